# Copyright 2026 cpg_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""What the feedback keeps from tick to tick: the estimate, the laws' state, its output."""

from typing import Any

from cpg_ros.feedback.efference_copy import SIGNALS
from cpg_ros.feedback.gains import LAWS
from cpg_ros.feedback.law import named_tuple, StateVariable
import numpy as np

#: State that is no single law's.
COMMON = {
    'velocity': StateVariable('of the base in its own frame [m/s]', (3,)),
    'contact': StateVariable('whether each foot is on the ground', ('legs',), False),
    'doubt': StateVariable('for how long the legs on the ground have disagreed with the velocity '
                           '[s]'),
    'displacement': StateVariable('of each foot, smoothed [m]', ('legs', 3)),
    'stride': StateVariable("to be added to each leg's stride", ('legs',)),
    'frequency_scale': StateVariable('factor of the stride frequency', (), 1.0),
    'last_phase': StateVariable('of the first leg at the last tick [cycles]'),
    'wanted_velocity': StateVariable('forward and to the left as it is approached [m/s], and in a '
                                     'second row its rate [m/s^2]', (2, 2))}
VARIABLES = {name: variable for part in (COMMON, *(law.memory for law in LAWS))
             for name, variable in part.items()}
#: Arrays without an axis of the runs, which pass values on within a tick.
SCRATCH = {
    'previous_contact': StateVariable('contact before this tick', ('legs',), False),
    'leg_velocities': StateVariable("see estimate.update; then the planned feet's places [m]",
                                    ('legs', 4)),
    'scratch': StateVariable('see estimate.update', (4, 3)),
    'expected': StateVariable('signals of the efference copy', (SIGNALS,))}
_Fields: Any = named_tuple('Memory', [*VARIABLES, *SCRATCH])


class Memory(_Fields):  # type: ignore[misc]
    """Arrays of VARIABLES, whose first axis is that of the runs, and of SCRATCH."""

    __slots__ = ()

    @classmethod
    def empty(cls, runs: int, legs: int) -> 'Memory':
        """Return the memory of robots that have not moved yet."""
        def array(variable: StateVariable, *first: int) -> np.ndarray:
            shape = [legs if size == 'legs' else int(size) for size in variable.shape]
            return np.full((*first, *shape), variable.initial)

        return cls(*(array(one, runs) for one in VARIABLES.values()),
                   *(array(one) for one in SCRATCH.values()))
