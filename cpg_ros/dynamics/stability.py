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

"""Stability of a gait: whether it attracts, and with what symmetry gain."""

from dataclasses import dataclass

from cpg_ros.dynamics.floquet import leading_within, sufficient_gain
from cpg_ros.dynamics.periodic import Orbit

#: Decay that the chosen gain gives transverse disturbances, per model time.
RATE = 0.5


@dataclass(frozen=True)
class Stability:
    """What is known of an orbit's stability.

    Attributes:
        enough: symmetry gain (1/model time) that makes transverse disturbances decay.
        chosen: the gain to run with: that, with a margin.
        flaw: why the gait does not attract whatever the gain, or ''.

    """

    enough: float
    chosen: float
    flaw: str


def stability(orbit: Orbit) -> Stability:
    """Judge an orbit by its multipliers.

    Where the network knows a bound that holds in any of its states, the gain comes from that.
    """
    bound = orbit.network.sufficient_gain(RATE)
    if bound is None:
        enough, chosen = (sufficient_gain(orbit, rate) for rate in (0.0, RATE))
    else:
        enough = chosen = bound
    leading = leading_within(orbit)
    flaw = '' if leading < 1.0 else (
        f'a disturbance within its own symmetry class grows {leading:.4g} times a stride')
    return Stability(enough, chosen, flaw)
