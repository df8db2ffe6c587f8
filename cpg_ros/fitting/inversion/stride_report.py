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

"""Strides of a recording one by one: retraction and protraction of each leg, and their tables.

A leg's hip (or what corresponds to it) is foremost about when the foot is set down. From there to
its hindmost angle the leg is retracted, mostly in stance, and from there on protracted, mostly in
swing (Alexander 2003, Principles of Animal Locomotion). Which of the two strokes is which, the
joint below tells: it is bent more in protraction. Where that does not decide, neither does this.
A trotting Go1 retracts its legs in 74 % of the stride, by its thighs, and loads its feet in 58 %:
where loads on the feet were recorded, too, strides go from touchdown to touchdown, through stance
and swing.
"""

from collections.abc import Mapping, Sequence
import csv
from dataclasses import dataclass
import io
from itertools import pairwise

from cpg_ros.common.errors import ShortRepr
from cpg_ros.fitting.gaits.foot_contacts import FootContacts
from cpg_ros.fitting.gaits.leg_names import role_of
from cpg_ros.fitting.gaits.mean_cycle import evaluate_coefficients
from cpg_ros.fitting.gaits.quality_checks import MIN_TRAVEL
from cpg_ros.fitting.gaits.stride import Stride
from cpg_ros.fitting.inversion.recording_fit import RecordingFit
from cpg_ros.fitting.recordings.recording import Recording
import numpy as np

#: PROXIMAL: words of joints that swing a leg; then the words of joints below, which bend it.
PROXIMAL = frozenset(('hip', 'thigh', 'hfe', 'hy', 'coxa', 'shoulder', 'upper', 'hippitch'))
DISTAL = frozenset(('knee', 'calf', 'kfe', 'lower', 'tibia', 'elbow', 'shank', 'kn', 'kneepitch'))
#: HARMONICS: of the mean cycle in its extremes, which are searched for at POINTS phases.
HARMONICS, POINTS = 12, 4096
#: FIT_HALF_WIDTH: of the fit to an extreme, cycles; SEARCH_RANGE: around that of the mean cycle,
#: cycles; NUM_CANDIDATES: phases in it; MIN_SIDE_SAMPLES: on either side.
FIT_HALF_WIDTH, SEARCH_RANGE, NUM_CANDIDATES, MIN_SIDE_SAMPLES = 0.08, 0.08, 33, 3
#: MIN_SKEWNESS: that tells in which sense a joint bends; MIN_MEAN_RATIO: of its mean to its RMS
#: motion, that tells it otherwise; MIN_BEND_DIFFERENCE: of the two strokes, likewise.
MIN_SKEWNESS, MIN_MEAN_RATIO, MIN_BEND_DIFFERENCE = 0.4, 1.0, 0.3


@dataclass(frozen=True, eq=False, repr=False)
class LegStrides(ShortRepr):
    """Strides of a leg.

    Attributes:
        leg: its name.
        joint: joint whose extremes are used.
        begins: s, begin of its strides: the joint is foremost or, if its direction is unknown, at
            its largest angle, or the foot touches down; shape (n,).
        periods: s, shape (n,).
        retractions: s, from foremost to hindmost, or in stance, shape (n,); nan if the direction
            is unknown.
        range: of the joint in the mean cycle, rad.
        reason: why retraction and protraction cannot be distinguished, or ''.
        by_contacts: whether the strides are those of the foot's contacts, not of the joint.

    """

    leg: str
    joint: str
    begins: np.ndarray
    periods: np.ndarray
    retractions: np.ndarray
    range: float  # noqa: A003
    reason: str = ''
    by_contacts: bool = False

    def _summary(self) -> str:
        by = 'loads' if self.by_contacts else self.joint
        return f'{self.leg}: {len(self.begins)} strides by {by}'

    @property
    def protractions(self) -> np.ndarray:
        """Durations of the forward strokes, or in swing, s, shape (n,)."""
        return self.periods - self.retractions

    @property
    def fractions(self) -> np.ndarray:
        """Fractions of the retractions in their strides, shape (n,)."""
        return self.retractions / self.periods


