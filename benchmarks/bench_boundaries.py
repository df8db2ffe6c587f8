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

"""Boundaries of atlases against the closed formula, DDE-BIFTOOL and AUTO-07p, where installed.

The delayed network over c and tau: all curves of Hopf points against the formula, and points of
each against DDE-BIFTOOL (Octave, and its public repository in the folder that DDE_BIFTOOL names),
which follows them with all eight cells. The quadruped's pace over xi and alpha=beta: Hopf points
and folds against AUTO's (Debian: auto-07p and gfortran) curves in two parameters; torus points
against those that it finds on branches at two values of xi. Where one is missing, the result says
so.
"""

from collections.abc import Iterable
from dataclasses import replace
import os
from pathlib import Path
import shutil
import tempfile

from bench_peers import output_rows
from common import emit, log, ROOT
from cpg_ros.analysis.atlas.chart import chart_of, ParameterPlane
from cpg_ros.analysis.atlas.fold_curves import fold_curves
from cpg_ros.analysis.atlas.hopf_curves import Boundary, hopf_curves
from cpg_ros.analysis.atlas.orbit_curves import Edge, orbit_curves
from cpg_ros.dynamics.continuation import continue_orbit
from cpg_ros.dynamics.equilibrium import equilibrium
from cpg_ros.dynamics.orbit import Orbit
from cpg_ros.dynamics.solve_orbit import solve_orbit, solve_preset
from cpg_ros.networks.registry import PRESETS
from cpg_ros.networks.symmetry import GAITS
import numpy as np

#: Largest differences of a parameter. Mesh and tolerance of AUTO limit its folds and torus points.
TARGETS = {'formula': 1e-8, 'dde_biftool': 1e-8, 'auto': 1e-8}
#: Curves that AUTO must have met of each kind.
MET = {'HB': 1, 'LP': 3, 'TR': 2}
KINDS = {'HB': 'Hopf', 'LP': 'fold', 'TR': 'torus'}
#: Where on the branch of the pace, between its fold and rest, torus points lie. On the map another
#: orbit attracts there, so their curves begin here.
TORUS = ((0.21, 0.23), (0.139, 0.145))
DELAYED, PACE = PRESETS['delayed']['trot'].network, PRESETS['quadruped']['pace']


def formula(gait: str, c: float, tau: float, omega: float) -> float:
    """Distance in tau from the closed formula's curve of the class, at this c and near omega."""
    j, k = GAITS[gait]
    gaps = []
    for mode in {j, -j % 4}:
        own = DELAYED.a + DELAYED.b + DELAYED.d * 1j**-mode
        for sign in (1.0, -1.0):
            exact = own.imag + sign * np.sqrt(complex(c * c - own.real**2)).real
            if abs(exact - omega) > 1e-4:
                continue
            angle = -np.angle((1j * exact - own) / (c * (-1)**k)) % (2.0 * np.pi)
            turns = round((tau * exact - angle) / (2.0 * np.pi))
            gaps.append(abs((angle + 2.0 * np.pi * turns) / exact - tau))
    return min(gaps, default=np.inf)


def some(curve: Boundary, count: int) -> np.ndarray:
    """Numbers of points, evenly along a curve, without its ends."""
    return np.linspace(0, len(curve.points) - 1, count + 2).astype(int)[1:-1]


def dde_biftool(chart: ParameterPlane, curves: list[Boundary]) -> dict[str, object]:
    """Return the largest difference in c or tau, whichever is not held, and how many points."""
    place = os.environ.get('DDE_BIFTOOL', '')
    if not shutil.which('octave-cli'):
        return {'skipped': 'Octave is not installed (Debian: octave)'}
    if not Path(place, 'ddebiftool').is_dir():
        return {'skipped': 'DDE_BIFTOOL names no folder with DDE-BIFTOOL in it'}
    low = np.array([chart.first.low, chart.second.low])
    high = np.array([chart.first.high, chart.second.high])
    rows = []
    for number, curve in enumerate(curves):
        ahead = np.gradient(curve.points[:, :2], axis=0) / (high - low)
        for k in some(curve, 6):
            steep = abs(ahead[k, 1]) > abs(ahead[k, 0])
            rows.append([number, *GAITS[curve.gaits[0]], *curve.points[k], steep])
    mine = np.array(rows, dtype=float)
    with tempfile.TemporaryDirectory() as name:
        targets = Path(name) / 'targets.txt'
        np.savetxt(targets, mine, fmt='%.17g')
        os.environ.update(TARGETS=str(targets), LOW=f'{low.tolist()}', HIGH=f'{high.tolist()}',
                          PARAMETERS=f'{list(DELAYED.as_dict().values())}')
        found = output_rows(['octave-cli', '--norc', 'hopf.m'],
                            ROOT / 'benchmarks' / 'dde_biftool')
    theirs = np.array([[float(word) for word in row] for row in found])
    return {'difference': float(np.abs(theirs[:, 2:4] - mine[:, 3:5]).max()),
            'curves': len(curves), 'points': len(theirs), 'corrected': int(theirs[:, 1].sum())}


