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

"""Hopf points on lines across the plane of an atlas, from which curves are followed."""

from collections.abc import Iterator
from dataclasses import dataclass

from cpg_ros.atlas.chart import Chart
from cpg_ros.dynamics.hopf_search import hopf_points
from cpg_ros.errors import CpgError
from cpg_ros.short_repr import ShortRepr
import numpy as np

#: Lines along each axis.
LINES = 41


@dataclass(frozen=True, eq=False, repr=False)
class ChartLine(ShortRepr):
    """A line across the plane of an atlas, parallel to one of its axes.

    Attributes:
        chart: the plane.
        gaits: whose Hopf points are searched on it.
        axis: along which: 0 or 1.
        fixed: value on the other axis.
        low: least value on this one.
        high: greatest value.

    """

    chart: Chart
    gaits: tuple[str, ...]
    axis: int
    fixed: float
    low: float
    high: float

    def place(self, value: float) -> tuple[float, float]:
        """Return the values on both axes."""
        return (value, self.fixed) if self.axis == 0 else (self.fixed, value)


@dataclass(frozen=True, eq=False, repr=False)
class HopfStart(ShortRepr):
    """A Hopf point from which a curve is followed.

    Attributes:
        gait: whose.
        mode: its class.
        share: (p1, p2, omega), the parameters in shares of their ranges.

    """

    gait: str
    mode: tuple[int, ...]
    share: np.ndarray


def lines_across(chart: Chart, gaits: tuple[str, ...]) -> Iterator[ChartLine]:
    """Yield evenly spaced lines along both axes: lines along one may all miss a curve."""
    axes = chart.first, chart.second
    for along, across in ((1, 0), (0, 1)):
        for fixed in np.linspace(axes[across].low, axes[across].high, LINES):
            yield ChartLine(chart, gaits, along, float(fixed), axes[along].low, axes[along].high)


def hopf_starts(segment: ChartLine) -> list[HopfStart]:
    """Return the Hopf points of some gaits on a line across the plane."""
    chart = segment.chart
    network = chart.at(*segment.place(segment.low))
    if not network.rests:
        return []
    line = (chart.first, chart.second)[segment.axis].line
    gaits = {frozenset(network.symmetry(gait).shifts): gait for gait in segment.gaits}
    try:
        points = hopf_points(network, line, segment.low, segment.high)
    except CpgError:
        return []
    found = []
    for point in points:
        gait = gaits.get(frozenset(point.block.symmetry.shifts))
        if gait is not None:
            share = (np.array(segment.place(point.value)) - chart.low) / chart.size
            found.append(HopfStart(gait, point.mode, np.append(share, point.omega)))
    return found