def leg_strides(recording: Recording, legs: Mapping[str, Sequence[str]], stride: Stride
                ) -> list[LegStrides]:
    """Find the strides of every leg within the steady stretch of a recording.

    Args:
        recording: of the joints.
        legs: leg -> its joints.
        stride: the recording's, as `find_stride` returns it.

    """
    inside = (recording.times >= stride.begin) & (recording.times <= stride.end)
    times = recording.times[inside]
    phases = stride.warp(times)
    coefficients = np.fft.rfft(stride.mean, axis=1).T[:HARMONICS + 1] / stride.mean.shape[1]
    c = dict(zip(stride.joints, coefficients.T, strict=True))
    contacts = stride.contacts
    if contacts is not None and not set(stride.phases) <= set(contacts.legs):
        contacts = None
    strides = []
    for leg in stride.phases:
        names = [name for name in legs[leg] if name in c]
        joint, sense, reason = _leading(names, c)
        x = sense * recording.positions[inside, recording.joints.index(joint)]
        span = float(np.ptp(evaluate_coefficients(c[joint][:, None], np.arange(POINTS) / POINTS)))
        if contacts is not None:
            begins, periods, stances = contacts.strides(leg).T
            strides.append(LegStrides(leg, joint, begins, periods, stances, span, '', True))
            continue
        fore = _extremes(times, phases, x, sense * c[joint], 1.0)
        hind = None if reason else _extremes(times, phases, x, sense * c[joint], -1.0)
        rows = _strides(fore, hind)
        # Copies of one stride are one stride.
        begins, periods, liftoffs = rows[:1 if stride.cycles == 1 else None].T
        strides.append(LegStrides(leg, joint, begins, periods, liftoffs, span, reason))
    return strides


def _words(name: str) -> set[str]:
    return set(role_of(name).split())


def _leading(names: Sequence[str], c: Mapping[str, np.ndarray]) -> tuple[str, float, str]:
    """Return the joint to use, its direction of protraction, and why that is unknown."""
    def strongest(listed: Sequence[str]) -> str:
        return max(listed, key=lambda name: float(np.abs(c[name][1])))

    upper = [name for name in names if _words(name) & PROXIMAL]
    lower = [name for name in names if _words(name) & DISTAL]
    joint = strongest(upper or names)
    if not upper:
        return joint, 1.0, f'no joint of {", ".join(names)} is called like a hip'
    if not lower:
        return joint, 1.0, f'no joint of {", ".join(names)} is called like a knee'
    bending = strongest(lower)
    theta = np.arange(POINTS) / POINTS
    x, y = evaluate_coefficients(np.column_stack([c[joint], c[bending]]), theta)
    size, mean = float(np.std(y)), float(np.mean(y))
    # It is bent far for a short time; where it is bent evenly, its zero is where it is straight.
    skewness = float(np.mean((y - mean)**3)) / size**3 if size else 0.0
    if abs(skewness) < MIN_SKEWNESS and (abs(mean) < MIN_MEAN_RATIO * size or not size):
        return joint, 1.0, f'the direction in which {bending} bends is unknown'
    bend = np.sign(skewness if abs(skewness) >= MIN_SKEWNESS else mean) * y
    # From its smallest to its largest angle the joint rises.
    smallest, largest = theta[np.argmin(x)], theta[np.argmax(x)]
    rising = (theta - smallest) % 1.0 < (largest - smallest) % 1.0
    more = float(bend[rising].mean() - bend[~rising].mean())
    if abs(more) < MIN_BEND_DIFFERENCE * size:
        return joint, 1.0, f'{bending} is bent as much in one stroke of {joint} as in the other'
    return joint, float(np.sign(more)), ''


