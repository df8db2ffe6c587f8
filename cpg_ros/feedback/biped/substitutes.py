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

"""Substitutes for measurements of a biped that do not arrive, for as long as it needs to stop.

For a few ticks measured values go on as their rates say. Later the sole that bears more stands for
the inertial unit: it is level and still, so the joints say how the base leans and turns. The force
that the legs were to exert accelerates the centre of mass, and from it and the joints follows how
the base accelerates. Loads on the feet are those that the clock gives them. Joints move as they
must for soles that stand to be still and those that swing to be on their paths, while the base
moves as the inertial unit says.
"""

from cpg_ros.dynamics.integration.compilation import specialised
from cpg_ros.feedback.biped.feedback import BipedFeedback
from cpg_ros.feedback.biped.gains import BipedMemory, WALK
from cpg_ros.feedback.biped.links import blank_pose, kinematics, Links
from cpg_ros.feedback.biped.stepping import WALKS
from cpg_ros.feedback.estimate import SensorData
from cpg_ros.feedback.kinematics import GRAVITY
import numpy as np

#: Inputs in the order of their ages.
IMU, JOINTS, FEET = range(3)
#: EXTRAPOLATED: age, s, up to which a measurement is extrapolated by its rate; later it is
#: replaced.
EXTRAPOLATED = 0.05
#: PROMPT: age, s, above which a measurement that has just arrived is extrapolated, too.
PROMPT = 0.008
#: FOLLOWED: rate at which a predicted sole approaches its path, 1/s; DAMPED: damping of the least
#: squares that give the rates of the joints.
FOLLOWED, DAMPED = 20.0, 1e-3
#: FASTEST: largest rate of a predicted joint, rad/s.
FASTEST = 15.0
#: LEANT: age of the inertial unit, s, from which on a sole stands for it, where joints are known.
LEANT = 0.025
#: ADOPTED: duration of the transition to orientation and angular velocity from the sole, s.
ADOPTED = 0.02


#: KEPT: ticks that are kept of the last stride.
KEPT = 512


class LastStride:
    """The commands of the last stride of a walk, which are repeated where nothing is measured.

    A steady walk is periodic: its own last commands hold the torques that legs and body need of
    each other, which no prediction of a moment later does.
    """

    def __init__(self, joints: int) -> None:
        self._commands, self._phases = np.zeros((KEPT, joints)), np.full(KEPT, np.inf)
        self._row = 0

    def record(self, balance: BipedFeedback, blind: bool, command: np.ndarray) -> None:
        """Keep the command of a tick of a walk, rad, shape (joints,), if sensors are valid."""
        if balance.mode != WALK or balance.kind != WALKS:
            self._phases[:] = np.inf
        elif not blind:
            self._commands[self._row] = command
            self._phases[self._row] = balance.memory.phases[0]
            self._row = (self._row + 1) % KEPT

    def replay(self, balance: BipedFeedback, blind: bool, command: np.ndarray) -> np.ndarray:
        """Return the command to give in place of another, rad, shape (joints,)."""
        if not blind:
            return command
        off = np.abs((self._phases - balance.memory.phases[0] + 0.5) % 1.0 - 0.5)
        row = int(np.argmin(np.where(np.isfinite(off), off, 1.0)))
        return self._commands[row] if off[row] < 0.02 else command


