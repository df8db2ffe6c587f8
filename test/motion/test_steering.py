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

"""Gaits with motions of their own, and steering: what a stride factor does to the joints."""

from dataclasses import replace

from cpg_ros.motion.pattern import Pattern
from cpg_ros.motion.plan import plan, PlanError
from cpg_ros.motion.robot import SteeringTable
from cpg_ros.motion.robot_file import read_robot, RobotError, write_robot
from cpg_ros.motion.strides import StrideCommand
from cpg_ros.networks.registry import PRESETS
from depth import examples
import go2
from hypothesis import given
from hypothesis import strategies as st
import numpy as np
import pytest
import steered

TURN = 2.0 * np.pi
TABLE = SteeringTable(**{key: tuple(value) for key, value in steered.STEERING.items()})


@pytest.fixture(scope='module')
def robot(tmp_path_factory):
    return read_robot(steered.write(tmp_path_factory.mktemp('robot')))


def gait_plan(robot, gait='trot', network='delayed', **more):
    preset = PRESETS[network][gait]
    return plan(robot, gait, preset, preset.network, **{'frequency': 2.0} | more)


def run(pattern, duration, dt=0.002):
    rows = []
    for _ in range(round(duration / dt)):
        pattern.advance(dt)
        rows.append((pattern.position.copy(), pattern.velocity.copy(), pattern.phases.copy()))
    return [np.array(row) for row in zip(*rows, strict=True)]


def angles(one, phases, strides):
    """Joints from the file's numbers and the orbit alone: offset + (w0 + s (w - w0)) psi."""
    made, orbit, legs = steered.tree(), one.orbit, list(one.robot.legs)
    columns = []
    for leg, name in [(where, joint['name']) for where in legs
                      for joint in made['legs'][where]['joints']]:
        stand = next(j for j in made['legs'][leg]['joints'] if j['name'] == name)
        moved = made['gaits'][one.gait]['joints'].get(name, {})
        full = moved.get('weights', stand.get('weights', [stand.get('amplitude')]))
        still = moved.get('in_place', [])
        full, still = (np.pad(np.array(w, dtype=float), (0, 6 - len(w))) for w in (full, still))
        theta = phases[:, legs.index(leg)]
        x = orbit.waveform(theta) / orbit.peak
        y = orbit.waveform(theta, 1) / orbit.peak / TURN
        psi = np.stack([x, y, x**2, x * y, x**3, x**2 * y])
        weights = still + strides[legs.index(leg)] * (full - still)
        columns.append(moved.get('offset', stand['offset']) + weights @ psi)
    return np.stack(columns, axis=1)


@pytest.mark.parametrize('strides', [[1.0] * 4, [0.0] * 4, [-0.7, 0.9, -0.7, 0.9]])
def test_the_joints_are_what_the_file_says(robot, strides):
    one = gait_plan(robot)
    pattern = Pattern(one, ramp=0.2, strides=StrideCommand(4))
    pattern.steer(np.array(strides), 0.5)
    run(pattern, 1.5)
    position, velocity, phases = run(pattern, 2.0)
    assert np.abs(position - angles(one, phases, strides)).max() < 2e-3
    # At half the pace a stride of 2 Hz takes one second.
    assert np.abs(position[500:] - position[:-500]).max() < 2e-3
    steps = np.diff(position, axis=0) / 0.002
    assert np.abs(steps - (velocity[1:] + velocity[:-1]) / 2.0).max() < 0.01 * one.speed.max()


def test_without_a_drive_it_moves_as_with_full_strides(robot):
    one = gait_plan(robot)
    plain, driven = (run(Pattern(one, strides=command), 3.0)
                     for command in (None, StrideCommand(4)))
    for a, b in zip(plain, driven, strict=True):
        assert np.abs(a - b).max() < 1e-12


@examples(25)
@given(asked=st.lists(st.tuples(*[st.floats(-1.0, 1.0)] * 4, st.floats(0.4, 1.0)), min_size=1,
                      max_size=4), dt=st.sampled_from([0.001, 0.005, 0.02]))
