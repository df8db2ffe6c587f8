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

"""CSV files, against numbers that were printed into them."""

from cpg_ros.fitting.recordings.csv_reader import read_csv
from cpg_ros.fitting.recordings.formats import read_recording
from cpg_ros.fitting.recordings.recording import RecordingError
from depth import examples
from hypothesis import given
from hypothesis import strategies as st
import numpy as np
import pytest


@pytest.fixture
def write(tmp_path):
    def to_file(text, name='walk.csv'):
        path = tmp_path / name
        path.write_bytes(text if isinstance(text, bytes) else text.encode())
        return path
    return to_file


def refused(path, **options):
    with pytest.raises(RecordingError) as error:
        read_csv(path, **options)
    message = str(error.value)
    assert '\n' not in message
    assert message.startswith(f'{path}')
    return message[len(str(path)):]


@given(rows=st.lists(st.lists(st.floats(-1e3, 1e3) | st.just(float('nan')), min_size=3,
                              max_size=3), min_size=2, max_size=20),
       delimiter=st.sampled_from(',;\t'), end=st.sampled_from(('\n', '\r\n')),
       empty=st.booleans())
@examples(80)
def test_numbers_come_back_as_they_were_printed(rows, delimiter, end, empty, tmp_path_factory):
    path = tmp_path_factory.mktemp('tables') / 'walk.csv'
    lines = [delimiter.join(('time', 'lf_hip', 'lf_knee', 'rf_hip'))]
    for k, row in enumerate(rows):
        cells = ['' if empty and np.isnan(value) else repr(value) for value in row]
        lines.append(delimiter.join((f'{10.0 + 0.004 * k:.3f}', *cells)))
    path.write_text(end.join(lines) + end, newline='')
    table = np.array(rows)
    heard = ~np.isnan(table).all(axis=1)
    if np.isnan(table).all(axis=0).any() or heard.sum() < 2:
        refused(path)
        return
    recording = read_csv(path)
    assert recording.joints == ('lf_hip', 'lf_knee', 'rf_hip')
    assert np.array_equal(recording.positions, table[heard], equal_nan=True)
    times = 0.004 * np.flatnonzero(heard)
    assert np.allclose(recording.times, times - times[0], rtol=0.0, atol=1e-12)
    assert recording.start == pytest.approx(10.0 + times[0], abs=1e-12)


def test_units_are_declared_by_headers_or_options(write):
    text = '{},hip [deg],knee (rad),ankle\n0,180,1,90\n{},360,2,180\n'
    for header, step, options in (('time', '0.5', {}), ('Time(s)', '0.5', {}),
                                  ('t [ms]', '500', {}), ('time_ms', '500', {}),
                                  ('stamp', '500', {'time': 'ms'}),
                                  ('timestamp', '500000000', {'time': 'ns'})):
        recording = read_csv(write(text.format(header, step)), **options)
        assert recording.times.tolist() == [0.0, 0.5]
        assert np.allclose(recording.positions, [[np.pi, 1.0, 90.0], [2 * np.pi, 2.0, 180.0]])
        assert recording.joints == ('hip', 'knee', 'ankle')
    plain = write('time,hip,knee\n0,180,90\n1,360,180\n')
    assert np.allclose(read_csv(plain, unit='deg').positions, [[np.pi, np.pi / 2],
                                                               [2 * np.pi, np.pi]])
    assert ": column 'hip [deg]' is in deg, not rad" in refused(
        write(text.format('time', '1')), unit='rad')
    assert ": column 'time_ms' is in ms, not s" in refused(
        write(text.format('time_ms', '1')), time='s')
    assert ": unit 'grad' is none of" in refused(plain, unit='grad')


GO1 = ('Time(s),FR_Force,BaseAx,JointPosFR_hip,JointPosFR_thigh,JointPosFL_hip\n'
       '42.5811,1,0.08,-0.16,0.97,0.18\n42.5836,0,0.49,-0.15,0.96,0.17\n')


def test_columns_of_positions_are_the_joints_among_others(write):
    recording = read_csv(write(GO1))
    assert recording.joints == ('FR_hip', 'FR_thigh', 'FL_hip')
    assert recording.positions.tolist() == [[-0.16, 0.97, 0.18], [-0.15, 0.96, 0.17]]
    assert recording.times[1] == pytest.approx(0.0025, abs=1e-12)
    assert recording.start == 42.5811
    assert recording.notes == ("2 columns left out: 'FR_Force', 'BaseAx'",)


