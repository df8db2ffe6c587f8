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

"""A generator where numba cannot be imported: it walks by the exported C, without feedback."""

import os
from pathlib import Path
import shutil

from cpg_ros.motion.robot_file import load_robot
from cpg_ros.networks.registry import find_network
from graph import until
import numpy as np
import pytest

pytestmark = pytest.mark.skipif(shutil.which('gcc') is None, reason='gcc is not installed')


@pytest.fixture
def hidden(monkeypatch, tmp_path):
    """Hide numba from processes, and give them an empty cache."""
    (tmp_path / 'sitecustomize.py').write_text("import sys\nsys.modules['numba'] = None\n")
    monkeypatch.setenv('PYTHONPATH', f'{tmp_path}:{os.environ.get("PYTHONPATH", "")}')
    monkeypatch.setenv('NUMBA_CACHE_DIR', str(tmp_path))


def test_it_walks_all_gaits_at_1_khz(hidden, start):
    process, watcher = start('-p', 'robot:=unitree_go2', '-p', 'rate:=1000.0', '-p',
                             'combined_topic:=commands', '-p', 'transition:=0.3')
    assert 'numba is not installed: there is no feedback' in process.log
    robot = load_robot('unitree_go2')
    accepted = []
    for name in find_network('delayed').presets():
        (result,) = watcher.set(gait=name)
        if result.successful:
            accepted.append(name)
            until(lambda name=name: name in watcher.gaits[-1:], name)
    assert {'trot', 'walk', 'pace', 'bound'} <= set(accepted)

    def advancing():
        phases = np.unwrap(watcher.next_phases(40), period=1.0, axis=0)
        return (np.diff(phases, axis=0) >= 0.0).all() and np.ptp(phases, axis=0).min() > 0.0

    # A leg's phase may go back while gaits change.
    until(advancing, 'phases that advance')
    assert process.alive and len(robot.joints) == 12
    # Feedback is off by default, which a calibrated robot's is not where there is numba.
    assert watcher.get('feedback.enabled') == [False]
    (result,) = watcher.set(**{'feedback.enabled': True})
    assert not result.successful
    assert result.reason == 'no feedback: it needs numba, which is not installed'


@pytest.mark.parametrize('network', ['delayed', 'quadruped'])
def test_without_feedback_numba_is_not_loaded(start, monkeypatch, tmp_path, network):
    """From an empty cache on: orbits are solved for, judged and stepped in C."""
    monkeypatch.setenv('NUMBA_CACHE_DIR', str(tmp_path))
    process, watcher = start('-p', f'network:={network}')
    assert np.ptp(watcher.next_phases(20), axis=0).max() > 0.0
    maps = Path(f'/proc/{process.pid}/maps').read_text()
    assert 'pattern-' in maps and 'llvmlite' not in maps
    assert list(tmp_path.rglob('*.so')) and not list(tmp_path.rglob('*.nbc'))
