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

"""Files that are pipes, devices, without an end, or nested deep: one line each, and no waiting."""

import gzip
import os
from pathlib import Path

from bags import storage_file, walk, write_bag
from cpg_ros.common import files
from cpg_ros.common.errors import CpgError, InputError
from cpg_ros.common.files import opened, read_bytes, resource_folder
from cpg_ros.common.yaml_reader import parsed
from cpg_ros.fitting.recordings.bag_reader import read_bag
from cpg_ros.fitting.recordings.csv_reader import read_csv
from cpg_ros.motion import meshes
from cpg_ros.motion.description import load_urdf
from cpg_ros.motion.robot_file import read_robot
from cpg_ros.networks.presets import read_presets
from cpg_ros.networks.registry import find_network, NETWORKS
from cpg_ros.simulation.urdf_model import hull
from depth import examples
from hypothesis import given
from hypothesis import strategies as st
import pytest


def panel_mesh(path):
    from cpg_ros.motion.meshes import read_mesh
    return read_mesh(path)


def panel_urdf(path):
    from cpg_ros.ros.panel.shape import from_file
    return from_file(path, str)


def panel_description(path):
    from cpg_ros.ros.panel.shape import from_text
    return from_text(read_bytes(path, CpgError).decode(errors='surrogateescape'), 'it', str)


def simulated(path):
    pytest.importorskip('mujoco')
    from cpg_ros.simulation.robot_model import load
    return load(str(path), read_robot(resource_folder('config') / 'quadruped.yaml'))


READERS = {'robot.yaml': read_robot, 'presets.yaml': lambda path: read_presets(
    path, NETWORKS['delayed']), 'network.py': lambda path: find_network(str(path)),
    'robot.urdf': load_urdf, 'shape.urdf': panel_urdf,
    'model.urdf': simulated, 'model.xml': simulated, 'mesh.stl': panel_mesh,
    'mesh.obj': panel_mesh, 'hull.stl': hull, 'hull.dae': hull, 'table.csv': read_csv,
    'table.mot': read_csv, 'bag.mcap': read_bag, 'bag.db3': read_bag}
#: Those of text: what a reader makes of bytes that are none, its own tests tell.
TEXTS = [name for name in READERS
         if name.endswith(('.yaml', '.urdf', '.stl', '.obj', '.dae', '.csv'))]


def refusal(read, path):
    """Return the line that a reader refuses a file with."""
    with pytest.raises(CpgError) as caught:
        read(path)
    text = str(caught.value)
    assert '\n' not in text and len(text) < 600
    return text


@pytest.mark.parametrize('name', READERS)
def test_what_is_no_regular_file_is_refused_at_once(tmp_path, name):
    read = READERS[name]
    os.mkfifo(tmp_path / name)
    text = refusal(read, tmp_path / name)
    assert name in text
    for target in ('/dev/zero', '/dev/tty', tmp_path):
        (tmp_path / name).unlink()
        (tmp_path / name).symlink_to(target)
        text = refusal(read, tmp_path / name)
        assert name in text or str(target) in text


@pytest.mark.parametrize('name', [name for name in READERS
                                  if not name.startswith(('bag', 'table'))])
def test_a_file_of_a_terabyte_is_refused_at_once(tmp_path, name):
    with open(tmp_path / name, 'wb') as file:
        file.truncate(1 << 40)
    assert 'make it smaller' in refusal(READERS[name], tmp_path / name)


def test_a_line_without_an_end_is_no_table(tmp_path):
    # Ten megabytes that unpack to ten gigabytes without a line's end, in the small.
    with gzip.open(tmp_path / 'a.csv.gz', 'wb') as file:
        file.write(b'time,lh_hip\n0,' + b'0' * 10_000_000)
    assert 'a line has' in refusal(read_csv, tmp_path / 'a.csv.gz')
    with open(tmp_path / 'b.csv', 'wb') as file:
        file.truncate(1 << 40)
    assert 'make it smaller' in refusal(read_csv, tmp_path / 'b.csv')


