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

"""The executable check_robot: what it finds, as text and JSON, what it makes, what it refuses."""

import json
from pathlib import Path
import re
import subprocess
import sys

from cpg_ros.motion.robot_file import load_robot
from cpg_ros.networks.registry import NETWORKS
from cpg_ros.simulation.robot_setup.check_robot import main
import pytest
from urdf_texts import joint_of, quadruped_urdf, robot_of, SOURCE, URDF
import yaml


@pytest.fixture
def check(tmp_path, capsys):
    """Check the generic quadruped, or another robot file, against a URDF; return code and JSON."""
    def one(urdf, *arguments, robot='quadruped'):
        path = tmp_path / 'my.urdf'
        path.write_text(urdf)
        code = main([robot, '--urdf', str(path), '--json', *arguments])
        return code, json.loads(capsys.readouterr().out)
    return one


def faults(said):
    return {joint['name']: joint['faults'] for joint in said['joints'] if joint['faults']}


def test_the_shipped_quadruped_matches_its_urdf(check):
    code, said = check(URDF)
    assert code == 0 and said['matches'] and not said['notes']
    known = sum(len(NETWORKS[name].gaits()) for name in load_robot('quadruped').networks)
    assert len(said['joints']) == 12 and len(said['gaits']) == known
    for joint in said['joints']:
        for key in ('lower', 'upper', 'velocity'):
            assert joint['robot'][key] == joint['urdf'][key], joint['name']
    assert all(gait['fits'] and gait['frequency'] == 1.0 for gait in said['gaits'])


@pytest.mark.parametrize(('pattern', 'instead', 'joint', 'words'), [
    ('lf_thigh_joint', 'lf_thing_joint', 'lf_thigh_joint',
     "the URDF has no such joint, did you mean 'lf_thing_joint'?"),
    ('rf_calf_joint" type="revolute"', 'rf_calf_joint" type="fixed"', 'rf_calf_joint',
     'cannot be driven, in the URDF it is fixed'),
    ('rf_calf_joint" type="revolute"', 'rf_calf_joint" type="prismatic"', 'rf_calf_joint',
     'cannot be driven, in the URDF it is prismatic'),
    ('rf_calf_joint" type="revolute">', 'rf_calf_joint" type="revolute">\n'
     '<mimic joint="lf_calf_joint"/>', 'rf_calf_joint', "it follows 'lf_calf_joint' (mimic)")])
def test_names_and_kinds(check, pattern, instead, joint, words):
    assert pattern in URDF
    code, said = check(URDF.replace(pattern, instead), '--gait', 'trot')
    assert code == 1 and not said['matches']
    assert list(faults(said)) == [joint] and words in faults(said)[joint][0]


@pytest.mark.parametrize(('old', 'new', 'words'), [
    ('lower="-0.6"', 'lower="-0.5"', "lower limit -0.6 rad is 0.1 rad below the URDF's -0.5"),
    ('upper="2.2"', 'upper="1.7"', "upper limit 2.2 rad is 0.5 rad above the URDF's 1.7"),
    ('velocity="20"', 'velocity="15"', "velocity limit 20 rad/s is 5 rad/s above the URDF's 15"),
    ('upper="2.2"', 'upper="0.7"', "offset 0.8 rad is outside the URDF's limits -0.6 to 0.7")])
def test_limits(check, old, new, words):
    head, name, tail = URDF.partition('name="lf_thigh_joint"')
    code, said = check(head + name + tail.replace(old, new, 1), '--gait', 'trot')
    assert code == 1 and list(faults(said)) == ['lf_thigh_joint']
    assert words in ' / '.join(faults(said)['lf_thigh_joint'])


def test_narrower_limits_in_the_file_and_rounding_are_fine(check):
    code, said = check(URDF.replace('upper="2.2"', 'upper="2.19995"')
                       .replace('lower="-0.8"', 'lower="-1.5"').replace('"20"', '"30"'))
    assert code == 0 and said['matches']


def calves_in_mm(urdf):
    """Return a URDF with the feet of all legs so many m away."""
    assert urdf.count('xyz="0 0 -0.22"') >= 4
    return urdf.replace('xyz="0 0 -0.22"', 'xyz="0 0 -220"')


