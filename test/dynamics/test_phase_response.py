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

"""Phase response curves against direct perturbation of simulations, and against closed forms."""

from dataclasses import replace
import math

from cpg_ros.dynamics.arclength import NoOrbit
from cpg_ros.dynamics.floquet import multipliers
from cpg_ros.dynamics.integration.simulate import simulate
from cpg_ros.dynamics.phase_response import phase_response
from cpg_ros.dynamics.solve_orbit import solve_preset
from cpg_ros.dynamics.stability import stability
from cpg_ros.networks.equations import Field
from cpg_ros.networks.registry import PRESETS
from depth import in_depth
import numpy as np
import pytest
from sheared_legs import closed_response, closed_walk, LateShearedLegs, ShearedLegs, solved_walk

#: Phases at which a gait is disturbed, and by how much.
TIMES, SIZE = np.array([0.05, 0.41, 0.83]), 3e-4


class Disturbed:
    """An orbit from a time on as a history, with a motion added."""

    def __init__(self, orbit, time, motion, slope):
        self.orbit, self.time, self.motion, self.slope = orbit, time, motion, slope

    def __call__(self, times):
        return self.orbit(self.time + times) + self.motion(times)

    def derivative(self, times):
        return self.orbit.derivative(self.time + times) + self.slope(times)


def struck(orbit, time, change):
    """Return a history whose newest state alone is changed."""
    return Disturbed(orbit, time, lambda t: np.where(t[:, None] == 0.0, change, 0.0),
                     lambda t: np.zeros((t.size, change.size)))


def shifts(orbit, pairs, times, step):
    """Return by how many cycles the first of each pair of starts is ahead in the end.

    With a symmetry lock with which the gait attracts, until all else has decayed.
    """
    gain = stability(orbit).lock_gain
    leading = multipliers(orbit, gain).leading
    cycles = math.ceil(math.log(1e-8) / math.log(max(leading, 1e-4)))
    steps = math.ceil(cycles * orbit.period / step)
    run = simulate(orbit.network, [one for pair in pairs for one in pair], steps * step, step,
                   lock=(gain, orbit.symmetry), every=steps, progress=False)
    ends = run.x[:, -1].reshape(len(pairs), 2, -1)
    slopes = orbit.derivative(np.asarray(times) + steps * step)
    apart = ((ends[:, 0] - ends[:, 1]) * slopes).sum(axis=1)
    return apart / (slopes**2).sum(axis=1) / orbit.period


def directly(orbit, times, step):
    """Return the phase response by kicks to either side, shape (times, cells, variables)."""
    network, unit = orbit.network, np.eye(orbit.network.components)
    make = struck if network.delay else lambda orbit, time, change: orbit(time) + change
    pairs = [[make(orbit, time, side * SIZE * one) for side in (1.0, -1.0)]
             for time in times for one in unit]
    found = shifts(orbit, pairs, np.repeat(times, len(unit)), step) / (2.0 * SIZE)
    return found.reshape(times.size, network.variables, network.cells).swapaxes(1, 2)


def measured(orbit, times):
    """Return directly(), with a delay extrapolated to steps of no length.

    A kick to the newest state is a ramp over the step before it to what is heard a delay later.
    Steps are parts of the delay, so that the ramp begins and ends with steps.
    """
    network = orbit.network
    if not network.delay:
        # A step across a kink is of second order, and a kick moves kinks between steps.
        return directly(orbit, times, (0.0625 if network.kinks else 0.5) * network.step)
    parts = math.ceil(network.delay / network.step)
    one, two, four = (directly(orbit, times, network.delay / (n * parts)) for n in (1, 2, 4))
    return (8.0 * four - 6.0 * two + one) / 3.0


def shifted(orbit, time, motion):
    """Return the cycles by which a motion of a network's history advances its phase.

    A change of the history alone, dx(t + s) for -tau < s < 0, shifts it by the integral of
    Z(t + s + tau) B dx, B the Jacobian by the state a delay ago.
    """
    network, response = orbit.network, phase_response(orbit)

    def z(times):
        return response(times).swapaxes(1, 2).reshape(times.size, -1)

    now = float((z(np.array([time])) * motion(np.zeros(1))).sum())
    if not network.delay:
        return now
    nodes, weights = np.polynomial.legendre.leggauss(200)
    times = 0.5 * network.delay * (nodes - 1.0)
    later = time + times + network.delay
    by_past = Field(network).linearised(orbit(later), orbit(time + times))[2]
    kernel = np.einsum('ti,tij->tj', z(later), by_past)
    return now + (kernel * motion(times)).sum(axis=1) @ weights * 0.5 * network.delay


