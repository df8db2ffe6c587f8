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

"""A network of one's own, this file: what it states is enough for everything else.

Stuart-Landau oscillators, one a leg, coupled through both variables: on the walk the radius is
sqrt(mu - k), the period 2 pi / omega, the Hopf point at mu = k, and the multipliers are those of
the amplitude, exp(-2 (mu - k) T), and of the wave in which both legs move together. The second
network hears the other leg a delay ago; on the walk its pace solves omega' = omega +
k sin(omega' tau), its radius is sqrt(mu - k cos(omega' tau)).
"""

from dataclasses import dataclass, replace
from fractions import Fraction
import math
from pathlib import Path
import re

from cpg_ros import simulate, solve_orbit
from cpg_ros.dynamics.arclength import NoOrbit
from cpg_ros.dynamics.solve_orbit import solve_preset
from cpg_ros.networks.definition import exp, log, Range
from cpg_ros.networks.library.delayed import Delayed
from cpg_ros.networks.network import asymmetry, known, Network, Preset
from cpg_ros.networks.registry import definition_error, SHIPPED
from cpg_ros.networks.symmetry import Group, Symmetry
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq
import yaml

OTHER = (1, 0)
Z2 = Group(2, (('side', OTHER),))
SHIFTS = {'hop': Fraction(0), 'walk': Fraction(1, 2)}


@dataclass(frozen=True)
class TwoLegs(Network):
    """Two oscillators ``z' = (mu + i omega - |z|^2) z + k z_other``, z = x + i y."""

    mu: float
    omega: float
    k: float

    name = 'two_legs'
    cells = 2
    states = ('x', 'y')
    readout = 'phase'
    step = 0.01
    ranges = {'mu': Range(-5.0, 5.0, 'square of the radius of a cell by itself'),
              'omega': Range(0.1, 50.0, 'angular frequency'),
              'k': Range(-5.0, 5.0, 'weight of the other cell')}
    couplings = ('k',)
    legs = {'ankle': {'left': (1,), 'right': (2,)}}
    sides = {'left': 'left', 'right': 'right'}
    usual_gait = 'walk'
    free = ('mu', 'k')
    line = 'mu'
    span = (-1.0, 3.0)

    @staticmethod
    def equations(cell, p):
        x, y = cell.now()
        x_other, y_other = cell.now(OTHER)
        rest = p.mu - x ** 2 - y ** 2
        return rest * x - p.omega * y + p.k * x_other, rest * y + p.omega * x + p.k * y_other

    @classmethod
    def gaits(cls):
        return tuple(SHIFTS)

    def symmetry(self, gait):
        return Symmetry.of(Z2, {'side': SHIFTS[known(gait, self.gaits())]})

    @classmethod
    def presets(cls):
        return {'walk': Preset('walk', cls(1.0, 6.0, -0.5)),
                'hop': Preset('hop', cls(1.0, 6.0, 0.5))}


def fhn_ring():
    """Return FitzHugh-Nagumo cells in a ring of four, each of which hears the one before it."""
    group = Group(4, (('turn', (1, 2, 3, 0)),))

    @dataclass(frozen=True)
    class FhnRing(TwoLegs):
        """v' = v - v^3/3 - w + i + k (v_before - v), w' = eps (v + a - b w)."""

        mu: float = 0.0
        omega: float = 1.0
        k: float = -0.2
        eps: float = 0.08
        a: float = 0.7
        b: float = 0.8
        i: float = 0.5

        name = 'fhn_ring'
        cells = 4
        states = ('v', 'w')
        step = 0.05
        ranges = {**TwoLegs.ranges, 'eps': Range(0.0, 1.0, 'rate of w'),
                  'a': Range(-2.0, 2.0, ''), 'b': Range(0.0, 2.0, ''),
                  'i': Range(-1.0, 3.0, 'current')}
        legs = {'first': {f'leg{n}': (n,) for n in range(1, 5)}}
        line = 'i'
        span = (-0.5, 0.7)

        @staticmethod
        def equations(cell, p):
            v, w = cell.now()
            before, _ = cell.now(lambda number: number - 1)
            return (v - v**3 / 3.0 - w + p.i + p.k * (before - v),
                    p.eps * (v + p.a - p.b * w))

        def symmetry(self, gait):
            return Symmetry.of(group, {'turn': SHIFTS[gait] / 2})

        @classmethod
        def presets(cls):
            return {'walk': Preset('walk', cls())}

    return FhnRing


