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

"""Joints and legs read off the phase of Morris-Lecar cells, alone and in the moving pattern."""

from functools import cache
from itertools import permutations
from pathlib import Path

from cpg_ros.dynamics.solve_orbit import solve_preset
from cpg_ros.motion.pattern import Pattern
from cpg_ros.motion.phase_readout import PhaseReadout
from cpg_ros.motion.plan import plan
from cpg_ros.motion.robot_file import read_robot
from cpg_ros.networks.registry import PRESETS
from depth import in_full, spread
import numpy as np
import pytest
from read_joints import clocks_at, look

ROBOTS = {name: read_robot(Path(__file__).parents[2] / 'config' / f'{name}.yaml')
          for name in ('quadruped', 'biped')}
ALL = [(network, name) for network in ROBOTS for name in PRESETS[network]]
EVERY = pytest.mark.parametrize(('network', 'name'), spread(ALL))
WEIGHTS = np.random.default_rng(6).uniform(-0.5, 0.5, (8, 6))


@cache
def gait_plan(network, name, frequency=1.0):
    preset = PRESETS[network][name]
    return plan(ROBOTS[network], name, preset, preset.network, frequency)


class Theory:
    """What joints on all cells do on an orbit, from the harmonics of the cells' potentials."""

    def __init__(self, orbit, harmonics):
        cells, cycle = orbit.network.cells, np.arange(8192) / 8192
        self.k = np.arange(-harmonics, harmonics + 1)
        self.terms = np.fft.fft(orbit(cycle * orbit.period)[:, :cells], axis=0)[self.k] / 8192
        # Lanczos' factors.
        fraction = self.k / (harmonics + 1)
        self.terms *= (np.sin(np.pi * fraction) / np.pi / np.where(self.k, fraction, 1.0)
                       + (self.k == 0))[:, None]
        x = self.sum(cycle, 0)
        self.middle, self.half = (x.max(axis=0) + x.min(axis=0)) / 2, np.ptp(x, axis=0) / 2
        # A Newton step from the grid to where x peaks.
        top, each = x.argmax(axis=0), np.arange(cells)
        slope, bend = (self.sum(cycle, order)[top, each] for order in (1, 2))
        self.crests = cycle[top] - slope / bend / (2.0 * np.pi)

    def sum(self, theta, order):  # noqa: A003
        turn = np.exp(2j * np.pi * np.multiply.outer(theta, self.k)) * (1j * self.k)**order
        return (turn @ self.terms).real

    def angles(self, theta):
        x, y = (self.sum(theta, 0) - self.middle) / self.half, self.sum(theta, 1) / self.half
        a, b, c, d, e, f = WEIGHTS[:x.shape[1]].T
        return a * x + b * y + c * x**2 + d * x * y + e * x**3 + f * x**2 * y