def test_lengths_in_mm(check):
    code, said = check(calves_in_mm(URDF), '--gait', 'trot')
    assert code == 1 and not said['matches']
    assert any('the link below lh_calf_joint is 220 m long in the URDF' in line
               for line in said['shape'])


def test_axes_that_turn_the_other_way(check):
    urdf = URDF.replace('<axis xyz="0 1 0"/>', '<axis xyz="0 -1 0"/>').replace(
        '<axis xyz="1 0 0"/>', '<axis xyz="-1 0 0"/>')
    code, said = check(urdf, '--gait', 'trot')
    assert code == 1 and not said['matches']
    assert len(said['shape']) == 4
    assert all('moves forward while it is low in the trot' in line for line in said['shape'])


def test_a_mass_that_no_robot_has(check):
    urdf = re.sub(r'<mass value="[^"]*"/>', '<mass value="0.001"/>', URDF)
    code, said = check(urdf, '--gait', 'trot')
    assert code == 1 and not said['matches']
    (line,) = said['shape']
    assert re.match(r'the URDF has a mass of 0\.0\d+ kg with legs of 0\.\d+ m', line)


@pytest.mark.parametrize(('change', 'words'), [
    (lambda tree: tree | {'mass': 0.015}, 'geometry.mass 0.015 kg is not'),
    (lambda tree: tree | {'legs': {leg: one | {'turns': [-turn for turn in one['turns']]}
                                   for leg, one in tree['legs'].items()}},
     'turns: lh_hip_joint turns the other way in the URDF: -1 where it has 1'),
    (lambda tree: tree | {'legs': {leg: one | {'foot': [1000.0 * x for x in one['foot']]}
                                   for leg, one in tree['legs'].items()}},
     'foot: [0.0, 0.0, -220.0] m is')])
def test_geometry_that_is_not_the_descriptions(check, tmp_path, capsys, change, words):
    (tmp_path / 'of.urdf').write_text(URDF)
    made = tmp_path / 'new' / 'made.yaml'
    assert main(['--urdf', str(tmp_path / 'of.urdf'), '--make', str(made)]) == 0
    capsys.readouterr()
    tree = yaml.safe_load(made.read_text())
    code, said = check(URDF, '--gait', 'trot', robot=str(made))
    assert code == 0 and said['matches'], said['shape']
    tree['geometry'] = change(tree['geometry'])
    made.write_text(yaml.safe_dump(tree))
    code, said = check(URDF, '--gait', 'trot', robot=str(made))
    assert code == 1 and not said['matches']
    assert any(words in line for line in said['shape']), said['shape']


def test_continuous_joints_and_missing_velocities_limit_nothing(check):
    urdf = re.sub(r'revolute(">\s*<origin[^>]*>\s*<axis[^>]*>\s*<parent link=".._hip)',
                  r'continuous\1', URDF).replace(' velocity="20"', '')
    assert urdf.count('continuous') == 4
    code, said = check(urdf, '--gait', 'walk')
    assert code == 0 and said['joints'][1]['urdf'] == {'lower': None, 'upper': None,
                                                       'velocity': None}
    assert said['notes'] == []


def test_joints_that_no_leg_drives_are_noted(check):
    code, said = check(URDF.replace('</robot>', joint_of('neck_joint') + joint_of('tail', 'fixed')
                                    + '</robot>'), '--gait', 'trot')
    assert code == 0
    assert said['notes'] == ['moving joints of the URDF that no leg drives: neck_joint']


def test_gaits_that_leave_the_limits_are_told(check):
    # The thigh swings by 0.25 x, x from -1 to 1: to 1.05 rad, and sin-like at 3 Hz.
    narrow = URDF.replace('upper="2.2"', 'upper="1"')
    code, said = check(narrow, '--gait', 'trot')
    trot = said['gaits'][0]
    assert code == 1 and trot['network'] == 'delayed' and not trot['fits']
    assert trot['room'] == pytest.approx(-0.05, abs=1e-3) and 'thigh' in trot['room_at']
    assert 'lh_thigh_joint to 1.050 rad, above its limit 1' in trot['faults']
    assert len(trot['faults']) == 4
    assert check(narrow, '--gait', 'trot', '--amplitude', '0.7')[1]['gaits'][0]['fits']
    # Speeds are proportional to frequency and amplitude.
    slow, fast = (check(URDF, '--gait', 'trot', '--frequency', str(frequency), '--amplitude',
                        str(amplitude))[1]['gaits'][0]['speed_share']
                  for frequency, amplitude in ((1.0, 1.0), (4.0, 1.5)))
    assert fast == pytest.approx(6.0 * slow, rel=1e-6)
    fault = check(URDF, '--gait', 'trot', '--frequency', '10')[1]['gaits'][0]['faults'][0]
    assert re.search(r'calf_joint at 2\d\.\d\d rad/s, above its limit 20', fault)


