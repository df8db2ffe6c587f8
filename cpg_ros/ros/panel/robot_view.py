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

"""A generator with its robot, and the bridges on the graph, as pages show them."""

import asyncio
from collections.abc import Callable, Iterable, Mapping
import math
import re
import time
from typing import Any

from cpg_ros.ros.node.client import (
    CallError,
    Graph,
    level,
    namespace,
    NodeClient,
    RequestRefused,
    ServiceClients,
)
from cpg_ros.ros.node.parameters import choices, presets_among, untuned_among
from cpg_ros.ros.node.polled import best_effort, latched, PolledSubscription
from cpg_ros.ros.panel import shape
from cpg_ros.ros.panel.pages import RequestError
from cpg_ros.ros.panel.teleop import Teleop
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from geometry_msgs.msg import Wrench
from nav_msgs.msg import Odometry
from rcl_interfaces.msg import ParameterEvent, ParameterType
from rclpy.node import Node
from rclpy.parameter import parameter_value_to_python
from rclpy.qos import QoSProfile
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray, String
from std_srvs.srv import SetBool, Trigger

# The parameters of a node as controls of a page, made from its own descriptors.

#: Types that a page has a control for.
CONTROL_TYPES = {ParameterType.PARAMETER_BOOL: 'bool', ParameterType.PARAMETER_INTEGER: 'integer',
         ParameterType.PARAMETER_DOUBLE: 'double', ParameterType.PARAMETER_STRING: 'text'}
#: How long a node may take to judge a value, s: it may have to solve for a gait.
SET_TIMEOUT = 30.0
#: Parameters that every node of ROS has.
COMMON_PARAMETERS = ('qos_overrides.', 'start_type_description_service', 'use_sim_time')


def unit(text: str) -> str:
    """Return the unit in a description, as in ``rate [Hz]``; '' if it has none."""
    match = re.search(r'\[([^\]]+)\]', text)
    return match[1] if match else ''


#: HEALTH: topic on which nodes publish their health, with its type and quality.
HEALTH = {'/diagnostics': (DiagnosticArray, best_effort(20))}


class Subscriptions(dict[str, PolledSubscription]):
    """Topics that are subscribed to and polled, by name."""

    def __init__(self, watch: Node) -> None:
        """Follow no topic; ``watch`` subscribes, and is not spun."""
        super().__init__()
        self._watch = watch

    def subscribe_to(self, topics: Mapping[str, tuple[type, QoSProfile | None]]) -> None:
        """Subscribe to these topics, name -> type and quality, and to no others."""
        for name in set(self) - set(topics):
            self.pop(name).close()
        for name in set(topics) - set(self):
            self[name] = PolledSubscription(self._watch, topics[name][0], name, topics[name][1],
                                            overridable=False)

    def receive(self, name: str) -> list[Any]:
        """Return the messages that have arrived on a topic; none if it is not followed."""
        return [message for message, _ in self[name].receive()] if name in self else []

    def newest(self, name: str) -> Any:
        """Return the newest message that has arrived on a topic, None for none."""
        return self[name].newest() if name in self else None


