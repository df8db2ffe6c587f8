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

"""mujoco_playground's policy for the Go1, on its own model, in the runs that bench_feedback has.

What it observes and what its actions mean is as in the repository's ``play_go1_joystick.py``. Its
model's meshes are pictures of another repository: they are left out.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
import math
from pathlib import Path

from cpg_ros.gaits.stride import find_stride, Stride
from cpg_ros.networks.delayed import Delayed
from cpg_ros.simulation.body import FALLEN
from cpg_ros.simulation.scenario import Scenario
import mujoco
import numpy as np
import onnxruntime

POLICY = 'mujoco_playground/experimental/sim2sim/onnx/go1_policy.onnx'
MODEL = 'mujoco_playground/_src/locomotion/go1/xmls/scene_mjx_feetonly_flat_terrain.xml'
#: Its physics and its actions, s; what an action of 1 turns a joint by, rad.
TIMESTEP, EVERY, SCALE = 0.004, 0.02, 0.5
#: Its own stride is that of a walk so long, whose beginning does not count, s.
WALK, BEGINNING = 12.0, 2.0
LEGS = {'lh': 'RL', 'rh': 'RR', 'lf': 'FL', 'rf': 'FR'}


@dataclass(frozen=True)
class Run:
    """Whether a robot is upright at the end, its velocity and its joints' angles at each step.

    Attributes:
        joints: names of the columns of positions.
        times: s, shape (n,).
        positions: rad, shape (n, joints).
        speed: forward, in the base's own frame, m/s, shape (n,).
        upright: whether it did not fall.
        source: what to call it.

    """

    joints: tuple[str, ...]
    times: np.ndarray
    positions: np.ndarray
    speed: np.ndarray
    upright: bool
    source: str = POLICY


@dataclass(frozen=True)
class Upright:
    """Whether each run did not fall, shape (runs,)."""

    upright: np.ndarray


class Policy:
    """The policy and its robot, as a subject of ``feedback_figures.pushes``.

    Attributes:
        rng: where pushes come from.
        quick: few runs: a look.
        model: of the robot.
        stride: of its own gait at 0.4 m/s, to whose phases pushes are timed.
        speed: at which it then walks, m/s.

    """

    def __init__(self, folder: Path, seed: int, quick: bool = False) -> None:
        """Load the policy from a checkout."""
        one_core = onnxruntime.SessionOptions()
        one_core.intra_op_num_threads = one_core.inter_op_num_threads = 1
        self._policy = onnxruntime.InferenceSession(folder / POLICY, one_core,
                                                    providers=['CPUExecutionProvider'])
        self.rng, self.quick = np.random.default_rng(seed), quick
        spec = mujoco.MjSpec.from_file(str(folder / MODEL))
        for geom in [one for one in spec.geoms if one.type == mujoco.mjtGeom.mjGEOM_MESH]:
            spec.delete(geom)
        for mesh in list(spec.meshes):
            spec.delete(mesh)
        self.model = spec.compile()
        self.model.opt.timestep = TIMESTEP
        self._data = mujoco.MjData(self.model)
        self._base, floor = self.model.body('trunk').id, self.model.geom('floor').id
        self._floor = floor
        self._trunk = [geom for geom in range(self.model.ngeom)
                       if self.model.geom_bodyid[geom] == self._base]
        self._stand = np.array(self.model.key('home').qpos[7:])
        walk = self.walk(Scenario(friction=self.model.geom_friction[floor, 0]), WALK)
        late = walk.times > BEGINNING
        self.speed = float(walk.speed[late].mean())
        self.stride: Stride = find_stride(walk, {
            leg: tuple(f'{own}_{joint}_joint' for joint in ('hip', 'thigh', 'calf'))
            for leg, own in LEGS.items()}, Delayed)

    def run(self, scenarios: Sequence[Scenario], duration: float) -> Upright:
        """Walk once for each scenario; a push begins later by the phase of its own stride."""
        return Upright(np.array([self.walk(one, duration).upright for one in scenarios]))

    def walk(self, one: Scenario, duration: float) -> Run:
        """Walk from its stand, forward at a speed, on a flat floor."""
        model, data = self.model, self._data
        model.geom_friction[self._floor, 0] = one.friction
        mujoco.mj_resetDataKeyframe(model, data, model.key('home').id)
        late = one.phase / self.stride.frequency if one.phase else 0.0
        steps, every = round((duration + late) / TIMESTEP), round(EVERY / TIMESTEP)
        action = np.zeros(model.nu, dtype=np.float32)
        wish = np.array([one.speed, 0.0, 0.0])
        angles, speed, upright = np.zeros((steps, model.nu)), np.zeros(steps), True
        forces = replace(one, pushes=tuple(
            (when + late, *force) for when, *force in one.pushes)).forces(steps, TIMESTEP)
        for k in range(steps):
            data.xfrc_applied[self._base, :2] = forces[k]
            mujoco.mj_step1(model, data)
            velocity = data.sensor('local_linvel').data
            if k % every == 0:
                down = data.site('imu').xmat.reshape(3, 3).T @ np.array([0.0, 0.0, -1.0])
                action = self._act(np.concatenate([
                    velocity, data.sensor('gyro').data, down, data.qpos[7:] - self._stand,
                    data.qvel[6:], action, wish]))
                data.ctrl[:] = SCALE * action + self._stand
            angles[k], speed[k] = data.qpos[7:], velocity[0]
            if self._fallen():
                upright = False
                break
            mujoco.mj_step2(model, data)
        names = tuple(model.joint(joint).name for joint in model.actuator_trnid[:, 0])
        return Run(names, TIMESTEP * np.arange(k + 1), angles[:k + 1], speed[:k + 1], upright)

    def _act(self, observed: np.ndarray) -> np.ndarray:
        (found,) = self._policy.run(['continuous_actions'],
                                    {'obs': observed.astype(np.float32)[None]})
        return found[0]

    def _fallen(self) -> bool:
        """Whether the base leans too much or lies on the floor, as of cpg_ros' own bodies.

        Nothing but the feet collides in this model, so the trunk's distance tells.
        """
        if self._data.body('trunk').xmat[8] < math.cos(FALLEN):
            return True
        return any(mujoco.mj_geomDistance(self.model, self._data, self._floor, geom, 1.0, None)
                   <= 0.0 for geom in self._trunk)
