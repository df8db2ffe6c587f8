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

"""The node ``unitree_bridge``: drives a Unitree robot from a generator's output."""

from collections.abc import Callable, Mapping
from contextlib import suppress
from importlib import import_module
import json
from pathlib import Path
import re
import socket
import struct
import sys
import time
from typing import Any, ClassVar

from cpg_ros.common.errors import MissingLibraryError
from cpg_ros.motion.robot import Robot
from cpg_ros.ros.bridges.bridge import BridgeNode, StartRefused, Wait
from cpg_ros.ros.bridges.robot_state import bridge_specs, BridgeSettings
from cpg_ros.ros.bridges.unitree.messages import (
    BUTTONS,
    FootForces,
    LowCmd,
    LowState,
    Model,
    MODELS,
    PARTS,
    settings_of,
)
from cpg_ros.ros.bridges.watchdog_link import RobotInterface
from cpg_ros.ros.generator_io import foot_wrenches, joint_state, labelled, STAMPED
from cpg_ros.ros.node.message_block import each, indices, MessageBlock, Template
from cpg_ros.ros.node.node_base import run
from cpg_ros.ros.node.parameters import fixed, one_of, Spec
from cpg_ros.ros.node.polled import OVERRIDABLE, PolledSubscription
import rclpy
from rclpy.node import Node
from rclpy.qos import QoSProfile
from sensor_msgs.msg import BatteryState, Imu


def message(name: str) -> type:
    """Return a message type, such as ``unitree_go/LowCmd``.

    Raises:
        MissingLibraryError: its package is not there; says how to get it.

    """
    package, kind = name.split('/')
    try:
        return getattr(import_module(f'{package}.msg'), kind)
    except ImportError as error:
        wheels = Path(rclpy.__file__).is_relative_to(sys.prefix)
        raise MissingLibraryError(
            f'the messages of {package} are missing ({error}): ' + (
                "'make messages' builds them" if wheels else
                f'build {package} and unitree_api of '
                'https://github.com/unitreerobotics/unitree_ros2 with colcon, and source that '
                'workspace')) from error


class Unitree(RobotInterface):
    """Low-level commands and states of robots with four legs, by ``unitree_go``.

    Attributes:
        model: that the messages are for.

    """

    maker = 'unitree'
    command_topic, state_topic = '/lowcmd', '/lowstate'
    raw_states = True
    model: ClassVar[Model] = MODELS['go2']

    @classmethod
    def command_type(cls) -> type:
        """Return ``LowCmd``; errors as of ``message``."""
        return message(f'{cls.model.package}/LowCmd')

    @classmethod
    def state_type(cls) -> type:
        """Return ``LowState``; errors as of ``message``."""
        return message(f'{cls.model.package}/LowState')

    @classmethod
    def make_command(cls) -> LowCmd:
        """Return a command in which no joint is driven."""
        return LowCmd(cls.model)


class UnitreeG1(Unitree):
    """Those of the humanoid G1, by ``unitree_hg``."""

    model = MODELS['g1']


class UnitreeH12(Unitree):
    """Those of the humanoid H1-2, by ``unitree_hg``."""

    model = MODELS['h1_2']


#: Model -> interface; Unitree for the others.
INTERFACES: dict[str, type[Unitree]] = {'g1': UnitreeG1, 'h1_2': UnitreeH12}


#: Vendor id of Eclipse Cyclone DDS in RTPS packets.
_VENDOR = b'\x01\x10'
#: Host, version and system in a zero-terminated string.
_VERSION = re.compile(rb'([\x20-\x7e]+)/(\d+)\.(\d+)\.\d+/\w+/\w+\0')
_MULTICAST_GROUP = '239.255.0.1'
#: First major version of Cyclone DDS whose announcements crash the robot's firmware.
HARMFUL_VERSION = 11


def harmful(packet: bytes) -> str:
    """Return the sender of an announcement that would crash the robot's firmware, or ''."""
    if packet[:4] != b'RTPS' or packet[6:8] != _VENDOR:
        return ''
    for host, major, minor in _VERSION.findall(packet):
        if int(major) >= HARMFUL_VERSION:
            return f'cyclonedds {int(major)}.{int(minor)} on {host.decode()}'
    return ''


class Announcements:
    """Receives the announcements of a domain; none where the socket cannot be opened."""

    def __init__(self, domain: int) -> None:
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.setblocking(False)
        self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            self._socket.bind(('', 7400 + 250 * domain))
            for index, _ in socket.if_nameindex():
                group = struct.pack('4s4si', socket.inet_aton(_MULTICAST_GROUP), bytes(4), index)
                # An interface without multicast has no announcements.
                with suppress(OSError):
                    self._socket.setsockopt(socket.IPPROTO_IP, socket.IP_ADD_MEMBERSHIP, group)
        except OSError:
            self._socket.close()

    def check(self) -> str:
        """Return which harmful participant has announced itself since the last call, or ''."""
        hazard = ''
        while self._socket.fileno() >= 0:
            try:
                hazard = harmful(self._socket.recv(65536)) or hazard
            except BlockingIOError:
                break
        return hazard

    def close(self) -> None:
        """Close the socket."""
        self._socket.close()


