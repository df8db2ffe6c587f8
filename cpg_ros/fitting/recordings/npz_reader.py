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

"""Joint angles or markers from numpy archives (.npz) of named arrays."""

from collections.abc import Mapping, Sequence
import math
import os
from pathlib import Path
import zipfile

from cpg_ros.common import files
from cpg_ros.fitting.recordings.downsampling import pluralize
from cpg_ros.fitting.recordings.recording import (
    abbreviate,
    ANGLE_UNITS,
    JOINTS,
    MAX_TIME,
    Recording,
    recording_of,
    RecordingError,
    RecordingFormat,
    UNIT,
)
from cpg_ros.fitting.recordings.tables import FPS, stamps_of_frames, UnpackedSize
import numpy as np

#: Names of arrays: of times, rates, units and names.
TIMES = ('time', 'times', 't', 'timestamps')
RATES = ('fps', 'rate', 'frequency', 'sampling_rate')
NAMES = ('joints', 'joint_names', 'names')
POSITIONS = ('positions', 'angles', 'joint_positions', 'joint_angles', 'qpos', 'q')
UNITS = ('unit', 'units')
#: MAX_SIZE: of an archive, bytes.
MAX_SIZE = 1_000_000_000


def read_npz(path: str | Path, unit: str | None = None, fps: str | float | None = None,
             joints: Sequence[str] = (), progress: bool = True) -> Recording:
    """Read joint angles from an archive of arrays.

    It contains either one array for each joint, with its name, shape (n,); or `positions`, shape
    (n, joints), and names in `joints`. In addition, `time` (s), shape (n,), or `fps` (Hz), a
    number; and `unit`, 'rad' or 'deg'. Arrays of objects are not read, as they can run code.

    Args:
        path: the file.
        unit: 'rad' or 'deg', if the archive does not state it.
        fps: samples per second, if the archive has neither times nor a rate.
        joints: names in the order to return, or patterns such as 'left*'; all if empty.
        progress: not used.

    Raises:
        RecordingError: see `merged`; the archive is damaged or has no such arrays.

    """
    path = Path(path)
    notes: list[str] = []
    arrays = _arrays(path, notes)
    names, angles = _angles(arrays, path, notes)
    angles = angles * _scale(arrays, unit, path, notes)
    stamps = _stamps(arrays, fps, len(angles), path)
    return recording_of(path, stamps, names, angles, notes, joints)


def _arrays(path: Path, notes: list[str]) -> dict[str, np.ndarray]:
    """Read all arrays of numbers and texts."""
    with files.opened(path, RecordingError, largest=MAX_SIZE) as file:
        try:
            with zipfile.ZipFile(file) as zipped:
                members = [member.filename for member in zipped.infolist()]
                names = [name for name in members if name.endswith('.npy')]
                size = UnpackedSize(os.fstat(file.fileno()).st_size)
                for name in names:
                    size.add(_array_size(zipped, name))
            if others := [name for name in members if name not in names]:
                notes.append(f'{pluralize(len(others), "member")} that are no arrays left out: '
                             f'{abbreviate(others)}')
            file.seek(0)
            with np.load(file, allow_pickle=False) as archive:
                return {name.removesuffix('.npy'): archive[name] for name in names}
        except RecordingError as error:
            raise RecordingError(f'{path}: {error}') from error
        # Neither zipfile nor numpy lists what damaged archives make them raise.
        except Exception as error:
            reason = ' '.join(str(error).split()).rstrip('.') or type(error).__name__
            raise RecordingError(
                f"{path}: not an archive of numpy's arrays: {reason[:200]}") from error


def _array_size(archive: zipfile.ZipFile, name: str) -> int:
    """Return the bytes that an array takes as float64, from its header."""
    with archive.open(name) as member:
        version = np.lib.format.read_magic(member)
        read = (np.lib.format.read_array_header_1_0 if version == (1, 0)
                else np.lib.format.read_array_header_2_0)
        shape, _, kind = read(member)
    # Use Python's integers: a product of sizes may overflow numpy's.
    return max(archive.getinfo(name).file_size, math.prod(shape) * max(8, kind.itemsize))


def _find_key(arrays: Mapping[str, np.ndarray], names: Sequence[str]) -> str:
    """Return which of the names an array has, or ''."""
    return next((name for name in arrays if name.lower() in names), '')


