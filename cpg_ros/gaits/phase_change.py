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

"""Where within a stretch of one frequency legs change their phases: a walk that becomes a trot.

Each stride gives each leg's phase against the first leg, as a point on the unit circle. The place
that splits these points into two groups whose means are furthest apart, for their numbers, is the
change (the likelihood ratio of one change in the mean), if the phase of a leg differs by enough.
"""

from collections.abc import Mapping, Sequence

from cpg_ros.gaits.quality_checks import CHANGE, SURE
from cpg_ros.gaits.recording_like import RecordingLike
from cpg_ros.gaits.stride import Stride
import numpy as np

#: Fewest strides on either side of a change.
FEWEST = int(SURE)


def phase_change(recording: RecordingLike, legs: Mapping[str, Sequence[str]], stride: Stride
                 ) -> float | None:
    """Return when the phases of the legs change within a stretch, s, to about one stride.

    Args:
        recording: of the joints.
        legs: leg -> its joints.
        stride: found in the recording, whose stretch is looked at.

    Returns:
        The recording's time, None if no leg changes its phase by more than a tenth of a cycle.

    """
    points = _points(recording, legs, stride)
    count = len(points)
    if count < 2 * FEWEST:
        return None
    sums = np.cumsum(points, axis=0)
    ends = np.arange(FEWEST, count - FEWEST + 1)[:, None]
    before = sums[ends[:, 0] - 1] / ends
    after = (sums[-1] - sums[ends[:, 0] - 1]) / (count - ends)
    ratio = ends * (count - ends) / count * np.abs(after - before)**2
    best = int(np.argmax(ratio.sum(axis=1)))
    turned = np.angle(after[best] * before[best].conj()) / (2.0 * np.pi)
    if np.abs(turned).max() <= CHANGE:
        return None
    first = np.ceil(stride.warp.phases[0])
    return float(np.interp(first + ends[best, 0], stride.warp.phases, stride.warp.knots))


def _points(recording: RecordingLike, legs: Mapping[str, Sequence[str]], stride: Stride
            ) -> np.ndarray:
    """Return exp(2 pi i phase) of the legs against the first, shape (whole strides, legs - 1)."""
    warp, joints = stride.warp, list(recording.joints)
    inside = (recording.times >= warp.knots[0]) & (recording.times <= warp.knots[-1])
    phases = warp(recording.times[inside])
    first, last = int(np.ceil(phases[0])), int(np.floor(phases[-1]))
    number = np.floor(phases).astype(int) - first
    whole = (number >= 0) & (number < last - first)
    turn = np.exp(-2j * np.pi * phases[whole])
    sums = []
    for leg in stride.phases:
        name = max((one for one in legs[leg] if one in stride.joints),
                   key=lambda one: float(np.ptp(stride.mean[stride.joints.index(one)])))
        x = recording.positions[inside, joints.index(name)][whole]
        x = np.where(np.isfinite(x), x - np.nanmean(x), 0.0) * turn
        sums.append(np.bincount(number[whole], x.real, last - first)
                    + 1j * np.bincount(number[whole], x.imag, last - first))
    ahead = np.array(sums[1:]) * np.conj(sums[0])
    return (ahead / np.maximum(np.abs(ahead), 1e-300)).T
