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

"""A biped that stands and walks by a network's clock: sensors in, joint positions out."""

from collections.abc import Callable

from cpg_ros.errors import InputError
from cpg_ros.feedback.biped.gains import BipedGains
from cpg_ros.feedback.biped.links import links_of
from cpg_ros.feedback.biped.memory import BipedMemory, SHIFT, STAND, WALK
from cpg_ros.feedback.biped.tick import tick
from cpg_ros.feedback.estimate import SensorData
from cpg_ros.integration.jit import bound
from cpg_ros.motion.plan import GaitPlan, plan
from cpg_ros.motion.track import Track
from cpg_ros.networks.registry import NETWORKS
from cpg_ros.robots.robot import Robot
import numpy as np

#: Time in which the weight goes to the right foot before the first step, and until that, s.
SHIFTING, FIRST_STEP = 0.8, 1.0
#: At most this fast, m/s, and with this error of the capture point, m, a walk ends on two feet.
STILL, CAUGHT = 0.15, 0.05


class BipedFeedback:
    """Balance of one biped with soles; a tick allocates nothing but what the network's clock does.

    Attributes:
        robot: whose feedback it is.
        links: of the robot.
        gains: of the laws; may be replaced between ticks.
        memory: state and output of the laws.
        mode: STAND, SHIFT or WALK.
        order: names of the joints in the order of the sensors and links.
        rows: place of each joint of ``robot.order`` in that order, shape (joints,).
        program: the gait whose orbit is the clock.
        track: the network that runs it.
        faults: how often the network left its orbit and was put back.
        torques: wanted of the joints in ``robot.order``, N m, shape (joints,).
        positions: the same as targets of servos, rad.

    """

    def __init__(self, robot: Robot, gains: BipedGains | None = None,
                 program: GaitPlan | None = None) -> None:
        """Prepare to stand.

        Args:
            robot: whose robot file has the part ``biped``.
            gains: of the laws; the robot file's if not given.
            program: gait whose orbit is the clock; the walk of the robot's first network if not
                given.

        Raises:
            InputError: the robot file has no such part, or bad gains.
            PlanError: the gait cannot be run.

        """
        self.robot, self.links = robot, links_of(robot)
        biped = robot.biped
        if biped is None or len(robot.legs) != 2:
            raise InputError(f"robot '{robot.name}' has no two legs with soles")
        self.gains = gains or BipedGains.of(biped.gains)
        if program is None:
            network = NETWORKS[robot.networks[0]]
            preset = network.presets()[network.usual_gait]
            program = plan(robot, preset.gait, preset, preset.network, 0.0)
        self.program, self.track, self.faults = program, Track(program, 0.0), 0
        self.memory, self.mode = BipedMemory.empty(self.links), STAND
        self.order = list(biped.links)
        self.rows = np.array([self.order.index(name) for name in robot.order])
        # Their places among the legs' torques.
        chained = (self.links.chains - 1).ravel().tolist()
        self._places = np.array([chained.index(row) for row in self.rows])
        self._kp = np.array([biped.links[name].kp for name in robot.order])
        self.torques, self.positions = np.zeros((2, len(robot.order)))
        self._command, self._walks = np.zeros(3), False
        self._time = 0.0
        self._ready = False
        self._tick: Callable | None = None
        self._bound: BipedGains | None = None

    def restart(self) -> None:
        """Stand, and know nothing of what has been, as after a fall."""
        self.memory, self.mode = BipedMemory.empty(self.links), STAND
        self._time, self._ready = 0.0, False

    def walk(self, forward: float, left: float = 0.0, turn: float = 0.0) -> None:
        """Walk with this velocity, m/s, and rate of turning, rad/s, from now on."""
        self._command[:] = forward, left, turn
        self._walks = True

    def stand(self) -> None:
        """Stop walking, and stand on both legs as soon as the body is slow enough."""
        self._command[:] = 0.0
        self._walks = False

    def advance(self, sensors: SensorData, dt: float) -> np.ndarray:
        """Return where the servos are to be driven, rad, shape (joints,), by ``robot.order``.

        Args:
            sensors: of one run, joints by ``order``.
            dt: since the last time, s.

        """
        memory = self.memory
        if not self._ready:
            memory.heading[0] = sensors.rpy[0, 2]
            self._ready = True
        self._choose(dt)
        step = dt, min(self._time / SHIFTING, 1.0)
        arguments = (self.links, self.gains, memory, sensors, self._command, self.mode, step)
        if self._tick is None or self._bound is not self.gains:
            self._tick, self._bound = bound(tick, *arguments), self.gains
        self._tick(*arguments)
        if self.mode == WALK:
            quick, leap = memory.clock
            if not self.track.advance(leap + quick * self.gains.frequency * dt):
                self.faults += 1
                self.track.reseed()
        np.take(memory.torque, self._places, out=self.torques)
        np.divide(self.torques, self._kp, out=self.positions)
        self.positions += sensors.joint_positions[0, self.rows]
        return self.positions

    def follow(self, track: Track) -> None:
        """Take another plan's network as the clock, at its frequency, in the phase that it is."""
        track.align(self.track.phase)
        self.track, self.program = track, track.program
        self.gains = self.gains._replace(frequency=self.program.frequency)

    def _choose(self, dt: float) -> None:
        """Change the mode where it is time, and read the clock."""
        memory = self.memory
        if self.mode == WALK:
            legs = self.track.legs
            half = 0.5 * (1.0 - self.gains.duty)
            memory.phases[0], memory.phases[1] = (legs[0] + half) % 1.0, (legs[1] + half) % 1.0
            if not self._walks and self._slow():
                self.mode, self._time = STAND, 0.0
            return
        self._time += dt
        if not self._walks:
            self.mode, self._time = STAND, 0.0
        elif self.mode == STAND:
            self.mode, self._time = SHIFT, 0.0
        elif self._time >= FIRST_STEP:
            self._start()

    def _slow(self) -> bool:
        memory = self.memory
        both = not memory.swinging.any() and bool((memory.shares > 0.0).all())
        return (both and np.abs(memory.wanted).max() < 1e-6
                and np.abs(memory.center[1, :2]).max() < 2.0 * STILL
                and np.abs(memory.error).max() < CAUGHT)

    def _start(self) -> None:
        """Start the clock in the middle of both feet's stance before the left one lifts off."""
        memory, duty = self.memory, self.gains.duty
        self.mode = WALK
        memory.wanted[:] = memory.integral[:] = 0.0
        memory.clock[:] = 1.0, 0.0
        self.track.reseed()
        self.track.align((1.0 - 0.5 * (duty - 0.5) - 0.5 * (1.0 - duty)) % 1.0)
        self._choose(0.0)
