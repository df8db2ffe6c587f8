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

"""Objectives of a search for parameters: phases, stability, and different waveforms.

Phase errors are those of Rashidi et al. (2016), eqs. 6-9, with the cell numbers of their Table 5:
the phase of every cell relative to the first one, compared with the gait's. With two waveforms,
each cell is compared with the first cell of its waveform. Stability is the leading Floquet
multiplier. All sets of a generation are simulated in one batch.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from cpg_ros.common.errors import InputError, ShortRepr
from cpg_ros.dynamics import settling
from cpg_ros.dynamics.floquet import multipliers
from cpg_ros.dynamics.integration.simulate import Trajectory
from cpg_ros.dynamics.orbit import extra_symmetry
from cpg_ros.dynamics.solve_orbit import solve_from_path
from cpg_ros.fitting.gaits.recognition import lag, shape_difference, shifted, steadiness
from cpg_ros.networks.network import known, Network
from cpg_ros.networks.registry import find_network, is_path, NETWORKS, SHIPPED
from cpg_ros.networks.symmetry import Symmetry
import numpy as np

#: Shipped networks whose weights can be searched.
SEARCHABLE: dict[str, type[Network]] = {
    name: SHIPPED[name] for name in sorted(SHIPPED) if SHIPPED[name].searched}
#: Decimals of the values, with which presets are written.
DECIMALS = 4


@dataclass(frozen=True)
class Variable:
    """A number to search for, or a fixed one where ``low`` and ``high`` are equal.

    Attributes:
        name: by which it is fixed or bounded.
        low, high: bounds.
        members: parameters of the network with its value.

    """

    name: str
    low: float
    high: float
    members: tuple[str, ...]

    @property
    def free(self) -> bool:
        """Whether it has a range."""
        return self.low < self.high


@dataclass(frozen=True)
class Space:
    """Parameter sets of a network that have the symmetry of a gait.

    Attributes:
        network: class of the network.
        gait: one of its gaits.
        variables: all, free or fixed.

    """

    network: type[Network]
    gait: str
    variables: tuple[Variable, ...]

    @property
    def free(self) -> tuple[Variable, ...]:
        """The variables to search for."""
        return tuple(variable for variable in self.variables if variable.free)

    @property
    def symmetry(self) -> Symmetry:
        """Symmetry of the gait, which all sets have."""
        return self.build(np.array([variable.low for variable in self.free])).symmetry(self.gait)

    def build(self, values: np.ndarray) -> Network:
        """Return the network with values for the free variables, rounded to 4 decimals."""
        numbers = iter(np.round(values, DECIMALS))
        return self.network(**{
            member: value for variable in self.variables
            for value in (float(next(numbers)) if variable.free else variable.low,)
            for member in variable.members})


def _variables(network: type[Network], gait: str) -> list[Variable]:
    """One variable for each family of parameters, those of groups first."""
    # A family that is a whole group has the group's name.
    names = {frozenset(members): group for group, members in network.groups.items()}
    families = network.families(network.presets()[gait].network.symmetry(gait))
    stated = {member: (name, limits) for name, limits in network.searched.items()
              for member in network.groups.get(name, (name,))}
    variables = []
    for family in families:
        # The members have the same bounds.
        name, limits = stated[min(family)]
        variables.append((name not in network.groups, Variable(
            names.get(frozenset(family), min(family)), *limits, tuple(sorted(family)))))
    return [variable for _, variable in sorted(
        variables, key=lambda entry: (entry[0], () if entry[0] else entry[1].members))]


def search_space(network_name: str, gait: str, bounds: Mapping[str, tuple[float, float]],
                 fixed: Mapping[str, float]) -> Space:
    """Return the parameter sets in which to search for a gait.

    Args:
        network_name: of a network that states what may be searched, or its file.
        gait: one of the network's.
        bounds: variable, or any of its parameters -> lower and upper bound, instead of the
            defaults.
        fixed: variable, or any of its parameters -> value.

    Raises:
        InputError: the network or gait is unknown, or a bound or value cannot be used.

    """
    if not is_path(network_name) and (network_name not in NETWORKS
                                      or not NETWORKS[network_name].searched):
        raise InputError(f"network '{network_name}' is not one of {', '.join(SEARCHABLE)}")
    network = find_network(network_name)
    if not network.searched:
        raise InputError(f'the network {network.name} does not state what may be looked for')
    known(gait, network.gaits())
    variables = _variables(network, gait)
    indices = {name: k for k, variable in enumerate(variables)
               for name in (*variable.members, variable.name)}
    sources: dict[int, str] = {}
    for name, (low, high) in [*bounds.items(), *((name, (value, value))
                                                 for name, value in fixed.items())]:
        if name not in indices:
            raise InputError(f"'{name}' is not one of the variables of {gait}: "
                             f'{", ".join(variable.name for variable in variables)}')
        index = indices[name]
        old = variables[index]
        if index in sources:
            raise InputError(f'{name} is the same as {sources[index]}, which is given already')
        if name in bounds and not low < high:
            raise InputError(f'{name}: the lower bound {low:g} is not below the upper bound '
                             f'{high:g}')
        allowed = network.ranges[old.members[0]]
        if not allowed.low <= low <= high <= allowed.high:
            raise InputError(f'{name}: {low:g}{"" if low == high else f" to {high:g}"} is not '
                             f'within {allowed.low:g} to {allowed.high:g}')
        sources[index] = name
        variables[index] = Variable(old.name, low, high, old.members)
    space = Space(network, gait, tuple(variables))
    if not space.free:
        raise InputError('every variable is fixed: nothing is left to search')
    return space


#: Sets that are simulated at once, which limits memory; a usual generation is one batch.
BATCH_SIZE = 256
#: Deviation of a start from the gait, as a fraction of the signals (see ``_mismatch``).
START_MISMATCH = 0.2
#: Resolution of phase errors, degrees.
PHASE_RESOLUTION = 0.001
#: The exact orbit is solved for at phase errors up to MAX_EXACT_ERROR, degrees, and mismatch to
#: MAX_EXACT_MISMATCH.
MAX_EXACT_ERROR, MAX_EXACT_MISMATCH = 5.0, 0.15
#: Sets of a generation, the most stable ones, whose orbit is solved for, as it takes 20 to 300 ms;
#: relative difference of its period from the simulated one.
MAX_EXACT, PERIOD_TOLERANCE = 16, 0.02
#: Range of every cell; steadiness of its rotation (see fitting.gaits.recognition.steadiness);
#: difference in shape of two waveforms; factor of these limits in the search.
MIN_RANGE, MIN_STEADINESS, MIN_DIFFERENCE, MARGIN = 0.15, 0.1, 0.15, 1.2
#: Of a set without a gait, degrees; of one that rests or runs away; of one whose motion does not
#: repeat.
WORST_PHASE_ERROR, REST_STABILITY, APERIODIC = 180.0, 2.0, 1.5


@dataclass(frozen=True, eq=False, repr=False)
class Score(ShortRepr):
    """A parameter set with its objectives, and a state on its gait.

    Attributes:
        network: parameters.
        errors: phase errors in degrees, shape (3,) or (2,); see ``pairs``.
        stability: leading Floquet multiplier; an estimate unless ``exact``.
        difference: of the gait's two waveforms; None for one waveform.
        shortfall: by how much waveforms miss their requirements, 0 if they meet them.
        exact: whether the orbit was solved for.
        state: on the exact orbit, shape (components,).
        period: of the orbit, model time.

    """

    network: Network
    errors: np.ndarray
    stability: float
    difference: float | None
    shortfall: float
    exact: bool = False
    state: tuple[float, ...] = ()
    period: float = 0.0

    @property
    def objectives(self) -> np.ndarray:
        """Values to minimise: phase errors, stability, and minus the difference of waveforms."""
        rest = [self.stability] + ([] if self.difference is None else [-self.difference])
        return np.array([*np.maximum(self.errors, PHASE_RESOLUTION), *rest])


def pairs(symmetry: Symmetry) -> list[list[tuple[int, int]]]:
    """Return pairs of cells (from 0) for each phase error: a cell, and the first of its waveform.

    There are at most three errors; the last one is the largest of all further pairs.
    """
    first = symmetry.first[symmetry.waves].tolist()
    partners = [(cell, partner) for cell, partner in enumerate(first) if cell != partner]
    return [[pair] for pair in partners[:2]] + ([partners[2:]] if partners[2:] else [])


def objective_names(symmetry: Symmetry) -> tuple[str, ...]:
    """Return the names of the objectives with their units, in the order of Score.objectives."""
    names = []
    for group in pairs(symmetry):
        cells = sorted(cell + 1 for cell, _ in group)
        which = str(cells[0]) if len(cells) == 1 else f'{cells[0]} to {cells[-1]}'
        names.append(f'phase error of cell {which} [deg]')
    return (*names, 'leading multiplier [1]',
            *(['minus difference of waveforms [1]'] if symmetry.waves.max() else []))


def _mismatch(signals: np.ndarray, symmetry: Symmetry) -> float:
    """Return the deviation from the gait's symmetry: largest RMS over pairs, over the signal's."""
    largest = 0.0
    for cell, partner in (pair for group in pairs(symmetry) for pair in group):
        theta = symmetry.phases[cell] - symmetry.phases[partner]
        gap = np.sqrt(np.mean((signals[:, cell] - shifted(signals[:, partner], theta))**2))
        size = min(signals[:, cell].std(), signals[:, partner].std())
        largest = max(largest, float(gap / size) if size > 0.0 else 10.0)
    return largest


def phase_errors(signals: np.ndarray, symmetry: Symmetry) -> np.ndarray:
    """Return the phase errors of the groups of ``pairs``, degrees, 0 to 180, (..., groups).

    Args:
        signals: of the cells on even points of a cycle, shape (..., m, cells or more).
        symmetry: of the gait.

    """
    waves = np.swapaxes(signals, -1, -2)
    errors = []
    for group in pairs(symmetry):
        cells, first = np.array(group).T
        off = (lag(waves[..., cells, :], waves[..., first, :]) - symmetry.phases[cells]
               + symmetry.phases[first])
        errors.append(np.abs((off + 0.5) % 1.0 - 0.5).max(axis=-1) * 360.0)
    return np.stack(errors, axis=-1)


def waveform_shortfall(signals: np.ndarray, symmetry: Symmetry, margin: float = 1.0) -> float:
    """Return by how much waveforms miss their requirements, relative to them, or 0.

    Every cell must have a range and rotate steadily, so that its phase can be read in spite of
    noise; two waveforms must differ in shape.
    """
    cells, first = symmetry.group.cells, symmetry.first
    have = [(np.ptp(signals[:, wave]), MIN_RANGE) for wave in first]
    have += [(steadiness(signals[:, wave], signals[:, wave + cells]), MIN_STEADINESS)
             for wave in first]
    if len(first) == 2:
        have.append((shape_difference(*signals[:, first].T), MIN_DIFFERENCE))
    return float(sum(max(0.0, margin - max(0.0, value / least)) for value, least in have))


def _simulated(network: Network, gait: str, run: Trajectory
               ) -> tuple[Score, settling.LimitCycle | None]:
    """Score a set by its simulation; also return its cycle if it is worth solving for."""
    symmetry, cells = network.symmetry(gait), network.cells
    first = symmetry.first
    two = len(first) == 2
    finite = bool(np.isfinite(run.x[-1]).all())
    cycle = settling.last_cycle(run, cells) if finite else None
    if cycle is None:
        span = np.ptp(run.x[run.t.size // 2:, :cells], axis=0)
        alive = finite and span.max() >= settling.MIN_RANGE
        return Score(network, np.full(len(pairs(symmetry)), WORST_PHASE_ERROR),
                     APERIODIC if alive else REST_STABILITY, 0.0 if two else None, 10.0), None
    signals = cycle.signals
    errors = phase_errors(signals, symmetry)
    mismatch = _mismatch(signals, symmetry)
    near = errors.max() <= MAX_EXACT_ERROR and mismatch <= MAX_EXACT_MISMATCH
    if near:
        shortfall = waveform_shortfall(signals, symmetry, MARGIN)
    else:
        # The shapes are not those of the gait, so only the range counts; two waveforms that are
        # missing count less than any that are there.
        shortfall = max(0.0, MARGIN - np.ptp(signals[:, :cells], axis=0).min() / MIN_RANGE)
        shortfall += (MARGIN + errors.max() / WORST_PHASE_ERROR) if two else 0.0
    difference = (shape_difference(*signals[:, first].T) if near else 0.0) if two else None
    # Estimate the multiplier by the decay of the start's disturbance per cycle. It is above 1 if
    # the network has left the gait.
    stability = min(APERIODIC, (max(mismatch, 1e-10) / START_MISMATCH)
                    **(cycle.period / settling.SPAN))
    score = Score(network, errors, float(stability), difference, float(shortfall))
    return score, cycle if near and shortfall == 0.0 else None


def _proven(score: Score, cycle: settling.LimitCycle, gait: str) -> Score:
    """Solve for the exact orbit of a set that ends near its gait, from its cycle."""
    symmetry = score.network.symmetry(gait)
    orbit = solve_from_path(score.network, symmetry, cycle, cycle.period)
    if orbit is None or extra_symmetry(orbit) or abs(orbit.period / cycle.period
                                                     - 1.0) > PERIOD_TOLERANCE:
        # The estimate does not hold near the gait but off it.
        return replace(score, stability=max(1.0, score.stability))
    return replace(score, stability=multipliers(orbit).leading, exact=True,
                   state=tuple(orbit(np.array(0.0)).tolist()), period=orbit.period)


def evaluate(networks: Sequence[Network], gait: str, seed: int,
             most_exact: int = MAX_EXACT) -> list[Score]:
    """Simulate the parameter sets of a generation in a batch, and score each.

    Args:
        networks: of one kind.
        gait: one of theirs.
        seed: of the start.
        most_exact: most sets whose orbit is solved for.

    """
    results = []
    for first in range(0, len(networks), BATCH_SIZE):
        batch = networks[first:first + BATCH_SIZE]
        runs = settling.population_run(batch, settling.start_states(batch, gait, seed))
        results += [_simulated(network, gait, Trajectory(runs.t, x, slopes))
                    for network, x, slopes in zip(batch, runs.x, runs.slopes, strict=True)]
    scores = [score for score, _ in results]
    worth = sorted((k for k, (_, cycle) in enumerate(results) if cycle is not None),
                   key=lambda k: scores[k].stability)
    for k in worth[:most_exact]:
        cycle = results[k][1]
        assert cycle is not None
        scores[k] = _proven(scores[k], cycle, gait)
    return scores
