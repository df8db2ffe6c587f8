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

"""The core in C does what the tick in plain Python does, whatever is asked of it and when."""

from functools import cache

from cpg_ros.motion.pattern import Pattern
from cpg_ros.motion.plan import plan, PlanError
from cpg_ros.motion.robot_file import load_robot
from cpg_ros.motion.strides import StrideCommand
from cpg_ros.networks.registry import PRESETS
from depth import in_depth
import numpy as np
from plain_pattern import PlainPattern, PlainStrides
import pytest

SEED = 5757
#: Requests of a story, and the longest pause between two, s.
REQUESTS, PAUSE = 12, 0.15
ACTIONS = ('apply', 'apply', 'enable', 'resume', 'steer', 'trim', 'correct', 'scale', 'push',
           'nan')


@cache
def plans(network, duty):
    """All gaits of a network that the robot can take."""
    robot, found = load_robot('biped' if network == 'biped' else 'quadruped'), []
    for name, preset in PRESETS[network].items():
        try:
            found.append(plan(robot, name, preset, preset.network, 1.5, duty=duty))
        except PlanError:
            continue
    assert found
    return found


class Pair:
    """The core and the plain pattern, of which the same is asked."""

    def __init__(self, network, duty, draws):
        self.plans, self.draws = plans(network, duty), draws
        first = self.plans[draws.integers(len(self.plans))]
        legs, ramp = len(first.robot.legs), draws.choice([0.0, 0.4])
        steered = draws.random() < 0.7
        self.core = Pattern(first, ramp, strides=StrideCommand(legs) if steered else None)
        self.plain = PlainPattern(first, ramp, PlainStrides(legs) if steered else None)
        self.dt, self.time = draws.choice([0.001, 0.004, 0.02]), 0.0
        self.alike = 1e-12
        if draws.random() < 0.5:
            found = self.plain.offset + draws.uniform(-0.2, 0.2, self.plain.offset.size)
            self.core.start_from(found, 0.2)
            self.plain.start_from(found, 0.2)
        self.wave = draws.uniform(-0.1, 0.1, self.plain.offset.size)

    def correction(self, wanted):
        return wanted + self.wave * np.sin(20.0 * self.time + wanted)

    def ask(self, what):
        core, plain, draws = self.core, self.plain, self.draws
        if what == 'apply':
            request = self.plans[draws.integers(len(self.plans))], draws.choice([0.01, 0.3])
            core.apply(*request)
            plain.waiting = [request]
        elif what == 'enable':
            on, ramp = draws.random() < 0.6, draws.choice([0.0, 0.2])
            core.enable(bool(on), ramp)
            plain.ramp.go(float(on), max(ramp, 0.05))
            if plain.approach.parts and not on:
                left = plain.approach.level * np.abs(plain.found)
                plain.approach.go(0.0, max(ramp, 0.05, np.max(3.0 * left / plain.limits[2])))
        elif what == 'resume':
            stall = draws.choice([0.003, 0.05, 0.5])
            core.resume(stall)
            plain.resume(stall)
        elif what in ('steer', 'trim') and plain.strides is not None:
            strides = draws.uniform(-1.0, 1.0, plain.strides.trim.size)
            if what == 'trim':
                core.strides.trim = plain.strides.trim = 0.3 * strides
            else:
                pace = draws.uniform(0.6, 1.2)
                core.strides.set_target(strides, pace)
                plain.strides.target = np.append(strides, pace)
        elif what == 'correct':
            plain.correct = self.correction if draws.random() < 0.7 else None
        elif what == 'scale':
            core.frequency_scale = plain.scale = draws.uniform(0.5, 1.2)
        elif what in ('push', 'nan'):
            # A push can bring a cell near the origin of its plane, where the angle of its state,
            # and so phase, retiming and fast joints, enlarge roundings of the state by 1 / radius.
            self.alike = 1e-11 if what == 'push' else self.alike
            stepper = plain.tracks[-1].stepper
            offset = np.full(stepper.network.components, np.nan) if what == 'nan' else \
                draws.uniform(-0.1, 0.1, stepper.network.components) * np.abs(stepper.now[0]).max()
            for pattern in (plain.tracks, core._tracks):
                pattern[-1].stepper.disturb(offset)

    def run(self, time):
        core, plain = self.core, self.plain
        for _ in range(max(1, round(time / self.dt))):
            if plain.correct is None:
                core.advance(self.dt)
            else:
                core.move(self.dt, plain.correct(core.plan_tick(self.dt)))
            plain.advance(self.dt)
            self.time += self.dt
            assert np.abs(core.position - plain.position).max() <= self.alike
            assert np.abs(core.velocity - plain.velocity).max() <= 1e3 * self.alike
            late = core.phases - plain.tracks[-1].legs
            assert np.abs(late - np.round(late)).max() <= self.alike
            assert core.faults == plain.faults and core.plan is plain.tracks[-1].plan


def tell(network, duty, story):
    """Ask both the same, in the order that a number draws, and compare them at every tick."""
    draws = np.random.default_rng([SEED, story])
    pair = Pair(network, duty, draws)
    asked = []
    try:
        for _ in range(REQUESTS):
            pair.run(draws.uniform(0.0, PAUSE))
            asked.append(ACTIONS[draws.integers(len(ACTIONS))])
            pair.ask(asked[-1])
        pair.run(PAUSE)
    except AssertionError as error:
        raise AssertionError(f'{network}, story {story}: {asked}: {error}') from error


@pytest.mark.parametrize('duty', [0.0, *in_depth(0.55)])
@pytest.mark.parametrize('network', PRESETS)
def test_core_and_plain_python_do_the_same(network, duty, request):
    """In depth, 10,000 requests of all networks together; with duty factors, half of them.

    Angles and phases agree within 1e-12, and within 1e-11 once a network has been pushed.
    """
    deep = request.config.option.hypothesis_profile == 'deep'
    for story in range(1 + deep * (10000 // (REQUESTS * len(PRESETS) * 2))):
        tell(network, duty, story)
