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

"""Maps of gaits: against the Hopf formula, against other ways to the same, resumed and drawn."""

from dataclasses import replace
import json

import cpg_ros
from cpg_ros.analysis.atlas import atlas, fold_curves, grid
from cpg_ros.analysis.atlas import orbit_curves as curves
from cpg_ros.analysis.atlas.chart import chart_of
from cpg_ros.analysis.atlas.grid import (
    assess_row,
    AtlasRow,
    GaitMap,
    LOCKED,
    NONE,
    refine,
    uncrossed_edges,
)
from cpg_ros.analysis.atlas.hopf_curves import curves_from, hopf_curves, hopf_starts
from cpg_ros.analysis.atlas.map import LABEL_NAMES
from cpg_ros.common.errors import InputError
from cpg_ros.dynamics.continuation import continue_orbit
from cpg_ros.dynamics.floquet import Multipliers, multipliers
from cpg_ros.dynamics.solve_orbit import solve_orbit, solve_preset
from cpg_ros.networks.network import ParameterLine
from cpg_ros.networks.registry import PRESETS
from cpg_ros.networks.symmetry import GAITS
import numpy as np
import pytest
from scipy.optimize import brentq

parquet = pytest.importorskip('pyarrow.parquet')
TROT = PRESETS['delayed']['trot'].network
OVER = [('c', (4.0, 8.0)), ('tau', (0.2, 1.2))]


def critical(c, j, k, fast, n):
    """Omega and tau_n of the class (j, k) at a, b, d of the trot."""
    real = TROT.a + TROT.b + (TROT.d * 1j**-j).real
    imaginary = (TROT.d * 1j**-j).imag
    omega = imaginary + (1 if fast else -1) * np.sqrt(c * c - real * real)
    z = (1j * omega - complex(real, imaginary)) / (c * (-1)**k)
    return omega, ((-np.angle(z)) % (2 * np.pi) + 2 * np.pi * n) / omega


def test_curves_of_hopf_points_are_those_of_the_formula():
    found = hopf_curves(chart_of('delayed', TROT, OVER, (9, 9)), TROT.gaits())
    assert {gait for curve in found for gait in curve.gaits} >= {
        'trot', 'walk', 'pace', 'jump', 'bound'}
    for curve in found:
        assert len(curve.points) > 5
        (gait,) = curve.gaits
        j, k = GAITS[gait]
        for c, tau, omega in curve.points[::7]:
            gaps = [abs(critical(c, mode, k, fast, n)[1] - tau)
                    for mode in ({1, 3} if j == 1 else {j}) for fast in (True, False)
                    for n in range(4) if abs(critical(c, mode, k, fast, n)[0] - omega) < 1e-6]
            assert min(gaps) < 1e-8


@pytest.mark.deep
@pytest.mark.parametrize('order', [-1, 1])
def test_a_curve_across_the_plane_is_found_whichever_axis_comes_first(order):
    """A trot of Hopf oscillators is born at mu = -3/(alpha + 50), flat and steep by turns.

    The trace of its block at rest is (alpha + beta) mu + 3 k, with beta = 50 and k = 1 of the
    preset.
    """
    trot = PRESETS['hopf']['trot'].network
    chart = chart_of('hopf', trot, [('mu', (-1.0, 2.0)), ('alpha', (1.0, 10.0))][::order], (9, 9))
    (curve,) = hopf_curves(chart, ('trot',))
    mu, alpha = curve.points[:, :2].T[::order]
    assert mu == pytest.approx(-3.0 / (alpha + 50.0), abs=1e-9)
    assert alpha.min() < 1.01
    assert alpha.max() > 9.99


@pytest.mark.deep
def test_classes_with_the_same_eigenvalues_share_a_curve():
    """In Matsuoka's with the trot's equal weights pace, bound and pronk are born together."""
    trot = PRESETS['matsuoka']['trot'].network
    chart = chart_of('matsuoka', trot, [('a', (1.0, 5.0)), ('beta', (1.0, 5.0))], (9, 9))
    (curve,) = hopf_curves(chart, trot.gaits())
    assert set(curve.gaits) == {'pace', 'bound', 'pronk'}
    assert str(curve) == f'Hopf of {" and ".join(curve.gaits)}'


