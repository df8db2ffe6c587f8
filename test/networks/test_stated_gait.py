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

"""A gait that is found has the phases of its name, whatever parameters it was asked for at."""

from collections import Counter
import json

from cpg_ros.analysis.analysis_plot import colours
from cpg_ros.analysis.analyze import main as analyze
from cpg_ros.analysis.atlas.chart import chart_of
from cpg_ros.analysis.atlas.grid import assess_row, AtlasRow, NONE, STABLE
from cpg_ros.analysis.atlas.hopf_curves import hopf_curves
from cpg_ros.dynamics.arclength import NoOrbit
from cpg_ros.dynamics.equilibrium import equilibrium, NoEquilibrium
from cpg_ros.dynamics.integration.simulate import simulate
from cpg_ros.dynamics.solve_orbit import solve_orbit
from cpg_ros.dynamics.stability import verdicts
from cpg_ros.networks.network import stated_gait
from cpg_ros.networks.registry import find_network, NETWORKS, PRESETS, SHIPPED
from depth import examples, in_depth
from hypothesis import given
from hypothesis import strategies as st
import numpy as np
import pytest

NAMES = (*SHIPPED, *(f'{name}6' for name in ('delayed', 'hopf', 'matsuoka', 'phase')))
#: Cycles by which LH RH LF RF lead; two where a wave may run either way.
FOUR = {'pronk': [(0, 0, 0, 0)], 'pace': [(0, 0.5, 0, 0.5)], 'bound': [(0, 0, 0.5, 0.5)],
        'trot': [(0, 0.5, 0.5, 0)], 'jump': [(0, 0, 0.25, 0.25), (0, 0, 0.75, 0.75)],
        'walk': [(0, 0.5, 0.75, 0.25)], 'diagonal_walk': [(0, 0.5, 0.25, 0.75)]}
RINGS = {**FOUR, 'walk': [(0, 0.5, 0.25, 0.75), (0, 0.5, 0.75, 0.25)]}
#: Of phase oscillators, by their footfalls: the later a leg touches down, the less it leads.
FOOTFALLS = {'amble': (0, 0.5, 0.125, 0.625), 'canter_left': (1 / 3, 0, 2 / 3, 1 / 3),
             'canter_right': (0, 1 / 3, 1 / 3, 2 / 3), 'transverse_gallop': (0, 0.1, 0.5, 0.6),
             'rotary_gallop': (0.1, 0, 0.5, 0.6), 'half_bound': (0, 0, 0.4, 0.6),
             'unnamed': (0, 0.5, 0.375, 0.875)}
PHASE = {gait: FOUR[gait] for gait in FOUR if gait != 'jump'} | {
    gait: [tuple(-fall for fall in falls)] for gait, falls in FOOTFALLS.items()}
#: Sixths of a cycle by which LH RH LM RM LF RF lead (Wilson 1966; Golubitsky et al. 1999).
SIXTHS = {'tripod': (0, 3, 3, 0, 0, 3), 'ripple': (0, 3, 4, 1, 2, 5), 'wave': (0, 3, 5, 2, 4, 1),
          'reverse_ripple': (0, 3, 2, 5, 4, 1), 'reverse_wave': (0, 3, 1, 4, 2, 5),
          'pace': (0, 3, 0, 3, 0, 3), 'pronk': (0, 0, 0, 0, 0, 0), 'lurch': (0, 0, 3, 3, 0, 0),
          'inchworm': (0, 0, 4, 4, 2, 2), 'caterpillar': (0, 0, 5, 5, 4, 4),
          'unnamed': (0, 3, -1.5, 1.5, -3, 0)}
SIX = {gait: [tuple(one / 6 for one in sixths)] for gait, sixths in SIXTHS.items()}
#: Of the biped: of its two legs, or where these move differently, of two of its cells.
PAIRS = {'walk': (0, 1, 0.5), 'run': (0, 1, 0.5), 'two_legged_jump': (0, 1, 0.0),
         'two_legged_hop': (0, 1, 0.0), 'skip': (0, 1, 0.5), 'gallop': (0, 2, 0.5),
         'hesitation_walk': (0, 3, 0.5), 'asymmetric_hop': (0, 3, 0.0),
         'one_legged_hop': (0, 2, 0.0)}
WANTED = {'phase': PHASE, 'delayed': RINGS, 'quadruped': RINGS, 'hopf': FOUR, 'matsuoka': FOUR}


def leads(orbit, cells):
    """Cycles by which cells lead the first of them, by correlating a simulated cycle of theirs."""
    run = simulate(orbit.network, orbit, orbit.period, orbit.period / 1200, progress=False)
    x = run.x[:1200, list(cells)] - run.x[:1200, list(cells)].mean(axis=0)
    waves = np.fft.fft(x, axis=0)
    likeness = np.fft.ifft(waves * waves[:, :1].conj(), axis=0).real
    return -likeness.argmax(axis=0) / 1200


def off(phases, wanted):
    # Both against their first.
    gap = np.array(phases) - np.array(wanted) - (phases[0] - wanted[0])
    return float(np.abs((gap + 0.5) % 1.0 - 0.5).max())


