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

"""The strides of a recording as tables: each stride, each leg, and left against right."""

import csv
import io

from cpg_ros.gaits.leg_strides import leg_strides, LegStrides
from cpg_ros.inversion.recording_fit import RecordingFit
import numpy as np

#: Fewest strides of a leg that have a scatter.
FEWEST = 3
#: What is reported of strides: name by joints and by contacts, attribute of LegStrides, format.
QUANTITIES = (('stride [s]', 'stride [s]', 'periods', '.4f'),
              ('retraction [s]', 'stance [s]', 'retractions', '.4f'),
              ('protraction [s]', 'swing [s]', 'protractions', '.4f'),
              ('retracted', 'duty', 'shares', '.3f'))
Rows = list[tuple[str, ...]]


def strides_of(found: RecordingFit) -> list[LegStrides]:
    """Return the strides of every leg of an inverted recording."""
    return leg_strides(found.recording, found.legs, found.stride)


def _names(legs: list[LegStrides]) -> list[str]:
    return [names[legs[0].by_contacts] for *names, _, _ in QUANTITIES]


def every_stride(legs: list[LegStrides]) -> Rows:
    """Rows of the strides, leg by leg, with a head; empty cells where nothing tells."""
    rows: Rows = [('leg', 'number', 'begin [s]', *_names(legs))]
    for one in legs:
        for k, begin in enumerate(one.begins):
            values = [(getattr(one, attribute)[k], form) for *_, attribute, form in QUANTITIES]
            rows.append((one.leg, str(k + 1), f'{begin:.4f}',
                         *(_shown(value, form) for value, form in values)))
    return rows


def by_leg(legs: list[LegStrides]) -> Rows:
    """Rows of means and standard deviations, and the coefficient of variation of the period."""
    rows: Rows = [('leg', 'strides', *_names(legs), 'variation of strides',
                   'range [rad]', 'by')]
    for one in legs:
        cells = []
        for *_, attribute, form in QUANTITIES:
            values = getattr(one, attribute)
            known = len(values) > 0 and np.isfinite(values).all()
            cells.append('cannot tell' if not known else f'{values.mean():{form}}' + (
                f' +- {values.std(ddof=1):{form}}' if len(values) >= FEWEST else ''))
        scatter = (f'{one.periods.std(ddof=1) / one.periods.mean():.1%}'
                   if len(one.periods) >= FEWEST else f'fewer than {FEWEST}')
        rows.append((one.leg, str(len(one.begins)), *cells, scatter, f'{one.range:.3f}',
                     'foot loads' if one.by_contacts else one.joint))
    return rows


def symmetry(legs: list[LegStrides]) -> Rows:
    """Rows of the symmetry index of left and right legs, in percent; a head alone for none.

    100 (left - right) / ((left + right) / 2), of the means (Robinson, Herzog & Nigg 1987): 0 where
    both sides are alike.
    """
    rows: Rows = [('left - right', *_names(legs), 'range')]
    named = {one.leg: one for one in legs}
    for leg, left in named.items():
        right = named.get('right' if leg == 'left' else 'r' + leg[1:])
        if right is None or not leg.startswith('l'):
            continue
        pairs = [(_mean(getattr(left, attribute)), _mean(getattr(right, attribute)))
                 for *_, attribute, _ in QUANTITIES]
        rows.append((f'{leg} - {right.leg}', *(
            'cannot tell' if not a + b > 0.0 else f'{200.0 * (a - b) / (a + b):+.1f} %'
            for a, b in [*pairs, (left.range, right.range)])))
    return rows


def notes(legs: list[LegStrides]) -> list[str]:
    """Return what the strokes rest on, one line each."""
    known = [one.leg for one in legs if not one.why and not one.by_contacts]
    lines = [f'{one.leg}: cannot tell retraction from protraction: {one.why}'
             for one in legs if one.why]
    if legs[0].by_contacts:
        lines.insert(0, 'stance and swing are those of the loads on the feet: strides begin with '
                     'a touchdown')
    if known:
        lines.insert(0, f'{", ".join(known)}: a leg is retracted from the foremost to the '
                     'hindmost angle of the joint named, and then protracted; contacts are not '
                     'known, and stance is often shorter')
    return lines


def as_csv(found: RecordingFit) -> str:
    """Return every stride as a CSV file."""
    out = io.StringIO()
    csv.writer(out, lineterminator='\n').writerows(every_stride(strides_of(found)))
    return out.getvalue()


def _mean(values: np.ndarray) -> float:
    return float(values.mean()) if len(values) else float('nan')


def _shown(value: float, form: str) -> str:
    return f'{value:{form}}' if np.isfinite(value) else ''
