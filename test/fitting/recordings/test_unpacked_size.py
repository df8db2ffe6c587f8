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

"""Small files that unpack to far more than any recording has: refused before memory or disk is."""

import gzip
from pathlib import Path
import re
import sqlite3
import tempfile
import zipfile

from bags import joint_state, JOINTS, START, storage_file, walk, write_bag
from cpg_ros.fitting.recordings import tables
from cpg_ros.fitting.recordings.bag_reader import read_bag
from cpg_ros.fitting.recordings.csv_reader import read_csv
from cpg_ros.fitting.recordings.formats import read_recording
from cpg_ros.fitting.recordings.npz_reader import read_npz
from cpg_ros.fitting.recordings.opensim_reader import read_mot
from cpg_ros.fitting.recordings.recording import RecordingError
from depth import in_depth
import numpy as np
import pytest

KINDS = [('sqlite3', 'file'), ('sqlite3', 'message'), ('mcap', 'file'), ('mcap', 'message'),
         ('mcap', 'storage')]


def refusal(read, path: Path) -> str:
    with pytest.raises(RecordingError, match='unpacked, which recordings do not have') as error:
        read(path, progress=False)
    assert str(error.value).startswith(str(path)) and '\n' not in str(error.value)
    return str(error.value)


@pytest.mark.parametrize(('read', 'head'), [
    (read_csv, b'time,hip\n'), (read_mot, b'walk\ninDegrees=no\nendheader\ntime\thip\n')])
def test_text_that_unpacks_to_too_much(tmp_path, read, head, monkeypatch):
    monkeypatch.setattr(tables, 'UNPACKED_ALLOWANCE', 100_000)
    path = tmp_path / 'walk.csv.gz'
    path.write_bytes(gzip.compress(head + b'\n' * 1_000_000))
    assert 'more than 0 MB' in refusal(read, path)


BVH_HEAD = b"""HIERARCHY
ROOT Hips
{
CHANNELS 1 Xrotation
}
MOTION
Frames: 9
Frame Time: .01
"""


@pytest.mark.parametrize(('name', 'head'), [
    ('a.trc.gz', b'PathFileType\n\n\n\n\n'), ('a.bvh', BVH_HEAD),
    ('a.csv.gz', b'scorer,a\nbodyparts,b\ncoords,x\n')])
def test_lines_without_end_are_not_kept(tmp_path, name, head, monkeypatch):
    monkeypatch.setattr(tables, 'MAX_LINES', 1000)
    path = tmp_path / name
    path.write_bytes(gzip.compress(head + b'0\n' * 1001))
    with pytest.raises(RecordingError, match='more than 1000 lines') as error:
        read_recording(path, progress=False)
    assert str(error.value).startswith(str(path))


@pytest.mark.parametrize('kind', [np.int8, float])
def test_arrays_that_unpack_to_too_much(tmp_path, kind, monkeypatch):
    monkeypatch.setattr(tables, 'UNPACKED_ALLOWANCE', 100_000)
    path = tmp_path / 'walk.npz'
    np.savez_compressed(path, hip=np.zeros(1_000_000, kind), fps=100.0)
    refusal(read_npz, path)


def test_members_that_are_no_arrays_are_named(tmp_path):
    path = tmp_path / 'walk.npz'
    np.savez(path, hip=np.sin(np.arange(100.0)), fps=100.0)
    with zipfile.ZipFile(path, 'a') as packed:
        packed.writestr('README', 'a walk')
    found = read_npz(path)
    assert found.joints == ('hip',)
    assert "1 member that are no arrays left out: 'README'" in found.notes


def test_all_messages_of_a_bag_together_are_bounded(tmp_path, monkeypatch):
    # None of them is too large by itself.
    monkeypatch.setattr(tables, 'UNPACKED_ALLOWANCE', 1_000_000)
    large = joint_state(START, JOINTS, [0.0] * len(JOINTS), (), [0.0] * 50_000)
    bag = write_bag(tmp_path / 'walk', [('/joint_states', START + k, large) for k in range(100)],
                    'sqlite3', 'message')
    refusal(read_bag, bag)


