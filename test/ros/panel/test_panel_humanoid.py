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

"""A humanoid driven from the page in a real browser: it walks, runs, stops, falls, is put up."""

from contextlib import ExitStack

from graph import EXECUTABLE, Process, until, Watcher
from nav_msgs.msg import Odometry
from panel_client import press, start_panel
import pytest

pytestmark = pytest.mark.browser


def test_a_humanoid_is_steered_pushed_and_put_on_its_feet(browser):
    pytest.importorskip('mujoco', reason='the extra [sim] is not installed')
    with ExitStack() as ending:
        # Slow, and drawn small and coarsely: a page that stands still does not steer.
        body = Process('-p', 'lockstep:=true', '-p', 'robot:=humanoid', '-p', 'model:=humanoid',
                       '-p', 'real_time_factor:=0.3', executable=EXECUTABLE.with_name('robot_sim'))
        ending.callback(body.end)
        generator = Process('-p', 'use_sim_time:=true', '-p', 'rate:=250.0', '-p',
                            'robot:=humanoid', '-p', 'network:=biped', '-p', 'cmd_vel:=true',
                            '-p', "combined_topic:=''", domain=body.domain)
        ending.callback(generator.end)
        panel, address = start_panel(body.domain)
        ending.callback(panel.end)
        watcher, places = Watcher(body.domain), []
        ending.callback(watcher.end)
        watcher.node.create_subscription(Odometry, 'odom', lambda message: places.append(
            (message.pose.pose.position.x, message.twist.twist.linear.x)), 100)
        page = browser.new_page(device_scale_factor=0.25,
                                viewport={'width': 800, 'height': 600})
        ending.callback(page.close)
        page.goto(address)
        until(lambda: page.locator('#gaits button').count(), 'gaits')
        offered = page.locator('#gaits button').evaluate_all('all => all.map(b => b.dataset.gait)')
        assert {'walk', 'run', 'two_legged_hop', 'two_legged_jump'} <= set(offered)
        until(lambda: page.evaluate('panel.steering.able'), 'a pad')

        def walked(distance):
            press(page)
            return places and places[-1][0] > distance

        until(lambda: walked(0.15), 'a step')
        page.locator('#gaits button[data-gait=run]').click()
        until(lambda: watcher.gaits[-1] == 'run', 'the run')
        until(lambda: walked(0.4), 'more of it')
        page.locator('#gaits button[data-gait=walk]').click()
        until(lambda: watcher.gaits[-1] == 'walk', 'the walk')
        page.keyboard.up('ArrowUp')
        until(lambda: max(abs(speed) for _, speed in places[-100:]) < 0.05, 'a stand')
        banner = page.locator('#fallen')
        assert not banner.is_visible() and 'has fallen' not in body.log
        page.locator('#force').fill('300')

        def pushed():
            page.locator('#push').click()
            return 'has fallen' in body.log

        until(pushed, 'a fall')
        until(banner.is_visible, 'the banner')
        banner.locator('button').click()
        until(lambda: not banner.is_visible(), 'a robot that is up')
        body.wait_for('standing at the origin')
