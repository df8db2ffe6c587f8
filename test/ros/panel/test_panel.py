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

"""The panel on a graph, seen by pages without a browser."""

from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, suppress
import http.client
from io import BytesIO
import math
import os
import re
import socket
import subprocess
import time
from urllib.parse import urlsplit
import zipfile

import pytest
import yaml

pytest.importorskip('websockets')

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus  # noqa: E402
from geometry_msgs.msg import TwistStamped  # noqa: E402
from graph import free_domain, Process, until, Watcher  # noqa: E402, I100
from lifecycle_msgs.msg import Transition  # noqa: E402
from lifecycle_msgs.srv import ChangeState  # noqa: E402
from panel_client import Client, PANEL, start_panel, steered_robot  # noqa: E402
from rclpy.qos import qos_profile_sensor_data  # noqa: E402
from std_msgs.msg import String  # noqa: E402

#: Together on one worker, as they share a generator and a panel.
pytestmark = pytest.mark.xdist_group('panel')


@pytest.fixture(scope='module')
def rig(tmp_path_factory):
    """Yield a steered generator, a panel, its address, a watcher, and what is steered."""
    with steered_robot('-p', f"recordings:={tmp_path_factory.mktemp('recordings')}") as started:
        yield started


@pytest.fixture
def page(rig):
    """One page, ready."""
    client = Client(rig[2]).ready()
    yield client
    client.end()


def get(address, path, **headers):
    where = urlsplit(address)
    connection = http.client.HTTPConnection(where.hostname, where.port, timeout=10)
    connection.request('GET', path, headers=headers)
    answer = connection.getresponse()
    return answer, answer.read()


def test_the_page_and_nothing_else_is_served(rig):
    address = rig[2]
    answer, body = get(address, '/')
    assert answer.status == 200 and b'<title>cpg_ros panel</title>' in body
    # All that the page asks for is here: it works without a network.
    wanted = set(re.findall(rb'(?:src|href)="([^"]+)"', body))
    assert wanted and not [one for one in wanted if b'//' in one]
    for name in wanted:
        answer, _ = get(address, '/' + name.decode())
        assert answer.status == 200, name
    assert "default-src 'none'" in answer.headers['Content-Security-Policy']
    for path in ('/../panel_node.py', '/%2e%2e/panel_node.py', '//etc/passwd', '/bags/../x.zip',
                 '/bags/panel_1.zip', '/bags/%2fetc%2fpasswd.zip', '/x'):
        assert get(address, path)[0].status == 404, path
    assert get(address, '/x', Host='evil.example')[0].status == 403


def test_a_page_shows_what_a_generator_that_starts_waits_for():
    domain = free_domain()
    panel, address = start_panel(domain)
    watcher = Watcher(domain)
    page = Client(address)
    publisher = watcher.node.create_publisher(DiagnosticArray, '/diagnostics', 10)
    status = DiagnosticStatus(name='/cpg_generator: start', level=DiagnosticStatus.OK,
                              message='compiling the feedback, 3 of about 25 s')
    try:
        until(lambda: page.last.get('state', {}).get('starting') == '', 'nothing that starts')

        def shown():
            publisher.publish(DiagnosticArray(status=[status]))
            time.sleep(0.1)
            return page.last['state']['starting']
        until(shown, 'what is compiled')
        assert page.last['state']['starting'] == ('/cpg_generator is starting: compiling the '
                                                  'feedback, 3 of about 25 s')
        until(lambda: page.last['state']['starting'] == '', 'the end of it')
    finally:
        page.end()
        watcher.end()
        panel.end()


def test_a_generator_that_takes_stamped_commands_gets_them():
    generator = Process('-p', 'robot:=unitree_go2', '-p', 'cmd_vel:=true', '-p',
                        'stamped_cmd_vel:=true', '-p', 'feedback.enabled:=false')
    panel, address = start_panel(generator.domain)
    watcher = Watcher(generator.domain)
    heard = []
    watcher.node.create_subscription(TwistStamped, '/cmd_vel', heard.append, 100)
    page = Client(address).ready()
    try:
        def steered():
            page.send(do='steer', speed=1.0, turn=0.0)
            time.sleep(0.05)
            return heard and heard[-1].twist.linear.x == 0.5
        until(steered, 'a command')
        assert heard[-1].header.frame_id == 'base_link'
        until(lambda: heard[-1].twist.linear.x == 0.0, 'the stop')
    finally:
        page.end()
        watcher.end()
        panel.end()
        generator.end()