def test_loads_on_feet_are_no_joints_and_are_kept(write):
    path = write('time,LFHip,RFHip,LF_contact,RF_contact,LF_force_x,LH_force [N],torso_yaw\n'
                 '3.0,0.1,0.2,True,0,9,40.5,1\n3.5,0.3,0.4,False,1,9,41.5,2\n'
                 '4.0,0.3,0.4,,1,9,41.5,2\n4.5,0.3,0.4,true,1,9,2,2\n')
    recording = read_csv(path)
    assert recording.joints == ('LFHip', 'RFHip', 'LF_force_x', 'torso_yaw')
    assert recording.loads.legs == ('LF_contact', 'RF_contact', 'LH_force')
    # A line without one of them says nothing.
    assert recording.loads.times.tolist() == [0.0, 0.5, 1.5]
    assert recording.loads.loads.tolist() == [[1, 0, 40.5], [0, 1, 41.5], [1, 1, 2]]
    assert "taken for loads on the feet: 'LF_contact', 'RF_contact'" in recording.notes[0]


def test_columns_are_chosen_by_name_or_pattern(write):
    path = write(GO1)
    assert read_csv(path, joints=['FL_hip', 'FR_hip']).joints == ('FL_hip', 'FR_hip')
    assert read_csv(path, joints=['JointPosFL_hip']).joints == ('FL_hip',)
    assert read_csv(path, joints=['*_hip']).joints == ('FR_hip', 'FL_hip')
    assert read_csv(path, joints=['JointPosFR*', 'BaseAx']).joints == (
        'FR_hip', 'FR_thigh', 'BaseAx')
    assert refused(path, joints=['LH_*']).startswith(": no column 'LH_*'; there are 'FR_Force'")


def test_tables_of_plotjuggler(write):
    path = write('__time,/joint_states/lf_hip/position,/joint_states/lf_hip/velocity,'
                 '/joint_states/rf_hip/position\n1.0,0.1,5.0,0.2\n1.5,0.3,6.0,0.4\n')
    recording = read_csv(path)
    assert recording.joints == ('lf_hip', 'rf_hip')
    assert recording.positions.tolist() == [[0.1, 0.2], [0.3, 0.4]]


TIMES = 1_700_000_000_123_456_789 + 4_000_000 * np.arange(30)
ANGLES = np.sin(0.2 * np.arange(30)[:, None] + np.arange(2))


def rows(line):
    """Return lines of a table: of each, its number, the stamp in ns and the angles as text."""
    return ''.join(line(k, int(when), *(f'{x:.6f}' for x in row)) + '\n'
                   for k, (when, row) in enumerate(zip(TIMES, ANGLES, strict=True)))


def stamp(when):
    return f'{when // 10**9},{when % 10**9}'


@pytest.mark.parametrize('text', [
    # ros2 topic echo --csv has no header.
    rows(lambda k, t, a, b: f'{stamp(t)},,lf_hip,rf_hip,{a},{b},0.5,0.5,'),
    ',header.stamp.sec,header.stamp.nanosec,lf_hip,rf_hip\n'
    + rows(lambda k, t, a, b: f'{k},{stamp(t)},{a},{b}'),
    # The message's stamp counts, not when it was received.
    'receive_time,log_time,header.stamp.sec,header.stamp.nsec,lf_hip,rf_hip\n'
    + rows(lambda k, t, a, b: f'{t / 1e9 + 0.01 * (k % 3)},7,{stamp(t)},{a},{b}'),
], ids=['echo', 'pandas', 'foxglove'])
def test_stamps_in_whole_seconds_and_nanoseconds(write, text):
    recording = read_csv(write(text))
    assert recording.joints == ('lf_hip', 'rf_hip')
    assert recording.times.tolist() == ((TIMES - TIMES[0]) / 1e9).tolist()
    assert recording.positions == pytest.approx(ANGLES, abs=1e-6)


TABLE = 'time,lf_hip,rf_hip\n' + rows(lambda k, t, a, b: f'{0.004 * k:.3f},{a},{b}')


