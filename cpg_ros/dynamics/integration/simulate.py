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

"""Offline simulation with the real-time kernel, recording every node."""

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from itertools import repeat
import math
import os
import warnings

from cpg_ros.common.command_line import progress_bar
from cpg_ros.common.errors import InputError, ShortRepr
from cpg_ros.dynamics.integration.c_kernel import LaneBlock, LANES, lanes_of, ONE_LANE
from cpg_ros.networks.network import Network
from cpg_ros.networks.symmetry import Symmetry
import numpy as np

#: A constant state, shape (components,), or a function of times t <= 0, shape (m,), that
#: returns states, shape (m, components); an attribute ``derivative`` of the same form gives the
#: slopes.
History = np.ndarray | Sequence[float] | Callable[[np.ndarray], np.ndarray]

#: Work between two updates of the progress bar, components times steps.
CHUNK_WORK = 20_000_000
#: Work of a step with noise, over that of one without; its random numbers take memory.
NOISE_WORK = 16


@dataclass(frozen=True, eq=False, repr=False)
class Trajectory(ShortRepr):
    """Dense solution on a fixed grid.

    Attributes:
        t: nodes from t = 0, model time, shape (nodes,).
        x: states, shape (nodes, components) or (batch, nodes, components).
        slopes: time derivatives, shaped like x; at t = 0 that of the network, not of the history.

    """

    t: np.ndarray
    x: np.ndarray
    slopes: np.ndarray

    def _summary(self) -> str:
        batch = f'{self.x.shape[0]} runs, ' if self.x.ndim == 3 else ''
        return (f'{batch}{self.t.size} nodes from 0 to {self.t[-1]:.6g}, '
                f'{self.x.shape[-1]} components')

    def __call__(self, times: np.ndarray | float) -> np.ndarray:
        """Interpolate the states at times by cubic Hermite, shape (..., times, components).

        Raises:
            ValueError: a time lies outside the simulated span.

        """
        times = np.atleast_1d(np.asarray(times, dtype=float))
        step = self.t[1]
        if times.size and not (times.min() >= 0.0 and times.max() <= self.t[-1] + 1e-9 * step):
            raise InputError(f'times reach from {times.min()} to {times.max()}, the trajectory '
                             f'from 0 to {self.t[-1]}')
        left = np.clip((times / step).astype(int), 0, self.t.size - 2)
        s = (times / step - left)[:, None]
        h01 = s * s * (3.0 - 2.0 * s)
        return ((1.0 - h01) * self.x[..., left, :] + h01 * self.x[..., left + 1, :]
                + s * (s - 1.0) ** 2 * step * self.slopes[..., left, :]
                + s * s * (s - 1.0) * step * self.slopes[..., left + 1, :])


def sample_history(history: History, nodes: int, step: float, components: int
                   ) -> tuple[np.ndarray, np.ndarray]:
    """Sample states and slopes of a history at t = -(nodes - 1) step .. 0.

    Returns:
        Two arrays of shape (nodes, components). Slopes of a function come from its attribute
            ``derivative``, otherwise from five-point differences a step apart.

    Raises:
        ValueError: the shape does not fit the network, or a value is not finite.

    """
    if callable(history):
        times = (np.arange(nodes) - nodes + 1) * step
        # Compiled code is for arrays of this order in memory.
        x = np.array(history(times), dtype=float, order='C')
        derivative = getattr(history, 'derivative', None)
        if derivative is not None:
            slopes = np.array(derivative(times), dtype=float, order='C')
        else:
            # One-sided at both ends, where nothing is known of the other side.
            offsets = np.arange(5)
            slopes = np.empty_like(x)
            for node in range(nodes):
                first = min(max(node - 2, 0), max(nodes - 5, 0))
                near = min(5, nodes)
                powers = np.vander(offsets[:near] + first - node, near, increasing=True).T
                weights = np.linalg.solve(powers, np.eye(near)[1])
                slopes[node] = weights @ x[first:first + near] / step
    else:
        x = np.repeat(np.asarray(history, dtype=float)[None], nodes, axis=0)
        slopes = np.zeros_like(x)
    if x.shape != (nodes, components):
        raise ValueError(f'a history has the shape ({components},), not {x.shape[1:]}')
    if not (np.isfinite(x).all() and np.isfinite(slopes).all()):
        raise InputError('the history has a value that is not finite')
    return x, slopes


