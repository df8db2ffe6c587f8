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

"""What is on the topics, into a bag: every message, by a thread of its own."""

from collections.abc import Callable, Iterable
from importlib import import_module
from pathlib import Path
import shutil
import threading
import time
from typing import Any
import zipfile

from cpg_ros.errors import CpgError
from cpg_ros.panel.topics import latched, Topic
from rclpy.node import Node
from rclpy.qos import QoSProfile

#: How often messages are fetched, s, and how many a topic may have had by then.
EVERY, DEPTH = 0.02, 1000
#: Topics whose last message waits for who comes later.
LATCHED = ('/gait', '/robot_description', '/tf_static')


class RecordingError(CpgError):
    """A recording cannot be made; one line for whoever asked."""


class Recorder:
    """Records to one bag after the other in a folder.

    Attributes:
        bag: the newest one, while it is recorded or after that, '' before the first.
        running: whether it is being recorded.

    """

    def __init__(self, node: Node, folder: Path, largest: int, ended: Callable[[str], None]
                 ) -> None:
        """Record to a folder by a node that is not spun, at most so many bytes a bag.

        Ended is called, from the thread that records, with why a recording ended by itself.
        """
        self._node, self._folder, self._largest, self._ended = node, folder, largest, ended
        self._stop = threading.Event()
        self._thread: threading.Thread | None = None
        self.bag = ''
        self.bytes = 0

    @property
    def running(self) -> bool:
        """Whether a bag is being recorded."""
        return self._thread is not None and self._thread.is_alive()

    def start(self, topics: Iterable[tuple[str, str]]) -> str:
        """Record topics, (name, type), to a new bag; return its name.

        Raises:
            RecordingError: one is being recorded, nothing can be recorded, or not there.

        """
        if self.running:
            raise RecordingError(f'{self.bag} is being recorded already')
        from rosbags.rosbag2 import StoragePlugin, Writer, WriterError
        from rosbags.typesys import get_typestore, Stores
        store = get_typestore(Stores.ROS2_JAZZY)
        known = sorted((name, kind) for name, kind in topics if kind in store.types)
        if not known:
            raise RecordingError('there is nothing to record')
        bag = time.strftime('panel_%Y%m%d_%H%M%S')
        path = self._folder / bag
        try:
            self._folder.mkdir(parents=True, exist_ok=True)
            writer = Writer(path, version=9, storage_plugin=StoragePlugin.MCAP)
            writer.open()
        except (OSError, WriterError) as error:
            raise RecordingError(f'{path}: {error}') from error
        readers = []
        for name, kind in known:
            package, _, message = kind.partition('/msg/')
            quality = latched() if name.endswith(LATCHED) else QoSProfile(depth=DEPTH)
            try:
                reader = Topic(self._node, getattr(import_module(f'{package}.msg'), message),
                               name, quality, raw=True)
            except (ImportError, AttributeError):
                continue  # of a package that is not installed here
            readers.append((reader, writer.add_connection(name, kind, typestore=store)))
        self._stop.clear()
        self.bag, self.bytes = bag, 0
        self._thread = threading.Thread(target=self._record, args=(writer, readers),
                                        name='recorder', daemon=True)
        self._thread.start()
        return bag

    def _record(self, writer: Any, readers: list[tuple[Topic, Any]]) -> None:
        why = ''
        try:
            while not self._stop.wait(EVERY):
                for reader, connection in readers:
                    for data, when in reader.take():
                        writer.write(connection, when, data)
                        self.bytes += len(data)
                if self.bytes > self._largest:
                    why = f'{self.bag} is full ({self.bytes / 1e6:.0f} MB)'
                    break
        except OSError as error:
            why = f'{self.bag}: {error.strerror}'
        finally:
            writer.close()
            for reader, _ in readers:
                reader.close()
        if why:
            self._ended(why)

    def stop(self) -> None:
        """End the recording, if there is one."""
        self._stop.set()
        if self._thread is not None:
            self._thread.join(timeout=5.0)

    def packed(self, bag: str) -> bytes:
        """Return a recording that has ended as a zip archive.

        Raises:
            RecordingError: there is no such recording, or it has not ended.

        """
        path = self._folder / bag
        # Only what this recorder makes: no name leads out of the folder.
        if not bag.startswith('panel_') or not bag[6:].replace('_', '').isdigit():
            raise RecordingError('this is no recording')
        if self.running and bag == self.bag:
            raise RecordingError(f'{bag} is still being recorded')
        if not path.is_dir():
            raise RecordingError(f'there is no recording {bag}')
        archive = self._folder / f'{bag}.zip'
        if not archive.is_file():
            part = archive.with_suffix('.part')
            with zipfile.ZipFile(part, 'w', zipfile.ZIP_DEFLATED) as made:
                for file in sorted(path.iterdir()):
                    made.write(file, f'{bag}/{file.name}')
            shutil.move(part, archive)
        return archive.read_bytes()
