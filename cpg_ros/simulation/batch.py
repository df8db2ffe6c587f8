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

"""Many runs at once, open loop: what a program publishes, and bodies that follow it on all cores.

Nothing is fed back, so that all of a run's targets are known beforehand.
"""

from collections.abc import Callable, Sequence

from cpg_ros.feedback.interpolation import periodic
from cpg_ros.motion.pattern import Pattern
from cpg_ros.motion.plan import GaitPlan
from cpg_ros.motion.strides import Drive
from cpg_ros.robots.robot import Robot
from cpg_ros.simulation.bodies import Bodies
from cpg_ros.simulation.body import Body
from cpg_ros.simulation.run_metrics import judge, RunMetrics
from cpg_ros.simulation.scenario import Scenario
import numpy as np

#: Runs whose states are kept at the same time.
TOGETHER = 12


def targets(program: GaitPlan, duration: float, timestep: float,
            strides: Sequence[float] = (), pace: float = 1.0, ramp: float = 1.0) -> np.ndarray:
    """Work out the angles that a generator publishes from the stand on.

    The ramp is the generator's own; after it the orbit is what it is, and is looked up.

    Args:
        program: the gait.
        duration: s.
        timestep: of the generator, s.
        strides: factor of each leg's stride; none for the gait as it is.
        pace: factor of the frequency.
        ramp: from the stand into the gait, s.

    Returns:
        Angles in rad in the order of the robot's controllers, shape (steps, joints).

    """
    robot = program.robot
    drive, stride = None, np.ones(len(robot.legs))
    if len(strides) or pace != 1.0:
        drive, stride = Drive(stride.size), np.array(strides or stride, dtype=float)
        drive.set_target(stride, pace, at_once=True)
    pattern = Pattern(program, ramp, drive=drive)
    steps = round(duration / timestep)
    found = np.empty((steps, len(robot.order)))
    done = 0
    while done < steps and pattern.level < 1.0:
        pattern.advance(timestep)
        found[done] = pattern.position
        done += 1
    if done < steps:
        ahead = (pattern.phases[0] - program.readout.start
                 + program.frequency * pace * timestep * np.arange(1, steps - done + 1))
        still, stride = program.in_place.angles, stride[robot.leg_of_joint, None]
        angles = still + stride * (program.readout.angles - still)
        base = robot.column('offset') + program.shift
        phases = program.orbit.phases[robot.cells]
        found[done:] = (base[:, None] + np.array([
            periodic(row, ahead + phase) for row, phase in zip(angles, phases, strict=True)])).T
    return found[:, robot.places]


class Batch(Bodies):
    """Bodies of one robot, of which as many run at once as there are cores."""

    def __init__(self, name: str, robot: Robot, kp: float | None = None,
                 kd: float | None = None, timestep: float = 0.002, threads: int = 0,
                 say: Callable[[str], None] = lambda line: None) -> None:
        """Load the model; arguments as of ``robot_model.load``; threads: 0 for all cores.

        Raises:
            SimulationError: MuJoCo is missing, or the model cannot be used.

        """
        super().__init__(Body(name, robot, kp, kd, timestep, say=say), threads)

    def run(self, runs: Sequence[tuple[np.ndarray, Scenario]]) -> list[RunMetrics]:
        """Let bodies follow targets from the stand, and judge each run.

        Args:
            runs: targets of the joints, rad, shape (steps, joints), and what is met; all as long.

        """
        found = []
        for first in range(0, len(runs), TOGETHER):
            part = runs[first:first + TOGETHER]
            control, joints, force = self.controls(len(part), len(part[0][0]))
            for k, (angles, scenario) in enumerate(part):
                joints[k], force[k] = angles, scenario.forces(len(angles), self.timestep)
            state, sensors = self.rollout([self.model(scenario) for _, scenario in part],
                                          np.tile(self.start, (len(part), 1)), control)
            found += [judge(self.body, self.parts, angles, scenario.mass, one, sensed)
                      for (angles, scenario), one, sensed
                      in zip(part, state, sensors, strict=True)]
        return found