def test_it_shows_what_the_node_says_of_itself(rig, page):
    _, _, _, watcher, _ = rig
    controls = {one['name']: one for one in page.last['controls']['controls']}
    tau = controls['delayed.tau']
    assert tau['kind'] == 'double' and tau['low'] < tau['value'] < tau['high']
    assert controls['rate']['unit'] == 'Hz' and not controls['rate']['fixed']
    assert controls['robot']['fixed'] and controls['robot']['value'] == 'unitree_go2'
    # A steered robot is offered what its file can steer.
    choices = controls['gait']['choices']
    assert choices[:2] == ['walk', 'trot'] and 'pace' not in choices
    # Each topic is discovered when it is: what they bring comes in any order.
    until(lambda: page.last['gait']['gait'] and page.last['names'].get('phases')
          and page.last['names'].get('cells') and {'angles', 'cells'} <= set(page.frame)
          and page.last.get('health', {}).get('parts'), 'all topics')
    assert page.last['gait']['gait'] == watcher.gaits[-1] == 'trot'
    joints = page.last['names']['joints']
    assert sorted(joints) == sorted(watcher.names) and len(page.frame['angles']) == 12
    assert page.last['names']['phases'] == ['lh', 'rh', 'lf', 'rf']
    assert page.last['names']['cells'] == ['x,dx/dt:2', 'cells:8']
    assert len(page.frame['cells']) == 16
    (part,) = page.last['health']['parts'].values()
    assert part['values']['gait'] == 'trot'


def test_it_shows_thirty_frames_a_second_of_two_hundred(page):
    first, began = page.frames, time.monotonic()
    until(lambda: page.frames >= first + 60, 'frames')
    assert (page.frames - first) / (time.monotonic() - began) < 31.5


def test_a_click_changes_the_gait_for_every_page(rig, page):
    other = Client(rig[2]).ready()
    for gait in ('walk', 'trot'):
        page.send(do='set', name='gait', value=gait)
        until(lambda: rig[3].gaits[-1] == gait, gait)  # noqa: B023
        for one in (page, other):
            until(lambda: one.last['gait']['gait'] == gait  # noqa: B023
                  and one.value('gait') == gait, gait)  # noqa: B023
    other.end()


def test_a_drag_ends_at_the_last_value(rig, page):
    for k in range(40):
        page.send(do='set', name='frequency', value=1.5 + 0.01 * k)
    until(lambda: page.value('frequency') == pytest.approx(1.89), 'the last value')
    time.sleep(0.3)
    assert rig[3].get('frequency') == [pytest.approx(1.89)]
    rig[3].set(frequency=2.0)
    until(lambda: page.value('frequency') == 2.0, 'what another node set')


@pytest.mark.parametrize(('name', 'value', 'said'), [
    ('delayed.tau', 0.2, "tau 0.2 is below the trot's critical delay"),
    ('gait', 'gallop', "'gallop' is not one of"), ('rate', 1e5, 'rate out of range'),
    ('rate', 'fast', 'Wrong parameter type'), ('rate', True, 'Wrong parameter type'),
    ('robot', 'goat', 'cannot be changed'), ('nonsense', 1, 'no parameter')])
def test_a_refusal_is_shown_with_its_reason(rig, page, name, value, said):
    before = {name: page.value(name) for name in ('delayed.tau', 'gait', 'rate', 'robot')}
    page.send(do='set', name=name, value=value)
    until(lambda: page.said, 'a reason')
    assert said in page.said[-1]
    assert dict(zip(before, rig[3].get(*before), strict=True)) == before


@pytest.mark.parametrize('how', ['silent', 'let_go', 'stop', 'close'])
def test_the_robot_stops_when_nobody_holds_on(rig, how):
    twists = rig[4]
    page = Client(rig[2]).ready()
    twists.clear()

    def steered():
        page.steer(0.1, 1.0, -0.5)
        return twists and twists[-1][1:] == (0.5, -0.3)

    # It begins to publish when it is steered: who listens may be found a little later.
    until(steered, 'cmd_vel')
    let_go = time.monotonic()
    if how == 'let_go':
        page.send(do='steer', speed=0, turn=0)
    elif how == 'stop':
        page.send(do='stop')
    elif how == 'close':
        page.end()
    until(lambda: twists[-1][1:] == (0.0, 0.0), 'the stop')
    assert max(when for when, *asked in twists if asked != [0.0, 0.0]) - let_go < 2.0
    count = len([one for one in twists if one[1:] == (0.0, 0.0)])
    assert count >= 1
    # And then it is silent: another node may steer. What was sent may come late.
    def silent():
        count = len(twists)
        time.sleep(0.3)
        return len(twists) == count

    until(silent, 'silence')
    if how == 'stop':
        until(lambda: any(text.startswith('ramping down') for text in page.said), 'the stand')
        page.send(do='enable', on=True)
        until(lambda: len(page.said) > 1, 'an answer')
    if how != 'close':
        page.end()


