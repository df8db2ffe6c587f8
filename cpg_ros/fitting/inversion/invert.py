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

"""Parameters of a network, and joints' readouts, from the mean cycle of a recorded gait.

Joints are computed from the gait's exact orbit as the generator computes them. Their readouts are
eliminated, and a trust-region method fits the network's free numbers by exact derivatives. The
orbit's period is not fitted, as the generator's frequency is free.
"""

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace

from cpg_ros.common.errors import InputError
from cpg_ros.dynamics.arclength import NoOrbit
from cpg_ros.fitting.gaits.stride import Stride
from cpg_ros.fitting.inversion.cycle_problem import CycleProblem, Orbits
from cpg_ros.fitting.inversion.fit import (
    correlation_length,
    Estimate,
    estimates,
    Fit,
    mean_share,
    model_error,
    ModelError,
    NULL_THRESHOLD,
    QUANTILE,
    Spread,
    spread,
)
from cpg_ros.fitting.inversion.fit_data import Joints, joints_of, NUM_WEIGHTS
from cpg_ros.fitting.inversion.fit_starts import best_starts, upside_down
from cpg_ros.fitting.inversion.free_parameters import (
    distinct,
    Free,
    free_numbers,
    Minimisation,
)
from cpg_ros.fitting.inversion.leg_duty import (
    GAIT_DUTY,
    GaitReadout,
)
from cpg_ros.motion.plan import validate_orbit
from cpg_ros.motion.readout import MAX_DUTY, MIN_DUTY
from cpg_ros.networks.network import Network
import numpy as np

# The caveats of a fit, in words.

#: MAX_RELATIVE_WIDTH: half width of a 95 % interval over the value, without a warning.
MAX_RELATIVE_WIDTH = 0.1
#: Of warnings. BOUND_TOLERANCE: distance from a bound, over the bounds' distance.
CORRELATION_THRESHOLD, BOUND_TOLERANCE = 0.95, 1e-5


def findings(free: Sequence[Free], estimates: Mapping[str, Estimate], spread: Spread,
             model: ModelError, times: float, best: Minimisation) -> list[str]:
    """List the caveats of a fit.

    Args:
        free: the free numbers.
        estimates: of them.
        spread: their covariance, and that of the phase.
        model: errors of the model.
        times: RMS residual over its standard error.
        best: result of the start that led to the fit.

    """
    lines = []
    if model.size > 0.0:
        bounded = [name for name, estimate in estimates.items() if estimate.bounded]
        unknown = [name for name in estimates if name not in bounded]
        clauses = [f'the intervals of {_join_names(bounded)} allow for this'] if bounded else []
        if unknown:
            clauses.append(f'{_join_names(unknown)}: cannot tell')
        lines.append((
            f'the model does not fit the recording: the residual is {times:.3g} times the noise, '
            f'as with waveforms that are wrong by {100.0 * model.size:.2g} %; '
            if np.isfinite(model.size) else 'feet bore loads, under which the joints deviated '
            'from their commands by an unknown amount; ') + '; '.join(clauses))
    for row in spread.blind:
        blind = [estimate.name for estimate,
                 fraction in zip(free, row, strict=False) if abs(fraction) > NULL_THRESHOLD]
        if len(blind) == 1:
            lines.append(f'{blind[0]} is not determined: it does not affect the recorded motion')
        elif blind:
            moves = row[:len(free)] * spread.scale[:len(free)]
            moves = moves / np.abs(moves).max()
            ways = ', '.join(f'{estimate.name} by {move:+.3g}' for estimate, move
                             in zip(free, moves, strict=True) if estimate.name in blind)
            lines.append(f'{_join_names(blind)} are not determined one by one: changing {ways} '
                         'does not affect the recorded motion')
    for k, (name, estimate) in enumerate(estimates.items()):
        room = BOUND_TOLERANCE * (free[k].high - free[k].low)
        for end, bound in (('lower', free[k].low), ('upper', free[k].high)):
            if abs(estimate.value - bound) <= room:
                lines.append(f'{name} ends at its {end} bound {bound:g}: its interval is '
                             'one-sided')
        if not model.size and np.isfinite(estimate.stderr) and (not estimate.bounded or max(
                estimate.high - estimate.value,
                estimate.value - estimate.low) > MAX_RELATIVE_WIDTH * abs(estimate.value)):
            lines.append(
                f'{name} is poorly identifiable: any value from {estimate.low:.4g} to '
                f'{estimate.high:.4g} fits as well'
                + ('' if estimate.bounded else ', and the range ends there only because '
                             'its bound is reached or the gait ceases to exist')
                + '; with a free readout, it affects only the shape of the waveform')
    errors = spread.correlation
    for k in range(len(free)):
        for other in range(k):
            if abs(errors[k, other]) > CORRELATION_THRESHOLD:
                lines.append(f'{free[other].name} and {free[k].name} are strongly correlated: '
                             f'{errors[k, other]:.3f}')
    if not best.converged:
        lines.append(f'the trust region was stopped after {best.evaluations} evaluations, '
                     'before it had converged')
    return lines


