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

"""Recording of a run for its film, its footfall diagram and its summary."""

from collections import deque
from collections.abc import Callable
import math
from pathlib import Path

from cpg_ros.networks.leg_numbers import footfall_order
from cpg_ros.simulation.body import Body
from cpg_ros.simulation.robot_model import legs, load, SimulationError
from cpg_ros.simulation.terrain import add_ground, lay, Terrain
import numpy as np

#: How much of the end of a run is kept, s: longer films and diagrams are of no use.
KEPT = 60.0
#: Pictures of a film and samples of the footfalls a second.
FRAMES, SAMPLES = 12.5, 200.0


class RunLog:
    """Records a body after each of its periods."""

    def __init__(self, body: Body, rate: float, film: Path | None = None,
                 footfalls: Path | None = None, terrain: Terrain | None = None) -> None:
        """Keep what the files need; one that is None is not made.

        Args:
            body: looked at.
            rate: of the periods, Hz.
            film: .gif or .mp4.
            footfalls: .png, .svg or .pdf.
            terrain: that the body is on; None for the flat floor.

        Raises:
            SimulationError: a file cannot be written there.

        """
        self._body, self._film, self._footfalls = body, film, footfalls
        self._terrain = terrain
        self._fps = min(FRAMES, rate)
        self._frames = _Every(rate, FRAMES)
        self._samples = _Every(rate, SAMPLES)
        self._poses: deque[np.ndarray] = deque(maxlen=round(KEPT * FRAMES))
        self._steps: deque[tuple] = deque(maxlen=round(KEPT * SAMPLES))
        self._gaits: list[tuple[float, str]] = []
        self._now = 0.0
        if footfalls is not None:
            from cpg_ros.simulation.footfall_diagram import FORMATS
            if footfalls.suffix not in FORMATS:
                raise SimulationError(f'footfalls {footfalls}: must end in {", ".join(FORMATS)}')
            if not footfalls.parent.is_dir():
                raise SimulationError(f'footfalls {footfalls}: there is no folder '
                                      f'{footfalls.parent}')
        if film is not None:
            from cpg_ros.simulation.camera import check_film
            check_film(film)

    def gait(self, name: str) -> None:
        """Note that a gait begins."""
        if not self._gaits or self._gaits[-1][1] != name:
            self._gaits.append((self._now, name))

    def look(self, now: float) -> None:
        """Record the body at a time, s, that grows from call to call."""
        self._now, body = now, self._body
        if self._film is not None and self._frames.due():
            self._poses.append(body.data.qpos.copy())
        if self._footfalls is not None and self._samples.due():
            self._steps.append((now, body.feet.copy(), body.base[:2].copy()))

    def write(self, name: str, enough: Callable[[], bool] = lambda: False) -> list[Path]:
        """Make the files and return them; ``name`` is that of the model.

        Raises:
            SimulationError, OSError: one cannot be made.

        """
        written = []
        if self._footfalls is not None and len(self._steps) > 2:
            from cpg_ros.simulation.footfall_diagram import plot_footfalls
            times, forces, places = (np.array(each) for each in zip(*self._steps, strict=True))
            begun = [gait for gait in self._gaits if gait[0] <= times[0]][-1:]
            gaits = [(max(float(times[0]), when), gait) for when, gait in
                     begun + [gait for gait in self._gaits if gait[0] > times[0]]]
            robot = self._body.robot
            measured, shown = legs(robot), footfall_order(robot.legs, robot.sides, robot.girdles)
            plot_footfalls(self._footfalls, shown, times,
                           forces[:, [measured.index(leg) for leg in shown]], places, gaits)
            written.append(self._footfalls)
        if self._film is not None and self._poses:
            from cpg_ros.simulation.camera import shoot
            terrain = self._terrain
            model = load(name, self._body.robot, visual=True, add=add_ground if terrain else None)
            if terrain is not None:
                lay(model, terrain)
            shoot(self._film, model, self._poses, self._fps, enough=enough)
            written.append(self._film)
        return written


class _Every:
    """Selects from the periods of one rate those that are due at a lower one."""

    def __init__(self, rate: float, wanted: float) -> None:
        self._share, self._sum = min(1.0, wanted / rate), 1.0

    def due(self) -> bool:
        due = self._sum >= 1.0 - 1e-9
        self._sum += self._share - (1.0 if due else 0.0)
        return due


def summary(body: Body, since: float) -> str:
    """Summarise in one line where the body is after a time, s."""
    x, y = body.base[:2]
    way = math.hypot(x, y)
    speed = way / since if since > 0.0 else 0.0
    return (f'{way:.2f} m from the start (x {x:.2f}, y {y:.2f}) in {since:.1f} s, '
            f'{speed:.2f} m/s, heading {math.degrees(body.yaw):.0f} degrees, '
            f'{"fallen" if body.fallen else "upright"}')
