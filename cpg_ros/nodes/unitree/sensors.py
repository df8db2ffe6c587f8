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

"""The measurements of a Unitree robot, on the topics that robot_sim has."""

from cpg_ros.nodes.joint_publishers import joint_state, labelled
from cpg_ros.nodes.message_block import each, MessageBlock, Template
from cpg_ros.robots.robot import Robot
from cpg_ros.unitree.low_state import LowState
from cpg_ros.unitree.models import JOINTS, PARTS
import numpy as np
from rclpy.node import Node
from rclpy.qos import QoSProfile
from rclpy.qos_overriding_options import QoSOverridingOptions
from sensor_msgs.msg import BatteryState, Imu

#: Unitree's feet are in the order of its legs.
FEET = tuple(name.partition('_')[0] for name in JOINTS[::len(PARTS)])


class Sensors:
    """Publishes ``joint_states``, ``imu``, ``foot_contacts``; once a second ``battery``."""

    def __init__(self, node: Node, robot: Robot, state: LowState) -> None:
        """Be ready to publish what ``state`` holds, joints in ``robot.order``."""
        self._state = state
        names = list(robot.order)
        self._from = [JOINTS.index(name) for name in names]
        self._feet = [FEET.index(leg[0].name.partition('_')[0]) for leg in robot.legs.values()]
        n = len(names)
        # The block's numbers: positions, velocities, efforts, orientation, rates, forces.
        parts = np.split(np.arange(3 * n + 10 + len(self._feet)),
                         np.cumsum([n, n, n, 4, 3, 3]))
        self._parts = [slice(part[0], part[-1] + 1) for part in parts]
        *_, orientation, rates, acceleration, forces = parts
        imu = Imu()
        imu.header.frame_id = 'imu'
        self._block = MessageBlock(node, parts[-1][-1] + 1, [
            ('joint_states', joint_state(names, np.arange(n), n, 2 * n)),
            ('imu', Template(imu, [imu.header.stamp], numbers=[
                *each(imu.orientation, 'wxyz', orientation),
                *each(imu.angular_velocity, 'xyz', rates),
                *each(imu.linear_acceleration, 'xyz', acceleration)])),
            ('foot_contacts', labelled(tuple(robot.legs), forces))])
        self._battery = node.create_publisher(
            BatteryState, 'battery', QoSProfile(depth=100),
            qos_overriding_options=QoSOverridingOptions.with_default_policies())

    def publish(self, stamp: int) -> None:
        """Publish the state; stamp in ns."""
        state, values = self._state, self._block.values
        for part, given in zip(self._parts, (
                state.q[self._from], state.dq[self._from], state.torque[self._from],
                state.quaternion, state.gyroscope, state.accelerometer,
                state.feet[self._feet]), strict=True):
            values[part] = given
        self._block.publish(stamp)

    def publish_battery(self, stamp: int) -> None:
        """Publish the battery's state; stamp in ns."""
        state = self._state
        message = BatteryState(
            voltage=state.voltage, current=state.current, percentage=state.charge,
            temperature=float('nan'), charge=float('nan'), capacity=float('nan'),
            design_capacity=float('nan'), cell_voltage=state.cells, present=bool(state.cells),
            power_supply_status=BatteryState.POWER_SUPPLY_STATUS_DISCHARGING,
            power_supply_technology=BatteryState.POWER_SUPPLY_TECHNOLOGY_LION)
        message.header.stamp.sec, message.header.stamp.nanosec = divmod(stamp, 1_000_000_000)
        self._battery.publish(message)

    def values(self) -> dict[str, object]:
        """Return temperatures in deg C and the charge of the battery in %, for /diagnostics."""
        state = self._state
        heat = {f'{name} [deg C]': value
                for name, value in zip(JOINTS, state.temperature.tolist(), strict=True)}
        return {**heat, 'imu [deg C]': state.imu_temperature,
                'battery [%]': round(100.0 * state.charge)}
