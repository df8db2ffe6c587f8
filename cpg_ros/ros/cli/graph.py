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

"""Topics of a graph: list, messages, rates; record and play bags, play schedules."""

from array import array
import asyncio
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
import signal
import sys
import time
from typing import Any

from cpg_ros.common.command_line import note, progress_bar, say
from cpg_ros.common.errors import CpgError, InputError
from cpg_ros.fitting.inversion.gait_schedule import Entry, GaitSchedule, read_schedule
from cpg_ros.fitting.recordings.bag_storage import opened
from cpg_ros.fitting.recordings.recording import RecordingError
from cpg_ros.ros.bag_recorder import BagRecorder, POLL_PERIOD
from cpg_ros.ros.node.client import NodeClient, NOTICE_DELAY
from cpg_ros.ros.node.message_block import message_class
from cpg_ros.ros.node.polled import best_effort, latched, PolledSubscription
import numpy as np
import rclpy
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import DurabilityPolicy, QoSProfile
from rosbags.interfaces import Connection, QosDurability
import yaml

# Publishing the messages of a bag, as ``ros2 bag play`` does.

#: How long a player waits for listeners, s.
SUBSCRIBER_TIMEOUT = 1.0


def play(node: Node, path: Path, topics: Sequence[str] = (), rate: float = 1.0) -> Counter[str]:
    """Publish a bag's messages with their timing, ``rate`` times as fast.

    Without topics, play all. Return the number of messages of each topic.

    Raises:
        RecordingError: the bag cannot be read, or a topic is not in it.

    """
    counts: Counter[str] = Counter()
    with opened(path) as bag:
        recorded = {connection.topic: connection for connection in bag.connections}
        names = [node.resolve_topic_name(name) for name in topics] or list(recorded)
        for topic in names:
            if topic not in recorded:
                raise RecordingError(f'{path}: no topic {topic!r}; there are '
                                     f'{", ".join(recorded)}')
        publishers = {topic: _publisher(node, recorded[topic]) for topic in names}
        _wait_for_listeners(node, list(publishers.values()))
        expected = bag.expected()
        with progress_bar(f'playing {path.name}', max(1, sum(expected[name] for name in names))
                          ) as bar:
            start, began = None, time.monotonic()
            for done, (topic, received, message) in enumerate(bag.messages(names)):
                start = received if start is None else start
                due = began + (received - start) * 1e-9 / rate
                while (wait := due - time.monotonic()) > 0.0:
                    rclpy.spin_once(node, timeout_sec=min(wait, 0.05))
                publishers[topic].publish(message)
                counts[topic] += 1
                bar(done + 1)
    return counts


def _wait_for_listeners(node: Node, publishers: Sequence[Publisher]) -> None:
    """Wait briefly for subscribers, so that they receive the first messages."""
    end = time.monotonic() + SUBSCRIBER_TIMEOUT
    while time.monotonic() < end and not all(
            publisher.get_subscription_count() for publisher in publishers):
        rclpy.spin_once(node, timeout_sec=0.02)


def _publisher(node: Node, connection: Connection) -> Publisher:
    offered = getattr(connection.ext, 'offered_qos_profiles', ())
    latched = any(profile.durability == QosDurability.TRANSIENT_LOCAL for profile in offered)
    return node.create_publisher(message_class(connection.msgtype), connection.topic, QoSProfile(
        depth=1 if latched else 100, durability=DurabilityPolicy.TRANSIENT_LOCAL if latched
        else DurabilityPolicy.VOLATILE))


# Recording the topics of a graph into a bag, as ``ros2 bag record`` does.

#: How often the graph is searched for new topics, s.
SEARCH_PERIOD = 0.5
#: COMMON_TOPICS: topics of every node, which are not recorded unless they are named.
COMMON_TOPICS = ('/rosout', '/parameter_events')


def record(node: Node, path: Path, topics: Sequence[str]) -> BagRecorder:
    """Record topics until SIGINT or SIGTERM; by default all that exist or appear.

    A second signal does not interrupt the writing of the bag.

    Raises:
        BagError: the name is taken, or the folder cannot be written to.

    """
    recorder, searched = BagRecorder(node, path), 0.0
    names = [node.resolve_topic_name(name) for name in topics]
    signals: list[int] = []
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda number, frame: signals.append(number))
    try:
        while not signals:
            if time.monotonic() > searched + SEARCH_PERIOD:
                searched = time.monotonic()
                for topic in _subscribed(node, recorder, names):
                    print(f'recording {topic}', file=sys.stderr, flush=True)
            recorder.poll()
            time.sleep(POLL_PERIOD)
    finally:
        recorder.close()
    return recorder


def _subscribed(node: Node, recorder: BagRecorder, topics: Sequence[str]) -> list[str]:
    """Record topics that are new on the graph; return them."""
    return [topic for topic, kinds in node.get_topic_names_and_types()
            if topic not in recorder.counts and topic not in recorder.passed_over
            and (topic in topics if topics else topic not in COMMON_TOPICS)
            and node.count_publishers(topic) and recorder.subscribe(topic, kinds[0])]


# Schedules: parameters of a running generator, set at given times.

#: RESPONSE_TIMEOUT: longest time for a setting, s, as a network may have to be compiled.
RESPONSE_TIMEOUT = 60.0