@pytest.mark.parametrize('name', ['metadata.yaml', 'bag.db3'])
def test_a_pipe_in_a_bag_is_refused(tmp_path, name):
    bag = write_bag(tmp_path / 'bag', walk(20)[0])
    path = bag / name if name == 'metadata.yaml' else storage_file(bag)
    path.unlink()
    os.mkfifo(path)
    assert 'is a pipe' in refusal(read_bag, tmp_path / 'bag')


def test_files_of_proc_are_as_empty_as_they_say():
    # Their size is 0, whatever is in them; reading some of them waits.
    assert not read_bytes('/proc/self/maps', CpgError)
    with opened('/proc/self/maps', CpgError) as file:
        assert file.readable()


@pytest.mark.parametrize('text', ['[' * 20_000 + ']' * 20_000, '[' * 20_000,
                                  '{a: ' * 20_000 + '1' + '}' * 20_000, '- ' * 20_000 + '1'])
def test_yaml_nested_deep_is_one_line(tmp_path, text):
    (tmp_path / 'a.yaml').write_text(text)
    for read in (read_robot, READERS['presets.yaml']):
        assert 'nested more than 50 deep' in refusal(read, tmp_path / 'a.yaml')


def test_yaml_aliases_are_counted_as_what_they_stand_for(tmp_path):
    laughs = ''.join(f'a{k}: &a{k} [{", ".join([f"*a{k - 1}"] * 10) if k else "lol"}]\n'
                     for k in range(12))
    for text, words in ((laughs, 'aliases stand for'), ('network: &a [*a]\n', 'part of')):
        (tmp_path / 'a.yaml').write_text(text)
        assert words in refusal(read_robot, tmp_path / 'a.yaml')
    assert parsed('a: &a [1, 2]\nb: [*a, *a]\n') == {'a': [1, 2], 'b': [[1, 2], [1, 2]]}


@pytest.mark.parametrize('text', ['!!int x', '!!float x', '!!bool x', '!!timestamp x', '!!int ""',
                                  '2020-13-45', '1' * 5000, '!!binary "\u00ff"',
                                  '0x' + 'f' * 9000])
def test_values_that_do_not_fit_their_tags_are_one_line(tmp_path, text):
    for whole in (text, f'network: {text}', f'network: delayed\nlegs: {text}'):
        (tmp_path / 'a.yaml').write_text(whole)
        refusal(read_robot, tmp_path / 'a.yaml')


LAUGHS = ('<?xml version="1.0"?><!DOCTYPE robot [<!ENTITY a0 "lol">' + ''.join(
    f'<!ENTITY a{k} "{f"&a{k - 1};" * 10}">' for k in range(1, 12)) + ']>')


@pytest.mark.parametrize('name', ['robot.urdf', 'shape.urdf', 'model.urdf',
                                  'hull.dae'])
def test_xml_that_unfolds_or_is_nested_deep_is_one_line(tmp_path, name):
    root = 'COLLADA' if name == 'hull.dae' else 'robot'
    for text, words in (
            (f'{LAUGHS}<{root}>&a11;</{root}>', 'entit'),
            (f'<{root}>' + '<a>' * 20_000 + '</a>' * 20_000 + f'</{root}>', '200 deep'),
            (f'<{root}>' + '<node>' * 20_000, '200 deep')):
        (tmp_path / name).write_text(text)
        assert words in refusal(READERS[name], tmp_path / name)


