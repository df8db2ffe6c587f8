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

"""A made-up robot of four legs as a URDF, for the robot file walker.yaml."""

from pathlib import Path

from cpg_ros.motion.robot_file import read_robot

ROBOT = read_robot(Path(__file__).parents[1] / 'data' / 'walker.yaml')

LINK = """<link name="{name}"><inertial><mass value="{mass}"/>
<inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial>
<collision><origin xyz="0 0 {z}"/><geometry><sphere radius="0.03"/></geometry></collision>
</link>"""
JOINT = """<joint name="{name}" type="revolute"><parent link="{parent}"/><child link="{child}"/>
<origin xyz="{x} {y} {z}"/><axis xyz="{axis}"/>
<limit lower="-3" upper="3" effort="{effort}" velocity="20"/></joint>"""


def urdf(path):
    """Return a robot of four legs whose base a URDF cannot say to be free."""
    parts = [LINK.format(name='base', mass=5.0, z=0.0)]
    for leg, x, y in (('FL', 0.2, 0.1), ('FR', 0.2, -0.1), ('RL', -0.2, 0.1), ('RR', -0.2, -0.1)):
        parent = 'base'
        for part, z, axis in (('hip', 0.0, '1 0 0'), ('thigh', 0.0, '0 1 0'),
                              ('calf', -0.2, '0 1 0')):
            name = f'{leg}_{part}'
            parts += [LINK.format(name=name, mass=0.5, z=-0.2 if part == 'calf' else 0.0),
                      JOINT.format(name=f'{name}_joint', parent=parent, child=name, z=z,
                                   axis=axis, effort=25, x=x if part == 'hip' else 0,
                                   y=y if part == 'hip' else 0)]
            parent = name
    path.write_text(f'<robot name="own">{"".join(parts)}</robot>')
    return str(path)


def stood(body, seconds=2.0):
    """Let a body stand for a while."""
    for _ in range(round(seconds / body.model.opt.timestep)):
        body.step()
    return body
