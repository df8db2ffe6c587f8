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

"""The bridges to robots on the graph, as every page shows them."""

from collections.abc import Iterable
import math
import time
from typing import Any

from cpg_ros.ros.node.client import level, ServiceClients
from cpg_ros.ros.node.polled import best_effort, latched, PolledSubscription
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rclpy.node import Node
from std_msgs.msg import String
from std_srvs.srv import Trigger

#: Action of a page -> service of a bridge.
STOPS = {'sit': 'stop', 'damp': 'damp'}
#: A bridge publishes its status once a second; after this time without one it is stale, s.
STALE = 3.0
#: Longest text of a bridge that is shown, characters.
LONGEST = 200


class BridgeViews:
    """State, health, battery and temperature of each bridge.

    Attributes:
        message: for pages.

    """

    def __init__(self, watch: Node, services: ServiceClients) -> None:
        """View no bridge yet.

        Args:
            watch: that subscribes, and is not spun.
            services: clients of other nodes.

        """
        self._watch, self._services = watch, services
        self._health: PolledSubscription | None = None
        self._states: dict[str, PolledSubscription] = {}
        self._shown: dict[str, dict[str, Any]] = {}
        self._when: dict[str, float] = {}
        self.message: dict[str, Any] = {}
        self._update()

    def update(self, names: Iterable[str], wanted: bool) -> None:
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
            for service in STOPS.values():
                self._services.client(Trigger, f'{name}/{service}')
        followed = names if wanted else set()
        for name in set(self._states) - followed:
            self._states.pop(name).close()
        for name in followed - set(self._states):
            self._states[name] = PolledSubscription(self._watch, String, f'{name}/state',
                                                    latched(), overridable=False)
        if followed and self._health is None:
            self._health = PolledSubscription(self._watch, DiagnosticArray, '/diagnostics',
                                              best_effort(20), overridable=False)
        elif not followed and self._health is not None:
            self._health.close()
            self._health = None

    def news(self) -> dict[str, Any] | None:
        """Return the message for pages if it has changed, otherwise None."""
        for name, topic in self._states.items():
            if (state := topic.newest()) is not None:
                self._shown[name]['state'] = state.data[:LONGEST]
        now = time.monotonic()
        for message, _ in self._health.receive() if self._health is not None else ():
            for status in message.status:
                if (name := status.name.partition(': ')[0]) in self._shown:
                    self._when[name] = now
                    self._shown[name].update(_read(status))
        for name, when in self._when.items():
            if now > when + STALE:
                self._shown[name].update(level='stale', text=f'no status for {STALE:g} s')
        return self._update()

    def _update(self) -> dict[str, Any] | None:
        message = {'type': 'bridges', 'bridges': {name: dict(self._shown[name])
                                                  for name in sorted(self._shown)}}
        if message == self.message:
            return None
        self.message = message
        return message


def _read(status: DiagnosticStatus) -> dict[str, Any]:
    """Return what pages show of a bridge's status."""
    found: dict[str, Any] = {'level': level(status),
                             'text': status.message[:LONGEST], 'battery': None, 'hottest': None}
    heat: list[tuple[float, str]] = []
    for pair in status.values:
        try:
            value = float(pair.value)
        except ValueError:
            continue
        if not math.isfinite(value):
            continue
        if pair.key == 'battery [%]':
            found['battery'] = value
        elif pair.key.endswith('[deg C]'):
            heat.append((value, pair.key.removesuffix('[deg C]').strip()[:LONGEST]))
    if heat:
        found['hottest'] = max(heat)
    return found
