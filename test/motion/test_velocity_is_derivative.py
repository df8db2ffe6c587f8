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

"""Velocities are the derivatives of the positions: of any set that runs, whatever happens to it.

Between two ticks at 100 Hz a difference quotient is not the derivative. The measure is therefore
the integral of the velocity over a tick: by Simpson's rule over the ticks of a twin that is told
the same and ticks four times as often; and the twins' velocities have to agree. Noise reaches the
twins at other instants, and then they are two motions: there the integral is taken over a
pattern's own ticks, by the rule of fourth order that uses a tick more on either side.
"""

from dataclasses import replace
from functools import cache
from pathlib import Path

from cpg_ros.dynamics.integration.stepper import Stepper
from cpg_ros.motion.pattern import Pattern
from cpg_ros.motion.plan import plan, plan_gait, PlanError
from cpg_ros.motion.robot_file import load_robot, read_robot
from cpg_ros.motion.strides import StrideCommand
from cpg_ros.networks.registry import PRESETS
from depth import in_depth, spread
import numpy as np
import pytest

ROBOTS = {name: read_robot(Path(__file__).parents[2] / 'config' / f'{name}.yaml')
          for name in ('quadruped', 'biped')}
#: Steep orbits: cells double back, and the angle in their plane hardly turns, or turns back.
STEEP = [('trot', {'alpha': -0.6549, 'beta': -1.3162, 'gamma': -0.6, 'delta': -0.6}),
         ('walk', {'alpha': 0.0078, 'beta': -0.0085, 'gamma': -1.3068, 'delta': -1.201})]
#: Random sets of each network, and how far they are from a preset's (fraction of each value).
SETS, SPREAD = 4, 0.5
#: Ticks of the twin in one.
TICKS = 4
SIMPSON = np.array([1.0, 4.0, 2.0, 4.0, 1.0]) / 12.0
EACH = pytest.mark.parametrize('network', spread(PRESETS, 2))
RATES = pytest.mark.parametrize('rate', [500.0, *in_depth(100.0, 2000.0)])


@cache
def plans(network):
    """Random sets of a network that run, after the known steep ones of the quadruped's."""
    rng, robot = np.random.default_rng(19), ROBOTS['biped' if network == 'biped' else 'quadruped']

    def planned(name, changes):
        preset = PRESETS[network][name]
        return plan(robot, name, preset, replace(preset.network, **changes),
                    rng.uniform(1.0, 2.0))

    found = [planned(*steep) for steep in STEEP if network == 'quadruped']
    count = SETS + len(found)
    while len(found) < count:
        name = str(rng.choice(list(PRESETS[network])))
        known = PRESETS[network][name]
        changes = {}
        for family in known.network.families(known.network.symmetry(known.gait)):
            factor = 1.0 + SPREAD * rng.uniform(-1.0, 1.0)
            changes |= {key: factor * getattr(known.network, key) for key in family}
        try:
            found.append(planned(name, changes))
        except PlanError:
            continue
    return found


class Twins:
    """A pattern at a rate, and one that does the same at four times that rate."""

    def __init__(self, plan, rate):
        self.pair, self.dt = [Pattern(plan, 0.3), Pattern(plan, 0.3)], 1.0 / rate

    def both(self, method, *arguments):
        for pattern in self.pair:
            getattr(pattern, method)(*arguments)

    def disturb(self, offset):
        for pattern in self.pair:
            pattern._tracks[0].stepper.disturb(offset)

    def check(self, time, *plans):
        """Advance by a time and hold every tick against the velocities."""
        one, twin = self.pair
        speed = np.max([plan.speed for plan in plans], axis=0)
        for _ in range(round(time / self.dt)):
            before, rates = one.position.copy(), [twin.velocity.copy()]
            one.advance(self.dt)
            for _ in range(TICKS):
                twin.advance(self.dt / TICKS)
                rates.append(twin.velocity.copy())
            step = (one.position - before) / self.dt
            assert (np.abs(step - SIMPSON @ rates) <= 0.005 * speed + 1e-9).all()
            assert (np.abs(one.velocity - twin.velocity) <= 0.005 * speed + 1e-9).all()
            assert one.held == twin.held == 0


def run(pattern, time, rate, before=lambda: None):
    """Positions and velocities after each tick, shape (n, 2, joints)."""
    rows = np.empty((round(time * rate), 2, pattern.position.size))
    for row in rows:
        before()
        pattern.advance(1.0 / rate)
        row[:] = pattern.position, pattern.velocity
    return rows


def check_own(rows, dt, plan):
    """Hold ticks, as ``run`` gives them, against their own velocities."""
    position, velocity = rows[:, 0], rows[:, 1]
    mean = (13.0 * (velocity[1:-2] + velocity[2:-1]) - velocity[:-3] - velocity[3:]) / 24.0
    step = (position[2:-1] - position[1:-2]) / dt
    assert (np.abs(step - mean) <= 0.005 * plan.speed + 1e-9).all()