# The parameters of ``unitree_bridge``.

SPECS = fixed(bridge_specs(
    'unitree_go2',
    model=Spec('go2', 'robot model, which determines the torque limits',
               constraints=one_of(MODELS)),
    kp=Spec([0.0], 'proportional gains [N m / rad]; 0 for 60, or, of a humanoid, those of the '
            'robot file', constraints='one number, one for each joint in motor order, or, with '
            'four legs, three for hip, thigh and calf'),
    kd=Spec([0.0], 'damping gains [N m s / rad]; 0 for 2, or, of a humanoid, those of the robot '
            'file', constraints='as kp'),
    foot_scale=Spec(1.0, 'force per unit of a foot sensor [N]', 0.001, 1000.0),
    foot_offset=Spec([0.0], "reading of a foot sensor in the air, in the robot's units",
                     constraints="one number, or one for each leg in the robot file's order"),
    foot_threshold=Spec([0.0], 'force below which a foot is taken to be in the air [N]',
                        constraints='as foot_offset'),
    stop_button=Spec('B', 'button of the wireless remote that stops the robot, pressed alone or '
                     'with others', constraints=one_of(BUTTONS)),
    stamped=STAMPED,
    motion_switcher=Spec(True, "ask the robot's own service to release its motion modes; set to "
                         'false for simulators, which have none')))


# The measurements of a Unitree robot, on the topics that robot_sim has.

#: Unitree's feet are in the order of its legs.
FEET = tuple(name.partition('_')[0] for name in MODELS['go2'].joints[::len(PARTS)])


class Sensors:
    """Publishes ``joint_states``, ``imu``; of robots with four legs ``foot_contacts``, and, once a
    second, ``battery``.
    """

    def __init__(self, node: Node, robot: Robot, state: LowState, feet: FootForces,
                 stamped: bool = False) -> None:
        """Publish the contents of ``state``, joints in ``robot.order``, then those that are held.

        ``stamped`` adds forces on the feet with stamps, in frames such as ``lh_foot``.
        """
        self._state, self._forces, joints_there = state, feet, state.model.joints
        self._legs = () if state.model.humanoid else tuple(robot.legs)
        names = (*robot.order, *(name for name in joints_there if name in robot.held))
        self._from = [joints_there.index(name) for name in names]
        self._feet = [FEET.index(robot.legs[leg][0].name.partition('_')[0]) for leg in self._legs]
        n = len(names)
        sizes = n, n, n, 4, 3, 3, len(self._feet)
        *joints, orientation, rates, acceleration, forces = indices(sizes)
        imu = Imu()
        imu.header.frame_id = 'imu'
        templates = [
            ('joint_states', joint_state(names, *joints)),
            ('imu', Template(imu, [imu.header.stamp], numbers=[
                *each(imu.orientation, 'wxyz', orientation),
                *each(imu.angular_velocity, 'xyz', rates),
                *each(imu.linear_acceleration, 'xyz', acceleration)]))]
        if self._legs:
            templates.append(('foot_contacts', labelled(self._legs, forces)))
            if stamped:
                templates += foot_wrenches(self._legs, forces,
                                           {leg: f'{leg}_foot' for leg in self._legs})
            self._battery = node.create_publisher(BatteryState, 'battery', QoSProfile(depth=100),
                                                  qos_overriding_options=OVERRIDABLE)
        self._block = MessageBlock(node, sizes, templates)

    def publish(self, stamp: int) -> None:
        """Publish the state; stamp in ns."""
        state, joints = self._state, self._from
        numbers = (state.q[joints], state.dq[joints], state.torque[joints], state.quaternion,
                   state.gyroscope, state.accelerometer)
        self._block.publish(stamp, (*numbers, self._forces.newtons(state.feet[self._feet]))
                            if self._legs else (*numbers, state.feet))

    def publish_battery(self, stamp: int) -> None:
        """Publish the battery's state, if it is in LowState; stamp in ns."""
        state = self._state
        if state.model.humanoid:
            return
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
        heat = {f'{name} [deg C]': value for name, value in zip(
            state.model.joints, state.temperature.tolist(), strict=True)}
        feet = {f'foot {leg} [raw]': state.feet[foot].item()
                for leg, foot in zip(self._legs, self._feet, strict=True)}
        battery = {} if state.model.humanoid else {'battery [%]': round(100.0 * state.charge)}
        return {**heat, **feet, 'imu [deg C]': state.imu_temperature, **battery}


# The motion modes of a Unitree robot, which must be off while a bridge commands it.