def test_a_gait_that_the_parameters_of_the_robot_file_speed_up(check, tmp_path):
    tree = yaml.safe_load((SOURCE / 'config' / 'quadruped.yaml').read_text())
    tree['gaits'] = {'trot': {'frequency': 9.5}}
    path = tmp_path / 'fast.yaml'
    path.write_text(yaml.safe_dump(tree))
    code, said = check(URDF, '--gait', 'trot', 'walk', robot=str(path))
    assert code == 1 and [gait['frequency'] for gait in said['gaits']] == (
        [9.5, 1.0] * len(load_robot('quadruped').networks))
    assert not said['gaits'][0]['fits'] and said['gaits'][1]['fits']


def test_as_text(tmp_path, capsys):
    path = tmp_path / 'my.urdf'
    path.write_text(URDF.replace('lf_thigh_joint', 'lf_thai_joint'))
    assert main(['quadruped', '--urdf', str(path), '--gait', 'trot']) == 1
    said = capsys.readouterr().out
    for words in ("- lf_thigh_joint: the URDF has no such joint, did you mean 'lf_thai_joint'?",
                  'limits [rad]', '-0.8 to 0.8', 'nearest limit', 'fits',
                  'note: moving joints of the URDF that no leg drives: lf_thai_joint',
                  f'quadruped does not match {path}: 1 thing, see above'):
        assert words in said
    assert max(map(len, said.splitlines())) <= 140


def test_prefixes_and_foreign_blocks_do_not_matter(check):
    foreign = ('<gazebo reference="lf_calf"><mu1>1</mu1></gazebo><transmission name="t">'
               '<joint name="lf_calf_joint"><hardwareInterface>x</hardwareInterface></joint>'
               '</transmission><sensor:camera undeclared="yes"/><ros2_control><joint name="a">'
               '<limit lower="x"/></joint></ros2_control></robot>')
    prefixed = URDF.replace('<robot ', '<robot xmlns="http://somewhere" xmlns:xacro="http://x" ')
    code, said = check(prefixed.replace('</robot>', foreign), '--gait', 'trot')
    assert code == 0 and said['matches']


# -- refusals ---------------------------------------------------------------------------------

REFUSED = [
    ('', 'no element found'),
    (URDF[:-200], 'line '),
    (URDF.replace('<link name="base"/>', '<link name="base">'), 'mismatched tag'),
    ('<mujoco/>', 'its root is <mujoco>, not <robot>: this is not a URDF'),
    ('<sdf version="1.9"/>', 'its root is <sdf>'),
    ('<robot name="a"><link name="b"/></robot>', 'it has no joints'),
    ('<robot name="a" xmlns:xacro="x"><xacro:macro name="leg"/></robot>',
     'it is xacro, expand it first (xacro my.urdf > robot.urdf)'),
    (robot_of(joint_of('a'), joint_of('a')), "the joint 'a' appears twice"),
    (robot_of(joint_of('a').replace(' name="a"', '')), 'a joint has no name'),
    (robot_of(joint_of('a').replace(' type="revolute"', '')), "the joint 'a' has no type"),
    (robot_of(joint_of('a', limit='lower="low"')), 'limit lower="low" is not a number'),
    (robot_of(joint_of('a', limit='lower="nan"')), 'limit lower="nan" is not a number'),
    (robot_of(joint_of('a', axis='0 1')), 'axis xyz="0 1" is not 3 numbers'),
    (robot_of('<joint name="a" type="revolute"/>'), "'a' is revolute, but has no <limit>"),
    ('<!DOCTYPE robot [<!ENTITY a "b">]>' + URDF.partition('?>')[2], "the entity 'a'"),
    ('<?xml version="1.0" encoding="klingon"?><robot/>', 'encoding'),
    ('solid teapot\n', 'syntax error')]


