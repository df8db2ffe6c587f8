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

"""What robots meet in runs of a closed loop, what dulls their senses, and how the runs ended."""

from dataclasses import dataclass
import math

from cpg_ros.simulation.terrain import Terrain
import numpy as np


@dataclass(frozen=True)
class Scenario:
    """What a robot meets in a run, flat ground and nothing else if not told.

    Attributes:
        friction: between feet and ground.
        terrain: ground that is not flat.
        push: impulse on the base forward and to the left, N s, within PUSH seconds.
        when: the push begins, s.
        phase: of the first leg at the start of the gait, cycles.
        speed: wanted, forward, m/s; ignored where the gait cannot be steered.
        commands: later wishes, each (s, m/s forward, m/s to the left, rad/s of turning).
        switches: later gaits, each (s, name).

    """

    friction: float = 1.0
    terrain: Terrain | None = None
    push: tuple[float, float] = (0.0, 0.0)
    when: float = math.inf
    phase: float = 0.0
    speed: float = 0.4
    commands: tuple[tuple[float, float, float, float], ...] = ()
    switches: tuple[tuple[float, str], ...] = ()


@dataclass(frozen=True)
class Noise:
    """What dulls the senses of all runs of a batch.

    Attributes:
        delay: of everything that is felt, s.
        force_bias, force_noise: of each foot's force, as shares of it; the bias is drawn once.
        lean_bias: of roll and pitch, rad, drawn once, either sign.
        turning_noise: of the angular rates, rad/s.
        seed: of what is drawn.

    """

    delay: float = 0.0
    force_bias: float = 0.0
    force_noise: float = 0.0
    lean_bias: float = 0.0
    turning_noise: float = 0.0
    seed: int = 0


@dataclass(frozen=True)
class Outcome:
    """How runs ended, and their signals after each step; the first axis is the run's.

    What follows a run's end repeats its last value.

    Attributes:
        fell: when it fell, s, infinite if it did not, shape (runs,).
        arrived: when it came as far as was asked for, s, infinite if it did not.
        place: of the base on the ground, m, shape (runs, steps, 2).
        lean: roll, pitch and yaw, rad, shape (runs, steps, 3).
        velocity: true one of the base in its own frame, m/s, shape (runs, steps, 3).
        estimated: the same as estimated.
        turning: rad/s, its own frame, shape (runs, steps, 3).
        phase: of the first leg, cycles, shape (runs, steps).
        cost: of transport after BEGINNING, shape (runs,).

    """

    fell: np.ndarray
    arrived: np.ndarray
    place: np.ndarray
    lean: np.ndarray
    velocity: np.ndarray
    estimated: np.ndarray
    turning: np.ndarray
    phase: np.ndarray
    cost: np.ndarray

    @property
    def upright(self) -> np.ndarray:
        """Whether each run did not fall."""
        return np.isinf(self.fell)
