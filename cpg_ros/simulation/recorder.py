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

"""Recording of runs, offscreen pictures of a robot, films and footfall diagrams."""

from collections import deque
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing, suppress
import importlib
from itertools import chain
import math
import os
from pathlib import Path
import shutil
import subprocess
from typing import Any

from cpg_ros.common.command_line import progress_bar
from cpg_ros.motion.rotations import rpy_of
from cpg_ros.networks.leg_numbers import footfall_order
from cpg_ros.simulation.body import Body
from cpg_ros.simulation.robot_model import engine, load, SimulationError
from cpg_ros.simulation.terrain import add_ground, lay, Terrain
import numpy as np
from PIL import Image

# Recording of a run for its film, its footfall diagram and its summary.

#: MAX_DURATION: last part of a run that is kept, s; longer films and diagrams are of no use.
MAX_DURATION = 60.0
#: FRAME_RATE: pictures of a film per second; SAMPLE_RATE: samples of the footfalls per second.
FRAME_RATE, SAMPLE_RATE = 12.5, 200.0


class RunLog:
    """Records a body after each of its periods."""

    def __init__(self, body: Body, rate: float, film: Path | None = None,
                 footfalls: Path | None = None, terrain: Terrain | None = None) -> None:
        """Prepare to record for these files; a file that is None is not written.

        Args:
            body: to be recorded.
            rate: of the periods, Hz.
            film: .gif or .mp4.
            footfalls: .png, .svg or .pdf.
            terrain: that the body is on; None for the flat floor.

        Raises:
            SimulationError: a file cannot be written there.

        """
        self._body, self._film, self._footfalls = body, film, footfalls
        self._terrain = terrain
        self._fps = min(FRAME_RATE, rate)
        self._frame_due = self._sample_due = 0.0
        self._poses: deque[np.ndarray] = deque(maxlen=round(MAX_DURATION * FRAME_RATE))
        self._steps: deque[tuple] = deque(maxlen=round(MAX_DURATION * SAMPLE_RATE))
        self._gaits: list[tuple[float, str]] = []
        self._now = 0.0
        if footfalls is not None:
            from cpg_ros.analysis.gait_diagram import FORMATS
            if footfalls.suffix not in FORMATS:
                raise SimulationError(f'footfalls {footfalls}: must end in {", ".join(FORMATS)}')
            if not footfalls.parent.is_dir():
                raise SimulationError(f'footfalls {footfalls}: there is no folder '
                                      f'{footfalls.parent}')
        if film is not None:
            check_film(film)

    def gait(self, name: str) -> None:
        """Note that a gait begins."""
        if not self._gaits or self._gaits[-1][1] != name:
            self._gaits.append((self._now, name))

    def update(self, now: float) -> None:
        """Record the body at a time, s, that grows from call to call."""
        self._now, body = now, self._body
        if self._film is not None and now >= self._frame_due:
            self._frame_due += 1.0 / FRAME_RATE
            self._poses.append(body.data.qpos.copy())
        if self._footfalls is not None and now >= self._sample_due:
            self._sample_due += 1.0 / SAMPLE_RATE
            self._steps.append((now, body.feet.copy(), body.base[:2].copy()))

    def write(self, name: str, enough: Callable[[], bool] = lambda: False) -> list[Path]:
        """Write the files and return their paths; ``name`` is the model's.

        Raises:
            SimulationError, OSError: one cannot be made.

        """
        written = []
        if self._footfalls is not None and len(self._steps) > 2:
            from cpg_ros.analysis.gait_diagram import plot_footfalls
            times, forces, positions = (np.array(each) for each in zip(*self._steps, strict=True))
            begun = [gait for gait in self._gaits if gait[0] <= times[0]][-1:]
            gaits = [(max(float(times[0]), when), gait) for when, gait in
                     begun + [gait for gait in self._gaits if gait[0] > times[0]]]
            robot = self._body.robot
            measured = tuple(robot.legs)
            shown = footfall_order(measured, robot.sides, robot.girdles)
            plot_footfalls(self._footfalls, shown, times,
                           forces[:, [measured.index(leg) for leg in shown]], positions, gaits)
            written.append(self._footfalls)
        if self._film is not None and self._poses:
            terrain = self._terrain
            model = load(name, self._body.robot, visual=True, add=add_ground if terrain else None)
            if terrain is not None:
                lay(model, terrain)
            shoot(self._film, model, self._poses, self._fps, enough=enough)
            written.append(self._film)
        return written


def summary(body: Body, since: float) -> str:
    """Summarise in one line where the body is after a time, s."""
    x, y = body.base[:2]
    way = math.hypot(x, y)
    speed = way / since if since > 0.0 else 0.0
    return (f'{way:.2f} m from the start (x {x:.2f}, y {y:.2f}) in {since:.1f} s, '
            f'{speed:.2f} m/s, heading {math.degrees(body.yaw):.0f} degrees, '
            f'{"fallen" if body.fallen else "upright"}')


