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

"""Six legs in physics: the shipped hexapod walks, and goes from gait to gait."""

from functools import cache
from itertools import pairwise
import math
from pathlib import Path
import re

from cpg_ros.feedback.gains import robot_gains
from cpg_ros.motion.description import load_urdf
from cpg_ros.motion.pattern import Pattern
from cpg_ros.motion.plan import plan
from cpg_ros.motion.robot_file import load_robot, read_robot, write_robot
from cpg_ros.networks.registry import find_network
from cpg_ros.simulation.robot_setup.check_robot import main
from cpg_ros.simulation.robot_setup.description_match import checked
from cpg_ros.simulation.robot_setup.first_robot import robot_from
from cpg_ros.simulation.robot_setup.leg_chains import legs_in
import numpy as np
import pytest

mujoco = pytest.importorskip('mujoco')

from cpg_ros.simulation.body import Anatomy, Body  # noqa: E402
from cpg_ros.simulation.closed_loop import ClosedLoopBatch  # noqa: E402
from cpg_ros.simulation.robot_model import find_model  # noqa: E402
from cpg_ros.simulation.scenario import Scenario  # noqa: E402

ROOT = Path(__file__).parents[2]
HEXAPOD, DT = load_robot('hexapod'), 0.002
#: Of the trunk with its round ends, m (resource/models/hexapod.xml).
LENGTH = 2 * (0.165 + 0.035)


@cache
def gait_plan(gait):
    preset = find_network('delayed6').presets()[gait]
    return plan(HEXAPOD, gait, preset, preset.network, HEXAPOD.motion(gait, gait).frequency)


def walked(pattern, body, time, standing=None):
    for _ in range(round(time / DT)):
        pattern.advance(DT)
        body.command(pattern.position[HEXAPOD.order_indices])
        body.step()
        if standing is not None:
            standing.append(body.feet > 0.0)
        assert not body.fallen


# The largest fraction of legs in the air at once is what each gait is named for.
@pytest.mark.parametrize(('gait', 'lengths', 'duty'), [
    ('tripod', 4.0, (0.5, 0.7)), ('ripple', 3.0, (0.6, 0.8)), ('wave', 1.5, (0.75, 0.9))])
