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

"""Implausible samples: stamps far from all others, angles that no joint can have."""

import numpy as np

#: A position beyond this is of no joint (rad).
FARTHEST = 1e6
#: A position so many times as far from the median as most of them spread, the spread taken as 1
#: rad at least, is of no joint, either, where no more than one or this share of them is.
SPIKE, RARE = 100.0, 0.01
#: A gap of so many times what all samples take, and of this much (ns), has recordings on either
#: side that do not belong together, or stamps that went wrong.
ASTRAY, GAP = 10.0, 60_000_000_000
#: Stamps, the columns that they are of, and positions, shape (n, columns).
Part = tuple[np.ndarray, list[int], np.ndarray]


def counted(count: int, what: str) -> str:
    """Return a number of things in words."""
    return f'{count} {what}{"" if count == 1 else "s"}'


def without_astray(parts: list[Part]) -> tuple[list[Part], list[str]]:
    """Keep the longest run of samples without a huge gap; return it, and notes on the rest."""
    stamps = np.sort(np.concatenate([stamps for stamps, _, _ in parts]))
    steps = np.diff(stamps)
    usual = np.median(steps[steps > 0]) if (steps > 0).any() else 0.0
    gaps = np.flatnonzero(steps > max(ASTRAY * usual * stamps.size, GAP)) + 1
    ends = np.concatenate([[0], gaps, [stamps.size]])
    most = int(np.argmax(np.diff(ends)))
    lost = stamps.size - int(ends[most + 1] - ends[most])
    if not lost:
        return parts, []
    first, last = stamps[ends[most]], stamps[ends[most + 1] - 1]
    kept = []
    for own, columns, positions in parts:
        there = (own >= first) & (own <= last)
        if there.any():
            kept.append((own[there], columns, positions[there]))
    stray = stamps[0] if ends[most] else stamps[-1]
    return kept, [f'{counted(lost, "sample")} stamped far from the others, left out, such as at '
                  f'{stray / 1e9:.10g} s: the others are from {first / 1e9:.10g} s to '
                  f'{last / 1e9:.10g} s']


def without_far(parts: list[Part], width: int) -> np.ndarray:
    """Take away positions that no joint can have; return how many, shape (width,)."""
    count = np.zeros(width, int)
    for _, columns, positions in parts:
        # Column by column: a long recording is large.
        for k, column in zip(columns, positions.T, strict=True):
            far = _far(column)
            count[k] += np.count_nonzero(far)
            column[far] = np.nan
    return count


def _far(column: np.ndarray) -> np.ndarray:
    """Return which positions of a joint are beyond all others, shape (samples,)."""
    there = np.isfinite(column)
    far = there & (np.abs(column) > FARTHEST)
    known = there & ~far
    if known.any():
        low, middle, high = np.percentile(column[known], (5.0, 50.0, 95.0))
        spikes = known & (np.abs(column - middle) > SPIKE * max(high - low, 1.0))
        if np.count_nonzero(spikes) <= max(1.0, RARE * np.count_nonzero(known)):
            far |= spikes
    return far
