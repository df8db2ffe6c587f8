"""Gaits of the delayed network as exact periodic orbits.

On a primary gait every cell is x_1 shifted by a known phase, so the eight delay equations
collapse to one periodic problem (docs/theory.md, section Exact orbits): with theta = t / T,
``u'(theta)/T = a u + b tanh u + d tanh u(theta + phi_d) + c tanh u(theta + phi_c - tau/T)``,
solved by Fourier collocation with the period as unknown. Phase zero is where x_1 peaks.
"""

from dataclasses import astuple, dataclass, replace

import numpy as np
from scipy.optimize import brentq

from cpg_ros.dynamics import fourier as collocation
from cpg_ros.dynamics.hopf import hopf_point, weakened
from cpg_ros.dynamics.periodic import NoOrbit, Orbit
from cpg_ros.errors import InputError
from cpg_ros.networks.delayed import Delayed, Mode

NODES = 63
MOST_NODES = 255
#: Newton stops at this residual; a waveform is resolved when its last harmonics are this small.
TOLERANCE = 1e-12
RESOLVED = 1e-12
#: Below this amplitude Newton has fallen to the rest state.
SMALLEST = 1e-7


@dataclass(frozen=True, eq=False)
class DelayedOrbit(Orbit):
    """A primary gait: one waveform on evenly spaced nodes.

    Attributes:
        values: x_1 at the nodes theta = m / n, shape (n,); values[0] is the peak.
        d_values: derivatives of the nodal values by a, b, c, d, tau, at fixed theta, shape
            (n, 5).

    """

    network: Delayed
    values: np.ndarray
    d_values: np.ndarray

    @property
    def peak(self) -> float:
        """Amplitude: the largest value of every cell."""
        return float(self.values[0])

    @property
    def levels(self) -> np.ndarray:  # type: ignore[override]
        """Middle, which the symmetry x -> -x puts at 0, and half the range, shape (1, 1, 2)."""
        return np.array([[[0.0, self.peak]]])

    def waveform(self, theta: np.ndarray, order: int = 0, wave: int = 0, variable: int = 0
                 ) -> np.ndarray:
        """x_1, or its derivative in theta of the given order, at theta in cycles."""
        return collocation.evaluate(self.values, theta, order)

    def d_waveform(self, theta: np.ndarray, wave: int = 0, variable: int = 0) -> np.ndarray:
        """Derivatives of x_1 by the parameters, shape theta.shape + (parameters,)."""
        return np.stack([collocation.evaluate(column, theta) for column in self.d_values.T], -1)

    def _states(self, times: np.ndarray, order: int) -> np.ndarray:
        theta = np.asarray(times, dtype=float) / self.period
        return collocation.evaluate(self.values, theta, order, self.phases)


