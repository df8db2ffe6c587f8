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

"""All orbits of a gait: what simulations settle on is found, and judged with the others."""

from dataclasses import dataclass
from pathlib import Path
import re

from cpg_ros.dynamics.arclength import NoOrbit
from cpg_ros.dynamics.floquet import multipliers, multipliers_within
from cpg_ros.dynamics.integration.simulate import simulate, Trajectory
from cpg_ros.dynamics.settling import last_cycle
from cpg_ros.dynamics.solve_orbit import coexisting_orbits
from cpg_ros.networks.library.biped import Biped
from cpg_ros.networks.library.delayed import Delayed
from cpg_ros.networks.library.quadruped import Quadruped
from cpg_ros.networks.registry import find_network, PRESETS
from depth import in_depth
import numpy as np
import pytest
from two_sided import OTHER, TwoSided, WIDE
from van_der_pol import van_der_pol

#: A set that optimize certified: the hop of period 13.9143 attracts, that of 13.38 does not.
CERTIFIED = Biped(current=0.2787, phi=0.2601, w_21=0.2612, w_12=-0.8434, w_43=0.2612,
                  w_34=-0.8434, w_31=0.7012, w_42=0.4165, w_13=0.7012, w_24=0.4165,
                  w_41=-0.5327, w_32=0.442, w_23=-0.5327, w_14=0.442)


def settled(network, gait, rng, span=900.0):
    """Periods of the cycles, with the gait's shifts, on which states of its class settle."""
    symmetry = network.symmetry(gait)
    starts = rng.uniform(-0.4, 0.5, (6, network.components)) @ symmetry.basis.T
    starts = starts @ symmetry.basis
    # The lock acts outside the class only, on rounding.
    run = simulate(network, starts, span, 2.0 * network.step, lock=(1.0, symmetry), every=5,
                   progress=False)
    found = []
    for x, slopes in zip(run.x, run.slopes, strict=True):
        cycle = last_cycle(Trajectory(run.t, x, slopes), network.cells)
        if cycle is None:
            continue
        signals = cycle.signals[:, :network.cells]
        gaps = [np.abs(signals[:, list(symmetry.group.elements[name])] - np.roll(
            signals, -round(float(shift) * len(signals)), axis=0)).max()
            for name, shift in symmetry.shifts]
        if max(gaps) < 0.01 * np.ptp(signals):
            found.append(cycle.period)
    return found


def test_the_orbit_that_attracts_comes_first():
    found = coexisting_orbits(CERTIFIED, 'one_legged_hop')
    first = found.orbits[0]
    assert first.period == pytest.approx(13.9143, abs=1e-4)
    assert multipliers(first).attracts
    assert multipliers(first).leading == pytest.approx(0.0055, abs=1e-4)
    # That of period 13.38 is one of the others, none of which attracts.
    assert min(abs(one.period - 13.3812) for one in found.orbits[1:]) < 1e-4
    assert all(multipliers_within(one).leading > 1.0 for one in found.orbits[1:])
    assert all(one.residual < 1e-9 for one in found.orbits)
    # What the plan takes comes at less cost.
    quick = coexisting_orbits(CERTIFIED, 'one_legged_hop', starts=False, everything=False)
    assert quick.orbits[0].period == pytest.approx(first.period, rel=1e-7)