def test_steps_are_between_velocities_where_a_network_turns_within_a_tick():
    """A delayed network that finds its own way to a gait passes close to its planes' origins."""
    robot, rate, draws = load_robot('unitree_go2'), 500.0, np.random.default_rng(10)
    gaits = [plan_gait(robot, gait, frequency, network='delayed')
             for gait in PRESETS['delayed'] for frequency in (0.5, 1.3, 2.2)]
    pattern, limit = Pattern(gaits[0], 0.2, strides=StrideCommand(4)), robot.column('velocity')
    for _ in range(400):
        draw = draws.random()
        if draw < 0.4:
            pattern.apply(gaits[draws.integers(len(gaits))], 0.0)
        elif draw < 0.7:
            pattern.enable(bool(draws.random() < 0.7), 0.2)
        pattern.steer(draws.uniform(-1.0, 1.0, 4), draws.uniform(0.6, 1.3))
        position, velocity = run(pattern, draws.uniform(0.01, 0.08), rate).swapaxes(0, 1)
        step = np.diff(position, axis=0) * rate
        beside = step - np.clip(step, np.minimum(velocity[:-1], velocity[1:]),
                                np.maximum(velocity[:-1], velocity[1:]))
        assert (np.abs(beside) <= 0.05 * limit).all()


def test_where_strides_change_while_a_ramp_is_slowed():
    robot, rate = load_robot('unitree_go2'), 2000.0
    gaits = [plan_gait(robot, gait, frequency)
             for gait, frequency in (('trot', 2.2), ('walk', 1.3), ('trot', 0.5), ('walk', 0.5))]
    pattern, draws, rows = Pattern(gaits[0], 0.2, strides=StrideCommand(4)), np.random.default_rng(
        5), []
    for _ in range(60):
        draw = draws.random()
        if draw < 0.3:
            # The network's own way to another gait is faster than the joints: the clock slows.
            pattern.apply(gaits[draws.integers(4)], 0.0)
        elif draw < 0.6:
            pattern.enable(bool(draws.random() < 0.7), 0.2)
        pattern.steer(draws.uniform(-1.0, 1.0, 4), draws.uniform(0.6, 1.3))
        rows.append(run(pattern, 0.05, rate))
    position, velocity = np.concatenate(rows).swapaxes(0, 1)
    steps = np.diff(position, axis=0) * rate
    beside = np.maximum(np.minimum(velocity[:-1], velocity[1:]) - steps,
                        steps - np.maximum(velocity[:-1], velocity[1:]))
    assert beside.max() < 0.02


@EACH
@RATES
def test_in_a_gait_in_switches_and_after_a_re_seed(network, rate):
    sets = plans(network)
    for old, new in zip(sets, sets[1:] + sets[:1], strict=True):
        twins = Twins(old, rate)
        twins.check(0.9, old)
        twins.both('apply', new, 0.4)
        twins.check(0.7, old, new)
        assert not any(pattern.in_transition for pattern in twins.pair)
        twins.disturb(np.full(new.orbit.network.components, np.nan))
        twins.check(0.5, new)
        assert [pattern.faults for pattern in twins.pair] == [1, 1]


@EACH
@RATES
def test_on_the_way_back_to_the_orbit(network, rate):
    for k, gait_plan in enumerate(plans(network)):
        orbit, rng = gait_plan.orbit, np.random.default_rng([20, k])
        middle = orbit(np.arange(64) / 64 * orbit.period).mean(axis=0)
        # Where swing is a fifth of the stride, legs that far out of step are out of the gait.
        most = 0.1 if network == 'hopf' else 0.2
        factor = 1.0 + most * rng.uniform(-1.0, 1.0, middle.size)
        pattern = Pattern(gait_plan, 0.2)
        # Every component comes with a size of its own.
        pattern._tracks[0].stepper = Stepper(
            orbit.network, lambda t, orbit=orbit, middle=middle, factor=factor: (
                middle + factor * (orbit(t) - middle)),
            gain=gait_plan.gain, symmetry=orbit.symmetry)
        run(pattern, 0.3, rate)
        check_own(run(pattern, 1.2, rate), 1.0 / rate, gait_plan)
        assert pattern.faults == 0


@pytest.mark.parametrize('network', ['quadruped', 'biped'])
@RATES
def test_with_noise(network, rate):
    for k, gait_plan in enumerate(plans(network)):
        pattern, rng = Pattern(gait_plan, 0.2), np.random.default_rng([21, k])
        size = np.repeat(gait_plan.orbit.levels[0, :, 1], gait_plan.orbit.network.cells)
        stepper, late = pattern._tracks[0].stepper, []

        def kick(pattern=pattern, gait_plan=gait_plan, rng=rng, size=size, stepper=stepper,
                 late=late):
            stepper.disturb(0.2 * size / np.sqrt(rate) * rng.standard_normal(size.size))
            late.append(pattern.phases - gait_plan.orbit.phases[gait_plan.robot.leg_cells])

        run(pattern, 0.5, rate)
        check_own(run(pattern, 1.5, rate, kick), 1.0 / rate, gait_plan)
        # The legs feel it, each in its own way.
        apart = (np.array(late) - late[0] + late[0][0] - np.array(late)[:, :1] + 0.5) % 1.0
        assert np.ptp(apart, axis=0).max() > 1e-3 and pattern.faults == 0


@pytest.mark.parametrize('network', ['quadruped', 'biped'])
def test_a_transition_of_0_s_hardly_outruns_the_gaits(network):
    sets = plans(network)
    for old, new in zip(sets, sets[1:] + sets[:1], strict=True):
        run(pattern := Pattern(old, 0.2), 2.0, 500.0)
        pattern.apply(new, 0.0)
        fastest = np.maximum(old.speed, new.speed)
        check_own(rows := run(pattern, 4.0, 500.0), 0.002, replace(new, speed=fastest))
        # A cell's clock runs faster than the strides by half at most.
        assert (np.abs(rows[:, 1]) <= 1.5 * fastest + 1e-9).all() and pattern.held == 0
