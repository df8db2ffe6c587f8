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

A dead man's switch: the robot walks only as long as the page sends commands.

The panel publishes on ``cmd_vel`` only while a page has the lease, and with a new publisher after
every take-over. Panels on one graph therefore treat one another like any other node that steers: a
publisher that has appeared since the take-over ends the steering until the holder confirms it.
"""

from collections.abc import Callable, Hashable
import math
from typing import Any

from cpg_ros.common.errors import CpgError
from cpg_ros.ros.node.health import node_of
from cpg_ros.ros.panel.pages import Page
from geometry_msgs.msg import Twist, TwistStamped
from rclpy.node import Node

# The lease to move a robot: at most one holder at a time, and anybody can take over.

#: LEASE_TIMEOUT: time without a command after which the holder loses the lease, s.
LEASE_TIMEOUT = 2.0


class LeaseError(CpgError):
    """Another page has control of the robot; one line for the sender of the command."""


class Lease:
    """A robot's lease.

    Attributes:
        holder: who may move the robot, None for nobody.
        confirmed: ids of the other publishers beside which the holder has chosen to steer.

    """

    def __init__(self) -> None:
        self._pass_to(None, 0.0)

    def acquire(self, who: Hashable, now: float) -> None:
        """Give the lease to ``who``, if it is free or already theirs; now is in s.

        Raises:
            LeaseError: another has it.

        """
        if self.holder is None:
            self._pass_to(who, now)
        elif self.holder != who:
            raise LeaseError(f'{self.holder} has control of the robot: take over first')
        self.renew(who, now)

    def take_over(self, who: Hashable, now: float,
                  others: frozenset[bytes] = frozenset()) -> Hashable | None:
        """Give the lease to ``who``, confirming ``others``; return a former holder, or None."""
        lost = None if self.holder == who else self.holder
        self._pass_to(who, now, others)
        return lost

    def renew(self, who: Hashable, now: float) -> None:
        """Record a sign of life of the holder."""
        if who == self.holder:
            self._last_command = now

    def release(self, who: Hashable) -> bool:
        """End the lease of ``who``; return whether they held it."""
        held = self.holder is not None and who == self.holder
        if held:
            self._pass_to(None, 0.0)
        return held

    def expire(self, now: float) -> Hashable | None:
        """End the lease of a holder that has been silent for too long; return it, or None."""
        holder = self.holder
        if holder is None or now - self._last_command <= LEASE_TIMEOUT:
            return None
        self._pass_to(None, now)
        return holder

    def _pass_to(self, who: Hashable | None, now: float,
                 others: frozenset[bytes] = frozenset()) -> None:
        self.holder, self._last_command, self.confirmed = who, now, others


#: COMMAND_TIMEOUT: largest age of a command when it is published, s; an older one counts as zero.
COMMAND_TIMEOUT = 0.3
#: NUM_STOPS: number of times that a stop is published, in case messages are lost.
NUM_STOPS = 5


class Teleop:
    """Lets one page at a time move a robot.

    Attributes:
        lease: of the robot.
        target: forward speed in m/s and yaw rate in rad/s, (0, 0) if nobody steers.
        others: id -> node, of other publishers on the topic.

    """

    def __init__(self, node: Node, topic: str, fastest: tuple[float, float],
                 stamped: Callable[[], bool]) -> None:
        """Publish nothing yet; ``topic`` is a full name.

        ``fastest`` is the speed in m/s and the yaw rate in rad/s at full deflection; ``stamped``
        returns whether the generator takes TwistStamped, not Twist.
        """
        self._node, self._topic, self._stamped = node, topic, stamped
        self._publisher: Any = None
        self._kind: Any = Twist
        # Ids of our publisher, and of those of nodes of this name that were there before it.
        self._own: set[bytes] = set()
        self._before: set[bytes] = set()
        self.lease = Lease()
        self._fastest = fastest
        self._until, self._stops = -math.inf, 0
        self.target = 0.0, 0.0
        self.others: dict[bytes, str] = {}

    # -- the lease --------------------------------------------------------------------------

    def acquire(self, page: Page, now: float) -> None:
        """Give a page the lease, if no other page has it.

        Raises:
            LeaseError: another page has it.

        """
        self.lease.acquire(page, now)
        page.lost_to = ''
        if self._publisher is None:
            self._open()

    def take_over(self, page: Page, now: float) -> Page | None:
        """Give a page the lease in any case; return the page that has lost it."""
        self.stop()
        self._send(now)
        self.update()
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
            self.stop()

    # -- steering ---------------------------------------------------------------------------

    def steer(self, page: Page, stamp: float, now: float, speed: float, turn: float) -> None:
        """Steer by fractions of full deflection; given after a stamp and received now, both in s.

        Raises:
            LeaseError: another page has the lease, or other nodes steer.

        """
        still = speed == 0.0 and turn == 0.0
        if still or now - stamp > COMMAND_TIMEOUT:
            # Letting go of the pad needs no lease, and gives none.
            if self.lease.holder is page:
                self.stop()
            return
        self.acquire(page, now)
        self.update()
        if not self.confirmed:
            self.stop()
            raise LeaseError(f'{self._topic} is also published by {", ".join(self.names)}: '
                             'take over to steer')
        self._until, self._stops = stamp + COMMAND_TIMEOUT, NUM_STOPS
        self.target = speed * self._fastest[0], turn * self._fastest[1]

    def stop(self) -> None:
        """Stop the robot, whichever page steers."""
        self._until = -math.inf

    def beat(self, now: float) -> None:
        """Publish the command for a time, s; stop a page that has been silent for too long."""
        self._send(now)
        if self.lease.expire(now) is not None:
            self.stop()
        if self.lease.holder is None and self._until == -math.inf and not self._stops:
            self.close()

    def _send(self, now: float) -> None:
        """Publish the target while it is fresh, then zeros, NUM_STOPS times."""
        if now > self._until:
            self.stop()
            self.target = 0.0, 0.0
            if not self._stops:
                return
            self._stops -= 1
        if self._publisher is not None:
            message = self._kind()
            twist = message if self._kind is Twist else message.twist
            twist.linear.x, twist.angular.z = self.target
            if self._kind is TwistStamped:
                # No time: the generator's may be simulated. The panel's limit is COMMAND_TIMEOUT.
                message.header.frame_id = 'base_link'
            self._publisher.publish(message)

    # -- the topic --------------------------------------------------------------------------

    @property
    def confirmed(self) -> bool:
        """Whether the holder has confirmed all other publishers."""
        return self.lease.confirmed.issuperset(self.others)

    @property
    def names(self) -> list[str]:
        """Names of the other nodes, sorted."""
        return sorted(set(self.others.values()))

    def update(self) -> None:
        """Find the other publishers."""
        if self._publisher is not None and not self._own:
            self._own = self._named() - self._before
        self.others = {
            gid: node_of(publisher)
            for publisher in self._node.get_publishers_info_by_topic(self._topic)
            if (gid := bytes(publisher.endpoint_gid)) not in self._own}

    def _open(self) -> None:
        self._before = self._named()
        self._kind = TwistStamped if self._stamped() else Twist
        self._publisher = self._node.create_publisher(self._kind, self._topic, 10)

    def _named(self) -> set[bytes]:
        """Return the ids of publishers of nodes with this name, which others may have, too."""
        return {bytes(publisher.endpoint_gid)
                for publisher in self._node.get_publishers_info_by_topic(self._topic)
                if (publisher.node_name, publisher.node_namespace) == (self._node.get_name(),
                                                                       self._node.get_namespace())}

    def close(self) -> None:
        """Destroy the publisher."""
        if self._publisher is not None:
            self._node.destroy_publisher(self._publisher)
            self._publisher, self._own = None, set()

    # -- the state for pages ----------------------------------------------------------------

    def state(self, page: Page) -> dict[str, Any]:
        """Return the state of the lease for a page."""
        holder = self.lease.holder
        return {'type': 'lease', 'page': str(page), 'holder': str(holder or ''),
                'yours': holder is page, 'lost_to': page.lost_to, 'stop_only': page.stop_only,
                'others': self.names, 'confirmed': self.confirmed, 'limit': COMMAND_TIMEOUT,
                'round_trip': round(page.round_trip, 1)
                if page.round_trip > COMMAND_TIMEOUT else None}
