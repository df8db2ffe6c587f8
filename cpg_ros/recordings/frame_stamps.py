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

"""Stamps of frames that have numbers but no times."""

import math
from pathlib import Path

from cpg_ros.recordings.recording import LATEST, RecordingError
from cpg_ros.recordings.recording_format import Option
import numpy as np

FPS = Option('fps', 'frames a second, for files that do not say', 'HZ')
#: Slowest and fastest that is believed, Hz.
SLOWEST, FASTEST = 1e-2, 1e6


def stamps_of_frames(frames: np.ndarray, fps: str | float | None, path: Path) -> np.ndarray:
    """Return the stamps of frames.

    Args:
        frames: their numbers, shape (n,).
        fps: frames a second, as a number or its text; None if nobody said.
        path: for messages.

    Returns:
        ns, int64, shape (n,).

    Raises:
        RecordingError: there is no rate or an impossible one, or a frame without a number.

    """
    if fps is None:
        raise RecordingError(f'{path}: it has no times: give the frames a second (fps)')
    try:
        rate = float(fps)
    except ValueError:
        rate = math.nan
    if not SLOWEST <= rate <= FASTEST:
        raise RecordingError(f'{path}: {fps!s:.40} frames a second are not from {SLOWEST:g} to '
                             f'{FASTEST:g}')
    seconds = np.asarray(frames, float) / rate
    if not (np.abs(seconds) < LATEST).all():
        raise RecordingError(f'{path}: frames without a plausible number')
    return np.rint(seconds * 1e9).astype(np.int64)