def _extremes(times: np.ndarray, phases: np.ndarray, x: np.ndarray, c: np.ndarray, side: float
              ) -> np.ndarray:
    """Return the times of a joint's maxima (side 1) or minima (-1), and phases, shape (k, 2)."""
    theta = np.arange(POINTS) / POINTS
    peak = float(theta[np.argmax(side * evaluate_coefficients(c[:, None], theta)[0])])
    extremes = []
    for k in range(int(np.floor(phases[0] - peak)), int(np.ceil(phases[-1] - peak)) + 1):
        nearby = (np.abs(phases - peak - k) <= SEARCH_RANGE + FIT_HALF_WIDTH) & np.isfinite(x)
        at = _summit(phases[nearby], side * x[nearby], peak + k)
        if at is not None:
            extremes.append((float(np.interp(at, phases, times)), at))
    return np.array(extremes).reshape(-1, 2)


def _summit(phases: np.ndarray, x: np.ndarray, guess: float) -> float | None:
    """Return where two half parabolas that meet at their vertex fit best, or None.

    The strokes on either side of an extreme have different durations, so its sides have different
    slopes: a vertex of a symmetric fit, and a mean of unequal strides, are biased towards the
    slower stroke.
    """
    candidates = guess + np.linspace(-SEARCH_RANGE, SEARCH_RANGE, NUM_CANDIDATES)
    misfits = np.full(NUM_CANDIDATES, np.inf)
    for k, at in enumerate(candidates):
        nearby = np.abs(phases - at) <= FIT_HALF_WIDTH
        before, after = (nearby & (phases < at)).sum(), (nearby & (phases > at)).sum()
        if min(before, after) < MIN_SIDE_SAMPLES:
            continue
        off = phases[nearby] - at
        rows = np.column_stack([np.ones(off.size), np.minimum(off, 0.0)**2,
                                np.maximum(off, 0.0)**2])
        coefficients = np.linalg.lstsq(rows, x[nearby])[0]
        if max(coefficients[1:]) < 0.0:
            misfits[k] = np.mean((rows @ coefficients - x[nearby])**2)
    k = int(np.argmin(misfits))
    if not 0 < k < NUM_CANDIDATES - 1 or not np.isfinite(misfits[k - 1:k + 2]).all():
        return None
    low, middle, high = misfits[k - 1:k + 2]
    bend = low - 2.0 * middle + high
    between = 0.5 * (low - high) / bend if bend > 0.0 else 0.0
    return float(candidates[k] + between * (candidates[1] - candidates[0]))


def _strides(fore: np.ndarray, hind: np.ndarray | None) -> np.ndarray:
    """Return begin, period and retraction of strides with all of their extremes, s, shape (n, 3).

    Without hindmost instants all retractions are nan.
    """
    rows = []
    for (begin, phase), (end, following) in pairwise(fore):
        if following - phase >= 1.5:
            continue
        if hind is None:
            rows.append((begin, end - begin, np.nan))
        elif len(between := hind[(hind[:, 0] > begin) & (hind[:, 0] < end)]) == 1:
            rows.append((begin, end - begin, between[0, 0] - begin))
    return np.array(rows).reshape(-1, 3)


# The strides of a recording as tables: each stride, each leg, and left against right.

#: MIN_STRIDES: of a leg, for a scatter.
MIN_STRIDES = 3
#: QUANTITIES: name from joints, name from contacts, attribute of LegStrides, and format of each.
QUANTITIES = (('stride [s]', 'stride [s]', 'periods', '.4f'),
              ('retraction [s]', 'stance [s]', 'retractions', '.4f'),
              ('protraction [s]', 'swing [s]', 'protractions', '.4f'),
              ('retracted', 'duty', 'fractions', '.3f'))
Rows = list[tuple[str, ...]]


def strides_of(result: RecordingFit) -> list[LegStrides]:
    """Return the strides of every leg of an inverted recording."""
    return leg_strides(result.recording, result.legs, result.stride)


def _names(legs: list[LegStrides]) -> list[str]:
    return [names[legs[0].by_contacts] for *names, _, _ in QUANTITIES]