def of_pace() -> tuple[ParameterPlane, list[Boundary]]:
    """Return the plane of the pace, and curves of its Hopf points, folds and torus points."""
    chart = chart_of('quadruped', PACE.network, [('xi', (-0.02, 0.02)),
                                                 ('alpha=beta', (0.1, 0.65))], (9, 9))
    axis, orbit = chart.second, solve_preset(PACE)
    branch = continue_orbit(orbit, axis.line, axis.low, 0.25, most=80)

    def edge(orbit: Orbit, *values: float) -> Edge:
        (one, other) = ((value - axis.low) / (axis.high - axis.low) for value in values)
        theta = np.arange(65) / 65
        return Edge(np.array([0.5, one]), np.array([0.5, other]),
                    orbit(theta * orbit.period).tolist(), orbit.period)

    small = [edge(min(branch.at(one), key=lambda orbit: orbit.levels[0, 0, 1]), one, other)
             for one, other in TORUS]
    value = axis.line.value(PACE.network)
    return chart, [*hopf_curves(chart, ('pace',)),
                   *fold_curves((chart, 'pace', [edge(orbit, value, axis.low)])),
                   *orbit_curves((chart, 'pace', small))]


def auto(chart: ParameterPlane, curves: list[Boundary]) -> dict[str, object]:
    """Return the largest difference in alpha=beta for each kind, with how many points of what."""
    if not shutil.which('autox') or not shutil.which('gfortran'):
        return {'skipped': 'AUTO-07p is not installed (Debian: auto-07p, gfortran)'}
    wanted = {round(one, 12) for curve in curves if curve.kind != 'torus'
              for one in curve.points[some(curve, 4), 0]}
    torus = next(curve for curve in curves if curve.kind == 'torus')
    values = [0.0, *(float(one) for one in torus.points[some(torus, 1) // 2, 0])]
    axis, network = chart.second, PACE.network
    rest = equilibrium(chart.at(0.0, axis.low)).repeat(8)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for file in (ROOT / 'benchmarks' / 'auto07p').iterdir():
            shutil.copy(file, folder)
        theta, first = np.linspace(0.0, 1.0, 401), solve_preset(PACE)
        for k, xi in enumerate(values):
            orbit = solve_orbit(replace(network, xi=xi), 'pace', first)
            np.savetxt(folder / f'start{k}.dat', np.column_stack([
                theta * orbit.period, orbit(theta * orbit.period)]), fmt='%.15g')
        found = output_rows(['autox', 'boundaries.py', f'{axis.low},{axis.high}',
                      f'{chart.first.low},{chart.first.high}', joined(sorted(wanted)),
                      joined(network.as_dict().values()), str(axis.line.value(network)),
                      joined(rest), *(f'start{k}={xi!r}' for k, xi in enumerate(values))], folder)
    return {KINDS[kind]: compared([curve for curve in curves if curve.kind == KINDS[kind]], [
        (float(xi), float(value)) for label, xi, value in found if label == kind])
        for kind in MET}


def joined(values: Iterable[float]) -> str:
    return ','.join(repr(float(value)) for value in values)


def compared(curves: list[Boundary], points: list[tuple[float, float]]) -> dict[str, object]:
    """Differences of a peer's points from the points of curves with the same first value.

    AUTO also follows Hopf points of other gaits, and folds where no point of ours was chosen:
    what is far from all curves is theirs. That each curve was met is counted.
    """
    gaps: dict[int, list[float]] = {}
    for one, other in points:
        for number, curve in enumerate(curves):
            k = np.abs(curve.points[:, 0] - one).argmin()
            gap = abs(curve.points[k, 1] - other)
            if abs(curve.points[k, 0] - one) < 1e-8 and gap < 1e-3:
                gaps.setdefault(number, []).append(float(gap))
    return {'difference': max((max(each) for each in gaps.values()), default=float('nan')),
            'curves': len(gaps), 'points': sum(map(len, gaps.values()))}


def main() -> None:
    chart = chart_of('delayed', DELAYED, [('c', (2.0, 10.0)), ('tau', (0.2, 2.0))], (9, 9))
    log('curves of the delayed network')
    hopf = hopf_curves(chart, DELAYED.gaits())
    exact = max(formula(curve.gaits[0], *point) for curve in hopf for point in curve.points)
    log(f'{exact:.1e} from the formula; DDE-BIFTOOL')
    by_dde = dde_biftool(chart, hopf)
    log(f'{by_dde}; curves of the pace')
    plane, curves = of_pace()
    log(f'{[curve.kind for curve in curves]}; AUTO')
    by_auto = auto(plane, curves)
    emit(benchmark='boundaries', formula=exact, formula_curves=len(hopf),
         formula_points=sum(len(curve.points) for curve in hopf), dde_biftool=by_dde,
         auto=by_auto, targets=TARGETS, passed=bool(
             exact <= TARGETS['formula']
             and ('skipped' in by_dde or (by_dde['difference'] <= TARGETS['dde_biftool']
                                          and by_dde['corrected'] == by_dde['points']))
             and ('skipped' in by_auto or all(
                 by_auto[KINDS[kind]]['difference'] <= TARGETS['auto']
                 and by_auto[KINDS[kind]]['curves'] >= count for kind, count in MET.items()))))


if __name__ == '__main__':
    main()
