"""How well a fit determines its free numbers: standard errors, intervals, and what it cannot tell.

The residual of a model that is not the truth is no noise: it is larger than the standard errors
of the mean cycle, and neighbouring instants share it. So a joint counts with what its readout
leaves where that is more, and variances are inflated by how far the residual is correlated along
the cycle. Intervals are quadratic where the cost is, and those of the profile likelihood where it
is not.
"""

from dataclasses import dataclass

import numpy as np

from cpg_ros.dynamics.periodic import NoOrbit
from cpg_ros.fitting.trials import Evaluate, descend

#: Half the width of a 95 % interval, in standard errors.
QUANTILE = 1.959964
#: Singular values of the scaled derivative below this share of the largest are exact zeros, and
#: numbers with this share in such a direction cannot be told.
ZERO, SHARE = 1e-7, 1e-3
#: The cost rises by what the quadratic says, within these factors, or its profile is followed.
QUADRATIC = (0.85, 1.18)
#: Steps of a profile on either side, and its tolerance in standard errors.
STEPS, CLOSE = 10, 0.03
TOLERANCE = 1e-4


@dataclass(frozen=True)
class Estimate:
    """A fitted number.

    Attributes:
        value: where the cost is least.
        stderr: standard error; infinite where the data do not tell it from others.
        low, high: 95 % interval, within the bounds.
        bounded: whether the data bound it on both sides; where not, an end of the interval is
            that of the bounds, or the edge of where there is an orbit.

    """

    value: float
    stderr: float
    low: float
    high: float
    bounded: bool


