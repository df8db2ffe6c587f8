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

"""A recording that changes its gait, cut into its steady stretches, each of them fitted.

The longest steady stretch is found first, then the longest ones before and after it, and so on:
each is followed with its own phase until the motion is no longer alike, which it is not where the
frequency changes. Where only the legs' phases change, a stretch is cut in two.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

from cpg_ros.errors import CpgError, InputError
from cpg_ros.gaits.phase_change import phase_change
from cpg_ros.gaits.quality_checks import SURE
from cpg_ros.gaits.stride import Stride
from cpg_ros.gaits.usable_joints import NoSteadyGait
from cpg_ros.inversion.recording_fit import (
    fit_recording,
    leg_joints,
    network_of,
    RecordingFit,
    stride_of,
)
from cpg_ros.networks.registry import find_network, NetworkError, with_legs_of
from cpg_ros.recordings.recording import Recording, RecordingError
from cpg_ros.robots.robot import Robot
from cpg_ros.short_repr import ShortRepr

#: Shorter remains are not searched: three strides of the fastest that is looked for, s.
SHORTEST = 0.24


@dataclass(frozen=True, eq=False, repr=False)
class StretchFit(ShortRepr):
    """A steady stretch of a recording.

    Attributes:
        begin, end: s from the recording's start.
        stride: what was found there, on a clock of its own.
        fit: the network's gait fitted to it; None if that failed.
        why: why there is no fit.

    """

    begin: float
    end: float
    stride: Stride
    fit: RecordingFit | None
    why: str = ''

    def _summary(self) -> str:
        return (f'{self.begin:.2f} to {self.end:.2f} s: {self.stride.verdict}, '
                f'{self.stride.frequency:.4g} Hz')

    @property
    def gait(self) -> str | None:
        """Name of the gait, None if it is none or cannot be told."""
        return None if len(self.stride.alike) > 1 else self.stride.gait


    @property
    def confidence(self) -> float:
        """Probability that gait and frequency are those named, as of RecordingFit."""
        return self.stride.confidence if self.fit is None else self.fit.confidence


def cut(recording: Recording, robot: Robot | None = None, network: str = ''
        ) -> list[tuple[float, float, Stride]]:
    """Return begin and end, s, and stride of the steady stretches of a recording, in its order.

    Args:
        recording: joints over time.
        robot: which joints belong to which legs; by default their names decide.
        network: whose gaits they may be; by default as of fit_recording.

    Raises:
        NoSteadyGait: there is none.
        CpgError: as of fit_recording.

    """
    legs, _ = leg_joints(recording, robot)
    try:
        kind = with_legs_of(find_network(_network(recording, robot, network)), legs)
    except NetworkError as error:
        raise InputError(f'network {error}') from error
    found: list[tuple[float, float, Stride]] = []
    remains = [(0.0, float(recording.times[-1]))]
    why: NoSteadyGait | None = None
    while remains:
        begin, end = remains.pop()
        try:
            part = recording.between(begin, end)
            _, stride = stride_of(part, legs, kind, robot)
        except NoSteadyGait as error:
            why = why or error
            continue
        except RecordingError:
            # Fewer than two samples are no stretch.
            continue
        origin = part.start - recording.start
        change = phase_change(part, legs, stride)
        if change is not None:
            # What changes, and one stride on either side, is of neither gait.
            remains += _longer((begin, origin + change - 1.0 / stride.frequency),
                               (origin + change + 1.0 / stride.frequency, end))
            continue
        first, last = origin + stride.begin, origin + stride.end
        if stride.cycles >= SURE:
            found.append((first, last, stride))
        remains += _longer((begin, first), (last, end))
    if not found:
        raise why or NoSteadyGait(f'{recording.source}: no steady gait of {SURE:g} strides')
    return sorted(found, key=lambda one: one[0])


def _network(recording: Recording, robot: Robot | None, network: str) -> str:
    if network or robot is None:
        return network or network_of(leg_joints(recording, robot)[0])
    return robot.networks[0]


def _longer(*parts: tuple[float, float]) -> list[tuple[float, float]]:
    return [(begin, end) for begin, end in parts if end - begin >= SHORTEST]


def fit_stretches(recording: Recording, robot: Robot | None = None, network: str = '', *,
                  order: int = 3, done: Callable[[float], None] = lambda share: None
                  ) -> list[StretchFit]:
    """Fit a network's gaits to all steady stretches of a recording.

    Args:
        recording: joints over time.
        robot: as of fit_recording.
        network: one for all stretches; by default as of fit_recording.
        order: of the readouts, 1 to 3.
        done: called with the share of the fits that is done, 0 to 1.

    Raises:
        CpgError: as of cut.

    """
    name, found = _network(recording, robot, network), []
    stretches = cut(recording, robot, network)
    for k, (begin, end, stride) in enumerate(stretches):
        part = replace(recording.between(begin, end),
                       source=f'{recording.source}, {begin:.2f} to {end:.2f} s')

        def so_far(share: float, before: int = k) -> None:
            done((before + share) / len(stretches))
        try:
            fit = fit_recording(part, robot, name, order=order, done=so_far)
            found.append(StretchFit(begin, end, fit.stride, fit))
        except CpgError as error:
            found.append(StretchFit(begin, end, stride, None, str(error)))
    return found


def stretch_rows(found: Sequence[StretchFit]) -> list[tuple[str, ...]]:
    """Return stretches as a table, with its head."""
    rows: list[tuple[str, ...]] = [('begin [s]', 'end [s]', 'gait', 'frequency [Hz]', 'strides',
                                    'confidence', 'RMS error')]
    return rows + [(f'{one.begin:.2f}', f'{one.end:.2f}', one.stride.verdict,
                    f'{one.stride.frequency:.4f}', str(one.stride.cycles),
                    f'{one.confidence:.3f}', 'not fitted' if one.fit is None else
                    f'{100.0 * one.fit.fit.mean_rms_share:.1f} %') for one in found]
