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

"""Joint states out of rosbag2 bags: sqlite3 and mcap, compressed or not, without ROS.

The library `rosbags` reads the storage; positions come from the messages' bytes in bulk (see
`cdr`), so that of a long bag only the angles are ever in memory.
"""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from cpg_ros.files.plain_text import printable
from cpg_ros.files.progress_bar import progress_bar
from cpg_ros.recordings.bag_storage import Bag, files_of_bag, opened, STORAGES
from cpg_ros.recordings.joint_streams import BATCH, recorded, Stream
from cpg_ros.recordings.load_stream import LoadStream, NAME, TYPE
from cpg_ros.recordings.recording import Recording, RecordingError
from cpg_ros.recordings.recording_format import JOINTS, Option, RecordingFormat
from cpg_ros.recordings.servo import Servo


def read_bag(path: str | Path, topics: Sequence[str] = (), joints: Sequence[str] = (),
             progress: bool = True, some: bool = False, servo: Servo | None = None
             ) -> Recording:
    """Read the joint states of a bag.

    See `recorded` for joints that are on several topics, and for stamps. Loads on the feet are
    read if one topic of the bag has them (see `LoadStream`).

    A recorder that died leaves mcap files without an end and no metadata.yaml. The complete part
    of such files is read, and a note reports it. A truncated sqlite3 file is an error.

    Args:
        path: the bag's folder, or one of its storage files (.mcap, .db3).
        topics: which to read; all topics of type sensor_msgs/msg/JointState, if empty.
        joints: which joints to take, in this order; all of them, if empty.
        progress: show a progress bar.
        some: joints that are not there are passed over, unless none is.
        servo: of the joints, if the angles that they were driven to are wanted.

    Raises:
        RecordingError: see `recorded`; a bag that cannot be read, a topic that is not there or of
            another type.

    """
    path = Path(path)
    source = printable(f'{path}, ')
    with opened(path) as bag:
        streams = {topic: Stream(topic, joints, servo, source)
                   for topic in bag.choose(topics)}
        loads = _load_stream(bag)
        expected = bag.expected()
        total = max(1, sum(expected[topic] for topic in streams))
        with progress_bar(f'reading {path.name}', total, enabled=progress) as bar:
            messages = bag.messages([*streams, *([loads.topic] if loads else [])])
            for done, (topic, received, message) in enumerate(messages, 1):
                if loads and topic == loads.topic:
                    loads.add(received, message)
                    continue
                streams[topic].add(received, message)
                if loads:
                    loads.pass_joint_state(received, message)
                if not done % BATCH:
                    bar(done)
        for stream in streams.values():
            stream.decode()
        notes = [*map(printable, bag.notes), *(
            f"{topic}: {stream.count} messages, where the bag's metadata counts {expected[topic]}"
            for topic, stream in streams.items() if stream.count != expected[topic]), *(
            f'{topic}: no messages' for topic, stream in streams.items() if not stream.count)]
    recording = recorded(list(streams.values()), joints, source, notes, some)
    return recording if loads is None else _with_loads(recording, loads)


def _load_stream(bag: Bag) -> LoadStream | None:
    """Return a stream for the topic with foot loads, None unless exactly one has them."""
    found = {one.topic for one in bag.connections
             if one.topic.rsplit('/')[-1] == NAME and one.msgtype == TYPE}
    return LoadStream(found.pop()) if len(found) == 1 else None


def _with_loads(recording: Recording, stream: LoadStream) -> Recording:
    try:
        return replace(recording, loads=stream.loads(recording.start))
    except RecordingError as error:
        # What is asked for is the joints.
        return replace(recording, notes=(*recording.notes, f'{error}: left out'))


BAG = RecordingFormat(
    name='bag', contents='a rosbag2 bag', help='a rosbag2 bag, sqlite3 or mcap', metavar='DIR',
    read=read_bag, endings=STORAGES, files_in=files_of_bag, features=('servo', 'some'),
    options=(Option('topics', 'topics of the bag to read (default: all of type '
                    'sensor_msgs/msg/JointState)', 'TOPIC', several=True), JOINTS),
    lacks={'unit': 'joint states are in rad', 'time': 'joint states have their stamps'})