def five_variables():
    """Return the two legs with three more variables a cell, each of which follows the last."""
    @dataclass(frozen=True)
    class Five(TwoLegs):
        """Nothing depends on the three: the orbit stays that of the two legs."""

        name = 'five'
        states = ('x', 'y', 'p', 'q', 'r')

        @staticmethod
        def equations(cell, p):
            x, y, a, b, c = cell.now()
            x_other, y_other, *_ = cell.now(OTHER)
            rest = p.mu - x ** 2 - y ** 2
            return (rest * x - p.omega * y + p.k * x_other, rest * y + p.omega * x + p.k * y_other,
                    x - a, a - b, b - c)

    return Five


def late_network():
    """Return the second network; in here, since a file holds one."""
    @dataclass(frozen=True)
    class LateLegs(TwoLegs):
        """The same, the other leg heard a delay ago."""

        tau: float = 0.1

        name = 'late_legs'
        delay_parameter = 'tau'
        longest_delay = 2.0
        ranges = {**TwoLegs.ranges, 'tau': Range(0.01, 2.0, 'delay [model time]')}
        line = 'tau'

        @staticmethod
        def equations(cell, p):
            x, y = cell.now()
            x_other, y_other = cell.past(OTHER)
            rest = p.mu - x ** 2 - y ** 2
            return rest * x - p.omega * y + p.k * x_other, rest * y + p.omega * x + p.k * y_other

        @classmethod
        def presets(cls):
            return {'walk': Preset('walk', cls(-0.5, 6.0, -1.0, 0.3))}

    return LateLegs


WALK = TwoLegs(1.0, 6.0, -0.5)
HARMONIC = np.linspace(0.0, 1.0, 33)


@pytest.mark.parametrize(('gait', 'k'), [('walk', -0.5), ('walk', 0.3), ('hop', 0.4)])
def test_its_orbit_and_multipliers_are_the_exact_ones(gait, k):
    from cpg_ros.dynamics.floquet import multipliers
    from cpg_ros.dynamics.solve_orbit import solve_orbit
    network = replace(WALK, k=k)
    square = network.mu + (k if gait == 'hop' else -k)
    orbit = solve_orbit(network, gait)
    assert orbit.period == pytest.approx(2.0 * np.pi / 6.0, rel=1e-10)
    assert np.allclose(orbit.waveform(HARMONIC), np.sqrt(square) * np.cos(2 * np.pi * HARMONIC),
                       atol=1e-9)
    assert orbit.d_period[0] == pytest.approx(0.0, abs=1e-9)
    assert orbit.d_waveform(np.zeros(1))[0, 0] == pytest.approx(0.5 / np.sqrt(square), rel=1e-8)
    found = multipliers(orbit)
    amplitude = np.exp(-2.0 * square * orbit.period)
    assert np.abs(found.within - amplitude).min() < 1e-8

    def rates(t, x):
        return np.concatenate([network.rates(x[:4]), (network.jacobian(x[:4])
                                                      @ x[4:].reshape(4, 4)).ravel()])

    start = np.concatenate([orbit(np.array(0.0)), np.eye(4).ravel()])
    whole = solve_ivp(rates, (0.0, orbit.period), start, 'DOP853', rtol=1e-12, atol=1e-13)
    own = np.linalg.eigvals(whole.y[4:, -1].reshape(4, 4))
    mine = np.concatenate([found.within, found.transverse, [found.trivial]])
    assert np.allclose(np.sort_complex(own), np.sort_complex(mine), atol=1e-8)


def test_its_hopf_point_and_branch_are_the_exact_ones():
    from cpg_ros.dynamics.continuation import continue_orbit
    from cpg_ros.dynamics.hopf import hopf_points
    from cpg_ros.dynamics.solve_orbit import solve_orbit
    from cpg_ros.networks.network import ParameterLine
    line = ParameterLine.parse('mu', TwoLegs)
    points = {point.gait: point for point in hopf_points(WALK, line, -1.0, 3.0)}
    assert points['walk'].value == pytest.approx(-0.5, abs=1e-10)
    assert points['hop'].value == pytest.approx(0.5, abs=1e-10)
    point = points['walk']
    assert (point.omega, point.supercritical) == (pytest.approx(6.0), True)
    assert point.normal_form.k1 == pytest.approx(1.0, abs=1e-9)
    assert point.amplitude(-0.4) == pytest.approx(np.sqrt(0.1), rel=1e-9)
    branch = continue_orbit(solve_orbit(WALK, 'walk'), line, -1.0, 3.0)
    assert [end.why for end in branch.ends] == ['rest', 'bound']
    assert branch.ends[0].value == pytest.approx(-0.5, abs=1e-5)
    assert np.allclose(branch.amplitudes, np.sqrt(branch.values + 0.5), atol=1e-7)


