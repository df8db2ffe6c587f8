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

Joints are read off the gait's exact orbit as the generator reads them; their readouts are
eliminated, and a trust region moves the network's free numbers by exact derivatives. How fast the
recording walks is no part of that, since the generator's frequency is free: the orbit's period
counts only where a time scale is given.
"""

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress

from cpg_ros.dynamics.periodic import NoOrbit
from cpg_ros.errors import InputError
from cpg_ros.inversion.caveats import findings
from cpg_ros.inversion.fit_data import joints_of, MeanCycle
from cpg_ros.inversion.free_parameters import Free, free_numbers
from cpg_ros.inversion.gait_fit import Fit
from cpg_ros.inversion.identifiability import correlation_length, Optimum, spread
from cpg_ros.inversion.least_squares import CycleProblem, Period
from cpg_ros.inversion.trust_region import Minimisation
from cpg_ros.inversion.variable_projection import WEIGHTS
from cpg_ros.motion.plan import refusal
from cpg_ros.networks.network import Network
from cpg_ros.robots.robot import HARMONICS
import numpy as np

#: A frequency is never known better than to this share.
KNOWN_FREQUENCY = 1e-4
#: Relative change at which a trust region stops, and at which the last one does.
TOLERANCE, LAST = 1e-6, 1e-8
#: Times that joints are weighted anew, and the relative change of a weight that is none.
WEIGHINGS, SAME = 4, 0.02
#: Halvings that find where the generator begins to reject the gait.
HALVINGS = 6


def invert(cycle: MeanCycle, cells: Mapping[str, int], network: Network, gait: str,
           free: Sequence[str] = (), order: int = 3,
           starts: Sequence[Mapping[str, float]] = ({},), *,
           bounds: Mapping[str, tuple[float, float]] | None = None, harmonics: int = HARMONICS,
           time_scale: float = 0.0, profiles: bool = True,
           done: Callable[[float], None] = lambda share: None) -> Fit:
    """Fit free numbers of a network, and readouts, to the mean cycle of a recorded gait.

    Args:
        cycle: the recording's.
        cells: joint -> the cell that drives it, from 1; other joints are left out.
        network: parameters; those that are not free keep their values.
        gait: one of its gaits.
        free: names of parameters to fit, or of groups of them; the usual ones by default.
        order: of the readouts, 1 to 3.
        starts: free number -> value to start from; {} starts from the network's own values.
        bounds: free number -> lower and upper bound, where narrower than the range.
        harmonics: of a Morris-Lecar cell's waveform that joints follow.
        time_scale: seconds in a unit of model time, to fit the period, too; 0 leaves it free,
            as the generator's frequency does.
        profiles: whether intervals are those of the profile likelihood where the cost is not
            quadratic; they take most of the time.
        done: called with the share of the work that is done, 0 to 1.

    Raises:
        InputError: names, bounds or starts cannot be used.
        ValueError: shapes do not fit, or there is no start.
        NoOrbit: no start has such a gait; the message is that of the first.

    """
    if order not in WEIGHTS:
        raise ValueError(f'order {order} is not 1, 2 or 3')
    if not starts:
        raise ValueError('there is no start')
    joints = joints_of(cycle, cells, network)
    numbers = free_numbers(network, gait, free or network.free, bounds)
    taken = len(joints.names) * (1 + WEIGHTS[order]) + len(numbers) + 1
    if joints.theta.size < 2 * (1 + WEIGHTS[order]) or joints.data.size <= taken:
        raise InputError(f'{joints.theta.size} instants of {len(joints.names)} joints do not '
                         f'determine readouts of order {order} and {len(numbers)} parameters')
    period = None
    if time_scale > 0.0:
        value = 1.0 / (cycle.frequency * time_scale)
        share = max(cycle.frequency_error / cycle.frequency, KNOWN_FREQUENCY)
        period = Period(value, value * share)
    begins = [_begin(network, numbers, start) for start in starts]

    problem = CycleProblem(joints, joints.stated, network, gait, numbers, order, harmonics, period)
    trials: list[Minimisation] = []
    for begin in begins:
        done(0.5 * len(trials) / len(begins))
        trials.append(_trial(problem, begin, weigh=all(other.why for other in trials)))
    done(0.5)
    best = min(trials, key=lambda trial: trial.cost)
    if best.why:
        raise NoOrbit(trials[0].why)
    values = _weighed(problem, best.values)
    problem.hold(values)
    others = [trial.values for trial in (_along_the_valley(problem, values) if profiles else [])]
    by_cost = sorted([values, *others], key=problem.cost)
    if by_cost[0] is not values:
        by_cost[0] = _weighed(problem, by_cost[0])
        problem.hold(by_cost[0])
    runs, flaw = _that_runs(problem, by_cost, best.path[:, 1:])
    warnings = []
    if flaw:
        warnings = [f'the generator would refuse the {gait} that fits best: {flaw}' + (
            '' if runs is None else '; this is the best one on the way there that it runs')]
    # The cost is not least there, so that there is no profile to follow.
    return _judged(problem, trials, others, by_cost[0] if runs is None else runs,
                   profiles and not flaw, warnings, done)


def _begin(network: Network, numbers: Sequence[Free], start: Mapping[str, float]) -> np.ndarray:
    """Values of a start, checked."""
    known = {one.name: one.value(network) for one in numbers}
    for name, value in start.items():
        if name not in known:
            raise InputError(f"start: '{name}' is not free")
        known[name] = float(value)
    for one in numbers:
        if not one.low <= known[one.name] <= one.high:
            raise InputError(f'{one.name} {known[one.name]:g} to start from is not within '
                             f'{one.low:g} to {one.high:g}')
    return np.array(list(known.values()))


def _left(problem: CycleProblem, values: np.ndarray) -> np.ndarray:
    """Size of what the readout of each joint leaves, rad, its freedom allowed for."""
    residual = problem.best_readouts(values).residual
    return np.sqrt(np.sum(residual**2, axis=0) / (len(residual) - problem.weights))


def _trial(problem: CycleProblem, begin: np.ndarray, weigh: bool) -> Minimisation:
    """Go down from one start; the first one that has an orbit sets the joints' weights."""
    values = np.append(begin, 0.0)
    try:
        problem.begin(values)
        values[-1] = problem.first_phase(values)
    except NoOrbit as error:
        return Minimisation.without_orbit(values, error)
    if weigh:
        problem.sizes = np.maximum(problem.joints.stated, _left(problem, values))
    return problem.coordinates.descend(problem, values, TOLERANCE)


