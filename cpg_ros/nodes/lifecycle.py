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

"""ROS's life cycle beside a node that is no LifecycleNode: a step for each transition."""

from collections.abc import Callable, Mapping
from typing import Any

from lifecycle_msgs.srv import ChangeState
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.lifecycle import LifecycleNodeMixin, LifecycleState, TransitionCallbackReturn
from rclpy.node import Node


class Lifecycle(LifecycleNodeMixin):
    """The states and services of https://design.ros2.org/articles/node_lifecycle.html.

    rclpy decides at the creation of a node whether it is managed, before there are parameters:
    this takes of a node what the mixin needs, so that a parameter can decide it.
    """

    def __init__(self, node: Node, steps: Mapping[str, Callable[[], str]]) -> None:
        """Serve ``~/change_state`` and the others.

        Args:
            node: in whose name.
            steps: configure, activate, deactivate, cleanup and shutdown -> what does it, and
                returns why it cannot be done, or ''. The state stays as it was then.

        """
        self._logger, self._steps = node.get_logger(), steps
        self.handle = node.handle
        self.default_callback_group = node.default_callback_group
        self._services = node._services
        super().__init__()
        service: Any = self._service_change_state
        self._change, service.callback = service.callback, self._answered_change

    @property
    def active(self) -> bool:
        """Whether the state is active."""
        return self._state_machine.current_state[1] == 'active'

    def _answered_change(self, request: ChangeState.Request, response: ChangeState.Response
                         ) -> ChangeState.Response:
        """Change the state; refuse a transition that the state does not have.

        rclpy raises an exception for that one, and the client waits for ever.
        """
        try:
            return self._change(request, response)
        except rclpy_implementation.RCLError:
            wanted, state = request.transition, self._state_machine.current_state[1]
            self._logger.warning(f'{wanted.label or f"transition {wanted.id}"}: refused: the '
                                 f"state '{state}' does not have it")
            response.success = False
            return response

    def _step(self, name: str) -> TransitionCallbackReturn:
        if reason := self._steps[name]():
            self._logger.warning(f'{name}: refused: {reason}')
            return TransitionCallbackReturn.FAILURE
        self._logger.info(f'{name}: done')
        return TransitionCallbackReturn.SUCCESS

    def on_configure(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Do its step."""
        return self._step('configure')

    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Do its step."""
        return self._step('activate')

    def on_deactivate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Do its step."""
        return self._step('deactivate')

    def on_cleanup(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Do its step."""
        return self._step('cleanup')

    def on_shutdown(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Do its step."""
        return self._step('shutdown')
