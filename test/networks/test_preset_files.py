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

"""Preset files: what is written is read again, and every bad file says what is wrong with it."""

from dataclasses import replace
import os
from pathlib import Path

from cpg_ros.networks.library.biped import Biped
from cpg_ros.networks.network import Preset
from cpg_ros.networks.presets import PresetError, read_presets, write_presets
from cpg_ros.networks.registry import NETWORKS, PRESETS
from depth import examples
from hypothesis import given
from hypothesis import strategies as st
import pytest
import yaml

CONFIG = Path(__file__).parents[2] / 'config' / 'presets'
WALK = PRESETS['biped']['walk']
NAMES = st.text(st.characters(exclude_categories=['Cs']), min_size=1).filter(str.strip)


@st.composite
def presets(draw, network):
    numbers = [draw(st.floats(allowed.low, allowed.high)) for allowed in network.ranges.values()]
    start, period = None, 0.0
    if network.variables > 1 and draw(st.booleans()):
        count = network.cells * network.variables
        start = tuple(draw(st.lists(st.floats(-1e3, 1e3), min_size=count, max_size=count)))
        period = draw(st.floats(0.0, 1e3, exclude_min=True))
    return Preset(draw(st.sampled_from(network.gaits())), network(*numbers), start, period)


@pytest.mark.parametrize('network', NETWORKS.values(), ids=str)
@examples(25)
@given(data=st.data())
def test_what_is_written_is_read_again(network, tmp_path_factory, data):
    written = data.draw(st.dictionaries(NAMES, presets(network), min_size=1, max_size=3))
    comment = data.draw(st.sampled_from(['', 'Found by chance.', 'presets: []\nof two lines']))
    path = tmp_path_factory.mktemp('presets') / 'some.yaml'
    write_presets(path, network, written, comment)
    found = read_presets(path, network)
    assert found == written and list(found) == list(written)
    assert path.read_text().startswith(''.join(f'# {line}\n' for line in comment.splitlines()))
    assert os.listdir(path.parent) == ['some.yaml']


@pytest.mark.parametrize('network', PRESETS)
def test_shipped_files(network):
    kind = NETWORKS[network]
    if (path := CONFIG / f'{network}.yaml').exists():
        assert read_presets(path, kind) == PRESETS[network]
    for name, preset in PRESETS[network].items():
        assert isinstance(preset.network, kind) and preset.gait in kind.gaits()
        # A gait's own name is that of its usual preset.
        assert name not in kind.gaits() or preset.gait == name
        # What is not found from anywhere has to be told, or is known beforehand.
        assert (preset.start is None) == (
            kind.variables == 1 or preset.network.on_orbit(preset.gait) is not None)
        for key, value in preset.network.as_dict().items():
            assert kind.ranges[key].low <= value <= kind.ranges[key].high


def check_refused(path, *words, network=Biped):
    with pytest.raises(PresetError) as caught:
        read_presets(path, network)
    text = str(caught.value)
    assert '\n' not in text and text.startswith(f'preset file {path}: ')
    assert all(word in text for word in words), text


ENTRY, PARAMETERS = ('presets', 'walk'), ('presets', 'walk', 'parameters')
MISSING = object()


@pytest.mark.parametrize(('keys', 'value', 'where', 'why'), [
    (('colour',), 1, 'file.colour', 'unknown key (allowed: network, presets)'),
    ((*ENTRY, 'gate'), 'walk', 'presets.walk.gate', 'unknown key'),
    ((*PARAMETERS, 'w_11'), 0.1, 'presets.walk.parameters.w_11', 'unknown key'),
    (('network',), 'quadruped', 'network', "is 'quadruped', not 'biped'"),
    (('network',), None, 'network', 'not'),
    (('presets',), {}, 'presets', 'at least one name'),
    (('presets',), [1], 'presets', 'mapping'),
    (ENTRY, None, 'presets.walk', 'must be a mapping, not nothing'),
    ((*ENTRY, 'gait'), 'trot', 'presets.walk.gait', "'trot' is not one of walk, run"),
    ((*ENTRY, 'gait'), 3, 'presets.walk.gait', 'must be a name, not 3'),
    (PARAMETERS, [0.1] * 14, 'presets.walk.parameters', 'must be a mapping'),
    ((*PARAMETERS, 'phi'), float('nan'), 'presets.walk.parameters.phi', 'must be finite, not nan'),
    ((*PARAMETERS, 'w_21'), float('inf'), 'presets.walk.parameters.w_21', 'finite, not inf'),
    ((*PARAMETERS, 'w_21'), '0.39', 'presets.walk.parameters.w_21', "a number, not '0.39'"),
    ((*PARAMETERS, 'w_21'), True, 'presets.walk.parameters.w_21', 'a number, not True'),
    ((*PARAMETERS, 'w_21'), None, 'presets.walk.parameters.w_21', 'a number, not nothing'),
    ((*PARAMETERS, 'w_21'), 2.01, 'presets.walk.parameters.w_21', '2.01 is not from -2 to 2'),
    ((*PARAMETERS, 'phi'), 0.0, 'presets.walk.parameters.phi', '0 is not from 0.01 to 2'),
    ((*PARAMETERS, 'phi'), 1e9, 'presets.walk.parameters.phi', 'at most 1000'),
    ((*PARAMETERS, 'phi'), 10**400, 'presets.walk.parameters.phi', 'at most 1000'),
    ((*ENTRY, 'start'), [0.1] * 7, 'presets.walk.start', 'has 7 numbers, not 8'),
    ((*ENTRY, 'start'), 0.1, 'presets.walk.start', 'must be a list'),
    ((*ENTRY, 'start'), [], 'presets.walk.start', 'must be a list with at least one entry'),
    ((*ENTRY, 'start'), [0.1] * 7 + ['x'], 'presets.walk.start[7]', "a number, not 'x'"),
    ((*ENTRY, 'period'), 0.0, 'presets.walk.period', '0 must be positive'),
    ((*ENTRY, 'period'), -14.0, 'presets.walk.period', '-14 must be positive'),
    ((*ENTRY, 'period'), float('nan'), 'presets.walk.period', 'must be finite'),
    ((*ENTRY, 'period'), MISSING, 'presets.walk', "'start' and 'period' go together"),
    ((*ENTRY, 'start'), MISSING, 'presets.walk', "'start' and 'period' go together"),
    ((*ENTRY, 'gait'), MISSING, 'presets.walk.gait', 'is missing'),
    ((*PARAMETERS, 'w_43'), MISSING, 'presets.walk.parameters.w_43', 'is missing'),
    (PARAMETERS, MISSING, 'presets.walk.parameters', 'is missing'),
    (('network',), MISSING, 'file.network', 'is missing'),
    (('presets',), MISSING, 'file.presets', 'is missing')])
