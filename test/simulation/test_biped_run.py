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

"""A humanoid in physics walks, turns, stops and survives pushes, runs and hops by the network."""

from dataclasses import replace
from functools import cache
import importlib.util
import math
import re

from cpg_ros.feedback.biped.feedback import BipedFeedback, gait_plan
from cpg_ros.feedback.biped.gains import BipedGains, WALK
from cpg_ros.motion.robot_file import load_robot
from cpg_ros.simulation.robot_setup import check_robot
from depth import in_depth
import numpy as np
import pytest

mujoco = pytest.importorskip('mujoco')

from cpg_ros.simulation.biped_run import BipedRun  # noqa: E402
from cpg_ros.simulation.robot_model import find_model, SimulationError  # noqa: E402
from cpg_ros.simulation.robot_setup.model_reading import read_biped  # noqa: E402
from cpg_ros.simulation.scenario import impulse, SensorNoise  # noqa: E402
from cpg_ros.simulation.terrain import START_SIZE, Terrain  # noqa: E402

#: Sensors as of benchmarks/bench_humanoid.py.
NOISE = SensorNoise(delay=0.004, gyroscope_noise=0.02, accelerometer_noise=0.1, force_noise=0.05)
STOP = (math.nan, 0.0, 0.0)
DIRECTIONS = [(1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0)]


@cache
def runner(name='humanoid'):
    if name == 'unitree_g1' and importlib.util.find_spec('mjlab') is None:
        pytest.skip('mjlab, which has the G1, is not installed')
    return BipedRun(name, load_robot(name), NOISE)


@pytest.mark.parametrize('name', ['humanoid', 'unitree_g1'])
@pytest.mark.parametrize('speed', [0.5, -0.2, *in_depth(0.0, 0.3)])
def test_it_walks_as_fast_as_it_is_told(name, speed):
    found = runner(name).run(12.0, ((1.0, speed, 0.0, 0.0),), seed=7)
    assert math.isinf(found.fell)
    assert abs(found.speed[0] - speed) < max(0.1 * abs(speed), 0.02)
    # 10 s at 1.65 strides a second.
    assert found.steps > 28 and found.tilt < 0.3


@pytest.mark.parametrize('error', ['orientation_bias', 'imu_tilt'])
@pytest.mark.parametrize('name', ['humanoid', 'unitree_g1'])
def test_it_finds_the_roll_of_a_tilted_imu_and_walks_straight(name, error):
    run = runner(name)
    run.noise = replace(NOISE, **{error: 0.04})
    try:
        for seed in (3, 5):
            feedback = BipedFeedback(run.robot)
            found = run.run(10.0, ((1.0, 0.3, 0.0, 0.0),), feedback=feedback, seed=seed)
            assert math.isinf(found.fell)
            assert abs(found.speed[1]) < 0.05
            assert abs(abs(feedback.memory.roll_error) - 0.04) < 0.012
    finally:
        run.noise = NOISE


def test_the_cost_of_transport_counts_all_motors_and_no_work_that_joints_give_back(monkeypatch):
    run, work = runner(), []
    body, step = run.body, run.body.step
    dofs = body.model.jnt_dofadr[body.model.actuator_trnid[:, 0]]
    assert run.robot.held and len(dofs) == len(run.robot.order) + len(run.robot.held)

    def counted():
        step()
        power = body.data.qfrc_actuator[dofs] * body.data.qvel[dofs]
        work.append(power[power > 0.0].sum() * run.dt)

    monkeypatch.setattr(body, 'step', counted)
    found = run.run(5.0, ((0.5, 0.4, 0.0, 0.0),), seed=7)
    distance = math.dist(found.path[-1, 1:3], found.path[0, 1:3])
    assert found.cost == pytest.approx(sum(work) / (9.81 * body.mass * distance))


def test_it_turns_and_goes_sideways():
    turned = runner().run(12.0, ((1.0, 0.2, 0.0, 0.3),), seed=8)
    assert math.isinf(turned.fell)
    yaw = np.unwrap(turned.path[:, 4])
    late = turned.path[:, 0] > 5.0
    rate = np.polyfit(turned.path[late, 0], yaw[late], 1)[0]
    assert rate == pytest.approx(0.3, abs=0.03)
    aside = runner().run(12.0, ((1.0, 0.0, 0.1, 0.0),), seed=9)
    assert math.isinf(aside.fell)
    assert aside.speed[1] == pytest.approx(0.1, abs=0.03)


