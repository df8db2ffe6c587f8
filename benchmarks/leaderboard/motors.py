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

"""Motors whose torque falls with their speed."""

from collections.abc import Sequence
from typing import Any

from cpg_ros.simulation.bodies import BatchPhysics
import numpy as np

#: SLOW: fraction of a motor's no-load speed up to which it has its full torque.
SLOW = 1e-3


def limit_motors(bodies: BatchPhysics, no_load: np.ndarray) -> None:
    """Limit what drives a joint on by a line from the model's limit at standstill to 0.

    Args:
        bodies: whose ``rollout`` is replaced.
        no_load: speeds at which motors have no torque left, rad/s, in the order of controllers,
            shape (joints,).

    """
    free, model, parts = bodies.rollout, bodies.body.model, bodies.parts
    moving = slice(1 + model.nq, 1 + model.nq + model.nv)

    def rollout(models: Sequence[Any], state: np.ndarray, control: np.ndarray,
                warmstart: np.ndarray | None = None) -> tuple[np.ndarray, np.ndarray]:
        """Take steps from states, (runs, states); return states and sensors after each."""
        results = []
        for k in range(control.shape[1]):
            step = control[:, k:k + 1].copy()
            joints = step[:, 0, :len(no_load)]
            joints[:] = _within_curve(model, models, joints, state[:, 1 + parts.angles],
                                      state[:, moving][:, parts.speeds], no_load)
            results.append(free(models, state, step, warmstart))
            before, state = state, results[-1][0][:, 0]
            warmstart = (state[:, moving] - before[:, moving]) / bodies.timestep
        states, sensors = zip(*results, strict=True)
        return np.concatenate(states, axis=1), np.concatenate(sensors, axis=1)

    bodies.rollout = rollout


def _within_curve(model: Any, models: Sequence[Any], target: np.ndarray, angles: np.ndarray,
                  speeds: np.ndarray, no_load: np.ndarray) -> np.ndarray:
    """Return the targets, rad, (runs, joints), that ask motors for no more than they have."""
    count = target.shape[1]
    kp = np.array([each.actuator_gainprm[:count, 0] for each in models])
    kd = -model.actuator_biasprm[:count, 2]
    most = model.actuator_forcerange[:count, 1]
    left = most * np.clip(1.0 - np.abs(speeds) / no_load, 0.0, 1.0)
    torque = kp * (target - angles) - kd * speeds
    # Voltage limits torques that drive the motion; at standstill the model's limit holds.
    short = ((torque * speeds > 0.0) & (np.abs(torque) > left)
             & (np.abs(speeds) > SLOW * no_load))
    return np.where(short, angles + (np.sign(torque) * left + kd * speeds) / kp, target)
