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

"""One robot's lease, and the ``cmd_vel`` of the page that has it.

The panel publishes on ``cmd_vel`` only while a page has the lease, and with a new publisher after
every take-over. So panels on one graph see one another as they see any other node that steers: a
publisher that has appeared since the holder took over ends his steering until he confirms it.
"""

from typing import Any

from cpg_ros.nodes.other_publishers import node_of
from cpg_ros.panel.lease import Lease, LeaseError
from cpg_ros.panel.pages import Page
from cpg_ros.panel.steering import HOLD, SteeringPublisher
from geometry_msgs.msg import Twist
from rclpy.node import Node


class Teleop:
    """Lets one page at a time move a robot.

    Attributes:
        lease: of the robot.
        steering: what is published.
        others: id -> node, of publishers on the topic that are not this one.

    """

    def __init__(self, node: Node, topic: str, fastest: tuple[float, float]) -> None:
        """Publish on a topic; a whole deflection is this speed in m/s and turn in rad/s."""
        self._node, self._topic = node, topic
        self._publisher: Any = None
        # Ids of our publisher, and of those of nodes of this name that were there before it.
        self._own: set[bytes] = set()
        self._before: set[bytes] = set()
        self.lease = Lease()
        self.steering = SteeringPublisher(self._publish, fastest)
        self.others: dict[bytes, str] = {}

    # -- the lease --------------------------------------------------------------------------

    def acquire(self, page: Page, now: float) -> None:
        """Let a page move the robot, if no other has the lease.

        Raises:
            LeaseError: another page has it.

        """
        self.lease.acquire(page, now)
        page.lost_to = ''
        if self._publisher is None:
            self._open()

    def take_over(self, page: Page, now: float) -> Page | None:
        """Let a page move the robot, whoever did; return the page that has lost it."""
        self.steering.stop()
        self.steering.beat(now)
        self.look()
        lost: Any = self.lease.take_over(page, now, frozenset(self.others))
        page.lost_to = ''
        if lost is not None:
            lost.lost_to = str(page)
        # Other panels see a publisher that is new.
        self.close()
        self._open()
        return lost

    def release(self, page: Page) -> None:
        """Take the lease from a page that has it."""
        if self.lease.release(page):
            self.steering.stop()

    # -- steering ---------------------------------------------------------------------------

    def steer(self, page: Page, stamp: float, now: float, speed: float, turn: float) -> None:
        """Steer with a command that was given after a stamp and has come now, both in s.

        Raises:
            LeaseError: another page has the lease, or other nodes steer.

        """
        still = speed == 0.0 and turn == 0.0
        if still or now - stamp > HOLD:
            # To let go takes no lease, and gives none.
            if self.lease.holder is page:
                self.steering.stop()
            return
        self.acquire(page, now)
        self.look()
        if not self.confirmed:
            self.steering.stop()
            raise LeaseError(f'{self._topic} is also published by {self.names}: take over to '
                             'steer')
        self.steering.hold(stamp, speed, turn)

    def beat(self, now: float) -> None:
        """Publish what is to be published at a time, s."""
        self.steering.beat(now)
        if self.lease.expire(now) is not None:
            self.steering.stop()
        if self._publisher is not None and self.lease.holder is None and self.steering.idle:
            self.close()

    # -- the topic --------------------------------------------------------------------------

    @property
    def confirmed(self) -> bool:
        """Tell whether the holder has chosen to steer beside all others that publish."""
        return self.lease.confirmed.issuperset(self.others)

    @property
    def names(self) -> str:
        """Which nodes the others are."""
        return ', '.join(sorted(set(self.others.values())))

    def look(self) -> None:
        """See who else publishes."""
        if self._publisher is not None and not self._own:
            self._own = self._named() - self._before
        self.others = {
            gid: node_of(one) for one in self._node.get_publishers_info_by_topic(self._topic)
            if (gid := bytes(one.endpoint_gid)) not in self._own}

    def _open(self) -> None:
        self._before = self._named()
        self._publisher = self._node.create_publisher(Twist, self._topic, 10)

    def _named(self) -> set[bytes]:
        """Return the ids of publishers of nodes of this one's name: others may have it, too."""
        return {bytes(one.endpoint_gid)
                for one in self._node.get_publishers_info_by_topic(self._topic)
                if (one.node_name, one.node_namespace) == (self._node.get_name(),
                                                           self._node.get_namespace())}

    def close(self) -> None:
        """Publish no more."""
        if self._publisher is not None:
            self._node.destroy_publisher(self._publisher)
            self._publisher, self._own = None, set()

    def _publish(self, message: Twist) -> None:
        if self._publisher is not None:
            self._publisher.publish(message)

    # -- what pages are shown ---------------------------------------------------------------

    def state(self, page: Page) -> dict[str, Any]:
        """Return what a page is to know of the lease."""
        holder = self.lease.holder
        return {'type': 'lease', 'page': str(page), 'holder': str(holder or ''),
                'yours': holder is page, 'lost_to': page.lost_to, 'stop_only': page.stop_only,
                'others': sorted(set(self.others.values())),
                'confirmed': self.confirmed, 'limit': HOLD,
                'round_trip': round(page.round_trip, 1)
                if page.round_trip > HOLD else None}
