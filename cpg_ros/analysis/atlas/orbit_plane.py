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

"""Orbits over the plane of an atlas, and whether their losses of stability are supercritical."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from cpg_ros.analysis.atlas.chart import ParameterPlane
from cpg_ros.dynamics.arclength import NoOrbit
from cpg_ros.dynamics.floquet import multipliers
from cpg_ros.dynamics.fourier.floquet import Accuracy
from cpg_ros.dynamics.orbit import Orbit
from cpg_ros.dynamics.orbit_normal_form import loses_stability, orbit_normal_form
from cpg_ros.dynamics.solve_orbit import solve_beside
import numpy as np

#: Accuracy of multipliers on curves.
ACCURACY = Accuracy(4, 1e-12, 1e-8, 5)


def spectrum(orbit: Orbit) -> list[np.ndarray]:
    """Multipliers of each subspace, largest first; the class comes first, without 1."""
    return multipliers(orbit, accuracy=ACCURACY).subspaces


class OrbitPlane:
    """Orbits over the plane, each solved beside the last one."""

    def __init__(self, chart: ParameterPlane, gait: str) -> None:
        """Take the plane; the first orbit is set as the last."""
        self.chart, self.gait = chart, gait
        self.last: Orbit | None = None

    def orbit(self, fraction: np.ndarray) -> Orbit:
        """Solve at a point given in fractions of the ranges.

        Raises:
            NoOrbit: there is none beside the last one.

        """
        assert self.last is not None
        solved = solve_beside(self.chart.at_fractions(fraction), self.last)
        if solved.levels[0, 0, 1] < 0.3 * self.last.levels[0, 0, 1]:
            raise NoOrbit('the orbit has shrunk')
        return solved


#: Points on a curve at which the normal form is computed.
POINTS = 5


@dataclass(frozen=True)
class LossOnCurve:
    """The normal form's verdict at a point of a curve.

    Attributes:
        values: on both axes.
        soft: whether the motion that branches off attracts; None if the form does not decide.
        why: reason why it does not decide, or ''.

    """

    values: tuple[float, float]
    soft: bool | None
    why: str = ''


def stability_losses(plane: OrbitPlane, part: int, rank: int,
                     curve: Sequence[tuple[np.ndarray, Orbit]]) -> Iterator[LossOnCurve]:
    """Yield the normal forms at evenly spaced points of a curve.

    Points at which other multipliers are outside the unit circle are left out: there the gait is
    unstable on both sides.

    Args:
        plane: of the curve.
        part: index of the subspace in which a multiplier crosses the unit circle.
        rank: of the multiplier in it, by size.
        curve: its points in fractions of the ranges, and orbits beside them.

    """
    indices = np.unique(((np.arange(POINTS) + 0.5) / POINTS * len(curve)).astype(int))
    for fraction, beside in (curve[k] for k in indices):
        plane.last = beside
        try:
            orbit = plane.orbit(fraction)
        except NoOrbit:
            continue
        if loses_stability(orbit):
            multiplier = complex(spectrum(orbit)[part][rank])
            form = orbit_normal_form(orbit, multiplier, part)
            yield LossOnCurve(plane.chart.values_at(fraction), form.soft, form.why)
