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

"""Files of laboratories, damaged at random: a recording comes out, or one line."""

import io

from cpg_ros.common.errors import CpgError
from cpg_ros.fitting.recordings.formats import read_recording
from depth import examples
from hypothesis import given
from hypothesis import strategies as st
import numpy as np
import pytest
from skeletons import angles, deeplabcut, LABELS, places, trc
from test_bvh_reader import text
from test_mot_reader import RUNNING

TIME = np.arange(12) / 50.0


def _packed():
    file = io.BytesIO()
    np.savez(file, time=TIME, hip=np.cos(TIME), knee=np.sin(TIME))
    return file.getvalue()


FILES = {
    'trc': trc(TIME, places(angles(TIME))).encode(),
    'mot': RUNNING.read_bytes()[:4000],
    'bvh': text().encode()[:3000],
    'csv': deeplabcut(places(angles(TIME))[:, :, [0, 2]], np.ones((12, 12)), LABELS).encode(),
    'npz': _packed(),
}
WORDS = (b'', b'nan', b'1e308', b'-', b'\t', b',', b'\n', b'\0', b'\xff', b'{', b'}', b'9' * 30,
         b'Xrotation', b'Frames:')


@pytest.mark.parametrize('kind', FILES)
@examples(200)
@given(data=st.data())
def test_a_recording_or_one_line(tmp_path_factory, kind, data):
    content = FILES[kind]
    for _ in range(data.draw(st.integers(0, 3))):
        at = data.draw(st.integers(0, len(content)))
        over = data.draw(st.integers(0, 12))
        content = content[:at] + data.draw(st.sampled_from(WORDS)) + content[at + over:]
    content = content[:data.draw(st.integers(0, len(content)))] if data.draw(
        st.booleans()) else content
    path = tmp_path_factory.mktemp('hostile') / f'walk.{kind}'
    path.write_bytes(content)
    options = {'trc': {'segments': 'human_plug_in_gait'},
               'csv': {'segments': 'human_plug_in_gait', 'fps': 50}}.get(kind, {})
    try:
        found = read_recording(path, 'pose' if kind == 'csv' else '', progress=False, **options)
    except CpgError as error:
        assert '\n' not in str(error) and str(path) in str(error)
    else:
        assert np.isfinite(found.positions).any() and (np.diff(found.times) > 0.0).all()