def test_whatever_is_asked_the_joints_move_smoothly(robot, asked, dt):
    one = gait_plan(robot)
    command = StrideCommand(4)
    pattern = Pattern(one, ramp=0.2, strides=command)
    run(pattern, 0.4, dt)
    rows = []
    for *strides, pace in asked:
        pattern.steer(np.array(strides), pace)
        rows.append(run(pattern, 0.3, dt))
        assert np.abs(command.stride).max() < 1.4
    position, velocity, _ = (np.concatenate(row) for row in zip(*rows, strict=True))
    robot = one.robot
    assert (position >= robot.column('lower')).all() and (position <= robot.column('upper')).all()
    # A stride that turns round within T moves a joint by its reach over T, more or less.
    fastest = one.speed + 2.0 * np.ptp(one.span, axis=0) / 0.2
    assert (np.abs(velocity) <= np.minimum(fastest, robot.column('velocity'))).all()
    steps = np.diff(position, axis=0) / dt
    error = np.abs(steps - (velocity[1:] + velocity[:-1]) / 2.0)
    assert (error <= (0.02 + 10.0 * dt) * fastest + 1e-9).all()


def test_strides_are_at_once_what_is_asked_while_nothing_moves(robot):
    pattern = Pattern(gait_plan(robot), enabled=False, strides=StrideCommand(4))
    pattern.steer(np.array([0.2, 0.4, 0.6, 0.8]), 0.7)
    pattern.advance(0.01)
    assert pattern.strides.stride.tolist() == [0.2, 0.4, 0.6, 0.8] and pattern.strides.pace == 0.7


def test_a_drive_approaches_as_a_critically_damped_oscillator():
    # Against a fine integration of s'' = (target - s) / T^2 - 2 s' / T.
    command, s, v, dt = StrideCommand(1), 1.0, 0.0, 1e-5
    command.set_target(np.array([-0.5]), 1.0)
    for tick in range(100):
        if tick == 20:
            command.set_target(np.array([0.8]), 1.0)
        for _ in range(1000):
            v += dt * (((-0.5 if tick < 20 else 0.8) - s) / 0.04 - 2.0 * v / 0.2)
            s += dt * v
        command.advance(0.01)
        assert abs(command.stride[0] - s) < 1e-3 and abs(command.rate[0] - v) < 1e-2


@given(speed=st.floats(-1.0, 1.0), turn=st.floats(-3.0, 3.0))
def test_the_steering_table_is_inverted(speed, turn):
    left, right, frequency = TABLE.ask(speed, turn)
    assert -1.0 <= min(left, right) <= max(left, right) <= 1.0 + 1e-12
    assert 1.0 <= frequency <= 2.0
    if abs(turn) > 1e-9:
        assert (right - left) * turn > 0.0
    near = min(max(speed, -0.2), 0.4)
    if abs(turn) < 0.1:
        # Read forwards: the mean stride gives the speed, the difference the turn.
        assert np.interp((left + right) / 2.0, TABLE.stride, TABLE.speed) == pytest.approx(near)
        assert (right - left) * np.interp(near, TABLE.speed, TABLE.turn) == pytest.approx(turn)


def test_a_gait_without_steering_says_so(robot):
    with pytest.raises(ValueError, match=r"'steered' .* 'pace' \(gaits.pace.steering\)"):
        gait_plan(robot, 'pace').steer(0.1, 0.0)


def test_presets_of_a_gait_move_like_it(robot):
    assert gait_plan(robot, 'liu2024_trot').motion is robot.motions['trot']
    assert gait_plan(robot, 'bound').motion.joints == {}


def test_the_offset_of_a_gait_ramps_with_the_level(robot):
    one = gait_plan(robot)
    pattern = Pattern(one, ramp=1.0, enabled=False)
    assert np.array_equal(pattern.position, robot.column('offset'))
    pattern.enable(True, 1.0)
    run(pattern, 3.0)
    position, _, phases = run(pattern, 0.5)
    assert np.abs(position - angles(one, phases, [1.0] * 4)).max() < 2e-3
    pattern.enable(False, 0.5)
    run(pattern, 1.5)
    assert np.array_equal(pattern.position, robot.column('offset'))


def test_strides_backward_must_stay_within_the_limits_too(robot, tmp_path):
    tree = steered.tree()
    # Forward the calf goes 0.45 below its offset, backward 0.45 above: beyond the upper limit.
    for entry in tree['gaits']['trot']['joints'].values():
        entry.pop('in_place', None)
        if entry['offset'] == -1.6:
            entry.update(offset=-1.0, weights=[0.0, 0.0, -0.45, 0.0])
    path = tmp_path / 'steered.yaml'
    path.write_text(steered.yaml.safe_dump(tree))
    with pytest.raises(PlanError, match=r'_calf_joint to -0\.550 rad, above its limit -0.7'):
        gait_plan(read_robot(path))
    del tree['gaits']['trot']['steering']
    path.write_text(steered.yaml.safe_dump(tree))
    gait_plan(read_robot(path))