def test_stop_and_enable(rig, page):
    page.send(do='enable', on=False)
    until(lambda: page.said, 'an answer')
    assert page.said[-1].startswith('ramping down')
    page.send(do='enable', on=True)
    until(lambda: len(page.said) > 1, 'an answer')
    page.send(do='seat', on=True)
    until(lambda: len(page.said) > 2, 'an answer')
    assert 'has no geometry of the leg' in page.said[-1] or page.said[-1] == 'sitting down'
    page.send(do='reset')
    page.send(do='push', force=50, direction=90)
    page.send(do='fit')
    until(lambda: len(page.said) > 5, 'answers')
    assert sum('there is no' in text for text in page.said) == 3


def test_stop_works_on_a_managed_generator_in_every_state():
    generator = Process('-p', 'managed:=true', '-p', 'ramp:=0.2')
    with ExitStack() as ending:
        ending.callback(generator.end)
        panel, address = start_panel(generator.domain)
        ending.callback(panel.end)
        watcher = Watcher(generator.domain)
        ending.callback(watcher.end)
        page = Client(address)
        ending.callback(page.end)
        until(lambda: page.last.get('selected'), 'the generator')

        def stopped():
            before = len(page.said)
            page.send(do='stop')
            until(lambda: len(page.said) > before, 'an answer')
            return page.said[-1]

        def change(transition):
            request = ChangeState.Request(transition=Transition(id=transition))
            return watcher.call(ChangeState, '/cpg_generator/change_state', request).success

        assert 'managed' not in stopped()
        assert change(Transition.TRANSITION_CONFIGURE)
        assert 'managed' not in stopped()
        assert change(Transition.TRANSITION_ACTIVATE)
        until(lambda: watcher.samples and max(watcher.samples[-1][2]) > 0.1, 'a walk')
        assert stopped().startswith('ramping down')
        until(lambda: not any(watcher.samples[-1][2]), 'the stand')
        # Activated again, it can walk again.
        assert change(Transition.TRANSITION_ACTIVATE)
        # A refusal is shown with its reason.
        page.send(do='enable', on=True)
        until(lambda: 'managed' in page.said[-1], 'the refusal')


def test_a_recording_can_be_fetched_and_read(rig, page):
    address = rig[2]
    # As sensors are published.
    felt = rig[3].node.create_publisher(String, '/felt', qos_profile_sensor_data)
    time.sleep(1.5)
    page.send(do='record', on=True)
    until(lambda: page.last['state']['recording'], 'recording')
    for _ in range(20):
        time.sleep(0.1)
        felt.publish(String(data='touch'))
    page.send(do='record', on=False)
    until(lambda: not page.last['state']['recording'], 'the end')
    bag = page.last['state']['bag']
    # Two pages fetch it at once.
    with ThreadPoolExecutor(8) as pool:
        answers = list(pool.map(lambda _: get(address, f'/bags/{bag}.zip'), range(8)))
    assert [answer.status for answer, _ in answers] == [200] * 8
    _, body = answers[0]
    assert all(other == body for _, other in answers)
    names = zipfile.ZipFile(BytesIO(body)).namelist()
    assert f'{bag}/metadata.yaml' in names
    told = yaml.safe_load(zipfile.ZipFile(BytesIO(body)).read(f'{bag}/metadata.yaml'))
    counts = {one['topic_metadata']['name']: one['message_count'] for one in
              told['rosbag2_bagfile_information']['topics_with_message_count']}
    # Every message of 200 a second, not thirty.
    assert counts['/joint_states'] > 100 and counts['/cpg_generator/gait'] == 1
    assert counts['/felt'] > 0


def test_an_error_of_the_disk_shows_a_page_no_path(rig, tmp_path_factory):
    (folder,) = tmp_path_factory.getbasetemp().glob('recordings0')
    (folder / 'panel_1').mkdir()
    (folder / 'panel_1.zip').mkdir()
    answer, body = get(rig[2], '/bags/panel_1.zip')
    assert answer.status == 404 and b'a directory' in body
    assert str(folder).encode() not in body