@pytest.mark.parametrize('text', [
    'Exported by Nexus\nSubject,Anna\nrate [Hz],250\n\n' + TABLE,
    TABLE.encode('utf-16'),
    TABLE.replace('time', 'Zeit').replace(',', ';').replace('.', ','),
    # What Foxglove's plots and data frames have: a line for each value.
    'elapsed time,receive time,topic,value\n' + rows(
        lambda k, t, a, b: f'{0.004 * k:.3f},7,lf_hip,{a}\n{0.004 * k:.3f},7,rf_hip,{b}'),
    'time,joint,position\n' + rows(lambda k, t, a, b: f'{0.004 * k:.3f},lf_hip,{a}')
    + rows(lambda k, t, a, b: f'{0.004 * k:.3f},rf_hip,{b}'),
    '__time,/joint_states/lf_hip/position,/imu/x,/joint_states/rf_hip/position\n' + rows(
        lambda k, t, a, b: f'{0.004 * k:.3f},{a},,{b}\n{0.004 * k + 0.001:.3f},,5,'),
], ids=['preamble', 'utf-16', 'german', 'foxglove plot', 'tidy', 'plotjuggler'])
def test_tables_as_programs_write_them(write, text):
    recording = read_csv(write(text))
    assert recording.joints == ('lf_hip', 'rf_hip')
    assert recording.times == pytest.approx(0.004 * np.arange(30))
    assert recording.positions == pytest.approx(ANGLES, abs=1e-6)


def test_positions_without_names_are_those_of_a_robot_file(write):
    path = write('t,position[0],position[1],velocity[0]\n' + rows(
        lambda k, t, a, b: f'{0.004 * k:.3f},{a},{b},0'))
    recording = read_recording(path, robot_joints=['lf_hip', 'rf_hip'])
    assert recording.joints == ('lf_hip', 'rf_hip')
    assert 'in the order of the robot file' in recording.notes[-1]
    with pytest.raises(RecordingError, match='2 positions without names, where the robot file'):
        read_recording(path, robot_joints=['lf_hip', 'rf_hip', 'lh_hip'])


@pytest.mark.parametrize('name', ['dof_pos_{}', 'joint_pos_{}', 'q{}', 'dof_pos[{}]'])
def test_positions_numbered_by_a_simulator_are_those_of_a_robot_file(write, name):
    path = write(f't,{name},{name},dof_vel_0\n'.format(0, 1) + rows(
        lambda k, t, a, b: f'{0.004 * k:.3f},{a},{b},7'))
    recording = read_recording(path, robot_joints=['lf_hip', 'rf_hip'])
    assert recording.joints == ('lf_hip', 'rf_hip')
    assert recording.positions == pytest.approx(ANGLES, abs=1e-6)
    assert read_csv(path).joints == tuple(name.format(k) for k in (0, 1))


@pytest.mark.parametrize(('begin', 'zone'), [('2026-11-29T19:34:07', 'Z'),
                                            ('2026-11-29 19:34:07', ''),
                                            ('2026-11-29T20:34:07', '+01:00')])
def test_dates_are_times(write, begin, zone):
    recording = read_csv(write('timestamp,lf_hip,rf_hip\n' + rows(
        lambda k, t, a, b: f'{begin}.{4 * k:03d}{zone},{a},{b}')))
    assert recording.times == pytest.approx(0.004 * np.arange(30), abs=1e-6)
    assert recording.start == pytest.approx(1795980847.0, abs=1e-6)
    assert recording.positions == pytest.approx(ANGLES, abs=1e-6)
    # A date is a time, but no angle, and not in ms.
    text = f't,knee\n0,1\n1,{begin}\n'
    assert refused(write(text)) == f", line 3, column 'knee': {begin!r} is not a number"
    assert 'is not a number' in refused(write(f't,knee\n{begin},1\n'), time='ms')


def test_names_that_change_in_an_echo_are_refused_by_line(write):
    text = rows(lambda k, t, a, b: f'{stamp(t)},,{"lf,rf" if k < 9 else "rf,lf"},{a},{b}')
    assert refused(write(text)) == ", line 10: joint 'rf', where the first line has 'lf'"


def test_other_units_are_no_joints(write):
    recording = read_csv(write('time [s],knee [rad],torque [Nm],speed [rad/s]\n'
                               '0,0.1,5,6\n1,0.2,7,\n'))
    assert recording.joints == ('knee',)
    assert recording.notes == ("2 columns left out: 'torque [Nm]', 'speed [rad/s]'",)


def test_a_text_among_columns_that_are_not_wanted_does_not_matter(write):
    path = write('# time,state,knee\n\n0,"on, slowly",0.1\n1,off,0.2\n\n')
    assert read_csv(path, joints=['knee']).positions.tolist() == [[0.1], [0.2]]


def test_equal_times_are_duplicates(write):
    recording = read_csv(write('t,knee\n0,1\n0,2\n1,3\n'))
    assert recording.positions.tolist() == [[1.0], [3.0]]
    assert recording.notes == ('1 duplicate of a stamp, the first is kept',)


