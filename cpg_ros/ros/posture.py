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

"""The pose of a generator's body: parameters, topic ``body_pose``, ``~/sit`` and ``~/stand``."""

from collections.abc import Callable, Mapping, Sequence
import math
from typing import Any

from cpg_ros.common.errors import InputError
from cpg_ros.motion.body_pose import POSE_NAMES
from cpg_ros.motion.pattern import Pattern
from cpg_ros.motion.plan import GaitPlan
from cpg_ros.motion.rotations import rpy_of
from cpg_ros.ros.node.health import STEADY
from cpg_ros.ros.node.parameters import one_of, Spec
from cpg_ros.ros.node.polled import OVERRIDABLE
from geometry_msgs.msg import Pose
import numpy as np
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import QoSProfile
from std_srvs.srv import Trigger

PREFIX = 'body.'
#: END_POSES: poses in which a robot may be left at the end.
END_POSES = 'stand', 'sit'
SPECS = {
    f'{PREFIX}height': Spec(0.0, 'height of the body above its stand [m]; feet stay where they '
                            'are', -1.0, 1.0),
    **{f'{PREFIX}{name}': Spec(0.0, f'{name} of the body against its feet{sense} [rad]', -0.8, 0.8)
       for name, sense in (('roll', ''), ('pitch', ', positive with the nose down'), ('yaw', ''))},
    'end': Spec('stand', 'pose in which the robot is left when the node ends; sit needs up to 3 s '
                'more', constraints=one_of(END_POSES))}
#: CHECK_PERIOD: period in which the node looks whether the robot has stopped, or risen, s.
CHECK_PERIOD = 0.02
#: POSE_TOLERANCE: distance from its pose at which a body has sat down or risen, m.
POSE_TOLERANCE = 5e-3
#: SIT_DURATION: time in which it sits down at the end, s.
SIT_DURATION = 1.0
#: WARNING_PERIOD: time between two warnings of a kind, s.
WARNING_PERIOD = 5.0


class Posture:
    """Poses of a pattern's body while the robot is up, and sitting down.

    Attributes:
        seated: whether the robot sits, is about to, or rises.
        walks: whether it walks after it has risen.

    """

    def __init__(self, node: Node, pattern: Pattern, plan: Callable[[], GaitPlan],
                 walk: Callable[[bool], str], validate_stand: Callable[[], str]) -> None:
        """Create topic and services.

        Args:
            node: with the parameters SPECS.
            pattern: with the body.
            plan: returns the gait of the parameters.
            walk: ramps into the gait, or down to the stand.
            validate_stand: returns why the robot cannot sit or stand up now, or ''.

        Raises:
            InputError: the robot cannot take the pose in the parameters.

        """
        self._node, self._pattern, self._plan = node, pattern, plan
        self._walk, self._validate_stand, self._body = walk, validate_stand, pattern.body
        self.seated = self.walks = self._rises = False
        self._timer = node.create_timer(CHECK_PERIOD, self._go_on, clock=STEADY, autostart=False)
        self._pose = self._asked({})
        if reason := self.validate([], plan()):
            raise InputError(reason)
        if any(self._pose):
            self._aim(self._pose)
        node.create_subscription(Pose, 'body_pose', self._receive, QoSProfile(depth=1),
                                 qos_overriding_options=OVERRIDABLE)
        self._serve('sit', 'sitting down', self._sit)
        self._serve('stand', 'standing up: ~/enable walks', lambda: self.rise(False))

    def _asked(self, changes: Mapping[str, Any]) -> tuple[float, ...]:
        """Return the pose of the parameters after a batch of changes."""
        return tuple(changes.get(name, self._node.get_parameter(name).value)
                     for name in (f'{PREFIX}{number}' for number in POSE_NAMES))

    def validate(self, parameters: Sequence[Parameter], plan: GaitPlan) -> str:
        """Return why a batch of changes, or a plan, is rejected, or ''."""
        changes = {parameter.name: parameter.value for parameter in parameters}
        end = changes.get('end', self._node.get_parameter('end').value)
        if end == 'sit' and self._body.unavailable:
            return f'end: {self._body.unavailable}'
        changed = any(name.startswith(PREFIX) for name in changes)
        return self._reason(self._asked(changes) if changed else self._pose, plan)

    def _reason(self, pose: Sequence[float], plan: GaitPlan) -> str:
        """Return why the robot cannot stand in a pose, or walk in it by a plan, or ''."""
        try:
            if any(pose):
                self._body.angles(pose, plan)
        except InputError as error:
            return str(error)
        return ''

    def apply(self, parameters: Sequence[Parameter]) -> None:
        """Apply a batch that has been accepted and stored."""
        if any(parameter.name.startswith(PREFIX) for parameter in parameters):
            self._aim(self._asked({}))

    def _aim(self, pose: tuple[float, ...]) -> None:
        """Go to a pose, or keep it for when the robot has risen."""
        self._pose = pose
        if not (self.seated or self._body.unavailable):
            self._move(pose)

    def _move(self, pose: Sequence[float] | np.ndarray) -> None:
        self._body.go_to(pose, self._node.get_parameter('ramp').value)

    def _receive(self, message: Pose) -> None:
        """Accept a pose in champ's convention: z above the stand's height, and an orientation."""
        position, q = message.position, message.orientation
        numbers = np.array([q.w, q.x, q.y, q.z])
        length, log = float(np.linalg.norm(numbers)), self._node.get_logger()
        if not (math.isfinite(length + position.z) and abs(length - 1.0) < 0.01):
            log.warning(f'body_pose ignored: z {position.z} m, orientation {numbers[1:]} {q.w} is '
                        'not finite, or its length is not 1', throttle_duration_sec=WARNING_PERIOD)
            return
        if position.x or position.y:
            log.warning('body_pose: x and y are ignored, only z and the orientation count',
                        once=True)
        pose = tuple(np.round([position.z, *rpy_of(numbers)], 5).tolist())
        if pose == self._pose:
            return
        if reason := self._reason(pose, self._plan()):
            log.warning(f'body_pose ignored: {reason}', throttle_duration_sec=WARNING_PERIOD)
            return
        self._aim(pose)

    # -- sitting ---------------------------------------------------------------------------

    def _serve(self, name: str, text: str, act: Callable[[], None]) -> None:
        def answer(_: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
            reason = self._body.unavailable or self._validate_stand()
            response.success, response.message = not reason, reason or text
            if not reason:
                act()
            self._node.get_logger().info(response.message)
            return response

        self._node.create_service(Trigger, f'~/{name}', answer)

    def _sit(self) -> None:
        self._walk(False)
        self.seated, self._rises = True, False
        self._timer.reset()

    def rise(self, walks: bool) -> None:
        """Stand up from sitting, and then walk, if requested."""
        self.walks = walks
        if self.seated:
            self._rises = True
            self._move(self._pose)
            self._timer.reset()

    def _go_on(self) -> None:
        """Sit down once the robot stands, or walk once it is up."""
        if self._rises:
            if np.abs(self._body.now - self._pose).max() > POSE_TOLERANCE:
                return
            self.seated = self._rises = False
            if self.walks:
                self._walk(True)
        elif self._pattern.standing:
            self._move(self._body.seat)
        else:
            return
        self._timer.cancel()

    def end(self) -> bool:
        """Sit down for the last time; return whether the robot sits."""
        if not self.seated or self._rises:
            self.seated, self._rises = True, False
            self._body.go_to(self._body.seat, SIT_DURATION)
        return bool(np.abs(self._body.now - self._body.seat).max() < POSE_TOLERANCE)
