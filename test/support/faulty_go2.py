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

"""A simulated Go2 whose feedback gets its sensors through messages with a fault."""

from dataclasses import dataclass
import re
from unittest import mock

from c_ticks import CTicks
from cpg_ros.feedback.input_checks import MAX_AGE
from cpg_ros.feedback.kinematics import geometry_of
from cpg_ros.motion.pattern import Pattern
from cpg_ros.motion.strides import StrideCommand
from cpg_ros.ros.feedback import sensor_input
from cpg_ros.ros.feedback.loop import FeedbackLoop
from cpg_ros.ros.feedback.sensor_input import SensorInput
from cpg_ros.simulation.body import Body
from cpg_ros.simulation.scenario import SensorNoise
from cpg_ros.simulation.sensors import SimulatedSensors
from go2 import DT, gait_plan, GO2
import numpy as np
from sensor_faults import BEGINS, FaultySensors, Measured, Wire

#: Times in the reasons, which differ from tick to tick.
FIGURES = re.compile(r' for [0-9.]+ s|(?<=is )\d+ (?=ms)')
#: It stands for so long before it walks, s.
STANDS = 0.5


@dataclass
class FaultOutcome:
    """How a run ended.

    Attributes:
        fell: whether the body fell.
        crossed: commands beyond a limit of position, or of speed between two ticks.
        fractions: of the feedback, tick by tick.
        faults: what was named as the reason why there is no feedback, in the order of appearance.

    """

    fell: bool
    crossed: int
    fractions: np.ndarray
    faults: list[str]


class FaultyGo2:
    """A Go2 in a gait, its feedback enabled, with a fault of its sensors."""

    def __init__(self, fault: str = 'none', seed: int = 0, gait: str = 'trot',
                 begins: float = BEGINS, **settings: object) -> None:
        """Stand; begins in s, settings as of SensorInput."""
        settings.setdefault('latest', MAX_AGE)
        self.gait = gait_plan(gait)
        self.body = Body('go2', GO2)
        self._unit = SimulatedSensors(self.body, DT, SensorNoise(
            gyroscope_noise=0.02, accelerometer_noise=0.2, orientation_bias=0.008, seed=seed))
        self.pattern = Pattern(self.gait, 1.0, False, StrideCommand(4))
        geometry = geometry_of(GO2)
        with mock.patch.object(sensor_input, 'PolledSubscription', Wire):
            inputs = SensorInput(None, GO2, geometry, 'imu', 'measured', 'foot_contacts',
                                 'foot_contacts', **settings)
        self.wires = dict(Wire.wires)
        self.loop = FeedbackLoop(self.pattern, geometry, inputs,
                                 lambda: (self.gait.own_speed, 0.0, 0.0))
        self.loop.enabled = True
        self._ticks = CTicks(self.pattern, self.loop, DT)
        # Faults begin at another phase of the stride with each seed.
        self.sensors = FaultySensors(fault, seed, begins + 0.1 * seed)
        self.time, self._gap, self.crossed = 0.0, 0.0, 0
        self._told = self.pattern.position.copy()

    def tick(self) -> None:
        """Walk on by a tick."""
        body, pattern = self.body, self.pattern
        self.time += DT
        self._gap += DT
        _, felt = self._unit.measure(round(1e9 * self.time))
        Wire.wires = self.wires
        self.sensors.put(self.time, Measured(
            felt, GO2.order, body.position.copy(), body.velocity.copy(), body.torque.copy(),
            body.feet.copy()))
        if not self.sensors.stalled(self.time):
            if self.time > STANDS and not pattern.enabled:
                pattern.enable(True, 1.0)
            if self._gap > 1.5 * DT:
                # As the generator's ticker does it.
                pattern.resume(self._gap - DT)
            self._ticks.tick(round(1e9 * self.time))
            self._count()
            self._gap = 0.0
            body.command(self.loop.target[GO2.order_indices])
            body.scale_kp(self.loop.feedback.memory.kp_scale[0])
        body.step()

    def _count(self) -> None:
        told, lower, upper, fastest = self.pattern.position, *map(
            GO2.column, ('lower', 'upper', 'velocity'))
        self.crossed += int((told < lower - 1e-9).any() or (told > upper + 1e-9).any()
                            or (np.abs(told - self._told) > fastest * DT * (1.0 + 1e-6)).any())
        self._told[:] = told

    def run(self, seconds: float) -> FaultOutcome:
        """Walk on for some seconds, or until it has fallen."""
        fractions, faults = [], []
        for _ in range(round(seconds / DT)):
            self.tick()
            fractions.append(self.loop.fraction)
            fault = FIGURES.sub('', self.loop.faults)
            if fault and fault not in faults:
                faults.append(fault)
            if self.body.fallen:
                break
        return FaultOutcome(bool(self.body.fallen), self.crossed, np.array(fractions), faults)