@pytest.mark.parametrize('rounds', [3, *in_depth(10)])
def test_it_stands_walks_and_stands_again(rounds):
    robot = runner().robot
    feedback = BipedFeedback(robot)
    commands = [(8.0 * k + 1.0, 0.3, 0.0, 0.0) for k in range(rounds)]
    commands += [(8.0 * k + 5.0, *STOP) for k in range(rounds)]
    found = runner().run(8.0 * rounds, tuple(commands), feedback=feedback, seed=10)
    # The network is where its clock is from the first step of every walk, not of the first only.
    assert math.isinf(found.fell) and not feedback.state.faults
    time, x = found.path[:, 0], found.path[:, 1]
    for k in range(rounds):
        # It walks in between, and stands at the end of each round.
        rest = x[(time > 8.0 * k + 7.5) & (time < 8.0 * k + 8.0)]
        assert np.ptp(rest) < 0.02, k
    assert x[-1] > rounds * 0.6


@pytest.mark.parametrize('name', ['humanoid', 'unitree_g1'])
@pytest.mark.parametrize(('gait', 'speed', 'flight'), [
    ('run', 1.0, 0.3), ('two_legged_hop', 0.0, 0.25), *in_depth(('run', 0.5, 0.3))])
def test_it_runs_and_hops_off_the_ground(name, gait, speed, flight):
    run = runner(name)
    feedback = BipedFeedback(run.robot, plan=gait_plan(run.robot, gait))
    found = run.run(10.0, ((1.0, speed, 0.0, 0.0),), feedback=feedback, seed=13)
    assert math.isinf(found.fell) and not feedback.state.faults
    assert found.speed[0] == pytest.approx(speed, abs=0.03)
    assert found.flight > flight and found.tilt < 0.25


def test_it_changes_between_walk_run_hop_and_stand():
    run = runner()
    feedback = BipedFeedback(run.robot)
    gaits = ((4.0, 'run'), (10.0, 'walk'), (16.0, 'two_legged_hop'), (22.0, 'run'),
             (28.0, 'walk'))
    commands = ((1.0, 0.3, 0.0, 0.0), (12.0, *STOP), (15.0, 0.0, 0.0, 0.0), (22.0, 0.3, 0.0, 0.0),
                (26.0, *STOP), (30.0, 0.2, 0.0, 0.0))
    found = run.run(34.0, commands, feedback=feedback, seed=14, gaits=gaits)
    assert math.isinf(found.fell) and found.tilt < 0.25 and not feedback.state.faults
    assert feedback.plan.gait == 'walk' and feedback.state.mode == WALK and not feedback.changing
    time, x = found.path[:, 0], found.path[:, 1]
    # It stands still before the hop, and after the run that was told to stand.
    for begin, end in ((14.5, 15.0), (29.5, 30.0)):
        assert np.ptp(x[(time > begin) & (time < end)]) < 0.03
    running = (time > 7.0) & (time < 10.0)
    assert np.ptp(x[running]) == pytest.approx(0.9, abs=0.1)


@pytest.mark.parametrize('name', ['humanoid', *in_depth('unitree_g1')])
@pytest.mark.parametrize(('wish', 'gait'), [
    (STOP, 'run'), ((1.0, 0.0, 0.0), 'walk'), ((0.0, 0.0, 0.0), 'two_legged_jump')])
def test_a_fast_run_slows_down_before_it_becomes_a_walk(name, wish, gait):
    # Turned into a walk at 1 m/s, it fell 14 times of 16.
    run = runner(name)
    feedback = BipedFeedback(run.robot, plan=gait_plan(run.robot, 'run'))
    found = run.run(14.0, ((1.0, 1.0, 0.0, 0.0), (8.3, *wish)), feedback=feedback, seed=21,
                    gaits=((8.3, gait),))
    assert math.isinf(found.fell) and found.tilt < 0.3
    time, x = found.path[:, 0], found.path[:, 1]
    ran, after = (time > 7.0) & (time < 8.0), (time > 13.0) & (time < 14.0)
    assert np.ptp(x[ran]) == pytest.approx(1.0, abs=0.05)
    # A walk goes no faster than it can, whatever is wished of it.
    assert np.ptp(x[after]) == pytest.approx(0.6 if gait == 'walk' else 0.0, abs=0.08)
    assert not feedback.changing and not feedback.state.faults


