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

"""A network in real time: a ring of history, a fixed step, constant memory."""

from collections.abc import Callable
import copy
import math

from cpg_ros.common.errors import InputError
from cpg_ros.dynamics.integration.c_kernel import Lane, library_of
from cpg_ros.dynamics.integration.simulate import History, sample_history
from cpg_ros.networks.network import Network
from cpg_ros.networks.symmetry import Symmetry
import numpy as np


class Stepper:
    """A network that advances in model time, evaluated between its nodes.

    Parameters can change while it runs: the history stays, and the next step starts with the slope
    at the new ones.

    Attributes:
        now: x, x', x'' at the output instant, shape (3, components), overwritten by ``advance``.
        history: ring of states, and of slopes after and before them, (nodes, components) each.
        lane: network, symmetry lock and history, as C takes them.
        clock: newest node, and model time from the output instant to it, shape (2,).

    """

    def __init__(self, network: Network, history: History, step: float | None = None,
                 max_delay: float | None = None, gain: float = 0.0,
                 symmetry: Symmetry | None = None) -> None:
        """Start at model time 0 from a history.

        Args:
            network: parameters.
            history: constant state, function of times t <= 0, or orbit.
            step: model time, at most the delay; by default the network's own.
            max_delay: longest delay that may be set later, model time; by default the network's
                own.
            gain: of the symmetry lock, 1/model time; 0 is the paper's model.
            symmetry: of the gait to lock, required for a gain other than 0.

        Raises:
            ValueError: a step or delay is out of range, or a history does not fit.

        """
        step = network.step if step is None else step
        max_delay = max(network.longest_delay, step) if max_delay is None else max_delay
        if not (math.isfinite(step) and step > 0.0 and max_delay >= step):
            raise InputError(f'step {step} must be positive and at most max_delay {max_delay}')
        self.step = float(step)
        self.max_delay = max_delay
        nodes = math.ceil(max_delay / step) + 3
        states, slopes = sample_history(history, nodes, step, network.components)
        self._x, self._after, self._before = states, slopes, slopes.copy()
        self.clock = np.array([nodes - 1, 0.0])
        self.now = np.empty((3, network.components))
        self.set(network, gain, symmetry)
        self.advance(0.0)

    def set(self, network: Network, gain: float = 0.0,  # noqa: A003
            symmetry: Symmetry | None = None) -> None:
        """Continue with other parameters from the next step, keeping the history.

        Raises:
            ValueError: the delay is shorter than a step or longer than the ring, a gain has no
                symmetry, or a value is not finite. Nothing has changed then.

        """
        if not all(math.isfinite(v) for v in (*network.as_dict().values(), gain)):
            raise InputError(f'not finite: {network}, gain {gain}')
        if network.delay_parameter and not self.step <= network.delay <= self.max_delay:
            raise InputError(f'{network.delay_parameter} {network.delay} must be from '
                             f'{self.step} to {self.max_delay}')
        if gain and symmetry is None:
            raise ValueError('a symmetry gain needs the symmetry class')
        self.network, self.gain, self.symmetry = network, gain, symmetry
        self._library = library_of(type(network))
        self.history = self._x, self._after, self._before
        self.lane = Lane(network, float(gain), np.zeros((1, network.components))
                         if symmetry is None else symmetry.basis, self.step, self.history)
        self._addresses = self.clock.ctypes.data, self.now.ctypes.data
        self._restart()

    def _restart(self) -> None:
        """Recompute the slope that leaves the newest node."""
        self._library.set_slope(self.lane.pointer, int(self.clock[0]))

    def advance(self, duration: float) -> np.ndarray:
        """Advance by a duration in model time, 0 or more; return x, x', x'', (3, components).

        Every call returns the same array.
        """
        clock, now = self._addresses
        self._library.advance(self.lane.pointer, clock, duration, now)
        return self.now

    def copy(self) -> 'Stepper':
        """Return an independent stepper in the same state."""
        twin = copy.copy(self)
        for name in ('_x', '_after', '_before', 'clock', 'now'):
            setattr(twin, name, getattr(self, name).copy())
        twin.set(self.network, self.gain, self.symmetry)
        return twin

    @property
    def ahead(self) -> float:
        """Model time from the output instant to the newest node, less than a step."""
        return float(self.clock[1])

    def newest(self) -> np.ndarray:
        """Return the state at the newest node, shape (components,)."""
        return self._x[int(self.clock[0])].copy()

    def disturb(self, offset: np.ndarray) -> None:
        """Add an offset, shape (components,), to the newest state; the history before it stays."""
        self._x[int(self.clock[0])] += offset
        self._restart()

    def superpose(self, motion: Callable[[np.ndarray], np.ndarray],
                  slope: Callable[[np.ndarray], np.ndarray]) -> None:
        """Add a motion to the newest state and to all of the history before it.

        Args:
            motion: of model times up to 0, that of the newest node; (n,) to (n, components).
            slope: its derivative, per model time, likewise.

        """
        nodes, newest = len(self._x), int(self.clock[0])
        times = (np.arange(nodes) - nodes + 1) * self.step
        oldest_first = (newest + 1 + np.arange(nodes)) % nodes
        self._x[oldest_first] += motion(times)
        slopes = slope(times)
        self._after[oldest_first] += slopes
        self._before[oldest_first] += slopes
        self._restart()