def pieces(name):
    """Return what files of this kind are made of."""
    common = ['\0', '\n', ' ', '0', '1', '-1', '1e999', 'nan', '99999999999999999999', '\u00e9']
    kinds = {'.yaml': ['network', 'legs', 'delayed', 'presets', 'joints', ': ', '- ', '  ', '[',
                       ']', '{', '}', '&a ', '*a', '!!int ', '!!timestamp ', '|', '"', "'", '? ',
                       '<<'],
             '.urdf': ['<robot>', '</robot>', '<link name="a">', '</link>', '<visual>',
                       '</visual>', '<geometry>', '</geometry>', '<box size="1 2"/>',
                       '<sphere radius="x"/>',
                       '<mesh filename="package://%2e%2e/x.stl" scale="1"/>', '<origin rpy="1"/>',
                       '<mesh filename="file:///%00"/>', '<cylinder radius="nan" length="1"/>',
                       '<joint name="j" type="revolute"><parent link="a"/><child link="b"/>'
                       '<limit lower="0" upper="1"/></joint>', '<joint name="k" type="fixed">'
                       '<parent link="b"/><child link="a"/></joint>', '&#0;', '<!DOCTYPE a>'],
             '.dae': ['<COLLADA>', '</COLLADA>', '<asset><up_axis>X_UP</up_axis></asset>',
                      '<geometry id="g">', '</geometry>', '<source id="s">', '</source>',
                      '<float_array>1 2 3 4</float_array>', '<vertices>', '</vertices>',
                      '<input semantic="POSITION" source="#&quot;]"/>', '<visual_scene>',
                      '</visual_scene>', '<node>', '</node>', '<rotate>1</rotate>',
                      '<instance_geometry url="#g"/>', '<matrix>1 2</matrix>'],
             '.stl': ['solid s', 'vertex 0 0 0 ', 'vertex 1 2 ', 'vertex x y z '],
             '.obj': ['v 0 0 0\n', 'v 1 1\n', 'f 1 2 3\n', 'f 1/ /2 3\n', 'f 0 -9 7\n', 'f ',
                      'v '],
             '.csv': ['time', 'lh_hip', ',', ';', '\t', '"', 'endheader\n', '[deg]', '\ufeff']}
    return st.lists(st.sampled_from(common + kinds[Path(name).suffix]), max_size=40).map(''.join)


@pytest.mark.parametrize('name', [*TEXTS, 'description.urdf'])
@examples(150)
@given(data=st.data())
def test_whatever_a_file_has_in_it_is_read_or_refused_in_one_line(tmp_path_factory, name, data):
    read = {**READERS, 'description.urdf': panel_description}[name]
    path = tmp_path_factory.getbasetemp() / name
    content = data.draw(pieces(name) | st.binary(max_size=60))
    path.write_bytes(content.encode() if isinstance(content, str) else content)
    try:
        read(path)
    except CpgError as error:
        assert '\n' not in str(error)


NODE = '<node><instance_geometry url="#g"/></node>'
COLLADA = """<COLLADA><library_geometries><geometry id="g"><mesh>
<source id="s"><float_array>0 0 0 1 0 0 0 1 0</float_array></source>
<vertices id="v"><input semantic="POSITION" source="#s"/></vertices>
<triangles><input semantic="VERTEX" source="#v" offset="0"/><p>{corners}</p></triangles>
</mesh></geometry></library_geometries>
<library_visual_scenes><visual_scene>{nodes}</visual_scene></library_visual_scenes></COLLADA>"""


@pytest.mark.parametrize(('corners', 'nodes', 'words'), [
    ('0 1 2', 600, 'more than 2000 points and triangles'),
    ('0 1 2 ' * 2001, 1, 'a list has more than 6000 numbers')])
def test_a_mesh_placed_without_end(tmp_path, monkeypatch, corners, nodes, words):
    monkeypatch.setattr(meshes, 'MAX_POINTS', 2000)
    monkeypatch.setattr(meshes, 'MAX_NUMBERS', 6000)
    path = tmp_path / 'leg.dae'
    path.write_text(COLLADA.format(corners='0 1 2', nodes=NODE * 2))
    assert len(meshes.read_mesh(path).points) == 6
    path.write_text(COLLADA.format(corners=corners, nodes=NODE * nodes))
    with pytest.raises(meshes.MeshError, match=words) as error:
        meshes.read_mesh(path)
    assert str(error.value).startswith(str(path))


def test_more_elements_than_any_robot_has(monkeypatch):
    monkeypatch.setattr(files, 'MAX_ELEMENTS', 1000)
    assert len(files.parse(b'<a>' + b'<b/>' * 999 + b'</a>', InputError)) == 999
    with pytest.raises(InputError, match='it has more than 1000 elements'):
        files.parse(b'<a>' + b'<b/>' * 1000 + b'</a>', InputError)
