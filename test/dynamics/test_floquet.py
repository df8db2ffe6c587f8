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

"""Floquet multipliers against flows of the whole network; which gaits attract, and in noise."""

from functools import cache

from cpg_ros.dynamics.continuation import continue_orbit
from cpg_ros.dynamics.floquet import Multipliers, multipliers, smallest_gain, stable
from cpg_ros.dynamics.integration.simulate import simulate
from cpg_ros.dynamics.mesh.floquet import eigenvalues
from cpg_ros.dynamics.solve_orbit import solve_preset
from cpg_ros.dynamics.stability import MAX_LOCK_RATE, stability
from cpg_ros.motion.phase_readout import PhaseReadout
from cpg_ros.networks.library.biped import Biped
from cpg_ros.networks.library.quadruped import Quadruped
from cpg_ros.networks.network import ParameterLine, Preset
from cpg_ros.networks.registry import PRESETS
from depth import in_depth, spread
import numpy as np
import pytest
from read_joints import clocks_at, look
from scipy.integrate import solve_ivp

ALL = [(network, name) for network in ('quadruped', 'biped') for name in PRESETS[network]]
EVERY = pytest.mark.parametrize(('network', 'name'), spread(ALL))


@cache
def solved(network, name):
    orbit = solve_preset(PRESETS[network][name])
    return orbit, multipliers(orbit), stability(orbit)


def on_class(orbit):
    """Return the projector on Fix(K): the mean over the permutations that shift by nothing."""
    size, whole = orbit.network.cells, []
    for name in orbit.symmetry.k:
        g = np.eye(size)[list(orbit.symmetry.group.elements[name])]
        whole.append(np.kron(np.eye(2), g))
    return np.mean(whole, axis=0)


def paired(found, wanted):
    """Largest distance of each wanted number to the found one that is left for it."""
    found, gaps = list(found), []
    for one in sorted(wanted, key=abs, reverse=True):
        gaps.append(min(abs(found - np.array(one))))
        found.pop(int(np.abs(found - np.array(one)).argmin()))
    return max(gaps, default=0.0)


def monodromy(orbit, flow, width=1e-5):
    """Return the derivative of the state a period later by that at phase 0, by differences."""
    start = orbit(np.array(0.0))
    moved = flow(np.concatenate([start + width * np.eye(start.size),
                                 start - width * np.eye(start.size)]))
    return (moved[:start.size] - moved[start.size:]).T / (2.0 * width)


def strides(orbit, starts, count, gain=0.0):
    """States after each of some periods of simulation, shape (batch, count, components)."""
    steps = int(np.ceil(orbit.period / orbit.network.step))
    return simulate(orbit.network, starts, count * orbit.period, orbit.period / steps,
                    lock=(gain, orbit.symmetry), every=steps).x[:, 1:]


@EVERY
def test_multipliers_are_those_of_the_flow(network, name):
    orbit, mine, _ = solved(network, name)

    def flow(starts):
        sizes = starts.shape
        return solve_ivp(lambda t, x: orbit.network.rates(x.reshape(sizes)).ravel(),
                         (0.0, orbit.period), starts.ravel(), 'DOP853', rtol=1e-10,
                         atol=1e-12).y[:, -1].reshape(sizes)
    matrix, inside = monodromy(orbit, flow), on_class(orbit)
    assert np.linalg.matrix_rank(inside) == mine.within.size + 1
    outside = np.eye(len(inside)) - inside
    # The flow keeps the class and, to first order, what is orthogonal to it.
    assert max(np.abs(a @ matrix @ b).max() for a, b in ((inside, outside), (outside, inside))
               ) < 1e-4
    assert abs(mine.trivial - 1.0) < 1e-6
    for own, part in (([mine.trivial, *mine.within], inside), (mine.transverse, outside)):
        found = np.linalg.eigvals(part @ matrix @ part)
        assert paired(found, own) < 1e-4 * max(abs(found).max(), 1e-2)
    sizes = np.abs(mine.within), np.abs(mine.transverse)
    assert all((np.diff(size) <= 1e-12).all() for size in sizes)


