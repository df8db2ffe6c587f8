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

"""NSGA-II on islands, which exchange their best sets, and the verification of the result.

A set is verified by its exact orbit, its multipliers, and runs with noise. Each island runs its
own NSGA-II with random numbers derived from the seed, its number and the epoch. The result depends
on the number of islands, but not on the number of workers.
"""

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace

from cpg_ros.analysis.objectives import (
    evaluate,
    MAX_EXACT,
    objective_names,
    pairs,
    phase_errors,
    Score,
    search_space,
    Space,
    waveform_shortfall,
)
from cpg_ros.common.command_line import progress_bar
from cpg_ros.common.errors import CpgError, InputError, MissingLibraryError, ShortRepr
from cpg_ros.dynamics.arclength import NoOrbit
from cpg_ros.dynamics.floquet import multipliers
from cpg_ros.dynamics.integration.simulate import simulate, Trajectory
from cpg_ros.dynamics.orbit import Orbit
from cpg_ros.dynamics.settling import last_cycle, MIN_RANGE, SAMPLE_PERIOD, STEP_RATIO
from cpg_ros.dynamics.solve_orbit import solve_preset
from cpg_ros.fitting.gaits.recognition import shape_difference
from cpg_ros.networks.network import Network, Preset
from cpg_ros.networks.symmetry import Symmetry
import numpy as np

#: Intensity of noise that a gait survives, per square root of model time; duration of the runs,
#: model time; their number, which fits into the vector registers.
NOISE, DURATION, NUM_RUNS = 0.01, 500.0, 8
#: Without noise after that; phase error then, degrees.
CALM_PERIODS, MAX_FINAL_ERROR = 30, 1.0
#: Phase error, degrees, averaged over some cycles under noise, at which a gait is left.
MAX_PHASE_ERROR, AVERAGING_CYCLES = 60.0, 4
#: POINTS: points of a cycle; DIGITS: digits of the start and period of a preset.
POINTS, DIGITS = 1024, 10


class NotVerified(CpgError):
    """A parameter set fails the verification; the message says why."""


@dataclass(frozen=True, eq=False, repr=False)
class VerifiedGait(ShortRepr):
    """A parameter set with its exact orbit.

    Attributes:
        preset: gait, parameters, a state on the orbit and its period, rounded.
        orbit: solved for from that preset.
        errors: phase errors at the end of the search's simulation, degrees.
        leading: leading Floquet multiplier.
        differences: of its two waveforms, strict and plain (see shape_difference); 0 for one
            waveform.

    """

    preset: Preset
    orbit: Orbit
    errors: np.ndarray
    leading: float
    differences: tuple[float, float]


def exact_preset(preset: Preset) -> tuple[Preset, Orbit]:
    """Move a preset's start onto its exact orbit, to the peak of cell 1.

    Returns:
        The preset with rounded start and period, and the orbit that follows from them.

    Raises:
        NoOrbit: it has no such orbit.

    """
    orbit = solve_preset(preset)
    start = orbit(np.array(0.0)).round(DIGITS)
    rounded = Preset(preset.gait, preset.network, tuple(start.tolist()),
                     round(orbit.period, DIGITS))
    return rounded, solve_preset(rounded)


def survives(orbit: Orbit, seed: int = 0) -> bool:
    """Return whether a gait survives noise without a lock, started from its orbit."""
    network, symmetry = orbit.network, orbit.symmetry
    starts = np.repeat(orbit(np.zeros(1)), NUM_RUNS, axis=0)
    step = STEP_RATIO * network.step
    every = max(1, round(SAMPLE_PERIOD / step))
    noisy = simulate(network, starts, DURATION, step, noise=NOISE, seed=seed, every=every,
                     progress=False, quiet=True)
    window = round(AVERAGING_CYCLES * orbit.period / (step * every))
    windows = noisy.x[:, :(noisy.t.size - 1) // window * window].reshape(
        NUM_RUNS, -1, window, network.components)
    if not all(_holds(window_states, symmetry) for run in windows for window_states in run):
        return False
    calm = simulate(network, noisy.x[:, -1], CALM_PERIODS * orbit.period, step, every=every,
                    progress=False)
    for x, slopes in zip(calm.x, calm.slopes, strict=True):
        cycle = last_cycle(Trajectory(calm.t, x, slopes), network.cells)
        if (cycle is None or abs(cycle.period / orbit.period - 1.0) > 0.01
                or phase_errors(cycle.signals, symmetry).max() > MAX_FINAL_ERROR
                or waveform_shortfall(cycle.signals, symmetry) > 0.0):
            return False
    return True


