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

"""Default starts of a fit: the best of many values that cover the ranges.

A cost may have several minima, as other parameters can give similar waveforms with a free readout.
The cost of each candidate takes an orbit and a linear fit of the readouts. The trust region starts
from the smallest costs on the grid, and from the network's own values.
"""

from contextlib import suppress

from cpg_ros.dynamics.arclength import NoOrbit
from cpg_ros.fitting.inversion.cycle_problem import CycleProblem
from cpg_ros.fitting.inversion.free_parameters import Free, MIN_SCALE
from cpg_ros.fitting.inversion.leg_duty import GAIT_DUTY
import numpy as np

#: DUTY_NAMES: names of free numbers that are the stance's fraction of a stride.
DUTY_NAMES = (GAIT_DUTY, 'duty')
#: DUTIES: values of the gait's duty that are tried.
DUTIES = (0.38, 0.5, 0.6, 0.7, 0.8)
#: DELAY_RATIOS: delays that are tried, over the critical one; RANGE_FRACTIONS: places in a narrow
#: range, whose ends have one sign and a ratio up to MAX_RANGE_RATIO; FACTORS: factors of numbers
#: without such a range.
DELAY_RATIOS, FACTORS = (1.05, 1.4, 2.5), (0.7, 1.4)
RANGE_FRACTIONS, MAX_RANGE_RATIO = (np.arange(9) + 0.5) / 9, 10.0
#: Besides the network's own values.
MIN_STARTS, MAX_STARTS = 2, 3


def _grid(problem: CycleProblem, k: int, parameter: Free, base: float) -> tuple[float, ...]:
    """Return the candidate coordinates of a free number besides its own."""
    if parameter.name == GAIT_DUTY:
        return DUTIES
    if k == problem.coordinates.delay:
        return DELAY_RATIOS
    low, high = parameter.low, parameter.high
    if 0.0 < low < high <= MAX_RANGE_RATIO * low:
        return tuple(low + fraction * (high - low) for fraction in RANGE_FRACTIONS)
    return tuple(factor * base for factor in FACTORS)


def best_starts(problem: CycleProblem, begin: np.ndarray) -> list[np.ndarray]:
    """Return the network's own values and the smallest costs on a grid over the ranges.

    Args:
        problem: the fit.
        begin: the network's own values and a phase; without an orbit they are the only start.

    Returns:
        Values, the smallest cost first, each of shape (values,).

    """
    try:
        problem.begin(begin)
        base = problem.coordinates.of(begin)[:-1]
    except NoOrbit:
        return [begin]
    axes = [np.unique([value, *_grid(problem, k, parameter, float(value))])
            for k, (parameter, value) in enumerate(zip(problem.free, base, strict=True))]
    grid = np.stack(np.meshgrid(*axes, indexing='ij'), axis=-1)
    explained, starts = np.full(grid.shape[:-1], -np.inf), {}
    start = [int(np.abs(axis - value).argmin()) for axis, value in zip(axes, base, strict=True)]
    # The nearest ones first, an orbit leads to the next; one of the network's numbers is moved at
    # a time, as an orbit takes far longer than a readout.
    norm = np.sum(np.abs(grid - base) / (np.abs(base) + MIN_SCALE), axis=-1)
    for index in sorted(np.ndindex(norm.shape), key=lambda parameter: float(norm[parameter])):
        if sum(k != at for k, at, parameter in zip(index, start, problem.free, strict=True)
               if parameter.members) > 1:
            continue
        with suppress(NoOrbit):
            values = problem.coordinates.values(np.append(grid[index], 0.0))
            if all(parameter.low <= value <= parameter.high
                   for parameter, value in zip(problem.free, values, strict=False)):
                values[-1], explained[index] = problem.explained_share(values)
                problem.hold(values)
                starts[index] = values
    if not starts:
        return [begin]
    ranked = sorted(starts, key=lambda index: -explained[index])
    best = [index for index in ranked if _highest(explained, index)][:MAX_STARTS]
    best += [index for index in ranked if index not in best][:max(MIN_STARTS - len(best), 0)]
    return [starts[index] for index in ranked if index in (tuple(start), *best)]


def upside_down(problem: CycleProblem, values: np.ndarray) -> np.ndarray | None:
    """Return values near which the waveform may be the same inverted; None if none is known.

    With a free readout, an inverted waveform gives the same motion with stance and swing
    exchanged.
    """
    fractions = [k for k, parameter in enumerate(problem.free) if parameter.name in DUTY_NAMES]
    if not fractions:
        return None
    shifted = values.copy()
    for k in fractions:
        shifted[k] = np.clip(1.0 - values[k], problem.free[k].low, problem.free[k].high)
    shifted[-1] = problem.explained_share(shifted)[0]
    return shifted


def _highest(explained: np.ndarray, index: tuple[int, ...]) -> bool:
    """Return whether no neighbour on the grid explains more."""
    neighbours = explained[tuple(slice(max(k - 1, 0), k + 2) for k in index)]
    return bool(explained[index] >= neighbours.max())