def test_arms_swing_by_the_cells_and_take_yaw_from_the_walk():
    run, found = runner(), {}
    robot = run.robot
    links = {name: replace(link, swing=0.0) for name, link in robot.biped.links.items()}
    still = replace(robot, biped=replace(robot.biped, links=links))
    for key, one in (('swinging', robot), ('still', still)):
        feedback, angles, rates = BipedFeedback(one), [], []
        advance = feedback.advance

        def noted(sensors, dt, advance=advance, feedback=feedback, angles=angles, rates=rates):
            command = advance(sensors, dt)
            angles.append((feedback.arms.positions.copy(), feedback.track.legs.copy()))
            rates.append(feedback.memory.turning[2])
            return command

        feedback.advance = noted
        assert math.isinf(run.run(10.0, ((1.0, 0.4, 0.0, 0.0),), feedback=feedback, seed=15).fell)
        found[key] = angles, np.array(rates[2000:])
    left = list(robot.held).index('left_shoulder_joint')
    angles, legs = map(np.array, zip(*found['swinging'][0][2000:], strict=True))
    assert angles[:, left].min() == pytest.approx(-0.2, abs=0.01)
    assert angles[:, left].max() == pytest.approx(0.2, abs=0.01)
    # Forward is negative: an arm is furthest forward after the other leg's flexor has peaked.
    forward = legs[np.argmin(angles[:, left]), 1]
    assert 0.1 < forward < 0.4
    assert not np.ptp(np.array([one for one, _ in found['still'][0]]), axis=0).any()
    assert found['swinging'][1].std() < 0.9 * found['still'][1].std()


def test_a_robot_file_that_begins_with_the_right_leg_walks_as_well():
    robot = load_robot('humanoid')
    other = replace(robot, legs=dict(reversed(list(robot.legs.items()))))
    run = BipedRun('humanoid', other, NOISE)
    commands = ((1.0, 0.3, 0.0, 0.0), (8.0, 0.2, 0.1, 0.2))
    found = run.run(14.0, commands, (impulse(5.0, 0.0, 15.0),), seed=16)
    assert math.isinf(found.fell) and found.tilt < 0.3
    assert found.speed[0] == pytest.approx(0.25, abs=0.05)


@pytest.mark.parametrize('number', [0, 1, *in_depth(2, 3)])
def test_it_survives_pushes_by_placing_its_feet(number):
    push = impulse(6.0, *(20.0 * np.array(DIRECTIONS[number])))
    commands = ((1.0, 0.3, 0.0, 0.0),)
    assert math.isinf(runner().run(11.0, commands, (push,), seed=number).fell)
    robot = runner().robot
    fixed = BipedFeedback(robot)
    fixed.set_gains('walk', BipedGains.of({'place_x': 0.0, 'place_y': 0.0}))
    assert math.isfinite(runner().run(11.0, commands, (push,), fixed, number).fell)


def test_the_velocity_is_estimated_without_bias():
    run, found = runner(), []
    feedback = BipedFeedback(run.robot)
    advance = feedback.advance

    def noted(sensors, dt):
        command = advance(sensors, dt)
        found.append((feedback.memory.velocity - run.body.rates[:3]).copy())
        return command

    feedback.advance = noted
    run.run(10.0, ((1.0, 0.3, 0.0, 0.0),), feedback=feedback, seed=11)
    off = np.array(found[1500:])
    assert np.abs(off[:, :2].mean(axis=0)).max() < 0.01
    assert off[:, :2].std(axis=0).max() < 0.05


def test_the_robot_file_is_what_the_model_says():
    robot = load_robot('humanoid')
    read = read_biped('humanoid', robot)
    # The shipped one walks with the G1's gains, servos among them, and its arms swing.
    links = {name: replace(link, cell=0, swing=0.0) for name, link in robot.biped.links.items()}
    made = {name: replace(link, kp=links[name].kp, kd=links[name].kd)
            for name, link in read.links.items()}
    assert replace(read, links=made, gains={}, scale=(1.0, 1.0)) == replace(
        robot.biped, links=links)
    assert read.scale == (pytest.approx(1.05, abs=0.01), pytest.approx(0.978, abs=0.001))


def test_the_usual_gains_are_those_of_a_robot_of_the_g1s_size():
    read = read_biped('unitree_g1', runner('unitree_g1').robot)
    assert read.scale == (1.0, 1.0)
    assert all(link.kp == min(link.effort, 100.0) for link in read.links.values())


@pytest.mark.parametrize('joints', [6, 5])
def test_a_robot_file_made_from_a_model_alone_walks(tmp_path, joints):
    text = find_model('humanoid').read_text()
    if joints == 5:
        text = re.sub(r'<joint name="(left|right)_hip_yaw_joint"[^>]*>', '', text)
    model = tmp_path / 'mine.xml'
    model.write_text(text)
    made = tmp_path / 'mine.yaml'
    assert check_robot.main(['--mjcf', str(model), '--make', str(made)]) == 0
    robot = load_robot(made)
    assert {len(leg) for leg in robot.legs.values()} == {joints}
    found = BipedRun(str(model), robot, NOISE).run(12.0, ((1.0, 0.3, 0.0, 0.0),), seed=12)
    assert math.isinf(found.fell)
    assert found.speed[0] == pytest.approx(0.3, abs=0.03)