def _holds(signals: np.ndarray, symmetry: Symmetry) -> bool:
    """Return whether the cells are alive and in phase on the mean of a few noisy cycles."""
    alive = np.ptp(signals[:, :symmetry.group.cells], axis=0).min() >= MIN_RANGE
    return bool(alive and phase_errors(_folded(signals), symmetry).max() <= MAX_PHASE_ERROR)


def _folded(signals: np.ndarray) -> np.ndarray:
    """Return the mean over the cycles of a window, shape (points, components)."""
    points = signals.shape[0] // AVERAGING_CYCLES
    return signals[:points * AVERAGING_CYCLES].reshape(AVERAGING_CYCLES, points, -1).mean(axis=0)


def polish(score: Score, gait: str, seed: int = 0) -> VerifiedGait:
    """Solve for the orbit of a set and verify it.

    Args:
        score: of the set.
        gait: that it must have.
        seed: of the noise.

    Raises:
        NotVerified: it has no stable orbit of the gait, its waveforms miss their requirements, or
            it does not survive noise.

    """
    if not score.exact:
        raise NotVerified('its orbit was not found')
    try:
        preset, orbit = exact_preset(Preset(gait, score.network, score.state, score.period))
    except NoOrbit as error:
        raise NotVerified(str(error)) from error
    spectrum = multipliers(orbit)
    leading = spectrum.leading
    if not spectrum.attracts:
        raise NotVerified(f'its orbit is not stable, with a leading multiplier of {leading:.3f}')
    signals = orbit.cycle(POINTS)
    if waveform_shortfall(signals, orbit.symmetry) > 0.0:
        raise NotVerified('a waveform is too small, turns too unsteadily or is too like the other')
    first, differences = orbit.symmetry.first, (0.0, 0.0)
    if len(first) == 2:
        a, b = (signals[:, cell] for cell in first)
        differences = shape_difference(a, b), shape_difference(a, b, plain=True)
    if not survives(orbit, seed):
        raise NotVerified(f'noise of {NOISE} drives it off its gait')
    return VerifiedGait(preset, orbit, score.errors, leading, differences)


#: Between two migrations; fraction of a population that migrates.
EPOCH_GENERATIONS, MIGRATION_RATE = 3, 0.1


# The search of Rashidi et al. 2016, section 4.

#: Of two-point crossover and of the mutation of a bit, as printed; NUM_BITS: of a variable, ours:
#: three decimals of a weight, as their Table 2 has them.
CROSSOVER_RATE, MUTATION_RATE, NUM_BITS = 0.08, 0.03, 11


@dataclass(frozen=True)
class SearchSetup:
    """Arguments of search_space for all islands, and whether as in the paper; can be pickled."""

    network: str
    gait: str
    bounds: Mapping[str, tuple[float, float]]
    fixed: Mapping[str, float]
    paper: bool = False

    @property
    def space(self) -> Space:
        """Parameter sets among which the gait is searched for."""
        return search_space(self.network, self.gait, self.bounds, self.fixed)

    def build(self, values: np.ndarray) -> Network:
        """Return a network of the search: from its variables, or from their bits."""
        if self.paper:
            low, high = np.array([(variable.low, variable.high) for variable in self.space.free]).T
            whole = values.reshape(-1, NUM_BITS) @ (1 << np.arange(NUM_BITS)[::-1])
            values = low + (high - low) * whole / (2**NUM_BITS - 1)
        return self.space.build(values)


