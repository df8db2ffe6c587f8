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

"""Learned policies on the bodies of cpg_ros, entrants of the table; ``policies.yaml`` names them.

A policy observes and acts 50 times a second, the joints are servos with its own gains, and all
else is as with the feedback: the model, its limits of torque, the ground, pushes and falls.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
import importlib.util
import math
import os
from pathlib import Path
from typing import Any

from cpg_ros.feedback.kinematics import GRAVITY
from cpg_ros.motion.robot_file import load_robot
from cpg_ros.simulation.bodies import BatchPhysics
from cpg_ros.simulation.body import Body, MAX_LEAN
from cpg_ros.simulation.run_metrics import SETTLING_TIME, torques
from cpg_ros.simulation.scenario import Scenario, SensorNoise
from cpg_ros.simulation.terrain import add_ground
import numpy as np
import yaml

NAMES = Path(__file__).with_name('policies.yaml')
#: Physics' time step as of ClosedLoop, and how often a policy acts, s.
TIMESTEP, PERIOD = 0.002, 0.02
JOINTS = ('hip', 'thigh', 'calf')


class Missing(Exception):
    """A policy cannot be had here; the message says what it lacks."""


def entries() -> dict[str, dict[str, Any]]:
    """Return what ``policies.yaml`` says of each policy."""
    return yaml.safe_load(NAMES.read_text())


def network(entry: dict[str, Any]) -> Callable[[np.ndarray], np.ndarray]:
    """Return a policy's network: observations, shape (runs, numbers), to actions (runs, 12).

    Raises:
        Missing: there is no checkout, or what runs it is not installed.

    """
    folder = os.environ.get(entry['folder'])
    if not folder:
        raise Missing(f'{entry["folder"]} names no checkout of {entry["source"].split(",")[0]}')
    file = Path(folder) / entry['file']
    if not file.is_file():
        raise Missing(f'{entry["folder"]}: there is no {entry["file"]} in it')
    runtime = 'onnxruntime' if file.suffix == '.onnx' else 'torch'
    if importlib.util.find_spec(runtime) is None:
        raise Missing(f'{runtime} is not installed')
    if runtime == 'torch':
        import torch
        torch.set_num_threads(1)
        module = torch.jit.load(str(file)).eval()

        def scripted(observed: np.ndarray) -> np.ndarray:
            with torch.inference_mode():
                return module(torch.from_numpy(observed)).numpy()
        return scripted
    import onnxruntime
    one_core = onnxruntime.SessionOptions()
    one_core.intra_op_num_threads = one_core.inter_op_num_threads = 1
    session = onnxruntime.InferenceSession(file, one_core, providers=['CPUExecutionProvider'])
    takes, gives = session.get_inputs()[0].name, [session.get_outputs()[0].name]
    # These files take one observation at a time.
    return lambda observed: np.concatenate([session.run(gives, {takes: row[None]})[0]
                                            for row in observed])


@dataclass
class Runs:
    """How runs ended, as of ``scenario.Outcome``, whose names these are."""

    fell: np.ndarray
    arrived: np.ndarray
    place: np.ndarray
    velocity: np.ndarray
    angular_velocity: np.ndarray
    cost: np.ndarray

    @property
    def upright(self) -> np.ndarray:
        """Whether each run did not fall."""
        return np.isinf(self.fell)


class LearnedPolicy:
    """A policy and its robot.

    Attributes:
        noise: its delay is that of everything that the policy observes; the rest is not used.
        body: the robot, for its model.
        bodies: any number of it.

    """

    def __init__(self, entry: dict[str, Any]) -> None:
        """Load a policy; its entry is as of `entries`.

        Raises:
            Missing: it cannot be had.

        """
        self._act, self._entry = network(entry), entry
        robot = load_robot('unitree_go2')  # the Go1's joints have the same names
        self.body = Body(entry['robot'], robot, entry['kp'], entry['kd'], TIMESTEP, add_ground)
        self.bodies = BatchPhysics(self.body, 1)
        own = [f'{leg}_{joint}_joint' for leg in entry['legs'] for joint in JOINTS]
        #: Where the policy's joints are among the body's, and the other way round.
        self._ours = [robot.order.index(name) for name in own]
        self._back = [own.index(name) for name in robot.order]
        self._stand = np.array(entry['stand'])
        scale = np.array(entry['scale'])
        self._scale = np.resize(scale, 12)
        self.noise: SensorNoise | None = None

    def run(self, scenarios: Sequence[Scenario], duration: float, goal: float = math.inf) -> Runs:
        """Let bodies walk from the stand, one for each scenario; as ``ClosedLoop.run``.

        Where there is a goal ahead, a policy is steered back to the line by its turning, as by a
        driver: it does not keep its heading by itself, as the feedback does.
        """
        bodies, model, parts = self.bodies, self.body.model, self.bodies.parts
        runs, every = len(scenarios), round(PERIOD / TIMESTEP)
        steps = math.ceil(duration / PERIOD) * every
        models = [bodies.model(one) for one in scenarios]
        control, joints, force = bodies.controls(runs, every)
        forces = np.stack([one.forces(steps, TIMESTEP) for one in scenarios])
        state = np.tile(bodies.start, (runs, 1))
        position, moving = slice(1, 1 + model.nq), slice(1 + model.nq, 1 + model.nq + model.nv)
        free = int(model.jnt_dofadr[model.body_jntadr[parts.base]])
        warm, found = np.zeros((runs, model.nv)), _Record(runs, steps)
        late = 0 if self.noise is None else round(self.noise.delay / TIMESTEP)
        past = np.repeat(state[:, None], late + 1, axis=1)
        senses = _Senses(self._entry, self._stand, runs)
        going = np.arange(runs)
        for k in range(0, steps, every):
            seen = past[going, -1 - late]
            place, speed = seen[:, position], seen[:, moving]
            wish = _wishes(scenarios, going, k * TIMESTEP)
            if math.isfinite(goal):
                wish[:, 2] += back_to_the_line(place[:, parts.pose])
            action = self._act(senses.observe(
                going, place[:, parts.pose[3:]], speed[:, free:free + 6],
                place[:, parts.angles][:, self._ours], speed[:, parts.speeds][:, self._ours],
                wish))
            senses.action[going] = action
            target = (self._stand + self._scale * action)[:, self._back]
            joints[going], force[going] = target[:, None], forces[going, k:k + every]
            after, sensed = bodies.rollout([models[run] for run in going], state[going],
                                           control[going], warm[going])
            whole = np.concatenate([state[going, None], after], axis=1)
            warm[going] = (whole[:, -1, moving] - whole[:, -2, moving]) / TIMESTEP
            state[going] = after[:, -1]
            past[going] = np.concatenate([past[going], after], axis=1)[:, -late - 1:]
            place, speed = whole[:, :, position], whole[:, :, moving]
            _, torque = torques(model, np.repeat(target, every, axis=0),
                                place[:, :-1, parts.angles].reshape(-1, 12),
                                speed[:, :-1, parts.speeds].reshape(-1, 12))
            power = np.maximum(torque * speed[:, :-1, parts.speeds].reshape(-1, 12), 0.0)
            ends = found.keep(going, slice(k, k + every), place[:, 1:, parts.pose],
                              speed[:, 1:, free:free + 6],
                              power.sum(axis=1).reshape(-1, every),
                              sensed[:, :, 3 * len(self._entry['legs'])] > 0.0, goal)
            going = going[~ends]
            if not going.size:
                break
        return found.runs(GRAVITY * self.body.mass)


def back_to_the_line(pose: np.ndarray) -> np.ndarray:
    """Return the turning, rad/s, by which a driver keeps robots on the line ahead, (runs,)."""
    turn = rotations(pose[:, 3:])
    heading = np.arctan2(turn[:, 1, 0], turn[:, 0, 0])
    return np.clip(-1.5 * heading - 1.0 * pose[:, 1], -1.0, 1.0)


class _Senses:
    """What a policy observes, with its history."""

    def __init__(self, entry: dict[str, Any], stand: np.ndarray, runs: int) -> None:
        self._observes, self._stand = entry['observes'], stand
        self._length, self._by_time = entry.get('history', 1), entry.get('by') == 'time'
        self._history: dict[str, np.ndarray] = {}
        self.action = np.zeros((runs, 12))

    def observe(self, going: np.ndarray, quaternion: np.ndarray, twist: np.ndarray,
                angles: np.ndarray, speeds: np.ndarray, wish: np.ndarray) -> np.ndarray:
        """Return the network's input, shape (going, numbers)."""
        turn = rotations(quaternion)
        now = {'velocity': np.einsum('nji,nj->ni', turn, twist[:, :3]),
               'angular_velocity': twist[:, 3:], 'gravity': -turn[:, 2],
               'positions': angles - self._stand, 'velocities': speeds, 'command': wish,
               'action': self.action[going]}
        for name, factor in self._observes.items():
            value = now[name] * factor
            if name not in self._history:
                self._history[name] = np.repeat(value[:, None], self._length, axis=1)
            kept = self._history[name]
            kept[going] = np.concatenate([kept[going, 1:], value[:, None]], axis=1)
        parts = [self._history[name][going] for name in self._observes]
        if self._by_time:
            found = np.concatenate(parts, axis=2)[:, ::-1].reshape(len(going), -1)
        else:
            found = np.concatenate([part.reshape(len(going), -1) for part in parts], axis=1)
        return np.ascontiguousarray(found, dtype=np.float32)