def as_urdf(model):
    """The humanoid's bodies, joints and shapes as a URDF: its axes are parallel, with all at 0."""
    names = {body: f'link{body}' for body in range(1, model.nbody)}
    parts = []
    for body, name in names.items():
        mass, center = model.body_mass[body], model.body_ipos[body]
        turn = np.zeros(9)
        mujoco.mju_quat2Mat(turn, model.body_iquat[body])
        axes = turn.reshape(3, 3)
        i = axes @ np.diag(model.body_inertia[body]) @ axes.T
        shapes = []
        for geom in np.flatnonzero(model.geom_bodyid == body):
            size, kind = model.geom_size[geom], mujoco.mjtGeom(model.geom_type[geom])
            shape = {mujoco.mjtGeom.mjGEOM_BOX: f'<box size="{2 * size[0]} {2 * size[1]} '
                                                f'{2 * size[2]}"/>',
                     mujoco.mjtGeom.mjGEOM_SPHERE: f'<sphere radius="{size[0]}"/>',
                     mujoco.mjtGeom.mjGEOM_CAPSULE: f'<cylinder radius="{size[0]}" length="'
                                                    f'{2 * size[1]}"/>'}[kind]
            w, x, y, z = model.geom_quat[geom]
            rpy = (math.atan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y)),
                   math.asin(np.clip(2 * (w * y - z * x), -1, 1)),
                   math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z)))
            shapes.append(f'<collision><origin xyz="{" ".join(map(str, model.geom_pos[geom]))}" '
                          f'rpy="{" ".join(map(str, rpy))}"/><geometry>{shape}</geometry>'
                          '</collision>')
        parts.append(
            f'<link name="{name}"><inertial><origin xyz="{" ".join(map(str, center))}"/>'
            f'<mass value="{mass}"/><inertia ixx="{i[0, 0]}" iyy="{i[1, 1]}" izz="{i[2, 2]}" '
            f'ixy="{i[0, 1]}" ixz="{i[0, 2]}" iyz="{i[1, 2]}"/></inertial>{"".join(shapes)}'
            '</link>')
        joint = model.body_jntadr[body]
        if (parent := model.body_parentid[body]) == 0:
            continue
        assert model.body_jntnum[body] == 1 and not model.jnt_pos[joint].any()
        low, high = model.jnt_range[joint]
        parts.append(
            f'<joint name="{model.joint(joint).name}" type="revolute"><parent link="'
            f'{names[parent]}"/><child link="{name}"/><origin xyz="'
            f'{" ".join(map(str, model.body_pos[body]))}"/><axis xyz="'
            f'{" ".join(map(str, model.jnt_axis[joint]))}"/><limit lower="{low}" upper="{high}" '
            f'effort="{model.jnt_actfrcrange[joint][1]}" velocity="20"/></joint>')
    return f'<robot name="made">{"".join(parts)}</robot>'


def test_a_robot_file_made_from_a_urdf_alone_walks(tmp_path):
    urdf, made = tmp_path / 'mine.urdf', tmp_path / 'mine.yaml'
    urdf.write_text(as_urdf(mujoco.MjModel.from_xml_path(str(find_model('humanoid')))))
    assert check_robot.main(['--urdf', str(urdf), '--make', str(made)]) == 0
    robot = load_robot(made)
    shipped = load_robot('humanoid').biped
    assert robot.biped.total == pytest.approx(shipped.total)
    for leg, place in shipped.soles.items():
        assert robot.biped.soles[leg] == pytest.approx(place, abs=1e-6)
    found = BipedRun(str(urdf), robot, NOISE).run(12.0, ((1.0, 0.3, 0.0, 0.0),), seed=12)
    assert math.isinf(found.fell)
    assert found.speed[0] == pytest.approx(0.3, abs=0.03)


def test_where_the_g1_comes_from_is_said(monkeypatch):
    monkeypatch.setattr('importlib.util.find_spec', lambda name: None)
    with pytest.raises(SimulationError, match='pip install --no-deps mjlab'):
        find_model('unitree_g1')


@pytest.mark.parametrize('angle', [3.0, -3.0])
def test_it_climbs_and_descends_a_ramp(angle):
    """As high as the ramp is where it is, which begins START_SIZE ahead."""
    run = BipedRun('humanoid', load_robot('humanoid'), NOISE, terrain=Terrain('ramp', angle))
    found = run.run(12.0, ((1.0, 0.3, 0.0, 0.0),), seed=15)
    assert math.isinf(found.fell)
    assert found.speed[0] == pytest.approx(0.3, abs=0.05)
    # From where it walks, which is lower than it stands, but before the ramp.
    x, z = found.path[found.path[:, 1] > START_SIZE - 0.1][[0, -1]].T[[1, 3]]
    assert x[1] > 2.0
    rise = (x[1] - START_SIZE) * math.tan(math.radians(angle))
    assert z[1] - z[0] == pytest.approx(rise, abs=0.03)
