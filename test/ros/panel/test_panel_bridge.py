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

"""Bridges to robots on the page: what it shows of them, and its two stops."""

from contextlib import ExitStack
import threading

import pytest

pytest.importorskip('websockets')

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue  # noqa: E402, I100
from graph import EXECUTABLE, free_domain, Process, until  # noqa: E402
from panel_client import Client, start_panel  # noqa: E402
import rclpy  # noqa: E402
from rclpy.executors import SingleThreadedExecutor  # noqa: E402
from rclpy.qos import DurabilityPolicy, QoSProfile  # noqa: E402
from servo_chain import calibrated, LYING, ServoChain, STEPS  # noqa: E402
from std_msgs.msg import String  # noqa: E402
from std_srvs.srv import Trigger  # noqa: E402

BRIDGE = '/robot/some_bridge'


class SomeBridge:
    """Looks like a bridge with a battery and warm motors, and records what it is asked for."""

    def __init__(self, domain):
        self.domain, self.asked, self.mute = domain, [], False
        self._context = rclpy.Context()
        rclpy.init(context=self._context, domain_id=domain)
        self.node = node = rclpy.create_node('some_bridge', namespace='robot',
                                             context=self._context, enable_rosout=False)
        latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self._state = node.create_publisher(String, '~/state', latched)
        self._state.publish(String(data='following'))
        self._health = node.create_publisher(DiagnosticArray, '/diagnostics', 10)
        for name in ('stop', 'damp'):
            node.create_service(Trigger, f'~/{name}', lambda _, answer, name=name:
                                self._answer(name, answer))
        node.create_timer(0.1, self._publish)
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(node)
        self._thread = threading.Thread(target=self._executor.spin, daemon=True)
        self._thread.start()

    def _answer(self, name, answer):
        self.asked.append(name)
        answer.success, answer.message = name != 'stop' or len(self.asked) < 3, f'{name} it is'
        return answer

    def _publish(self):
        if not self.mute:
            values = {'battery [%]': '87', 'FR_hip [deg C]': '41', 'FR_calf [deg C]': '63',
                      'imu [deg C]': 'nan', 'late ticks': '0'}
            self._health.publish(DiagnosticArray(status=[DiagnosticStatus(
                level=DiagnosticStatus.ERROR, name=f'{BRIDGE}: robot', message='following',
                values=[KeyValue(key=key, value=value) for key, value in values.items()])]))

    def end(self):
        """Leave the graph."""
        self._executor.shutdown()
        self._thread.join(10.0)
        self.node.destroy_node()
        rclpy.shutdown(context=self._context)


def shown(page, name=BRIDGE):
    """Return what a page shows of a bridge, empty if it shows none."""
    return page.last.get('bridges', {}).get('bridges', {}).get(name, {})


@pytest.mark.live
def test_every_page_shows_bridges_and_stops_them_without_control():
    with ExitStack() as ending:
        bridge = SomeBridge(free_domain())
        ending.callback(bridge.end)
        panel, address = start_panel(bridge.domain)
        ending.callback(panel.end)
        # Without a generator; the last page is one of those that can only stop the robot.
        pages = [ending.enter_context(Closing(address)) for _ in range(17)]
        for page in (pages[0], pages[-1]):
            until(lambda: shown(page) == {  # noqa: B023
                'state': 'following', 'level': 'error', 'text': 'following', 'battery': 87.0,
                'hottest': [63.0, 'FR_calf']}, 'the bridge')
        pages[-1].send(do='damp', bridge=BRIDGE)
        until(lambda: pages[-1].said == ['damp it is'], 'the answer')
        pages[0].send(do='sit', bridge=BRIDGE)
        until(lambda: pages[0].said == ['stop it is'], 'the answer')
        assert bridge.asked == ['damp', 'stop']
        # A refusal is shown, and what is no bridge is not called.
        pages[0].send(do='sit', bridge=BRIDGE)
        pages[1].send(do='damp', bridge='/robot')
        until(lambda: len(pages[0].said) == 2 and pages[1].said, 'the answers')
        assert pages[1].said == ["there is no bridge '/robot'"]
        bridge.mute = True
        until(lambda: shown(pages[0]).get('level') == 'stale', 'a silent bridge')
        bridge.node.destroy_service(next(one for one in bridge.node.services
                                         if one.srv_name.endswith('/damp')))
        until(lambda: not shown(pages[0]), 'no bridge any more')
        assert panel.alive


class Closing(Client):
    """A page for a with statement."""

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.end()


def lying():
    """Return the step of each servo when the robot lies."""
    return {k + 1: round(2048 + (1 - 2 * (k % 2)) * STEPS * angle)
            for k, angle in enumerate(LYING)}


@pytest.fixture
def servo_robot(tmp_path):
    """Yield the domain and the servos of a robot whose bridge holds it at its stand."""
    with ExitStack() as ending:
        chain = ServoChain(lying())
        ending.callback(chain.end)
        domain, path = free_domain(), calibrated(tmp_path, chain.path)
        arguments = '-p', f'calibration:={path}', '-p'
        bus = Process(*arguments, 'command_timeout:=1.0', domain=domain,
                      executable=EXECUTABLE.with_name('servo_bus'))
        ending.callback(bus.end)
        bridge = Process(*arguments, 'robot:=biped', '-p', 'state_timeout:=5.0', domain=domain,
                         executable=EXECUTABLE.with_name('servo_bridge'))
        ending.callback(bridge.end)
        bridge.wait_for('standing: it has risen')
        yield domain, chain


@pytest.mark.browser
@pytest.mark.parametrize('button', ['Sit down', 'Damp at once'])
def test_two_buttons_make_a_real_bridge_sit_and_damp(servo_robot, browser, button):
    domain, chain = servo_robot
    with ExitStack() as ending:
        panel, address = start_panel(domain)
        ending.callback(panel.end)
        page, other = browser.new_page(), browser.new_page()
        ending.callback(page.close)
        ending.callback(other.close)
        for one in (page, other):
            one.goto(address)
            until(lambda: one.locator('.bridge .chip').inner_text() == 'standing',  # noqa: B023
                  'the state')
        page.locator('.bridge button', has_text=button).click()
        for one in (page, other):
            until(lambda: one.locator('.bridge .chip').inner_text() == 'damping',  # noqa: B023
                  'a robot that is damped')
        until(lambda: not any(chain.torque.values()), 'no torque')
        away = max(abs(chain.goals[servo] - goal) for servo, goal in lying().items())
        assert away <= 1 if button == 'Sit down' else away > 100
