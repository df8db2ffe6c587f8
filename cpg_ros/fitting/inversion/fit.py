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

"""Fits and their uncertainty: standard errors, intervals, undetermined numbers; the class Fit.

A wrong model leaves a residual that exceeds the standard errors of the mean cycle and is
correlated along it. Therefore each joint is weighted by its residual where that is larger, and
variances are multiplied by the residual's correlation length. Where noise does not explain the
residual, the model's waveforms are assumed to be wrong by as much as explains it, which widens the
intervals of the numbers that such errors move.
"""

from dataclasses import dataclass, replace
from functools import cached_property

from cpg_ros.common.errors import short, ShortRepr
from cpg_ros.dynamics.arclength import NoOrbit
from cpg_ros.dynamics.hopf import first_hopf, HopfPoint
from cpg_ros.dynamics.orbit import Orbit
from cpg_ros.dynamics.stability import GaitAssessment
from cpg_ros.fitting.inversion.cycle_problem import CycleProblem
from cpg_ros.fitting.inversion.free_parameters import distinct, Minimisation
from cpg_ros.networks.network import Network
import numpy as np
from scipy.special import chdtri, stdtrit

#: QUANTILE: half the width of a 95 % interval, standard errors.
QUANTILE = 1.959964
#: RANK_TOLERANCE: singular value of the scaled derivative, over the largest, up to which it is 0;
#: NULL_THRESHOLD: component of a number in such a direction from which on it is not determined.
RANK_TOLERANCE, NULL_THRESHOLD = 1e-7, 1e-3
#: MAX_QUADRATIC_WIDTH: half width of an interval, over the value, up to which costs are taken for
#: quadratic; MAX_STEPS: to the end of a wider one; INTERVAL_TOLERANCE: relative, there;
#: MAX_STEP_GROWTH: of a step over the last one; EDGE_THRESHOLD: fraction of its length that a step
#: misses where orbits end; BOUND_TOLERANCE: distance from a bound, over the interval's quadratic
#: half width, up to which a number is at the bound.
MAX_QUADRATIC_WIDTH, MAX_STEPS, INTERVAL_TOLERANCE = 0.05, 10, 0.03
MAX_STEP_GROWTH, EDGE_THRESHOLD, BOUND_TOLERANCE = 3.0, 0.2, 1e-6
#: Of a descent with one number given (profile likelihood). CONSTRAINT_WIDTH: width, over its size,
#: of the residual that draws the number to its target.
PROFILE_TOLERANCE, MAX_EVALUATIONS, CONSTRAINT_WIDTH = 1e-4, 30, 0.3
#: MAX_NOISE_RATIO: RMS residual that noise explains, in its standard errors.
MAX_NOISE_RATIO = 1.1
#: SIGNIFICANCE: of an error of the model; NOISE_VARIANCE_RATIO: variance of the noise along a
#: waveform's harmonics, over its mean, as readouts take a part of it and mean cycles have fewer
#: harmonics than instants.
SIGNIFICANCE, NOISE_VARIANCE_RATIO = 0.01, 1.5


@dataclass(frozen=True)
class Estimate:
    """A fitted number.

    Attributes:
        value: the number at the least cost.
        stderr: standard error; infinite where the data do not separate it from others.
        low, high: 95 % interval, within the bounds.
        bounded: whether the data bound it on both sides; where not, an end of the interval is
            that of the bounds, or the edge of where there is an orbit.

    """

    value: float
    stderr: float
    low: float
    high: float
    bounded: bool

    def union(self, other: 'Estimate') -> 'Estimate':
        """Return this estimate with an interval that includes another's."""
        return replace(self, low=min(self.low, other.low), high=max(self.high, other.high),
                       bounded=self.bounded and other.bounded)