def _join_names(names: Sequence[str]) -> str:
    return ' and '.join(filter(None, [', '.join(names[:-1]), names[-1]]))


#: DEFAULT_DUTY: of legs that stand as long as they swing.
DEFAULT_DUTY = 0.5
#: Relative changes at which a trust region, and the last one, stop.
TOLERANCE, FINAL_TOLERANCE = 1e-5, 1e-8
#: MAX_COST_RATIO: to the least, of a minimum that is compared with the best.
MAX_COST_RATIO = 2.0
#: TRIAL_EVALUATIONS: evaluations after which a start is left whose cost is above ABANDON_RATIO
#: times the least one plus ABANDON_START_RATIO times its own first one.
TRIAL_EVALUATIONS, ABANDON_RATIO, ABANDON_START_RATIO = 5, 10.0, 0.01
#: LAG_TEST_RATIOS: distances over an interval's half width at which lags of joints are tested.
LAG_TEST_RATIOS = (1.4, 2.0, 2.8, 4.0)
#: MAX_REWEIGHTINGS: of the joints; WEIGHT_TOLERANCE: relative change at which they stop.
MAX_REWEIGHTINGS, WEIGHT_TOLERANCE = 4, 0.02
#: COST_TOLERANCE: between the costs of the same motion half a cycle later.
COST_TOLERANCE = 0.02
#: BISECTION_STEPS: to the value at which the generator begins to reject the gait.
BISECTION_STEPS = 6


def invert(cycle: Stride, cells: Mapping[str, int], network: Network, gait: str,
           free: Sequence[str] = (), order: int = 3,
           starts: Sequence[Mapping[str, float]] = (), *, readout: GaitReadout | None = None,
           bounds: Mapping[str, tuple[float, float]] | None = None,
           orbits: Orbits | None = None,
           straight: bool = False, loaded: bool = False,
           done: Callable[[float], None] = lambda fraction: None) -> Fit:
    """Fit free numbers of a network, and readouts, to the mean cycle of a recorded gait.

    Args:
        cycle: the recording's.
        cells: joint -> the cell that drives it, from 1; other joints are left out.
        network: parameters; those that are not free keep their values.
        gait: one of its gaits.
        free: names of parameters to fit, or of groups of them; the usual ones by default.
            GAIT_DUTY is the fraction of the stride that legs stand.
        order: of the readouts, 1 to 3.
        starts: free number -> initial value; {} for the network's own values. By default these,
            and the best of a grid over the ranges.
        readout: the generator's readout of the gait; by default legs stand as the cells do.
        bounds: free number -> lower and upper bound, where narrower than the range.
        orbits: of earlier fits of the same parameters, gait and readout.
        straight: whether the cost is assumed to be quadratic in wide intervals, too.
        loaded: whether the feet bore loads to which joints gave way: the error of the model is
            then unknown, and parameters have no intervals within their bounds.
        done: called with the finished fraction, 0 to 1.

    Raises:
        InputError: names, bounds or starts are invalid.
        ValueError: shapes do not fit.
        NoOrbit: no start has such a gait; the message is that of the first.

    """
    numbers = _numbers(network, gait, free or network.free, bounds)
    problem = _problem(cycle, joints_of(cycle, cells, network), network, gait, numbers, order,
                       readout or GaitReadout.of(type(network), gait), orbits)
    problem.loaded = loaded
    trials = _trials(problem, starts, done)
    best = min(trials, key=lambda trial: trial.cost)
    values = _reweight(problem, best.values)
    problem.hold(values)
    values, others, turned = _select_minimum(problem, values, trials)
    runs, reason = _stable_values(problem, [values, *others], best.path[:, 1:])
    warnings = [] if problem.readout.weights else [
        'without a robot file, the recording does not tell stance from swing: ' + ', '.join(
            f'{free.name} {value:.4g}' for free,
            value in zip(problem.free, candidate, strict=False))
        + ' fits as well, all joints reversed' for candidate in turned]
    if reason:
        warnings += [f'the generator would refuse the {gait} that fits best: {reason}' + (
            '' if runs is None else '; using the best fit that the generator can run')]
    done(0.6)
    fit = _fit_at(problem, trials, others, values if runs is None else runs,
                  straight or bool(reason), warnings)
    done(1.0)
    return fit


