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

"""Pages that compete for a robot, stand still or are far away, without a browser."""

from itertools import pairwise
import json
import signal
import threading
import time

import pytest

pytest.importorskip('websockets')

from geometry_msgs.msg import Twist  # noqa: E402, I100
from graph import Process, until  # noqa: E402
from panel_client import Client, Delay, start_panel, steered_robot  # noqa: E402
import rclpy  # noqa: E402
from websockets.exceptions import InvalidStatus  # noqa: E402

#: Together on one worker, as they share a generator and a panel.
pytestmark = pytest.mark.xdist_group('panel_lease')


@pytest.fixture(scope='module')
def rig():
    """Yield a steered generator, a panel, its address, a watcher, and what is steered."""
    with steered_robot() as started:
        yield started


@pytest.fixture
def twists(rig):
    """Yield what is steered, once nobody steers any more."""
    until(lambda: not rig[4] or time.monotonic() - rig[4][-1][0] > 0.5, 'silence')
    rig[4].clear()
    return rig[4]


@pytest.fixture
def open_page(rig):
    """Open pages that are closed in the end."""
    opened = []

    def open_one(address=None):
        opened.append(Client(address or rig[2]))
        return opened[-1]

    yield open_one
    for page in opened:
        page.end()


@pytest.fixture
def teleop(rig):
    """Yield another node that publishes on cmd_vel, in a process of this test's own graph."""
    context = rclpy.Context()
    rclpy.init(context=context, domain_id=rig[0].domain)
    node = rclpy.create_node('teleop', context=context, enable_rosout=False)
    yield node
    node.destroy_node()
    rclpy.shutdown(context=context)


def moving(twists):
    """Return when the robot was steered, s."""
    return [when for when, *command in twists if command != [0.0, 0.0]]


def reversals(twists):
    speeds = [speed for _, speed, _ in twists if speed]
    return sum(one * other < 0.0 for one, other in pairwise(speeds))


def test_two_pages_do_not_steer_at_once(twists, open_page):
    one, other = open_page().ready(), open_page().ready()
    both = [threading.Thread(target=page.steer, args=(3.0, speed))
            for page, speed in ((one, 1.0), (other, -1.0))]
    for thread in both:
        thread.start()
    for thread in both:
        thread.join()
    assert moving(twists) and reversals(twists) == 0
    (loser,) = [page for page in (one, other) if page.said]
    assert len(loser.said) == 1 and 'has control of the robot: take over first' in loser.said[0]


def test_a_click_takes_over_and_both_pages_see_it(twists, open_page):
    one, other = open_page().ready(), open_page().ready()
    one.steer(0.5)
    until(lambda: moving(twists), 'steering')
    names = [page.last['lease']['page'] for page in (one, other)]
    one.lease(yours=True, holder=names[0])
    other.lease(yours=False, holder=names[0])
    other.send(do='take_over')
    one.lease(yours=False, holder=names[1], lost_to=names[1])
    other.lease(yours=True, holder=names[1])
    until(lambda: f'{names[1]} has taken over' in one.said[-1], 'the page says so')
    one.steer(0.5)
    twists.clear()
    one.steer(0.5)
    assert not moving(twists)
    other.steer(0.3, -1.0)
    one.send(do='steer', speed=0, turn=0)  # which does not stop the other
    other.steer(0.3, -1.0)
    until(lambda: twists[-1][1] == -0.5, 'the other steers')


@pytest.mark.parametrize('request_', [
    {'do': 'set', 'name': 'gait', 'value': 'walk'}, {'do': 'enable', 'on': True},
    {'do': 'push', 'force': 50, 'direction': 0}, {'do': 'reset'}, {'do': 'seat', 'on': True}])
