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

"""How branches of orbits end, and where: what lies beyond the last orbit is extrapolated.

Near an orbit that has no period, a homoclinic one, the period grows as ``-log|p - p0|``; near a
saddle-node on the cycle as ``|p - p0|^(-1/2)`` (Kuznetsov, *Elements of Applied Bifurcation
Theory*, chapters 6 and 7). In both laws what is left of the way follows from how fast the value
still moves as the period grows, at two places.
"""

from dataclasses import dataclass

import numpy as np

#: A branch that cannot be resolved any more has run into such an orbit if its period has grown
#: this many times over, and the value moves less than this share of its scale in a period.
GROWN, STILL = 3.0, 1e-2
#: A step in which the period grows by this share and the value moves by less than this one of its
#: scale is all that is left to see of such an end.
LONGER, ROUNDING = 0.01, 1e-9
#: The value's slope falls as the period to the power of -3 near a saddle-node; from this power on
#: its fall is taken for an exponential one.
STEEPER = 4.0


@dataclass(frozen=True)
class BranchEnd:
    """How a branch ends.

    Attributes:
        why: 'rest' (the amplitude falls to zero: a Hopf point), 'symmetry' (it runs into an
            orbit that has more of it, where it turns back as its own mirror image), 'period'
            (it grows without bound: near a homoclinic orbit), 'bound' (an end of the range),
            'steps', 'steep' (the waveform cannot be resolved), 'lost' (Newton's method fails
            however short the step), 'start' (it was not followed that way).
        value: where; of a Hopf point extrapolated to amplitude 0, of 'period' to no period.
        period: at the Hopf point; else that of the last orbit.

    """

    why: str
    value: float
    period: float

    def __str__(self) -> str:
        texts = {'rest': 'Hopf point', 'symmetry': 'orbit of more symmetry',
                 'bound': 'followed to',
                 'period': 'homoclinic end near', 'steps': 'not followed beyond', 'start':
                 'not followed from', 'steep': 'too steep beyond', 'lost': 'lost at'}[self.why]
        grows = ', period grows' if self.why == 'period' else ''
        return f'{texts} {self.value:.7g}{grows}'


def grows_alone(values: np.ndarray, periods: np.ndarray, scale: float) -> bool:
    """Whether from one point to the next the period grows and the value no longer moves."""
    return bool(len(values) > 1 and abs(np.diff(periods)) > LONGER * periods[0]
                and abs(np.diff(values)) < ROUNDING * scale)


def without_period(values: np.ndarray, periods: np.ndarray, scale: float) -> float | None:
    """Return the value towards which a branch's period grows without bound; None if not so.

    Args:
        values: of the parameter at the last points, shape (points,).
        periods: of the orbits there, shape (points,).
        scale: of the values.

    """
    if periods.size < 4 or not periods[-1] > GROWN * periods.min():
        return None
    slopes, middle = _slopes(values, periods)
    if not abs(slopes[-1]) * periods[-1] < STILL * scale:
        return None
    if _winds(slopes):
        # In ever smaller turns: the last one is the best estimate.
        return float(values[-1])
    fall = np.log(slopes[0] / slopes[2])
    power = fall / np.log(middle[2] / middle[0])
    if power <= 1.5:
        return None
    if power < STEEPER:
        last = slopes[2] * (middle[2] / periods[-1])**power
        return float(values[-1] + last * periods[-1] / (power - 1.0))
    rate = fall / (middle[2] - middle[0])
    last = slopes[2] * np.exp(-rate * (periods[-1] - middle[2]))
    return float(values[-1] + last / rate)


def law_of_growth(values: np.ndarray, periods: np.ndarray) -> str | None:
    """Return by which law a branch's period grows without bound, from its last points.

    Args:
        values: of the parameter, shape (points,).
        periods: of the orbits there, shape (points,).

    Returns:
        'homoclinic', 'SNIC' (a saddle node on the invariant circle), or None.

    """
    if periods.size < 4:
        return None
    slopes, middle = _slopes(values, periods)
    if _winds(slopes):
        return 'homoclinic'
    power = np.log(slopes[0] / slopes[2]) / np.log(middle[2] / middle[0])
    return None if power <= 1.5 else 'SNIC' if power < STEEPER else 'homoclinic'


def _slopes(values: np.ndarray, periods: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Derivatives of the value by the period between the last four points, and periods there."""
    return (np.diff(values[-4:]) / np.diff(periods[-4:]),
            0.5 * (periods[-4:-1] + periods[-3:]))


def _winds(slopes: np.ndarray) -> bool:
    """Whether the value winds in, or no longer moves."""
    return bool(not slopes.all() or (np.sign(slopes) != np.sign(slopes[-1])).any())