def test_many_lines_are_read_in_parts(write):
    rows = np.column_stack([0.002 * np.arange(20_000), np.sin(0.01 * np.arange(20_000))])
    text = 'time,knee\n' + '\n'.join(f'{time:.3f},{angle!r}' for time, angle in rows.tolist())
    recording = read_csv(write(text))
    assert np.array_equal(recording.positions[:, 0], rows[:, 1])
    lines = text.split('\n')
    lines[15_000] = 'a,b'
    assert refused(write('\n'.join(lines))) == ", line 15001, column 'time': 'a' is not a number"
    lines[15_000] = '0.5,0.1'
    assert refused(write('\n'.join(lines))) == (
        ", line 15001, column 'time': time goes back from 29.996 to 0.5 s")


@pytest.mark.parametrize(('text', 'message'), [
    ('', ': the file is empty'),
    ('\n \n', ': the file is empty'),
    ('time,knee\n', ': no samples'),
    ('time,knee\n\n\n', ': no samples'),
    ('time,knee\n0,0.1\n1,fast\n', ", line 3, column 'knee': 'fast' is not a number"),
    ('time,knee\n0,0.1\nlater,0.1\n', ", line 3, column 'time': 'later' is not a number"),
    ('time;knee\n0,1;0.5\n', ", line 2, column 'time': '0,1' is not a number"),
    ('time,knee\n0,0.1\n\n1,0.1,7\n', ', line 4: 3 columns, where the header has 2'),
    ('time,hip,knee\n0,0.1,0.2\n1,0.1\n', ', line 3: 2 columns, where the header has 3'),
    ('time,hip,knee\n0,0.1\n1,0.1\n', ', line 2: 2 columns, where the header has 3'),
    ('0,0.1\n1,0.2\n', ', line 1: no header; the first line has to name the columns'),
    ('hip,knee\n0,0.1\n', ", line 1: no time column, such as 'time' or 'time [ms]'; "
                          "the columns are 'hip', 'knee'"),
    ('t,time,knee\n0,0,0.1\n', ", line 1: 2 time columns, 't', 'time'"),
    ('time\n0\n', ", line 1: one column only, 'time'; a table has a time column and one per "
                  'joint'),
    ('time,force [N]\n0,0.1\n', ', line 1: no column of angles'),
    ('time,knee,knee\n0,1,2\n', ", line 1: joint 'knee' is named twice"),
    ('time,knee\n0,1\n2,1\n\n1,1\n', ", line 5, column 'time': time goes back from 2 to 1 s"),
    ('time,knee\n0,1\n,1\n', ", line 3, column 'time': no time"),
    ('time,knee\n0,1\ninf,1\n', ", line 3, column 'time': no time"),
    ('time,knee\n1700000000000,1\n', ", line 2, column 'time': 1.7e+12 s is not a plausible "
                                     'time; if it is in ms, us or ns, declare the unit'),
    ('time,knee\n0,0.1\n', ': 1 sample, all at stamp 0.000000000 s: no time passes'),
    ('time,knee\n3,0.1\n3,0.2\n', ': 2 samples, all at stamp 3.000000000 s: no time passes'),
    ('time,hip,knee\n0,1,\n1,1,nan\n', ": no finite position of joint 'knee' in 2 samples; name "
                                       'the joints to take to do without'),
    (b'time,knee\n0,\0\n1,2\n', ', line 2: not a text file (a byte 0)'),
    (b'\x7fELF\0\0\1', ', line 1: not a text file (a byte 0)'),
    (b'time,knee\n0,\xff\xfe\n', ': not a text file (invalid start byte)'),
    ('time,"knee\n0,1\n', ', line 1: unexpected end of data'),
])
def test_damaged_tables_are_refused_by_line_and_column(write, text, message):
    assert refused(write(text)) == message


def test_what_is_no_file(tmp_path):
    assert refused(tmp_path / 'missing.csv') == ': No such file or directory'
    assert refused(tmp_path) == ': Is a directory'


@given(data=st.data())
@examples(150)
def test_scratched_tables_are_read_or_refused(data, tmp_path_factory):
    text = bytearray(b'time,lf_hip [deg],lf_knee\n' + b''.join(
        b'%.3f,%.2f,%.2f\n' % (0.01 * k, k, -k) for k in range(8)))
    for _ in range(data.draw(st.integers(1, 4))):
        text[data.draw(st.integers(0, len(text) - 1))] = data.draw(st.integers(0, 255))
    cut = data.draw(st.integers(0, len(text)))
    path = tmp_path_factory.mktemp('tables') / 'walk.csv'
    path.write_bytes(text[:cut])
    try:
        assert len(read_csv(path).times) >= 2
    except RecordingError as error:
        assert '\n' not in str(error)
