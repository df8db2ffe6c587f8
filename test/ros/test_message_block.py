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

"""What is published as bytes is, byte for byte, what rclpy makes of the same message."""

from contextlib import nullcontext
import ctypes
from types import SimpleNamespace

from builtin_interfaces.msg import Duration, Time
from cpg_ros.motion.robot_file import load_robot
from cpg_ros.ros.generator_io import Outputs
from cpg_ros.ros.node import native
from cpg_ros.ros.node.message_block import MessageBlock, Template
from cpg_ros.ros.robot_sim import Measurements
from depth import examples
from geometry_msgs.msg import TransformStamped
from hypothesis import given
from hypothesis import strategies as st
from nav_msgs.msg import Odometry
import numpy as np
import pytest
from rclpy.serialization import deserialize_message, serialize_message
from sensor_msgs.msg import Imu, JointState
from std_msgs.msg import Float64MultiArray, Header, MultiArrayDimension, MultiArrayLayout
from tf2_msgs.msg import TFMessage
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

ROBOTS = [load_robot(name) for name in ('quadruped', 'goat', 'biped', 'unitree_go2')]
SIZES = {'boolean': 1, 'octet': 1, 'uint8': 1, 'uint16': 2, 'int32': 4, 'uint32': 4, 'double': 8}


class Handle(nullcontext):
    """Stands in for rclpy's handle of a publisher."""

    pointer = 0


class Graph:
    """Stands in for a node and its middleware: keeps what was published last, by topic.

    Attributes:
        refused: number of a publisher whose messages the middleware does not take.

    """

    def __init__(self, monkeypatch):
        self.sent, self.kinds, self.refused = {}, {}, None
        self._topics = []
        send = ctypes.CFUNCTYPE(ctypes.c_int32, ctypes.c_size_t,
                                ctypes.POINTER(native.Serialized), ctypes.c_void_p)(self._send)
        self._functions = {'rcl_publish_serialized_message': send}
        monkeypatch.setattr(native, 'address', lambda name: ctypes.cast(
            self._functions[name], ctypes.c_void_p).value)

    def _send(self, publisher, message, _):
        if publisher - 1 == self.refused:
            return 1
        self.sent[self._topics[publisher - 1]] = ctypes.string_at(message[0].buffer,
                                                                  message[0].length)
        return 0

    def resolve_topic_name(self, topic):
        return topic.replace('~', '/cpg_generator')

    def create_publisher(self, kind, topic, *_, **__):
        self.kinds[topic] = kind
        self._topics.append(topic)
        handle = Handle()
        handle.pointer = len(self._topics)
        return SimpleNamespace(topic_name=self.resolve_topic_name(topic), handle=handle)


@pytest.fixture(scope='module')
def graph():
    """Return what makes a graph."""
    with pytest.MonkeyPatch.context() as patch:
        yield lambda: Graph(patch)


def written(message, at=0):
    """Bytes of CDR that a message takes, from the encapsulation on, but for the padding."""
    used = []

    def put(size):
        nonlocal at
        at += -at % size
        used.extend(range(at, at + size))
        at += size

    def walk(kind, value):
        nonlocal at
        sequence, _, rest = kind.partition('<')
        if sequence == 'sequence':
            put(4)
            for one in value:
                walk(rest.rstrip('>'), one)
        elif kind.endswith(']'):
            for one in value:
                walk(kind.partition('[')[0], one)
        elif kind == 'string':
            put(4)
            used.extend(range(at, at + len(value) + 1))
            at += len(value) + 1
        elif kind in SIZES:
            put(SIZES[kind])
        else:
            for name, inner in value.get_fields_and_field_types().items():
                walk(inner, getattr(value, name))
    walk('', message)
    return 4 + np.array(used)


def same(raw, message):
    """Compare with rclpy's own bytes; padding is whatever was in memory."""
    assert type(raw) is bytes
    expected = serialize_message(message)
    counts = written(message)
    # Readers of bags allow up to three bytes more, as the whole is a multiple of four.
    assert raw[:4] == expected[:4] and len(raw) - 4 < counts[-1] + 1 <= len(raw)
    got, wanted = (np.frombuffer(one, np.uint8) for one in (raw, expected))
    assert np.array_equal(got[counts], wanted[counts])
    assert repr(deserialize_message(raw, type(message))) == repr(message)


def array_of(names, values):
    layout = MultiArrayLayout(dim=[MultiArrayDimension(label=','.join(names), stride=1,
                                                       size=len(names))] if names else [])
    return Float64MultiArray(layout=layout, data=list(values))


finite = st.floats(allow_nan=False, width=64)


