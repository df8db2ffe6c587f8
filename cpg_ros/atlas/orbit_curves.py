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

"""Curves of torus points, period doublings and branch points of a gait in two parameters.

On a curve the modulus of one multiplier is 1. Away from folds orbits are a function of both
parameters, and so is its logarithm g: the curve g = 0 is followed by steps along its tangent and
Newton's method normal to it.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import chain

from cpg_ros.atlas.chart import Chart, COARSE
from cpg_ros.atlas.grid_refinement import grid_indices, Sheet
from cpg_ros.atlas.hopf_condition import slopes
from cpg_ros.atlas.hopf_curves import Boundary
from cpg_ros.atlas.orbit_plane import OrbitPlane, spectrum
from cpg_ros.atlas.resonances import resonances
from cpg_ros.atlas.row_job import NONE, solve_from_wave
from cpg_ros.atlas.stability_losses import stability_losses
from cpg_ros.dynamics.bifurcation import REAL
from cpg_ros.dynamics.floquet import ATTRACTS
from cpg_ros.dynamics.orbit import NoOrbit
from cpg_ros.short_repr import ShortRepr
import numpy as np
from scipy.optimize import brentq

#: Curves of a gait at most, points of each, steps in shares of the ranges.
CURVES, MOST, STEP, SHORTEST = 6, 120, 0.03, 2e-3
#: How well g is zero, differences for its slope, and Newton's steps.
EXACT, DIFFERENCE, NEWTON = 1e-8, 1e-5, 8

Distance = Callable[[np.ndarray], float]


@dataclass(frozen=True, eq=False, repr=False)
class Edge(ShortRepr):
    """Two neighbours on the grid between which multipliers cross, in shares of the ranges."""

    here: np.ndarray
    there: np.ndarray
    wave: list[list[float]]
    period: float


def edges(chart: Chart, sheet: Sheet) -> list[Edge]:
    """Return neighbours on the coarse grid that differ in the number of unstable multipliers."""
    rows, columns = grid_indices(chart.first.count, COARSE), grid_indices(chart.second.count,
                                                                          COARSE)
    found = []
    for k, row in enumerate(rows):
        for m, column in enumerate(columns):
            for other in ((row, columns[m + 1]) if m + 1 < len(columns) else None,
                          (rows[k + 1], column) if k + 1 < len(rows) else None):
                at = (row, column)
                if other is None or at not in sheet.waves or sheet.label[other] == NONE:
                    continue
                if sheet.numbers['unstable'][at] != sheet.numbers['unstable'][other]:
                    found.append(Edge(chart.share(at), chart.share(other), *sheet.waves[at]))
    return found


def orbit_curves(job: tuple[Chart, str, list[Edge]]) -> list[Boundary]:
    """Follow the curves that some edges cross; those that cannot be followed are left out."""
    chart, gait, crossed = job
    found: list[Boundary] = []
    for edge in crossed:
        middle = 0.5 * (edge.here + edge.there)
        reach = np.abs(edge.here - edge.there).max()
        known = [(one.points[:, :2] - chart.low) / chart.size for one in found]
        if any(np.abs(points - middle).max(axis=1).min() < 1.5 * reach for points in known):
            continue
        try:
            found += _through(chart, gait, edge)
        except (NoOrbit, np.linalg.LinAlgError):
            continue
        if len(found) >= CURVES:
            break
    return found


def _through(chart: Chart, gait: str, edge: Edge) -> Iterator[Boundary]:
    plane = OrbitPlane(chart, gait)
    one, other = edge.here, edge.there
    plane.last = solve_from_wave(chart.at_share(one), gait, edge.wave, edge.period)
    before, after = spectrum(plane.last), spectrum(plane.orbit(other))
    for part, (left, right) in enumerate(zip(before, after, strict=True)):
        counts = [int((np.abs(some) >= ATTRACTS).sum()) for some in (left, right)]
        if counts[0] == counts[1]:
            continue
        rank = min(counts)

        def g(share: np.ndarray, part: int = part, rank: int = rank) -> float:
            orbit = plane.orbit(share)
            some = spectrum(orbit)[part]
            plane.last = orbit
            return float(np.log(np.abs(some[rank]))) if len(some) > rank else -10.0

        start = plane.last
        place = brentq(lambda s: g(one + s * (other - one)), 0.0, 1.0, xtol=1e-9)
        share = one + place * (other - one)
        crossing = complex(spectrum(plane.orbit(share))[part][rank])
        kind = ('torus' if abs(crossing.imag) > REAL else
                'branch point' if crossing.real > 0.0 else 'period doubling')
        at_share = plane.last
        ways, special = [], []
        for way in (-1.0, 1.0):
            plane.last = at_share
            ways.append([(new, plane.last) for new in _followed(g, share, way)])
            if kind == 'torus':
                plane.last = at_share
                along = [share, *(new for new, _ in ways[-1])]
                special.append([*resonances(plane, part, rank, along)][::int(way)])
        curve = [*ways[0][::-1], (share, at_share), *ways[1]]
        yield Boundary(kind, (gait,), chart.low + np.array([new for new, _ in curve]) * chart.size,
                       tuple(chain(*special)),
                       tuple(stability_losses(plane, part, rank, curve)))
        plane.last = start


def _followed(g: Distance, start: np.ndarray, way: float) -> Iterator[np.ndarray]:
    """Yield points of g = 0 from one on, until the plane ends or the orbit is lost."""
    here, step, count = start, STEP, 0
    normal = slopes(g, here, DIFFERENCE)
    tangent = way * np.array([-normal[1], normal[0]]) / np.linalg.norm(normal)
    while count < MOST and step > SHORTEST:
        try:
            new, across = _onto(g, here + step * tangent, normal)
        except (NoOrbit, np.linalg.LinAlgError):
            step *= 0.5
            continue
        ahead = np.array([-across[1], across[0]]) / np.linalg.norm(across)
        ahead *= np.sign(ahead @ tangent) or 1.0
        if (ahead @ tangent < 0.8 or np.linalg.norm(new - here) > 2.0 * step
                or (new < 0.0).any() or (new > 1.0).any()):
            # Beyond the edge, too: up to it by shorter steps.
            step *= 0.5
            continue
        here, tangent, normal = new, ahead, across
        yield here
        count, step = count + 1, min(1.5 * step, STEP)
        if count > 5 and np.linalg.norm(here - start) < 0.5 * STEP:
            break


def _onto(g: Distance, share: np.ndarray, normal: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Apply Newton's method normal to the curve; return the point on it and the slope of g."""
    for _ in range(NEWTON):
        value = g(share)
        if abs(value) < EXACT:
            return share, slopes(g, share, DIFFERENCE)
        unit = normal / np.linalg.norm(normal)
        along = (g(share + DIFFERENCE * unit) - value) / DIFFERENCE
        share = share - value / along * unit
    raise NoOrbit('the curve is lost')
