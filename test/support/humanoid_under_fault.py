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

"""A simulated humanoid that walks by its generator's own loop while its sensors are at fault."""

from collections import deque
from functools import cache

from c_ticks import CTicks
from cpg_ros.feedback.biped.balanced_pattern import BalancedPattern
from cpg_ros.feedback.biped.feedback import gait_plan
from cpg_ros.feedback.input_checks import MAX_AGE_BALANCE
from cpg_ros.feedback.kinematics import GRAVITY
from cpg_ros.motion.robot_file import load_robot
from cpg_ros.ros.feedback import sensor_input
from cpg_ros.ros.feedback.loop import BalanceLoop
from cpg_ros.simulation.body import Body
from cpg_ros.simulation.scenario import SensorNoise
from cpg_ros.simulation.sensors import SimulatedSensors
from cpg_ros.simulation.terrain import set_friction
import numpy as np
from sensor_faults import FaultySensors, Measured, Wire

DT, BEGINS = 0.002, 4.0
#: Of all measurements, s; of the inertial unit's own besides, as of bench_humanoid.
DELAY, FORCE_NOISE = 0.004, 0.05
NOISE = SensorNoise(gyroscope_noise=0.02, accelerometer_noise=0.1)


@cache
def body_of(name: str) -> Body:
    body = Body(name, load_robot(name), timestep=DT)
    set_friction(body.model, 0.6)
    return body


class HumanoidUnderFault:
    """One humanoid and one fault.

    Attributes:
        pattern: that moves it.
        crossed: targets beyond a limit of position or speed so far.
        fell: whether it has fallen.

    """

    def __init__(self, fault: str, seed: int = 0, speed: float = 0.3, name: str = 'humanoid',
                 begins: float = BEGINS) -> None:
        self.body = body = body_of(name)
        body.reset()
        robot, self._speed = body.robot, speed
        plan = gait_plan(robot, 'walk')
        self.pattern = BalancedPattern(plan, 1.0, enabled=False)
        subscription, sensor_input.PolledSubscription = sensor_input.PolledSubscription, Wire
        try:
            inputs = sensor_input.SensorInput(None, robot, GRAVITY * robot.biped.total, 'imu',
                                              'measured', 'foot_contacts', 'foot_contacts',
                                              latest=MAX_AGE_BALANCE)
        finally:
            sensor_input.PolledSubscription = subscription
        self.loop = BalanceLoop(self.pattern, inputs, lambda: (speed, 0.0, 0.0))
        self.loop.enabled = True
        self._ticks = CTicks(self.pattern, self.loop, DT)
        # As many as the robot has, with the names of what it holds.
        self._names = (*robot.order, *robot.held)
        self.faults = FaultySensors(fault, seed, begins)
        self._unit = SimulatedSensors(body, DT, SensorNoise(**{**vars(NOISE), 'seed': seed}))
        self._rng = np.random.default_rng(seed + 1)
        self._late: deque[Measured] = deque()
        self._limits = [robot.column(key) for key in ('lower', 'upper', 'velocity')]
        self._last = self.pattern.position.copy()
        self.time, self._gap, self.crossed, self.fell = 0.0, 0.0, 0, False

    def run(self, seconds: float = 10.0) -> str:
        """Walk from 1 s on; return how it ends: walk, stand, crouch or fall."""
        while self.time < seconds - 0.5 * DT:
            if abs(self.time - 1.0) < 0.5 * DT and self._speed:
                self.pattern.enable(True, 1.0)
            self.step()
        pattern = self.pattern
        if self.fell:
            return 'fall'
        if pattern.balancing:
            return 'walk' if pattern.level else 'stand'
        return 'crouch' if pattern.crouching else 'held'

    def step(self) -> None:
        """Take a step of physics and feedback."""
        body, pattern = self.body, self.pattern
        self._late.append(self._measured())
        if len(self._late) > round(DELAY / DT):
            self.faults.put(self.time, self._late.popleft())
        self._gap += DT
        if not self.faults.stalled(self.time):
            if self._gap > 1.5 * DT:
                # As the generator's ticker does it.
                pattern.resume(self._gap - DT)
            self._ticks.tick(round(1e9 * self.time))
            self._check(DT)
            self._gap = 0.0
        body.command(pattern.position[pattern.robot.order_indices])
        body.hold(pattern.held_angles)
        body.step()
        self.time += DT
        self.fell = self.fell or bool(body.fallen)

    def _measured(self) -> Measured:
        body = self.body
        held = body.held
        _, imu = self._unit.measure(round(1e9 * self.time))
        loads = body.feet * (1.0 + FORCE_NOISE * self._rng.standard_normal(2))
        return Measured(imu, self._names, np.append(body.position, held[0]),
                        np.append(body.velocity, held[1]), np.append(body.torque, held[2]), loads)

    def _check(self, dt: float) -> None:
        (lower, upper, fastest), position = self._limits, self.pattern.position
        step = np.abs(position - self._last)
        self.crossed += bool((position < lower - 1e-9).any() or (position > upper + 1e-9).any()
                             or (step > fastest * dt * (1.0 + 1e-6)).any())
        self._last[:] = position