def test_bad_values(tmp_path, keys, value, where, why):
    # A file that is right but for the value under these keys.
    write_presets(path := tmp_path / 'b.yaml', Biped, {'walk': WALK})
    tree = inner = yaml.safe_load(path.read_text())
    for key in keys[:-1]:
        inner = inner[key]
    inner[keys[-1]] = value
    if value is MISSING:
        del inner[keys[-1]]
    path.write_text(yaml.safe_dump(tree))
    check_refused(path, f': {where}: ', why)


@pytest.mark.parametrize(('content', 'words'), [
    (b'network: [biped\npresets:', 'line 2'), (b'\xff\xfe\x00', 'decode'), (b'', 'not nothing'),
    (b'network: biped\nnetwork: biped\n', "'network' appears twice"), (b'- 1\n', 'a mapping'),
    (b'network: biped\npresets:\n  1: {}\n', 'the key 1 is not a name'),
    (b'a: !!python/object:os.system {}\n', 'line 1'), (b'a: \x07\n', 'file')])
def test_files_of_other_kinds(tmp_path, content, words):
    (path := tmp_path / 'b.yaml').write_bytes(content)
    check_refused(path, words)
    check_refused(tmp_path / 'none.yaml', 'No such file')
    check_refused(tmp_path, 'directory')


def test_the_delayed_network_has_no_start(tmp_path):
    preset, kind = PRESETS['delayed']['trot'], NETWORKS['delayed']
    write_presets(path := tmp_path / 'd.yaml', kind, {'trot': preset})
    assert read_presets(path, kind) == {'trot': preset}
    write_presets(path, kind, {'trot': replace(preset, start=(0.1,) * 8, period=1.0)})
    check_refused(path, ': presets.trot.start: ', 'delay', network=kind)


def test_a_failed_write_leaves_the_old_file(tmp_path, monkeypatch):
    write_presets(path := tmp_path / 'b.yaml', Biped, {'walk': WALK})
    before = path.read_bytes()
    with pytest.raises(yaml.YAMLError):
        write_presets(path, Biped, {'walk': replace(WALK, start=(object(),) * 8)})
    # The disk is full half way.
    real = Path.write_bytes

    def half(self, content):
        real(self, content[:len(content) // 2])
        raise OSError(28, 'No space left on device')
    monkeypatch.setattr(Path, 'write_bytes', half)
    with pytest.raises(OSError, match='No space'):
        write_presets(path, Biped, {'run': PRESETS['biped']['run']})
    monkeypatch.undo()
    assert path.read_bytes() == before and read_presets(path, Biped) == {'walk': WALK}
    assert list(tmp_path.iterdir()) == [path]
    with pytest.raises(OSError):
        write_presets(tmp_path / 'no' / 'b.yaml', Biped, {'walk': WALK})


@pytest.mark.skipif(os.geteuid() == 0, reason='root may write everywhere')
def test_nothing_is_written_where_nothing_may_be(tmp_path):
    tmp_path.chmod(0o500)
    with pytest.raises(PermissionError):
        write_presets(tmp_path / 'b.yaml', Biped, {'walk': WALK})
    assert os.listdir(tmp_path) == []
    tmp_path.chmod(0o700)
