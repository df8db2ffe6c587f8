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

"""The node ``cpg_inversion``, which records joint states and fits them on request.

One thread records and responds; a fit runs in another one.
"""

import asyncio
from functools import partial
import json
from pathlib import Path
import threading
import traceback

from cpg_ros.common.command_line import finite
from cpg_ros.common.errors import CpgError
from cpg_ros.common.files import write_atomically
from cpg_ros.fitting.inversion.parameter_files import running_parameters, write_fitted
from cpg_ros.fitting.inversion.recording_fit import fit_recording, RecordingFit
from cpg_ros.fitting.recordings.joint_streams import LiveRecording, Servo
from cpg_ros.motion.robot import Robot
from cpg_ros.motion.robot_file import load_robot
from cpg_ros.networks.registry import is_path
from cpg_ros.ros.node import node_base
from cpg_ros.ros.node.client import CallError, NodeClient, ServiceClients
from cpg_ros.ros.node.health import Health, HealthPublisher
from cpg_ros.ros.node.node_base import StartedNode, StartError
from cpg_ros.ros.node.parameters import Spec
from cpg_ros.ros.node.polled import best_effort, latched, OVERRIDABLE
from diagnostic_msgs.msg import DiagnosticStatus
from rcl_interfaces.msg import SetParametersResult
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.exceptions import NameValidationException
from rclpy.parameter import Parameter
from rclpy.task import Future
from rclpy.timer import Timer
from rclpy.validate_topic_name import validate_topic_name
from sensor_msgs.msg import JointState
from std_msgs.msg import String
from std_srvs.srv import Trigger

NAME = 'cpg_inversion'
#: RESPONSE_TIMEOUT: longest time for a generator to answer, s.
RESPONSE_TIMEOUT = 3.0

SPECS = {
    'topics': Spec(['joint_states'], 'topics of type sensor_msgs/JointState to listen to',
                   read_only=True),
    'robot': Spec('', 'robot file, or the name of a shipped one; if empty, legs are identified by '
                  'the names of the joints', read_only=True),
    'window': Spec(60.0, 'how much of the latest joint states to keep and fit [s]; 0 for all',
                   0.0, 3600.0),
    'every': Spec(0.0, 'interval between automatic fits [s]; 0 for none', 0.0, 3600.0),
    'network': Spec('', "network to fit; if empty, the robot's, or one for the number of legs",
                    constraints='a name, or at the start the path of a Python file'),
    'gait': Spec('', 'gait to fit; if empty, the recognised gait'),
    'preset': Spec('', 'shipped preset that supplies the parameters that are not free; if empty, '
                   "the gait's preset"),
    # Never without a value: rclpy would answer nothing for all parameters it is read with.
    'free': Spec([''], "parameters to fit; if empty, the network's default ones"),
    'order': Spec(3, 'order of the readout', 1, 3),
    'kp': Spec(0.0, 'proportional gain of the joint controllers [N m/rad], to fit the commands, '
               'position + (effort + kd velocity) / kp; 0 fits the measured positions', 0.0, 1e5),
    'kd': Spec(0.0, 'damping gain of the joint controllers [N m s/rad]', 0.0, 1e4),
    # Read-only: other nodes on the graph may start a fit, but not choose which files it writes.
    'out': Spec('', 'parameter file to write; empty for none', read_only=True),
    'report': Spec('', 'HTML report to write; empty for none', read_only=True),
    'apply_to': Spec('', 'generator whose parameters are set after a fit, such as /cpg_generator; '
                     "the joints' readouts, too, where both have the same 'robot'; empty for "
                     'none')}


