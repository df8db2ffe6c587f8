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

"""A biped's feedback: its kinematics beside MuJoCo's, its laws beside the inverted pendulum."""

import importlib.util
import subprocess
import sys

from cpg_ros.common.errors import InputError
from cpg_ros.feedback.biped import stepping, support
from cpg_ros.feedback.biped.feedback import gait_plan, KINDS
from cpg_ros.feedback.biped.gains import BipedGains, GAINS
from cpg_ros.feedback.biped.links import add_torques, blank_pose, kinematics, links_of, rotate
from cpg_ros.motion.body_file import GAIT_SPEEDS
from cpg_ros.motion.robot_file import load_robot
from cpg_ros.networks.library.biped import Biped
import numpy as np
import pytest
from scipy.integrate import solve_ivp

ROBOTS = ('humanoid', 'unitree_g1')
G = 9.81


def skip_without_mjlab():
    if importlib.util.find_spec('mjlab') is None:
        pytest.skip('mjlab, which has the G1, is not installed')


def model_of(name):
    """Return the model of a robot and a state of it."""
    mujoco = pytest.importorskip('mujoco')
    if name == 'unitree_g1':
        skip_without_mjlab()
    from cpg_ros.simulation.robot_model import find_model
    model = mujoco.MjModel.from_xml_path(str(find_model(name)))
    return mujoco, model, mujoco.MjData(model)


@pytest.mark.parametrize('name', ROBOTS)
def test_kinematics_and_weights_are_those_of_mujoco(name):
    mujoco, model, data = model_of(name)
    robot = load_robot(name)
    links = links_of(robot)
    pose, rng = blank_pose(links), np.random.default_rng(3)
    ids = [model.joint(joint).id for joint in robot.biped.links]
    angles, speeds = model.jnt_qposadr[ids], model.jnt_dofadr[ids]
    n, turn, quaternion = len(ids), np.zeros((3, 3)), np.zeros(4)
    center, soles, weights = np.zeros(6), np.zeros((2, 6)), np.zeros(n)
    for _ in range(20):
        rpy, joints = rng.uniform(-1.0, 1.0, 3), rng.uniform(-1.0, 1.0, n)
        turning, rates = rng.normal(size=3), rng.normal(size=n)
        rotate(*rpy, turn)
        mujoco.mju_mat2Quat(quaternion, turn.ravel())
        data.qpos[:3], data.qpos[3:7], data.qpos[angles] = 0.0, quaternion, joints
        data.qvel[:3], data.qvel[3:6], data.qvel[speeds] = 0.0, turn.T @ turning, rates
        mujoco.mj_forward(model, data)
        mujoco.mj_subtreeVel(model, data)
        kinematics(links, rpy, joints, (turning, rates), pose, center, soles, weights)
        np.testing.assert_allclose(center[:3], data.subtree_com[1], atol=1e-9)
        np.testing.assert_allclose(center[3:], data.subtree_linvel[1], atol=1e-9)
        for leg, (own, chain) in enumerate(zip(robot.legs.values(), links.chains, strict=True)):
            last = max(model.joint(joint.name).bodyid[0] for joint in own)
            linear, angular = np.zeros((2, 3, model.nv))
            mujoco.mj_jac(model, data, linear, angular, pose.soles[leg], last)
            np.testing.assert_allclose(soles[leg, :3], linear @ data.qvel, atol=1e-9)
            np.testing.assert_allclose(soles[leg, 3:], angular @ data.qvel, atol=1e-9)
            # The sole is where it is in the model: it moves with the last body.
            at_zero = np.array(robot.biped.soles[list(robot.legs)[leg]])
            body = data.xmat[last].reshape(3, 3)
            zero = mujoco.MjData(model)
            zero.qpos[:], zero.qpos[3] = 0.0, 1.0
            mujoco.mj_kinematics(model, zero)
            offset = zero.xmat[last].reshape(3, 3).T @ (at_zero - zero.xpos[last])
            np.testing.assert_allclose(pose.soles[leg], data.xpos[last] + body @ offset,
                                       atol=1e-9)
            force, moment, torques = rng.normal(size=3), rng.normal(size=3), np.zeros(len(chain))
            add_torques(links, pose, leg, pose.soles[leg], tuple(force), tuple(moment), torques)
            wanted = (linear.T @ force + angular.T @ moment)[speeds[chain - 1]]
            np.testing.assert_allclose(torques, wanted, atol=1e-9)
        data.qvel[:] = 0.0
        mujoco.mj_forward(model, data)
        np.testing.assert_allclose(weights, data.qfrc_bias[speeds], atol=1e-9)


