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

"""Legs guessed from joint names as robots and laboratories use them."""

from cpg_ros.fitting.gaits.leg_names import legs_of, LegsError, role_of
from hypothesis import given
from hypothesis import strategies as st
import pytest

LEGS = ('lf', 'rf', 'lh', 'rh')
#: How the four legs are called.
STYLES = {
    'LF': ('LF', 'RF', 'LH', 'RH'), 'lf_': ('lf', 'rf', 'lh', 'rh'),
    'FL': ('FL', 'FR', 'RL', 'RR'), 'hind': ('fl', 'fr', 'hl', 'hr'),
    'back': ('FL', 'FR', 'BL', 'BR'), 'rear last': ('LF', 'RF', 'LR', 'RR'),
    'words': ('front_left', 'front_right', 'rear_left', 'rear_right'),
    'side first': ('left_front', 'right_front', 'left_hind', 'right_hind'),
    'camel': ('FrontLeft', 'FrontRight', 'BackLeft', 'BackRight'),
    'fore': ('fore_l', 'fore_r', 'hind_l', 'hind_r')}
FORMS = ('{}_hip_joint', 'joint_{}_hip', 'hip_{}', '{}/knee', '{}.hx', 'JointPos_{}_calf',
         'abduct_{}_j', 'torso_to_abduct_{}_j', '{}_joint_1')


@pytest.mark.parametrize('names', STYLES.values(), ids=STYLES)
@pytest.mark.parametrize('form', FORMS)
def test_the_usual_names_of_four_legs(names, form):
    joints = [form.format(name) for name in names]
    legs = legs_of(joints)
    assert [legs[leg] for leg in LEGS] == [(joint,) for joint in joints]
    assert tuple(legs) == ('lh', 'rh', 'lf', 'rf')
    assert len({role_of(joint) for joint in joints}) == 1
    assert legs.unassigned == ()


@pytest.mark.parametrize(('left', 'right'), [
    ('L_hip', 'R_hip'), ('left_hip', 'right_hip'), ('hip_left', 'hip_right'), ('hip_l', 'hip_r'),
    ('LHipPitch', 'RHipPitch'), ('lknee', 'rknee'), ('leg_left_1_joint', 'leg_right_1_joint'),
    ('hip_flexion_l', 'hip_flexion_r'), ('hip_lt', 'hip_rt'), ('LT_KNEE', 'RT_KNEE'),
    ('LLEG_HIP_R', 'RLEG_HIP_R'), ('LeftHipR', 'RightHipR'),
    ('left_ankle_joint', 'right_ankle_joint')])
def test_the_usual_names_of_two_legs(left, right):
    legs = legs_of([right, left])
    assert dict(legs.joints) == {'left': (left,), 'right': (right,)}
    assert role_of(left) == role_of(right)


@pytest.mark.parametrize(('name', 'leg'), [
    ('JointPosFR_hip', 'rf'), ('JointPosRL_calf', 'lh'), ('FLhip', 'lf'), ('rrcalf', 'rh'),
    ('abduct_fr_to_thigh_fr_j', 'rf'), ('LFCoxa', 'lf'), ('LH_HAA', 'lh'), ('FR_0', 'rf')])
def test_names_of_particular_robots(name, leg):
    others = [f'{code}_hip' for code in ('LF', 'RF', 'LH', 'RH') if code.lower() != leg]
    assert legs_of([name, *others])[leg] == (name,)


@pytest.mark.parametrize('form', ['{}_coxa', 'joint_{}Coxa', 'coxa_{}', '{}/ThC_pitch'])
@pytest.mark.parametrize('names', [
    ('lh', 'rh', 'lm', 'rm', 'lf', 'rf'), ('LH', 'RH', 'LM', 'RM', 'LF', 'RF'),
    ('RL', 'RR', 'ML', 'MR', 'FL', 'FR'),
    ('hind_left', 'hind_right', 'middle_left', 'middle_right', 'front_left', 'front_right'),
    ('left_rear', 'right_rear', 'left_mid', 'right_mid', 'left_front', 'right_front')])
def test_the_usual_names_of_six_legs(names, form):
    joints = [form.format(name) for name in names]
    legs = legs_of(joints)
    assert tuple(legs) == ('lh', 'rh', 'lm', 'rm', 'lf', 'rf')
    assert [legs[leg] for leg in legs] == [(joint,) for joint in joints]
    assert len({role_of(joint) for joint in joints}) == 1


@pytest.mark.parametrize(('pairs', 'wanted'), [
    (3, 'lh rh lm rm lf rf'), (4, 'l4 r4 l3 r3 l2 r2 l1 r1')])