@pytest.mark.parametrize(('urdf', 'words'), REFUSED, ids=[words for _, words in REFUSED])
def test_files_that_are_no_urdf_end_in_one_line(tmp_path, capsys, urdf, words):
    path = tmp_path / 'my.urdf'
    path.write_text(urdf)
    assert main(['quadruped', '--urdf', str(path)]) == 2
    said = capsys.readouterr()
    assert said.out == '' and said.err.count('\n') == 1
    assert said.err.startswith(f'check_robot: URDF {path}: ') and words in said.err


@pytest.mark.parametrize(('arguments', 'words'), [
    (('quadruped',), '--urdf'),
    (('--urdf', 'URDF'), 'give either a robot file or --make FILE'),
    (('quadruped', '--urdf', 'URDF', '--make', 'a.yaml'), 'give either'),
    (('quadruped', '--urdf', 'nowhere.urdf'), 'nowhere.urdf: No such file'),
    (('quadruped', '--urdf', '.'), 'Is a directory'),
    (('octopod', '--urdf', 'URDF'), "robot 'octopod' is neither a .yaml file nor one of: biped"),
    (('nowhere.yaml', '--urdf', 'URDF'), 'nowhere.yaml: No such file'),
    (('quadruped', '--urdf', 'URDF', '--gait', 'canter'), "'canter' is not one of walk, trot"),
    (('quadruped', '--urdf', 'URDF', '--frequency', 'nan'), '--frequency: nan is not from 0'),
    (('quadruped', '--urdf', 'URDF', '--amplitude', '-1'), '--amplitude: -1 is not from 0 to 3'),
    (('quadruped', '--urdf', 'URDF', '--velocity', '0'), '--velocity: 0 is not above 0'),
    (('--urdf', 'URDF', '--make', 'a.txt'), 'a.txt does not end in .yaml'),
    (('--urdf', 'URDF', '--make', 'URDF.yaml'), 'already exists'),
    (('--urdf', 'URDF', '--make', 'URDF/a.yaml'), 'URDF: File exists'),
    (('--urdf', 'NAMELESS', '--make', 'a.yaml'), 'no legs are found'),
    (('--urdf', 'SIDEWAYS', '--make', 'a.yaml'), 'forward and'),
    (('--urdf', 'STIFF', '--make', 'a.yaml'), 'no room to move'),
    (('--urdf', 'ROUND', '--make', 'a.yaml'), 'form a loop')])
def test_nonsense_ends_in_one_line(tmp_path, capsys, monkeypatch, arguments, words):
    monkeypatch.chdir(tmp_path)
    for name, content in {
            'URDF': URDF, 'URDF.yaml': '', 'NAMELESS': robot_of(joint_of('one'), joint_of('two')),
            'SIDEWAYS': quadruped_urdf(axis='1 0 0'),
            'STIFF': quadruped_urdf(hip='lower=".5" upper=".5"'),
            'ROUND': quadruped_urdf().replace('link="base"/><child', 'link="FL_calf_joint_l"/>'
                                              '<child')}.items():
        Path(name).write_text(content)
    try:
        code = main(list(arguments))
    except SystemExit as ended:
        code = ended.code
    said = capsys.readouterr()
    assert code == 2 and said.out == ''
    assert words in said.err and said.err.startswith('check_robot: ')
    assert said.err.count('\n') == 1 and not Path('a.yaml').exists()


@pytest.mark.no_cover
def test_as_a_process(tmp_path):
    command = [sys.executable, '-P', '-m', 'cpg_ros.simulation.robot_setup.check_robot']
    urdf = SOURCE / 'resource' / 'urdf' / 'quadruped.urdf'
    good = subprocess.run([*command, 'quadruped', '--urdf', urdf, '--gait', 'trot', '--json'],
                          capture_output=True, text=True, timeout=120)
    assert good.returncode == 0 and json.loads(good.stdout)['matches'] and not good.stderr
    bad = subprocess.run([*command, 'biped', '--urdf', urdf, '--gait', 'walk'],
                         capture_output=True, text=True, timeout=120)
    assert bad.returncode == 1 and 'the URDF has no such joint' in bad.stdout
    wrong = subprocess.run([*command, 'quadruped', '--urdf', tmp_path], capture_output=True,
                           text=True, timeout=120)
    assert wrong.returncode == 2 and wrong.stderr.count('\n') == 1
