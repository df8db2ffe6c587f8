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

from cpg_ros.checks.description_match import checked
from cpg_ros.checks.robot_template import robot_from
from cpg_ros.motion.pattern import Pattern
from cpg_ros.motion.plan import plan
from cpg_ros.networks.registry import find_network
from cpg_ros.robots.robot_file import load_robot, read_robot, write_robot
from cpg_ros.robots.urdf import load_urdf
import numpy as np
import pytest

mujoco = pytest.importorskip('mujoco')

from cpg_ros.simulation.body import Body  # noqa: E402
from cpg_ros.simulation.robot_model import find_model, legs  # noqa: E402

ROOT = Path(__file__).parents[2]
HEXAPOD, DT = load_robot('hexapod'), 0.002
#: Of the trunk with its round ends, m (models/hexapod.xml).
LENGTH = 2 * (0.165 + 0.035)


@cache
def program(gait):
    preset = find_network('delayed6').presets()[gait]
    return plan(HEXAPOD, gait, preset, preset.network, HEXAPOD.motion(gait, gait).frequency)


def walked(pattern, body, time, standing=None):
    for _ in range(round(time / DT)):
        pattern.advance(DT)
        body.command(pattern.position[HEXAPOD.places])
        body.step()
        if standing is not None:
            standing.append(body.feet > 0.0)
        assert not body.fallen


# The largest share of legs in the air at once is what each gait is named for.
@pytest.mark.parametrize(('gait', 'lengths', 'duty'), [
    ('tripod', 4.0, (0.5, 0.7)), ('ripple', 3.0, (0.6, 0.8)), ('wave', 1.5, (0.75, 0.9))])
def test_it_walks_for_ten_seconds(gait, lengths, duty):
    body, standing = Body('hexapod', HEXAPOD), []
    walked(Pattern(program(gait)), body, 10.0, standing)
    assert body.base[0] >= lengths * LENGTH
    assert abs(math.degrees(body.yaw)) <= 15.0
    share = np.mean(standing[len(standing) // 2:], axis=0)
    assert duty[0] <= share.mean() <= duty[1]


def test_legs_of_the_physics_set_down_in_the_order_of_the_gait():
    body, standing = Body('hexapod', HEXAPOD), []
    pattern = Pattern(program('wave'))
    walked(pattern, body, 4.0)
    walked(pattern, body, 6.0, standing)
    stood = np.array(standing, dtype=float)
    turn = np.exp(-2j * np.pi * program('wave').frequency * DT * np.arange(len(stood)))
    phases = dict(zip(legs(HEXAPOD), np.angle(turn @ stood) / (2.0 * np.pi), strict=True))
    # From hind to fore on each side, a sixth of a stride apart, and then the other side.
    for before, after in (('lh', 'lm'), ('lm', 'lf'), ('lf', 'rh'), ('rh', 'rm'), ('rm', 'rf')):
        late = (phases[before] - phases[after]) % 1.0
        assert abs(late - 1.0 / 6.0) < 0.06, (before, after)


@pytest.mark.parametrize('tour', [
    ('tripod', 'wave', 'ripple', 'tripod'), ('ripple', 'wave', 'tripod', 'ripple')])
def test_it_goes_from_gait_to_gait(tour):
    body, pattern = Body('hexapod', HEXAPOD), Pattern(program(tour[0]))
    walked(pattern, body, 3.0)
    for before, gait in pairwise(tour):
        pattern.apply(program(gait), 1.0)
        fastest = np.maximum(program(before).speed, program(gait).speed)
        for _ in range(round(3.0 / DT)):
            walked(pattern, body, DT)
            assert (np.abs(pattern.velocity) <= 1.02 * fastest + 0.05).all()
    assert body.base[0] > 1.0 and abs(math.degrees(body.yaw)) <= 15.0
    assert pattern.held == 0 and pattern.faults == 0


def test_its_files_agree():
    urdf = load_urdf(ROOT / 'urdf' / 'hexapod.urdf')
    assert checked(HEXAPOD, urdf, ('hexapod', 'hexapod.urdf')).faults == []
    model = mujoco.MjModel.from_xml_path(str(find_model('hexapod')))
    assert sum(model.body_mass) == pytest.approx(2.87)
    for joint in HEXAPOD.joints:
        own = model.joint(joint.name)
        assert tuple(own.range) == pytest.approx((joint.lower, joint.upper))


def test_a_robot_file_is_made_from_a_urdf_of_six_legs(tmp_path):
    text = (ROOT / 'urdf' / 'hexapod.urdf').read_text()
    path = tmp_path / 'six.urdf'
    # Legs that swing about y, as the template knows them.
    path.write_text(text.replace('axis xyz="0 0 1"', 'axis xyz="0 1 0"').replace(
        'axis xyz="0 0 -1"', 'axis xyz="0 1 0"'))
    robot, says = robot_from(load_urdf(path), 'six')
    assert robot.networks[0] == 'delayed6' and len(robot.joints) == 18
    assert 'lm_coxa_joint swings' in says
    write_robot(tmp_path / 'six.yaml', robot)
    assert read_robot(tmp_path / 'six.yaml') == robot