@pytest.mark.parametrize('delay', [4.0, 8.0, *in_depth(5.0, 20.0)])
def test_long_delays(delay):
    network = Delayed(-4.5, 1.0, 6.5, -2.0, delay)
    found = coexisting_orbits(network, 'trot')
    first = found.orbits[0]
    # Long delays: twice the delay and the time of a switch, which no longer changes.
    assert first.period == pytest.approx(2.0 * delay + 0.5674, abs=1e-3)
    assert multipliers_within(first).leading < 0.1 and first.residual < 1e-9
    # It comes back after a disturbance of 5 per cent in its class.
    symmetry = network.symmetry('trot')

    def kicked(times):
        return 1.05 * first(times)

    run = simulate(network, kicked, 6.0 * first.period, lock=(1.0, symmetry), progress=False)
    late = run.t[run.t > 5.0 * first.period]
    states = run(late)
    shift = late[states[:, 0].argmax()]
    assert np.abs(states - first(late - shift)).max() < 0.02 * np.ptp(states)
    # An orbit at a delay is one at the delay and whole periods more (Yanchuk & Perlikowski).
    for orbit in found.orbits[1:]:
        assert orbit.residual < 1e-9
        earlier = network.replace(tau=delay - orbit.period) if orbit.period < delay else None
        if earlier is not None:
            periods = [one.period for one in coexisting_orbits(earlier, 'trot').orbits]
            assert np.abs(np.array(periods) / orbit.period - 1.0).min() < 1e-6
            break


def test_a_gait_below_its_critical_delay():
    """Jumps of a large amplitude coexist with a stable rest: simulation settles on them."""
    network = PRESETS['delayed']['trot'].network.replace(tau=0.2)
    orbit = coexisting_orbits(network, 'jump', everything=False).orbits[0]
    assert multipliers_within(orbit).leading < 1.0 and orbit.residual < 1e-9
    symmetry = network.symmetry('jump')
    starts = np.random.default_rng(3).uniform(-2.0, 2.0, (8, network.components))
    run = simulate(network, starts @ symmetry.basis.T @ symmetry.basis, 20.0 * orbit.period,
                   lock=(1.0, symmetry), progress=False)
    sizes = 0.5 * np.ptp(run.x[:, run.t > 10.0 * orbit.period, 0], axis=1)
    assert np.abs(sizes / orbit.levels[0, 0, 1] - 1.0).min() < 1e-4


def test_what_was_searched_is_said():
    network = PRESETS['delayed']['trot'].network
    with pytest.raises(NoOrbit, match=r'0\.7446; searched from 15 starts and 1 Hopf'):
        coexisting_orbits(network, 'pace', everything=False)
    with pytest.raises(NoOrbit, match=r'no pace .*; searched from 15 starts$'):
        coexisting_orbits(PRESETS['quadruped']['trot'].network, 'pace', everything=False)
    # An orbit that attracts in its class is enough for a plan.
    quick = coexisting_orbits(network, 'trot', starts=False, everything=False)
    assert (len(quick.orbits), quick.searched) == (1, '')


@pytest.mark.parametrize('seed', [0, *in_depth(1, 2, 3)])
def test_what_simulations_settle_on_is_found_and_attracts(seed):
    rng = np.random.default_rng(4100 + seed)
    seen = 0
    for _ in range(4):
        network = Biped.symmetric(rng.uniform(0.2, 0.32), rng.uniform(0.15, 0.4),
                                  *rng.uniform(-1, 1, 3))
        for gait in ('walk', 'run', 'two_legged_jump', 'two_legged_hop'):
            for period in settled(network, gait, rng):
                orbits = coexisting_orbits(network, gait, everything=False).orbits
                ours = [one for one in orbits if abs(one.period / period - 1.0) < 3e-3]
                assert ours and multipliers_within(ours[0]).leading < 1.0, (network, gait, period)
                assert multipliers_within(orbits[0]).leading < 1.0
                seen += 1
    assert seen


def test_slow_relaxation_oscillations_are_found_when_all_orbits_are_asked_for():
    """A jump below its critical delay, on which every start settles; no branch leads to it."""
    network = Delayed(-4.4405, 0.5554, 6.0639, 2.361, 0.7308)
    periods = settled(network, 'jump', np.random.default_rng(11), 300.0)
    assert periods and max(periods) - min(periods) < 1e-3
    found = coexisting_orbits(network, 'jump').orbits
    assert found[0].period == pytest.approx(periods[0], abs=1e-3)
    assert multipliers_within(found[0]).leading < 1.0


