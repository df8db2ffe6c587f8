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

"""What legs do besides their phases: walk on, step on the spot, turn, or run.

The two joints of a leg that move most go round a loop: a foot is lifted on its way forward and set
down on its way back. The loop has an area, and its sense is that of the travel. On the spot
hip and knee go to and fro on one path; in a turn the legs of one side go round the other way.

Running is told from walking by hips and knees, thigh and shank taken for equally long: by how much
of a stride the foot moves back with the ground, how much the knee is bent where the foot passes
below the hip, and how far it bends in between.
"""

from collections.abc import Collection, Mapping, Sequence

from cpg_ros.gaits.leg_names import role_of, words_of
from cpg_ros.gaits.quality_checks import QualityIssue
import numpy as np

#: Area of a loop over that of an ellipse of the same amplitudes, a quarter of a cycle apart: below
#: the first there is no telling from a path, above the second the sense is sure.
PATH, SURE = 0.25, 0.4
#: Joints that move by less than this share of what the leg's first one does tell nothing.
MOVES = 0.1
#: Foot that moves with the ground: back, by this share of its fastest.
GROUND = 0.5
#: Share of the stride, knee at mid-stance and most bent knee (rad) half-way between walk and run,
#: and what changes the odds by e. People walk with 0.5 to 0.65, below 0.2 and 0.9 to 1.1, and run
#: with 0.25 to 0.45, above 0.3 and 1.4 to 2.2.
BETWEEN, ODDS = np.array([0.48, 0.22, 1.25]), np.array([-0.06, 0.06, 0.15])
#: Most that the odds may say: who limps or marches is none of these (e to this power).
MOST = 5.0
#: Points of a cycle.
POINTS = 256


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


def running_probability(legs: Mapping[str, Sequence[str]],
                        c: Mapping[str, np.ndarray]) -> float | None:
    """Return the probability that two legs run rather than walk; None where nothing tells.

    Args:
        legs: leg -> its joints; hips and knees are told from their names.
        c: joint -> Fourier coefficients of its mean cycle, complex, shape (n + 1,).

    """
    features = []
    for listed in legs.values():
        pair = []
        for role in ('hip', 'knee'):
            found = [name for name in listed if role in words_of(name)]
            if not found:
                return None
            name = max(found, key=lambda one: float(np.sum(np.abs(c[one][1:])**2)))
            turns = np.exp(2j * np.pi * np.outer(np.arange(POINTS) / POINTS,
                                                 np.arange(c[name].size)))
            pair.append(c[name][0].real + 2.0 * (turns[:, 1:] @ c[name][1:]).real)
        features.append(_step(*pair))
    odds = float(np.sum((np.mean(features, axis=0) - BETWEEN) / ODDS))
    return float(1.0 / (1.0 + np.exp(-np.clip(odds, -MOST, MOST))))


def _step(hip: np.ndarray, knee: np.ndarray) -> tuple[float, float, float]:
    """Return share of the stride on the ground, knee at mid-stance, and its largest bend."""
    knee = knee if knee.mean() >= 0.0 else -knee
    best = (-np.inf, 0.0, 0.0)
    for sense in (1.0, -1.0):
        x = np.sin(sense * hip) + np.sin(sense * hip - knee)
        length = np.cos(sense * hip) + np.cos(sense * hip - knee)
        speed = 0.5 * (np.roll(x, -1) - np.roll(x, 1))
        # The foot is low on its way back.
        low = float(np.mean(speed * (length.mean() - length)))
        if low > best[0]:
            ground = speed < GROUND * np.quantile(speed, 0.1)
            middle = ground & (np.abs(x) <= 0.1 * np.ptp(x))
            best = (low, float(np.mean(ground)),
                    float(knee[middle].min()) if middle.any() else float(knee[ground].min()))
    return best[1], best[2], float(knee.max())