@pytest.mark.parametrize('name', [
    name for name in NAMES[:-3] if name not in ('quadruped', 'biped')]
    + in_depth('quadruped', 'biped', *NAMES[-3:]))
def test_what_is_found_is_the_gait_asked_for_or_nothing_is(name):
    network, found = NETWORKS[name], Counter()
    for preset_name, preset in network.presets().items():
        for gait in network.gaits():
            try:
                orbit = solve_orbit(preset.network, gait)
            except NoOrbit:
                assert gait != preset.gait, preset_name
                continue
            found[gait] += 1
            if name == 'biped':
                one, other, lead = PAIRS[gait]
                apart = off(leads(orbit, (one, other)), (0.0, lead))
            else:
                cells = [listed[0] - 1 for listed in next(iter(network.legs.values())).values()]
                table = SIX if name.endswith('6') else WANTED[name]
                apart = min(off(leads(orbit, cells), one) for one in table[gait])
            assert apart < 0.005, (preset_name, gait)
    assert set(found) == set(network.gaits())


@pytest.mark.parametrize('name', ['phase', 'phase2', *in_depth('phase6', 'phase8')])
def test_phase_oscillators_have_one_gait_at_a_set(name):
    for gait, preset in PRESETS[name].items():
        found = verdicts(preset.network)
        assert [one for one in found if found[one].orbit is not None] == [gait]
        other = next(one for one in found if one != gait)
        assert found[other].why == f"the offsets make the {gait}, not '{other}'" or (
            gait == 'unnamed' and 'no other gait with a name' in found[other].why)
        assert np.allclose(preset.network.symmetry(other).phases,
                           PRESETS[name][other].network.symmetry(other).phases)


@examples(60)
@given(st.sampled_from(sorted(PHASE)), st.floats(-2.0, 2.0),
       st.lists(st.floats(-0.04, 0.04), min_size=4, max_size=4))
def test_a_gait_keeps_its_name_while_it_is_the_nearest(gait, common, moved):
    trot = PRESETS['phase']['trot'].network
    network = trot.with_phases(dict(zip(trot.offsets, np.array(PHASE[gait][0]) + moved + common,
                                        strict=True)))

    def distance(one):
        # RMS over the legs after the best of many common shifts.
        gaps = np.array(network.leads) - PHASE[one][0]
        return min(float(np.sqrt(np.mean(((gaps - shift + 0.5) % 1.0 - 0.5)**2)))
                   for shift in np.arange(2000) / 2000)

    apart = {one: distance(one) for one in PHASE if one != 'unnamed'}
    nearest = min(apart, key=apart.get)
    first, second = sorted(apart.values())[:2]
    if abs(first - 0.06) > 1e-3 and second - first > 1e-3:
        assert stated_gait(network) == (nearest if first < 0.06 else 'unnamed')


def test_analyze_names_the_gait_and_refuses_the_others(capsys):
    assert analyze(['--network', 'phase', '--preset', 'pronk', '--json']) == 0
    gaits = json.loads(capsys.readouterr().out)['gaits']
    assert [gait for gait, one in gaits.items() if one['exists']] == ['pronk']
    assert gaits['pronk']['phases'] == {'lh': 0.0, 'rh': 0.0, 'lf': 0.0, 'rf': 0.0}
    assert gaits['trot']['why'] == "the offsets make the pronk, not 'trot'"


@pytest.mark.parametrize('name', [*NAMES, 'phase12', 'delayed8'])
def test_every_gait_is_drawn_in_a_colour_of_its_own(name):
    drawn = colours(find_network(name))
    assert set(drawn) == set(find_network(name).gaits())
    assert len(set(drawn.values())) == len(drawn)


def test_a_row_of_an_atlas_ends_where_the_offsets_make_another_gait():
    trot = PRESETS['phase']['trot'].network
    chart = chart_of('phase', trot, [('w', (0.5, 2.0)), ('offset_lf', (0.5, 0.9))], (3, 5))
    columns = tuple(range(5))
    found = assess_row(AtlasRow(chart, 'trot', 1, columns))
    # RMS of 0.1 in one leg of four, after the best common shift: 0.043.
    assert [one['label'] for one in found] == [STABLE, STABLE, NONE, NONE, NONE]
    found = assess_row(AtlasRow(chart, 'pronk', 1, columns))
    assert {one['label'] for one in found} == {NONE}
    found = assess_row(AtlasRow(chart, 'unnamed', 1, columns))
    assert [one['label'] for one in found] == [NONE, NONE, STABLE, STABLE, STABLE]


def test_an_atlas_seeks_no_equilibrium_where_there_is_none(monkeypatch):
    trot = PRESETS['phase']['trot'].network
    monkeypatch.setattr('cpg_ros.dynamics.equilibrium.Quotient.newton_from_all', None)
    chart = chart_of('phase', trot, [('w', (0.1, 5.0)), ('nu', (0.5, 2.0))], (9, 9))
    assert hopf_curves(chart, trot.gaits()) == []
    with pytest.raises(NoEquilibrium, match='no equilibrium'):
        equilibrium(trot)