#: NUM_COLOURS: number of colours of a GIF; few, and no dithering, make it small.
NUM_COLOURS = 96
#: AZIMUTH, ELEVATION: direction of view, degrees: from the robot's left, ahead of it and above.
AZIMUTH, ELEVATION = -125.0, -14.0
#: CAMERA_DISTANCE: of the camera, as a multiple of the base's height in the stand.
CAMERA_DISTANCE = 4.7
#: YAW_GAIN: fraction of the robot's yaw by which the camera follows from picture to picture.
YAW_GAIN = 0.1
NO_OPENGL = ('pictures need OpenGL without a screen; on Debian and Ubuntu: apt install libegl1 '
             'libgl1-mesa-dri, or libosmesa6')
#: SHADOW_SIZE: resolution of shadows; NUM_SAMPLES: samples per pixel (0: edges are not smoothed).
SHADOW_SIZE, NUM_SAMPLES = 1024, 0


class Camera:
    """A camera at the front quarter that looks at a robot's base and moves along with it.

    To be used in the thread that made it, and closed by it.
    """

    def __init__(self, model: Any, width: int = 480, height: int = 320) -> None:
        """Open an offscreen context for a ``mujoco.MjModel``.

        Raises:
            SimulationError: there is no OpenGL.

        """
        mujoco = engine()
        self._mujoco, self._model, self._data = mujoco, model, mujoco.MjData(model)
        model.vis.global_.offwidth, model.vis.global_.offheight = width, height
        model.vis.headlight.ambient[:], model.vis.headlight.diffuse[:] = 0.4, 0.4
        # Without a graphics card these two cost as much as all the rest.
        model.vis.quality.shadowsize, model.vis.quality.offsamples = SHADOW_SIZE, NUM_SAMPLES
        free = int(np.argmax(model.jnt_type == int(mujoco.mjtJoint.mjJNT_FREE)))
        self._base = slice(model.jnt_qposadr[free], model.jnt_qposadr[free] + 7)
        self._option, self._view = mujoco.MjvOption(), mujoco.MjvCamera()
        shown = self._option.geomgroup[model.geom_group] > 0
        if 2 * len(set(model.geom_bodyid[shown])) < len(set(model.geom_bodyid)):
            # Hardly more than collision shapes, which are hidden by default.
            self._option.geomgroup[:] = 1
        self._view.azimuth, self._view.elevation = AZIMUTH, ELEVATION
        self._view.distance = 0.0
        self._rectangle = mujoco.MjrRect(0, 0, width, height)
        self._picture = np.zeros((height, width, 3), np.uint8)
        self._opengl = _opengl(width, height)
        self._opengl.make_current()
        self._scene = mujoco.MjvScene(model, maxgeom=2000)
        try:
            self._context = mujoco.MjrContext(model, mujoco.mjtFontScale.mjFONTSCALE_100)
        except mujoco.FatalError as error:
            raise SimulationError(f'{NO_OPENGL} ({error})') from error
        mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN, self._context)

    def picture(self, pose: np.ndarray) -> np.ndarray:
        """Return the picture of one pose (all of ``qpos``), uint8, shape (height, width, 3).

        The first pose sets how far away the camera stays.
        """
        mujoco, view = self._mujoco, self._view
        self._data.qpos[:] = pose
        mujoco.mj_kinematics(self._model, self._data)
        mujoco.mj_comPos(self._model, self._data)
        mujoco.mj_camlight(self._model, self._data)
        x, y, z, *turned = pose[self._base]
        gap = AZIMUTH + math.degrees(rpy_of(np.array(turned))[2]) - view.azimuth
        gap -= 360.0 * round(gap / 360.0)
        if not view.distance:
            view.distance = CAMERA_DISTANCE * z
            view.lookat[2] = 0.6 * z
            view.azimuth += gap
        view.azimuth += YAW_GAIN * gap
        view.lookat[:2] = x, y
        mujoco.mjv_updateScene(self._model, self._data, self._option, None, view,
                               mujoco.mjtCatBit.mjCAT_ALL, self._scene)
        mujoco.mjr_render(self._rectangle, self._scene, self._context)
        mujoco.mjr_readPixels(self._picture, None, self._rectangle, self._context)
        return self._picture[::-1]

    def close(self) -> None:
        """Release the OpenGL context; some drivers fail if it lasts to the end of the process."""
        self._context.free()
        self._opengl.free()


def without_opengl() -> str:
    """Return why no picture can be drawn, or ''."""
    anything = engine().MjModel.from_xml_string(
        '<mujoco><worldbody><body><freejoint/><geom size="1"/></body></worldbody></mujoco>')
    try:
        Camera(anything, 16, 16).close()
    except SimulationError as error:
        return str(error)
    return ''


