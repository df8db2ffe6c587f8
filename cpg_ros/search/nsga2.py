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

"""Weights that give a network a gait, found by NSGA-II (Deb et al. 2000).

As in Rashidi et al. (2016), section 4, with two more requirements: that the gait is
stable, and that two waveforms differ. A generation is simulated in one batch, sets that
end near the gait are judged by their exact orbit, and the chosen one is proven.
"""

from collections.abc import Mapping
from concurrent.futures import Executor
from dataclasses import dataclass

from cpg_ros.errors import CpgError, InputError
from cpg_ros.files.progress_bar import progress_bar
from cpg_ros.search.islands import archipelago, Epoch, evolve, SearchSetup
from cpg_ros.search.objectives import Score
from cpg_ros.search.search_space import search_space, Space
from cpg_ros.search.verification import Chosen, NotVerified, polish
import numpy as np

#: Sets of the front that are tried before the search is given up.
TRIALS = 20
#: Phase errors (degrees) that are all the same when one set is chosen, and the largest allowed.
SAME, LARGEST = 0.1, 1.0


class NoGaitFound(CpgError):
    """No set passed; the message says how close the search came."""

    exit_code = 1


@dataclass(frozen=True)
class Front:
    """What a search has found.

    Attributes:
        space: what was varied.
        scores: the Pareto front of all sets that were tried, best first.
        tried: all of them, in the order in which they were tried.
        chosen: the best one, with its exact orbit.

    """

    space: Space
    scores: tuple[Score, ...]
    tried: tuple[Score, ...]
    chosen: Chosen


def optimise(network_name: str, gait: str, *, population: int = 60, generations: int = 12,
             seed: int = 0, bounds: Mapping[str, tuple[float, float]] | None = None,
             fixed: Mapping[str, float] | None = None, progress: bool = True,
             islands: int = 1, executor: Executor | None = None) -> Front:
    """Look for weights that give a network a gait.

    Args:
        network_name: as search_space takes it.
        gait: one of the network's.
        population: parameter sets in a generation.
        generations: how many.
        seed: of everything random; the same seed finds the same.
        bounds: variable -> lower and upper bound, instead of the usual ones.
        fixed: variable -> its value.
        progress: show a progress bar.
        islands: populations that evolve apart and exchange their best; with more of them other
            sets are found, on however many workers they are.
        executor: any, for the islands; None for this process.

    Raises:
        InputError: an unknown network, gait or variable, or a bound that cannot be used.
        MissingLibraryError: pymoo is missing.
        NoGaitFound: no set passed.

    """
    space = search_space(network_name, gait, bounds or {}, fixed or {})
    if population < 4 or generations < 1:
        raise InputError(f'population {population} must be at least 4 and generations '
                         f'{generations} at least 1')
    if seed < 0:
        raise InputError(f'seed {seed} must not be negative')
    if islands < 1:
        raise InputError(f'islands {islands} must be at least 1')
    setup = SearchSetup(network_name, gait, dict(bounds or {}), dict(fixed or {}))
    with progress_bar(f'optimising the {gait}', generations, enabled=progress) as bar:
        if islands == 1:
            epoch = Epoch(setup, population, generations, seed, seed)
            tried = (evolve(epoch, bar) if executor is None
                     else executor.submit(evolve, epoch).result()).tried
        else:
            tried = archipelago(setup, population, generations, seed, islands, executor, bar)
    return _front(space, tried, seed)


def _front(space: Space, tried: tuple[Score, ...], seed: int) -> Front:
    """Choose from the front; a set that does not stand up to scrutiny is struck off it."""
    left = [one for one in tried if one.exact and one.errors.max() <= LARGEST]
    if not left:
        best = min(tried, key=lambda one: (one.errors.max(), one.shortfall, one.stability))
        raise _nothing(space, tried, _closeness(best))
    for _ in range(TRIALS):
        front = sorted(_non_dominated(left), key=_order)
        try:
            chosen = polish(front[0], space.gait, seed)
        except NotVerified as error:
            why = f'the best has the phases, but {error}'
            left.remove(front[0])
            if not left:
                break
            continue
        return Front(space, tuple(front), tried, chosen)
    raise _nothing(space, tried, why)


def _closeness(best: Score) -> str:
    """Say how close a set comes to its gait without being on it."""
    if best.errors.max() > LARGEST:
        return f'the best has phase errors of up to {best.errors.max():.1f} degrees'
    if best.shortfall > 0.0:
        return ('the best has the phases, but a waveform is too small, turns too unsteadily or is '
                'too like the other')
    return 'the best has the phases, but is not on an orbit of this gait'


def _nothing(space: Space, tried: tuple[Score, ...], why: str) -> NoGaitFound:
    return NoGaitFound(f'no {space.gait} among {len(tried)} sets of weights: {why}; more '
                       'generations, a larger population or another seed may find one')


def _order(score: Score) -> tuple[float, float]:
    """Smallest phase errors first, then the most stable."""
    return np.ceil(score.errors.max() / SAME), score.stability


def _non_dominated(scores: list[Score]) -> list[Score]:
    values = np.array([one.objectives for one in scores])
    return [one for one, own in zip(scores, values, strict=True)
            if not ((values <= own).all(axis=1) & (values < own).any(axis=1)).any()]
