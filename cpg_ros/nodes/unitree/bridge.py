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

"""The node ``unitree_bridge``: drives a Unitree robot by what a generator publishes."""

from collections.abc import Mapping
import sys

from cpg_ros.nodes.bridge_base import BridgeNode
from cpg_ros.nodes.bridge_start import Wait
from cpg_ros.nodes.node_base import run
from cpg_ros.nodes.unitree.interfaces import message, Unitree
from cpg_ros.nodes.unitree.motion_modes import release
from cpg_ros.nodes.unitree.parameters import SPECS
from cpg_ros.nodes.unitree.sensors import Sensors
from cpg_ros.robots.robot import Robot
from cpg_ros.safety.bridge_settings import BridgeSettings
from cpg_ros.unitree.foot_forces import FootForces
from cpg_ros.unitree.low_state import BUTTONS, LowState
from cpg_ros.unitree.models import MODELS, settings_of
from cpg_ros.unitree.participants import Announcements

NAME = Unitree.bridge_name()


class UnitreeBridge(BridgeNode):
    """Commands of a generator as ``LowCmd``; ``LowState`` as the topics that robot_sim has."""

    interface, specs = Unitree, SPECS
    state_hint = (': is the cable in, the address of this computer in 192.168.123.*, '
                  'ROS_AUTOMATIC_DISCOVERY_RANGE=SUBNET, and ROS_DOMAIN_ID 0 for a robot, 1 for '
                  "Unitree's simulator?")

    def __init__(self) -> None:
        """Declare the parameters, check them, and prepare to start.

        Raises:
            StartError: a parameter, the robot file or the messages cannot be used.

        """
        self._state = LowState()
        super().__init__(self._state)
        self._button = BUTTONS[self._value('stop_button')]
        self._sensors = Sensors(self, self.robot, self._state, FootForces(
            len(self.robot.legs), self._value('foot_scale'), self._value('foot_offset'),
            self._value('foot_threshold')))
        self._announcements = Announcements(self.context.get_domain_id())

    def make_settings(self, robot: Robot, common: dict[str, float]) -> BridgeSettings:
        """Return the settings of the robot file and the model."""
        value = self._value
        self._one_of('model', tuple(MODELS))
        self._one_of('stop_button', tuple(BUTTONS))
        message('unitree_api/Request')
        return settings_of(robot, MODELS[value('model')], list(value('kp')), list(value('kd')),
                           value('torque_factor'), **common)

    @property
    def title(self) -> str:
        """The model."""
        return str(self._value('model'))

    def prepare(self, wait: Wait) -> None:
        """Release the robot's motion modes."""
        if not self._value('motion_switcher'):
            return
        if self.dry:
            self.get_logger().info('dry run: CheckMode, StandDown and ReleaseMode are not sent')
        else:
            release(self, wait, self.log_step)

    def stop_pressed(self) -> str:
        """Return whether the stop button of the wireless remote is pressed."""
        pressed = self._state.buttons & self._button
        return 'the button of the wireless remote' if pressed else ''

    def network_hazard(self) -> str:
        """Return a participant that crashes the robot's software, or ''."""
        found = self._announcements.look()
        return found and (f'{found} is on this network: it crashes the 0.10 in '
                          "Unitree's firmware; stop it")

    def publish_measurements(self, stamp: int) -> None:
        """Publish ``joint_states``, ``imu`` and ``foot_contacts``."""
        self._sensors.publish(stamp)

    def publish_slow_measurements(self, stamp: int) -> None:
        """Publish ``battery``."""
        self._sensors.publish_battery(stamp)

    def measured_values(self) -> Mapping[str, object]:
        """Return temperatures and the charge of the battery."""
        return self._sensors.values()

    def finish(self) -> None:
        """End the threads and the watchdog, as the base class does."""
        super().finish()
        self._announcements.close()


def main(args: list[str] | None = None) -> int:
    """Run the node until a signal ends it; return the exit code."""
    return run(UnitreeBridge, NAME, 'Leads a Unitree robot by what a generator publishes.', SPECS,
               args)


if __name__ == '__main__':
    sys.exit(main())