def every_stride(legs: list[LegStrides]) -> Rows:
    """Return rows of the strides, leg by leg, with a head; empty cells where unknown."""
    rows: Rows = [('leg', 'number', 'begin [s]', *_names(legs))]
    for leg in legs:
        for k, begin in enumerate(leg.begins):
            values = [(getattr(leg, attribute)[k], form) for *_, attribute, form in QUANTITIES]
            rows.append((leg.leg, str(k + 1), f'{begin:.4f}',
                         *(_format(value, form) for value, form in values)))
    return rows


def by_leg(legs: list[LegStrides]) -> Rows:
    """Return rows of means and standard deviations, and the period's coefficient of variation."""
    rows: Rows = [('leg', 'strides', *_names(legs), 'variation of strides',
                   'range [rad]', 'by')]
    for leg in legs:
        cells = []
        for *_, attribute, form in QUANTITIES:
            values = getattr(leg, attribute)
            finite = len(values) > 0 and np.isfinite(values).all()
            cells.append('cannot tell' if not finite else f'{values.mean():{form}}' + (
                f' +- {values.std(ddof=1):{form}}' if len(values) >= MIN_STRIDES else ''))
        scatter = (f'{leg.periods.std(ddof=1) / leg.periods.mean():.1%}'
                   if len(leg.periods) >= MIN_STRIDES else f'fewer than {MIN_STRIDES}')
        rows.append((leg.leg, str(len(leg.begins)), *cells, scatter, f'{leg.range:.3f}',
                     'contacts' if leg.by_contacts else leg.joint))
    return rows


def gait_summary(result: RecordingFit, legs: list[LegStrides]) -> Rows:
    """Return the rows of a gait laboratory's report: quantity and value, with a head."""
    periods = np.concatenate([leg.periods for leg in legs])
    stride, contacts = result.stride, result.stride.contacts
    scatter = f' +- {periods.std(ddof=1):.3f}' if len(periods) >= MIN_STRIDES else ''
    rows: Rows = [
        ('quantity', 'value'),
        ('cadence [steps/min]', f'{120.0 * stride.frequency:.1f}') if len(legs) == 2 else
        ('stride rate [strides/min]', f'{60.0 * stride.frequency:.1f}'),
        ('stride time [s]', f'{1.0 / stride.frequency:.3f}{scatter}')]
    for leg in legs:
        percent = 100.0 * leg.fractions
        if len(percent) and np.isfinite(percent).all():
            names = ('stance', 'swing') if leg.by_contacts else ('retraction', 'protraction')
            rows += [(f'{name} of {leg.leg} [% of stride]', f'{value:.1f}') for name, value in zip(
                names, (percent.mean(), 100.0 - percent.mean()), strict=True)]
        else:
            rows.append((f'retraction of {leg.leg} [% of stride]', 'cannot tell'))
    if contacts is None:
        rows.append(('stance, swing, double support', 'not known without contacts of the feet'))
    elif len(legs) == 2:
        rows.append(('double support [% of stride]',
                     f'{100.0 * float(contacts.down.all(axis=1).mean()):.1f}'))
    if contacts is not None:
        rows.append(('flight [% of stride]', f'{100.0 * contacts.flight:.1f}'))
    rows += _travel(result)
    return rows


def _travel(result: RecordingFit) -> Rows:
    """Return the rows of stride length and speed, by the way of the body over the stretch."""
    recording, stride = result.recording, result.stride
    if recording.body is None or recording.cycle:
        return [('stride length', 'not known: joint angles do not tell how far the body travels')]
    inside = (recording.times >= stride.begin) & (recording.times <= stride.end)
    first, *_, last = recording.body[inside, :2]
    length = float(np.linalg.norm(last - first)) / stride.warp.cycles
    if length < MIN_TRAVEL:
        return [('stride length', 'not known: the body stays where it is, as on a treadmill')]
    return [('stride length [m]', f'{length:.3f}'),
            ('speed [m/s]', f'{length * stride.frequency:.3f}')]