class Controls:
    """One node's parameters.

    Attributes:
        by_name: parameter -> its control as pages draw it, with the value.

    """

    def __init__(self, node: NodeClient, report: Callable[[str], None]) -> None:
        """Control a node; ``report`` takes a line for each value that the node rejects."""
        self._node, self._report = node, report
        self.by_name: dict[str, dict[str, Any]] = {}
        self._waiting: dict[str, Any] = {}
        self._work: asyncio.Task | None = None

    async def read(self) -> None:
        """Read descriptors and values from the node.

        Raises:
            CallError: it does not answer.

        """
        names = [name for name in await self._node.parameters()
                 if not name.startswith(COMMON_PARAMETERS)]
        described, values = await self._node.descriptors(names), await self._node.values(names)
        controls = {}
        for name, descriptor, value in zip(names, described, values, strict=True):
            if descriptor.type not in CONTROL_TYPES:
                continue
            (span,) = (*descriptor.floating_point_range, *descriptor.integer_range)[:1] or (None,)
            controls[name] = {
                'name': name, 'kind': CONTROL_TYPES[descriptor.type],
                'text': descriptor.description, 'unit': unit(descriptor.description),
                'fixed': descriptor.read_only,
                'choices': choices(descriptor.additional_constraints),
                'presets': presets_among(descriptor.additional_constraints),
                'untuned': untuned_among(descriptor.additional_constraints),
                'value': value,
                'low': span.from_value if span else None, 'high': span.to_value if span else None}
        self.by_name = controls

    def update(self, event: ParameterEvent) -> dict[str, Any]:
        """Store the changes of an event; return name -> value if they are this node's."""
        if event.node != self._node.name:
            return {}
        values = {parameter.name: parameter_value_to_python(parameter.value)
                  for parameter in event.changed_parameters if parameter.name in self.by_name}
        for name, value in values.items():
            self.by_name[name]['value'] = value
        return values

    def value(self, name: str) -> Any:
        """Return a parameter's value, None if there is none."""
        return self.by_name.get(name, {}).get('value')

    def set(self, name: str, value: Any) -> None:  # noqa: A003
        """Set a parameter soon; of several waiting values only the last one is sent.

        Raises:
            RequestError: the node has no such parameter, or it cannot change.

        """
        control = self.by_name.get(name)
        if control is None:
            raise RequestError(f"{self._node.name} has no parameter '{name}'")
        if control['fixed']:
            raise RequestError(f'{name} cannot be changed while the node runs')
        self._waiting[name] = value
        if self._work is None or self._work.done():
            self._work = asyncio.get_running_loop().create_task(self._send())

    async def _send(self) -> None:
        while self._waiting:
            name = next(iter(self._waiting))
            value = self._waiting.pop(name)
            try:
                await self._node.set_parameters({name: value}, SET_TIMEOUT)
            except RequestRefused as error:
                self._report(f'{name} {value}: {error}')
            except CallError as error:
                self._report(str(error))


#: Decimal places of values: a tenth of a milliradian is less than a pixel.
DIGITS = 4
#: The folder of an absolute path.
FOLDER_PATTERN = re.compile(r"(?<![\w/:.])/(?:[^/\s:'\"]+/)+")


#: A topic that is silent for this long has no message, s.
MESSAGE_TIMEOUT = 1.0
#: Type of ``robot_description``.
STRING_TYPE = 'std_msgs/msg/String'


def descriptions(space: str) -> tuple[str, str]:
    """Return the usual topics of a robot's URDF, that of the namespace first."""
    return f'{space}/robot_description', '/robot_description'


async def _once(watch: Node, kind: type, name: str) -> Any:
    """Return a topic's next or latched message, None if none arrives in time."""
    topic = Subscriptions(watch)
    topic.subscribe_to({name: (kind, latched() if kind is String else None)})
    try:
        for _ in range(round(MESSAGE_TIMEOUT / 0.02)):
            if (message := topic.newest(name)) is not None:
                return message
            await asyncio.sleep(0.02)
        return None
    finally:
        topic.subscribe_to({})


