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

"""Islands: populations that evolve separately, and periodically send their best to a neighbour.

Each island is an NSGA-II of its own with random numbers of its own, derived from the seed, its
number and the epoch. What is found depends on the number of islands, never on who computes them.
"""

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass

from cpg_ros.errors import MissingLibraryError
from cpg_ros.networks.network import Network
from cpg_ros.search.objectives import evaluate, objective_names, Score
from cpg_ros.search.search_space import search_space, Space
from cpg_ros.short_repr import ShortRepr
import numpy as np

#: Generations between two migrations, and the share of a population that goes.
EPOCH, MIGRANTS = 3, 0.1


@dataclass(frozen=True)
class SearchSetup:
    """What all islands search, as the arguments of search_space, which can be pickled."""

    network: str
    gait: str
    bounds: Mapping[str, tuple[float, float]]
    fixed: Mapping[str, float]

    @property
    def space(self) -> Space:
        """The parameter sets among which the gait is looked for."""
        return search_space(self.network, self.gait, self.bounds, self.fixed)


@dataclass(frozen=True, eq=False, repr=False)
class Epoch(ShortRepr):
    """An island for some generations.

    Attributes:
        setup: where it looks.
        population: sets in a generation.
        generations: how many.
        random: seed of the island's random numbers.
        seed: of the states that sets are judged from, the same for all.
        start: first generation, shape (population, free variables); at random if None.
        known: scores of sets that need not be judged anew.

    """

    setup: SearchSetup
    population: int
    generations: int
    random: int
    seed: int
    start: np.ndarray | None = None
    known: tuple[Score, ...] = ()


@dataclass(frozen=True, eq=False, repr=False)
class EpochResult(ShortRepr):
    """An island after an epoch: its last generation, best first, and all sets it has judged."""

    values: np.ndarray
    scores: tuple[Score, ...]
    tried: tuple[Score, ...]


def evolve(epoch: Epoch,
           progress: Callable[[int], None] = lambda generation: None) -> EpochResult:
    """Run NSGA-II on an island for an epoch.

    Raises:
        MissingLibraryError: pymoo is missing.

    """
    try:
        from pymoo.algorithms.moo.nsga2 import NSGA2
        from pymoo.core.evaluator import Evaluator
        from pymoo.core.problem import Problem
        from pymoo.problems.static import StaticProblem
    except ImportError as error:
        raise MissingLibraryError('optimize needs pymoo: pip install pymoo'
                                  ) from error
    space = epoch.setup.space
    problem = Problem(n_var=len(space.free), n_obj=len(objective_names(space.symmetry)),
                      n_ieq_constr=1,
                      xl=np.array([variable.low for variable in space.free]),
                      xu=np.array([variable.high for variable in space.free]))
    algorithm = (NSGA2(pop_size=epoch.population) if epoch.start is None
                 else NSGA2(pop_size=epoch.population, sampling=epoch.start))
    algorithm.setup(problem, termination=('n_gen', epoch.generations), seed=epoch.random)
    tried: dict[Network, Score] = {one.network: one for one in epoch.known}
    for generation in range(epoch.generations):
        population = algorithm.ask()
        networks = [space.build(values) for values in population.get('X')]
        new = list(dict.fromkeys(one for one in networks if one not in tried))
        if new:
            tried.update(zip(new, evaluate(new, space.gait, epoch.seed), strict=True))
        scores = [tried[one] for one in networks]
        # Bounds as the algorithm has them; waveforms that miss what is asked of them come
        # after all others, whatever their phases.
        static = StaticProblem(problem, F=np.array([one.objectives for one in scores]),
                               G=np.array([[one.shortfall] for one in scores]))
        Evaluator().eval(static, population)
        algorithm.tell(infills=population)
        progress(generation + 1)
    values = algorithm.pop.get('X')
    last = [tried[space.build(one)] for one in values]
    best = sorted(range(len(last)), key=lambda k: (
        last[k].shortfall, float(last[k].errors.max()), last[k].stability, tuple(values[k])))
    return EpochResult(values[best], tuple(last[k] for k in best), tuple(tried.values()))


def _random(seed: int, island: int, epoch: int) -> int:
    return int(np.random.SeedSequence([seed, island, epoch]).generate_state(1)[0])


def archipelago(setup: SearchSetup, population: int, generations: int, seed: int, islands: int,
                executor: Executor | None,
                progress: Callable[[int], None] = lambda generation: None
                ) -> tuple[Score, ...]:
    """Return all sets that some islands have judged, in an order that is always the same.

    Args:
        setup: where they look.
        population: sets in a generation of each.
        generations: of each.
        seed: of everything random.
        islands: how many, in a ring; each sends its best to the next one.
        executor: any; None for this process.
        progress: takes the number of generations done.

    """
    tried: dict[Network, Score] = {}
    starts: list[np.ndarray | None] = [None] * islands
    known: list[tuple[Score, ...]] = [()] * islands
    for epoch, begun in enumerate(range(0, generations, EPOCH)):
        count = min(EPOCH, generations - begun)
        # The generation that an epoch begins with is the last one of that before.
        epochs = [Epoch(setup, population, count + (epoch > 0), _random(seed, island, epoch), seed,
                        starts[island], known[island]) for island in range(islands)]
        found = list(map(evolve, epochs) if executor is None else executor.map(evolve, epochs))
        for one in found:
            for score in one.tried:
                if score.network not in tried or score.exact > tried[score.network].exact:
                    tried[score.network] = score
        starts, known = migrate(found)
        progress(begun + count)
    return tuple(tried.values())


def migrate(found: Sequence[EpochResult]
            ) -> tuple[list[np.ndarray | None], list[tuple[Score, ...]]]:
    """The best of each island in the place of the worst of the next one."""
    many = max(1, round(MIGRANTS * len(found[0].values)))
    starts: list[np.ndarray | None] = []
    known = []
    for island, own in enumerate(found):
        other = found[island - 1]
        starts.append(np.concatenate([own.values[:-many], other.values[:many]]))
        known.append((*own.scores[:-many], *other.scores[:many]))
    return starts, known
