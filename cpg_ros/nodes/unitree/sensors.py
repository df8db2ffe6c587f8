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
from cpg_ros.nodes.message_block import each, MessageBlock, places, Template
from cpg_ros.nodes.qos_profiles import OVERRIDABLE
from cpg_ros.robots.robot import Robot
from cpg_ros.unitree.foot_forces import FootForces
from cpg_ros.unitree.low_state import LowState
from cpg_ros.unitree.models import JOINTS, PARTS
from rclpy.node import Node
from rclpy.qos import QoSProfile
from sensor_msgs.msg import BatteryState, Imu

#: Unitree's feet are in the order of its legs.
FEET = tuple(name.partition('_')[0] for name in JOINTS[::len(PARTS)])


class Sensors:
    """Publishes ``joint_states``, ``imu``, ``foot_contacts``; once a second ``battery``."""

    def __init__(self, node: Node, robot: Robot, state: LowState, feet: FootForces) -> None:
        """Publish the contents of ``state``, joints in ``robot.order``."""
        self._state, self._forces, self._legs = state, feet, tuple(robot.legs)
        names = robot.order
        self._from = [JOINTS.index(name) for name in names]
        self._feet = [FEET.index(leg[0].name.partition('_')[0]) for leg in robot.legs.values()]
        n = len(names)
        sizes = n, n, n, 4, 3, 3, len(self._feet)
        *joints, orientation, rates, acceleration, forces = places(sizes)
        imu = Imu()
        imu.header.frame_id = 'imu'
        self._block = MessageBlock(node, sizes, [
            ('joint_states', joint_state(names, *joints)),
            ('imu', Template(imu, [imu.header.stamp], numbers=[
                *each(imu.orientation, 'wxyz', orientation),
                *each(imu.angular_velocity, 'xyz', rates),
                *each(imu.linear_acceleration, 'xyz', acceleration)])),
            ('foot_contacts', labelled(tuple(robot.legs), forces))])
        self._battery = node.create_publisher(BatteryState, 'battery', QoSProfile(depth=100),
                                              qos_overriding_options=OVERRIDABLE)

    def publish(self, stamp: int) -> None:
        """Publish the state; stamp in ns."""
        state, joints = self._state, self._from
        self._block.publish(stamp, (
            state.q[joints], state.dq[joints], state.torque[joints], state.quaternion,
            state.gyroscope, state.accelerometer, self._forces.newtons(state.feet[self._feet])))

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
        """Return temperatures in deg C, charge in % and raw foot sensors, for /diagnostics."""
        state = self._state
        heat = {f'{name} [deg C]': value
                for name, value in zip(JOINTS, state.temperature.tolist(), strict=True)}
        feet = {f'foot {leg} [raw]': raw for leg, raw in zip(
            self._legs, state.feet[self._feet].tolist(), strict=True)}
        return {**heat, **feet, 'imu [deg C]': state.imu_temperature,
                'battery [%]': round(100.0 * state.charge)}