def test_legs_that_are_counted(pairs, wanted):
    counted = [f'{side}{pair}' for pair in range(pairs, 0, -1) for side in 'LR']
    joints = [f'{leg}_{joint}' for leg in counted for joint in ('coxa', 'femur')]
    legs = legs_of(['abdomen', *joints])
    assert ' '.join(legs) == wanted and legs.unassigned == ('abdomen',)
    assert [legs[leg][0] for leg in legs] == [f'{leg}_coxa' for leg in counted]
    assert {role_of(joint) for joint in joints} == {'coxa', 'femur'}
    # What is counted is joints, if each number is there once.
    assert tuple(legs_of([f'L{k}_joint' for k in (1, 2, 3)] + [f'R{k}_joint' for k in (1, 2, 3)])
                 ) == ('left', 'right')


def test_ends_and_sides_in_any_order_and_half_a_quadruped():
    names = ('hip_front_lt', 'hip_front_rt', 'hip_hind_lt', 'hip_hind_rt')
    assert dict(legs_of(names).joints) == {
        leg: (name,) for leg, name in zip(('lf', 'rf', 'lh', 'rh'), names, strict=True)}
    with pytest.raises(LegsError, match='but none of'):
        legs_of(('FL_hip', 'FR_hip'))


def test_order_is_kept_and_what_is_of_no_leg_is_said():
    joints = [f'{leg}_{joint}' for leg in ('FR', 'FL', 'RR', 'RL')
              for joint in ('hip', 'thigh', 'calf')]
    legs = legs_of(['neck', *joints, 'left_gripper', 'RL_wheel'])
    assert legs['rf'] == ('FR_hip', 'FR_thigh', 'FR_calf')
    assert legs.unassigned == ('neck', 'left_gripper', 'RL_wheel')
    assert "lh by 'rl' (3 joints: RL_hip ... RL_calf)" in legs.explanation
    assert 'of no leg: neck, left_gripper, RL_wheel' in legs.explanation
    assert '\n' not in legs.explanation


def test_arms_of_a_humanoid_are_no_legs_but_shoulders_of_a_dog_are():
    humanoid = legs_of(['left_hip', 'right_hip', 'left_shoulder_pitch', 'r_elbow', 'head_yaw'])
    assert humanoid.unassigned == ('left_shoulder_pitch', 'r_elbow', 'head_yaw')
    dog = legs_of(['left_fore_shoulder', 'right_fore_shoulder', 'left_hind_hip', 'right_hind_hip'])
    assert dog['lf'] == ('left_fore_shoulder',)


def test_the_front_of_a_hip_is_a_direction_where_other_joints_have_none():
    human = legs_of(['right_hip_front', 'right_knee', 'left_hip_front', 'left_knee', 'left_elbow'])
    assert dict(human.joints) == {'left': ('left_hip_front', 'left_knee'),
                                  'right': ('right_hip_front', 'right_knee')}
    for other in ('left_hip', 'left_elbow', 'left_hip_hind'):
        with pytest.raises(LegsError, match='are there'):
            legs_of(['right_hip_front', 'left_hip_front', other])


@pytest.mark.parametrize(('joints', 'message'), [
    (['joint_1', 'joint_2'], 'cannot identify legs from the joint names joint_1, joint_2'),
    ([], 'cannot identify legs'),
    (['FL_hip', 'FR_hip', 'RL_hip'], 'none of rh'),
    (['left_hip', 'left_knee'], "such as 'left_hip'.* none of right"),
    (['lf_hip', 'lm_hip', 'lh_hip', 'rf_hip', 'rm_hip'], 'none of rh'),
    (['left_middle_hip', 'right_middle_hip'], 'lm, rm are there .* none of lh, rh, lf, rf'),
    (['shoulder_left', 'shoulder_right'], 'cannot identify legs')])
def test_what_cannot_be_told_is_an_error(joints, message):
    with pytest.raises(LegsError, match=message) as error:
        legs_of(joints)
    assert '\n' not in str(error.value)


@given(st.permutations([f'{leg}_{joint}' for leg in LEGS for joint in ('hip', 'knee')]))
def test_the_order_of_joints_does_not_change_legs(joints):
    legs = legs_of(joints)
    for leg in LEGS:
        assert set(legs[leg]) == {f'{leg}_hip', f'{leg}_knee'}
        assert list(legs[leg]) == [name for name in joints if name in legs[leg]]


@given(st.lists(st.text(max_size=12), max_size=8, unique=True))
def test_any_names_give_legs_or_one_line(joints):
    try:
        legs = legs_of(joints)
    except LegsError:
        return
    assigned = [name for leg in legs for name in legs[leg]]
    assert sorted((*assigned, *legs.unassigned)) == sorted(joints)