def test_edges_whose_verdicts_differ_are_searched_where_no_curve_is_known():
    trot = PRESETS['hopf']['trot'].network
    chart = chart_of('hopf', trot, [('mu', (-1.0, 2.0)), ('alpha', (1.0, 10.0))], (17, 9))
    sheet = GaitMap((17, 9))
    sheet.label[:] = np.where(chart.first.values < 0.0, NONE, LOCKED)[:, None]
    edges = [*uncrossed_edges(chart, 'trot', sheet, ())]
    assert [(edge.axis, edge.low, edge.high) for edge in edges] == [(0, -1.0, 0.5)] * 2
    (curve,) = curves_from(chart, [start for edge in edges for start in hopf_starts(edge)])
    assert [*uncrossed_edges(chart, 'trot', sheet, [curve])] == []


def test_a_row_is_where_the_formula_says_and_as_orbits_alone_are():
    chart = chart_of('delayed', TROT, OVER, (9, 33))
    found = assess_row(AtlasRow(chart, 'trot', 5, tuple(range(0, 33, 4))))
    for one in found:
        tau = chart.second.values[one['column']]
        assert (one['label'] != NONE) == (tau > critical(6.5, 2, 1, True, 0)[1])
    one = found[4]
    orbit = solve_orbit(replace(TROT, c=6.5, tau=float(chart.second.values[16])), 'trot')
    judged = multipliers(orbit)
    assert one['label'] == LOCKED
    assert one['period'] == pytest.approx(orbit.period, rel=1e-9)
    assert one['leading'] == pytest.approx(judged.leading, rel=1e-4)
    assert one['unstable'] == judged.unstable == (np.abs(judged.transverse) >= 1.0).sum()


def test_a_multiplier_of_1_to_within_its_error_is_no_verdict(monkeypatch):
    chart = chart_of('delayed', TROT, OVER, (9, 33))
    monkeypatch.setattr(grid, 'multipliers', lambda orbit, **_: Multipliers(
        orbit.period, 0.0, np.array([1.0 + 3e-9]), 1.0 + 0.0j, (np.array([0.5]),)))
    (point,) = assess_row(AtlasRow(chart, 'trot', 5, (16,)))
    assert LABEL_NAMES[point['label']] == 'cannot tell'


def test_a_neutral_multiplier_that_rounding_puts_below_1_crosses_nothing(monkeypatch):
    # With d = 0 the rings are uncoupled, and a shift of one against the other is neutral.
    chart = chart_of('delayed', replace(TROT, d=2.0), [('d', (0.0, 1.0)), ('tau', (0.3, 0.5))],
                     (9, 9))
    orbit = solve_orbit(chart.at(0.0, 0.4), 'walk')
    wave = orbit(np.arange(65) / 65 * orbit.period).tolist()
    monkeypatch.setattr(curves, 'spectrum', lambda orbit: [
        np.array([0.8 if orbit.network.d else 1.0 - 1e-12])])
    edge = curves.Edge(np.array([0.0, 0.5]), np.array([0.25, 0.5]), wave, orbit.period)
    assert curves.orbit_curves((chart, 'walk', [edge])) == []


def test_a_torus_curve_has_a_pair_on_the_unit_circle(monkeypatch):
    monkeypatch.setattr(curves, 'MAX_POINTS', 2)
    chart = chart_of('delayed', TROT, OVER, (9, 9))
    found = curves.orbit_curves((chart, 'walk', [curves.Edge(
        np.array([5 / 8, 0.3]), np.array([5 / 8, 0.5]), *_wave(chart, 0.3))]))
    for curve in found:
        for c, tau in curve.points:
            judged = multipliers(solve_orbit(replace(TROT, c=float(c), tau=float(tau)), 'walk'))
            sizes = np.abs(np.concatenate([judged.within, judged.transverse]))
            assert np.abs(sizes - 1.0).min() < 1e-6
    assert [curve.kind for curve in found] == ['torus']