@examples(15)
@given(data=st.data())
@pytest.mark.parametrize('command', ['none', 'joint_trajectory', 'forward_position'])
@pytest.mark.parametrize('robot', ROBOTS, ids=lambda robot: robot.name)
def test_every_output_of_the_generator(robot, command, graph, data):
    graph = graph()
    outputs = Outputs(graph, robot, 'joint_states', command)
    n = len(robot.joints)
    for _ in range(2):
        position, velocity, phases = (np.array(data.draw(st.lists(finite, min_size=size,
                                                                  max_size=size)))
                                      for size in (n, n, len(robot.legs)))
        seconds = data.draw(st.integers(0, 2**31 - 1))
        nanoseconds = data.draw(st.integers(0, 10**9 - 1))
        period = data.draw(st.integers(1, 10**9))
        outputs.block.publish(10**9 * seconds + nanoseconds, (position, velocity, phases), period)
    where = {joint.name: k for k, joint in enumerate(robot.joints)}
    header = Header(stamp=Time(sec=seconds, nanosec=nanoseconds))

    def states(names):
        places = [where[name] for name in names]
        return JointState(header=header, name=list(names), position=position[places].tolist(),
                          velocity=velocity[places].tolist())
    expected = {f'{leg}/joint_states': states([joint.name for joint in joints])
                for leg, joints in robot.legs.items()}
    expected['joint_states'] = whole = states(robot.order)
    expected['~/phase'] = array_of(list(robot.legs), phases)
    if command == 'joint_trajectory':
        expected['joint_trajectory_controller/joint_trajectory'] = JointTrajectory(
            joint_names=list(robot.order), points=[JointTrajectoryPoint(
                positions=whole.position, velocities=whole.velocity,
                time_from_start=Duration(sec=period // 10**9, nanosec=period % 10**9))])
    elif command == 'forward_position':
        expected['forward_position_controller/commands'] = array_of([], whole.position)
    assert graph.sent.keys() == expected.keys()
    for topic, message in expected.items():
        assert graph.kinds[topic] is type(message)
        same(graph.sent[topic], message)


@examples(15)
@given(values=st.lists(finite, min_size=63, max_size=63))
def test_what_a_simulated_robot_publishes(graph, values):
    values, felt = np.split(np.array(values), [53])
    robot = load_robot('unitree_go2')
    graph = graph()
    body = SimpleNamespace(robot=robot)
    parts = np.split(values, np.cumsum([12, 12, 12, 4, 3, 4]))
    for name, part in zip(('position', 'velocity', 'torque', 'feet', 'base', 'quaternion',
                           'twist'), parts, strict=True):
        setattr(body, name, part)
    unit = SimpleNamespace(measure=lambda stamp: (stamp - 30, felt), seed=0,
                           foot_forces=body.feet)
    Measurements(graph, body, unit, ('odom', 'trunk')).publish(12_000_000_034)
    stamp = Time(sec=12, nanosec=34)
    position, velocity, torque, feet, base, quaternion, twist = (part.tolist() for part in parts)
    same(graph.sent['joint_states'],
         JointState(header=Header(stamp=stamp), name=list(robot.order), position=position,
                    velocity=velocity, effort=torque))
    odometry = Odometry(header=Header(stamp=stamp, frame_id='odom'), child_frame_id='trunk')
    pose, moving = odometry.pose.pose, odometry.twist.twist
    pose.position.x, pose.position.y, pose.position.z = base
    (pose.orientation.w, pose.orientation.x, pose.orientation.y,
     pose.orientation.z) = quaternion
    moving.linear.x, moving.linear.y, moving.linear.z = twist[:3]
    moving.angular.x, moving.angular.y, moving.angular.z = twist[3:]
    same(graph.sent['odom'], odometry)
    moved = TransformStamped(header=odometry.header, child_frame_id='trunk')
    moved.transform.rotation = pose.orientation
    at = moved.transform.translation
    at.x, at.y, at.z = base
    same(graph.sent['/tf'], TFMessage(transforms=[moved]))
    imu = Imu(header=Header(stamp=Time(sec=12, nanosec=4), frame_id='trunk'))
    for part, names, numbers in ((imu.orientation, 'xyzw', felt[:4]),
                                 (imu.angular_velocity, 'xyz', felt[4:7]),
                                 (imu.linear_acceleration, 'xyz', felt[7:])):
        for name, number in zip(names, numbers.tolist(), strict=True):
            setattr(part, name, number)
    same(graph.sent['imu'], imu)
    label = deserialize_message(graph.sent['foot_contacts'], Float64MultiArray)
    same(graph.sent['foot_contacts'], array_of(label.layout.dim[0].label.split(','), feet))


def test_what_is_not_found_in_the_bytes_is_refused(graph):
    message = JointState(name=['a'])
    twice = Template(message, numbers=[(message, 'position', np.arange(1))] * 2)
    with pytest.raises(ValueError, match='JointState: cannot be filled in place'):
        MessageBlock(graph(), [1], [('a', twice)])


def test_what_the_middleware_refuses_is_an_error(monkeypatch):
    graph = Graph(monkeypatch)
    messages = [Float64MultiArray() for _ in range(3)]
    block = MessageBlock(graph, [1], [
        (topic, Template(message, numbers=[(message, 'data', np.arange(1))]))
        for topic, message in zip('abc', messages, strict=True)])
    graph.refused = 1
    with pytest.raises(native.MiddlewareError, match='a message cannot be published: '):
        block.publish(0, [np.array([2.5])])
    assert graph.sent.keys() == {'a'}


def test_without_a_compiler_a_generator_ends_in_one_line(monkeypatch, start, tmp_path):
    monkeypatch.setenv('NUMBA_CACHE_DIR', str(tmp_path))
    monkeypatch.setenv('CC', 'missing-cc')
    process = start('-p', 'kernel:=c', watch=False)
    assert process.wait() == 1
    (line,) = process.log.splitlines()
    assert line.endswith("the C compiler that CC names, 'missing-cc', is not installed")
