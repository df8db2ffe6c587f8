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

"""Folders of recordings: a row each, resumed by content, whatever is wrong with some."""

from concurrent.futures import ThreadPoolExecutor
import csv
import os
from pathlib import Path
import signal
import subprocess
import sys
import time

from bags import walk, write_bag
from cpg_ros.common.errors import InputError
from cpg_ros.fitting.inversion.many_recordings import FitSettings, Folders
from cpg_ros.fitting.inversion.results import digest, recordings_in
import numpy as np
import pytest

parquet = pytest.importorskip('pyarrow.parquet')
INVERSION = [sys.executable, '-P', '-m', 'cpg_ros.fitting.inversion.inversion']
QUICK = FitSettings(network='delayed', free=('tau',), order=1)


def table(phases=(0.0, 0.5, 0.5, 0.0), frequency=1.5, seed=0):
    """A CSV of hips and knees that swing with these phases of LH RH LF RF."""
    t, rng = np.arange(400) / 50.0, np.random.default_rng(seed)
    columns = {'time': t}
    for leg, phase in zip(('lh', 'rh', 'lf', 'rf'), phases, strict=True):
        turn = 2.0 * np.pi * (frequency * t + phase)
        columns[f'{leg}_hip'] = 0.3 * np.cos(turn) + 0.003 * rng.normal(size=t.size)
        columns[f'{leg}_knee'] = 0.3 * np.sin(turn) - 1.0 + 0.003 * rng.normal(size=t.size)
    rows = [','.join(columns), *(','.join(f'{value:.5f}' for value in row)
                                 for row in zip(*columns.values(), strict=True))]
    return '\n'.join(rows) + '\n'


@pytest.fixture
def folder(tmp_path):
    place = tmp_path / 'in'
    place.mkdir()
    (place / 'trot.csv').write_text(table())
    (place / 'pace.csv').write_text(table((0.0, 0.5, 0.0, 0.5), 2.0))
    (place / 'empty.csv').write_text('')
    (place / 'words.csv').write_text('time,lh_hip\n0,zero\n')
    (place / 'notes.txt').write_text('no recording')
    return place


def invert(folder, out, settings=QUICK):
    with ThreadPoolExecutor(1) as executor:
        return Folders([folder], out, settings, progress=False).run(executor)


def rows_of(out):
    with (out / 'table.csv').open() as file:
        return {Path(row['file']).name: row for row in csv.DictReader(file)}


def bare(out):
    """The table but for the timings."""
    return [{name: value for name, value in row.items() if name != 'seconds'}
            for row in rows_of(out).values()]


def test_a_row_a_recording_and_reasons_for_the_bad_ones(folder, tmp_path):
    out = tmp_path / 'out'
    summary = invert(folder, out)
    assert (summary.done, summary.failed, summary.kept) == (4, 2, 0)
    rows = rows_of(out)
    assert rows['trot.csv']['gait'] == 'trot'
    assert rows['pace.csv']['gait'] == 'pace'
    for name, hertz in (('trot.csv', 1.5), ('pace.csv', 2.0)):
        row = rows[name]
        assert float(row['frequency']) == pytest.approx(hertz, abs=5.0 * float(
            row['frequency_error']))
        assert float(row['delayed.tau.low']) <= float(row['delayed.tau']) <= float(
            row['delayed.tau.high'])
        fitted = out / row['fitted']
        assert str(fitted.with_name(f'{fitted.stem}_robot.yaml')) in fitted.read_text()
    assert 'the file is empty' in rows['empty.csv']['reason']
    assert 'line 2' in rows['words.csv']['reason']
    told = parquet.read_table(out / 'table.parquet').to_pylist()
    assert [row['gait'] for row in told] == [row['gait'] for row in rows.values()]
    assert dict(told[1]['phases'])['rh'] == pytest.approx(0.5, abs=0.01)
    page = (out / 'index.html').read_text()
    assert page.count('<svg') == 2
    assert 'the file is empty' in page