async def play_schedule(path: Path, other: NodeClient, rate: float) -> str:
    """Set a generator's parameters at the times of a schedule, ``rate`` times as fast.

    Return a summary.

    Raises:
        ScheduleError: the file cannot be used.
        InputError: the generator does not run the schedule's network.
        CallError: the generator does not answer, or refuses a value.

    """
    schedule = read_schedule(path)
    await _check(schedule, other, path)
    began = time.monotonic()
    for entry in schedule.entries:
        # Nothing else happens on this loop.
        await asyncio.sleep(max(began + entry.at / rate - time.monotonic(), 0.0))
        await other.set_parameters(entry.parameters, RESPONSE_TIMEOUT)
        say(f'{entry.at:8.2f} s  {_words(entry)}')
    return f'{other.name} goes on with the last entry'


async def _check(schedule: GaitSchedule, other: NodeClient, path: Path) -> None:
    network, robot = await other.values(['network', 'robot'])
    start = (f'generator --ros-args -p network:={schedule.network} -p robot:={schedule.robot}')
    if network != schedule.network:
        raise InputError(f'{path}: is for the network {schedule.network}, and {other.name} runs '
                         f'{network}; start it with: {start}')
    if robot != schedule.robot:
        note('cpg', f'{other.name} moves the robot {robot}, so joints will not move as recorded; '
             f'they would with: {start}')


def _words(entry: Entry) -> str:
    return ', '.join(f'{name} {value:.4g}' if isinstance(value, float) else f'{name} {value}'
                     for name, value in entry.parameters.items())


#: DISCOVERY_TIME: time without a new topic after which topics are listed, s.
DISCOVERY_TIME = 1.0
#: COUNT_DURATION: time for which messages are counted, s; QUEUE_DEPTH: most messages that wait
#: until they are taken.
COUNT_DURATION, QUEUE_DEPTH = 3.0, 1000


class SilentTopic(CpgError):
    """A topic has no publisher, or no message arrived."""

    exit_code = 1


def topics(node: Node) -> dict[str, str]:
    """Return the topics that have publishers or subscribers, and their types, sorted.

    They are found one after another, slowly on a loaded machine: it waits until none has come for
    ``DISCOVERY_TIME``.
    """
    names: list[tuple[str, list[str]]] = []
    changed = time.monotonic()
    while (now := time.monotonic()) < changed + DISCOVERY_TIME:
        if (new := node.get_topic_names_and_types()) != names:
            names, changed = new, now
        time.sleep(0.02)
    return {name: ' '.join(kinds) for name, kinds in sorted(names)}


class Topic:
    """A subscribed topic."""

    def __init__(self, node: Node, name: str, wait: float,
                 late: Callable[[str], None] = lambda name: None) -> None:
        """Find a topic's type and subscribe; relative names are in the namespace /.

        It waits up to ``wait`` s each for a publisher and the first message; ``late`` is called
        once with the topic's name if neither has come within ``NOTICE_DELAY``.

        Raises:
            SilentTopic: it has no publisher.

        """
        began = time.monotonic()
        self._end, self._silence = began + wait, began + NOTICE_DELAY
        self._late = late
        self._name = topic = node.resolve_topic_name(name)
        while not (publishers := node.get_publishers_info_by_topic(topic)):
            if time.monotonic() > self._end:
                raise SilentTopic(f'nobody publishes on {topic}')
            self._pause()
        # What was published before is kept for those that ask as its publisher offers it.
        durabilities = {publisher.qos_profile.durability for publisher in publishers}
        quality = latched if durabilities == {DurabilityPolicy.TRANSIENT_LOCAL} else best_effort
        self._subscription = PolledSubscription(
            node, message_class(publishers[0].topic_type), name, quality(QUEUE_DEPTH),
            overridable=False)

    def messages(self) -> Iterator[Any]:
        """Yield messages as they arrive.

        Raises:
            SilentTopic: none arrives.

        """
        silent = True
        while True:
            for message, _ in self._subscription.receive():
                silent = False
                yield message
            if silent and time.monotonic() > self._end:
                raise SilentTopic(f'nothing came on {self._name}')
            if silent:
                self._pause()
            else:
                time.sleep(POLL_PERIOD)

    def _pause(self) -> None:
        if time.monotonic() > self._silence:
            self._late(self._name)
            self._silence = np.inf
        time.sleep(POLL_PERIOD)

    def rate(self) -> float:
        """Count messages for a while; return their rate, Hz."""
        count, end = 0, time.monotonic() + COUNT_DURATION
        while time.monotonic() < end:
            time.sleep(POLL_PERIOD)
            count += sum(1 for _ in self._subscription.receive())
        return count / COUNT_DURATION


def as_yaml(message: Any) -> str:
    """Return a message as YAML, as ``ros2 topic echo`` prints it, with a line break at its end."""
    dumper = getattr(yaml, 'CSafeDumper', yaml.SafeDumper)
    return str(yaml.dump(_plain(message), Dumper=dumper, sort_keys=False, allow_unicode=True,
                         default_flow_style=False, width=2**31 - 1))


def _plain(value: Any) -> Any:
    """Return a message or a field of one as YAML has it."""
    if hasattr(value, 'get_fields_and_field_types'):
        return {field: _plain(getattr(value, field))
                for field in value.get_fields_and_field_types()}
    if isinstance(value, (np.ndarray, array)):
        return value.tolist()
    if isinstance(value, bytes):  # one octet; those of a list are integers, too
        return value[0]
    return [_plain(item) for item in value] if isinstance(value, (list, tuple)) else value