HOSTILE = ['', '{', '[' * 4000, 'null', '{"do":"set","name":"gait","value":NaN}',
           '{"do":"set","name":"rate","value":1e308}', '{"do":"exec","x":1}',
           '{"do":"set","name":"../robot","value":"x"}', b'\x00\xff\xfe', '"\ud83d\ude00"',
           '{"do":"choose","node":"/nobody"}', '{"do":"set","name":"gait","value":"' + 'x' * 3000
           + '"}', '{"do":"steer","speed":9,"turn":0}', '{"do":"push","force":1e9,"direction":0}']


def test_nothing_hostile_changes_anything(rig, page):
    _, panel, address, watcher, twists = rig
    names = ('gait', 'rate', 'frequency', 'delayed.tau', 'amplitude')
    before = watcher.get(*names)
    twists.clear()
    where = urlsplit(address)
    for k in range(100):
        with suppress(Exception):
            one = Client(address)
            if k % 4 == 0:
                one.send_raw('x' * 70_000)  # longer than a request may be: it is cut off
                until(lambda: one.closed == '1009', 'the end of it')  # noqa: B023
            for text in HOSTILE:
                one.send_raw(text)
            one.end()
        with suppress(OSError), socket.create_connection(
                (where.hostname, where.port), timeout=5) as raw:
            raw.sendall([b'\x16\x03\x01\x00', b'GET / HTTP/9\r\n\r\n', b'POST /socket HTTP/1.1\r\n'
                         b'Host: localhost\r\n\r\n', os.urandom(300)][k % 4])
    assert panel.alive and watcher.get(*names) == before
    assert not [one for one in twists if one[1:] != (0.0, 0.0)]
    seen = page.frames
    until(lambda: page.frames > seen + 10, 'frames after it')


def test_a_flood_is_cut_off(rig):
    one = Client(rig[2]).ready()
    with suppress(Exception):
        for _ in range(2000):
            one.send(do='alive')
    until(lambda: one.closed == '1008', 'the end of it')


def run(*words):
    variables = dict(os.environ, ROS_DOMAIN_ID=str(free_domain()))
    return subprocess.run([PANEL, '--ros-args', *words], env=variables, text=True, timeout=60,
                          capture_output=True, check=False)


def test_it_does_not_start_where_it_must_not(tmp_path):
    with socket.create_server(('127.0.0.1', 0)) as taken:
        port = taken.getsockname()[1]
        for words, said in (
                (('-p', 'host:=0.0.0.0'), 'set the parameter token'),
                (('-p', 'host:=0.0.0.0', '-p', 'token:=short'), 'token:=auto makes one'),
                (('-p', 'host:=0.0.0.0', '-p', 'token:=auto'), 'there is none: make one'),
                (('-p', f'port:={port}'), 'Address already in use'),
                (('-p', f'urdf:={tmp_path}/no.urdf'), 'No such file'),
                (('-p', 'port:=70000'), '70000 is not from 0 to 65535')):
            found = run(*words)
            (line,) = found.stderr.splitlines()
            assert found.returncode == 1 and said in line


def test_robots_in_two_namespaces_and_one_that_comes_later():
    domain = free_domain()
    panel, address = start_panel(domain)
    page = Client(address)
    until(lambda: 'state' in page.last, 'a page of an empty graph')
    assert page.last['state']['generators'] == []
    started = []
    try:
        for space, network in (('/a', 'delayed'), ('/b', 'biped')):
            started.append(Process('-p', f'network:={network}', '-r', f'__ns:={space}',
                                   domain=domain))
            name = f'{space}/cpg_generator'
            until(lambda: name in page.last['state']['generators'], name)  # noqa: B023
        assert page.ready().last['selected']['node'] == '/a/cpg_generator'
        assert page.last['shape']['source'] == 'quadruped.urdf'
        for one in ('selected', 'controls', 'shape', 'names', 'gait'):
            del page.last[one]
        page.send(do='choose', node='/b/cpg_generator')
        page.ready()
        assert page.last['controls']['node'] == '/b/cpg_generator'
        assert page.last['shape']['source'] == "stick figure of 'biped'"
        until(lambda: len(page.last['names']['cells'][0].split(',')) == 4, 'two variables')
        until(lambda: len(page.frame.get('cells', ())) == 16, 'them of four cells')
        assert all(math.isfinite(value) for value in page.frame['cells'])
        started[1].end()
        until(lambda: page.last['state']['generators'] == ['/a/cpg_generator'], 'one left')
        # The page does not turn to the other robot by itself: nobody asked to move that one.
        page.send(do='enable', on=True)
        until(lambda: page.said == ['/b/cpg_generator is gone'], 'the answer')
        assert page.last['selected']['node'] == '/b/cpg_generator'
    finally:
        page.end()
        for one in (*started, panel):
            one.end()
