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

"""What legs do besides their phases: walk on, step on the spot, or turn.

The two joints of a leg that move most go round a loop: a foot is lifted on its way forward and set
down on its way back. The loop has an area, and its sense is that of the travel. On the spot
hip and knee go to and fro on one path; in a turn the legs of one side go round the other way.
"""

from collections.abc import Collection, Mapping, Sequence

from cpg_ros.gaits.leg_names import role_of
from cpg_ros.gaits.quality_checks import QualityIssue
import numpy as np

#: Area of a loop over that of an ellipse of the same amplitudes, a quarter of a cycle apart: below
#: the first there is no telling from a path, above the second the sense is sure.
PATH, SURE = 0.25, 0.4
#: Joints that move by less than this share of the motion of the leg's first one are ignored.
MOVES = 0.1


def _area(a: np.ndarray, b: np.ndarray) -> float:
    """Signed area of the loop of two joints, 1 for an ellipse a quarter of a cycle apart."""
    n = np.arange(1, a.size)
    sizes = np.sum(n * np.abs(a[1:])**2) * np.sum(n * np.abs(b[1:])**2)
    return float(np.sum(n * (a[1:].conj() * b[1:]).imag) / max(np.sqrt(sizes), 1e-300))


def _loops(legs: Mapping[str, Sequence[str]], c: Mapping[str, np.ndarray]
           ) -> tuple[dict[str, float], set[str]]:
    """Return areas of the loops of two joints that all legs have, and these joints' names.

    Of those the two that move most; nothing if there are none.
    """
    roles = [{role_of(name): name for name in listed} for listed in legs.values()]
    power = {role: sum(float(np.sum(np.abs(c[own[role]][1:])**2)) for own in roles)
             for role in sorted(set.intersection(*map(set, roles)))}
    most = sorted(power, key=lambda role: -power[role])[:2]
    if len(most) < 2 or power[most[1]] < MOVES**2 * power[most[0]]:
        return {}, set()
    return ({leg: _area(*(c[own[role]] for role in sorted(most)))
             for leg, own in zip(legs, roles, strict=True)},
            {own[role] for own in roles for role in most})


def check_travel(legs: Mapping[str, Sequence[str]], c: Mapping[str, np.ndarray],
                 girdles: Mapping[str, str], opposite: Collection[str]) -> list[QualityIssue]:
    """Doubt a gait that goes nowhere, or round.

    Args:
        legs: leg -> its joints.
        c: joint -> Fourier coefficients of its mean cycle, complex, shape (n + 1,).
        girdles: leg -> fore or hind, where the legs have these.
        opposite: joints that count angles in the opposite sense of the first leg's.

    """
    loops, joints = _loops(legs, c)
    if not loops:
        return []
    if max(map(abs, loops.values())) < PATH:
        return [QualityIssue('the joints of each leg go to and fro on one path: the legs step, '
                             'or hop, on the spot', 0.5)]
    # Fore and hind knees may bend in opposite senses: legs are compared across the body.
    across: dict[str, list[float]] = {}
    for leg, area in loops.items():
        across.setdefault(girdles.get(leg, ''), []).append(area)
    if not joints & set(opposite) and all(
            min(own) < -SURE and max(own) > SURE for own in across.values()):
        return [QualityIssue('the legs of one side step forward and those of the other back: it '
                             'turns on the spot', 0.3)]
    return []
