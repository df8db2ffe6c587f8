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

"""Networks for any even number of legs, by a rule."""

from dataclasses import replace
from fractions import Fraction
from itertools import combinations
import pickle

from cpg_ros.common.errors import CpgError
from cpg_ros.dynamics.hopf import hopf_points
from cpg_ros.dynamics.integration.simulate import simulate
from cpg_ros.dynamics.orbit import extra_symmetry
from cpg_ros.dynamics.solve_orbit import solve_orbit, solve_preset
from cpg_ros.dynamics.stability import stability
from cpg_ros.fitting.gaits.leg_phases import match_gait
from cpg_ros.networks.leg_numbers import footfall_order
from cpg_ros.networks.library.delayed import Delayed, PRESETS
from cpg_ros.networks.network import ParameterLine
from cpg_ros.networks.registry import find_network, NETWORKS, numbered
from cpg_ros.networks.symmetry import Symmetry
from depth import in_depth
import numpy as np
import pytest

#: Phases LH RH LM RM LF RF by which legs lead LH: waves run from hind to fore, the legs of a pair
#: half a cycle apart (Wilson 1966).
HEXAPOD = {'tripod': (0, 3, 3, 0, 0, 3), 'ripple': (0, 3, 4, 1, 2, 5), 'wave': (0, 3, 5, 2, 4, 1),
           'reverse_ripple': (0, 3, 2, 5, 4, 1), 'reverse_wave': (0, 3, 1, 4, 2, 5),
           'pace': (0, 3, 0, 3, 0, 3), 'pronk': (0, 0, 0, 0, 0, 0), 'lurch': (0, 0, 3, 3, 0, 0),
           'inchworm': (0, 0, 4, 4, 2, 2), 'caterpillar': (0, 0, 5, 5, 4, 4)}


def phases(network, gait):
    found = network.presets()[gait].network.symmetry(gait).phases
    return {leg: found[cells[0] - 1] for leg, cells in network.legs['implicit'].items()}


def test_four_legs_are_the_network_itself():
    assert find_network('delayed4') is Delayed
    assert Delayed.legs == {
        'implicit': {'lh': (1, 7), 'rh': (2, 8), 'lf': (3, 5), 'rf': (4, 6)}}
    assert find_network('delayed6') is find_network('delayed6')
    assert 'delayed6' in NETWORKS and 'delayed6' not in tuple(NETWORKS)


@pytest.mark.parametrize(('name', 'message'), [
    ('delayed5', 'not an even number'), ('delayed2', 'too few for two'), ('delayed34', 'to 32'),
    ('biped6', 'has 2 legs, not 6'), ('nothing6', 'is not one of delayed')])
def test_a_number_of_legs_that_a_network_does_not_take_is_refused(name, message):
    with pytest.raises(CpgError, match=message) as error:
        find_network(name)
    assert '\n' not in str(error.value)


def test_six_legs_and_their_gaits():
    network = find_network('delayed6')
    assert network.cells == 12
    assert tuple(network.legs['implicit']) == ('lh', 'rh', 'lm', 'rm', 'lf', 'rf')
    assert network.girdles['lm'] == 'middle' and network.sides['rm'] == 'right'
    assert network.gaits() == tuple(HEXAPOD)
    for gait, wanted in HEXAPOD.items():
        assert np.allclose(list(phases(network, gait).values()), np.array(wanted) / 6), gait
        found = match_gait(phases(network, gait), network)
        assert (found.gait, found.candidates) == (gait, (gait,))


@pytest.mark.parametrize('legs', [6, 8, 12])
def test_every_gait_of_any_number_of_legs_attracts(legs):
    network = find_network(f'delayed{legs}')
    for gait, preset in network.presets().items():
        assert not stability(solve_preset(preset)).reason, gait


class Less:
    """An orbit of which less symmetry is known than it has."""

    def __init__(self, orbit, symmetry):
        self.network, self.period, self.symmetry = orbit.network, orbit.period, symmetry
        self._orbit = orbit

    def __call__(self, times):
        return self._orbit(times)


