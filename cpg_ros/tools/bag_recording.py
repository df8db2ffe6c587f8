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

"""Recording the topics of a graph into a bag, as ``ros2 bag record`` does."""

from collections.abc import Sequence
from pathlib import Path
import sys
import time

from cpg_ros.nodes.bag_recorder import BagRecorder, EVERY
from rclpy.node import Node

#: How often the graph is searched for new topics, s.
LOOK = 0.5
#: Topics that come with every node and that nobody wants.
USUAL = ('/rosout', '/parameter_events')


def record(node: Node, path: Path, wanted: Sequence[str]) -> BagRecorder:
    """Record until Ctrl-C.

    Args:
        node: subscribes.
        path: of the bag, a folder that does not exist yet.
        wanted: topics; if empty, all that exist or appear.

    Raises:
        BagError: something is there already, or the folder cannot be written to.

    """
    recorder, looked = BagRecorder(node, path), 0.0
    names = [node.resolve_topic_name(one) for one in wanted]
    try:
        while True:
            if time.monotonic() > looked + LOOK:
                looked = time.monotonic()
                for topic in _subscribed(node, recorder, names):
                    print(f'recording {topic}', file=sys.stderr, flush=True)
            recorder.take()
            time.sleep(EVERY)
    except KeyboardInterrupt:
        pass
    finally:
        recorder.close()
    return recorder


def _subscribed(node: Node, recorder: BagRecorder, wanted: Sequence[str]) -> list[str]:
    """Record topics that are new on the graph; return them."""
    return [topic for topic, kinds in node.get_topic_names_and_types()
            if topic not in recorder.counts and topic not in recorder.passed_over
            and (topic in wanted if wanted else topic not in USUAL)
            and node.count_publishers(topic) and recorder.subscribe(topic, kinds[0])]
