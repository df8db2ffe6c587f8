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

"""A node on the graph names files that hurt whoever opens them: the panel opens none of them."""

import json
import os
import threading

import pytest

pytest.importorskip('websockets')

from depth import in_depth  # noqa: E402, I100
from graph import free_domain, until  # noqa: E402
from panel_client import Client, start_panel  # noqa: E402
import rclpy  # noqa: E402
from rclpy.executors import SingleThreadedExecutor  # noqa: E402
from rclpy.qos import DurabilityPolicy, QoSProfile  # noqa: E402
from sensor_msgs.msg import JointState  # noqa: E402
from std_msgs.msg import Float64MultiArray, String  # noqa: E402
from std_srvs.srv import SetBool  # noqa: E402

pytestmark = pytest.mark.live
LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
NETWORK = """from pathlib import Path
Path({marker!r}).write_text('run')
"""
ROBOT = 'network: {network}\nlegs: {{}}\n'
URDF = """<robot name="one"><link name="base"><visual><geometry><box size="1 1 1"/></geometry>
</visual><visual><geometry><mesh filename="{mesh}"/></geometry></visual></link><link name="arm"/>
<joint name="shoulder" type="revolute"><parent link="base"/><child link="arm"/><limit lower="-1"
upper="2" velocity="3"/></joint></robot>"""


class Impostor:
    """Looks like a generator, and says of its robot what it likes."""

    def __init__(self, domain, robot, description=''):
        self.domain = domain
        self._context = rclpy.Context()
        rclpy.init(context=self._context, domain_id=domain)
        self._node = node = rclpy.create_node('cpg_generator', context=self._context)
        node.declare_parameter('robot', robot)
        node.create_publisher(Float64MultiArray, '~/phase', 10)
        node.create_publisher(String, '~/gait', 10)
        node.create_service(SetBool, '~/enable', self._enable)
        if description:
            self._latched = node.create_publisher(String, 'robot_description', LATCHED)
            self._latched.publish(String(data=description))
        self._joints = {leg: node.create_publisher(JointState, f'{leg}/joint_states', 10)
                        for leg in ('lh', 'rf')}
        node.create_timer(0.05, self._move)
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(node)
        self._thread = threading.Thread(target=self._executor.spin, daemon=True)
        self._thread.start()

    @staticmethod
    def _enable(_, answer):
        answer.success, answer.message = True, 'ramping down'
        return answer

    def _move(self):
        for leg, publisher in self._joints.items():
            publisher.publish(JointState(name=[f'{leg}_hip', f'{leg}_knee'], position=[0.1, 0.2]))

    def end(self):
        """Leave the graph."""
        self._executor.shutdown()
        self._thread.join(10.0)
        self._node.destroy_node()
        rclpy.shutdown(context=self._context)


@pytest.fixture
def shown():
    """Yield what shows a page an impostor, and returns the panel, its page and the shape."""
    started = []

    def show(robot, description='', *panel_args):
        impostor = Impostor(free_domain(), robot, description)
        started.append(impostor)
        panel, address = start_panel(impostor.domain, *panel_args)
        started.append(panel)
        page = Client(address)
        started.append(page)
        until(lambda: 'shape' in page.last or not panel.alive, 'a shape')
        assert panel.alive, panel.log
        return panel, page, page.last['shape']

    yield show
    for one in reversed(started):
        one.end()


def peak(pid):
    """Return the most memory that a process has had, bytes."""
    with open(f'/proc/{pid}/status') as status:
        return next(1024 * int(line.split()[1]) for line in status if line.startswith('VmHWM'))


