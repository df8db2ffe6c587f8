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

"""Records the topics of a robot into bags, one after another, in a thread of its own."""

from collections.abc import Callable, Iterable
import os
from pathlib import Path
import threading
import time
import zipfile

from cpg_ros.nodes.bag_recorder import BagRecorder, EVERY
from cpg_ros.recordings.bag_writer import BagError
from rclpy.node import Node


class Recorder:
    """Records one bag after another into a folder.

    Attributes:
        bag: name of the newest one, '' before the first.
        running: whether it is being recorded.

    """

    def __init__(self, node: Node, folder: Path, largest: int, ended: Callable[[str], None]
                 ) -> None:
        """Prepare to record.

        Args:
            node: that subscribes, and need not be spun.
            folder: for the bags.
            largest: size at which a recording ends, bytes.
            ended: called from the recording thread with why a recording ended by itself.

        """
        self._node, self._folder, self._largest, self._ended = node, folder, largest, ended
        self._stop, self._packing = threading.Event(), threading.Lock()
        self._thread: threading.Thread | None = None
        self.bag = ''

    @property
    def running(self) -> bool:
        """Whether a bag is being recorded."""
        return self._thread is not None and self._thread.is_alive()

    def start(self, topics: Iterable[tuple[str, str]]) -> str:
        """Record topics, (name, type), to a new bag; return its name.

        Raises:
            BagError: another bag is being recorded, there is nothing to record, or the folder
                cannot be written to.

        """
        if self.running:
            raise BagError(f'{self.bag} is being recorded already')
        # Another panel may record to the same folder in the same second.
        bag = time.strftime(f'panel_%Y%m%d_%H%M%S_{os.getpid()}')
        try:
            self._folder.mkdir(parents=True, exist_ok=True)
            recorder = BagRecorder(self._node, self._folder / bag)
        except (BagError, OSError) as error:
            raise BagError(self._shown(error)) from error
        for name, kind in sorted(topics):
            recorder.subscribe(name, kind)
        if not recorder.counts:
            recorder.close()
            raise BagError('there are no topics to record')
        self._stop.clear()
        self.bag = bag
        self._thread = threading.Thread(target=self._record, args=(recorder,), name='recorder',
                                        daemon=True)
        self._thread.start()
        return bag

    def _record(self, recorder: BagRecorder) -> None:
        why = ''
        try:
            while not self._stop.wait(EVERY):
                recorder.take()
                if recorder.size > self._largest:
                    why = f'{self.bag} is full ({recorder.size / 1e6:.0f} MB)'
                    break
        except BagError as error:
            why = self._shown(error)
        finally:
            try:
                recorder.close()
            except BagError as error:
                why = why or self._shown(error)
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
            BagError: there is no such recording, it has not ended, or the disk is full or broken.

        """
        path = self._folder / bag
        # Only what this recorder makes: no name leads out of the folder.
        if not bag.startswith('panel_') or not bag[6:].replace('_', '').isdigit():
            raise BagError('this is not a recording')
        if self.running and bag == self.bag:
            raise BagError(f'{bag} is still being recorded')
        if not path.is_dir():
            raise BagError(f'there is no recording {bag}')
        archive = self._folder / f'{bag}.zip'
        try:
            # Several pages may download it at once.
            with self._packing:
                if not archive.is_file():
                    part = archive.with_suffix('.part')
                    with zipfile.ZipFile(part, 'w', zipfile.ZIP_DEFLATED) as made:
                        for file in sorted(path.iterdir()):
                            made.write(file, f'{bag}/{file.name}')
                    part.replace(archive)
            return archive.read_bytes()
        except OSError as error:
            raise BagError(self._shown(error)) from error

    def _shown(self, error: Exception) -> str:
        """Log an error, and return it for pages, without the folder."""
        self._node.get_logger().warning(str(error))
        text = (f'{Path(error.filename or self._folder).name}: {error.strerror}'
                if isinstance(error, OSError) else str(error))
        return text.replace(f'{self._folder}/', '')
