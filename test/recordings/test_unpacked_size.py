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
import tempfile

from bags import joint_state, JOINTS, START, storage_file, walk, write_bag
from cpg_ros.recordings import unpacked_size
from cpg_ros.recordings.bag_reader import read_bag
from cpg_ros.recordings.csv_reader import read_csv
from cpg_ros.recordings.mot_reader import read_mot
from cpg_ros.recordings.recording import RecordingError
from depth import in_depth
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
    monkeypatch.setattr(unpacked_size, 'ALWAYS', 100_000)
    path = tmp_path / 'walk.csv.gz'
    path.write_bytes(gzip.compress(head + b'\n' * 1_000_000))
    assert 'more than 0 MB' in refusal(read, path)


def test_a_long_table_is_read(tmp_path, monkeypatch):
    monkeypatch.setattr(unpacked_size, 'ALWAYS', 100_000)
    path = tmp_path / 'walk.csv.gz'
    rows = ''.join(f'{k / 100},{k % 7}\n' for k in range(20_000))
    path.write_bytes(gzip.compress(f'time,hip\n{rows}'.encode()))
    assert len(rows) > 100_000
    assert len(read_csv(path, progress=False).times) == 20_000


@pytest.mark.parametrize(('storage', 'compression'), KINDS)
@pytest.mark.parametrize('limit', [20_000_000, *in_depth(unpacked_size.ALWAYS)])
def test_bags_that_unpack_to_too_much(tmp_path, storage, compression, limit, monkeypatch):
    monkeypatch.setattr(unpacked_size, 'ALWAYS', limit)
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
    monkeypatch.setattr(unpacked_size, 'ALWAYS', 0)
    messages = walk(200)[0]
    bag = write_bag(tmp_path / 'walk', messages, storage, compression)
    assert len(read_bag(bag, progress=False).times) == 200