def test_it_walks_for_ten_seconds(gait, lengths, duty):
    body, standing = Body('hexapod', HEXAPOD), []
    walked(Pattern(gait_plan(gait)), body, 10.0, standing)
    assert body.base[0] >= lengths * LENGTH
    assert abs(math.degrees(body.yaw)) <= 15.0
    fraction = np.mean(standing[len(standing) // 2:], axis=0)
    assert duty[0] <= fraction.mean() <= duty[1]


def test_legs_of_the_physics_set_down_in_the_order_of_the_gait():
    body, standing = Body('hexapod', HEXAPOD), []
    pattern = Pattern(gait_plan('wave'))
    walked(pattern, body, 4.0)
    walked(pattern, body, 6.0, standing)
    stood = np.array(standing, dtype=float)
    turn = np.exp(-2j * np.pi * gait_plan('wave').frequency * DT * np.arange(len(stood)))
    phases = dict(zip(HEXAPOD.legs, np.angle(turn @ stood) / (2.0 * np.pi), strict=True))
    # From hind to fore on each side, a sixth of a stride apart, and then the other side.
    for before, after in (('lh', 'lm'), ('lm', 'lf'), ('lf', 'rh'), ('rh', 'rm'), ('rm', 'rf')):
        late = (phases[before] - phases[after]) % 1.0
        assert abs(late - 1.0 / 6.0) < 0.06, (before, after)


@pytest.mark.parametrize('tour', [
    ('tripod', 'wave', 'ripple', 'tripod'), ('ripple', 'wave', 'tripod', 'ripple')])
def test_it_goes_from_gait_to_gait(tour):
    body, pattern = Body('hexapod', HEXAPOD), Pattern(gait_plan(tour[0]))
    walked(pattern, body, 3.0)
    for before, gait in pairwise(tour):
        pattern.apply(gait_plan(gait), 1.0)
        fastest = np.maximum(gait_plan(before).speed, gait_plan(gait).speed)
        for _ in range(round(3.0 / DT)):
            walked(pattern, body, DT)
            assert (np.abs(pattern.velocity) <= 1.02 * fastest + 0.05).all()
    assert body.base[0] > 1.0 and abs(math.degrees(body.yaw)) <= 15.0
    assert pattern.held == 0 and pattern.faults == 0


def test_its_files_agree():
    urdf = load_urdf(ROOT / 'resource' / 'urdf' / 'hexapod.urdf')
    assert checked(HEXAPOD, urdf, ('hexapod', 'hexapod.urdf')).faults == []
    model = mujoco.MjModel.from_xml_path(str(find_model('hexapod')))
    assert sum(model.body_mass) == pytest.approx(2.87)
    for joint in HEXAPOD.joints:
        own = model.joint(joint.name)
        assert tuple(own.range) == pytest.approx((joint.lower, joint.upper))


def test_a_robot_file_is_made_from_a_urdf_of_six_legs(tmp_path):
    text = (ROOT / 'resource' / 'urdf' / 'hexapod.urdf').read_text()
    path = tmp_path / 'six.urdf'
    # Legs that swing about y, as those of quadrupeds do.
    path.write_text(text.replace('axis xyz="0 0 1"', 'axis xyz="0 1 0"').replace(
        'axis xyz="0 0 -1"', 'axis xyz="0 1 0"'))
    robot, says = robot_from(known := load_urdf(path), 'six', legs_in(known))
    assert robot.networks[0] == 'delayed6' and len(robot.joints) == 18
    assert 'lm_coxa_joint swings' in says
    write_robot(tmp_path / 'six.yaml', robot)
    assert read_robot(tmp_path / 'six.yaml') == robot


@pytest.mark.parametrize('source', ['urdf', 'turned', 'mjcf'])
def test_legs_that_reach_to_the_side_stand_swing_and_lift(tmp_path, source, capsys):
    path, out = tmp_path / 'six.urdf', tmp_path / 'six.yaml'
    text = (ROOT / 'resource' / 'urdf' / 'hexapod.urdf').read_text()
    if source == 'turned':
        # The same robot with joints that count the other way round.
        text = re.sub(r'axis xyz="([^"]+)"', lambda axis: 'axis xyz="{}"'.format(
            ' '.join(str(-float(one)) for one in axis[1].split())), text)
        text = re.sub(r'lower="(\S+)" upper="(\S+)" effort', lambda limits: (
            f'lower="{-float(limits[2])}" upper="{-float(limits[1])}" effort'), text)
    path.write_text(text)
    model = ['--mjcf', 'hexapod'] if source == 'mjcf' else ['--urdf', str(path)]
    assert main([*model, '--make', str(out)]) == 0
    assert 'lm_coxa_joint swings, lm_femur_joint lifts' in capsys.readouterr().err
    robot = read_robot(out)
    body = Body(model[1], robot)
    parts = Anatomy(body)

    def feet(column, order):
        """Where the feet are where joints have what their weights of an order add."""
        body.reset()
        for joint in robot.joints:
            weights = (*joint.weights, 0.0)[:2]
            body.data.qpos[body.model.jnt_qposadr[body.model.joint(joint.name).id]] = (
                joint.offset + column * weights[order])
        mujoco.mj_kinematics(body.model, body.data)
        return parts.sole_positions(body.data) - body.data.xpos[parts.base]

    stand = feet(0.0, 0)
    side = np.array([1.0 if leg[0] == 'l' else -1.0 for leg in robot.legs])
    # All feet on one level below the trunk's belly, outside of it; x forward, y up in swing.
    assert np.ptp(stand[:, 2]) < 1e-3 and stand[0, 2] < -0.05 - 0.035
    assert (stand[:, 1] * side > 0.12).all()
    assert (feet(1.0, 0)[:, 0] - stand[:, 0] > 0.01).all()
    assert (feet(1.0, 1)[:, 2] - stand[:, 2] > 0.005).all()
    # The shipped file, which was written by hand, has femora and tibiae at these angles.
    own = {joint.name: joint.offset for joint in HEXAPOD.joints}
    sign = -1.0 if source == 'turned' else 1.0
    for joint in robot.joints:
        if 'coxa' not in joint.name:
            assert joint.offset == pytest.approx(sign * own[joint.name], abs=2e-3)


@pytest.mark.parametrize('gait', ['tripod', 'ripple'])
def test_its_velocity_is_estimated_by_legs_that_reach_to_the_side(gait):
    """And with all laws on it keeps walking."""
    loop = ClosedLoopBatch('hexapod', gait_plan(gait))
    ran = loop.run([Scenario(speed=speed) for speed in (0.1, 0.2)], 8.0, robot_gains(HEXAPOD))
    late = round(2.0 / DT)
    true, found = (one[:, late:, 0].mean(axis=1) for one in (ran.velocity, ran.estimated))
    assert ran.upright.all() and (true > 0.06).all()
    assert found == pytest.approx(true, rel=0.1)