class Substitutes:
    """Fills the gaps in the measurements of one biped; a tick allocates little.

    Attributes:
        sensors: measurements with the gaps filled, overwritten by ``fill``.
        suspect: the joint whose own measurement is not to be used, in the links' order; None for
            none.

    """

    def __init__(self, links: Links) -> None:
        """Prepare for a robot's links."""
        joints = len(links.masses) - 1
        self._links, self._pose = links, blank_pose(links)
        self.suspect: int | None = None
        self.sensors = SensorData.zeros(1, len(links.chains), joints)
        self._still, self._angles = np.zeros(3), np.zeros(joints)
        self._center, self._soles, self._weights = np.zeros(6), np.zeros((2, 6)), np.zeros(joints)
        self._kinematics = specialised(kinematics, links, self._still,
                                       self.sensors.joint_positions[0],
                                 (self._still, self.sensors.joint_velocities[0]), self._pose,
                                 self._center, self._soles, self._weights)

    def fill(self, measured: SensorData, ages: np.ndarray, latencies: np.ndarray,
             memory: BipedMemory, dt: float) -> SensorData:
        """Return the present measurements, with substitutes for those that are late.

        Args:
            measured: the last valid ones.
            ages: time since those of inertial unit, joints and feet arrived, s, shape (3,).
            latencies: time since they were measured, s, shape (3,).
            memory: of the feedback at its last tick.
            dt: of a tick, s; younger measurements are taken as they are.

        """
        sensors = self.sensors
        for own, newest in zip(sensors, measured, strict=True):
            own[:] = newest
        late = ages > 1.5 * dt
        if late[JOINTS]:
            self._move(memory, dt)
        else:
            self._take_joints(latencies[JOINTS], memory, dt)
        time = max(ages[IMU], latencies[IMU])
        if late[IMU] or time > PROMPT:
            self._turn(measured, min(time, EXTRAPOLATED))
        begins = EXTRAPOLATED if late[JOINTS] else LEANT
        if ages[IMU] > begins:
            # In a stand, one that arrives but is not believed may be that of a robot on its edges.
            pushed = latencies[IMU] < LEANT and not memory.swinging.any()
            self._lean_on_sole(memory, min((ages[IMU] - begins) / ADOPTED, 1.0), dt, pushed)
        if late[IMU] and late[JOINTS]:
            # Neither input tells how the base turns: let its angular velocity fade.
            sensors.angular_velocity[0] *= max(1.0 - ages.min() / EXTRAPOLATED, 0.0)
        if ages[FEET] > EXTRAPOLATED:
            weight = GRAVITY * memory.pose.carried[0]
            sensors.foot_forces[0] = np.where(memory.swinging, 0.0, weight * memory.fractions)
        return sensors

    def sole_tilts(self, sensors: SensorData) -> np.ndarray:
        """Return how far each sole leans forward and left by IMU and joints, rad, shape (2, 2)."""
        rpy = np.array([*sensors.rpy[0, :2], 0.0])
        self._kinematics(self._links, rpy, sensors.joint_positions[0],
                         (self._still, sensors.joint_velocities[0]), self._pose, self._center,
                         self._soles, self._weights)
        return self._pose.rotations[self._links.chains[:, -1], :2, 2].copy()

    def _take_joints(self, latency: float, memory: BipedMemory, dt: float) -> None:
        """Take the joints as measured a latency in s ago, but for the suspect."""
        angles, rates = self.sensors.joint_positions[0], self.sensors.joint_velocities[0]
        if latency > PROMPT:
            angles += min(latency, EXTRAPOLATED) * rates
        suspect = self.suspect
        if suspect is None:
            self._angles[:] = angles
            return
        measured, measured_rates = angles.copy(), rates.copy()
        self._move(memory, dt)
        predicted, rate = self._angles[suspect], rates[suspect]
        angles[:], rates[:] = measured, measured_rates
        angles[suspect], rates[suspect] = predicted, rate
        self._angles[:] = angles

    def _move(self, memory: BipedMemory, dt: float) -> None:
        """Predict the joints of the legs dt in s later."""
        pose, rates = memory.pose, self.sensors.joint_velocities[0]
        rates[:] = 0.0
        for leg, chain in enumerate(self._links.chains):
            sole = pose.soles[leg]
            columns = np.vstack([np.cross(pose.axes[chain], sole - pose.places[chain]).T,
                                 pose.axes[chain].T])
            moved = -np.concatenate([memory.base + np.cross(memory.turning, sole),
                                     memory.turning])
            if memory.swinging[leg]:
                moved[:3] += memory.path[1] + FOLLOWED * (memory.path[0] - sole)
            rates[chain - 1] = columns.T @ np.linalg.solve(
                columns @ columns.T + DAMPED * np.eye(6), moved)
        self._angles += dt * np.clip(rates, -FASTEST, FASTEST)
        self.sensors.joint_positions[0] = self._angles

    def _turn(self, measured: SensorData, time: float) -> None:
        """Extrapolate the orientation by the angular velocity for a time in s."""
        roll, pitch, _ = measured.rpy[0]
        x, y, z = measured.angular_velocity[0]
        c, s, cosine = np.cos(roll), np.sin(roll), max(np.cos(pitch), 0.1)
        about = (s * y + c * z) / cosine
        self.sensors.rpy[0] += time * np.array([x + np.sin(pitch) * about, c * y - s * z, about])

    def _lean_on_sole(self, memory: BipedMemory, fraction: float, dt: float,
                      pushed: bool) -> None:
        """Set lean and rates of the base from the joints of the leg that bears more."""
        sensors, pose = self.sensors, self._pose
        self._kinematics(self._links, self._still, sensors.joint_positions[0],
                         (self._still, sensors.joint_velocities[0]), pose, self._center,
                         self._soles, self._weights)
        # By the loads, as a foot that is late is not level yet when the clock has it land.
        leg = int(memory.loads[1] > memory.loads[0])
        # The base seen from the sole: the sole's rotation from the base, transposed.
        up = pose.rotations[self._links.chains[leg, -1]][:, 2]
        lean = np.array([np.arctan2(up[1], up[2]), np.arcsin(-np.clip(up[0], -1.0, 1.0))])
        rpy = sensors.rpy[0]
        rpy[:2] += fraction * (lean - rpy[:2])
        rpy[2] = memory.heading[0]
        turning = -self._soles[leg, 3:]
        sensors.angular_velocity[0] += fraction * (turning - sensors.angular_velocity[0])
        # The centre of mass goes as the force of the last tick moves it, and the base as it has
        # to while legs move against it.
        turn = memory.pose.rotations[0]
        self._kinematics(self._links, rpy, sensors.joint_positions[0],
                         (turn @ sensors.angular_velocity[0], sensors.joint_velocities[0]), pose,
                         self._center, self._soles, self._weights)
        moved = memory.force / pose.carried[0] - (
            self._center[3:] - memory.center[1] + memory.base) / dt
        moved[2] += GRAVITY - memory.force[2] / pose.carried[0]
        if pushed:
            # Feet on their edges do not exert that force: it topples about the middle of a sole.
            center, sole = memory.center[0], memory.pose.soles[int(np.argmax(memory.fractions))]
            moved = GRAVITY / max(center[2] - sole[2], 0.1) * (center - sole)
            moved[2] = GRAVITY
        sensors.acceleration[0] = turn.T @ moved