def test_what_a_table_of_a_database_makes_up_is_bounded(tmp_path):
    bag = write_bag(tmp_path / 'walk', walk(20)[0], 'sqlite3')
    with sqlite3.connect(storage_file(bag)) as base:
        base.execute('ALTER TABLE messages RENAME TO known')
        base.execute('CREATE VIEW messages AS SELECT known.id AS id, topic_id, timestamp, '
                     'zeroblob(10000000) AS data FROM known')
    base.close()
    with pytest.raises(RecordingError) as error:
        read_bag(bag, progress=False)
    assert str(error.value).startswith(str(bag)) and '\n' not in str(error.value)


@pytest.mark.parametrize('column', ['timestamp', 'data'])
def test_messages_without_time_or_content(tmp_path, column):
    bag = write_bag(tmp_path / 'walk', walk(20)[0], 'sqlite3')
    with sqlite3.connect(storage_file(bag)) as base:
        base.execute('CREATE TABLE loose AS SELECT * FROM messages')
        base.execute('DROP TABLE messages')
        base.execute('ALTER TABLE loose RENAME TO messages')
        base.execute(f'UPDATE messages SET {column} = NULL WHERE rowid = 5')
    base.close()
    with pytest.raises(RecordingError) as error:
        read_bag(bag, progress=False)
    assert str(error.value).startswith(str(bag)) and '\n' not in str(error.value)


@pytest.mark.parametrize('value', ['[]', '{a: 1}', 'null', '-x', '1.5', '2020-01-01'])
def test_metadata_of_other_types(tmp_path, value):
    bag = write_bag(tmp_path / 'walk', walk(20)[0], 'sqlite3')
    path = bag / 'metadata.yaml'
    text = path.read_text()
    for key in ('message_count', 'name', 'type', 'relative_file_paths', 'topic_metadata',
                'nanoseconds', 'storage_identifier', 'version', 'offered_qos_profiles'):
        changed = re.sub(rf'(\b{key}:) *[^\n]+', rf'\1 {value}', text)
        path.write_text(changed)
        try:
            read_bag(bag, progress=False)
        except RecordingError as error:
            assert str(error).startswith(str(bag)) and '\n' not in str(error)


def test_a_long_table_is_read(tmp_path, monkeypatch):
    monkeypatch.setattr(tables, 'UNPACKED_ALLOWANCE', 100_000)
    path = tmp_path / 'walk.csv.gz'
    rows = ''.join(f'{k / 100},{k % 7}\n' for k in range(20_000))
    path.write_bytes(gzip.compress(f'time,hip\n{rows}'.encode()))
    assert len(rows) > 100_000
    assert len(read_csv(path, progress=False).times) == 20_000


@pytest.mark.parametrize(('storage', 'compression'), KINDS)
@pytest.mark.parametrize('limit', [20_000_000, *in_depth(tables.UNPACKED_ALLOWANCE)])
def test_bags_that_unpack_to_too_much(tmp_path, storage, compression, limit, monkeypatch):
    monkeypatch.setattr(tables, 'UNPACKED_ALLOWANCE', limit)
    temporary = tmp_path / 'temporary'
    temporary.mkdir()
    monkeypatch.setattr(tempfile, 'tempdir', str(temporary))
    large = joint_state(START, JOINTS, [0.0] * len(JOINTS), (), [0.0] * round(0.14 * limit))
    bag = write_bag(tmp_path / 'walk', [('/joint_states', START, large)], storage, compression)
    assert storage_file(bag).stat().st_size < 0.01 * limit
    refusal(read_bag, bag)
    assert not list(temporary.iterdir())


@pytest.mark.parametrize(('storage', 'compression'), KINDS)
def test_how_much_counts_beside_the_size_of_what_was_packed(tmp_path, storage, compression,
                                                            monkeypatch):
    # Less than what it always may be is nothing, then: the ratio alone decides.
    monkeypatch.setattr(tables, 'UNPACKED_ALLOWANCE', 0)
    messages = walk(200)[0]
    bag = write_bag(tmp_path / 'walk', messages, storage, compression)
    assert len(read_bag(bag, progress=False).times) == 200