@pytest.mark.parametrize('kind', ['network', 'pipe', *in_depth('device', 'proc', 'gone')])
def test_a_robot_file_that_a_node_names_is_not_opened(shown, tmp_path, kind):
    marker, robot = tmp_path / 'marker', tmp_path / 'robot.yaml'
    if kind == 'network':
        (tmp_path / 'x.py').write_text(NETWORK.format(marker=str(marker)))
        robot.write_text(ROBOT.format(network=tmp_path / 'x.py'))
    elif kind == 'pipe':
        os.mkfifo(robot)
    else:
        robot = {'device': '/dev/zero', 'proc': '/proc/self/maps', 'gone': '/no/robot.yaml'}[kind]
    panel, page, shape = shown(str(robot))
    # The panel's page goes on: joints that the impostor publishes are shown.
    before = page.frames
    until(lambda: page.frames > before + 5, 'frames')
    assert not marker.exists(), 'the panel ran the Python file that a node names'
    assert shape['source'] == f"stick figure of '{robot}'" and set(shape['feet']) == {'lh', 'rf'}
    (doubt,) = shape['doubts']
    assert str(robot) in doubt and 'opens no file that a node names' in doubt
    assert peak(panel.pid) < 1e9


@pytest.mark.parametrize('kind', ['pipe', 'up', 'encoded', *in_depth('device', 'proc', 'file')])
def test_meshes_of_a_description_are_those_of_installed_packages(shown, tmp_path, kind):
    os.mkfifo(tmp_path / 'pipe.stl')
    (tmp_path / 'own.stl').write_text('solid s\nendsolid s')
    mesh = {'pipe': f'file://{tmp_path}/pipe.stl', 'device': '/dev/zero',
            'proc': 'file:///proc/self/maps', 'file': str(tmp_path / 'own.stl'),
            'up': f'package://cpg_ros/../../../../../../../../../..{tmp_path}/own.stl',
            'encoded': f'package://cpg_ros/{"%2e%2e/" * 12}{tmp_path}/own.stl'}[kind]
    panel, page, shape = shown('/no/robot.yaml', URDF.format(mesh=mesh))
    assert shape['source'] == 'robot_description' and len(shape['links']) == 2
    assert shape['links'][0]['parts'], 'the box is drawn all the same'
    (doubt,) = shape['doubts']
    assert 'installed packages only' in doubt
    before = page.frames
    until(lambda: page.frames > before + 5, 'frames')
    assert peak(panel.pid) < 1e9


def test_a_page_sees_no_folder_of_the_panels_own_files(shown, tmp_path):
    urdf = tmp_path / 'own.urdf'
    urdf.write_text(URDF.format(mesh='meshes/missing.stl'))
    panel, _, shape = shown('/no/robot.yaml', '', '-p', f'urdf:={urdf}')
    assert shape['source'] == 'own.urdf' and str(tmp_path) not in json.dumps(shape)
    assert 'missing.stl' in shape['doubts'][0]
    until(lambda: str(tmp_path) in panel.log, 'the folder in the log')


BALL = '<visual><geometry><sphere radius="1"/></geometry></visual>'
LINK = ('<link name="{k}"/><joint name="{k}j" type="continuous"><parent link="base"/>'
        '<child link="{k}"/></joint>')


@pytest.mark.parametrize(('kind', 'source', 'said'), [
    ('balls', 'robot_description', 'not drawn: what exceeds 100000 triangles'),
    ('links', "stick figure of '/no/robot.yaml'", 'more than the 8 MB that a page is sent')])
def test_a_large_description_leaves_pages_and_their_stop(shown, kind, source, said):
    more = {'balls': BALL * 12_000, 'links': ''}[kind]
    links = {'balls': '', 'links': ''.join(LINK.format(k=k) for k in range(36_500))}[kind]
    text = URDF.replace('<visual>', f'{more}<visual>', 1).replace('</robot>', f'{links}</robot>')
    _, page, shape = shown('/no/robot.yaml', text)
    assert shape['source'] == source and any(said in one for one in shape['doubts'])
    assert len(json.dumps(shape)) < 8e6
    before = page.frames
    until(lambda: page.frames > before + 5, 'frames')
    assert not page.closed
    page.send(do='stop')
    until(lambda: any('ramping down' in text for text in page.said), 'the answer to the stop')