@pytest.mark.parametrize('legs', [4, 6, 8, 12])
def test_what_an_orbit_has_beyond_the_symmetry_known_is_seen(legs):
    for gait, preset in find_network(f'delayed{legs}').presets().items():
        orbit = solve_preset(preset)
        assert extra_symmetry(orbit) == '', gait
        shifts = dict(orbit.symmetry.shifts)
        for some in combinations(shifts, 2):
            part = Symmetry.of(orbit.symmetry.group, {name: shifts[name] for name in some})
            found = extra_symmetry(Less(orbit, part))
            if len(part.shifts) == len(shifts):
                assert found == ''
                continue
            one, fraction = found.removesuffix(' of a cycle').split(' shifts it by ')
            assert one not in part.h and shifts[one] == Fraction(fraction), (gait, some)


@pytest.mark.parametrize(('legs', 'gait', 'same'), [
    (6, 'tripod', 'trot'), (6, 'lurch', 'bound'), (8, 'tetrapod', 'trot'), (8, 'pace', 'pace'),
    (8, 'ripple', 'walk'), (8, 'inchworm', 'jump')])
def test_gaits_whose_neighbours_are_as_far_apart_have_one_waveform(legs, gait, same):
    # A cell hears one behind it and one opposite: the reduced equation is the same.
    four = PRESETS[same].network
    more = find_network(f'delayed{legs}')(*four.as_dict().values())
    a, b = solve_orbit(four, same), solve_orbit(more, gait)
    assert np.isclose(a.period, b.period, rtol=1e-9)
    theta = np.arange(64) / 64
    assert np.allclose(a.waveform(theta), b.waveform(theta), atol=1e-8)


@pytest.mark.parametrize('gait', ['tripod', 'ripple', *in_depth(*list(HEXAPOD)[2:])])
def test_simulation_and_orbit_agree_on_six_legs(gait):
    preset = find_network('delayed6').presets()[gait]
    orbit = solve_preset(preset)
    network = preset.network
    run = simulate(network, orbit, 3.0 * orbit.period, network.step,
                   lock=(stability(orbit).lock_gain, orbit.symmetry))
    assert np.abs(run.x[:, :12] - orbit(run.t)).max() < 1e-6


@pytest.mark.parametrize('gait', ['ripple', 'wave', 'reverse_wave'])
def test_hopf_points_of_six_legs_by_the_characteristic_equation(gait):
    network = find_network('delayed6').presets()[gait].network
    j = {'ripple': -2, 'wave': -1, 'reverse_wave': 1}[gait]
    big = network.a + network.b + network.d * np.exp(-2j * np.pi * j / 6)
    omega = big.imag + np.sqrt(network.c**2 - big.real**2)
    tau = (-np.angle((1j * omega - big) / -network.c) % (2.0 * np.pi)) / omega
    found = hopf_points(network, ParameterLine.parse('tau', type(network)), 0.0, 0.6)
    known = [point for point in found if point.gait == gait]
    assert np.isclose(known[0].value, tau) and np.isclose(known[0].omega, omega)


def test_networks_survive_pickling_and_stay_apart():
    six = find_network('delayed6').presets()['wave'].network
    assert pickle.loads(pickle.dumps(six)) == six
    assert six != Delayed(*six.as_dict().values())
    assert replace(six, tau=0.5).tau == 0.5


def test_footfalls_of_more_than_four_legs_stand_side_by_side():
    six, eight = numbered(6)[0], numbered(8)[0]
    order = [footfall_order(one.sides, one.sides, one.girdles) for one in (Delayed, six, eight)]
    assert order == [['lf', 'rf', 'lh', 'rh'], ['lf', 'lm', 'lh', 'rf', 'rm', 'rh'],
                     ['l1', 'l2', 'l3', 'l4', 'r1', 'r2', 'r3', 'r4']]