def _opengl(width: int, height: int) -> Any:
    """Return a context of MUJOCO_GL's kind, or of the first that works without a screen."""
    setting = os.environ.get('MUJOCO_GL', '').strip().lower()
    kinds = (setting,) if setting in ('egl', 'osmesa', 'glfw') else ('egl', 'osmesa')
    reasons = []
    for kind in kinds:
        # What is missing shows as almost any error, down to attributes of None. A failed
        # attempt leaves its choice of a platform behind, and that may not be changed once
        # PyOpenGL is loaded.
        platform = os.environ.get('PYOPENGL_PLATFORM')
        try:
            return importlib.import_module(f'mujoco.{kind}').GLContext(width, height)
        except Exception as error:
            reasons.append(f'{kind}: {" ".join(str(error).split())[:120]}')
            if platform is None:
                os.environ.pop('PYOPENGL_PLATFORM', None)
    raise SimulationError(f'{NO_OPENGL} ({"; ".join(reasons)})')


def check_film(path: Path) -> None:
    """Check that a film can be written later.

    Raises:
        SimulationError: an unknown ending, no such folder, or no ffmpeg.

    """
    if path.suffix not in ('.gif', '.mp4'):
        raise SimulationError(f'film {path}: must end in .gif or .mp4')
    if not path.parent.is_dir():
        raise SimulationError(f'film {path}: there is no folder {path.parent}')
    if path.suffix == '.mp4' and shutil.which('ffmpeg') is None:
        raise SimulationError(f'film {path}: .mp4 needs ffmpeg (apt install ffmpeg); .gif needs '
                              'nothing more')


def write_film(path: Path, pictures: Iterator[np.ndarray], count: int, fps: float) -> None:
    """Write a film, GIF or MP4, that is at ``path`` when it is whole, and not before.

    Args:
        path: ends in .gif or .mp4.
        pictures: at least one, all of one size, uint8, shape (height, width, 3).
        count: largest number of pictures.
        fps: pictures per second.

    Raises:
        SimulationError: as ``check_film``, or ffmpeg failed.
        OSError: it cannot be written.

    """
    check_film(path)
    beside = path.with_name(f'.{path.name}.{os.getpid()}.part')
    try:
        if path.suffix == '.gif':
            _write_gif(beside, pictures, count, fps)
        else:
            _write_mp4(beside, pictures, fps)
        beside.replace(path)
    except OSError as error:
        raise OSError(error.errno, error.strerror, str(path)) from error
    finally:
        beside.unlink(missing_ok=True)


def _write_gif(path: Path, pictures: Iterator[np.ndarray], count: int, fps: float) -> None:
    """Write a GIF with the colours of its first picture."""
    images = (Image.fromarray(np.ascontiguousarray(picture)) for picture in pictures)
    first = next(images).quantize(NUM_COLOURS, dither=Image.Dither.NONE)
    # A GIF counts in hundredths of a second: what rounding leaves over is made up for.
    ends = np.round(100.0 / fps * np.arange(count + 1)).astype(int)
    first.save(path, 'GIF', save_all=True, loop=0, duration=(10 * np.diff(ends)).tolist(),
               append_images=(image.quantize(palette=first, dither=Image.Dither.NONE)
                              for image in images))


def _write_mp4(path: Path, pictures: Iterator[np.ndarray], fps: float) -> None:
    """Write an MP4 by ffmpeg."""
    first = next(pictures)
    height, width, _ = first.shape
    with subprocess.Popen(
        ['ffmpeg', '-y', '-loglevel', 'error', '-f', 'rawvideo', '-pix_fmt', 'rgb24', '-s',
         f'{width}x{height}', '-r', str(fps), '-i', '-', '-an', '-pix_fmt', 'yuv420p',
         '-movflags', '+faststart', '-f', 'mp4', str(path)],
        stdin=subprocess.PIPE, stderr=subprocess.PIPE) as ffmpeg:
        assert ffmpeg.stdin is not None
        with suppress(BrokenPipeError):
            for picture in chain([first], pictures):
                ffmpeg.stdin.write(picture.tobytes())
        _, complaint = ffmpeg.communicate()
    if ffmpeg.returncode:
        words = ' '.join(complaint.decode(errors='replace').split())
        raise SimulationError(f'ffmpeg: {words or ffmpeg.returncode}')


def shoot(path: Path, model: Any, poses: Sequence[np.ndarray], fps: float = 20.0,
          width: int = 480, height: int = 320, enough: Callable[[], bool] = lambda: False
          ) -> None:
    """Make a film of poses (all of ``qpos``) that are 1/fps s apart, with a progress bar.

    It is as short as one picture where ``enough`` says so. Without a graphics card a picture
    takes 0.1 to 0.2 s, so films are made after a run and not while it has to be in time.
    """
    with (closing(Camera(model, width, height)) as camera,
          progress_bar(f'drawing {path.name}', len(poses)) as bar):

        def pictures() -> Iterator[np.ndarray]:
            for k, pose in enumerate(poses):
                yield camera.picture(pose)
                bar(k + 1)
                if enough():
                    return

        write_film(path, pictures(), len(poses), fps)