def correlation_length(residual: np.ndarray) -> float:
    """Return the number of instants that share one independent residual, at least 1.

    It is the integrated autocorrelation along the cycle, up to its first zero.

    Args:
        residual: on even instants, over its size, shape (m, joints).

    """
    power = np.sum(np.abs(np.fft.rfft(residual, axis=0))**2, axis=1)
    acf = np.fft.irfft(power, len(residual))[:len(residual) // 2 + 1]
    if acf[0] <= 0.0:
        return 1.0
    acf /= acf[0]
    end = int(np.argmax(acf <= 0.0)) if (acf <= 0.0).any() else acf.size
    return float(1.0 + 2.0 * acf[1:end].sum())


@dataclass(frozen=True, eq=False, repr=False)
class Spread(ShortRepr):
    """Covariance of the numbers of a fit.

    Attributes:
        covariance: shape (n, n), in the directions that are determined.
        blind: directions that do not change the residual, one a row, in units of scale, shape
            (directions, n).
        scale: change of each number that by itself changes the residual by 1, shape (n,).
        inflation: factor on all variances, which is included.

    """

    covariance: np.ndarray
    blind: np.ndarray
    scale: np.ndarray
    inflation: float

    @property
    def errors(self) -> np.ndarray:
        """Standard errors, shape (n,); infinite for numbers that are not determined."""
        errors = np.sqrt(np.diag(self.covariance))
        if len(self.blind):
            errors[np.abs(self.blind).max(axis=0) > NULL_THRESHOLD] = np.inf
        return errors

    @property
    def correlation(self) -> np.ndarray:
        """Correlations, shape (n, n); NaN for numbers that are not determined."""
        errors = self.errors
        with np.errstate(invalid='ignore', divide='ignore'):
            correlation = self.covariance / np.outer(errors, errors)
        correlation[~np.isfinite(errors)] = correlation[:, ~np.isfinite(errors)] = np.nan
        np.fill_diagonal(correlation, 1.0)
        return correlation


def spread(jacobian: np.ndarray, inflation: float) -> Spread:
    """Return the covariance of the numbers of a fit from its derivatives.

    Args:
        jacobian: of the residual over its standard errors, shape (residuals, n).
        inflation: factor on all variances.

    """
    size = np.linalg.norm(jacobian, axis=0)
    scale = 1.0 / np.where(size > 0.0, size, 1.0)
    values, rows = np.linalg.svd(jacobian * scale, full_matrices=False)[1:]
    significant = values > RANK_TOLERANCE * max(values[0], 1e-300)
    half = rows[significant] / values[significant, None]
    return Spread(inflation * (half.T @ half) * np.outer(scale, scale), rows[~significant], scale,
                  inflation)


@dataclass(frozen=True, eq=False, repr=False)
class ModelError(ShortRepr):
    """Effect of errors in the model's waveforms on the numbers of a fit.

    Attributes:
        size: RMS of the waveforms' errors, each harmonic over half the waveform's range; 0 where
            noise explains the residual, infinite if it is not known.
        errors: standard deviation of each number by these, shape (n,).
        quantile: half the width of a 95 % interval, in these.

    """

    size: float
    errors: np.ndarray
    quantile: float

    @classmethod
    def unknown(cls, count: int) -> 'ModelError':
        """Return errors of any size, for this many numbers."""
        return cls(np.inf, np.full(count, np.inf), QUANTILE)


def model_error(residual: np.ndarray, jacobian: np.ndarray, by_waveform: np.ndarray,
                noise: float) -> ModelError:
    """Estimate the errors of the waveforms from the residual, as independent and of one size.

    The residual shows what numbers and readouts do not absorb; the rest moves the numbers.

    Args:
        residual: shape (residuals,).
        jacobian: its derivative by the numbers, shape (residuals, n).
        by_waveform: its derivative by the waveforms' harmonics, shape (residuals, terms).
        noise: sum of squares of the residual that noise alone would leave.

    """
    size = np.linalg.norm(jacobian, axis=0)
    columns = jacobian / np.where(size > 0.0, size, 1.0)
    projection = np.linalg.pinv(columns, RANK_TOLERANCE) @ by_waveform
    ways, s, _ = np.linalg.svd(by_waveform - columns @ projection, full_matrices=False)
    ways, s = ways[:, s > RANK_TOLERANCE * s[0]], s[s > RANK_TOLERANCE * s[0]]**2
    excess = float(residual @ residual) - MAX_NOISE_RATIO**2 * noise
    explained = float(np.sum((residual @ ways)**2))
    level = NOISE_VARIANCE_RATIO * noise / residual.size
    if explained > chdtri(s.size, SIGNIFICANCE) * level:
        # In the few directions of such errors far less of them shows than in the whole residual.
        excess = max(excess, explained - s.size * level)
    if excess <= 0.0 or not s.size:
        return ModelError(0.0, np.zeros(size.size), QUANTILE)
    waveform = float(np.sqrt(excess / s.sum()))
    # Errors of a model favour some harmonics: as of one direction fewer than are seen.
    freedom = float(s.sum()**2 / np.sum(s**2)) - 1.0
    return ModelError(waveform, waveform * np.linalg.norm(projection, axis=1)
                      / np.where(size > 0.0, size, 1.0), float(stdtrit(max(freedom, 1.0), 0.975)))


def estimates(problem: CycleProblem, values: np.ndarray, uncertainty: Spread,
              model: ModelError, straight: bool = False) -> dict[str, Estimate]:
    """Estimate the free numbers, with intervals by noise and by errors of the model.

    Args:
        problem: the fit.
        values: at the least cost, shape (n,).
        uncertainty: their covariance.
        model: errors of the model.
        straight: whether the cost is assumed to be quadratic in wide intervals, too.

    """
    result, count = {}, len(problem.free)
    halves = np.hypot(QUANTILE * uncertainty.errors, model.quantile * model.errors)[:count]
    wide = bool((halves > MAX_QUADRATIC_WIDTH * np.abs(values[:count])).any())
    curved = wide and not (straight or model.size)
    for k, (free, half) in enumerate(zip(problem.free, halves.tolist(), strict=True)):
        value = float(values[k])
        low, high = max(free.low, value - half), min(free.high, value + half)
        bounded = free.low < low and high < free.high
        if curved and half < np.inf:
            (low, below), (high, above) = (_end(problem, values, uncertainty, k, side * half)
                                           for side in (-1.0, 1.0))
            bounded = below and above
        result[free.name] = Estimate(
            value, float(np.hypot(uncertainty.errors[k], model.errors[k])), low, high, bounded)
    return result


def _end(problem: CycleProblem, values: np.ndarray, uncertainty: Spread, k: int, half: float
         ) -> tuple[float, bool]:
    """Find an end of an interval, where the least cost for a given number k has risen enough.

    Args:
        problem: the fit.
        values: at the least cost.
        uncertainty: their covariance.
        k: index of the number.
        half: first distance, negative for the lower end.

    Returns:
        Number k there, and whether the cost has risen enough; it has not at a bound of the number
        or where orbits end.

    """
    limit = problem.free[k].high if half > 0.0 else problem.free[k].low
    min_cost, target = problem.cost(values), float(values[k]) + half
    inside, outside = (0.0, values), (np.inf, values)
    for _ in range(MAX_STEPS):
        target = limit if half * (target - limit) >= 0.0 else target
        at = inside[1]
        if abs(target - at[k]) <= BOUND_TOLERANCE * abs(half):
            return float(at[k]), False
        end, cost = _minimum(problem, uncertainty, k, target, at)
        rise = float(np.sqrt(max(0.0, 2.0 * (cost - min_cost) / uncertainty.inflation)))
        if abs(rise - QUANTILE) <= INTERVAL_TOLERANCE * QUANTILE:
            return float(end[k]), True
        if rise > QUANTILE:
            outside = rise, end
        elif target == limit or abs(end[k] - target) > EDGE_THRESHOLD * abs(target - at[k]):
            return float(end[k]), False
        else:
            further = (QUANTILE - rise) / max(rise - inside[0], 0.1 * (QUANTILE - rise))
            target = float(end[k] + min(MAX_STEP_GROWTH, 1.05 * further) * (end[k] - at[k]))
            inside = rise, end
        if np.isfinite(outside[0]):
            fraction = np.clip((QUANTILE - inside[0]) / (outside[0] - inside[0]), 0.1, 0.9)
            target = float(inside[1][k] + fraction * (outside[1][k] - inside[1][k]))
    return ((float(inside[1][k]), False) if np.isinf(outside[0])
            else (float(outside[1][k]), True))


def _minimum(problem: CycleProblem, uncertainty: Spread, k: int, target: float, at: np.ndarray
           ) -> tuple[np.ndarray, float]:
    """Minimise the cost with number k near a target; return values and cost.

    An additional residual pulls number k there, so that no step starts where there is no orbit.
    """
    row = (np.arange(at.size) == k) / (CONSTRAINT_WIDTH * INTERVAL_TOLERANCE * abs(target - at[k]))

    def evaluate(values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        residual, slopes = problem(values)
        return np.append(residual, row @ values - row[k] * target), np.vstack([slopes, row])

    try:
        begin = problem.rephased(problem.coordinates.move(
            at, (target - at[k]) * uncertainty.covariance[:, k] / uncertainty.covariance[k, k]))
        residual, slopes = problem(begin)
        others = np.delete(slopes * uncertainty.scale, k, axis=1)
        rest = residual - others @ np.linalg.lstsq(others, residual, RANK_TOLERANCE)[0]
        cost, rest_cost = 0.5 * float(residual @ residual), 0.5 * float(rest @ rest)
        # Where a linear step of the others gains little, none is taken.
        if cost - rest_cost < INTERVAL_TOLERANCE * uncertainty.inflation:
            return begin, rest_cost
    except NoOrbit:
        begin = at
    point = problem.coordinates.descend(evaluate, begin, PROFILE_TOLERANCE, MAX_EVALUATIONS).values
    return point, problem.cost(point)


#: MIN_JOINT_RANGE: of a mean cycle, rad; a joint that moves by less stands.
MIN_JOINT_RANGE = 0.01


def rms_shares(data: np.ndarray, errors: np.ndarray) -> np.ndarray:
    """Return RMS error over range of each joint, nan for one that stands, shape (joints,).

    Args:
        data: rad, shape (joints, m).
        errors: fitted minus recorded, rad, the same.

    """
    spans = np.ptp(data, axis=1)
    return np.sqrt(np.mean(errors**2, axis=1)) / np.where(spans > MIN_JOINT_RANGE, spans, np.nan)


def mean_share(data: np.ndarray, errors: np.ndarray) -> float:
    """Return the mean of the same over the joints that move; 0 if none does."""
    shares = rms_shares(data, errors)
    return float(np.nansum(shares) / max(np.isfinite(shares).sum(), 1))


@dataclass(frozen=True, eq=False, repr=False)
class Fit(ShortRepr):
    """A gait fitted to a mean cycle.

    Attributes:
        network: the fitted parameters.
        gait: one of its gaits.
        orbit: the gait's.
        order: of the readouts.
        fractions: order of the readout -> mean RMS error over range with that order, the
            parameters kept.
        harmonics: of a Morris-Lecar cell's waveform that joints follow.
        duty: fraction of the stride in stance; None for that of the network's cells.
        stance: phase at which legs begin to stand without a duty, and the fraction, as in a robot
            file; None if they stand while their cells fall.
        parameters: free number -> estimate; then those that were read from the legs' phases.
        correlation: of the free numbers, in their order; nan where the data do not separate one
            from others.
        cells: joint -> the cell behind it, from 1.
        readouts: joint -> offset and weights, rad, as a robot file takes them.
        theta: cycles, shape (m,).
        recorded: mean cycle of each joint, rad, shape (joints, m).
        errors: fitted minus recorded, rad, shape (joints, m).
        phase: of the orbit where theta is 0, cycles.
        cost: half the sum of squares of the errors over their sizes.
        sizes: joint -> standard error of its mean cycle, or its residual if that is larger, rad.
        misfit: joint -> residual over the standard error of its mean cycle.
        sharing: number of instants that share one independent error.
        model_error: RMS of the waveforms' errors that explain the residual, each harmonic over
            half the waveform's range; 0 where noise explains it, infinite if it is not known.
        starts: result of each start.
        warnings: one line each.

    """

    network: Network
    gait: str
    orbit: Orbit
    order: int
    fractions: dict[int, float]
    harmonics: int
    duty: float | None
    stance: tuple[float, float] | None
    parameters: dict[str, Estimate]
    correlation: np.ndarray
    cells: dict[str, int]
    readouts: dict[str, tuple[float, tuple[float, ...]]]
    theta: np.ndarray
    recorded: np.ndarray
    errors: np.ndarray
    phase: float
    cost: float
    sizes: dict[str, float]
    misfit: dict[str, float]
    sharing: float
    model_error: float
    starts: tuple[Minimisation, ...]
    warnings: tuple[str, ...]

    def _summary(self) -> str:
        return (f'{self.gait} of {self.network.name} to {len(self.joints)} joints: RMS error '
                f'{100.0 * self.mean_rms_share:.3g} % of range, '
                f'{short({name: estimate.value for name, estimate in self.parameters.items()})}')

    @property
    def joints(self) -> tuple[str, ...]:
        """Names of the joints."""
        return tuple(self.readouts)

    @property
    def fitted(self) -> np.ndarray:
        """The fitted joints at theta, rad, shape (joints, m)."""
        return self.recorded + self.errors

    @property
    def free(self) -> tuple[str, ...]:
        """Names of the parameters that were fitted."""
        return tuple(self.parameters)[:len(self.correlation)]

    @property
    def minima(self) -> list[Minimisation]:
        """Distinct minima that the starts converged to, the least cost first."""
        minima: list[Minimisation] = []
        for trial in sorted(self.starts, key=lambda minimum: minimum.cost):
            if not minima or (trial.converged and all(
                    distinct(trial.values[:-1], minimum.values[:-1]) for minimum in minima)):
                minima.append(trial)
        return minima

    @property
    def rms(self) -> dict[str, float]:
        """Root mean square error of each joint, rad."""
        return dict(zip(self.readouts, np.sqrt(np.mean(self.errors**2, axis=1)).tolist(),
                        strict=True))

    @property
    def rms_share(self) -> dict[str, float]:
        """RMS error over the joint's range; 0 for a joint that stands."""
        shares = np.nan_to_num(rms_shares(self.recorded, self.errors))
        return dict(zip(self.readouts, shares.tolist(), strict=True))

    @property
    def mean_rms_share(self) -> float:
        """Mean over the joints that move; 0 if none does."""
        return mean_share(self.recorded, self.errors)

    @cached_property
    def hopf(self) -> HopfPoint | None:
        """Hopf point from which the gait emerges as the delay grows; None without delay."""
        return first_hopf(self.network, self.gait)

    @cached_property
    def verdict(self) -> GaitAssessment:
        """Verdict on the gait's stability."""
        return GaitAssessment(self.gait, self.orbit)
