"""The delayed network in real time: a ring of history, a fixed model step, constant memory."""

import copy
import math

import numpy as np

from cpg_ros.dynamics import kernel
from cpg_ros.dynamics.simulate import History, sample_history
from cpg_ros.networks.delayed import Delayed, Mode

#: Model time per step of the generator: 500 steps a cycle, error of a waveform about 1e-9.
STEP = 0.0025


class Stepper:
    """One network advancing in model time, evaluated between its nodes.

    The parameters, the delay among them, can be changed while it runs: the history is kept,
    and the next step starts with the slope of the new parameters.

    Attributes:
        now: x, x', x'' at the output instant, shape (3, cells), overwritten by ``advance``.

    """

    def __init__(self, network: Delayed, history: History, step: float = STEP,
                 max_delay: float = 5.0, gain: float = 0.0, mode: Mode | None = None) -> None:
        """Start at model time 0 from a history.

        Args:
            network: parameters.
            history: constant state, function of times t <= 0, or orbit.
            step: model time per step, at most the delay.
            max_delay: longest delay that may be set later, in model time.
            gain: gain of the symmetry lock, in 1/model time; 0 is the paper's model.
            mode: symmetry class of the lock, needed for a gain other than 0.

        Raises:
            ValueError: a step or delay out of range, or a history that does not fit.

        """
        if not (math.isfinite(step) and step > 0.0 and max_delay >= step):
            raise ValueError(f'step {step} must be positive and at most max_delay {max_delay}')
        self.step = step
        self.max_delay = max_delay
        nodes = math.ceil(max_delay / step) + 3
        states, slopes = sample_history(history, nodes, step, network.cells)
        self._x, self._after, self._before = states, slopes, slopes.copy()
        self._clock = np.array([nodes - 1, 0.0])
        self._tau = np.empty(1)
        self.now = np.empty((3, network.cells))
        self.set(network, gain, mode)
        self.advance(0.0)

    def set(self, network: Delayed, gain: float = 0.0, mode: Mode | None = None) -> None:
        """Go on with other parameters from the next step, keeping the history.

        Raises:
            ValueError: the delay is shorter than a step or longer than the ring, a gain
                without its class, or a value that is not finite. Nothing is changed then.

        """
        if not all(math.isfinite(v) for v in (*network.as_dict().values(), gain)):
            raise ValueError(f'not finite: {network}, gain {gain}')
        if not self.step <= network.tau <= self.max_delay:
            raise ValueError(f'tau {network.tau} must be from {self.step} to {self.max_delay}')
        if gain and mode is None:
            raise ValueError('a symmetry gain needs the symmetry class')
        self.network, self.gain, self.mode = network, gain, mode
        self._tau[0] = network.tau
        self._fixed = (network.kind, network.coefficients, self._tau, float(gain),
                       np.zeros((1, network.cells)) if mode is None else mode.basis, self.step,
                       self._x, self._after, self._before)
        kernel.set_slope(*self._fixed, int(self._clock[0]))

    def advance(self, duration: float) -> np.ndarray:
        """Advance by a duration in model time (0 or more); return x, x', x'', shape (3, cells).

        The array returned is the same one every time.
        """
        kernel.advance(*self._fixed, self._clock, duration, self.now)
        return self.now

    def copy(self) -> 'Stepper':
        """Return an independent stepper in the same state."""
        twin = copy.copy(self)
        for name in ('_x', '_after', '_before', '_clock', '_tau', 'now'):
            setattr(twin, name, getattr(self, name).copy())
        twin.set(self.network, self.gain, self.mode)
        return twin

    @property
    def ahead(self) -> float:
        """Model time from the output instant to the newest node, less than a step."""
        return float(self._clock[1])

    def newest(self) -> np.ndarray:
        """Return the state at the newest node, shape (cells,)."""
        return self._x[int(self._clock[0])].copy()

    def disturb(self, offset: np.ndarray) -> None:
        """Add an offset, shape (cells,), to the newest state; the history before it stays."""
        self._x[int(self._clock[0])] += offset
        kernel.set_slope(*self._fixed, int(self._clock[0]))
