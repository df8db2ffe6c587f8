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

"""A network, its feedback and its body, linearised about their stride.

The stride map takes a deviation from a settled stride to the deviation one stride later. Its
multipliers tell what remains of a disturbance of the whole, as Floquet multipliers do for the
network alone. The network drives the body, which acts on the network by its clock only. Therefore
the multipliers of the whole are those of the network with its lock, and those of the map of its
phase, the body and the feedback, which finite differences give.
"""

from dataclasses import dataclass
import math

from cpg_ros.common.errors import InputError, ShortRepr
from cpg_ros.dynamics.floquet import by_size, Multipliers, multipliers
from cpg_ros.feedback.gains import Gains, VARIABLES
from cpg_ros.motion.plan import GaitPlan
from cpg_ros.simulation.body import MAX_LEAN
from cpg_ros.simulation.closed_loop import ClosedLoop, ClosedLoopBatch
from cpg_ros.simulation.robot_model import engine
from cpg_ros.simulation.scenario import Scenario
import numpy as np

#: NUM_SETTLING: strides before the one that is linearised; STEP: of the finite differences, in the
#: unit of each coordinate; TICK: tick, about, s.
NUM_SETTLING, STEP, TICK = 45, 1e-5, 0.002
#: PHASE_TOLERANCE: change of the phase over a stride, cycles, that is none.
PHASE_TOLERANCE = 1e-5
#: Change up to which a coordinate is the same after a stride, whatever the others are.
CHANGE_TOLERANCE = 1e-9


@dataclass(frozen=True, eq=False, repr=False)
class StrideMap(ShortRepr):
    """A stride of network, feedback and body, linearised.

    Attributes:
        stride: its duration, s.
        names: of the coordinates: phase of the gait [cycles], positions of base and joints [m,
            rad], their speeds, the feedback's memory, strides and pace; laws that are off and the
            place on the ground are left out.
        jacobian: derivative of the coordinates a stride later, shape (n, n).
        change: of the coordinates over the stride, 0 on a periodic one, shape (n,).
        values: multipliers of the map, the largest first, shape (n,); that of the phase is 1.
        network: multipliers of the network with its lock.

    """

    stride: float
    names: tuple[str, ...]
    jacobian: np.ndarray
    change: np.ndarray
    values: np.ndarray
    network: Multipliers

    @property
    def leading(self) -> float:
        """Largest modulus of all multipliers but that of the phase."""
        others = np.delete(self.values, np.abs(self.values - 1.0).argmin())
        return float(max(np.abs(others).max(), self.network.leading))

    def after(self, deviation: np.ndarray, strides: int) -> np.ndarray:
        """Return a deviation from the stride some strides later, shape (n,)."""
        return np.asarray(np.linalg.matrix_power(self.jacobian, strides) @ deviation)

    def _summary(self) -> str:
        return (f'{len(self.names)} coordinates, stride {self.stride:.4f} s, '
                f'leading multiplier {self.leading:.4f} a stride')