def equations(network: Delayed, mode: Mode, u: np.ndarray, period: float
              ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Residual (n + 1,), its Jacobian in (u, T), and its derivative in (a, b, c, d, tau)."""
    n = u.size
    a, b, c, d, tau = network.as_dict().values()
    derive = collocation.derivative_matrix(n)
    ring, _ = collocation.shift_matrices(n, -mode.j / 4)
    delayed, delayed_slope = collocation.shift_matrices(n, mode.k / 2 - tau / period)

    slope, past, past_slope = derive @ u, delayed @ u, delayed_slope @ u
    here, neighbour, across = np.tanh(u), np.tanh(ring @ u), np.tanh(past)
    residual = np.empty(n + 1)
    residual[:n] = slope / period - a * u - b * here - d * neighbour - c * across
    residual[n] = slope[0]

    jacobian = np.zeros((n + 1, n + 1))
    jacobian[:n, :n] = (derive / period - d * (1.0 - neighbour**2)[:, None] * ring
                        - c * (1.0 - across**2)[:, None] * delayed)
    jacobian[np.arange(n), np.arange(n)] -= a + b * (1.0 - here**2)
    by_shift = c * (1.0 - across**2) * past_slope
    jacobian[:n, n] = -slope / period**2 - by_shift * tau / period**2
    jacobian[n, :n] = derive[0]

    by_parameter = np.zeros((n + 1, 5))
    by_parameter[:n] = np.stack([-u, -here, -across, -neighbour, by_shift / period], axis=1)
    return residual, jacobian, by_parameter


def complete(network: Delayed, mode: Mode, u: np.ndarray, period: float, residual: np.ndarray,
             jacobian: np.ndarray, by_parameter: np.ndarray) -> DelayedOrbit:
    """Complete a solution by its derivatives; the last three are those of the equations."""
    derivatives = -np.linalg.solve(jacobian, by_parameter)
    return DelayedOrbit(network, mode, period, float(np.abs(residual[:-1]).max()),
                        derivatives[-1], u, derivatives[:-1])


def _newton(network: Delayed, mode: Mode, u: np.ndarray, period: float) -> DelayedOrbit | None:
    """Newton from a guess, doubling the nodes until the waveform is resolved."""
    while True:
        for _ in range(12):
            residual, jacobian, by_parameter = equations(network, mode, u, period)
            size = float(np.abs(residual[:-1]).max())
            if size <= TOLERANCE * max(1.0, float(np.abs(u).max()) * abs(network.c)):
                break
            # numpy's solver, unlike scipy's, releases the interpreter lock: a node publishes
            # while it solves.
            try:
                step = np.linalg.solve(jacobian, residual)
            except np.linalg.LinAlgError:
                return None
            u, period = u - step[:-1], period - float(step[-1])
            # A period that leaves the range of the delay has run away, and so has a waveform.
            if not (1e-3 * network.tau < period < 1e3 * network.tau and np.abs(u).max() < 1e3):
                return None
        else:
            return None
        if np.abs(u).max() < SMALLEST:
            return None
        if collocation.tail(u) <= RESOLVED:
            break
        if u.size >= MOST_NODES:
            raise NoOrbit(f'the waveform is too steep for {MOST_NODES} nodes')
        u = collocation.resample(u, 2 * u.size + 1)
    return complete(network, mode, u, period, residual, jacobian, by_parameter)


def _continued(network: Delayed, mode: Mode, onset: float) -> DelayedOrbit | None:
    """Follow the orbit in the delay from near its onset, halving steps that fail."""
    tau, reached = network.tau, onset
    ahead = onset + 0.1 * (tau - onset)
    orbit, tries = None, 0
    while reached < tau and tries < 10:
        tries += 1
        here = replace(network, tau=ahead)
        guess = _guess(here, mode) if orbit is None else (orbit.values, orbit.period + float(
            orbit.d_period[-1]) * (ahead - reached))
        found = None if guess is None else _newton(here, mode, *guess)
        if found is None or found.values.argmax() != 0:
            ahead = reached + 0.4 * (ahead - reached)
            continue
        reached, orbit = ahead, found
        ahead = min(tau, reached + 1.6 * max(ahead - reached, 0.1 * (tau - onset)))
    return orbit if reached >= tau else None


def _describing_gain(amplitude: float) -> float:
    """First-harmonic gain of tanh for an input amplitude * cos."""
    angle = np.arange(32) * (2.0 * np.pi / 32)
    return float(2.0 / 32 * (np.tanh(amplitude * np.cos(angle)) @ np.cos(angle)) / amplitude)


def _guess(network: Delayed, mode: Mode) -> tuple[np.ndarray, float] | None:
    """First-harmonic waveform and period: the amplitude whose weakened network is at its Hopf."""
    def excess(amplitude: float) -> float:
        point = hopf_point(weakened(network, _describing_gain(amplitude)), mode)
        return 1e3 if point is None else point.tau - network.tau

    low, high = 0.0, 1e-3
    while excess(high) < 0.0:
        low, high = high, 2.0 * high
        if high > 1e3:
            return None
    low = max(low, 1e-6)
    if excess(low) >= 0.0:
        return None
    amplitude = brentq(excess, low, high, rtol=1e-3)
    point = hopf_point(weakened(network, _describing_gain(amplitude)), mode)
    if point is None:
        return None
    return amplitude * np.cos(2.0 * np.pi * np.arange(NODES) / NODES), 2.0 * np.pi / point.omega


def _predicted(network: Delayed, near: DelayedOrbit) -> tuple[np.ndarray, float]:
    """Waveform and period that the derivatives of a known orbit predict for a near network."""
    change = np.subtract(astuple(network), astuple(near.network))
    return near.values + near.d_values @ change, near.period + float(near.d_period @ change)


def solve(network: Delayed, gait: str, near: DelayedOrbit | None = None) -> DelayedOrbit:
    """Solve for the gait's orbit, with exact derivatives by every parameter.

    Args:
        network: parameters.
        gait: one of the six primary gaits.
        near: an orbit of that gait to start from; where it leads nowhere it does not matter.

    Raises:
        ValueError: an unknown gait, or parameters that are not finite or a delay not positive.
        NoOrbit: this set has no such orbit; the message names the threshold.

    """
    mode = network.symmetry(gait)
    for name, value in network.as_dict().items():
        if not np.isfinite(value):
            raise InputError(f'{name} is {value}, not a finite number')
    if network.tau <= 0.0:
        raise InputError(f'tau is {network.tau}, it must be positive')
    a, b = mode.eigenvalue_terms(network)
    if mode.j % 2 == 0 and b >= 0.0:
        wanted = 'positive' if mode.k else 'negative'
        raise NoOrbit(f'c {network.c:g} gives no {gait}: c must be {wanted}')
    point = hopf_point(network, mode)
    if point is None:
        raise NoOrbit(f'|c| {abs(network.c):g} gives no {gait} at any delay: it must be above '
                      f'{abs(a.real):.4f}')
    if network.tau <= point.tau:
        raise NoOrbit(f"tau {network.tau:g} is below the {gait}'s critical delay {point.tau:.4f}")
    if near is not None and near.symmetry == mode:
        try:
            orbit = _newton(network, mode, *_predicted(network, near))
        except NoOrbit:
            orbit = None
        if (orbit is not None and orbit.values.argmax() == 0
                and 0.5 < orbit.period / near.period < 2.0):
            return orbit
    reason = 'no orbit was found'
    try:
        guess = _guess(network, mode)
        orbit = None if guess is None else _newton(network, mode, *guess)
        if orbit is None or orbit.values.argmax() != 0:
            orbit = _continued(network, mode, point.tau)
    except NoOrbit as error:
        orbit, reason = None, str(error)
    if orbit is None:
        raise NoOrbit(f'no {gait} at tau {network.tau:g}, far from its critical delay '
                      f'{point.tau:.4f}: {reason}')
    return orbit