def looks(readout, theta, states, stride=1e-3):
    """Angles, rises, legs and distances at states, clocks coming from where the gait is then."""
    rows = []
    for phase, state in zip(theta, states, strict=True):
        angle, rise, legs = np.empty((3, state.size // 2))
        now = np.vstack([state, np.full((2, state.size), np.nan)])
        distance = look(readout, now, stride, clocks_at(readout, phase - stride), angle, rise,
                        legs)
        rows.append((angle, rise, legs, distance))
    return [np.array(row) for row in zip(*rows, strict=True)]


@EVERY
@pytest.mark.parametrize('harmonics', [1, 3])
def test_on_the_orbit_joints_and_legs_are_those_of_theory(network, name, harmonics):
    orbit = solve_preset(PRESETS[network][name])
    cells = np.arange(orbit.network.cells)
    theory = Theory(orbit, harmonics)
    readout = PhaseReadout(orbit, cells, WEIGHTS[:cells.size], cells, harmonics)
    theta = np.random.default_rng(7).uniform(0.0, 1.0, 400)
    angle, rise, legs, distance = looks(readout, theta, orbit(theta * orbit.period))
    late = legs - theta[:, None] + theory.crests
    assert np.abs((late + 0.5) % 1.0 - 0.5).max() < 1e-4
    assert np.abs(angle - theory.angles(theta)).max() < 1e-3
    wanted = (theory.angles(theta + 1e-5) - theory.angles(theta - 1e-5)) / 2e-5
    assert np.abs(rise - wanted).max() < 0.01 * np.abs(wanted).max()
    assert distance.max() < 0.01
    # The tables from which a program's limits are checked.
    even = np.arange(512) / 512
    phase = (even[:, None] + orbit.phases) % 1.0
    mine = [np.interp(row, even, table, period=1.0) for row, table in zip(
        phase.T, readout.angles, strict=True)]
    assert np.abs(np.transpose(mine) - theory.angles(even)).max() < 1e-3


@EVERY
def test_a_state_off_the_orbit_is_told(network, name):
    orbit = solve_preset(PRESETS[network][name])
    cells, cycle = np.arange(orbit.network.cells), np.arange(256) / 256 * orbit.period
    readout = PhaseReadout(orbit, cells, WEIGHTS[:cells.size], cells, 3)
    rest, on_it = orbit(cycle).mean(axis=0), orbit(np.array(0.0))
    # One cell by itself a quarter of a cycle late, or twice as far out.
    late, far = on_it.copy(), on_it.copy()
    late[[cells[-1], -1]] = orbit(np.array(-0.25 * orbit.period))[[cells[-1], -1]]
    far[[cells[-1], -1]] += on_it[[cells[-1], -1]] - rest[[cells[-1], -1]]
    assert (looks(readout, [0.0] * 3, [rest, late, far])[3] > 0.3).all()


@pytest.mark.parametrize('component', [*range(8), slice(None)])
def test_nan_anywhere_comes_through(component):
    orbit = solve_preset(PRESETS['biped']['walk'])
    readout = PhaseReadout(orbit, cells := np.arange(4), WEIGHTS[:4], cells, 3)
    state = orbit(np.array(0.0))
    state[component] = np.nan
    assert np.isnan(looks(readout, [0.0], [state])[3]).all()


def test_a_waveform_that_repeats_within_a_cycle_is_refused():
    orbit = solve_preset(PRESETS['quadruped']['pace'])

    class Twice:
        network, waves, phases, levels = orbit.network, orbit.waves, orbit.phases, orbit.levels

        def waveform(self, theta, *arguments):
            return orbit.waveform(2.0 * theta, *arguments)

    with pytest.raises(ValueError, match='repeats within a cycle: the first harmonic'):
        PhaseReadout(Twice(), np.arange(8), WEIGHTS, np.arange(8), 3)


@EVERY
def test_clocks_come_to_what_the_cells_do(network, name):
    orbit = solve_preset(PRESETS[network][name])
    cells, stride = np.arange(orbit.network.cells), 0.005
    readout = PhaseReadout(orbit, cells, WEIGHTS[:cells.size], cells, 3)
    theory, rng = Theory(orbit, 3), np.random.default_rng(8)
    # Some cells far from where their clocks have them, each in its own way.
    away = rng.uniform(-0.4, 0.4, cells.size)
    clocks = clocks_at(readout, 0.0)
    clocks[0] += away
    angle, rise, legs = np.empty((3, cells.size))

    def run(state_at, strides):
        rows = []
        for k in range(round(strides / stride)):
            theta = (k + 1) * stride
            state = state_at(theta)
            distance = look(readout, np.vstack([state] * 3), stride, clocks, angle, rise, legs)
            rows.append((theta, angle.copy(), distance))
        return [np.array(row) for row in zip(*rows, strict=True)]

    theta, angles, distances = run(lambda theta: orbit(np.array(theta * orbit.period)), 9.0)
    assert distances[0] > 0.3 and distances[-100:].max() < 0.1
    assert np.abs(angles[-200:] - theory.angles(theta[-200:])).max() < 0.01
    # Come to rest, even where they never would, they hardly move their joints any more.
    rest = orbit(np.array(0.0))
    theta, angles, distances = run(lambda theta: rest, 6.0)
    assert (distances[200:] > 0.3).all()
    assert (np.ptp(angles[-200:], axis=0) < 0.15 * np.ptp(theory.angles(theta), axis=0)).all()


def drive(pattern, count, dt=1e-3):
    rows = [(pattern.position.copy(), pattern.velocity.copy(), pattern.phases.copy())]
    for _ in range(count):
        pattern.advance(dt)
        rows.append((pattern.position.copy(), pattern.velocity.copy(), pattern.phases.copy()))
    return [np.array(row) for row in zip(*rows, strict=True)]


def in_swing(one, ticks=65):
    drive(pattern := Pattern(one, ramp=0.2), ticks, 0.02)
    return pattern


@EVERY
def test_the_pattern_moves_as_planned(network, name):
    one, robot = gait_plan(network, name, 1.5), ROBOTS[network]
    position, velocity, phases = drive(pattern := in_swing(one), 1334)
    lower, upper = robot.column('lower'), robot.column('upper')
    assert (position >= lower).all() and (position <= upper).all()
    assert (np.abs(velocity) <= robot.column('velocity')).all()
    # Two strides reach all of the span and of the speed, and no more.
    reach = np.stack([position.min(axis=0), position.max(axis=0)]) - robot.column('offset')
    assert np.allclose(reach, one.span, 0.0, 1e-4)
    assert np.allclose(np.abs(velocity).max(axis=0), one.speed, 0.01, 1e-9)
    rate = (position[2:] - position[:-2]) / 2e-3
    assert (np.abs(rate - velocity[1:-1]) <= 0.01 * one.speed + 1e-9).all()
    steps = np.diff(np.unwrap(phases, axis=0, period=1.0), axis=0)
    assert np.abs(steps - 1.5e-3).max() < 2e-5
    # Legs are as the gait has the cells that give their phases.
    first = [np.flatnonzero(one.orbit.waves == wave)[0] for wave in one.orbit.waves]
    for leg, cell in enumerate(robot.leg_cells):
        if first[cell] in robot.leg_cells:
            other = list(robot.leg_cells).index(first[cell])
            late = phases[:, leg] - phases[:, other] - one.orbit.phases[cell]
            assert np.abs((late + 0.5) % 1.0 - 0.5).max() < 2e-4
    assert (pattern.faults, pattern.held) == (0, 0)


@pytest.mark.parametrize('network', ROBOTS)
def test_no_switch_outruns_or_outreaches_the_gaits(network):
    pairs = list(enumerate(permutations(PRESETS[network], 2)))
    for k, (old, new) in pairs if in_full() else pairs[::4]:
        plans = gait_plan(network, old), gait_plan(network, new)
        pattern = in_swing(plans[0], 65 + 7 * k % 50)
        pattern.apply(plans[1], 1.0)
        position, velocity, _ = drive(pattern, 1300)
        steps, speed = np.diff(position, axis=0), np.max([one.speed for one in plans], axis=0)
        assert (np.abs(steps) <= 1.001e-3 * speed + 1e-9).all(), (old, new)
        deviation = position - ROBOTS[network].column('offset')
        assert (deviation >= np.min([one.span[0] for one in plans], axis=0) - 1e-6).all()
        assert (deviation <= np.max([one.span[1] for one in plans], axis=0) + 1e-6).all()
        error = np.abs(steps / 1e-3 - (velocity[1:] + velocity[:-1]) / 2.0)
        assert (error <= 0.012 * speed + 1e-9).all(), (old, new)
        assert (pattern.faults, pattern.held, pattern.in_transition) == (0, 0, False)
        assert pattern.plan is plans[1]