def test_a_curve_of_folds_is_where_branches_turn(monkeypatch):
    preset = PRESETS['quadruped']['pace']
    line = ParameterLine.parse('alpha=beta', type(preset.network))

    def fold_of(orbit):
        (fold,) = continue_orbit(orbit, line, 0.1, 0.2, most=40, first_step=0.1).folds
        return fold

    first = fold_of(solve_preset(preset))
    # AUTO-07p's.
    assert first.value == pytest.approx(0.1367076463, abs=1e-9)
    chart = chart_of('quadruped', preset.network, [('xi', (-0.05, 0.05)),
                                                   ('alpha=beta', (0.1, 0.2))], (9, 9))
    monkeypatch.setattr(fold_curves, 'MIN_STEP', 0.02)
    found = fold_curves.continue_fold(chart, first.curve_point, 0.0, 1.0)
    assert len(found) >= 10
    xi, fold = found[3]
    network = replace(preset.network, xi=xi)
    assert fold_of(solve_orbit(network, 'pace', solve_preset(preset))).value == pytest.approx(
        fold.value, abs=1e-9)


def _wave(chart, fraction):
    tau = chart.second.low + fraction * (chart.second.high - chart.second.low)
    orbit = solve_orbit(replace(TROT, c=6.5, tau=tau), 'walk')
    return orbit(np.arange(65) / 65 * orbit.period).tolist(), orbit.period


@pytest.fixture(scope='module')
def drawn(tmp_path_factory):
    out = tmp_path_factory.mktemp('atlas') / 'out'
    words = ['--over', 'c=4:8', 'tau=0.2:0.8', '--points', '7x7', '--gait', 'trot', 'pace',
             '--jobs', '1', '--interactive', '--out', str(out)]
    assert atlas.main(words) == 0
    return out, words


def test_the_table_agrees_with_the_formula_everywhere(drawn):
    table = parquet.read_table(drawn[0] / 'atlas.parquet').to_pylist()
    assert len(table) == 2 * 7 * 7
    for row in table:
        j, k = GAITS[row['gait']]
        real = abs(TROT.a + TROT.b + (TROT.d * 1j**-j).real)
        threshold = critical(row['c'], j, k, True, 0)[1] if row['c'] > real else np.inf
        if abs(row['tau'] - threshold) > 0.02:
            assert row['exists'] == (row['tau'] > threshold), row
    assert 0 < sum(row['computed'] for row in table) < len(table)


def test_it_goes_on_where_it_stopped_and_ends_with_the_same(drawn):
    out, words = drawn
    before = (out / 'atlas.parquet').read_bytes()
    parts = sorted((out / 'parts').iterdir())
    for part in parts[::2]:
        part.unlink()
    assert atlas.main(words) == 0
    assert (out / 'atlas.parquet').read_bytes() == before
    assert sorted((out / 'parts').iterdir()) == parts
    assert atlas.main([*words, '--set', 'a=-4']) == 2


def test_the_page_is_one_file_with_everything_in_it(drawn):
    page = (drawn[0] / 'index.html').read_text()
    assert 'src=' not in page
    assert 'href=' not in page
    told = json.loads(page.split('id="atlas">')[1].split('</script>')[0])
    assert told['counts'] == [7, 7]
    assert set(told['gaits']) == {'trot', 'pace'}
    assert told['gaits']['trot']['waves']


def test_points_of_codimension_two_are_listed_and_marked(drawn):
    """The trot and the walk are born together where their formulas meet."""
    c = brentq(lambda c: critical(c, 2, 1, True, 0)[1] - critical(c, 1, 1, True, 0)[1], 6.0, 7.5)
    stored = json.loads((drawn[0] / 'boundaries.json').read_text())
    (point,) = (point for curve in stored for point in curve['codimension_two']
                if (point['type'], point['gait'], point['other']) == (
                    'Hopf-Hopf', 'trot', ['walk']))
    assert point['values'] == pytest.approx([c, critical(c, 2, 1, True, 0)[1]], abs=1e-9)
    told = json.loads((drawn[0] / 'index.html').read_text().split('id="atlas">')[1].split(
        '</script>')[0])
    assert [*point['values'], 'HH'] in told['gaits']['trot']['special']


