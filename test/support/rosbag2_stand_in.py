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

"""A stand-in for ROS's rosbag2_py, which is not on PyPI: the part of its interface that is used.

Names and arguments are those of the Python wrapper in rosbag2's jazzy branch; the library
`rosbags` reads the storage. Importing this module makes it look as if that were not installed.
"""

from pathlib import Path
import sys
from types import ModuleType, SimpleNamespace

from rosbags.rosbag2 import Reader


class StorageOptions:

    def __init__(self, uri, storage_id=''):
        self.uri, self.storage_id = uri, storage_id


class StorageFilter:

    def __init__(self, topics=()):
        self.topics = topics


class SequentialReader:
    compressed = False

    def open(self, storage, _):  # noqa: A003
        try:
            self.reader = Reader(Path(storage.uri))
            self.reader.open()
        except Exception as error:
            raise RuntimeError('No storage could be initialized') from error
        assert bool(self.reader.compression_mode) == self.compressed
        self.rest, self.wanted = None, None

    def get_metadata(self):
        return SimpleNamespace(topics_with_message_count=[SimpleNamespace(
            topic_metadata=SimpleNamespace(name=one.topic, type=one.msgtype),
            message_count=one.msgcount) for one in self.reader.connections])

    def set_filter(self, storage_filter):
        self.wanted = storage_filter.topics

    def has_next(self):
        if self.rest is None:
            self.rest = list(self.reader.messages(
                [one for one in self.reader.connections if one.topic in self.wanted]))
        return bool(self.rest)

    def read_next(self):
        one, received, message = self.rest.pop(0)
        return one.topic, bytes(message), received


class SequentialCompressionReader(SequentialReader):
    compressed = True


class Info:

    def read_metadata(self, uri, _):
        try:
            with Reader(Path(uri)) as reader:
                return SimpleNamespace(compression_mode=(reader.compression_mode or '').upper())
        except Exception as error:
            raise RuntimeError('Exception on parsing info file') from error


made = ModuleType('rosbag2_py')
made.__spec__ = __spec__
for thing in (StorageOptions, StorageFilter, SequentialReader, SequentialCompressionReader, Info):
    setattr(made, thing.__name__, thing)
made.ConverterOptions = lambda *_: None
sys.modules['rosbag2_py'], sys.modules['rosbags'] = made, None
