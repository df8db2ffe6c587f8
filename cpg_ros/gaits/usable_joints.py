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

"""The joints of a recording that have angles enough, without samples that are no motion."""

from collections.abc import Mapping, Sequence

from cpg_ros.errors import CpgError
from cpg_ros.gaits.recording_like import RecordingLike
import numpy as np

#: Fewest samples of a joint.
SAMPLES = 8
#: A sample is no motion if it is off both neighbours by this many standard deviations and times
#: as much as they differ.
SPIKE = 3.0


class NoSteadyGait(CpgError):
    """A recording has no steady gait; the message describes what it has instead."""

    exit_code = 1


def usable_joints(recording: RecordingLike, legs: Mapping[str, Sequence[str]]
            ) -> tuple[dict[str, tuple[str, ...]], np.ndarray, list[str]]:
    """Return the legs' joints that have angles, their positions without spikes, and notes.

    Args:
        recording: of the joints.
        legs: leg -> its joints.

    Raises:
        NoSteadyGait: there are too few samples, or a leg has no joint with angles.

    """
    listed = [name for name in recording.joints if any(name in one for one in legs.values())]
    # Joint by joint in memory, as they are averaged.
    x = np.empty((len(listed), len(recording.times))).T
    for column, name in zip(x.T, listed, strict=True):
        column[:] = recording.positions[:, recording.joints.index(name)]
        column[np.isinf(column)] = np.nan
    enough = np.isfinite(x).sum(axis=0) >= SAMPLES
    spikes = 0
    for k in np.flatnonzero(enough):
        column = x[:, k]
        before, here, after = column[:-2], column[1:-1], column[2:]
        off = np.abs(here - 0.5 * (before + after))
        with np.errstate(invalid='ignore'):
            wild = ((off > SPIKE * np.nanstd(column)) & (off > SPIKE * np.abs(after - before)))
        here[wild] = np.nan
        spikes += int(np.count_nonzero(wild))
    # Of spikes alone nothing is left.
    enough = np.isfinite(x).sum(axis=0) >= SAMPLES
    names = [name for name, good in zip(listed, enough, strict=True) if good]
    lost = [name for name in listed if name not in names]
    notes = [f'left out, without angles: {", ".join(lost)}'] if lost and names else []
    if len(recording.times) < SAMPLES:
        raise NoSteadyGait(f'{recording.source}: {len(recording.times)} samples are not enough '
                           f'for a gait, at least {SAMPLES} are needed')
    kept = _kept(legs, names, recording.source)
    x = x if enough.all() else x[:, enough]
    if spikes:
        notes.append(f'left out, far off both neighbours: {spikes} samples')
    return kept, x, notes


def with_angles(names: list[str], legs: dict[str, tuple[str, ...]], x: np.ndarray, source: str,
                notes: list[str]) -> tuple[list[str], dict[str, tuple[str, ...]], np.ndarray]:
    """Leave out joints with hardly any angles; return names, legs, and which have enough.

    Args:
        names: of the joints.
        legs: leg -> its joints.
        x: angles, rad, nan where missing, shape (n, joints).
        source: of the recording, for messages.
        notes: what is left out is added to.

    Raises:
        NoSteadyGait: a leg has no joint left.

    """
    full = np.isfinite(x).sum(axis=0) >= SAMPLES
    if full.all():
        return names, legs, full
    lost = [name for name, good in zip(names, full, strict=True) if not good]
    notes.append(f'left out, without angles in the stretch: {", ".join(lost)}')
    names = [name for name in names if name not in lost]
    return names, _kept(legs, names, source), full


def _kept(legs: Mapping[str, Sequence[str]], names: Sequence[str], source: str
          ) -> dict[str, tuple[str, ...]]:
    """Keep the legs' joints that are among names, at least one of each leg."""
    kept = {leg: tuple(name for name in listed if name in names) for leg, listed in legs.items()}
    for leg, listed in kept.items():
        if not listed:
            raise NoSteadyGait(f'{source}: none of the joints of {leg} '
                               f'({", ".join(legs[leg])}) has angles')
    return kept
