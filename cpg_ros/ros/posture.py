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

from collections.abc import Callable, Sequence
import math

from cpg_ros.common.errors import InputError
from cpg_ros.motion.body_pose import BodyPose, POSE
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
from rclpy.timer import Timer
from std_srvs.srv import Trigger

PREFIX = 'body.'
#: ENDS: poses in which a robot may be left at the end.
ENDS = 'stand', 'sit'
SPECS = {
    f'{PREFIX}height': Spec(0.0, 'height of the body above its stand [m]; feet stay where they '
                            'are', -1.0, 1.0),
    f'{PREFIX}roll': Spec(0.0, 'roll of the body against its feet [rad]', -0.8, 0.8),
    f'{PREFIX}pitch': Spec(0.0, 'pitch of the body against its feet, positive with the nose down '
                           '[rad]', -0.8, 0.8),
    f'{PREFIX}yaw': Spec(0.0, 'yaw of the body against its feet [rad]', -0.8, 0.8),
    'end': Spec('stand', 'pose in which the robot is left when the node ends; sit needs up to 3 s '
                'more', constraints=one_of(ENDS))}
#: LOOK: period in which the node looks whether the robot has stopped, or risen, s.
LOOK = 0.02
#: NEAR: distance from its pose at which a body has sat down or risen, m.
NEAR = 5e-3
#: LAST: time in which it sits down at the end, s.
LAST = 1.0
#: QUIET: time between two warnings of a kind, s.
QUIET = 5.0


class Posture:
    """Poses of a pattern's body while the robot is up, and sitting down.

    Attributes:
        seated: whether the robot sits, is about to, or rises.
        walks: whether it walks after it has risen.

    """

    def __init__(self, node: Node, pattern: Pattern, plan: Callable[[], GaitPlan],
                 walk: Callable[[bool], str], refusal: Callable[[], str]) -> None:
        """Create topic and services.

        Args:
            node: with the parameters SPECS.
            pattern: with the body.
            plan: returns the gait of the parameters.
            walk: ramps into the gait, or down to the stand.
            refusal: returns why the robot cannot sit or stand up now, or ''.

        Raises:
            InputError: the robot cannot take the pose in the parameters.

        """
        self._node, self._pattern, self._plan = node, pattern, plan
        self._walk, self._refusal = walk, refusal
        self.seated = self.walks = self._rises = False
        self._timer: Timer | None = None
        self._pose = self._asked([])
        if reason := self.judge([], plan()):
            raise InputError(reason)
        if any(self._pose):
            self._move(self._pose)
        node.create_subscription(Pose, 'body_pose', self._take, QoSProfile(depth=1),
                                 qos_overriding_options=OVERRIDABLE)
        node.create_service(Trigger, '~/sit', self._sit)
        node.create_service(Trigger, '~/stand', self._stand)

    @property
    def obstacle(self) -> str:
        """Why the body cannot be moved, or ''."""
        if self._pattern.body is None:
            try:
                BodyPose(self._pattern.robot)
            except InputError as error:
                return str(error)
        return ''

    @property
    def _body(self) -> BodyPose:
        assert self._pattern.body is not None
        return self._pattern.body

    def _asked(self, parameters: Sequence[Parameter]) -> tuple[float, ...]:
        """Return the pose of the parameters after a batch of changes."""
        values = {f'{PREFIX}{name}': self._node.get_parameter(f'{PREFIX}{name}').value
                  for name in POSE}
        values |= {p.name: p.value for p in parameters if p.name in values}
        return tuple(values.values())

    def judge(self, parameters: Sequence[Parameter], plan: GaitPlan) -> str:
        """Return why a batch of changes, or a plan, is rejected, or ''."""
        end = {'end': self._node.get_parameter('end').value, **{p.name: p.value
                                                                for p in parameters}}['end']
        if end == 'sit' and (obstacle := self.obstacle):
            return f'end: {obstacle}'
        changed = any(parameter.name.startswith(PREFIX) for parameter in parameters)
        return self._reason(self._asked(parameters) if changed else self._pose, plan)

    def _reason(self, pose: Sequence[float], plan: GaitPlan) -> str:
        """Return why the robot cannot stand in a pose, or walk in it by a plan, or ''."""
        if not any(pose):
            return ''
        if obstacle := self.obstacle:
            return f'{PREFIX}*: {obstacle}'
        try:
            self._body.check(pose, plan)
        except InputError as error:
            return str(error)
        return ''

    def apply(self, parameters: Sequence[Parameter]) -> None:
        """Apply a batch that has been accepted and stored."""
        if any(parameter.name.startswith(PREFIX) for parameter in parameters):
            self._pose = self._asked([])
            if not self.seated and not self.obstacle:
                self._move(self._pose)

    def _move(self, pose: Sequence[float] | np.ndarray) -> None:
        self._body.go_to(pose, self._node.get_parameter('ramp').value)

    def _take(self, message: Pose) -> None:
        """Accept a pose in champ's convention: z above the stand's height, and an orientation."""
        place, q = message.position, message.orientation
        numbers = np.array([q.w, q.x, q.y, q.z])
        length, log = float(np.linalg.norm(numbers)), self._node.get_logger()
        if not (math.isfinite(length + place.z) and abs(length - 1.0) < 0.01):
            log.warning(f'body_pose ignored: z {place.z} m, orientation {numbers[1:]} {q.w} is '
                        'not finite or has not the length 1', throttle_duration_sec=QUIET)
            return
        if place.x or place.y:
            log.warning('body_pose asks for a way forward or to the left: x and y are ignored',
                        once=True)
        pose = tuple(np.round([place.z, *rpy_of(numbers)], 5).tolist())
        if pose == self._pose:
            return
        if reason := self._reason(pose, self._plan()):
            log.warning(f'body_pose ignored: {reason}', throttle_duration_sec=QUIET)
            return
        self._pose = pose
        if not self.seated and not self.obstacle:
            self._move(pose)

    # -- sitting ---------------------------------------------------------------------------

    def _answer(self, response: Trigger.Response, text: str) -> Trigger.Response:
        response.message = self.obstacle or self._refusal()
        response.success = not response.message
        if response.success:
            response.message = text
            self._timer = self._timer or self._node.create_timer(LOOK, self._go_on, clock=STEADY)
        self._node.get_logger().info(response.message)
        return response

    def _sit(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        if self._answer(response, 'sitting down').success:
            self._walk(False)
            self.seated, self._rises = True, False
        return response

    def _stand(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        if self._answer(response, 'standing up: ~/enable walks').success:
            self.rise(False)
        return response

    def rise(self, walks: bool) -> None:
        """Stand up from sitting, and then walk, if requested."""
        self.walks = walks
        if self.seated:
            self._rises = True
            self._move(self._pose)
            self._timer = self._timer or self._node.create_timer(LOOK, self._go_on, clock=STEADY)

    def _go_on(self) -> None:
        """Sit down once the robot stands, or walk once it is up."""
        if self.seated and self._rises:
            if np.abs(self._body.now - self._pose).max() > NEAR:
                return
            self.seated = self._rises = False
            if self.walks:
                self._walk(True)
        elif self.seated:
            if not self._pattern.standing:
                return
            self._move(self._body.seat)
        if self._timer is not None:
            self._timer.destroy()
            self._timer = None

    def end(self) -> bool:
        """Sit down for the last time; return whether the robot sits."""
        if not self.seated or self._rises:
            self.seated, self._rises = True, False
            self._body.go_to(self._body.seat, LAST)
        return bool(np.abs(self._body.now - self._body.seat).max() < NEAR)