def test_what_moves_the_robot_takes_the_lease(rig, open_page, request_):
    one, other = open_page().ready(), open_page().ready()
    one.send(do='set', name='gait', value='trot')
    one.lease(yours=True)
    other.send(**request_)
    until(lambda: other.said, 'a reason')
    assert 'has control of the robot: take over first' in other.said[-1]
    assert rig[3].get('gait') == ['trot']
    for page in (one, other):
        page.send(do='alive')
    one.send(do='release')
    other.lease(holder='')
    other.send(**request_)
    other.lease(yours=True)
    other.send(do='set', name='gait', value='trot')
    until(lambda: rig[3].gaits[-1] == 'trot', 'trot')


@pytest.mark.parametrize('how', ['closed', 'silent', 'released'])
def test_a_lease_ends(open_page, how):
    one, other = open_page().ready(), open_page().ready()
    one.send(do='take_over')
    one.lease(yours=True)
    other.lease(yours=False, holder=one.last['lease']['page'])
    began = time.monotonic()
    if how == 'closed':
        one.end()
    elif how == 'released':
        one.send(do='release')
    other.lease(holder='')
    assert how != 'silent' or time.monotonic() - began > 1.5


@pytest.mark.parametrize('stop', [{'do': 'stop'}, {'do': 'enable', 'on': False}])
def test_stop_works_from_any_page(rig, twists, open_page, stop):
    pages = [open_page() for _ in range(16)]
    pages[0].ready()
    try:
        last = open_page()
    except InvalidStatus as error:
        pytest.fail(f'the 17th page cannot stop the robot: {error}')
    last.lease(stop_only=True)
    last.send(do='set', name='gait', value='walk')
    until(lambda: last.said, 'a reason')
    assert last.said[-1] == '16 pages are open already: this one can only stop the robot'
    pages[0].steer(0.5)
    until(lambda: moving(twists), 'steering')
    last.send(**stop)
    until(lambda: twists[-1][1:] == (0.0, 0.0), 'the stop')
    until(lambda: any(text.startswith('ramping down') for text in last.said), 'the stand')
    until(lambda: abs(rig[3].samples[-1][2][0]) < 1e-6, 'the stand')
    assert not last.frames
    pages[0].send(do='enable', on=True)
    # Another closes: it can do all.
    pages[3].end()
    last.lease(stop_only=False)
    last.ready()
    pages[0].end()
    last.lease(holder='')
    last.send(do='enable', on=True)
    last.lease(yours=True)


def test_a_link_with_a_delay_does_not_steer(rig, twists, open_page):
    link = Delay(rig[2], 1.2)
    try:
        page = open_page(link.address).ready()
        page.steer(2.5)
        page.send(do='steer', speed=0, turn=0)
        time.sleep(3.0)
        assert not moving(twists)
        until(lambda: (page.last['lease']['round_trip'] or 0.0) >= 2.4, 'the page says so')
        page.send(do='enable', on=True)
        until(lambda: page.said, 'a reason')
        assert 'enable came up to 2' in page.said[-1] and 'the limit is 2 s' in page.said[-1]
        assert not page.last['lease']['holder']
        # It can stop the robot.
        page.send(do='stop')
        until(lambda: page.said[-1].startswith('ramping down'), 'the stand')
    finally:
        link.end()
    page = open_page().ready()
    page.send(do='enable', on=True)
    until(lambda: page.said, 'an answer')


def test_a_page_that_was_frozen_does_not_steer(twists, open_page):
    page = open_page().ready()
    page.steer(0.3)
    until(lambda: moving(twists), 'steering')
    stamp = page.stamp
    until(lambda: twists[-1][1] == 0.0, 'the stop')
    time.sleep(1.0)
    twists.clear()
    for _ in range(10):
        page.send(do='steer', speed=1.0, turn=0.0, **({} if stamp is None else {'stamp': stamp}))
    time.sleep(0.6)
    assert not moving(twists)
    page.steer(0.3)
    until(lambda: moving(twists), 'steering again')