class RobotView:
    """Topics, parameters and shape of one generator.

    Attributes:
        controls: its parameters.
        teleop: its lease and its ``cmd_vel``.

    """

    def __init__(self, node: Node, watch: Node, services: ServiceClients, name: str,
                 fastest: tuple[float, float], report: Callable[[str], None],
                 send: Callable[[dict[str, Any]], None]) -> None:
        """View the generator ``name``; ``node`` is spun, ``watch`` is not.

        ``fastest`` is the speed in m/s and the yaw rate in rad/s at full deflection. ``report``
        shows a line on its pages, ``send`` sends them a message.
        """
        self.name, self._space = name, namespace(name)
        self._node, self._watch, self._services = node, watch, services
        self._report, self._send, self._topics = report, send, Subscriptions(watch)
        self.controls = Controls(NodeClient(services, name), report)
        # A client that the generator does not know yet would delay a stop.
        services.client(SetBool, f'{name}/enable')
        self._pushes: Any = None
        self.teleop = Teleop(
            node, f'{self._space}/cmd_vel', fastest,
            lambda: self.controls.value('stamped_cmd_vel') is True)
        self.graph = Graph()
        self._latest: dict[str, dict[str, Any]] = {}
        self._joints: dict[str, float] = {}
        self._names: dict[str, list[str]] = {}
        self._urdf = str(node.get_parameter('urdf').value)
        self._readied: asyncio.Task | None = None
        self._stale = True
        self._sources: tuple[str, ...] = ()

    # -- parameters and shape ---------------------------------------------------------------

    def ready(self) -> None:
        """Start reading parameters and shape, at first and when their sources have changed."""
        sources = (self.graph.beside(self.name, self.graph.simulations),
                   *sorted(name for name, _ in self.graph.topics
                           if name in descriptions(self._space)))
        if self._stale or sources != self._sources:
            self._stale, self._sources = False, sources
            if self._readied is not None:
                self._readied.cancel()
            self._readied = asyncio.get_running_loop().create_task(self._ready())

    async def _ready(self) -> None:
        try:
            await self.controls.read()
            self._keep({'type': 'controls', 'node': self.name,
                        'controls': list(self.controls.by_name.values())})
            info = await self._robot_info()
            doubts: list[str] = []
            drawn = await asyncio.to_thread(shape.find, info, doubts.append)
            doubts = list(dict.fromkeys(doubts))[:5]
            for doubt in doubts:
                self._node.get_logger().warning(doubt)
            # A page sees folders only of files that the graph names, not of the panel's own.
            named = ' '.join((info.robot, info.model, info.description))
            doubts = [FOLDER_PATTERN.sub(lambda names: names[0] * (names[0] in named), doubt)
                      for doubt in doubts]
            self._keep({**drawn.message(), 'doubts': doubts})
        except CallError as error:
            self._report(str(error))
            self._stale = True

    async def _robot_info(self) -> shape.RobotInfo:
        """Return the description of the robot by the graph and the user.

        Raises:
            CallError: the simulation does not answer.

        """
        robot = str(self.controls.value('robot') or '')
        info = shape.RobotInfo(self._urdf, robot=robot)
        for topic in descriptions(self._space):
            if not (info.urdf or info.description) and (topic, STRING_TYPE) in self.graph.topics:
                message = await _once(self._watch, String, topic)
                info.description = getattr(message, 'data', '')
        if simulation := self.graph.beside(self.name, self.graph.simulations):
            model, = await NodeClient(self._services, simulation).values(['model'])
            info.model = str(model or '')
        if shape.shipped_robot(robot) is None:
            for topic in self._leg_topics():
                message = await _once(self._watch, JointState, topic)
                leg = topic.split('/')[-2]
                info.legs[leg] = list(message.name) if message else []
        return info

    def _leg_topics(self) -> list[str]:
        """Return the topics of single legs' joint states, sorted."""
        pattern = re.compile(re.escape(self._space) + '/[^/]+/joint_states')
        return sorted(name for name, kind in self.graph.topics
                      if kind == 'sensor_msgs/msg/JointState' and pattern.fullmatch(name))

    def messages(self) -> list[dict[str, Any]]:
        """Return the messages that a new page needs."""
        return list(self._latest.values())

    def _keep(self, message: dict[str, Any]) -> None:
        self._latest[message['type']] = message
        self._send(message)

    # -- topics -----------------------------------------------------------------------------

    def listen(self, graph: Graph, listening: bool) -> None:
        """Subscribe to the topics on the graph, or to none if no page shows the generator."""
        self.graph = graph
        space = self._space
        # One topic with all joints costs their publisher less than one for each leg.
        whole = f'{space}/joint_states'
        joints = [whole] if self._watch.count_publishers(whole) else self._leg_topics()
        topics = {f'{self.name}/gait': (String, latched()),
                  '/parameter_events': (ParameterEvent, best_effort(100))}
        for kind, name, names in (
                (JointState, 'sensor_msgs/msg/JointState', joints),
                (Odometry, 'nav_msgs/msg/Odometry', [f'{space}/odom']),
                (Float64MultiArray, 'std_msgs/msg/Float64MultiArray',
                 [f'{self.name}/phase', f'{self.name}/cells', f'{space}/foot_contacts'])):
            topics.update({topic: (kind, best_effort()) for topic in names
                           if (topic, name) in graph.topics})
        self._topics.subscribe_to(topics if listening else {})

    def frame(self) -> dict[str, Any]:
        """Return the values that changed since the last frame."""
        values: dict[str, Any] = {}
        fresh = False
        for name, topic in self._topics.items():
            if name.endswith('/joint_states') and (joints := topic.newest()) is not None:
                self._joints.update(zip(joints.name, joints.position, strict=False))
                values['time'] = joints.header.stamp.sec + 1e-9 * joints.header.stamp.nanosec
                fresh = True
        if fresh:
            self._names_message('joints', list(self._joints))
            values['angles'] = _short(self._joints.values())
        for key, name in (('phases', f'{self.name}/phase'), ('cells', f'{self.name}/cells'),
                          ('forces', f'{self._space}/foot_contacts')):
            if (message := self._topics.newest(name)) is not None:
                dimensions = message.layout.dim
                if dimensions:
                    self._names_message(key, dimensions[0].label.split(',')
                                        if key != 'cells' else
                                        [f'{dimension.label}:{dimension.size}'
                                         for dimension in dimensions])
                values[key] = _short(message.data)
        if (moved := self._topics.newest(f'{self._space}/odom')) is not None:
            position, rotation = moved.pose.pose.position, moved.pose.pose.orientation
            speed = moved.twist.twist
            values['base'] = _short((position.x, position.y, position.z,
                                     rotation.w, rotation.x, rotation.y, rotation.z))
            values['speed'] = _short((speed.linear.x, speed.linear.y, speed.angular.z))
        if self.teleop.target != (0.0, 0.0):
            values['steered'] = _short(self.teleop.target)
        return values

    def _names_message(self, key: str, names: list[str]) -> None:
        """Send the pages the names of the numbers under a key, if they have changed."""
        if self._names.get(key) != names:
            self._names[key] = names
            self._keep({'type': 'names', **self._names})

    def news(self, statuses: Iterable[DiagnosticStatus]) -> None:
        """Send the pages the gait, changed parameters and, of new statuses, the health."""
        if (gait := self._topics.newest(f'{self.name}/gait')) is not None:
            self._keep({'type': 'gait', 'gait': gait.data})
        for event in self._topics.receive('/parameter_events'):
            # A node of the same name has started again.
            self._stale |= event.node == self.name and bool(event.new_parameters)
            if values := self.controls.update(event):
                self._send({'type': 'values', 'values': values})
        beside = (self.graph.beside(self.name, kind)
                  for kind in (self.graph.simulations, self.graph.bridges))
        owners = tuple(f'{name}: ' for name in (self.name, *beside) if name)
        if parts := {status.name: {
                'level': level(status), 'text': status.message,
                'values': {value.key: value.value for value in status.values}}
                for status in statuses if status.name.startswith(owners)}:
            self._keep({'type': 'health', 'parts': {
                **self._latest.get('health', {}).get('parts', {}), **parts}})

    # -- actions ----------------------------------------------------------------------------

    def simulation(self) -> str:
        """Return the node that simulates the robot.

        Raises:
            CallError: it is not simulated.

        """
        simulation = self.graph.beside(self.name, self.graph.simulations)
        if not simulation:
            raise CallError(f'there is no simulated robot for {self.name}')
        return simulation

    def push(self, force: float, direction: float) -> None:
        """Push the robot with a force, N, in a direction, degrees from the world's x to its y.

        Raises:
            CallError: it is not simulated.

        """
        simulation = self.simulation()
        if self._pushes is None:
            self._pushes = self._node.create_publisher(Wrench, f'{simulation}/push', 10)
        end = time.monotonic() + 1.0
        while not self._pushes.get_subscription_count() and time.monotonic() < end:
            time.sleep(0.01)
        message, angle = Wrench(), math.radians(direction)
        message.force.x, message.force.y = force * math.cos(angle), force * math.sin(angle)
        self._pushes.publish(message)

    def close(self) -> None:
        """End subscriptions, publishers and clients."""
        self.listen(self.graph, listening=False)
        self.teleop.close()
        if self._pushes is not None:
            self._node.destroy_publisher(self._pushes)
        self._services.forget(self.name)
        if self._readied is not None:
            self._readied.cancel()