def test_motions_survive_writing(robot, tmp_path):
    write_robot(tmp_path / 'steered.yaml', robot)
    assert read_robot(tmp_path / 'steered.yaml') == robot


@pytest.mark.parametrize(('place', 'value', 'why'), [
    ('gallop', {}, 'gaits.gallop: unknown key'),
    ('trot', [], 'gaits.trot: must be a mapping'),
    ('trot.pace', 1, 'gaits.trot.pace: unknown key'),
    ('trot.frequency', 0, 'gaits.trot.frequency: 0 is not from 0.01 to 10 Hz'),
    ('trot.frequency', 'fast', 'gaits.trot.frequency: must be a number'),
    ('trot.joints', None, 'gaits.trot.joints: must be a mapping'),
    ('trot.joints', ['lh_calf_joint'], 'gaits.trot.joints: must be a mapping'),
    ('trot.joints.tail', {}, 'gaits.trot.joints.tail: unknown key'),
    ('trot.joints.lh_calf_joint.offset', 3.0, 'offset: 3 is outside the limits -2.6 to -0.7'),
    ('trot.joints.lh_calf_joint.amplitude', 0.1, "one of 'amplitude' and 'weights'"),
    ('trot.joints.lh_calf_joint.in_place', [0, 0, 0], 'takes 1, 2, 4 or 6 numbers'),
    ('trot.steering.speed', [0.1, 0.2], 'stride: has 3 numbers, and speed has 2'),
    ('trot.steering.speed', [0.1, 0.1, 0.2], r'speed\[1\]: 0.1 is not above 0.1'),
    ('trot.steering.stride', [0, 0.5, 1.5], r'stride\[2\]: 1.5 is not from -1 to 1'),
    ('trot.steering.turn', [0, 1, 1], r'turn\[0\]: 0 is not from 0.001'),
    ('trot.steering.frequency', [1, 2, 5], r'frequency\[2\]: 5 is not from 0.01 to twice the g'),
    ('trot.steering.speed', 0.3, 'speed: must be a list'),
    ('trot.steering.sideways', [0], 'unknown key'),
    ('pace.steering', dict(steered.STEERING), "gaits.pace.steering: needs the gait's 'frequency'"),
])
def test_a_wrong_entry_is_named(tmp_path, place, value, why):
    tree = steered.tree()
    *parents, last = place.split('.')
    node = tree['gaits']
    for key in parents:
        node = node[key]
    node[last] = value
    path = tmp_path / 'wrong.yaml'
    path.write_text(steered.yaml.safe_dump(tree))
    with pytest.raises(RobotError, match=why) as caught:
        read_robot(path)
    assert str(path) in str(caught.value) and '\n' not in str(caught.value)


def test_beyond_full_strides_legs_are_faster_as_far_as_joints_go():
    slow, preset = go2.gait_plan('trot'), PRESETS['delayed']['trot']
    fast = plan(go2.GO2, 'trot', preset, preset.network, 2.9)
    table = slow.motion.steering
    assert table.stride[-1] == 1.0 and table.frequency[-1] > slow.motion.frequency
    strides, pace = slow.steer(slow.speeds[1], 0.0)
    assert (strides == 1.0).all() and pace == pytest.approx(table.frequency[-1] / 2.005)
    # Without steering it goes as fast as its own strides do.
    own = table.frequency.index(slow.motion.frequency)
    assert slow.own_speed == table.speed[own] < table.speed[-1]
    assert fast.own_speed == pytest.approx(slow.own_speed * 2.9 / 2.005)
    faster = replace(table, frequency=(2.6,) * len(table.frequency))
    unknown = replace(slow, motion=replace(slow.motion, steering=faster))
    assert unknown.own_speed == 0.0
    limits = fast.robot.column('velocity')
    for one in (slow, fast):
        for wish in np.linspace(*one.speeds, 9):
            _, pace = one.steer(wish, 0.0)
            assert (one.speed * pace <= limits * (1.0 + 1e-9)).all()
    assert fast.steer(fast.speeds[1], 0.0)[1] < slow.steer(slow.speeds[1], 0.0)[1]