class Inversion(StartedNode):
    """Records joint states; ~/fit writes parameters and files and sets up a running generator."""

    def __init__(self) -> None:
        super().__init__(NAME)
        self._declare(SPECS)
        name = self._value('robot')
        self._robot: Robot | None = load_robot(name) if name else None
        if not self.get_parameter_or('topics').value:
            raise StartError('parameter topics must not be empty')
        for topic in self._value('topics'):
            validate_topic_name(topic)
        topics = tuple(self.resolve_topic_name(topic) for topic in self._value('topics'))
        self._live = LiveRecording(topics, self._value('window'))
        for topic in topics:
            # The subscription may fall behind during a fit.
            self.create_subscription(
                JointState, topic, partial(self._receive, topic), best_effort(2000), raw=True,
                qos_overriding_options=OVERRIDABLE)
        self._result = self.create_publisher(String, '~/result', latched())
        # Another request is answered while one waits for its fit.
        self._group = ReentrantCallbackGroup()
        self.create_service(Trigger, '~/fit', self._fit, callback_group=self._group)
        self._timer: Timer | None = None
        self._busy, self._received, self._last = False, 0, (True, 'no fit yet')
        self._health = HealthPublisher(self, 'fit', name, self._report_health)
        self._often(self._value('every'))
        self._network = self._value('network')
        self.add_on_set_parameters_callback(self._allowed)
        self.add_post_set_parameters_callback(self._changed)
        self._warn_of_unknown()
        self.get_logger().info(f'listening to {", ".join(topics)}; call ~/fit')

    def _allowed(self, parameters: list[Parameter]) -> SetParametersResult:
        """Reject a Python file named over the graph: only the user may name one, at the start."""
        refused = any(parameter.name == 'network' and isinstance(parameter.value, str)
                      and is_path(parameter.value)
                      and parameter.value != self._network for parameter in parameters)
        return SetParametersResult(successful=not refused, reason=(
            'network: the path of a Python file can be given at the start only'
            if refused else ''))

    def _changed(self, parameters: list[Parameter]) -> None:
        for parameter in parameters:
            if parameter.name == 'window':
                self._live.window = parameter.value
            elif parameter.name == 'every':
                self._often(parameter.value)

    def _often(self, every: float) -> None:
        if self._timer is not None:
            self.destroy_timer(self._timer)
            self._timer = None
        if every > 0.0:
            self._timer = self.create_timer(every, self._again, callback_group=self._group)

    def _report_health(self) -> Health:
        """Return the status of the last second: WARN without joint states or after a failure."""
        received, self._received = self._received, 0
        well, text = self._last
        if not received:
            well, text = False, f'no joint states; {text}'
        return DiagnosticStatus.OK if well else DiagnosticStatus.WARN, text, {
            'joint states in the last second': received, 'fitting': self._busy}

    def _receive(self, topic: str, message: bytes) -> None:
        self._received += 1
        self._live.add(topic, self.get_clock().now().nanoseconds, message)

    async def _again(self) -> None:
        if not self._busy:
            await self._done()

    async def _fit(self, request: Trigger.Request, response: Trigger.Response
                   ) -> Trigger.Response:
        if self._busy:
            response.success, response.message = False, 'a fit is under way'
        else:
            response.success, response.message = await self._done()
        return response

    async def _done(self) -> tuple[bool, str]:
        """Fit in a thread; return success, and a summary or the reason."""
        self._busy = True
        try:
            live, work = self._live.copy(), Future(executor=self.executor)
            # The executor resumes coroutines only when something wakes it, and without further
            # joint states nothing else would: a callback does.
            work.add_done_callback(lambda _: None)
            self.thread = threading.Thread(target=self._work, args=(live, work), daemon=True)
            self.thread.start()
            well, message = self._last = await work
        finally:
            self._busy = False
        if well:
            self.get_logger().info(message)
        else:
            self.get_logger().warning(message)
        return well, message

    def _work(self, live: LiveRecording, work: Future) -> None:
        """Fit, write, publish and apply; store success and message."""
        try:
            free = tuple(name for name in self._value('free') if name)
            robot = self._robot
            names = () if robot is None else [joint.name for joint in robot.joints]
            kp, kd = self._value('kp'), self._value('kd')
            recording = live.recording(names, True, Servo(kp, kd) if kp else None)
            result = fit_recording(recording, robot, self._value('network'), self._value('gait'),
                                  free=free, order=self._value('order'),
                                  preset=self._value('preset'))
            message = '; '.join([_summary(result), *self._written(result)])
            self._result.publish(String(data=json.dumps(finite(result.as_dict()))))
            well, applied = self._applied(self._value('apply_to'), result)
            work.set_result((well, message + applied))
        except (CpgError, OSError) as error:
            work.set_result((False, str(error)))
        except Exception as error:
            # One fit must not end a node that listens.
            self.get_logger().error('a fit failed:\n' + traceback.format_exc())
            work.set_result((False, f'{type(error).__name__}: {error}'))

    def _written(self, result: RecordingFit) -> list[str]:
        written = []
        if self._value('out'):
            written += write_fitted(Path(self._value('out')).expanduser(), result, self._robot)
        if self._value('report'):
            # matplotlib takes half a second, and only pages need it.
            from cpg_ros.fitting.inversion.fit_report import as_html
            path = Path(self._value('report')).expanduser()
            write_atomically(path, as_html(result))
            written.append(path)
        return [f'written: {", ".join(map(str, written))}'] if written else []

    def _applied(self, target: str, result: RecordingFit) -> tuple[bool, str]:
        """Set the parameters of the target, if there is one; return success and a text."""
        if not target:
            return True, ''
        services = ServiceClients(self)
        try:
            whole = asyncio.run(self._set(NodeClient(services, target), result))
        except (CallError, NameValidationException) as error:
            return False, f'; not applied to {target}: {" ".join(str(error).split())}'
        finally:
            services.forget(target)
        if whole:
            return True, f"; applied to {target}: gait, frequency, network and joints' readouts"
        written = self._value('out')
        return True, (f'; applied to {target}: gait, frequency and network, not the readout, as '
                      "'robot' here is not its robot; to move as recorded, "
                      + (f'start it with --params-file {written}' if written else
                         "start this node with 'out', and it with the file written there"))

    async def _set(self, target: NodeClient, result: RecordingFit) -> bool:
        """Set a generator's parameters; return whether its robot can take the readouts."""
        robot = self._robot
        robot_name, = await target.values(['robot'])
        # The fit's cells are then those of its joints.
        whole = (robot is not None and robot_name == self._value('robot')
                 and robot.harmonics == result.fit.harmonics)
        await target.set_parameters(running_parameters(result, robot if whole else None),
                                    RESPONSE_TIMEOUT)
        return whole


def _summary(result: RecordingFit) -> str:
    fit = result.fit
    values = ', '.join(f'{name} {estimate.value:.4g} +- {estimate.stderr:.2g}'
                       for name, estimate in fit.parameters.items())
    named = result.stride.verdict if len(result.stride.candidates) > 1 else fit.gait
    return (f'{named} at {result.stride.frequency:.4f} Hz, {values}, mean RMS error '
            f'{100 * fit.mean_rms_share:.1f} % of range')


def run(args: list[str] | None = None) -> int:
    """Run the node until a signal ends it; return the exit code."""
    return node_base.run(Inversion, NAME, 'Fits the joint states that it receives.', SPECS, args,
                         'inversion')
