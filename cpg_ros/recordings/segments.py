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

"""Files of segments: which markers span which part of a body, and which parts a joint connects."""

from collections.abc import Mapping
from dataclasses import dataclass
import math
from pathlib import Path
from typing import Any

from cpg_ros.files.shared_resources import share
from cpg_ros.files.yaml_reader import YamlReader
from cpg_ros.recordings.recording import few, RecordingError
from cpg_ros.recordings.recording_format import Option

#: What every reader of markers takes.
SEGMENTS = Option('segments', 'for markers: a file that says which of them span which segment '
                  'and which joints are between, or the name of a shipped one', 'FILE')
#: Likelihood below which a marker counts as not seen, if the file does not say: as DeepLabCut's.
LIKELY = 0.6


@dataclass(frozen=True)
class Segment:
    """A line through a body, from one end to the other; each end is the mean of its markers."""

    begin: tuple[str, ...]
    end: tuple[str, ...]

    @property
    def markers(self) -> tuple[str, ...]:
        """Those of both ends."""
        return self.begin + self.end


@dataclass(frozen=True)
class JointAngle:
    """The angle by which a segment is turned from another.

    Attributes:
        first: name of the segment it is turned from, such as the thigh.
        second: name of the segment that is turned, such as the shank.
        axis: name of the segment about which it turns, by the right hand, in three dimensions;
            '' for the angle between the two, which has no sign.
        neutral: angle that counts as 0, rad.

    """

    first: str
    second: str
    axis: str = ''
    neutral: float = 0.0


@dataclass(frozen=True)
class Segments:
    """Segments, the joints between them, and the likelihood below which a marker is not seen."""

    segments: Mapping[str, Segment]
    joints: Mapping[str, JointAngle]
    likely: float = LIKELY

    def markers(self, joint: str, solid: bool) -> tuple[str, ...]:
        """Return the markers that a joint's angle is made of, each once.

        Args:
            joint: its name.
            solid: in three dimensions, where its axis' markers count, too.

        """
        one = self.joints[joint]
        return tuple(dict.fromkeys(
            marker for name in (one.first, one.second, *[one.axis] * bool(one.axis and solid))
            for marker in self.segments[name].markers))


class _Reader(YamlReader):
    """Reads the ends of segments, too."""

    def ends(self, value: Any, where: str) -> Segment:
        listed = self.items(value, where)
        if len(listed) != 2:
            raise self.fail(where, f'has two ends, not {len(listed)}')
        ends = [tuple(self.text(one, f'{where}[{k}]') for one in (
            self.items(end, f'{where}[{k}]') if isinstance(end, list) else [end]))
            for k, end in enumerate(listed)]
        if ends[0] == ends[1]:
            raise self.fail(where, 'begins and ends at the same marker')
        return Segment(*ends)

    def joint(self, value: Any, where: str, segments: Mapping[str, Segment]) -> JointAngle:
        tree = self.keys(value, where, {'between'}, {'axis', 'neutral'})
        between = self.items(tree['between'], f'{where}.between')
        if len(between) != 2 or between[0] == between[1]:
            raise self.fail(f'{where}.between', 'must be two segments')
        first, second = (self.text(one, f'{where}.between') for one in between)
        axis = self.text(tree['axis'], f'{where}.axis') if 'axis' in tree else ''
        for name in (first, second, *[axis] * bool(axis)):
            if name not in segments:
                raise self.fail(where, f'there is no segment {name!r}, only '
                                f'{few(list(segments), 20)}')
        neutral = self.number(tree.get('neutral', 0.0), f'{where}.neutral')
        if abs(neutral) > math.pi:
            raise self.fail(f'{where}.neutral', f'{neutral:g} rad is more than half a turn')
        return JointAngle(first, second, axis, neutral)


def shipped() -> list[str]:
    """Return the names of the shipped files."""
    return sorted(file.stem for file in (share() / 'config' / 'segments').glob('*.yaml'))


def load_segments(name: str | Path) -> Segments:
    """Read a file of segments.

    ::

        least_likelihood: 0.6       # optional
        segments:
          thigh: [hip, knee]        # from, to
          shank: [knee, [ankle_inner, ankle_outer]]
          leftward: [pelvis_right, pelvis_left]
        joints:
          knee: {between: [thigh, shank], axis: leftward, neutral: 0.0}

    In three dimensions, a joint with an axis is the angle that its two segments have as seen along
    the axis, positive by the right hand; one without is the angle between them, which is never
    negative. In a picture, angles are positive counter-clockwise, and an axis is ignored. The
    angle that counts as 0 is `neutral` (rad); others lie within half a turn of it.

    Args:
        name: path of the file, or the name of a shipped one.

    Raises:
        RecordingError: the file is not there or wrong; the message names the place.

    """
    path = Path(name)
    if not path.exists() and str(name) in shipped():
        path = share() / 'config' / 'segments' / f'{name}.yaml'
    reader = _Reader(path, 'segments', RecordingError, 1e6)
    if not path.exists():
        raise RecordingError(f'{path}: there is no such file of segments; shipped are '
                             f'{few(shipped())}')
    tree = reader.keys(reader.tree(), 'file', {'segments', 'joints'}, {'least_likelihood'})
    for key in ('segments', 'joints'):
        if not isinstance(tree[key], Mapping) or not tree[key]:
            raise reader.fail(key, 'must be a mapping with at least one entry')
    segments = {key: reader.ends(value, f'segments.{key}')
                for key, value in tree['segments'].items()}
    joints = {key: reader.joint(value, f'joints.{key}', segments)
              for key, value in tree['joints'].items()}
    likely = reader.number(tree.get('least_likelihood', LIKELY), 'least_likelihood')
    if not 0.0 <= likely <= 1.0:
        raise reader.fail('least_likelihood', f'{likely:g} is not from 0 to 1')
    return Segments(segments, joints, likely)