def test_a_panel_that_was_stopped_publishes_zero_first(rig, twists, open_page):
    page = open_page().ready()
    page.steer(0.5)
    until(lambda: moving(twists), 'steering')
    page.send(do='steer', speed=1.0, turn=0.0)
    time.sleep(0.05)
    rig[1].signal(signal.SIGSTOP)
    # Longer than a command is fresh, 0.3 s.
    time.sleep(0.4)
    twists.clear()
    page.steer(1.0)
    assert not twists
    rig[1].signal(signal.SIGCONT)
    until(lambda: twists, 'what is published first')
    assert twists[0][1:] == (0.0, 0.0)
    time.sleep(0.6)
    assert not moving(twists)


def test_another_node_that_publishes_is_named_and_confirmed(twists, open_page, teleop):
    page = open_page().ready()
    page.steer(0.3)
    until(lambda: moving(twists), 'steering')
    publisher = teleop.create_publisher(Twist, '/cmd_vel', 10)
    page.lease(others=['/teleop'], confirmed=False)
    time.sleep(0.5)
    twists.clear()
    page.steer(0.5)
    assert not moving(twists)
    assert page.said == ['/cmd_vel is also published by /teleop: take over to steer']
    page.send(do='take_over')
    page.lease(confirmed=True, yours=True)
    page.steer(0.5)
    until(lambda: moving(twists), 'steering')
    teleop.destroy_publisher(publisher)
    page.lease(others=[])


def test_two_panels_see_one_another(rig, twists, open_page):
    # They have the same name, as two that were started without care.
    panel, address = start_panel(rig[0].domain)
    try:
        one, other = open_page().ready(), open_page(address).ready()
        one.steer(0.3)
        other.lease(others=['/cpg_panel'], confirmed=False)
        time.sleep(0.5)
        twists.clear()
        other.steer(0.3, -1.0)
        assert not moving(twists)
        for page, opponent, speed in ((other, one, -0.5), (one, other, 0.5)):
            page.send(do='take_over')
            page.lease(yours=True, confirmed=True)
            opponent.lease(others=['/cpg_panel'], confirmed=False)
            for _ in range(5):
                opponent.steer(0.1, -2.0 * speed)
                page.steer(0.1, 2.0 * speed)
            until(lambda: moving(twists), 'steering')
            assert reversals(twists) == 0 and twists[-1][1] in (0.0, speed)
            time.sleep(0.6)
            twists.clear()
        other.end()
        one.lease(others=[])
    finally:
        panel.end()


@pytest.mark.parametrize(('stamp', 'said'), [
    (1e11, 'not one that the panel has sent'), ('1', 'must be a number'),
    (-1.0, 'must be a number'), (True, 'must be a number'), (None, 'stamp')])
def test_a_stamp_that_is_not_the_panels_moves_nothing(twists, open_page, stamp, said):
    page = open_page().ready()
    page.send(do='steer', speed=1.0, turn=0.0, stamp=stamp)
    until(lambda: page.said, 'a reason')
    page.send_raw(json.dumps({'do': 'enable', 'on': True}))
    until(lambda: len(page.said) > 1, 'a reason')
    assert said in page.said[0] and 'the newest stamp from the panel is missing' in page.said[1]
    time.sleep(0.3)
    assert not moving(twists)


def test_every_generator_has_a_lease_of_its_own(rig, open_page):
    second = Process('-p', 'network:=biped', '-r', '__ns:=/b', domain=rig[0].domain)
    try:
        one, other = open_page().ready(), open_page().ready()
        until(lambda: len(other.last['state']['generators']) == 2, 'two generators')
        one.send(do='take_over')
        other.send(do='choose', node='/b/cpg_generator')
        other.lease(holder='')
        other.send(do='take_over')
        for _ in range(5):
            one.send(do='alive')
            other.send(do='alive')
            time.sleep(0.1)
        one.lease(yours=True)
        other.lease(yours=True)
        # Whoever looks elsewhere has let go.
        one.send(do='choose', node='/b/cpg_generator')
        one.lease(yours=False, holder=other.last['lease']['page'])
    finally:
        second.end()