def _problem(cycle: Stride, joints: Joints, network: Network, gait: str,
             numbers: tuple[Free, ...], order: int, readout: GaitReadout,
             orbits: Orbits | None) -> CycleProblem:
    """Check the arguments, which are those of ``invert``, and return the problem."""
    if order not in NUM_WEIGHTS:
        raise ValueError(f'order {order} is not 1, 2 or 3')
    count = len(joints.names) * (1 + NUM_WEIGHTS[order]) + len(numbers) + 1
    if joints.theta.size < 2 * (1 + NUM_WEIGHTS[order]) or joints.data.size <= count:
        raise InputError(f'{joints.theta.size} instants of {len(joints.names)} joints do not '
                         f'determine readouts of order {order} and {len(numbers)} parameters')
    return CycleProblem(joints, joints.errors, network, gait, numbers, order, readout, orbits)


def _trials(problem: CycleProblem, starts: Sequence[Mapping[str, float]],
            done: Callable[[float], None]) -> list[Minimisation]:
    """Minimise from all starts; raise NoOrbit if none has an orbit."""
    begins = [np.append(_begin(problem, start), 0.0) for start in starts or ({},)]
    if not starts:
        begins = best_starts(problem, begins[0])
    trials: list[Minimisation] = []
    for begin in begins:
        done(0.5 * len(trials) / len(begins))
        trials.append(_trial(problem, begin, weigh=all(other.reason for other in trials)))
    best = min(trials, key=lambda trial: trial.cost)
    if best.reason:
        raise NoOrbit(trials[0].reason)
    with suppress(NoOrbit):
        if not starts and (other := upside_down(problem, best.values)) is not None:
            trials.append(_trial(problem, other, weigh=False))
    done(0.5)
    return [_continue_trial(problem, trial, best.cost) for trial in trials]


def _numbers(network: Network, gait: str, names: Sequence[str],
             bounds: Mapping[str, tuple[float, float]] | None) -> tuple[Free, ...]:
    """Return the free numbers, the gait's duty last."""
    numbers = [name for name in names if name != GAIT_DUTY]
    duty = (Free(GAIT_DUTY, (), MIN_DUTY, MAX_DUTY),) if GAIT_DUTY in names else ()
    return (free_numbers(network, gait, numbers, bounds) if numbers or not duty else ()) + duty


def _begin(problem: CycleProblem, start: Mapping[str, float]) -> np.ndarray:
    """Return values of a start, checked."""
    duty = problem.readout.duty or DEFAULT_DUTY
    values = {parameter.name: parameter.value(problem.network) if parameter.members else duty
             for parameter in problem.free}
    for name, value in start.items():
        if name not in values:
            raise InputError(f"start: '{name}' is not free")
        values[name] = float(value)
    for parameter in problem.free:
        if not parameter.low <= values[parameter.name] <= parameter.high:
            raise InputError(f'{parameter.name} {values[parameter.name]:g} to start from is not '
                             f'{parameter.low:g} to {parameter.high:g}')
    return np.array(list(values.values()))


def _trial(problem: CycleProblem, values: np.ndarray, weigh: bool) -> Minimisation:
    """Minimise from one start; the first start with an orbit sets the joints' weights."""
    values = values.copy()
    try:
        problem.begin(values)
        values[-1] = problem.first_phase(values)
    except NoOrbit as error:
        return Minimisation.without_orbit(values, error)
    if weigh:
        problem.sizes = np.maximum(problem.joints.errors, problem.residual_rms(values))
    trial = problem.coordinates.descend(problem, values, TOLERANCE, TRIAL_EVALUATIONS)
    problem.hold(trial.values)
    return trial


def _continue_trial(problem: CycleProblem, trial: Minimisation, min_cost: float) -> Minimisation:
    """Continue a trial until it converges, unless its cost is far above the least."""
    if trial.converged or trial.reason or (
            trial.cost > ABANDON_RATIO * min_cost + ABANDON_START_RATIO * trial.path[0, 0]):
        return trial
    rest = problem.coordinates.descend(problem, trial.values, TOLERANCE)
    problem.hold(rest.values)
    return replace(rest, start=trial.start, path=np.vstack([trial.path, rest.path[1:]]),
                   evaluations=trial.evaluations + rest.evaluations)