def test_the_laws_need_no_physics_engine():
    code = ("import sys; import cpg_ros.feedback.biped.feedback as f; from cpg_ros.motion."
            "robot_file import load_robot; f.BipedFeedback(load_robot('humanoid')); "
            "print('mujoco' in sys.modules)")
    ran = subprocess.run([sys.executable, '-P', '-c', code], text=True, capture_output=True,
                         check=True)
    assert ran.stdout.strip() == 'False'


def pendulum(start, velocity, foot, height, time):
    """Integrate the linear inverted pendulum, one axis; return place and velocity."""
    found = solve_ivp(lambda _, x: [x[1], G / height * (x[0] - foot)], (0.0, time),
                      [start, velocity], rtol=1e-11, atol=1e-12)
    return found.y[:, -1]


@pytest.mark.parametrize(('speed', 'sideways'), [(0.0, 0.0), (0.3, 0.0), (-0.2, 0.1)])
def test_a_pendulum_that_steps_as_it_is_told_repeats_itself(speed, sideways):
    """An independent pendulum with the law's own steps keeps its speed, step after step."""
    gains = BipedGains()._replace(place_offset=0.0, place_x=1.0, place_y=1.0)
    height, time, wanted = 0.65, 0.5 / gains.frequency, (speed, sideways)
    rate = stepping.growth_rate(height)
    assert rate == pytest.approx(np.sqrt(G / height), rel=1e-12)
    side, feet = 1, np.zeros(2)  # the left foot swings first
    forward, inward, left = stepping.offsets(speed, sideways, rate, gains)
    # Of all motions on this capture point, one whose centre of mass begins near the middle.
    xi = np.array([forward, side * inward + left])
    place = np.array([-0.5 * speed * time, side * 0.4 * inward])
    velocity = rate * (xi - place)
    began = None
    for k in range(40):
        # The course is known at any time: a third into the step the error is 0.
        early = np.array([pendulum(place[i], velocity[i], feet[i], height, time / 3)
                          for i in range(2)])
        xi = early[:, 0] + early[:, 1] / rate - feet
        error = stepping.dcm_error(tuple(xi), side, time / 3, rate, wanted, gains)
        # Rounding grows as exp(w t) as well, which the steps correct.
        np.testing.assert_allclose(error, 0.0, atol=1e-8)
        step = stepping.step(error, side, 2.0 * time / 3, rate, wanted, gains)
        end = np.array([pendulum(place[i], velocity[i], feet[i], height, time)
                        for i in range(2)])
        place, velocity = end[:, 0], end[:, 1]
        feet, side = feet + step, -side
        if k == 19:
            began = place.copy()
    travelled = (place - began) / (20 * time)
    np.testing.assert_allclose(travelled, wanted, atol=5e-3)


def test_a_step_catches_an_error_of_the_capture_point():
    """With gains of 1 the foot lands so that the next step has no error, whatever the push."""
    gains = BipedGains()._replace(place_offset=0.0, place_x=1.0, place_y=1.0)
    time, rate = 0.5 / gains.frequency, stepping.growth_rate(0.65)
    forward, inward, _ = stepping.offsets(0.3, 0.0, rate, gains)
    xi = np.array([forward + 0.02, inward + 0.03])
    error = stepping.dcm_error(tuple(xi), 1, 0.0, rate, (0.3, 0.0), gains)
    np.testing.assert_allclose(error, [0.02, 0.03], atol=1e-12)
    foot = np.array(stepping.step(error, 1, time, rate, (0.3, 0.0), gains))
    at_touchdown = np.exp(rate * time) * xi - foot
    after = stepping.dcm_error(tuple(at_touchdown), -1, 0.0, rate, (0.3, 0.0), gains)
    np.testing.assert_allclose(after, 0.0, atol=1e-9)
    assert stepping.speed_up(error, gains) == 1.0
    assert stepping.speed_up((0.1, 0.0), gains) == pytest.approx(
        1.0 + gains.speed_up * (0.1 - gains.speed_up_from))