@dataclass(frozen=True, eq=False, repr=False)
class Epoch(ShortRepr):
    """An island for some generations.

    Attributes:
        setup: of the search.
        population: number of sets in a generation.
        generations: their number.
        random: seed of the island's random numbers.
        seed: of the simulations' initial states, the same for all.
        start: first generation, shape (population, free variables); None for a random one.
        assessed: known scores of sets.

    """

    setup: SearchSetup
    population: int
    generations: int
    random: int
    seed: int
    start: np.ndarray | None = None
    assessed: tuple[Score, ...] = ()


@dataclass(frozen=True, eq=False, repr=False)
class EpochResult(ShortRepr):
    """An island after an epoch: its last generation, best first, and all sets it has judged."""

    values: np.ndarray
    scores: tuple[Score, ...]
    tried: tuple[Score, ...]


def evolve(epoch: Epoch, progress: Callable[[int], None] = lambda generation: None) -> EpochResult:
    """Run NSGA-II on an island for an epoch.

    Raises:
        MissingLibraryError: pymoo is missing.

    """
    try:
        from pymoo.algorithms.moo.nsga2 import NSGA2
        from pymoo.core.evaluator import Evaluator
        from pymoo.core.problem import Problem
        from pymoo.operators.crossover.pntx import TwoPointCrossover
        from pymoo.operators.mutation.bitflip import BitflipMutation
        from pymoo.operators.sampling.rnd import BinaryRandomSampling
        from pymoo.problems.static import StaticProblem
    except ImportError as error:
        raise MissingLibraryError('optimize needs pymoo: pip install pymoo') from error
    setup, options = epoch.setup, {}
    space, paper = setup.space, setup.paper
    if paper:
        # Their objectives are the phase errors alone.
        problem = Problem(n_var=NUM_BITS * len(space.free), n_obj=len(pairs(space.symmetry)), xl=0,
                          xu=1, vtype=bool)
        options = {'sampling': BinaryRandomSampling(),
                   'crossover': TwoPointCrossover(prob=CROSSOVER_RATE),
                   'mutation': BitflipMutation(prob=1.0, prob_var=MUTATION_RATE)}
    else:
        problem = Problem(n_var=len(space.free), n_obj=len(objective_names(space.symmetry)),
                          n_ieq_constr=1,
                          xl=np.array([variable.low for variable in space.free]),
                          xu=np.array([variable.high for variable in space.free]))
    if epoch.start is not None:
        options['sampling'] = epoch.start
    algorithm = NSGA2(pop_size=epoch.population, **options)
    algorithm.setup(problem, termination=('n_gen', epoch.generations), seed=epoch.random)
    score_of: dict[Network, Score] = {score.network: score for score in epoch.assessed}
    for generation in range(epoch.generations):
        population = algorithm.ask()
        networks = [setup.build(values) for values in population.get('X')]
        new = list(dict.fromkeys(network for network in networks if network not in score_of))
        if new:
            scores = evaluate(new, space.gait, epoch.seed, 0 if paper else MAX_EXACT)
            score_of.update(zip(new, scores, strict=True))
        scores = [score_of[network] for network in networks]
        # Sets whose waveforms miss their requirements come after all others.
        static = StaticProblem(problem, F=np.array(
            [score.objectives[:problem.n_obj] for score in scores]), **(
                {} if paper else {'G': np.array([[score.shortfall] for score in scores])}))
        Evaluator().eval(static, population)
        algorithm.tell(infills=population)
        progress(generation + 1)
    values = algorithm.pop.get('X')
    last = [score_of[setup.build(row)] for row in values]
    best = sorted(range(len(last)), key=lambda k: (
        last[k].shortfall, float(last[k].errors.max()), last[k].stability, tuple(values[k])))
    return EpochResult(values[best], tuple(last[k] for k in best), tuple(score_of.values()))