def _reweight(problem: CycleProblem, values: np.ndarray) -> np.ndarray:
    """Weight the joints by their residuals and fit again, until the weights settle."""
    for last in range(MAX_REWEIGHTINGS):
        sizes = np.maximum(problem.joints.errors, problem.residual_rms(values))
        if last and np.abs(sizes / problem.sizes - 1.0).max() < WEIGHT_TOLERANCE:
            break
        problem.sizes = sizes
        begin = problem.rephased(values)
        values = problem.coordinates.descend(problem, begin, FINAL_TOLERANCE).values
    return values


def _margin(problem: CycleProblem, values: np.ndarray) -> float:
    """Return the difference of costs up to which another minimum is as good as values."""
    residual = problem.best_readouts(values).residual / problem.sizes
    return 0.5 * QUANTILE**2 * correlation_length(residual)


def _select_minimum(problem: CycleProblem, values: np.ndarray, trials: Sequence[Minimisation]
               ) -> tuple[np.ndarray, list[np.ndarray], list[np.ndarray]]:
    """Return the values of the preferred minimum, other minima, and inverted ones.

    With a free readout, other parameters may give the same waveform upside down. Of minima that
    are as good as the best, the one whose joints move as in the robot file is preferred; without
    one, that with the largest duty.
    """
    def readouts(point: np.ndarray) -> np.ndarray:
        return problem.best_readouts(point).weights[1:3]

    def agreement(point: np.ndarray) -> float:
        agrees = problem.readout.agreement(problem.joints.names, readouts(point))
        return agrees or problem.stance_fraction(point)

    candidates, min_cost = [values], problem.cost(values)
    for trial in trials:
        if not trial.reason and all(distinct(trial.values[:-1], candidate[:-1])
                                    for candidate in candidates):
            point = trial.values
            if problem.cost(point) <= MAX_COST_RATIO * min_cost:
                # Joints were weighted otherwise where it was found.
                point = problem.coordinates.descend(problem, point, TOLERANCE).values
                problem.hold(point)
            candidates.append(point)
    limit = min(problem.cost(candidate) for candidate in candidates) + _margin(problem, values)

    def reverse(candidate: np.ndarray) -> bool:
        return float(np.sum(readouts(candidate) * readouts(values))) < 0.0

    # Half a cycle later cells of some gaits are the same upside down: that is no other motion.
    for k, candidate in enumerate(candidates):
        later = candidate + np.append(np.zeros(candidate.size - 1), 0.5)
        if reverse(candidate) and problem.cost(later) <= problem.cost(candidate) + COST_TOLERANCE:
            candidates[k] = later
    best = max((candidate for candidate in candidates if problem.cost(candidate) <= limit),
               key=agreement)
    inverse = [candidate for candidate in candidates if reverse(candidate)]
    if best is not values and (any(candidate is best for candidate in inverse)
                               or problem.cost(values) > limit):
        inverse, values = [values], _reweight(problem, best)
        problem.hold(values)
    others = [candidate for candidate in candidates if distinct(candidate[:-1], values[:-1])
              and not reverse(candidate)]
    return values, others, [candidate for candidate in inverse if problem.cost(candidate) <= limit]


def _stable_values(problem: CycleProblem, by_cost: Sequence[np.ndarray], way: np.ndarray
               ) -> tuple[np.ndarray | None, str]:
    """Return the best values that the generator runs, and why it rejects the best ones, or ''.

    Stability takes longer to assess than an orbit to solve for: it is assessed where the fit has
    ended, and if that is rejected, at as many places on the way there as a bisection takes.

    Args:
        problem: the fit.
        by_cost: values of its minima, the best first.
        way: values from the start to the best minimum, shape (steps, values).

    """
    def reason_at(values: np.ndarray) -> str:
        try:
            return validate_orbit(problem.best_readouts(values).orbit, problem.gait,
                           problem.readout.harmonics)
        except NoOrbit as error:
            return str(error)

    first = reason_at(by_cost[0])
    if not first:
        return by_cost[0], ''
    for values in by_cost[1:]:
        if not reason_at(values):
            return values, first
    trail = [*way, by_cost[0]]
    runs, rejected = 0, len(trail) - 1
    if reason_at(trail[0]):
        return None, first
    while rejected - runs > 1:
        middle = (runs + rejected) // 2
        runs, rejected = (runs, middle) if reason_at(trail[middle]) else (middle, rejected)
    inside, outside = trail[runs], trail[rejected]
    for _ in range(BISECTION_STEPS):
        between = 0.5 * (inside + outside)
        inside, outside = (inside, between) if reason_at(between) else (between, outside)
    inside = problem.rephased(inside)
    problem.hold(inside)
    return inside, first