def late_pace(network):
    """Angular frequency and squared radius of the walk, from z' = ... with z = r exp(i W t)."""
    def gap(pace):
        return pace - network.omega - network.k * np.sin(pace * network.tau)

    pace = brentq(gap, 0.5 * network.omega, 1.5 * network.omega, xtol=1e-14)
    return pace, network.mu - network.k * np.cos(pace * network.tau)


def test_with_a_delay_its_orbit_is_the_exact_one():
    from cpg_ros.dynamics.floquet import multipliers
    from cpg_ros.dynamics.hopf import first_hopf
    from cpg_ros.dynamics.integration.simulate import simulate
    from cpg_ros.dynamics.solve_orbit import solve_orbit
    network = late_network()(0.3, 6.0, -1.0, 0.1)
    pace, square = late_pace(network)
    point = first_hopf(replace(network, mu=-0.5), 'walk')
    if point is not None:
        matrix = 1j * point.omega - (-0.5 + 6.0j) - np.exp(-1j * point.omega * point.value)
        assert abs(matrix) < 1e-9
    run = simulate(network, lambda t: np.sqrt(square) * np.stack(
        [np.cos(pace * t), -np.cos(pace * t), np.sin(pace * t), -np.sin(pace * t)], axis=-1),
        10.0, 0.0025, progress=False)
    states = run(np.array([2.0 * np.pi / pace * 8]))[0]
    assert np.allclose(states, np.sqrt(square) * np.array([1.0, -1.0, 0.0, 0.0]), atol=1e-7)
    orbit = solve_orbit(network, 'walk')
    assert orbit.period == pytest.approx(2.0 * np.pi / pace, rel=1e-9)
    assert orbit.peak == pytest.approx(np.sqrt(square), rel=1e-9)
    assert abs(multipliers(orbit).trivial - 1.0) < 1e-8


def robot_tree():
    joint = {'cell': 1, 'offset': 0.1, 'weights': [0.3], 'lower': -1.0, 'upper': 1.0,
             'velocity': 10.0}
    return {'network': __file__, 'legs': {
        leg: {'joints': [{**joint, 'name': f'{leg}_hip', 'cell': cell}]}
        for leg, cell in (('left', 1), ('right', 2))}}


@pytest.mark.deep
def test_a_generator_runs_it_and_switches_its_gait(start, tmp_path):
    # In here: the generator loads this file, too, and knows nothing of tests.
    from graph import until
    robot = tmp_path / 'two_legs.yaml'
    robot.write_text(yaml.safe_dump(robot_tree()))
    _, watcher = start('-p', f'network:={Path(__file__)}', '-p', f'robot:={robot}', '-p',
                       'frequency:=2.0', '-p', 'transition:=0.3', '-p', 'rate:=200.0')
    until(lambda: watcher.gaits[-1:] == ['walk'], 'the walk')
    assert watcher.set(gait='hop')[0].successful
    until(lambda: watcher.gaits[-1:] == ['hop'], 'the hop')
    assert watcher.set(two_legs_mu=2.0)[0].successful
    refused = watcher.set(two_legs_mu=-3.0)[0]
    assert not refused.successful and 'hop' in refused.reason


def test_a_gait_that_simulations_leave_is_found_on_the_branch_of_its_hopf_point(monkeypatch):
    """The ring's walk is unstable in its own class; its period by continuation from i = 0.184."""
    # No simulation finds it, and these are most of the time.
    monkeypatch.setattr('cpg_ros.dynamics.mesh.solve.find_orbit', lambda *_: iter(()))
    orbit = solve_orbit(fhn_ring()(), 'walk')
    assert orbit.period == pytest.approx(29.165625, abs=1e-5)
    # The equations, cell by cell, lead back after a period.
    p = orbit.network

    def rates(_, x):
        v, w = x.reshape(2, 4)
        return np.concatenate([v - v**3 / 3.0 - w + p.i + p.k * (np.roll(v, 1) - v),
                               p.eps * (v + p.a - p.b * w)])
    start = orbit(np.array(0.0))
    run = solve_ivp(rates, (0.0, orbit.period), start, rtol=1e-11, atol=1e-12)
    assert run.y[:, -1] == pytest.approx(start, abs=1e-5)


def test_a_gait_that_is_not_there_is_refused_in_one_sentence(monkeypatch):
    monkeypatch.setattr('cpg_ros.dynamics.mesh.solve.find_orbit', lambda *_: iter(()))
    with pytest.raises(NoOrbit, match='no hop was found at these parameters, neither by '
                                      'simulations from states about the equilibrium nor from a '
                                      'Hopf point along mu'):
        solve_preset(Preset('hop', TwoLegs(-2.0, 6.0, 0.5)))


