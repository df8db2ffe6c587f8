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

"""Measurement of a gait's efference copy: the body's motion on flat ground without feedback."""

from collections.abc import Callable, Sequence
from dataclasses import replace

from cpg_ros.feedback.efference_copy import EfferenceCopy, fold, SPEEDS
from cpg_ros.motion.plan import plan
from cpg_ros.networks.registry import NETWORKS
from cpg_ros.robots.robot import Robot
from cpg_ros.simulation.closed_loop import ClosedLoop
from cpg_ros.simulation.leg_geometry import read_geometry
from cpg_ros.simulation.scenario import Scenario
import numpy as np

#: Length of a run, and of its beginning, which is left out, s.
DURATION, BEGINNING = 10.0, 3.0


def measure_efference(loop: ClosedLoop, speeds: Sequence[float] | None = None) -> EfferenceCopy:
    """Measure the motion of the body in a gait at several commanded speeds.

    Args:
        loop: bodies, whose first gait it is.
        speeds: commanded, m/s; by default as many as a table takes, from the slowest, which may
            be backward, to the fastest. A gait that cannot be steered has only its own.

    """
    commanded: Sequence[float] | np.ndarray = [0.0]
    if loop.program.motion.steering is not None:
        commanded = np.linspace(*loop.program.speeds, SPEEDS) if speeds is None else speeds
    ran = loop.run([Scenario(speed=speed) for speed in commanded], DURATION)
    first = round(BEGINNING / loop.timestep)
    # The velocity is the robot's own estimate: an error that it makes at every stride is no
    # disturbance.
    signals = np.concatenate([ran.estimated[:, :, :2], ran.angular_velocity[:, :, :2],
                              ran.rpy[:, :, :2]], axis=2)
    tables = [fold(phase[first:], one[first:])
              for phase, one in zip(ran.phase, signals, strict=True)]
    found = ran.velocity[:, first:, 0].mean(axis=1)
    rising = np.argsort(found)
    return EfferenceCopy(found[rising], np.array(tables)[rising])


def calibrated(robot: Robot, model: str, gaits: Sequence[str],
               update: Callable[[str], None] = lambda gait: None, *, kp: float | None = None,
               kd: float | None = None) -> Robot:
    """Return a robot with the geometry of a model, and with efference copies measured on it.

    A robot of whose legs feedback can displace none stays as it is.

    Args:
        robot: whose first network is used.
        model: as of ``robot_model.load``.
        gaits: that are measured; others keep theirs.
        update: called with each gait when it has been measured.
        kp: proportional gain of the joints, N m / rad; None for what is usual.
        kd: damping gain of the joints, N m s / rad; the same.

    Raises:
        SimulationError: the model cannot be used.
        Refused: a gait cannot be run.
        InputError: a robot did not go through all phases of a stride.

    """
    presets, motions = NETWORKS[robot.networks[0]].presets(), dict(robot.motions)
    for gait in gaits:
        preset, motion = presets[gait], robot.motion(gait, gait)
        program = plan(robot, gait, preset, preset.network, motion.frequency or 0.0)
        loop = ClosedLoop(model, program, kp=kp, kd=kd)
        geometry = read_geometry(loop.body, loop.parts)
        if not geometry.legs:
            return robot
        motions[gait] = replace(motion, efference=measure_efference(loop).as_table())
        robot = replace(robot, geometry=geometry)
        update(gait)
    return replace(robot, motions=motions)