@EVERY
def test_small_disturbances_grow_by_the_multipliers(network, name):
    # Along eigenvectors in and outside the class, for three periods, with and without a lock.
    orbit, mine, _ = solved(network, name)
    start, inside = orbit(np.array(0.0)), on_class(orbit)
    values, vectors = np.linalg.eig(monodromy(orbit, lambda x: strides(orbit, x, 1)[:, 0]))
    parts = (inside, mine.within, 0.0), (np.eye(start.size) - inside, mine.transverse, 0.1)
    for part, own, locked in parts:
        for value, vector, left in zip(values, vectors.T, np.linalg.inv(vectors), strict=True):
            belongs = np.linalg.norm(part @ vector) > 0.99 and abs(value - 1.0) > 1e-3
            if not belongs or abs(value) < 0.01:
                continue
            wanted = own[np.abs(own - value).argmin()]
            width = 1e-5 * min(1.0, abs(value)**-3)
            rows = width * np.array([vector.real, vector.imag, -vector.real, -vector.imag])
            for gain in (0.0, 0.1):
                runs = strides(orbit, start + rows, 3, gain)
                later = (runs[0] - runs[2] + 1j * (runs[1] - runs[3])) / (2.0 * width)
                decay = np.exp(-locked * orbit.period) if gain else 1.0
                growth = later @ left
                assert np.allclose(growth, (wanted * decay)**np.arange(1, 4), 2e-3, 1e-5)


@EVERY
def test_shipped_gaits_attract(network, name):
    orbit, mine, judged = solved(network, name)
    assert judged.reason == '' and multipliers(orbit, judged.lock_gain).leading < 1.0
    # The gain chosen lets what is transverse decay by RATE at least, and none is spent beyond.
    gain = judged.lock_gain
    slowest = np.log(max(np.abs(mine.transverse), default=1e-300)) / orbit.period - gain
    assert slowest <= -MAX_LOCK_RATE + 1e-9 and (gain == 0.0 or slowest >= -MAX_LOCK_RATE - 1e-9)
    enough = smallest_gain(orbit)
    assert judged.enough == enough <= judged.lock_gain
    assert np.abs(mine.transverse).max(initial=0.0) <= np.exp(enough * orbit.period) + 1e-9


@EVERY
def test_shipped_gaits_survive_noise(network, name):
    orbit, _, judged = solved(network, name)
    cells = np.arange(orbit.network.cells)
    readout = PhaseReadout(orbit, cells, np.zeros((cells.size, 6)), cells, 3)
    scratch = np.zeros((2, cells.size))
    runs = simulate(orbit.network, [orbit, orbit], 500.0, orbit.network.step, every=20,
                    lock=(judged.lock_gain, orbit.symmetry), noise=0.01, seed=3)
    for x, slopes in zip(runs.x, runs.slopes, strict=True):
        phases, clocks = np.empty((len(x), cells.size)), clocks_at(readout, 0.0)
        for k, now in enumerate(zip(x, slopes, slopes, strict=True)):
            look(readout, np.array(now), runs.t[1] / orbit.period, clocks, *scratch, phases[k])
        unwound = np.unwrap(phases[:, 0], period=1.0)
        assert unwound[-1] - unwound[0] == pytest.approx(500.0 / orbit.period, rel=0.02)
        stride = int(orbit.period / runs.t[1])
        assert (unwound[stride:] - unwound[:-stride] > 0.75).all()
        waves = [np.flatnonzero(orbit.waves == wave)[0] for wave in orbit.waves]
        late = np.exp(2j * np.pi * (phases - phases[:, waves] - orbit.phases))
        means = np.add.reduceat(late, np.arange(0, len(late) - stride, stride))
        # Between neighbouring gaits are 0.25. The paper's jump couples its pairs of cells by 0.01
        # only (multipliers 0.96): they wander further than others.
        wander = 0.2 if (network, name) == ('quadruped', 'jump') else 0.1
        assert np.abs(np.angle(means)).max() < 2.0 * np.pi * wander


