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

"""Two robots in namespaces of one domain, a panel each: no page moves the other robot."""

from contextlib import ExitStack

import pytest

pytest.importorskip('websockets')

from geometry_msgs.msg import Twist  # noqa: E402, I100
from graph import free_domain, Process, until, Watcher  # noqa: E402
from panel_client import Client, start_panel  # noqa: E402
from std_msgs.msg import Float64MultiArray  # noqa: E402

pytestmark = pytest.mark.live
#: The second one is the first that a list by name has, so that it does not hide a mistake.
SPACES = '/b', '/a'


@pytest.fixture
def robots(tmp_path):
    """Yield a watcher, and the pages, phases and commands of two robots, by namespace."""
    with ExitStack() as ending:
        domain = free_domain()
        pages, phases, commands = {}, {}, {}
        for space in SPACES:
            generator = Process('-r', f'__ns:={space}', '-p', 'robot:=unitree_go2', '-p',
                                'cmd_vel:=true', '-p', 'rate:=50.0', '-p', 'ramp:=0.2',
                                domain=domain)
            ending.callback(generator.end)
        watcher = Watcher(domain, '/a/cpg_generator')
        ending.callback(watcher.end)
        for space in SPACES:
            phases[space], commands[space] = [], []
            watcher.node.create_subscription(
                Float64MultiArray, f'{space}/cpg_generator/phase',
                lambda message, space=space: phases[space].append(message.data[0]), 10)
            watcher.node.create_subscription(
                Twist, f'{space}/cmd_vel',
                lambda message, space=space: commands[space].append(message.linear.x), 10)
            until(lambda: phases[space], f'a generator in {space}')  # noqa: B023
            panel, address = start_panel(domain, '-r', f'__ns:={space}', '-p',
                                         f'recordings:={tmp_path}')
            ending.callback(panel.end)
            pages[space] = Client(address).ready()
            ending.callback(pages[space].end)
        yield watcher, pages, commands


def test_each_panel_shows_moves_and_records_the_robot_of_its_namespace(robots):
    watcher, pages, commands = robots
    for space, page in pages.items():
        assert page.last['selected']['node'] == f'{space}/cpg_generator'
    pages['/b'].steer(0.5)
    until(lambda: 0.5 in commands['/b'], 'a command')
    # Both hold their robots, and neither sees another publisher.
    pages['/a'].steer(0.5, -1.0)
    until(lambda: -0.5 in commands['/a'], 'a command of the other')
    for page in pages.values():
        assert page.last['lease']['others'] == [] and page.said == []
    until(lambda: commands['/a'][-1] == commands['/b'][-1] == 0.0, 'the end of both')
    assert set(commands['/a']) == {-0.5, 0.0} and set(commands['/b']) == {0.5, 0.0}
    # A stop is for one of them.
    pages['/b'].send(do='stop')
    until(lambda: pages['/b'].said, 'the answer')
    pages['/a'].steer(0.3)
    assert pages['/a'].said == [] and 0.5 in commands['/a']
    # In one folder, in the same second.
    for page in pages.values():
        page.send(do='record', on=True)
    for page in pages.values():
        until(lambda: page.last['state']['recording'], 'recording')  # noqa: B023
        page.send(do='record', on=False)
        until(lambda: not page.last['state']['recording'], 'the end')  # noqa: B023
    bags = {page.last['state']['bag'] for page in pages.values()}
    assert len(bags) == 2
    names = {(name, space) for name, space in watcher.node.get_node_names_and_namespaces()
             if name.startswith('cpg_panel')}
    assert {space for _, space in names} == set(SPACES)
