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
from typing import Any

from cpg_ros.analysis.atlas.chart import ParameterPlane
from cpg_ros.analysis.atlas.row_job import subspace_multipliers
from cpg_ros.dynamics.arclength import NoOrbit
from cpg_ros.dynamics.orbit import Orbit
from cpg_ros.dynamics.orbit_normal_form import loses_stability, orbit_normal_form
from cpg_ros.dynamics.solve_orbit import solve_beside
import numpy as np

# A gait's orbits over the plane of an atlas, and their multipliers by subspace.

#: ARNOLDI: relative tolerance of multipliers; TRIVIAL: largest error of the trivial multiplier;
#: HALVINGS: most halvings of the elements.
ARNOLDI, TRIVIAL, HALVINGS = 1e-12, 1e-8, 5


def spectrum(orbit: Orbit) -> list[np.ndarray]:
    """Multipliers of each subspace, largest first; that of the class first, without 1."""
    return subspace_multipliers(orbit, ARNOLDI, TRIVIAL, HALVINGS)


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


#: PLACES: number of places on a curve at which the normal form is computed.
PLACES = 5


@dataclass(frozen=True)
class LossOnCurve:
    """The normal form's verdict at a point of a curve.

    Attributes:
        values: on both axes.
        soft: whether what leaves the gait attracts; None if the normal form cannot tell.
        why: it cannot.

    """

    values: tuple[float, float]
    soft: bool | None
    why: str = ''

    @staticmethod
    def of(stored: dict[str, Any]) -> 'LossOnCurve':
        """Return it from what as_dict has made."""
        first, second = stored['values']
        return LossOnCurve((first, second), stored['soft'], stored['why'])

    def as_dict(self) -> dict[str, Any]:
        """Return it as plain types."""
        return {'values': list(self.values), 'soft': self.soft, 'why': self.why}


def stability_losses(plane: OrbitPlane, part: int, rank: int,
                     curve: Sequence[tuple[np.ndarray, Orbit]]) -> Iterator[LossOnCurve]:
    """Yield the verdicts at places spread evenly over the points of a curve.

    Places where other multipliers are outside the unit circle are left out: there the gait is not
    stable on either side.

    Args:
        plane: of the curve.
        part: number of the subspace in which a multiplier crosses the unit circle.
        rank: how many larger ones that has.
        curve: its points in fractions of the ranges, and orbits beside them.

    """
    indices = np.unique(((np.arange(PLACES) + 0.5) / PLACES * len(curve)).astype(int))
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