def test_steps_keep_to_the_reach():
    gains = BipedGains()
    assert stepping.step((9.0, 9.0), 1, 0.1, 4.0, (0.0, 0.0), gains) == (
        gains.reach_x, gains.reach_y)
    assert stepping.step((-9.0, 9.0), -1, 0.1, 4.0, (0.0, 0.0), gains) == (
        -gains.reach_x, -gains.narrowest)


def test_the_clock_shares_the_weight():
    gains, fractions = BipedGains(), np.zeros(2)
    landed = np.zeros(2, dtype=bool)
    for phase in np.linspace(0.0, 1.0, 200, endpoint=False):
        phases = np.array([phase, (phase + 0.5) % 1.0])
        stepping.load_fractions(phases, landed, gains, fractions)
        assert fractions.sum() == pytest.approx(1.0)
        for leg in range(2):
            if phases[leg] < 1.0 - gains.duty:
                assert fractions[leg] == 0.0


def test_the_ground_force_turns_the_body_by_what_is_wanted():
    gains, mass = BipedGains(), 33.0
    center = np.array([0.02, -0.03, 0.0])
    cop = (0.01, 0.02, -gains.height)
    moment = (7.0, -5.0)
    up = support.upward_force(gains.height, gains.height, 0.0, mass, gains)
    force = np.array(support.ground_force(center, cop, up, moment, gains))
    about = np.cross(np.array(cop) - center, force)
    np.testing.assert_allclose(about[:2], moment, atol=1e-9)
    assert force[2] == pytest.approx(mass * G)


@pytest.mark.parametrize(('gait', 'kind'),
                         [('run', stepping.RUNS), ('two_legged_hop', stepping.HOPS)])
def test_a_stance_throws_the_body_as_far_as_its_flight_takes(gait, kind):
    gains, dt = BipedGains.of({}, gait), 1e-4
    stance_time, cycle = stepping.spans(kind, gains)
    flying = cycle - stance_time
    assert stance_time == pytest.approx(gains.duty / gains.frequency) and flying > 0.0
    fractions = np.linspace(0.0, 1.0, 2001)
    heights, rises, forces = np.array([stepping.course(fraction, kind,
                                                       gains) for fraction in fractions]).T
    # Newton: the force less the weight accelerates, from falling to rising for half the flight.
    assert rises[[0, -1]] == pytest.approx([-0.5 * G * flying, 0.5 * G * flying])
    np.testing.assert_allclose(np.gradient(rises, stance_time * fractions)[1:-1],
                               G * (forces - 1.0)[1:-1], atol=dt * G)
    np.testing.assert_allclose(np.gradient(heights, stance_time * fractions)[1:-1], rises[1:-1],
                               atol=1e-5)
    # The impulse bears the weight through the whole cycle; height at the end is as at the start.
    assert forces.mean() * stance_time == pytest.approx(cycle, rel=1e-3)
    assert heights[0] == pytest.approx(heights[-1], abs=1e-12)
    assert heights[0] == pytest.approx(gains.height * gains.flight_height)
    assert heights[1000] == heights.min()


def test_the_force_of_a_stance_corrects_the_height_and_never_pulls():
    gains = BipedGains.of({}, 'run')
    at, speed, force = stepping.course(0.5, stepping.RUNS, gains)
    on_course = stepping.upward_force(0.5, stepping.RUNS, at, speed, 33.0, gains)
    assert on_course == pytest.approx(33.0 * G * force)
    lower = stepping.upward_force(0.5, stepping.RUNS, at - 0.01, speed, 33.0, gains)
    assert lower - on_course == pytest.approx(0.01 * gains.flight_kp)
    assert stepping.upward_force(0.5, stepping.RUNS, at + 9.0, speed, 33.0, gains) == 0.0
    assert stepping.upward_force(0.5, stepping.RUNS, at - 9.0, speed, 33.0,
                                 gains) == pytest.approx(
        stepping.MAX_FORCE * 33.0 * G)


