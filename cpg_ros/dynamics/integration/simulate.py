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
from dataclasses import dataclass

from cpg_ros.common.command_line import progress_bar
from cpg_ros.common.errors import InputError, ShortRepr
from cpg_ros.dynamics.integration.c_kernel import c_kernels
from cpg_ros.dynamics.integration.compilation import COMPILED
from cpg_ros.dynamics.integration.kernel import Kernels, numba_kernels, Ring, Samples, System
from cpg_ros.networks.network import Network
from cpg_ros.networks.symmetry import Symmetry
import numpy as np

#: A constant state, shape (components,), or a function of times t <= 0, shape (m,), that
#: returns states, shape (m, components); an attribute ``derivative`` of the same form gives the
#: slopes.
History = np.ndarray | Sequence[float] | Callable[[np.ndarray], np.ndarray]

#: LANES: number of trajectories that advance together in vector registers.
LANES = 8
#: Backend of the kernels of batches: only numba's have noise and step all lanes at once.
_maker: Callable[[type[Network]], Kernels] = numba_kernels if COMPILED else c_kernels
#: CHUNK: work between two updates of the progress bar, components times steps.
CHUNK = 20_000_000


def use(maker: Callable[[type[Network]], Kernels]) -> None:
    """Set the kernels of this process; c_kernels are ready at once, without numba."""
    global _maker
    _maker = maker


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
                 batch: int) -> None:
        """Fill the rings of past states from the histories."""
        components, cells = networks[0].components, networks[0].cells
        # Five nodes at least, so that slopes of a given history are of fourth order.
        nodes = max(5, int(np.ceil(max(member.delay for member in networks) / step)) + 2)
        lanes = min(LANES, batch)
        blocks = -(-batch // lanes)
        members = np.minimum(np.arange(blocks * lanes), batch - 1).reshape(blocks, lanes)
        #: States, and slopes after and before each node.
        self._ring = np.empty((3, blocks, nodes, components, lanes))
        p = np.empty((blocks, networks[0].coefficients.shape[0], cells, lanes))
        self._tau = np.empty((blocks, lanes))
        samples = [sample_history(history, nodes, step, components) for history in histories]
        for (block, lane), m in np.ndenumerate(members):
            network = networks[m if len(networks) > 1 else 0]
            p[block, :, :, lane], self._tau[block, lane] = network.coefficients, network.delay
            past, slopes = samples[m if len(histories) > 1 else 0]
            self._ring[:, block, :, :, lane] = past, slopes, slopes
        self._p = p.reshape(blocks, -1, cells * lanes)
        self._step, self._batch = float(step), batch

    def run(self, compiled: Kernels, lock: tuple[float, np.ndarray], rows: int, every: int,
            noise: float, seed: int, progress: bool) -> tuple[np.ndarray, np.ndarray]:
        """Integrate by the kernels of the network, and by steps as of ``simulate``.

        Returns:
            States and slopes at the start and at ``rows`` nodes after it, shape (batch, rows + 1,
                components) each.

        """
        _, blocks, nodes, components, lanes = self._ring.shape
        flat = self._ring.reshape(3, blocks, nodes, components * lanes)
        head, steps = nodes - 1, rows * every
        systems = [System(p, tau, *lock) for p, tau in zip(self._p, self._tau, strict=True)]
        rings = [Ring(self._step, *flat[:, block]) for block in range(blocks)]
        for system, ring in zip(systems, rings, strict=True):
            compiled.set_slope(system, ring, head)
        states = np.empty((self._batch, rows + 1, components))
        slopes = np.empty_like(states)
        for m in range(self._batch):
            states[m, 0], slopes[m, 0] = self._ring[:2, m // lanes, head, :, m % lanes]
        record = Samples(every, states, slopes)
        with progress_bar('simulating', steps, enabled=progress) as bar:
            done = 0
            while done < steps:
                chunk = min(steps - done, max(1, CHUNK // (blocks * components * lanes)))
                seeds = np.random.SeedSequence([seed, done]).generate_state(blocks)
                if blocks == 1:
                    head = compiled.integrate(systems[0], rings[0], head, chunk, noise, seeds[0],
                                              record, done + 1)
                else:
                    head = compiled.integrate_many(
                        System(self._p, self._tau, *lock), Ring(self._step, *flat), head, chunk,
                        noise, seeds, record, done + 1)
                done += chunk
                bar(done)
        return states, slopes


def simulate(network: Network | Sequence[Network], history: History | Sequence[History],
             t_end: float, step: float | None = None, *,
             lock: tuple[float, Symmetry] | None = None,
             noise: float = 0.0, seed: int = 0, every: int = 1, progress: bool = True
             ) -> Trajectory:
    """Integrate a network from a history, by RK4 with cubic Hermite delayed values.

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
    lanes = _Lanes(networks, histories, step, batch)
    gain, basis = (0.0, np.zeros((1, networks[0].components))) if lock is None else (
        float(lock[0]), lock[1].basis)
    # A single run takes as long in C, which compiles sooner than numba's but has no noise.
    maker = c_kernels if batch == 1 and not noise else _maker
    compiled = (numba_kernels if noise and COMPILED else maker)(type(networks[0]))
    states, slopes = lanes.run(compiled, (gain, basis), rows, every, float(noise), seed, progress)
    times = np.arange(rows + 1) * (step * every)
    if isinstance(network, Network) and one_history:
        return Trajectory(times, states[0], slopes[0])
    return Trajectory(times, states, slopes)
