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

"""URDFs as text, as tests need them."""

from pathlib import Path

SOURCE = Path(__file__).resolve().parents[2]
URDF = (SOURCE / 'resource' / 'urdf' / 'quadruped.urdf').read_text()
LEGS = ('lh', 'rh', 'lf', 'rf')


def joint_of(name, kind='revolute', limit='lower="-1" upper="1" velocity="20"', axis='0 1 0',
             parent='base', more='', at='0 0 0', shape=''):
    if 'origin' not in more:
        more += f'<origin xyz="{at}"/>'
    return (f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{name}_l"/>'
            f'<axis xyz="{axis}"/><limit effort="1" {limit}/>{more}</joint>'
            f'<link name="{name}_l">{shape}</link>')


def foot_at(below, kind='sphere radius=".02"'):
    """Return a shape that collides, so far below its link's frame, m."""
    return (f'<collision><origin xyz="0 0 {-below}"/><geometry><{kind}/></geometry></collision>')


def robot_of(*joints):
    return f'<robot name="r"><link name="base"/>{"".join(joints)}</robot>'


def quadruped_urdf(calf='lower="-2.7" upper="-0.8" velocity="20"', axis='0 1 0', rpy='0 0 0',
                   thigh='lower="-1" upper="3" velocity="20"', hip='lower="-0.8" upper="0.8"',
                   roll='1 0 0'):
    """Return a quadruped named as Unitree does, calves given before thighs."""
    joints = []
    for leg, (x, y) in {'FL': (0.3, 0.1), 'FR': (0.3, -0.1), 'RL': (-0.3, 0.1),
                        'RR': (-0.3, -0.1)}.items():
        joints += [joint_of(f'{leg}_calf_joint', limit=calf, axis=axis,
                            parent=f'{leg}_thigh_joint_l', at='0 0 -1', shape=foot_at(1.0)),
                   joint_of(f'{leg}_thigh_joint', limit=thigh, axis=axis,
                            parent=f'{leg}_hip_joint_l'),
                   joint_of(f'{leg}_hip_joint', limit=hip, axis=roll,
                            more=f'<origin xyz="{x} {y} 0" rpy="{rpy}"/>')]
    return robot_of(*joints, joint_of('neck_joint'))


#: CHAIN: a biped's leg: names of joints, axes and places in their parents, m.
CHAIN = (('HIP_Y', '0 0 1', '0 0 0'), ('HIP_P', '0 1 0', '0 0 0'), ('KNEE', '0 1 0', '0 0 -.3'),
         ('ANKLE_P', '0 1 0', '0 0 -.3'), ('ANKLE_R', '1 0 0', '0 0 0'))


def biped_of(left, right, *more, chain=CHAIN, limit='lower="-2" upper="2" velocity="20"',
             turned='0 0 0'):
    """Return a URDF of two legs, with hip, knee and ankle each; more joints hang on the base.

    The feet are turned about their last joint by ``turned``, roll, pitch and yaw in rad.
    """
    joints = []
    for side, y in ((left, 0.1), (right, -0.1)):
        parent = ''
        for name, axis, at in chain:
            origin = f'<origin xyz="{at}" rpy="{turned if name == chain[-1][0] else "0 0 0"}"/>'
            joints.append(joint_of(
                f'{side}_{name}', limit=limit, axis=axis,
                more=origin if parent else f'<origin xyz="0 {y} 0"/>',
                parent=f'{side}_{parent}_l' if parent else 'base',
                shape=foot_at(0.05, 'box size=".2 .1 .02"') if name == chain[-1][0] else ''))
            parent = name
    return robot_of(*joints, *(joint_of(name, axis='1 0 0', parent=parent, at='0 0 -.02')
                               for name, parent in more))