@pytest.mark.parametrize(('network', 'name'), [
    ('delayed', 'walk'), ('quadruped', 'pace'), ('biped', 'skip'), ('phase', 'canter_left'),
    *in_depth(('delayed', 'pronk'), ('delayed', 'goat_trot'), ('delayed', 'jump'),
              ('delayed', 'liu2024_pace'), ('quadruped', 'jump'), ('quadruped', 'walk'),
              ('quadruped', 'trot'), ('biped', 'run'), ('biped', 'gallop'),
              ('biped', 'one_legged_hop'), ('biped', 'hesitation_walk'),
              ('biped', 'two_legged_hop'), ('hopf', 'pace'), ('hopf', 'walk'),
              ('matsuoka', 'trot'))])
def test_it_is_what_kicks_to_a_simulation_do(network, name):
    orbit = solve_preset(PRESETS[network][name])
    times = TIMES * orbit.period
    mine = phase_response(orbit)(times)
    assert np.abs(measured(orbit, times) - mine).max() < 1e-4 * np.abs(mine).max()


def test_a_motion_of_the_whole_history_shifts_the_phase_by_its_adjoint():
    orbit = solve_preset(PRESETS['delayed']['walk'])
    rates = np.arange(1.0, 9.0)

    def motion(t):
        return SIZE * np.cos(np.outer(t, rates))

    def slope(t):
        return -SIZE * rates * np.sin(np.outer(t, rates))

    pairs = [[Disturbed(orbit, time, motion, slope),
              Disturbed(orbit, time, lambda t: -motion(t), lambda t: -slope(t))]
             for time in TIMES]
    found = shifts(orbit, pairs, TIMES, orbit.network.step) / 2.0
    assert found == pytest.approx([shifted(orbit, time, motion) for time in TIMES], rel=1e-5)
    assert np.abs(found).min() > 1e-7


@pytest.mark.parametrize('network', [
    ShearedLegs(), ShearedLegs(shear=0.0), LateShearedLegs(), LateShearedLegs(k=0.4, tau=0.9)])
def test_oscillators_with_shear_have_the_closed_form(network):
    orbit = solved_walk(network)
    pace, radius = closed_walk(network)
    assert orbit.period == pytest.approx(2.0 * np.pi / pace, rel=1e-9)
    times = np.linspace(0.0, orbit.period, 25)
    response = phase_response(orbit)
    exact = closed_response(network, times)
    assert np.abs(response(times)[:, 0] - exact).max() < 1e-9
    # The other leg is half a cycle later.
    assert np.abs(response(times + 0.5 * orbit.period)[:, 1] - exact).max() < 1e-9
    if not network.delay:
        # The isochrons theta - shear log(r): what a unit along x and y does at angle 0.
        assert exact[0] == pytest.approx(np.array([-network.shear, 1.0]) / (4 * np.pi * radius))


def test_phase_oscillators_have_the_closed_form():
    """A kick across the radius turns one of four oscillators, all of which then agree."""
    orbit = solve_preset(PRESETS['phase']['canter_left'])
    times = np.linspace(0.0, 1.0, 21)
    angle = 2.0 * np.pi * (times[:, None] + orbit.phases)
    exact = np.stack([-np.sin(angle), np.cos(angle), 0.0 * angle], axis=-1) / (8.0 * np.pi)
    assert np.abs(phase_response(orbit)(times) - exact).max() < 1e-8


@pytest.mark.parametrize('network', list(PRESETS))
def test_along_the_orbit_it_is_the_frequency(network):
    for preset in PRESETS[network].values():
        orbit = solve_preset(preset)
        for time in TIMES * orbit.period:
            rate = shifted(orbit, time, lambda t, time=time, orbit=orbit: orbit.derivative(time
                                                                                          + t))
            assert rate * orbit.period == pytest.approx(1.0, abs=1e-9)


def test_without_a_phase_of_its_own_a_gait_has_no_response():
    orbit = solve_preset(PRESETS['phase']['trot'])
    # Without weights the same cycle is one of many: each leg may have any phase.
    uncoupled = replace(orbit, network=orbit.network.replace(w=0.0))
    with pytest.raises(NoOrbit, match='the orbit is not isolated, so its phase has no response'):
        phase_response(uncoupled)