def _estimates(problem: CycleProblem, values: np.ndarray, straight: bool
               ) -> tuple[dict[str, Estimate], Spread, ModelError]:
    """Return the estimates at values, their covariance, and the errors of the model."""
    residual, slopes = problem(values)
    uncertainty = spread(slopes, correlation_length(
        problem.best_readouts(values).residual / problem.sizes))
    model = ModelError.unknown(values.size) if problem.loaded else model_error(
        residual, slopes, problem.weighted(problem.by_waveform(values)), problem.noise)
    return estimates(problem, values, uncertainty, model, straight), uncertainty, model


def _lag_warnings(problem: CycleProblem, values: np.ndarray, estimated: Mapping[str, Estimate],
                   uncertainty: Spread) -> list[str]:
    """Warn of values beyond the intervals that fit as well if joints lag their cells.

    The generator's joints do not. In other recordings, a free readout nearly hides such lags.
    """
    if not problem.kinds.any():
        return []
    residual = problem(values)[0]
    data = problem.joints.data / problem.sizes
    threshold = float(np.sum(data * data) - residual @ residual) - 2.0 * _margin(problem, values)

    def fits(point: np.ndarray) -> bool:
        by_joint = problem.explained_by(point)
        return sum(by_joint[problem.kinds == kind].sum(axis=0).max()
                   for kind in range(problem.kinds.max() + 1)) >= threshold

    lines = []
    for k, (name, one) in enumerate(estimated.items()):
        ends = [one.low, one.high]
        for side, half in ((0, one.low - one.value), (1, one.high - one.value)):
            beyond = False
            with suppress(NoOrbit):
                for times in LAG_TEST_RATIOS if one.bounded else ():
                    point = problem.coordinates.move(
                        values, times * half * uncertainty.covariance[:, k]
                        / uncertainty.covariance[k, k])
                    fits_well = fits(point)
                    # The end lies before the first value that fits worse.
                    if fits_well or beyond:
                        ends[side] = float(point[k])
                    if not fits_well:
                        break
                    beyond = True
        if ends != [one.low, one.high]:
            lines.append(f'{name} may be from {ends[0]:.4g} to {ends[1]:.4g} if the joints of a '
                         'leg lag each other; its interval assumes that joints move with their '
                         'cells, as those of the generator do')
    return lines


def _fit_at(problem: CycleProblem, trials: Sequence[Minimisation], others: Sequence[np.ndarray],
            values: np.ndarray, straight: bool, warnings: Sequence[str]) -> Fit:
    """Return the fit at values, with its intervals and warnings."""
    joints, best = problem.joints, min(trials, key=lambda trial: trial.cost)
    readout_fit = problem.best_readouts(values)
    estimate, spread, model = _estimates(problem, values, straight)
    for other in others:
        if problem.cost(other) < problem.cost(values) + _margin(problem, values):
            # Another minimum explains the recording as well: the intervals hold both.
            estimate = {name: parameter.union(_estimates(problem, other, straight)[0][name])
                        for name, parameter in estimate.items()}
    if not (straight or model.size):
        warnings = [*warnings, *_lag_warnings(problem, values, estimate, spread)]
    fractions = {}
    for order in NUM_WEIGHTS:
        refit = problem.at_order(order)
        rest = refit.best_readouts(refit.rephased(values) if order != problem.order else values)
        fractions[order] = mean_share(joints.data.T, rest.residual.T)
    rows = [(float(row[0]), tuple(row[1:].tolist())) for row in readout_fit.weights.T]
    misfit = problem.residual_rms(values) / joints.errors
    count = len(problem.free)
    return Fit(
        network=readout_fit.orbit.network, gait=problem.gait, orbit=readout_fit.orbit,
        order=problem.order, fractions=fractions, harmonics=problem.readout.harmonics,
        duty=problem.duty(values), stance=problem.readout.stance, parameters=estimate,
        correlation=spread.correlation[:count, :count],
        cells=dict(zip(joints.names, (joints.cells + 1).tolist(), strict=True)),
        readouts=dict(zip(joints.names, rows, strict=True)), theta=joints.theta,
        recorded=joints.data.T, errors=readout_fit.residual.T, phase=float(values[-1]) % 1.0,
        cost=problem.cost(values),
        sizes=dict(zip(joints.names, problem.sizes.tolist(), strict=True)),
        misfit=dict(zip(joints.names, misfit.tolist(), strict=True)), sharing=spread.inflation,
        model_error=model.size, starts=tuple(trials),
        warnings=(*findings(problem.free, estimate, spread, model,
                            float(np.sqrt(np.mean(misfit**2))), best), *warnings))