def _short(values: Any) -> list[float | None]:
    """Return rounded values, None for those that are not finite."""
    return [round(value, DIGITS) if math.isfinite(value) else None for value in values]


#: Action of a page -> service of a bridge.
STOP_CALLS = {'sit': 'stop', 'damp': 'damp'}
#: A bridge publishes its status once a second; after this time without one it is stale, s.
STATUS_TIMEOUT = 3.0
#: Longest text of a bridge that is shown, characters.
MAX_TEXT_LENGTH = 200


class BridgeViews:
    """State, health, battery and temperature of each bridge.

    Attributes:
        message: for pages.

    """

    def __init__(self, watch: Node, services: ServiceClients) -> None:
        """View no bridge yet; ``watch`` is not spun."""
        self._services, self._states = services, Subscriptions(watch)
        self._shown: dict[str, dict[str, Any]] = {}
        self._when: dict[str, float] = {}
        self.message: dict[str, Any] = {'type': 'bridges', 'bridges': {}}

    def update(self, names: Iterable[str], listening: bool) -> None:
        """Subscribe to these bridges, or to none if no page is open."""
        names = set(names)
        for name in set(self._shown) - names:
            del self._shown[name], self._when[name]
            self._services.forget(name)
        for name in names - set(self._shown):
            self._shown[name] = {'state': '', 'level': '', 'text': '', 'battery': None,
                                 'hottest': None}
            self._when[name] = time.monotonic()
            # A client that the bridge does not know yet would delay a stop.
            for service in STOP_CALLS.values():
                self._services.client(Trigger, f'{name}/{service}')
        self._states.subscribe_to({f'{name}/state': (String, latched())
                             for name in (names if listening else ())})

    def news(self, statuses: Iterable[DiagnosticStatus]) -> dict[str, Any] | None:
        """Return the message for pages, None if new statuses and states do not change it."""
        now = time.monotonic()
        for name in self._shown:
            if (state := self._states.newest(f'{name}/state')) is not None:
                self._shown[name]['state'] = state.data[:MAX_TEXT_LENGTH]
        for status in statuses:
            if (name := status.name.partition(': ')[0]) in self._shown:
                self._when[name] = now
                self._shown[name].update(_read(status))
        for name, when in self._when.items():
            if now > when + STATUS_TIMEOUT:
                self._shown[name].update(level='stale', text=f'no status for {STATUS_TIMEOUT:g} s')
        message = {'type': 'bridges', 'bridges': {name: dict(self._shown[name])
                                                  for name in sorted(self._shown)}}
        if message == self.message:
            return None
        self.message = message
        return message


def _read(status: DiagnosticStatus) -> dict[str, Any]:
    """Return the part of a bridge's status that pages show."""
    values = {pair.key: value for pair in status.values
              if math.isfinite(value := _number(pair.value))}
    heat = [(value, key.removesuffix('[deg C]').strip()[:MAX_TEXT_LENGTH])
            for key, value in values.items() if key.endswith('[deg C]')]
    return {'level': level(status), 'text': status.message[:MAX_TEXT_LENGTH],
            'battery': values.get('battery [%]'), 'hottest': max(heat, default=None)}


def _number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        return math.nan