def _weighed(problem: CycleProblem, values: np.ndarray) -> np.ndarray:
    """Weigh the joints by what is left of each, and fit again."""
    for last in range(WEIGHINGS):
        sizes = np.maximum(problem.joints.stated, _left(problem, values))
        if last and np.abs(sizes / problem.sizes - 1.0).max() < SAME:
            break
        problem.sizes = sizes
        values = problem.coordinates.descend(problem, problem.rephased(values), LAST).values
    return values


def _that_runs(problem: CycleProblem, by_cost: Sequence[np.ndarray], way: np.ndarray
               ) -> tuple[np.ndarray | None, str]:
    """Return the best values that the generator runs, and why it rejects the very best, or ''.

    Stability takes longer to assess than an orbit to solve for: it is assessed where the fit has
    ended, and if that is rejected, at as many places on the way there as a bisection takes.

    Args:
        problem: the fit.
        by_cost: where it has ended, the best first.
        way: the values from the start on, shape (steps, values).

    """
    def flaw_at(values: np.ndarray) -> str:
        try:
            return refusal(problem.best_readouts(values).orbit, problem.gait, problem.harmonics)
        except NoOrbit as error:
            return str(error)

    first = flaw_at(by_cost[0])
    if not first:
        return by_cost[0], ''
    for values in by_cost[1:]:
        if not flaw_at(values):
            return values, first
    places = [*way, by_cost[0]]
    runs, refused = 0, len(places) - 1
    if flaw_at(places[0]):
        return None, first
    while refused - runs > 1:
        middle = (runs + refused) // 2
        runs, refused = (runs, middle) if flaw_at(places[middle]) else (middle, refused)
    here, beyond = places[runs], places[refused]
    for _ in range(HALVINGS):
        between = 0.5 * (here + beyond)
        here, beyond = (here, between) if flaw_at(between) else (between, beyond)
    here = problem.rephased(here)
    problem.hold(here)
    return here, first


def _optimum(problem: CycleProblem, values: np.ndarray, elsewhere: Sequence[np.ndarray] = ()
             ) -> Optimum:
    left, slopes = problem(values)
    sharing = correlation_length(problem.best_readouts(values).residual / problem.sizes)
    return Optimum(problem, values, problem.free, 0.5 * float(left @ left), sharing,
                   spread(slopes, sharing), problem.coordinates.descend,
                   problem.coordinates.moved, problem.rephased, elsewhere)


def _along_the_valley(problem: CycleProblem, values: np.ndarray) -> list[Minimisation]:
    """Look for other least costs, if that at the values is not the whole story."""
    optimum = _optimum(problem, values)
    if all(optimum.regular(k) for k in range(len(problem.free))):
        return []
    found = []
    for begin in problem.coordinates.valley(values):
        with suppress(NoOrbit):
            problem.begin(begin)
            found.append(problem.coordinates.descend(problem, problem.rephased(begin), TOLERANCE))
            problem.hold(found[-1].values)
    return found


def _judged(problem: CycleProblem, trials: Sequence[Minimisation], elsewhere: Sequence[np.ndarray],
            values: np.ndarray, profiles: bool, warnings: Sequence[str],
            done: Callable[[float], None]) -> Fit:
    """Return the fit at values, with its uncertainties."""
    joints, best = problem.joints, min(trials, key=lambda trial: trial.cost)
    placed = problem.best_readouts(values)
    optimum = _optimum(problem, values, elsewhere)
    known = optimum.spread
    estimates = {}
    for k, one in enumerate(problem.free):
        done(0.6 + 0.4 * k / len(problem.free))
        estimates[one.name] = optimum.estimate(k, profiles)
    done(1.0)
    rows = [(float(row[0]), tuple(row[1:].tolist())) for row in placed.weights.T]
    misfit = _left(problem, values) / joints.stated
    count = len(problem.free)
    return Fit(
        network=placed.orbit.network, gait=problem.gait, orbit=placed.orbit,
        order=problem.order, harmonics=problem.harmonics, parameters=estimates,
        correlation=known.correlation[:count, :count],
        cells=dict(zip(joints.names, (joints.cells + 1).tolist(), strict=True)),
        readouts=dict(zip(joints.names, rows, strict=True)), theta=joints.theta,
        recorded=joints.data.T, errors=placed.residual.T, phase=float(values[-1]) % 1.0,
        cost=optimum.cost, sizes=dict(zip(joints.names, problem.sizes.tolist(), strict=True)),
        misfit=dict(zip(joints.names, misfit.tolist(), strict=True)), sharing=optimum.inflation,
        starts=tuple(trials),
        warnings=(*findings(problem.free, estimates, known, best), *warnings))