def ranges(result: RecordingFit) -> Rows:
    """Return rows of the joints' mean cycles in degrees, with a head."""
    stride = result.stride
    rows: Rows = [('joint', 'least [deg]', 'largest [deg]', 'range [deg]',
                   'scatter of strides [deg]')]
    for name, mean, spread in zip(stride.joints, np.degrees(stride.mean),
                                  np.degrees(stride.spread), strict=True):
        scatter = f'{spread.mean():.1f}' if stride.cycles > 1 else 'one stride'
        rows.append((name, f'{mean.min():.1f}', f'{mean.max():.1f}', f'{np.ptp(mean):.1f}',
                     scatter))
    return rows


def normalised(result: RecordingFit, legs: list[LegStrides]
               ) -> list[tuple[str, str, np.ndarray, np.ndarray]]:
    """Return the joints' mean cycles from the begin of their leg's stride.

    Returns:
        For each joint its leg, its name, and the angle and its standard deviation at the phases of
            the mean cycle, deg, shape (m,).

    """
    stride, curves = result.stride, []
    for leg in legs:
        if not len(leg.begins):
            continue
        # The mean of phases that lie round the seam.
        begin = np.angle(np.exp(2j * np.pi * stride.warp(leg.begins)).mean()) / (2.0 * np.pi)
        for name in result.legs[leg.leg]:
            if name in stride.joints:
                k = stride.joints.index(name)
                mean, spread = (np.interp(stride.theta + begin, stride.theta, row[k], period=1.0)
                                for row in (stride.mean, stride.spread))
                curves.append((leg.leg, name, np.degrees(mean), np.degrees(spread)))
    return curves


def symmetry(legs: list[LegStrides]) -> Rows:
    """Return rows of the symmetry index of left and right legs, in percent; a head alone for none.

    100 (left - right) / ((left + right) / 2), of the means (Robinson, Herzog & Nigg 1987): 0 where
    both sides are alike.
    """
    rows: Rows = [('left - right', *_names(legs), 'range')]
    by_leg = {strides.leg: strides for strides in legs}
    for leg, strides_left in by_leg.items():
        right = by_leg.get('right' if leg == 'left' else 'r' + leg[1:])
        if right is None or not leg.startswith('l'):
            continue
        pairs = [(_mean(getattr(strides_left, attribute)), _mean(getattr(right, attribute)))
                 for *_, attribute, _ in QUANTITIES]
        rows.append((f'{leg} - {right.leg}', *(
            'cannot tell' if not a + b > 0.0 else f'{200.0 * (a - b) / (a + b):+.1f} %'
            for a, b in [*pairs, (strides_left.range, right.range)])))
    return rows


def notes(legs: list[LegStrides], contacts: FootContacts | None = None) -> list[str]:
    """Return the basis of the strokes, one line each."""
    by_angles = [strides.leg for strides in legs if not strides.reason and not strides.by_contacts]
    lines = [f'{strides.leg}: cannot tell retraction from protraction: {strides.reason}'
             for strides in legs if strides.reason]
    if contacts is not None and legs[0].by_contacts:
        lines.insert(0, f'stance and swing are those of {contacts.source}: strides begin with a '
                     'touchdown')
    if by_angles:
        lines.insert(0, f'{", ".join(by_angles)}: a leg is retracted from the foremost to the '
                     'hindmost angle of the joint named, and then protracted; contacts are not '
                     'known, and stance is often shorter')
    return lines


def as_csv(result: RecordingFit) -> str:
    """Return every stride as a CSV file."""
    out = io.StringIO()
    csv.writer(out, lineterminator='\n').writerows(every_stride(strides_of(result)))
    return out.getvalue()


def _mean(values: np.ndarray) -> float:
    return float(values.mean()) if len(values) else float('nan')


def _format(value: float, form: str) -> str:
    return f'{value:{form}}' if np.isfinite(value) else ''
