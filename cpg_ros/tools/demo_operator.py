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

"""The demonstration's node: it sets the gait of the generator, and follows the robot."""

import asyncio

from cpg_ros.errors import CpgError
from cpg_ros.nodes.node_client import CallError, NodeClient, RequestRefused, ServiceClients
from cpg_ros.nodes.qos_profiles import latched
from geometry_msgs.msg import Pose, Quaternion
from nav_msgs.msg import Odometry
from rclpy.node import Node
from std_msgs.msg import String


class DemoError(CpgError):
    """The demonstration cannot continue; the message is one line for the user."""

    exit_code = 1


class Operator(Node):
    """Sets the gait of the generator, and follows the robot.

    Attributes:
        pose: of the robot's base; None until it is known.
        time: of the robot's simulation, s.
        taken_over: whether somebody else has set another gait.

    """

    def __init__(self, gait: str) -> None:
        super().__init__('cpg_demo')
        self.pose: Pose | None = None
        self.time = 0.0
        self._generator = NodeClient(ServiceClients(self), 'cpg_generator')
        self._wanted, self.taken_over, self._heard = gait, False, False
        self.create_subscription(Odometry, 'odom', self._odom, 1)
        # Latched, as it is published: a gait chosen before discovery counts, too.
        self.create_subscription(String, 'cpg_generator/gait', self._gait, latched(10))

    def _odom(self, message: Odometry) -> None:
        self.pose = message.pose.pose
        self.time = message.header.stamp.sec + 1e-9 * message.header.stamp.nanosec

    def _gait(self, message: String) -> None:
        # Whoever chooses a gait on the page, or by a parameter, ends the tour.
        self._heard = True
        self.taken_over |= message.data != self._wanted

    def check_alone(self) -> None:
        """See that these are the only robot and the only generator.

        Raises:
            DemoError: there is another one, perhaps from before ours.

        """
        for topic, who in (('cpg_generator/phase', 'generator'), ('odom', 'robot')):
            if self.count_publishers(topic) > 1:
                raise DemoError(f'there is another {who} in this ROS domain: stop it, or set '
                                'another ROS_DOMAIN_ID')

    def switch(self, gait: str) -> str:
        """Set the gait; return why the generator refused it, or ''.

        Raises:
            DemoError: the generator does not answer.

        """
        self._wanted = gait
        try:
            asyncio.run(self._generator.set_parameters({'gait': gait}, 10.0))
        except RequestRefused as error:
            return str(error)
        except CallError as error:
            raise DemoError('the generator does not answer') from error
        return ''

    @property
    def ready(self) -> bool:
        """Whether the body moves, as it does once it is commanded, and the generator is heard."""
        return self.pose is not None and self._heard

    @property
    def place(self) -> tuple[float, float]:
        """Where the robot is, x and y in m; the origin until that is known."""
        return (0.0, 0.0) if self.pose is None else (self.pose.position.x, self.pose.position.y)

    @property
    def upright(self) -> float:
        """Cosine of the angle by which the base leans."""
        turn = Quaternion() if self.pose is None else self.pose.orientation
        return float(1.0 - 2.0 * (turn.x**2 + turn.y**2))
