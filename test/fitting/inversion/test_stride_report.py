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

"""Tables of strides, against strides that are written down."""

import csv

from cpg_ros.fitting.inversion.inversion import main
from cpg_ros.fitting.inversion.stride_report import (
    by_leg,
    every_stride,
    LegStrides,
    notes,
    symmetry,
)
import numpy as np
import pytest
from skeletons import angles

LEFT = LegStrides('left', 'left_hip', np.array([0.0, 1.0, 2.1]), np.array([1.0, 1.1, 0.9]),
                  np.array([0.6, 0.66, 0.54]), 0.8)
RIGHT = LegStrides('right', 'right_hip', np.array([0.5, 1.5]), np.array([1.0, 1.0]),
                   np.array([0.5, 0.5]), 0.4)
BLIND = LegStrides('right', 'right_hip', RIGHT.begins, RIGHT.periods, np.full(2, np.nan), 0.4,
                   'no knee')


def test_means_scatter_and_symmetry():
    head, left, right = by_leg([LEFT, RIGHT])
    assert left == ('left', '3', '1.0000 +- 0.1000', '0.6000 +- 0.0600', '0.4000 +- 0.0400',
                    '0.600 +- 0.000', '10.0%', '0.800', 'left_hip')
    # Two strides have no scatter.
    assert right[2:7] == ('1.0000', '0.5000', '0.5000', '0.500', 'fewer than 3')
    assert len(head) == len(left)
    # 0.6 against 0.5, of their mean: 18.2 %; 0.8 against 0.4: 66.7 %.
    assert symmetry([LEFT, RIGHT])[1] == ('left - right', '+0.0 %', '+18.2 %', '-22.2 %',
                                          '+18.2 %', '+66.7 %')
    fore = [LegStrides(leg, '', *[one] * 3, 0.5) for leg in ('lh', 'rh', 'lf', 'rf')
            for one in [np.ones(2)]]
    assert [row[0] for row in symmetry(fore)[1:]] == ['lh - rh', 'lf - rf']
    assert every_stride([LEFT])[2] == ('left', '2', '1.0000', '1.1000', '0.6600', '0.4400',
                                       '0.600')


def test_what_cannot_be_told_is_said_or_left_empty():
    assert by_leg([BLIND])[1][2:6] == ('1.0000', 'cannot tell', 'cannot tell', 'cannot tell')
    assert symmetry([LEFT, BLIND])[1][2:4] == ('cannot tell', 'cannot tell')
    assert every_stride([BLIND])[1][4:] == ('', '', '')
    assert notes([LEFT, BLIND])[1] == 'right: cannot tell retraction from protraction: no knee'
    assert notes([LEFT])[0].startswith('left: a leg is retracted from the foremost')


def test_the_tool_writes_the_table_and_the_page(tmp_path, capsys):
    time = np.arange(800) / 100.0
    path, out, page = (tmp_path / name for name in ('walk.csv', 'strides.csv', 'page.html'))
    np.savetxt(path, np.column_stack([time, angles(time)]), delimiter=',', comments='',
               header='time,left_hip,left_knee,left_ankle,right_hip,right_knee,right_ankle')
    command = ['--csv', str(path), '--network', 'phase', '--gait', 'walk', '--report']
    assert main([*command, str(out)]) == 0
    rows = list(csv.DictReader(out.open()))
    assert {row['leg'] for row in rows} == {'left', 'right'} and len(rows) >= 12
    # The hip is a cosine of 1.1 Hz: foremost and hindmost half a stride apart.
    for row in rows:
        assert float(row['stride [s]']) == pytest.approx(1.0 / 1.1, abs=2e-3)
        assert float(row['retracted']) == pytest.approx(0.5, abs=5e-3)
    assert main([*command, str(page)]) == 0
    assert all(words in page.read_text() for words in (
        '<h2>Strides</h2>', 'Symmetry index', 'Every stride', 'left - right'))
    # What a gait laboratory reads comes first: 1.1 strides, 2.2 steps a second.
    text = page.read_text()
    assert text.index('cadence [steps/min]') < text.index('<h2>Parameters</h2>')
    assert '>132.0<' in text and '>0.909 +-' in text
    assert 'not known without contacts of the feet' in text
    printed = capsys.readouterr().out
    assert printed.index('cadence [steps/min]') < printed.index('parameter')
    assert main([*command, str(tmp_path / 'strides.xls')]) == 2
    assert 'does not end in .html or .csv' in capsys.readouterr().err


def test_stance_swing_and_double_support_are_those_of_loads(tmp_path, capsys):
    # Each foot stands 60 % of the stride, half a stride apart: both do in 20 % of it.
    time = np.arange(800) / 100.0
    flexions = angles(time)
    loads = [((1.1 * time + phase) % 1.0 < 0.6).astype(float) for phase in (0.0, 0.5)]
    path = tmp_path / 'walk.csv'
    np.savetxt(path, np.column_stack([time, flexions, *loads]), delimiter=',', comments='',
               header='time,left_hip,left_knee,left_ankle,right_hip,right_knee,right_ankle,'
                      'left_contact,right_contact')
    assert main(['--csv', str(path), '--network', 'phase', '--gait', 'walk']) == 0
    rows = dict(line.rsplit(maxsplit=1) for line in capsys.readouterr().out.splitlines()
                if '[% of stride]' in line)
    for name, percent in (('stance of left', 60.0), ('swing of right', 40.0),
                        ('double support', 20.0), ('flight', 0.0)):
        assert float(rows[f'{name} [% of stride]']) == pytest.approx(percent, abs=1.5)
