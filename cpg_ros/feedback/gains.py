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

"""The list of the feedback laws, and the switches and gains of all of them."""

from collections.abc import Sequence
from typing import Any

from cpg_ros.errors import InputError
from cpg_ros.feedback import (
    clearance,
    heading,
    pace,
    placement,
    posture,
    reflexes,
    sidestep,
    slope,
    speed,
    stiffen,
    tegotae,
    touchdown,
    virtual_stiffness,
)
from cpg_ros.feedback.law import Gain, Law, named_tuple

#: In the order in which parameters and the reference list them.
LAWS: Sequence[Law] = [module.LAW for module in (
    posture, placement, pace, stiffen, virtual_stiffness, reflexes, clearance, slope, heading,
    speed, sidestep, touchdown, tegotae)]
#: Gains of no single law.
COMMON = {'smooth': Gain(0.008, 0.08, 's',
                         'time constant with which every displacement is smoothed')}
#: All gains, by name.
GAINS: dict[str, Gain] = {name: gain for gains in (*(law.gains for law in LAWS), COMMON)
                          for name, gain in gains.items()}
_DEFAULTS = {**{law.name: law.on for law in LAWS},
             **{name: gain.default for name, gain in GAINS.items()}}
_Fields: Any = named_tuple('Gains', _DEFAULTS, _DEFAULTS.values())


class Gains(_Fields):  # type: ignore[misc]
    """Which laws are on, and their gains in SI units.

    The fields are the switches of LAWS by their names, then GAINS.
    """

    __slots__ = ()

    def check(self) -> None:
        """Raise InputError if a gain is outside its limits."""
        for name, gain in GAINS.items():
            value = getattr(self, name)
            if not gain.low <= value <= gain.high:
                raise InputError(f"gain '{name}' is {value:g}, but must be from {gain.low:g} to "
                                 f'{gain.high:g}' + (f' {gain.unit}' if gain.unit else ''))