def test_an_orbit_that_does_not_attract_is_told():
    # Hopping cells feel no coupling; beside rest this one has an unstable cycle, which attracts
    # when time runs backward.
    network = Biped.symmetric(0.4, 0.15, 0.3, 0.3, 0.3)
    back = solve_ivp(lambda t, x: -network.rates(x), (0.0, 300.0), np.repeat([0.1, 0.45], 4),
                     'DOP853', rtol=1e-9, atol=1e-11, dense_output=True).sol
    times = np.linspace(270.0, 300.0, 30_001)
    v = back(times)[0]
    peaks = np.flatnonzero((v[1:-1] > v[:-2]) & (v[1:-1] >= v[2:])) + 1
    period = float(np.diff(times[peaks]).mean())
    start = tuple(float(value) for value in back(times[peaks[0]]))
    orbit = solve_preset(Preset('two_legged_hop', network, start, period))
    assert orbit.period == pytest.approx(period, rel=1e-4)
    assert np.abs(orbit(np.array(0.0)) - start).max() < 1e-4
    nudge = 1e-7 * np.ones((2, 1)) * orbit(np.array(0.0)) * [[1.0], [-1.0]]
    apart = np.diff(strides(orbit, orbit(np.array(0.0)) + nudge, 12), axis=0)[0]
    # Differences of successive strides are free of the shift along the orbit.
    grown = np.linalg.norm(np.diff(apart, axis=0), axis=1)
    (within,) = multipliers(orbit).within
    assert grown[-1] / grown[-2] == pytest.approx(within.real, rel=1e-3)
    assert within.real == pytest.approx(1.5715, abs=1e-4)
    assert stability(orbit).reason.endswith('own symmetry class grows 1.571 times a stride')


def test_a_gait_attracts_only_if_disturbances_outside_its_class_decay_too():
    orbit = solve_preset(PRESETS['delayed']['trot'])
    alone = multipliers(orbit)
    assert np.abs(alone.within).max() < 1.0 < np.abs(alone.transverse).max()
    assert not alone.attracts
    locked = multipliers(orbit, stability(orbit).lock_gain)
    assert np.abs(locked.transverse).max() < 1.0 and locked.attracts


def test_a_verdict_says_where_the_multiplier_cannot_be_told_from_1():
    for modulus, error, verdict in ((0.999, 0.0, True), (1.001, 0.0, False), (1.0, 0.0, None),
                                    (1.0 + 5e-8, 0.0, None), (0.999, 0.01, None),
                                    (1.001, 0.01, None), (0.98, 0.01, True), (1.02, 0.01, False)):
        assert stable(modulus, error) is verdict
    # As of uncoupled rings: a shift of one against the other neither grows nor decays.
    neutral = Multipliers(1.0, 0.0, np.zeros(1), 1.0 + 1e-12, (np.ones(1),))
    assert neutral.attracts is None and neutral.attracts_within is True
    fold = Multipliers(1.0, 0.0, np.array([1.0 + 1e-9]), 1.0 + 1e-8)
    assert fold.attracts_within is None and fold.unstable == 1


@pytest.mark.parametrize('change', [{}, *in_depth({'alpha': -0.6}, {'alpha': -0.3})])
def test_the_smallest_multipliers_are_right_beside_the_largest(change):
    # Together they multiply volumes as the divergence along the orbit does (Liouville). Beyond
    # alpha 0.1 the smallest are below what a float can hold.
    walk = PRESETS['quadruped']['walk']
    along = ParameterLine.parse('alpha', Quadruped)
    value = change.get('alpha', walk.network.alpha)
    (orbit,) = continue_orbit(solve_preset(walk), along, -1.0, 1.0, both=True).at(value)
    found = multipliers(orbit)
    theta = (np.arange(200_000) + 0.5) / 200_000
    divergence = np.trace(orbit.network.jacobian(orbit(theta * orbit.period)), axis1=-2, axis2=-1)
    sizes = np.log(np.abs([*found.within, *found.transverse]))
    assert sizes.sum() == pytest.approx(orbit.period * divergence.mean(), abs=1e-4)
    assert abs(found.trivial - 1.0) < 1e-9


def test_eigenvalues_of_a_long_product():
    # Made of its eigenvalues, in columns that differ from factor to factor.
    wanted, n, rng = [6e14, 0.8 + 0.6j, 0.8 - 0.6j, -1.0, 1e-9], 60, np.random.default_rng(5)
    columns = [np.linalg.qr(rng.normal(size=(5, 5)))[0] for _ in range(n)]
    roots = np.abs(wanted) ** (1.0 / n)
    first = np.diag(np.real(wanted) / roots**(n - 1))
    first[1, 2], first[2, 1] = 0.6, -0.6
    factors = [columns[(k + 1) % n] @ (np.diag(roots) if k else first) @ columns[k].T
               for k in range(n)]
    found = eigenvalues(np.array(factors))
    assert paired(found / np.abs(found), np.array(wanted) / np.abs(wanted)) < 1e-12
    assert np.allclose(np.sort(np.abs(found)), np.sort(np.abs(wanted)), 1e-12)