def correlation_length(residual: np.ndarray) -> float:
    """Instants that share one independent residual, at least 1.

    The integrated autocorrelation along the cycle, up to where it falls to zero.

    Args:
        residual: on even instants, over its size, shape (m, joints).

    """
    power = np.sum(np.abs(np.fft.rfft(residual, axis=0))**2, axis=1)
    together = np.fft.irfft(power, len(residual))[:len(residual) // 2 + 1]
    if together[0] <= 0.0:
        return 1.0
    together /= together[0]
    end = int(np.argmax(together <= 0.0)) if (together <= 0.0).any() else together.size
    return float(1.0 + 2.0 * together[1:end].sum())


@dataclass(frozen=True)
class Spread:
    """Covariance of the numbers of a fit.

    Attributes:
        covariance: shape (n, n), in the directions that are determined.
        blind: directions that change nothing, one a row, each number in units of what it takes
            to change the cost by itself, shape (directions, n).
        scale: those units, shape (n,).

    """

    covariance: np.ndarray
    blind: np.ndarray
    scale: np.ndarray

    @property
    def errors(self) -> np.ndarray:
        """Standard errors, shape (n,), infinite for what is not determined."""
        errors = np.sqrt(np.diag(self.covariance))
        if len(self.blind):
            errors[np.abs(self.blind).max(axis=0) > SHARE] = np.inf
        return errors

    @property
    def correlation(self) -> np.ndarray:
        """Correlations, shape (n, n); not a number for what is not determined."""
        errors = self.errors
        with np.errstate(invalid='ignore', divide='ignore'):
            found = self.covariance / np.outer(errors, errors)
        found[~np.isfinite(errors)] = found[:, ~np.isfinite(errors)] = np.nan
        np.fill_diagonal(found, 1.0)
        return found


def spread(jacobian: np.ndarray, inflation: float) -> Spread:
    """Return the covariance that a weighted derivative gives.

    Args:
        jacobian: of the residual over its standard errors, shape (residuals, n).
        inflation: factor on all variances.

    """
    size = np.linalg.norm(jacobian, axis=0)
    scale = 1.0 / np.where(size > 0.0, size, 1.0)
    values, rows = np.linalg.svd(jacobian * scale, full_matrices=False)[1:]
    seen = values > ZERO * max(values[0], 1e-300)
    half = rows[seen] / values[seen, None]
    return Spread(inflation * (half.T @ half) * np.outer(scale, scale), rows[~seen], scale)


@dataclass(frozen=True)
class Optimum:
    """A least cost, and what intervals about it are made from.

    Attributes:
        evaluate: the problem.
        values: where the cost is least, shape (n,).
        low, high: bounds.
        cost: half the sum of squares.
        inflation: factor on variances.
        spread: covariance.

    """

    evaluate: Evaluate
    values: np.ndarray
    low: np.ndarray
    high: np.ndarray
    cost: float
    inflation: float
    spread: Spread

    def _rise(self, cost: float) -> float:
        """Distance in standard errors that a cost stands for."""
        return float(np.sqrt(max(0.0, 2.0 * (cost - self.cost) / self.inflation)))

    def estimate(self, k: int, profiles: bool = True) -> Estimate:
        """Estimate number k with its interval, by its profile where the cost is not quadratic."""
        value, error = float(self.values[k]), float(self.spread.errors[k])
        if not np.isfinite(error):
            return Estimate(value, error, float(self.low[k]), float(self.high[k]), False)
        if not profiles:
            ends = [value - QUANTILE * error, value + QUANTILE * error]
            low, high = np.clip(ends, self.low[k], self.high[k]).tolist()
            return Estimate(value, error, low, high, [low, high] == ends)
        low, high = (self._end(k, error, side) for side in (-1.0, 1.0))
        return Estimate(value, error, low[0], high[0], low[1] and high[1])

    def _end(self, k: int, error: float, side: float) -> tuple[float, bool]:
        """One end of the interval, and whether the data set it."""
        limit = float(self.low[k] if side < 0.0 else self.high[k])
        if error > 0.0:
            along = self.spread.covariance[:, k] / self.spread.covariance[k, k]
            there = self.values + side * QUANTILE * error * along
            if (self.low <= there).all() and (there <= self.high).all():
                try:
                    left = self.evaluate(there)[0]
                except NoOrbit:
                    left = None
                if left is not None:
                    share = (self._rise(0.5 * float(left @ left)) / QUANTILE)**2
                    if QUADRATIC[0] <= share <= QUADRATIC[1]:
                        return float(there[k]), True
        return self._profile(k, error, side, limit)

    def _profile(self, k: int, error: float, side: float, limit: float) -> tuple[float, bool]:
        """Follow the least cost for given values of number k to where it has risen enough."""
        best = float(self.values[k])
        others = np.arange(self.values.size) != k
        inside, inside_rise, at = best, 0.0, self.values
        outside, outside_rise = None, np.inf
        place = best + side * QUANTILE * error
        for _ in range(STEPS):
            if side * (place - limit) >= 0.0:
                place = limit
            found = self._least(k, place, at, inside, others)
            if found is None:
                # No orbit: the edge is between.
                outside, outside_rise = place, np.inf
            else:
                rise = self._rise(found[0])
                if abs(rise - QUANTILE) <= CLOSE * QUANTILE:
                    return place, True
                if rise < QUANTILE:
                    inside, inside_rise, at = place, rise, found[1]
                    if place == limit:
                        return limit, False
                else:
                    outside, outside_rise = place, rise
            if outside is None:
                place = best + (place - best) * min(3.0, 1.02 * QUANTILE / max(inside_rise, 0.1))
            elif np.isfinite(outside_rise):
                share = (QUANTILE - inside_rise) / (outside_rise - inside_rise)
                place = inside + float(np.clip(share, 0.1, 0.9)) * (outside - inside)
            else:
                place = 0.5 * (inside + outside)
        if outside is not None and np.isfinite(outside_rise):
            return outside, True
        return inside, False

    def _least(self, k: int, place: float, at: np.ndarray, inside: float, others: np.ndarray
               ) -> tuple[float, np.ndarray] | None:
        """Least cost with number k at a place, and the values there; None without an orbit."""
        begin = at.copy()
        if place != inside and np.isfinite(self.spread.errors).all():
            along = self.spread.covariance[:, k] / self.spread.covariance[k, k]
            begin = np.clip(at + (place - inside) * along, self.low, self.high)
        begin[k] = place

        def filled(values: np.ndarray) -> np.ndarray:
            whole = begin.copy()
            whole[others] = values
            return whole

        def evaluate(values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
            left, slopes = self.evaluate(filled(values))
            return left, slopes[:, others]

        trial = descend(evaluate, begin[others], self.low[others], self.high[others], TOLERANCE,
                        most=15)
        return None if trial.why else (trial.cost, filled(trial.values))