def test_a_foot_in_flight_lands_below_where_the_body_will_be():
    gains = BipedGains.of({}, 'run')._replace(place_offset=0.0)
    stance_time = gains.duty / gains.frequency
    ahead, left = stepping.foothold((0.5, 0.0), (0.5, 0.0), 1, 0.1, gains)
    assert ahead == pytest.approx(0.5 * (0.1 + gains.flight_ahead * stance_time))
    assert left == pytest.approx(0.5 * gains.flight_width * gains.step_width)
    faster, _ = stepping.foothold((0.6, 0.0), (0.5, 0.0), 1, 0.1, gains)
    # Too fast: the foot is further ahead, which brakes.
    assert faster - ahead == pytest.approx(0.1 * (0.1 + gains.flight_ahead * stance_time
                                                  + gains.flight_x))
    _, right = stepping.foothold((0.0, 0.0), (0.0, 0.0), -1, 0.1, gains)
    assert right == pytest.approx(-left)


def test_every_gait_with_a_law_has_speeds_and_a_preset():
    assert set(KINDS) == set(GAIT_SPEEDS) <= set(Biped.presets())
    with pytest.raises(InputError, match="cannot be balanced in the gait 'skip', only in"):
        gait_plan(load_robot('humanoid'), 'skip')
    # Gains of a robot file are for the walk; they spare what only another gait has.
    assert BipedGains.of({'duty': 0.55}).duty == 0.55
    assert BipedGains.of({'duty': 0.55}, 'run').duty == 0.353


def test_a_foots_path_is_as_smooth_as_its_derivatives_say():
    gains = BipedGains()
    start, target, dt = np.array([-0.1, 0.2, 0.0]), np.array([0.2, 0.25, 0.01]), 1e-5
    out = np.zeros((3, 3, 3))
    for fraction in np.linspace(0.02, 0.95, 20):
        for k in range(3):
            stepping.path(fraction + (k - 1) * dt / 0.3, 0.3, start, target, gains, out[k])
        # Of the height only the lift is in the derivatives, by design.
        np.testing.assert_allclose(out[1, 1, :2], (out[2, 0] - out[0, 0])[:2] / (2 * dt),
                                   atol=1e-6)
        np.testing.assert_allclose(out[1, 2, :2], (out[2, 1] - out[0, 1])[:2] / (2 * dt),
                                   atol=1e-4)
    stepping.path(0.0, 0.3, start, target, gains, out[0])
    np.testing.assert_allclose(out[0, 0], start)


def test_gains_are_checked():
    assert BipedGains.of({'lift': 0.05}).lift == 0.05
    with pytest.raises(InputError, match=r"biped\.gains: 'lft' is not one of "):
        BipedGains.of({'lft': 0.05})
    with pytest.raises(InputError, match=r'biped\.gains\.duty: 0\.4 is not from 0\.501'):
        BipedGains.of({'duty': 0.4})


@pytest.mark.parametrize('gait', KINDS)
@pytest.mark.parametrize(('length', 'mass'), [(1.5, 2.3), (0.8, 0.7)])
def test_gains_go_with_size_and_mass_by_their_units(gait, length, mass):
    """Froude: gravity stays, so times go with the square root of lengths; forces with weight."""
    powers = {'m': (1.0, 0), 's': (0.5, 0), 'Hz': (-0.5, 0), '1/s': (-0.5, 0), '1/m': (-1.0, 0),
              'm/s^2': (0.0, 0), 'N/m': (-1.0, 1), 'N s/m': (-0.5, 1), 'N m': (1.0, 1),
              'N m/rad': (1.0, 1), 'N m s/rad': (1.5, 1), 'kg': (0.0, 1), 'rad': (0.0, 0),
              '': (0.0, 0)}
    usual, found = BipedGains.of({}, gait), BipedGains.of({'lift': 0.05}, gait, (length, mass))
    for name, gain in GAINS.items():
        if name == 'lift' and gait == 'walk':
            assert found.lift == 0.05
            continue
        lengths, masses = powers[gain.unit]
        expected = getattr(usual, name) * length**lengths * mass**masses
        assert getattr(found, name) == pytest.approx(min(max(expected, gain.low), gain.high)), name


def test_a_robot_without_soles_is_refused():
    with pytest.raises(InputError, match="robot file 'biped' has no part biped"):
        links_of(load_robot('biped'))
