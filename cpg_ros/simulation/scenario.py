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

"""Scenarios of simulated runs: commands, pushes and ground, sensor errors, and results."""

from dataclasses import dataclass

from cpg_ros.common.errors import ShortRepr
from cpg_ros.simulation.terrain import Terrain
import numpy as np

#: PUSH_DURATION: duration of a push, s.
PUSH_DURATION = 0.1


@dataclass(frozen=True)
class Scenario:
    """Commands, ground and disturbances of a run; flat ground only by default.

    Attributes:
        friction: between feet and ground.
        mass: factor of the mass of every link.
        pushes: each (s, N, N): time, and force on the base forward and to the left for
            PUSH_DURATION s; see `impulse`.
        terrain: ground that is not flat; like all that follows, with feedback only.
        phase: of the first leg at the start of the gait, cycles.
        speed: commanded forward speed, m/s; ignored where the gait cannot be steered.
        commands: later commands, each (s, m/s forward, m/s to the left, yaw rate in rad/s).
        switches: later gaits, each (s, name).
        payload: mass on the base at its centre of mass, kg; negative for a lighter base.
        pose: of the body above its feet: height, m, roll, pitch and yaw, rad.
        kp, kd: factors of the servos' proportional and damping gains.

    """

    friction: float = 1.0
    mass: float = 1.0
    pushes: tuple[tuple[float, float, float], ...] = ()
    terrain: Terrain | None = None
    phase: float = 0.0
    speed: float = 0.4
    commands: tuple[tuple[float, float, float, float], ...] = ()
    switches: tuple[tuple[float, str], ...] = ()
    payload: float = 0.0
    pose: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 0.0)
    kp: float = 1.0
    kd: float = 1.0

    def forces(self, steps: int, timestep: float) -> np.ndarray:
        """Return the forces of the pushes in each step, N, shape (steps, 2)."""
        forces = np.zeros((steps, 2))
        for when, *force in self.pushes:
            begin = round(when / timestep)
            forces[begin:begin + round(PUSH_DURATION / timestep)] += force
        return forces


def impulse(when: float, forward: float, left: float) -> tuple[float, float, float]:
    """Return the push that begins at a time, s, with an impulse, N s."""
    return when, forward / PUSH_DURATION, left / PUSH_DURATION


@dataclass(frozen=True)
class SensorNoise:
    """Errors of sensors; noise is a standard deviation.

    Attributes:
        delay: of all measurements, s.
        force_bias, force_noise: of each foot's force, as fractions of it; the bias is drawn once.
        orientation_bias: of roll and pitch, rad; each run draws the signs once.
        gyroscope_noise, gyroscope_bias: of the angular rates, rad/s, the bias on all axes.
        accelerometer_noise, accelerometer_bias: likewise, m/s^2.
        stuck: what the sensor of the first foot shows all the time, N; None if it works.
        seed: of the random numbers.
        imu_tilt: of the whole inertial unit about its x and y axes, rad, with signs as of
            orientation_bias.

    """

    delay: float = 0.0
    force_bias: float = 0.0
    force_noise: float = 0.0
    orientation_bias: float = 0.0
    gyroscope_noise: float = 0.0
    gyroscope_bias: float = 0.0
    accelerometer_noise: float = 0.0
    accelerometer_bias: float = 0.0
    stuck: float | None = None
    seed: int = 0
    imu_tilt: float = 0.0


@dataclass(frozen=True, eq=False, repr=False)
class Outcome(ShortRepr):
    """Results of runs, and their signals after each step; the first axis is the run.

    After a run's end its last value repeats.

    Attributes:
        fell: time of the fall, s, infinite without one, shape (runs,).
        arrived: time of arrival at the goal, s, infinite without one.
        place: of the base on the ground, m, shape (runs, steps, 2).
        rpy: roll, pitch and yaw, rad, shape (runs, steps, 3).
        velocity: true one of the base in its own frame, m/s, shape (runs, steps, 3).
        estimated: estimate of the velocity.
        angular_velocity: in the base's frame, rad/s, shape (runs, steps, 3).
        phase: of the first leg, cycles, shape (runs, steps).
        kp_scale: factor of the servos' proportional gain, shape (runs, steps).
        stiff: 1 while the feedback stiffens servos, by gains or targets, else 0, the same.
        cost: of transport after run_metrics.SETTLING_TIME, shape (runs,).

    """

    fell: np.ndarray
    arrived: np.ndarray
    place: np.ndarray
    rpy: np.ndarray
    velocity: np.ndarray
    estimated: np.ndarray
    angular_velocity: np.ndarray
    phase: np.ndarray
    kp_scale: np.ndarray
    stiff: np.ndarray
    cost: np.ndarray

    @property
    def upright(self) -> np.ndarray:
        """Whether each run did not fall."""
        return np.isinf(self.fell)
