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

"""Against Unitree's own software; UNITREE_SDK names a folder that has it.

In it: unitree_mujoco and unitree_sdk2_python as fetched from github.com/unitreerobotics, and venv,
a Python 3.10 with cyclonedds==0.10.2 (which has wheels for no later one), numpy, mujoco, pygame.
"""

import json
import os
from pathlib import Path
import subprocess
import sys

from cpg_ros.ros.bridges.unitree.messages import LowCmd, MODELS
import numpy as np
import pytest

SUPPORT = Path(__file__).parents[2] / 'support'
FOLDER = os.environ.get('UNITREE_SDK', '')

pytestmark = [pytest.mark.unitree, pytest.mark.live, pytest.mark.skipif(
    not FOLDER, reason="UNITREE_SDK names no folder with Unitree's software")]


def run(command, **options):
    found = subprocess.run(command, capture_output=True, check=False, **options)
    assert found.returncode == 0, found.stderr[-3000:].decode()
    return json.loads(found.stdout.splitlines()[-1])


@pytest.mark.parametrize(('model', 'kind'), [('go2', 'go'), ('g1', 'hg'), ('h1_2', 'hg')])
def test_the_check_sum_is_that_of_unitrees_library(model, kind):
    rng, command, sealed = np.random.default_rng(1), LowCmd(MODELS[model]), []
    for k in range(2000):
        for part in (command.q, command.dq, command.tau, command.kp, command.kd):
            part[:] = rng.normal(0.0, 30.0, len(part))
        command.echo[:] = k % 256
        sealed.append(command.encode())
    found = run([f'{FOLDER}/venv/bin/python', SUPPORT / 'unitree_sdk_crc.py', FOLDER, kind],
                input=b''.join(sealed), env={'PATH': os.environ['PATH']})
    assert found == {'commands': 2000, 'wrong': 0}


def alone(script, *words):
    """Run a script in a network of its own."""
    name = ['unshare', '--map-root-user', '--net']
    if subprocess.run([*name, 'ip', 'link'], capture_output=True, check=False).returncode:
        pytest.skip('no network namespaces here: cyclonedds 0.10 must be alone on its network')
    return run([*name, sys.executable, SUPPORT / script, FOLDER, *words])


def test_unitrees_humanoid_hangs_walks_in_its_rack_and_crouches():
    found = alone('unitree_sdk_walk.py', '6', '0', 'g1')
    assert found['wrong'] == 0 and found['commands'] > 3000
    assert found['states'] == ['idle', 'rising', 'hanging', 'standing', 'following', 'sitting',
                               'damping']
    # The open-loop walk swings hips and knees by 0.3 rad.
    assert found['largest swing'] > 0.25 and found['largest torque'] < 139.0


def test_unitrees_robot_stands_walks_and_sits():
    found = alone('unitree_sdk_walk.py', '4', '2')
    assert found['wrong'] == 0 and found['commands'] > 10000
    assert found['fallen'] == 0 and found['switches'] == 30
    assert found['states'] == ['idle', 'rising', 'standing', 'following', 'sitting', 'damping']
    assert found['last']['height'] < 0.16
    for gait, seen in found['gaits'].items():
        assert seen['distance'] > 0.3 and seen['least height'] > 0.12, gait
