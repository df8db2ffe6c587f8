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

"""Choice of the network that explains a recording, by cross-validation on its strides.

Every other stride is fitted, and the fit is compared with the mean cycle of the others, so that a
network gains nothing by following noise. Networks whose errors a recording cannot distinguish,
joint by joint, are ranked by their number of parameters: readouts of order 3 make many waveforms
from a nearly sinusoidal one.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

from cpg_ros.common.errors import CpgError, InputError
from cpg_ros.fitting.gaits.mean_cycle import average_cycles
from cpg_ros.fitting.gaits.stride import Stride
from cpg_ros.fitting.inversion.fit import rms_shares
from cpg_ros.fitting.inversion.fit_data import NUM_WEIGHTS
from cpg_ros.fitting.inversion.leg_duty import GaitReadout
from cpg_ros.fitting.inversion.recording_fit import (
    fit_with_fallbacks,
    leg_joints,
    networks_of,
    preset_of,
    stride_of,
)
from cpg_ros.fitting.recordings.recording import Recording
from cpg_ros.motion.robot import Robot
import numpy as np

#: MIN_DIFFERENCE: of the errors of two distinct networks, in its standard errors.
MIN_DIFFERENCE = 2.0


@dataclass(frozen=True)
class NetworkComparison:
    """Errors of a network's fit to a recording.

    Attributes:
        network: its name.
        gait: fitted one, or ''.
        error: mean over the joints of RMS error over range on strides that were not fitted.
        fitted: the same on those that were fitted.
        parameters: number of parameters of the network that were fitted, or read from the legs'
            phases.
        numbers: number of all fitted values, including the readouts'.
        why: why nothing was fitted, or ''.
        by_joint: error of each joint that moves.
        alike: whether the recording cannot distinguish it from the network with the smallest
            error.

    """

    network: str
    gait: str
    error: float = np.inf
    fitted: float = np.inf
    parameters: int = 0
    numbers: int = 0
    why: str = ''
    by_joint: dict[str, float] = field(default_factory=dict)
    alike: bool = False


def compare_networks(recording: Recording, robot: Robot | None = None, order: int = 3,
                     done: Callable[[float], None] = lambda fraction: None
                     ) -> list[NetworkComparison]:
    """Fit every network that has the recording's legs; sort by the error on other strides.

    Among those that the recording cannot distinguish, the one with the fewest numbers is first.

    Args:
        recording: joints over time.
        robot: its networks, legs and cells are used; by default all shipped networks.
        order: of the readouts, 1 to 3.
        done: called with the finished fraction, 0 to 1.

    Raises:
        CpgError: there are no legs or no steady gait, or no network has such legs.

    """
    legs, _ = leg_joints(recording, robot)
    kinds, comparisons = list(networks_of(robot, legs)), []
    if not kinds:
        raise InputError(f'{recording.source}: no network has {len(legs)} legs')
    for count, kind in enumerate(kinds):
        cells, stride = stride_of(recording, legs, kind, robot)
        gait = stride.gait or kind.unnamed
        if not gait:
            comparisons.append(NetworkComparison(kind.name, '', why=(
                f'its nearest gait, {stride.nearest}, is {stride.distance:.3f} of a cycle off')))
            continue
        half, rest = split_strides(recording, stride)
        parameters = preset_of(kind.name, gait).network.with_phases(stride.phases)
        done(count / len(kinds))
        try:
            fit, _ = fit_with_fallbacks(half, cells, parameters, gait, order=order,
                                        readout=GaitReadout.of(kind, gait, robot=robot))
        except CpgError as error:
            comparisons.append(NetworkComparison(kind.name, gait, why=str(error)))
            continue
        free = len(fit.parameters) + len(kind.offsets) - bool(kind.offsets)
        rows = [half.joints.index(name) for name in fit.joints]
        rms = rms_shares(rest[rows], fit.fitted - rest[rows])
        fractions = {name: value for name, value in zip(fit.joints, rms.tolist(), strict=True)
                     if np.isfinite(value)}
        comparisons.append(NetworkComparison(
            kind.name, gait, float(np.mean(list(fractions.values()) or [0.0])), fit.mean_rms_share,
            free, free + len(fit.joints) * (1 + NUM_WEIGHTS[fit.order]), by_joint=fractions))
    done(1.0)
    best = min(comparisons, key=lambda comparison: (comparison.error, comparison.numbers))
    comparisons = [replace(comparison, alike=not comparison.why
                           and not _distinct(comparison, best)) for comparison in comparisons]
    return sorted(comparisons, key=lambda comparison: (
        not comparison.alike,
        comparison.numbers if comparison.alike else comparison.error))


def _distinct(comparison: NetworkComparison, best: NetworkComparison) -> bool:
    """Return whether a network's errors exceed the least ones by more than their scatter."""
    if comparison is best:
        return False
    more = np.array([error - best.by_joint[name] for name, error in comparison.by_joint.items()
                     if name in best.by_joint])
    if more.size < 2:
        return comparison.error > best.error
    return bool(more.mean() > MIN_DIFFERENCE * more.std(ddof=1) / np.sqrt(more.size))


def split_strides(recording: Recording, stride: Stride) -> tuple[Stride, np.ndarray]:
    """Return the stride of every other cycle, and the mean of those between, (joints, m), rad.

    Raises:
        InputError: there are too few of them.

    """
    x = recording.positions[:, [recording.joints.index(name) for name in stride.joints]]
    inside = ((recording.times >= stride.warp.knots[0])
              & (recording.times <= stride.warp.knots[-1]))
    phases = stride.warp(recording.times[inside])
    if stride.cycles < 4:
        raise InputError(f'{recording.source}: comparing networks takes 4 strides or more, to fit '
                         f'one half and judge on the other; here are {stride.cycles}')
    even = np.floor(phases - phases[0]).astype(int) % 2 == 0
    means = []
    for mask in (even, ~even):
        part = average_cycles(phases[mask], x[inside][mask], stride.theta,
                              range(len(stride.joints)))
        means.append((part.mean(stride.theta - part.zero), part.error))
    return replace(stride, mean=means[0][0], error=means[0][1]), means[1][0]


def indistinguishable(comparisons: Sequence[NetworkComparison], order: int) -> str:
    """Name the networks that a recording cannot distinguish by readouts of an order, or ''."""
    names = [comparison.network for comparison in comparisons if comparison.alike]
    if len(names) < 2:
        return ''
    text = (f'the recording does not distinguish {", ".join(names[:-1])} and {names[-1]}; the one '
            'with the fewest parameters is fitted')
    return text if order == 1 else f'{text}; a readout of order 1 (--order 1) may tell more'


def as_rows(comparisons: Sequence[NetworkComparison]) -> list[tuple[str, ...]]:
    """Return rows of a table, with a head."""
    rows: list[tuple[str, ...]] = [('network', 'gait', 'held-out error', 'fitted', 'parameters',
                                    'all numbers', 'told from the least')]
    lowest = min((comparison.error for comparison in comparisons), default=np.inf)
    for comparison in comparisons:
        if comparison.why:
            rows.append((comparison.network, comparison.gait or 'none', '-', '-', '-', '-',
                         comparison.why))
            continue
        rows.append((comparison.network, comparison.gait, f'{100 * comparison.error:.2f} %',
                     f'{100 * comparison.fitted:.2f} %', str(comparison.parameters),
                     str(comparison.numbers),
                     '' if comparison.error == lowest else 'no' if comparison.alike else 'yes'))
    return rows