def _check(networks: Sequence[Network], t_end: float, step: float, every: int) -> None:
    """Raise the errors of ``simulate`` about these arguments."""
    if not (np.isfinite(t_end) and t_end > 0.0 and np.isfinite(step) and step > 0.0):
        raise InputError(f't_end {t_end} and step {step} must be positive and finite')
    for network in networks:
        if not all(np.isfinite(value) for value in network.as_dict().values()):
            raise InputError(f'a parameter is not finite: {network}')
        if 0.0 < network.delay < step or (network.delay <= 0.0 and network.delay_parameter):
            raise InputError(f'the delay {network.delay} is shorter than the step {step}')
        if type(network) is not type(networks[0]):
            raise ValueError(f'a batch has one kind of network, not {networks[0].name} and '
                             f'{network.name}')
    if every < 1:
        raise InputError(f'every {every} must be at least 1')


class _Lanes:
    """Trajectories in blocks of lanes, which advance together in vector registers.

    Trajectory m is lane m % lanes of block m // lanes; spare lanes repeat the last one.
    """

    def __init__(self, networks: Sequence[Network], histories: Sequence[History], step: float,
                 batch: int, lock: tuple[float, np.ndarray]) -> None:
        """Fill the rings of past states from the histories."""
        components, cells = networks[0].components, networks[0].cells
        # Five nodes at least, so that slopes of a given history are of fourth order.
        nodes = max(5, int(np.ceil(max(member.delay for member in networks) / step)) + 2)
        lanes = ONE_LANE if batch == 1 else LANES
        blocks = -(-batch // lanes)
        members = np.minimum(np.arange(blocks * lanes), batch - 1).reshape(blocks, lanes)
        #: States, and slopes after and before each node.
        self._ring = np.empty((3, blocks, nodes, components, lanes))
        self._p = np.empty((blocks, networks[0].coefficients.shape[0], cells, lanes))
        self._tau = np.empty((blocks, lanes))
        samples = [sample_history(history, nodes, step, components) for history in histories]
        for (block, lane), m in np.ndenumerate(members):
            network = networks[m if len(networks) > 1 else 0]
            self._p[block, ..., lane], self._tau[block, lane] = network.coefficients, network.delay
            past, slopes = samples[m if len(histories) > 1 else 0]
            self._ring[:, block, :, :, lane] = past, slopes, slopes
        self._library = lanes_of(type(networks[0]), lanes)
        self._gain, self._basis = lock[0], np.ascontiguousarray(lock[1])
        self._blocks = [LaneBlock(*(array.ctypes.data for array in (
            self._p[k], self._tau[k], self._basis, *self._ring[:, k])), self._gain, step,
            len(self._basis), nodes) for k in range(blocks)]

    def run(self, rows: int, every: int, noise: float, seed: int, progress: bool
            ) -> tuple[np.ndarray, np.ndarray]:
        """Integrate on all cores, by steps as of ``simulate``.

        Returns:
            States and slopes at the start and at ``rows`` nodes after it, shape (lanes, rows + 1,
                components) each; the last lanes may be spare.

        """
        _, blocks, nodes, components, lanes = self._ring.shape
        steps, head, done = rows * every, nodes - 1, 0
        states, slopes = np.empty((2, blocks, lanes, rows + 1, components))
        size = blocks * components * lanes * (NOISE_WORK if noise else 1)

        def advance(k: int, count: int, number: int) -> int:
            random = np.random.default_rng([seed, done, k])
            kicks = noise * random.standard_normal(count * components * lanes) if noise else None
            return int(self._library.steps(
                self._blocks[k], head, count, None if kicks is None else kicks.ctypes.data, every,
                number, rows + 1, states[k].ctypes.data, slopes[k].ctypes.data))

        for k, block in enumerate(self._blocks):
            self._library.begin(block, head)
            states[k, :, 0], slopes[k, :, 0] = self._ring[:2, k, head].swapaxes(1, 2)
        with (progress_bar('simulating', steps, enabled=progress) as bar,
              ThreadPoolExecutor(min(blocks, os.cpu_count() or 1)) as pool):
            while done < steps:
                count = min(steps - done, max(1, CHUNK_WORK // size))
                work = range(blocks), repeat(count), repeat(done + 1)
                *_, head = map(advance, *work) if blocks == 1 else pool.map(advance, *work)
                done += count
                bar(done)
        return (states.reshape(-1, rows + 1, components), slopes.reshape(-1, rows + 1, components))


def simulate(network: Network | Sequence[Network], history: History | Sequence[History],
             t_end: float, step: float | None = None, *,
             lock: tuple[float, Symmetry] | None = None,
             noise: float = 0.0, seed: int = 0, every: int = 1, progress: bool = True,
             quiet: bool = False) -> Trajectory:
    """Integrate a network from a history, by RK4 with cubic Hermite delayed values.

    A RuntimeWarning says how many simulations end in states that are not finite.

    One network and one history give one trajectory. A sequence of networks, an array of histories
    of shape (batch, components) or a list of histories give a batch, which runs on all cores; a
    single network or history is combined with every one of the other.

    Args:
        network: parameters, one set or a sequence.
        history: constant state, function of times t <= 0, or orbit (see History); one or many.
        t_end: end, model time; rounded up to whole steps.
        step: model time; every delay must be at least one step. By default half the network's own,
            or the shortest delay if that is less: without noise, each shipped gait stays within
            1e-6 of its range of the exact orbit over a cycle.
        lock: symmetry lock (gain in 1/model time, the gait's symmetry), or None.
        noise: standard deviation of white noise per square root of model time.
        seed: of the noise of the whole batch.
        every: steps between recorded ones; t_end is rounded up to a multiple.
        progress: show a progress bar if the work takes more than about two seconds.
        quiet: do not warn.

    Raises:
        InputError: step or t_end is not positive and finite, a parameter is not finite, or a delay
            is shorter than a step.
        ValueError: shapes or numbers of networks and histories do not fit.

    """
    networks = [network] if isinstance(network, Network) else list(network)
    if not networks or not (callable(history) or len(history)):
        raise ValueError('there is no network, or no history, to start from')
    one_history = callable(history) or not (callable(history[0]) or np.ndim(history[0]))
    histories: list = [history] if one_history else list(history)  # type: ignore[arg-type]
    batch = max(len(networks), len(histories))
    if {len(networks), len(histories)} - {1, batch}:
        raise ValueError(f'{len(networks)} networks do not go with {len(histories)} histories')
    if step is None:
        step = min((0.5 * networks[0].step,
                    *(member.delay for member in networks if member.delay > 0.0)))
    _check(networks, t_end, step, every)
    rows = int(np.ceil(t_end / (step * every) - 1e-9))
    gain, basis = (0.0, np.zeros((1, networks[0].components))) if lock is None else (
        float(lock[0]), lock[1].basis)
    lanes = _Lanes(networks, histories, float(step), batch, (gain, basis))
    # White noise: a normally distributed kick after each step (Euler-Maruyama).
    states, slopes = lanes.run(rows, every, float(noise) * math.sqrt(step), seed, progress)
    lost = int((~np.isfinite(states[:batch, -1]).all(axis=1)).sum())
    if lost and not quiet:
        warnings.warn(f'{lost} of {batch} simulations end in states that are not finite: the '
                      f'network runs away, or steps of {step:g} model time are too long for it',
                      RuntimeWarning, stacklevel=2)
    times = np.arange(rows + 1) * (step * every)
    if isinstance(network, Network) and one_history:
        return Trajectory(times, states[0], slopes[0])
    return Trajectory(times, states[:batch], slopes[:batch])