def _random(seed: int, island: int, epoch: int) -> int:
    return int(np.random.SeedSequence([seed, island, epoch]).generate_state(1)[0])


def archipelago(setup: SearchSetup, population: int, generations: int, seed: int, islands: int,
                executor: Executor | None,
                progress: Callable[[int], None] = lambda generation: None
                ) -> tuple[Score, ...]:
    """Return all sets that some islands have judged, in a reproducible order.

    Args:
        setup: of the search.
        population: number of sets in a generation of each.
        generations: of each.
        seed: of all random numbers.
        islands: number of islands in a ring; each sends its best to the next one.
        executor: any; None for this process.
        progress: takes the number of finished generations.

    """
    score_of: dict[Network, Score] = {}
    starts: list[np.ndarray | None] = [None] * islands
    scores: list[tuple[Score, ...]] = [()] * islands
    for epoch, begun in enumerate(range(0, generations, EPOCH_GENERATIONS)):
        count = min(EPOCH_GENERATIONS, generations - begun)
        # An epoch begins with the last generation of the previous one.
        epochs = [Epoch(setup, population, count + (epoch > 0), _random(seed, island, epoch), seed,
                        starts[island], scores[island]) for island in range(islands)]
        results = list(map(evolve, epochs) if executor is None else executor.map(evolve, epochs))
        for result in results:
            for score in result.tried:
                if score.network not in score_of or score.exact > score_of[score.network].exact:
                    score_of[score.network] = score
        starts, scores = migrate(results)
        progress(begun + count)
    return tuple(score_of.values())


def migrate(results: Sequence[EpochResult]
            ) -> tuple[list[np.ndarray | None], list[tuple[Score, ...]]]:
    """Replace the worst of each island by the best of the previous one."""
    many = max(1, round(MIGRATION_RATE * len(results[0].values)))
    starts: list[np.ndarray | None] = []
    scores = []
    for island, result in enumerate(results):
        other = results[island - 1]
        starts.append(np.concatenate([result.values[:-many], other.values[:many]]))
        scores.append((*result.scores[:-many], *other.scores[:many]))
    return starts, scores


# Weights that give a network a gait, found by NSGA-II (Deb et al. 2000).

#: Sets of the front that are verified, at most.
MAX_VERIFIED = 20
#: Of phase errors in the choice of a set, degrees; error of a set of the front, degrees.
PHASE_RESOLUTION, MAX_FRONT_ERROR = 0.1, 1.0


class NoGaitFound(CpgError):
    """No set passes; the message says how close the search comes."""

    exit_code = 1


@dataclass(frozen=True)
class Front:
    """Result of a search.

    Attributes:
        space: of the varied weights.
        scores: Pareto front of all sets that were tried, best first.
        tried: all of them, in order.
        best: the first of them, with its exact orbit.
        by_phase: of a search as in the paper: its Pareto front, of the phase errors alone.

    """

    space: Space
    scores: tuple[Score, ...]
    tried: tuple[Score, ...]
    best: VerifiedGait
    by_phase: tuple[Score, ...] = ()


