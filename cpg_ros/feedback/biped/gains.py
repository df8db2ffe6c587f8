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

"""Gains of a biped's feedback, those of its laws together."""

from collections.abc import Mapping
from typing import Any

from cpg_ros.errors import InputError
from cpg_ros.feedback.biped import clock, placement, stance, swing, velocity
from cpg_ros.feedback.law import Gain, named_tuple

GAINS: Mapping[str, Gain] = {name: gain for law in (clock, placement, stance, swing, velocity)
                             for name, gain in law.GAINS.items()}
_Fields: Any = named_tuple('BipedGains', GAINS, (gain.default for gain in GAINS.values()))


class BipedGains(_Fields):  # type: ignore[misc]
    """Gains in SI units, by the names of GAINS; defaults were found on a simulated Unitree G1."""

    __slots__ = ()

    @classmethod
    def of(cls, changes: Mapping[str, float]) -> 'BipedGains':
        """Return the usual gains with changes.

        Raises:
            InputError: no gain has this name, or it is not within its limits.

        """
        for name, value in changes.items():
            if name not in GAINS:
                raise InputError(f"biped.gains: '{name}' is not one of {', '.join(GAINS)}")
            gain = GAINS[name]
            if not gain.low <= value <= gain.high:
                raise InputError(f'biped.gains.{name}: {value:g} is not from {gain.low:g} to '
                                 f'{gain.high:g} {gain.unit}'.rstrip())
        return cls(**{name: float(value) for name, value in changes.items()})