#: Identifiers of requests. CHECK_MODE, RELEASE_MODE: of the service motion_switcher; STAND_DOWN:
#: of the service sport.
CHECK_MODE, RELEASE_MODE, STAND_DOWN = 1001, 1003, 1005
#: RESPONSE_TIMEOUT: of a request, s; RELEASE_TIMEOUT: of the release of all modes, s.
RESPONSE_TIMEOUT, RELEASE_TIMEOUT = 3.0, 30.0
#: LIE_DOWN_TIME: of the robot, s; RELEASE_TIME: after the release of a mode, s.
LIE_DOWN_TIME, RELEASE_TIME = 4.0, 1.0


class RobotService:
    """One of the robot's own services behind ``unitree_api``."""

    def __init__(self, node: Node, name: str, wait: Wait) -> None:
        """Connect; ``wait`` sleeps for some seconds, or raises StartRefused."""
        self._name, self._wait, self._node = name, wait, node
        self._request = message('unitree_api/Request')
        self._publisher = node.create_publisher(self._request, f'/api/{name}/request',
                                                QoSProfile(depth=10))
        self._answers = PolledSubscription(node, message('unitree_api/Response'),
                                           f'/api/{name}/response', QoSProfile(depth=10))

    def call(self, number: int) -> dict[str, Any]:
        """Send a request; return the data of the answer.

        Raises:
            StartRefused: there is no answer, or the robot refuses.

        """
        request = self._request()
        request.header.identity.id = time.monotonic_ns()
        request.header.identity.api_id = number
        request.parameter = '{}'
        end = time.monotonic() + RESPONSE_TIMEOUT
        while not (self._publisher.get_subscription_count()
                   and self._node.count_publishers(self._answers.topic)):
            if time.monotonic() > end:
                raise StartRefused(f"the robot has no service '{self._name}'; a simulator has "
                                   'none: motion_switcher:=false')
            self._wait(0.05)
        self._publisher.publish(request)
        while time.monotonic() < end + RESPONSE_TIMEOUT:
            for answer, _ in self._answers.receive():
                if answer.header.identity.id == request.header.identity.id:
                    if code := answer.header.status.code:
                        raise StartRefused(f"the robot's service '{self._name}' refuses request "
                                           f'{number} with code {code}')
                    return json.loads(answer.data or '{}')
            self._wait(0.02)
        raise StartRefused(f"the robot's service '{self._name}' does not answer request {number}")


def release(node: Node, lies: bool, wait: Wait, log: Callable[[str], None]) -> None:
    """Make the robot lie down and release its motion modes.

    Args:
        node: the bridge.
        lies: whether it lies down; a humanoid hangs in its rack instead.
        wait: sleeps for some seconds, or raises StartRefused.
        log: takes a line for each step.

    Raises:
        StartRefused: the robot has no such service, or does not release a mode.

    """
    switcher = RobotService(node, 'motion_switcher', wait)
    sport, end = None, time.monotonic() + RELEASE_TIMEOUT
    while name := switcher.call(CHECK_MODE).get('name', ''):
        if time.monotonic() > end:
            raise StartRefused(f"the robot does not release its motion mode '{name}'")
        if sport is None and lies:
            sport = RobotService(node, 'sport', wait)
            log(f"its motion mode '{name}' is active: it is asked to lie down")
            sport.call(STAND_DOWN)
            wait(LIE_DOWN_TIME)
        log(f"its motion mode '{name}' is to be released")
        switcher.call(RELEASE_MODE)
        wait(RELEASE_TIME)
    log('no motion mode of its own is active')


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
        super().__init__()
        self._button = BUTTONS[self._value('stop_button')]
        self._sensors = Sensors(self, self.robot, self._state, FootForces(
            len(self.robot.legs), self._value('foot_scale'), self._value('foot_offset'),
            self._value('foot_threshold')), self._value('stamped'))
        self._announcements = Announcements(self.context.get_domain_id())

    def make_state(self) -> LowState:
        """Return the state of a robot of the model."""
        self._one_of('model', tuple(MODELS))
        model = self._value('model')
        self.interface = INTERFACES.get(model, Unitree)
        self._state = LowState(MODELS[model])
        return self._state

    def make_settings(self, robot: Robot, common: dict[str, float]) -> BridgeSettings:
        """Return the settings of the robot file and the model."""
        value = self._value
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
            release(self, not self._state.model.humanoid, wait, self.log_step)

    def stop_pressed(self) -> str:
        """Return whether the stop button of the wireless remote is pressed."""
        pressed = self._state.buttons & self._button
        return 'the button of the wireless remote' if pressed else ''

    def graph_hazard(self) -> str:
        """Return a participant that crashes the robot's software, or ''."""
        hazard = self._announcements.check()
        return hazard and (f'{hazard} is on this network: it crashes the 0.10 in '
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
    return run(UnitreeBridge, NAME, "Drives a Unitree robot from a generator's output.", SPECS,
               args)