def test_a_cycle_of_three_spikes_is_found_where_variables_are_in_millivolts(tmp_path):
    """Hodgkin-Huxley cells that excite each other: intervals of 49.5, 49.8 and 60.4 ms."""
    page = Path(__file__).parents[2] / 'docs' / 'tutorials' / 'own_network.md'
    text = re.search(r':name: half_centre\.py\n\n(.*?)```', page.read_text(), re.DOTALL)[1]
    (path := tmp_path / 'spiking.py').write_text(text.replace("'half_centre'", "'spiking'"))
    network = find_network(str(path))(10.092, 0.49404, 0.0)
    symmetry = network.symmetry('hop')
    start = np.array([-50.0, -50.0, *[0.3] * 8])
    run = simulate(network, start, 2000.0, network.step, lock=(1.0, symmetry), progress=False)
    v = run.x[:, 0]
    spikes = run.t[np.flatnonzero((v[:-1] < -20.0) & (v[1:] >= -20.0))][-7:]
    found = coexisting_orbits(network, 'hop', everything=False)
    assert found.orbits[0].period == pytest.approx(spikes[3] - spikes[0], abs=0.05)
    assert spikes[6] - spikes[3] == pytest.approx(spikes[3] - spikes[0], abs=0.05)
    assert multipliers_within(found.orbits[0]).leading < 1.0


@pytest.mark.parametrize(('values', 'gait', 'period'), [
    # Slow relaxation orbits on which 5 of 6 random starts settle.
    ((-0.28129668681149644, -0.30217867035994656, 0.24333118851100943, 0.32137435218052846,
      -0.060000727346913245, -0.029765008121790552), 'jump', 26.79595)])
def test_slow_relaxation_orbits_of_the_quadruped_are_found(values, gait, period):
    orbits = coexisting_orbits(Quadruped(*values), gait, everything=False).orbits
    assert orbits[0].period == pytest.approx(period, abs=1e-4)
    assert multipliers(orbits[0]).attracts


def test_what_is_too_stiff_for_the_step_is_not_called_none():
    with pytest.raises(NoOrbit, match=r'steps of 0.02 model time run away .* shorter .step.'):
        coexisting_orbits(van_der_pol(1.0, 1.0)(1e4, -0.1), 'walk', everything=False)


def test_an_orbit_whose_period_has_doubled_is_found():
    # Simulations settle on cycles of 18.821 and 18.726 by turns.
    network = Biped.symmetric(0.3161816416321398, 0.272792643624282, 0.3769364125267425,
                              0.18598910346640518, -0.790205646865161)
    found = coexisting_orbits(network, 'one_legged_hop', everything=False).orbits[0]
    assert found.period == pytest.approx(18.8214 + 18.7258, abs=1e-3)
    assert multipliers_within(found).attracts
    states = found(np.array([0.0, 0.25, 0.5, 1.0]) * found.period)
    assert np.abs(states[2] - states[0]).max() > 1e-3 > 1e6 * np.abs(states[3] - states[0]).max()


@dataclass(frozen=True)
class Stiff(TwoSided):
    """Van der Pol cells with mu 200, and the step of a soft network."""

    mu: float = 200.0
    k: float = -0.1

    name = 'stiff'
    ranges = {'mu': WIDE, 'k': WIDE}
    couplings = ('k',)
    line = 'k'

    @staticmethod
    def equations(cell, p):
        x, y = cell.now()
        other, _ = cell.now(OTHER)
        return y, p.mu * (1.0 - x**2) * y - x + p.k * (other - x)


@pytest.mark.parametrize(('gait', 'period'), [('hop', 323.916), ('walk', 404.694)])
def test_orbits_of_a_stiff_network_are_found_where_its_step_is_too_long(gait, period):
    # As scipy's LSODA finds them with both cells; x has the range 2 for large mu.
    found = coexisting_orbits(Stiff(), gait, everything=False).orbits[0]
    assert found.period == pytest.approx(period, abs=1e-3)
    assert found.levels[0, 0, 1] == pytest.approx(2.0, abs=1e-3)
    assert found.error < 1e-8