def test_it_goes_on_by_content_and_ends_with_the_same_table(folder, tmp_path):
    out, other = tmp_path / 'out', tmp_path / 'other'
    invert(folder, out)
    before = bare(out)
    (out / 'table.csv').unlink()
    assert invert(folder, out).kept == 4
    assert bare(out) == before
    # As large and as old, but not the same.
    old = (folder / 'trot.csv').stat()
    (folder / 'trot.csv').write_text(table(seed=1))
    os.utime(folder / 'trot.csv', ns=(old.st_atime_ns, old.st_mtime_ns))
    assert invert(folder, out).kept == 3
    assert bare(out) != before
    invert(folder, other)
    assert [{**row, 'fitted': ''} for row in bare(out)] == [
        {**row, 'fitted': ''} for row in bare(other)]
    # Fitted otherwise, all are done again.
    assert invert(folder, out, FitSettings(network='delayed', free=('c',), order=1)).kept == 0


def test_what_was_repaired_or_spoiled_has_its_own_files_only(folder, tmp_path):
    out = tmp_path / 'out'
    invert(folder, out)
    (folder / 'pace.csv').write_text('')
    invert(folder, out)
    assert rows_of(out)['pace.csv']['fitted'] == ''
    assert not list((out / 'fitted').glob('pace*'))


def test_recordings_are_found_split_bags_as_one_and_results_not_at_all(tmp_path):
    write_bag(tmp_path / 'a' / 'bag', walk(20)[0], storage='mcap')
    (tmp_path / 'b').mkdir()
    for name in ('x_0.mcap', 'x_1.mcap'):
        (tmp_path / 'b' / name).write_bytes(b'')
    (tmp_path / 'c').mkdir()
    for name in ('monday.mcap', 'tuesday.mcap', 'walk.csv', 'run.csv.gz', 'ik.mot', '.x.csv'):
        (tmp_path / 'c' / name).write_bytes(b'')
    (tmp_path / 'd').mkdir()
    (tmp_path / 'd' / 'cpg_ros_results.json').write_text('{}')
    (tmp_path / 'd' / 'table.csv').write_text('')
    names = [str(one.relative_to(tmp_path)) for one in recordings_in([tmp_path, tmp_path / 'a'])]
    assert names == ['a/bag', 'b', 'c/ik.mot', 'c/monday.mcap', 'c/run.csv.gz', 'c/tuesday.mcap',
                     'c/walk.csv']
    assert digest(tmp_path / 'c' / 'monday.mcap') == digest(tmp_path / 'c' / 'tuesday.mcap')


def test_names_that_are_not_utf8_cost_no_row(folder, tmp_path):
    for name, text in ((b'w\xffalk.csv', table()), (b'bad\xfe.csv', ''), (b'two\nlines.csv', '')):
        (folder / os.fsdecode(name)).write_text(text)
    for begun in ('first', 'again'):
        run = subprocess.run([*INVERSION, '--bags', str(folder), '--out', str(tmp_path / 'out'),
                              '--network', 'delayed', '--free', 'tau', '--order', '1', '--jobs',
                              '1'],
                             capture_output=True, text=True)
        assert run.returncode == 0 and 'Traceback' not in run.stderr, (begun, run.stderr)
        assert '7 recordings, 3 fitted' in run.stdout
    rows = rows_of(tmp_path / 'out')
    assert list(rows) == ['bad\\xfe.csv', 'empty.csv', 'pace.csv', 'trot.csv', 'two\nlines.csv',
                          'words.csv', 'w\\xffalk.csv']
    assert [row['gait'] for row in rows.values()] == ['', '', 'pace', 'trot', '', '', 'trot']
    bad = rows['bad\\xfe.csv']
    assert bad['reason'].endswith('bad\\xfe.csv: the file is empty')
    with open(tmp_path / 'out' / 'table.csv', encoding='utf-8', newline='') as text:
        assert [len(row) for row in csv.reader(text)] == [len(bad)] * 8
    assert 'w\\xffalk.csv' in (tmp_path / 'out' / 'index.html').read_text(encoding='utf-8')


