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

"""Films the README's robots: a Go2 that is pushed, a robot of a URDF, a humanoid.

    python docs/film.py --urdf my.urdf

tunes the robot of the URDF, as ``demo --urdf`` does, and writes docs/film.webp. Without ``--urdf``
it writes docs/run.webp, a Go2 that runs up to 2 m/s. Runs are simulated
without ROS, at the speed of the machine, and drawn without a screen. The robot's files stay in the
folder out/film, and are used again.
"""

import argparse
from collections.abc import Iterator
from contextlib import closing
from importlib.util import find_spec
from pathlib import Path
import subprocess

from cpg_ros.feedback.gains import robot_gains
from cpg_ros.motion.plan import plan
from cpg_ros.motion.robot_file import load_robot
from cpg_ros.networks.registry import PRESETS
from cpg_ros.ros.cli.executables import command
from cpg_ros.simulation import recorder
from cpg_ros.simulation.biped_run import BipedRun
from cpg_ros.simulation.closed_loop import ClosedLoopBatch
from cpg_ros.simulation.robot_model import load
from cpg_ros.simulation.scenario import impulse, Scenario
from matplotlib import get_data_path
import numpy as np
from PIL import Image, ImageDraw, ImageFont

OUT = Path(__file__).with_name('film.webp')
#: Folder for the files of the URDF's robot.
FOLDER = Path('out', 'film')
#: Pictures per second, their size, and the quality of WebP.
RATE, SIZE, QUALITY = 12.5, (1280, 720), 60
FONT = ImageFont.truetype(Path(get_data_path(), 'fonts', 'ttf', 'DejaVuSans.ttf'), 30)
#: Clips of the Go2: gait, m/s, s, push to the left, N s, at s, caption.
GO2 = (('trot', 0.6, 4.0, 30.0, 2.0, 'Unitree Go2: a push of 30 N s'),)


#: The film of the run: its file, duration in s, commands, each s and m/s; size of its pictures.
RUN, LONG, COMMANDS = OUT.with_name('run.webp'), 8.0, ((0.0, 0.4), (2.0, 1.0), (3.5, 2.0))
SMALL = (480, 270)


class Filmed(ClosedLoopBatch):
    """Bodies whose states are kept, ``states``, one a step."""

    def rollout(self, *args, **options):
        """Take a step, and keep the state of the first body after it."""
        after = super().rollout(*args, **options)
        self.states.append(after[0][0, -1, 1:1 + self.body.model.nq].copy())
        return after


def tuned(urdf: Path, gait: str) -> Path:
    """Return the tuned robot file of a URDF, made by the package's tools where it is missing."""
    FOLDER.mkdir(parents=True, exist_ok=True)
    made, best = (FOLDER / f'{urdf.stem}{end}.yaml' for end in ('', f'_{gait}'))
    for file, words in (
            (made, ['check_robot', '--urdf', urdf, '--make', made]),
            (best, ['tune', '--robot', made, '--model', urdf, '--gait', gait, '--evaluations',
                    '120', '--out', best])):
        if not file.exists():
            subprocess.run([*command(words[0]), *map(str, words[1:])], check=False)
        if not file.exists():
            raise SystemExit(f'{words[0]} has made no {file}')
    return best


def walked(robot, model: str, gait: str, scenario: Scenario, duration: float, closed: bool
           ) -> np.ndarray:
    """Return the poses of a four-legged robot, one a picture."""
    preset = PRESETS[robot.networks[0]][gait]
    gait_plan = plan(robot, gait, preset, preset.network,
                     robot.motion(gait, gait).frequency or 0.0)
    batch = Filmed(model, gait_plan)
    batch.states = []
    if not batch.run([scenario], duration, robot_gains(robot) if closed else None).upright[0]:
        raise SystemExit(f'{robot.name} falls')
    return np.array(batch.states)[::round(1.0 / RATE / batch.timestep)]


def drawn(model, poses: np.ndarray, captions: str | list[str]) -> Iterator[Image.Image]:
    """Yield the pictures of poses, with one caption or one each."""
    if isinstance(captions, str):
        captions = [captions] * len(poses)
    with closing(recorder.Camera(model, *SIZE)) as camera:
        for pose, caption in zip(poses, captions, strict=True):
            image = Image.fromarray(camera.picture(pose))
            ImageDraw.Draw(image).text((36, 650), caption, 'white', FONT, stroke_width=3,
                                       stroke_fill='#1b2733')
            yield image


def run() -> Iterator[Image.Image]:
    """Yield the pictures of the run, with the speed that is reached."""
    go2 = load_robot('unitree_go2')
    later = tuple((when, speed, 0.0, 0.0) for when, speed in COMMANDS[1:])
    poses = walked(go2, 'go2', 'run', Scenario(speed=COMMANDS[0][1], commands=later), LONG,
                   closed=True)
    captions = []
    for k, pose in enumerate(poses):
        asked = [speed for when, speed in COMMANDS if when * RATE <= k][-1]
        # Over the last half second.
        before = max(k - round(0.5 * RATE), 0)
        speed = (pose[0] - poses[before, 0]) * RATE / max(k - before, 1)
        captions.append(f'asked {asked:.1f} m/s, runs at {speed:.1f} m/s')
    yield from drawn(load('go2', go2, visual=True), poses, captions)


def pictures(args: argparse.Namespace) -> Iterator[Image.Image]:
    """Yield the pictures of the film."""
    go2 = load_robot('unitree_go2')
    for gait, speed, duration, push, when, caption in GO2:
        poses = walked(go2, 'go2', gait, Scenario(speed=speed, pushes=(
            impulse(when, 0.0, push),)), duration, closed=True)
        yield from drawn(load('go2', go2, visual=True), poses, caption)
    robot = load_robot(str(tuned(args.urdf, args.gait)))
    poses = walked(robot, str(args.urdf), args.gait, Scenario(speed=args.speed), 3.0, closed=False)
    yield from drawn(load(str(args.urdf), robot, visual=True), poses, args.caption)
    biped = load_robot(args.biped)
    found = BipedRun(args.biped, biped).run(
        5.0, ((0.5, 0.4, 0.0, 0.0),), ((3.0, *np.array([0.0, 20.0]) / 0.1),))
    yield from drawn(load(args.biped, biped, visual=True), found.poses[50::round(100 / RATE)],
                     'A humanoid walks: a push of 20 N s')


def main() -> None:
    """Draw the film."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--urdf', type=Path, help='if not given, docs/run.webp is made')
    parser.add_argument('--gait', default='trot')
    parser.add_argument('--speed', type=float, default=0.4)
    parser.add_argument('--caption', default='Your robot, from its URDF')
    parser.add_argument('--biped', default='unitree_g1' if find_spec('mjlab') else 'humanoid')
    args = parser.parse_args()
    recorder.SHADOW_SIZE, recorder.NUM_SAMPLES = 2048, 2
    out = OUT if args.urdf else RUN
    first, *others = pictures(args) if args.urdf else (one.resize(SMALL) for one in run())
    first.save(out, save_all=True, append_images=others, duration=round(1000 / RATE), loop=0,
               quality=QUALITY, method=4)
    print(f'{out}: {1 + len(others)} pictures, {out.stat().st_size / 1e6:.2f} MB')


if __name__ == '__main__':
    main()