class _Record:
    """What is kept of runs; after a run's end, its last values."""

    def __init__(self, runs: int, steps: int) -> None:
        self._steps = steps
        self._end = np.full(runs, steps)
        self._fell, self._arrived = np.full((2, runs), np.inf)
        self._place, self._velocity, self._rates, self._power = (
            np.zeros((runs, steps, size)) for size in (2, 3, 3, 1))

    def keep(self, going: np.ndarray, now: slice, pose: np.ndarray, twist: np.ndarray,
             power: np.ndarray, trunk: np.ndarray, goal: float) -> np.ndarray:
        """Keep some steps of the runs that are going on; return which of these have ended."""
        turn = rotations(pose[:, :, 3:].reshape(-1, 4)).reshape(*pose.shape[:2], 3, 3)
        self._place[going, now], self._rates[going, now] = pose[:, :, :2], twist[:, :, 3:]
        self._velocity[going, now] = np.einsum('nkji,nkj->nki', turn, twist[:, :, :3])
        self._power[going, now, 0] = power
        down = (turn[:, :, 2, 2] < math.cos(MAX_LEAN)) | trunk
        far = pose[:, :, 0] > goal
        ends = (down | far).any(axis=1)
        for run, fallen, first in zip(going[ends], down[ends], (down | far)[ends].argmax(axis=1),
                                      strict=True):
            self._end[run] = now.start + first + 1
            (self._fell if fallen[first] else self._arrived)[run] = (now.start + first) * TIMESTEP
        return ends

    def runs(self, weight: float) -> Runs:
        """Return how the runs ended."""
        for run, end in enumerate(self._end):
            for rows in (self._place, self._velocity, self._rates, self._power):
                rows[run, end:] = rows[run, end - 1]
        late = slice(min(round(SETTLING_TIME / TIMESTEP), self._steps // 2), None)
        way = np.abs(self._velocity[:, late, 0].sum(axis=1)) * TIMESTEP
        work = self._power[:, late, 0].sum(axis=1) * TIMESTEP
        return Runs(self._fell, self._arrived, self._place, self._velocity, self._rates,
                    work / (weight * np.maximum(way, 1e-3)))


def _wishes(scenarios: Sequence[Scenario], going: np.ndarray, now: float) -> np.ndarray:
    """Return what runs are asked for, m/s, m/s and rad/s, shape (going, 3)."""
    found = np.zeros((len(going), 3))
    for row, run in zip(found, going, strict=True):
        one = scenarios[run]
        row[:] = one.speed, 0.0, 0.0
        for when, *wish in one.commands:
            if when <= now:
                row[:] = wish
    return found


def rotations(quaternions: np.ndarray) -> np.ndarray:
    """Return what turns vectors of bases' frames into the world's, shape (n, 3, 3)."""
    w, x, y, z = quaternions.T
    return np.stack([1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y),
                     2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x),
                     2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
                    axis=1).reshape(-1, 3, 3)