class _Coordinates:
    """Phase, body and feedback of runs, as deviations from the first run."""

    def __init__(self, walk: ClosedLoop, loop: ClosedLoopBatch) -> None:
        """Find the coordinates of a walk; nothing depends on where on the ground the body is."""
        self._mujoco, self._model = engine(), loop.body.model
        model, memory, legs = self._model, walk.feedback.memory, len(loop.robot.legs)
        self._state, sensors, earlier, _ = walk.bodies.parts
        self._q = slice(1, 1 + model.nq)
        base = int(model.jnt_dofadr[model.body_jntadr[loop.parts.base]])
        self._dofs = np.delete(np.arange(model.nv), [base, base + 1])
        self._patterns = walk.patterns.patterns
        self._strides = [pattern.strides for pattern in self._patterns]
        self._parts = {'speed': self._state[:, 1 + model.nq:1 + model.nq + model.nv],
                       'last speed of the base': earlier,
                       'foot force': sensors[:, 2:3 * legs:3],
                       **{name: part.reshape(len(part), -1) for name, part in
                          zip(memory._fields, memory, strict=True)
                          if name in VARIABLES and part.dtype == float}}
        self.names = ('phase of the gait', *(f'position {k}' for k in self._dofs), *(
            f'{name} {k}' for name, part in self._parts.items() for k in range(part.shape[1])), *(
            f'{what} {k}' for what in ('stride', 'rate of stride') for k in range(legs + 1)))

    def read(self, origin: np.ndarray | None = None) -> np.ndarray:
        """Return the coordinates of all runs, shape (runs, n).

        Positions are deviations from the first run's, or from an origin, shape (positions,).
        """
        if origin is None:
            origin = self._state[0, self._q].copy()
        way = np.zeros((len(self._state), self._model.nv))
        for row, state in zip(way, self._state, strict=True):
            self._mujoco.mj_differentiatePos(self._model, row, 1.0, origin, state[self._q])
        phases = [[pattern.clock] for pattern in self._patterns]
        strides = [command.state.ravel() for command in self._strides]
        return np.hstack([phases, way[:, self._dofs], *self._parts.values(), strides])

    def add(self, offsets: np.ndarray) -> None:
        """Add offsets to the coordinates of all runs, shape (runs, n)."""
        way = np.zeros(self._model.nv)
        end = 1 + len(self._dofs)
        for pattern, state, row in zip(self._patterns, self._state, offsets, strict=True):
            pattern.clock += row[0]
            way[self._dofs] = row[1:end]
            position = state[self._q].copy()
            self._mujoco.mj_integratePos(self._model, position, way, 1.0)
            state[self._q] = position
        for part in self._parts.values():
            part += offsets[:, end:end + part.shape[1]]
            end += part.shape[1]
        for command, row in zip(self._strides, offsets[:, end:], strict=True):
            command.state += row.reshape(command.state.shape)


def stride_map(model: str, plan: GaitPlan, gains: Gains | None, speed: float = 0.4, *,
               settling: int = NUM_SETTLING, threads: int = 1) -> StrideMap:
    """Linearise a robot that follows a gait about its stride.

    Central differences disturb every coordinate of a body that has settled on flat ground. What
    is true or false in the feedback's memory, such as contacts, stays as it is at the beginning of
    the stride; joints that are at their limits make the result untrue.

    Args:
        model: of the robot, as of ``robot_model.load``.
        plan: of the gait, for this robot.
        gains: of the feedback; None for none.
        speed: wanted, m/s.
        settling: strides before the one that is linearised.
        threads: of the physics, 0 for all cores.

    Raises:
        InputError: the body falls before it has settled, or the feedback changes the frequency, so
            that it returns to no state after the gait's stride.
        SimulationError: MuJoCo is missing, or the model cannot be used.

    """
    pace = 1.0 if plan.motion.steering is None else plan.steer(speed, 0.0)[1]
    stride = 1.0 / (plan.frequency * pace)
    ticks = round(stride / TICK)
    loop = ClosedLoopBatch(model, plan, timestep=stride / ticks, threads=threads)
    settled = ClosedLoop(loop, [Scenario(speed=speed)], gains, None)
    settled.go(settling * ticks)
    if np.cos(settled.senses.rpy[0, :2]).prod() < math.cos(MAX_LEAN):
        raise InputError(f'the {plan.name} falls within {settling} strides')
    count = len(_Coordinates(settled, loop).names)
    offsets = STEP * np.vstack([np.zeros(count), np.eye(count), -np.eye(count)])
    walk = ClosedLoop(loop, [Scenario(speed=speed)] * len(offsets), gains, None)
    walk.take(settled)
    coordinates, origin = _Coordinates(walk, loop), loop.body.model.qpos0.copy()
    before = coordinates.read(origin)[0]
    coordinates.add(offsets)
    walk.go(ticks)
    change, ends = coordinates.read(origin)[0] - before, coordinates.read()
    gaps = (ends[1:count + 1] - ends[count + 1:]).T
    for phases in (gaps[:1], change[:1]):
        phases[:] = (phases + 0.5) % 1.0 - 0.5
    if abs(change[0]) > PHASE_TOLERANCE:
        raise InputError(f'at {speed:g} m/s the feedback changes the frequency of the '
                         f'{plan.name}: {stride:.4f} s are not its stride; take a lower speed')
    jacobian = gaps / (2.0 * STEP)
    moves = np.abs(jacobian - np.eye(count)).max(axis=1) > CHANGE_TOLERANCE
    moves[0] = True
    jacobian, change = jacobian[np.ix_(moves, moves)], change[moves]
    return StrideMap(stride, tuple(np.array(coordinates.names)[moves].tolist()), jacobian, change,
                     by_size(np.linalg.eigvals(jacobian)), multipliers(plan.orbit, plan.gain))
