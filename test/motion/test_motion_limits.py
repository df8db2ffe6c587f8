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

"""Whatever is asked of a pattern and when, with times of 0 s too: limits, and true velocities."""

from functools import cache

from cpg_ros.motion.pattern import HOLD_TIME, Pattern
from cpg_ros.motion.plan import plan, PlanError
from cpg_ros.motion.robot_file import load_robot
from cpg_ros.networks.registry import PRESETS
from depth import examples
from hypothesis import given
from hypothesis import strategies as st
import numpy as np
import pytest

TIMES = st.sampled_from([0.0, 0.0, 0.01, 0.3])
#: Seconds of a step of a story.
PAUSES = st.floats(0.0, 0.7)
ACTIONS = st.one_of(
    st.tuples(st.just('enable'), st.booleans(), TIMES),
    st.tuples(st.just('apply'), st.integers(0, 99), TIMES),
    st.tuples(st.just('restart'), TIMES, st.booleans()),
    st.tuples(st.just('resume'), st.sampled_from([0.003, 0.05, 0.5])))
EACH = pytest.mark.parametrize('network', PRESETS)


@cache
def plans(network):
    """All gaits of a network that the robot can take at this frequency."""
    robot, found = load_robot('biped' if network == 'biped' else 'quadruped'), []
    for name, preset in PRESETS[network].items():
        try:
            found.append(plan(robot, name, preset, preset.network, 2.5))
        except PlanError:
            continue
    assert found
    return found


def check(pattern, dt, time, before, tolerance):
    """Advance and compare each step with limits and velocities; return where it came to."""
    limit = pattern.robot.column('velocity')
    for _ in range(max(1, round(time / dt))):
        position, velocity = before
        pattern.advance(dt)
        step = (pattern.position - position) / dt
        assert (np.abs(step) <= limit * (1.0 + 1e-6)).all()
        low, high = np.minimum(velocity, pattern.velocity), np.maximum(velocity, pattern.velocity)
        assert (np.maximum(low - step, step - high) <= tolerance * limit).all()
        before = pattern.position.copy(), pattern.velocity.copy()
    return before


@EACH
@pytest.mark.parametrize(('rate', 'tolerance'), [(100.0, 0.1), (500.0, 0.04)])
@examples(20)
@given(story=st.lists(st.tuples(ACTIONS, PAUSES), min_size=1, max_size=8))
def test_no_story_outruns_a_limit(network, rate, tolerance, story):
    gaits = plans(network)
    pattern = Pattern(gaits[0], 0.0)
    before = check(pattern, 1.0 / rate, 0.3, (pattern.position.copy(), pattern.velocity.copy()),
                   tolerance)
    for (name, *arguments), pause in story:
        if name == 'apply':
            arguments[0] = gaits[arguments[0] % len(gaits)]
        getattr(pattern, name)(*arguments)
        if name in ('restart', 'resume'):
            # A new motion begins at rest, and after a stall the slower, the longer it was.
            pace = 0.0 if name == 'restart' else max(0.0, 1.0 - arguments[0] / HOLD_TIME)
            before = before[0], pace * before[1]
        before = check(pattern, 1.0 / rate, pause, before, tolerance)


@EACH
def test_a_stop_on_the_way_to_the_stand_shortens_it(network):
    pattern = Pattern(plans(network)[0], 0.0)
    before = check(pattern, 0.002, 1.3, (pattern.position.copy(), pattern.velocity.copy()), 0.04)
    assert np.abs(before[1]).max() > 0.1
    pattern.restart(10.0)
    before = check(pattern, 0.002, 0.5, (before[0], np.zeros_like(before[1])), 0.04)
    pattern.enable(False, 0.5)
    check(pattern, 0.002, 0.52, before, 0.04)
    assert pattern.standing
    assert np.abs(pattern.position - pattern.robot.column('offset')).max() < 1e-12


def test_a_leap_of_a_correction_is_followed_no_faster_than_joints_may():
    pattern, dt = Pattern(plans('delayed')[0], 0.0), 0.002
    for _ in range(500):
        pattern.advance(dt)
    most = pattern.robot.column('velocity') * dt
    assert not pattern.held and (most < 0.1).all()
    before, steps = pattern.position.copy(), []
    for _ in range(50):
        pattern.move(dt, pattern.plan_tick(dt) + 0.2)
        steps.append(pattern.position - before)
        before = pattern.position.copy()
    # Its first steps take all that is allowed; then it is there, and nothing holds it.
    assert steps[0] == pytest.approx(most, rel=1e-6)
    assert (np.abs(steps) <= most * (1.0 + 1e-6)).all()
    held = pattern.held
    pattern.move(dt, pattern.plan_tick(dt) + 0.2)
    assert 0 < held == pattern.held