def optimise(network_name: str, gait: str, *, population: int = 60, generations: int = 12,
             seed: int = 0, bounds: Mapping[str, tuple[float, float]] | None = None,
             fixed: Mapping[str, float] | None = None, progress: bool = True,
             islands: int = 1, executor: Executor | None = None, paper: bool = False) -> Front:
    """Search for weights that give a network a gait, by NSGA-II on islands.

    As in the paper, weights are coded in bits, with the paper's rates of crossover and mutation,
    and the objectives are the phase errors alone; other parameters are those of the gait's preset.
    The sets of that front are then judged as those of any other search.

    Args:
        network_name: as search_space takes it.
        gait: one of the network's.
        population: number of parameter sets in a generation.
        generations: their number.
        seed: of all random numbers; determines the result.
        bounds: variable -> lower and upper bound, instead of the defaults.
        fixed: variable -> its value.
        progress: show a progress bar.
        islands: number of populations that evolve separately and exchange their best; the result
            depends on it, but not on the number of workers.
        executor: for the islands; None for this process.
        paper: search as Rashidi et al. 2016 do.

    Raises:
        InputError: an unknown network, gait or variable, or an unusable bound.
        MissingLibraryError: pymoo is missing.
        NoGaitFound: no set passed.

    """
    bounds, fixed = dict(bounds or {}), dict(fixed or {})
    space = search_space(network_name, gait, bounds, fixed)
    if paper:
        preset = space.network.presets()[gait].network.as_dict()
        names = {*bounds, *fixed}
        fixed |= {variable.name: preset[variable.members[0]] for variable in space.free
                  if not names & {variable.name, *variable.members}
                  and variable.members[0] not in space.network.couplings}
        space = search_space(network_name, gait, bounds, fixed)
    if population < 4 or generations < 1:
        raise InputError(f'population {population} must be at least 4 and generations '
                         f'{generations} at least 1')
    if seed < 0:
        raise InputError(f'seed {seed} must not be negative')
    if islands < 1:
        raise InputError(f'islands {islands} must be at least 1')
    setup = SearchSetup(network_name, gait, bounds, fixed, paper)
    with progress_bar(f'optimising the {gait}', generations, enabled=progress) as bar:
        if islands == 1:
            epoch = Epoch(setup, population, generations, seed, seed)
            scores = (evolve(epoch, bar) if executor is None
                      else executor.submit(evolve, epoch).result()).tried
        else:
            scores = archipelago(setup, population, generations, seed, islands, executor, bar)
    if not paper:
        return _front(space, scores, seed)
    by_phase = non_dominated(list(scores), len(pairs(space.symmetry)))
    judged = tuple(evaluate([score.network for score in by_phase], gait, seed, MAX_VERIFIED))
    return replace(_front(space, judged, seed), tried=scores, by_phase=tuple(by_phase))


def _front(space: Space, scores: tuple[Score, ...], seed: int) -> Front:
    """Select a set from the front; remove those that fail the verification."""
    left = [score for score in scores if score.exact and score.errors.max() <= MAX_FRONT_ERROR]
    if not left:
        best = min(scores, key=lambda one: (one.errors.max(), one.shortfall, one.stability))
        raise _nothing(space, scores, _closeness(best))
    for _ in range(MAX_VERIFIED):
        front = sorted(non_dominated(left), key=_order)
        try:
            verified = polish(front[0], space.gait, seed)
        except NotVerified as error:
            why = f'the best has the phases, but {error}'
            left.remove(front[0])
            if not left:
                break
            continue
        return Front(space, tuple(front), scores, verified)
    raise _nothing(space, scores, why)


def _closeness(best: Score) -> str:
    """Describe how close a set comes to its gait."""
    if best.errors.max() > MAX_FRONT_ERROR:
        return f'the best has phase errors of up to {best.errors.max():.1f} degrees'
    if best.shortfall > 0.0:
        return ('the best has the phases, but a waveform is too small, turns too unsteadily or is '
                'too like the other')
    return 'the best has the phases, but is not on an orbit of this gait'


def _nothing(space: Space, scores: tuple[Score, ...], why: str) -> NoGaitFound:
    return NoGaitFound(f'no {space.gait} among {len(scores)} sets of weights: {why}; more '
                       'generations, a larger population or another seed may find one')


def _order(score: Score) -> tuple[float, float]:
    """Return the sort key of a score: phase errors first, then stability."""
    return np.ceil(score.errors.max() / PHASE_RESOLUTION), score.stability


def non_dominated(scores: list[Score], objectives: int | None = None) -> list[Score]:
    """Return the Pareto front of the first objectives, by default of all."""
    values = np.array([score.objectives[:objectives] for score in scores])
    return [score for score, row in zip(scores, values, strict=True)
            if not ((values <= row).all(axis=1) & (values < row).any(axis=1)).any()]