@pytest.mark.parametrize('count', [2, 3, 9, 12, 20, 200])
def test_a_grid_of_any_size_is_halved_until_it_is_whole(count):
    chart = chart_of('delayed', TROT, OVER, (count, 9))
    assert chart.first.indices(1) == list(range(count))

    def run(jobs, number):
        for row in jobs:
            yield row, [{'row': row.row, 'column': column, 'label': int(3 * row.row > count)}
                        for column in row.columns]
    (sheet,) = refine(chart, ('trot',), (), run).values()
    assert (sheet.label == (3 * np.arange(count) > count)[:, None]).all()


@pytest.mark.deep
def test_a_gait_that_is_born_on_a_steep_curve_is_found_beside_it():
    """Which no row of the coarse grid meets: from c = 3.6 at tau = 0.2 to 3.74 at 0.5."""
    chart = chart_of('delayed', TROT, [('c', (3.0, 5.0)), ('tau', (0.2, 0.5))], (17, 5))

    def run(jobs, number):
        for row in jobs:
            yield row, assess_row(row)
    (sheet,) = refine(chart, ('jump',), hopf_curves(chart, ('jump',)), run).values()
    for k, tau in enumerate(chart.second.values):
        # The slow wave of the class, where its delay is the first critical one at this c.
        born = brentq(lambda c, tau=tau: critical(c, 1, 0, False, 0)[1] - tau, 3.55, 3.9)
        assert ((sheet.label[:, k] != NONE) == (chart.first.values > born)).all()


@pytest.mark.parametrize(('over', 'said'), [
    ([('c', (4.0, 4.0)), ('tau', (0.2, 1.0))], 'c: 4 is not below 4'),
    ([('c', (4.0, 50.0)), ('tau', (0.2, 1.0))], 'c: 50 is not within -20 to 20'),
    ([('e', (4.0, 5.0)), ('tau', (0.2, 1.0))], "'e' is not one of"),
    ([('c', (4.0, 5.0)), ('c', (0.2, 1.0))], 'c and c move the same parameter')])
def test_planes_that_cannot_be(over, said):
    with pytest.raises(InputError, match=said):
        chart_of('delayed', TROT, over, (9, 9))


def test_a_group_can_be_set_as_for_analyze(capsys):
    words = ['--network', 'biped', '--preset', 'run', '--over', 'current=0.1:0.3', 'phi=0.2:0.4']
    chart, _ = atlas._planned(atlas._parser().parse_args([*words, '--set', 'w_a=0.3']))
    for name, value in PRESETS['biped']['run'].network.as_dict().items():
        assert chart.base[name] == (0.3 if name in ('w_21', 'w_12', 'w_43', 'w_34') else value)
    for given, said in ((['w_a=0.3', 'w_21=0.2'], 'w_21 is given twice'),
                        (['speed=1'], "'speed' is not a parameter of the biped network"),
                        (['w_a=inf'], 'it must be finite')):
        assert atlas.main([*words, '--set', *given]) == 2
        assert said in capsys.readouterr().err


def test_an_atlas_in_python_is_that_of_the_executable_as_tables(drawn, tmp_path):
    found = cpg_ros.atlas(TROT, {'c': (4.0, 8.0), 'tau': (0.2, 0.8)}, ('trot', 'pace'), (7, 7),
                          drawn[0])
    table, written = found.table(), parquet.read_table(drawn[0] / 'atlas.parquet').to_pydict()
    assert list(table) == list(written)
    for name, column in written.items():
        np.testing.assert_array_equal(
            table[name], np.array([np.nan if value is None else value for value in column]))
    np.savez(tmp_path / 'atlas.npz', **table)
    with np.load(tmp_path / 'atlas.npz') as again:
        np.testing.assert_array_equal(again['leading'], table['leading'])
    lines = found.boundary_table()
    assert lines['boundary'].max() + 1 == len(found.boundaries)
    hopf = (lines['kind'] == 'Hopf') & (lines['gaits'] == 'trot')
    _, tau = critical(lines['c'][hopf], 2, 1, True, 0)
    assert np.isclose(lines['tau'][hopf], tau, atol=1e-6).any()


def test_an_atlas_in_python_takes_two_parameters_of_a_known_network():
    with pytest.raises(InputError, match='over two parameters, not 1'):
        cpg_ros.atlas(TROT, {'c': (4.0, 8.0)})
    with pytest.raises(InputError, match="'gallop' is not one of"):
        cpg_ros.atlas(TROT, dict(OVER), ('gallop',))
