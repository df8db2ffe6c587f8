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

"""Whether the generator can run a gait at all, whatever the robot."""

from dataclasses import dataclass

from cpg_ros.dynamics.periodic import Orbit
from cpg_ros.dynamics.stability import Stability
from cpg_ros.motion.joint_readout import joint_readout
from cpg_ros.motion.readout import NoPhase
import numpy as np

#: A period needs this many steps for the integrator to stay on the orbit.
STEPS_A_PERIOD = 40


@dataclass(frozen=True)
class Obstacle:
    """Why the generator cannot run a gait.

    Attributes:
        message: of a gait that is named, such as 'has a period of ...'.
        aside: the same of one that has been named, in fewer words, such as 'its period of ...'.

    """

    message: str
    aside: str


def obstacle(orbit: Orbit, judged: Stability, harmonics: int) -> Obstacle | None:
    """Find why the generator cannot run a gait: its period, its stability, or its waveform.

    Args:
        orbit: the gait's.
        judged: its stability.
        harmonics: of a Morris-Lecar cell's waveform that joints follow.

    """
    shortest = STEPS_A_PERIOD * orbit.network.step
    if orbit.period < shortest:
        period = f'period of {orbit.period:.3g} model time units'
        return Obstacle(f'has a {period}, too short for steps of {orbit.network.step}: at least '
                        f'{shortest:g} is needed', f'its {period} is below {shortest:g}')
    if judged.flaw:
        return Obstacle(f'exists at these parameters but does not attract: {judged.flaw}',
                        f'it does not attract: {judged.flaw}')
    try:
        joint_readout(orbit, np.empty(0, int), np.empty((0, 6)), np.zeros(1, int), harmonics)
    except NoPhase as error:
        return Obstacle(f'at these parameters cannot drive joints: {error}',
                        f'it cannot drive joints: {error}')
    return None