@pytest.mark.deep
def test_one_recording_whose_name_is_not_utf8(tmp_path):
    path = tmp_path / os.fsdecode(b'w\xffalk.csv')
    path.write_text(table())
    out, report = tmp_path / 'fitted.yaml', tmp_path / 'fitted.html'
    run = subprocess.run([*INVERSION, '--csv', str(path), '--network', 'delayed', '--free', 'tau',
                          '--order', '1', '--out', str(out), '--report', str(report)],
                         capture_output=True, text=True)
    assert run.returncode == 0, run.stderr
    assert all('w\\xffalk.csv' in file.read_text() for file in (out, report))
    for option in ('--csv', '--bag'):
        run = subprocess.run([*INVERSION, option, f'{path}x'], capture_output=True, text=True)
        (line,) = run.stderr.splitlines()
        assert run.returncode == 2 and line.startswith('inversion: ')


def test_folders_that_will_not_do(folder, tmp_path):
    with pytest.raises(InputError, match='there is no such folder'):
        Folders([tmp_path / 'nowhere'], tmp_path / 'out', QUICK)
    assert not (tmp_path / 'out').exists()
    with pytest.raises(InputError, match='it contains other files'):
        Folders([folder], folder, QUICK)
    (tmp_path / 'bare').mkdir()
    with pytest.raises(InputError, match='no bags or tables'):
        invert(tmp_path / 'bare', tmp_path / 'out')


def test_what_appears_is_taken_once_it_is_whole(folder, tmp_path, monkeypatch):
    monkeypatch.setattr('cpg_ros.fitting.inversion.many_recordings.SCAN_PERIOD', 0.01)
    looks, said = iter(range(8)), []

    def goes_on():
        look = next(looks, None)
        if look == 3:
            (folder / 'late.csv').write_text(table(seed=3))
        return look is not None

    with ThreadPoolExecutor(1) as executor:
        work = Folders([folder], tmp_path / 'out', QUICK, progress=False)
        summary = work.watch(executor, said.append, goes_on)
    assert (summary.done, summary.failed) == (5, 2)
    assert len(said) == 5
    assert said[-1].endswith('late.csv')


def test_ctrl_c_keeps_what_was_finished(folder, tmp_path):
    for k in range(40):
        (folder / f'more_{k}.csv').write_text(table(seed=k))
    out = tmp_path / 'out'
    words = [*INVERSION, '--bags', str(folder), '--out',
             str(out), '--jobs', '1', '--network', 'delayed', '--free', 'tau', '--order', '1']
    # A shell that runs the tests in the background has them ignore it.
    running = subprocess.Popen(
        words, stderr=subprocess.PIPE, text=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL))
    end = time.monotonic() + 120
    while len(list((out / 'rows').glob('*.json'))) < 2 and time.monotonic() < end:
        time.sleep(0.05)
    running.send_signal(signal.SIGINT)
    _, said = running.communicate(timeout=60)
    assert running.returncode == 130
    # After lines of progress, one a minute.
    assert 'Traceback' not in said and said.splitlines()[-1] == (
        'inversion: stopped; what was finished is kept, and the same command continues from there')
    assert 2 <= len(rows_of(out)) < 44


@pytest.mark.parametrize(('words', 'said'), [
    (['--bags', '.'], 'argument --bags: --out FOLDER is needed for the results'),
    (['--bags', '.', '--out', 'x', '--json'], 'argument --json: not with --bags'),
    (['--csv', 'x.csv', '--jobs', '2'], 'argument --jobs: one recording is one job; see --bags'),
    (['--csv', 'x.csv', '--watch'], 'argument --watch: one recording is one job; see --bags')])
def test_words_that_do_not_go_together(words, said, capsys):
    from cpg_ros.fitting.inversion.inversion import main
    assert main(words) == 2
    assert capsys.readouterr().err == f'inversion: {said}\n'