def _angles(arrays: Mapping[str, np.ndarray], path: Path, notes: list[str]
            ) -> tuple[list[str], np.ndarray]:
    """Return the joints' names and their angles."""
    table, names_key = _find_key(arrays, POSITIONS), _find_key(arrays, NAMES)
    if table and arrays[table].ndim == 2:
        if not names_key:
            raise RecordingError(f"{path}: the columns of {table!r} have no names: an array "
                                 "'joints' has to list them")
        names = [str(key) for key in np.ravel(arrays[names_key])]
        if arrays[names_key].dtype.kind != 'U' or len(names) != arrays[table].shape[1]:
            raise RecordingError(f'{path}: {names_key!r} are {arrays[names_key].size} of type '
                                 f'{arrays[names_key].dtype}, where {table!r} has '
                                 f'{arrays[table].shape[1]} columns to name')
        keys, angles = [table, names_key], arrays[table]
    else:
        other = {*TIMES, *RATES, *UNITS, *NAMES}
        size = arrays[time].size if (time := _find_key(arrays, TIMES)) else None
        names = [name for name, array in arrays.items() if name.lower() not in other
                 and array.ndim == 1 and array.dtype.kind in 'fiu' and array.size > 1
                 and size in (None, array.size)]
        if not names:
            raise RecordingError(
                f"{path}: neither 'positions' with 'joints' nor an array per joint, as long as "
                f'the times; there are {abbreviate(_descriptions(arrays), 20)}')
        if len({arrays[name].size for name in names}) > 1:
            raise RecordingError(f'{path}: arrays of different lengths, '
                                 f'{abbreviate(_descriptions({k: arrays[k] for k in names}))}')
        keys, angles = names, np.column_stack([arrays[name] for name in names])
    if angles.dtype.kind not in 'fiu':
        raise RecordingError(f'{path}: {keys[0]!r} is of type {angles.dtype}, not of numbers')
    reserved = {key for key in arrays if key.lower() in (*TIMES, *RATES, *UNITS)}
    ignored = [name for name in arrays if name not in keys and name not in reserved]
    if ignored:
        notes.append(f'{pluralize(len(ignored), "array")} left out: {abbreviate(ignored)}')
    return names, angles.astype(float)


def _descriptions(arrays: Mapping[str, np.ndarray]) -> list[str]:
    return [f'{name} {array.shape}' for name, array in arrays.items()]


def _scale(arrays: Mapping[str, np.ndarray], option: str | None, path: Path, notes: list[str]
           ) -> float:
    """Return the size of the unit in rad."""
    name = _find_key(arrays, UNITS)
    unit = str(arrays[name]) if name and arrays[name].ndim == 0 else None
    for value in (unit, option):
        if value is not None and value not in ANGLE_UNITS:
            raise RecordingError(f'{path}: unit {value[:40]!r} is none of '
                                 f'{abbreviate(list(ANGLE_UNITS))}')
    if unit and option and ANGLE_UNITS[unit] != ANGLE_UNITS[option]:
        raise RecordingError(f'{path}: its angles are in {unit}, not {option}')
    if not unit and not option:
        notes.append("no array 'unit': the angles are taken to be in rad")
    return ANGLE_UNITS[unit or option or 'rad']


def _stamps(arrays: Mapping[str, np.ndarray], fps: str | float | None, count: int, path: Path
            ) -> np.ndarray:
    """Return stamps in ns, shape (count,)."""
    if name := _find_key(arrays, TIMES):
        times = arrays[name]
        if times.shape != (count,) or times.dtype.kind not in 'fiu':
            raise RecordingError(f'{path}: {name!r} of shape {times.shape} and type '
                                 f'{times.dtype}, where there are {count} samples')
        seconds = times.astype(float)
        if not (np.abs(seconds) < MAX_TIME).all():
            raise RecordingError(f'{path}: {name!r} has values that are no times in s, such as '
                                 f'{seconds[~(np.abs(seconds) < MAX_TIME)][0]:g}')
        return np.rint(seconds * 1e9).astype(np.int64)
    if name := _find_key(arrays, RATES):
        if arrays[name].size != 1 or arrays[name].dtype.kind not in 'fiu':
            raise RecordingError(f'{path}: {name!r} is not one number')
        fps = float(arrays[name].item())
    return stamps_of_frames(np.arange(count), fps, path)


NPZ = RecordingFormat(
    name='npz', contents="an archive of numpy's arrays", help='arrays of angles with names',
    metavar='FILE', read=read_npz, endings=('.npz',), options=(JOINTS, UNIT, FPS),
    lacks={'time': "an archive's times are in s"})