def test_equations_may_have_powers_of_anything_logarithms_and_absolute_values():
    @dataclass(frozen=True)
    class Powers(TwoLegs):
        n: float

        name = 'powers'

        @staticmethod
        def equations(cell, p):
            x, y = cell.now()
            return 2.0 ** y - abs(x) ** p.n, log(1.0 + x ** 2) * p.k - y

    network, state = Powers(1.0, 6.0, -0.5, 2.5), np.array([0.7, -1.2, 0.4, -0.3])
    x, y = state[:2], state[2:]
    rates = np.concatenate([2.0 ** y - np.abs(x) ** 2.5, -0.5 * np.log(1.0 + x ** 2) - y])
    assert network.rates(state) == pytest.approx(rates, abs=1e-14)
    slopes = [(network.rates(state + step) - network.rates(state - step)) / 2e-6
              for step in 1e-6 * np.eye(4)]
    assert network.jacobian(state) == pytest.approx(np.array(slopes).T, abs=1e-8)
    by_n = -np.concatenate([np.abs(x) ** 2.5 * np.log(np.abs(x)), [0.0, 0.0]])
    assert network.by_parameter(state)[:, 3] == pytest.approx(by_n, abs=1e-12)
    run = simulate(network, state, 0.05, 0.01, progress=False)
    exact = solve_ivp(lambda _, z: network.rates(z), (0.0, 0.05), state, rtol=1e-11, atol=1e-12)
    assert run.x[-1] == pytest.approx(exact.y[:, -1], abs=1e-8)


def test_cells_of_any_number_of_variables_need_no_word():
    network = five_variables()(1.0, 6.0, -0.5)
    assert network.symmetry('walk').basis.shape == (10, 10)
    assert network.symmetry('hop').basis.shape == (5, 10)
    orbit = solve_orbit(network, 'walk')
    assert orbit.period == pytest.approx(2.0 * np.pi / 6.0)
    assert orbit.peak == pytest.approx(np.sqrt(1.5), rel=1e-6)


def test_a_symmetry_that_the_equations_do_not_have_is_refused():
    @dataclass(frozen=True)
    class Uneven(TwoLegs):
        """The right leg hears itself, too."""

        name = 'uneven'

        @staticmethod
        def equations(cell, p):
            x, y = cell.now()
            x_other, y_other = cell.now((1, 1))
            rest = p.mu - x ** 2 - y ** 2
            return rest * x - p.omega * y + p.k * x_other, rest * y + p.omega * x + p.k * y_other

    why = definition_error(Uneven)
    assert re.fullmatch(r'symmetry: the equations do not have that of the walk, which changes '
                        r'their rates by 0\.\d+ of their size', why)
    assert not definition_error(TwoLegs) and not definition_error(Delayed)
    for shipped in SHIPPED.values():
        for preset in shipped.presets().values():
            symmetry = preset.network.symmetry(preset.gait)
            assert asymmetry(preset.network, symmetry) < 1e-12


def test_equations_that_read_a_past_without_a_delay_are_refused():
    @dataclass(frozen=True)
    class Forgetful(TwoLegs):
        name = 'forgetful'

        @staticmethod
        def equations(cell, p):
            x, y = cell.past(OTHER)
            return p.mu * x, p.omega * y * p.k

    with pytest.raises(TypeError, match=r'Forgetful.equations reads the past, but the network '
                                        r'names no delay_parameter'):
        definition_error(Forgetful)


def test_numpys_functions_are_terms_and_comparisons_say_what_to_use():
    @dataclass(frozen=True)
    class Saturated(TwoLegs):
        name = 'saturated'

        @staticmethod
        def equations(cell, p):
            x, y = cell.now()
            return np.tanh(p.mu * x) - y, np.exp(-y) + p.omega * p.k * x

    x, y = state = np.array([[0.7, -1.2], [0.4, -0.3]])
    exact = np.concatenate([np.tanh(x) - y, np.exp(-y) - 3.0 * x])
    assert Saturated(1.0, 6.0, -0.5).rates(state.ravel()) == pytest.approx(exact, abs=1e-14)
    term = exp(1.0)
    for wrong in (lambda: max(term, 0.0), lambda: math.tanh(term), lambda: 1.0 if term else 0.0):
        with pytest.raises(TypeError, match=r'such as positive\(x\) for max\(0, x\)'):
            wrong()
