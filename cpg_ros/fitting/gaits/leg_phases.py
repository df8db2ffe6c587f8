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

"""Phases between legs from their mean cycles, and the matching gait.

A leg leads another by the shift at which the same joints of both are most alike (circular
cross-correlation of all of them). Another leg may have the opposite sign convention, as for
abduction; the mean angles, or the sign that makes the waveforms more alike, decide. Legs with
different joints, such as an animal's fore and hind ones, are compared by the first harmonic of the
joint that moves most; half a cycle is then uncertain, as the sign of an elbow that corresponds to
a knee's is unknown. Insects' legs are compared by their feet (insect_legs).
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from cpg_ros.fitting.gaits.foot_contacts import FootContacts, MAX_WALK_FALL, MIN_RUN_FALL
from cpg_ros.fitting.gaits.leg_names import HEXAPOD, role_of
from cpg_ros.fitting.gaits.mean_cycle import blocks, evaluate_coefficients, PhaseAverage
from cpg_ros.fitting.gaits.recognition import best_shift, recognise
from cpg_ros.networks.network import GAIT_TOLERANCE, nearest_gait, Network
import numpy as np
from scipy.special import stdtrit

# Scatter of the legs' phases: by how much each leg is early or late in every stride.

#: MIN_POWER_RATIO: squared slope of a stride, over the median stride's, for a phase of its own.
MIN_POWER_RATIO = 0.5
MIN_STRIDES = 3


@dataclass(frozen=True)
class PhaseScatter:
    """Scatter and error of a leg's phase relative to the first leg.

    Attributes:
        spread: standard deviation of single strides, cycles; nan if there are too few.
        error: standard error of the mean, cycles; nan likewise.
        half_width: of its 95 % interval (Student), cycles; nan likewise.
        strides: number of strides used.

    """

    spread: float
    error: float
    half_width: float
    strides: int


def phase_scatter(phases: np.ndarray, x: np.ndarray, average: PhaseAverage,
                  legs: Mapping[str, Sequence[str]], names: Sequence[str]
                  ) -> dict[str, PhaseScatter]:
    """Return how the phases of the legs relative to the first one scatter between strides.

    Args:
        phases: of the samples, cycles, ascending, shape (n,).
        x: rad, nan where missing, shape (n, joints).
        average: mean cycles of these samples.
        legs: leg -> its joints, the first leg first.
        names: of the joints, in the order of x.

    Returns:
        Leg -> scatter; zeros for the first leg.

    """
    theta = phases - average.zero
    stride = np.floor(theta - theta[0]).astype(int)
    count = int(stride[-1]) + 1
    order = np.arange(len(average.coefficients))[:, None]
    slope_average = replace(average, coefficients=2j * np.pi * order * average.coefficients)
    along, power = np.zeros((2, len(legs), count))
    for part in blocks(phases):
        finite = np.isfinite(x[part])
        slopes = np.where(finite, slope_average.mean(theta[part]).T, 0.0)
        residual = np.where(finite, x[part] - average.mean(theta[part]).T, 0.0)
        for row, joints in enumerate(legs.values()):
            columns = [names.index(name) for name in joints]
            for sums, values in ((along, residual), (power, slopes)):
                sums[row] += np.bincount(
                    stride[part], np.sum(values[:, columns] * slopes[:, columns], axis=1), count)
    reliable = power > MIN_POWER_RATIO * np.median(power, axis=1, keepdims=True)
    leads = np.full_like(along, np.nan)
    leads[reliable] = along[reliable] / power[reliable]
    return {leg: _scatter(row - leads[0]) for leg, row in zip(legs, leads, strict=True)}


def _scatter(leads: np.ndarray) -> PhaseScatter:
    reliable = leads[np.isfinite(leads)]
    if reliable.size < MIN_STRIDES:
        return PhaseScatter(np.nan, np.nan, np.nan, reliable.size)
    spread = float(reliable.std(ddof=1))
    error = spread / np.sqrt(reliable.size)
    return PhaseScatter(spread, error, float(stdtrit(reliable.size - 1, 0.975)) * error,
                        reliable.size)


# Positions of insects' feet from the angles of their joints, which show when each leg steps.

#: JOINTS: usual names of a leg's joints, and those of DeepFly3D, in the order in which they turn
#: it.
JOINTS = (('coxayaw', 'thcyaw'), ('coxa', 'coxapitch', 'thcpitch'), ('coxaroll', 'thcroll'),
          ('femur', 'femurpitch', 'ctrpitch'), ('femurroll', 'ctrroll'),
          ('tibia', 'tibiapitch', 'ftipitch'))
AXES = 'xyzyzy'
#: SEGMENT_LENGTHS: pair of legs of a fruit fly -> lengths of coxa, femur, and tibia with tarsus,
#: mm; SEGMENT_JOINTS: index of the joint after which each begins.
SEGMENT_LENGTHS = {'f': (0.40, 0.69, 1.17), 'm': (0.18, 0.78, 1.24), 'h': (0.20, 0.83, 1.39)}
SEGMENT_JOINTS = (2, 4, 5)
#: POINTS: number of points of a cycle.
POINTS = 128


def _roles(joints: Sequence[str]) -> list[str]:
    """Return a leg's joints in the order of JOINTS; nothing if one is missing."""
    by_role = {role_of(name).replace(' ', '').removeprefix('joint'): name for name in joints}
    joints_of_role = [next((by_role[role] for role in names if role in by_role), '')
                      for names in JOINTS]
    return joints_of_role if all(joints_of_role) else []


def foot(angles: Sequence[np.ndarray], pair: str) -> np.ndarray:
    """Return the position of a foot relative to the thorax, mm, shape (n, 3).

    Args:
        angles: rad, of each joint in the order of JOINTS, shape (n,).
        pair: f, m or h.

    """
    from scipy.spatial.transform import Rotation

    rotation, position = Rotation.identity(), np.zeros((angles[0].size, 3))
    for k, (axis, angle) in enumerate(zip(AXES, angles, strict=True)):
        rotation = rotation * Rotation.from_euler(axis, angle[:, None])
        if k in SEGMENT_JOINTS:
            length = SEGMENT_LENGTHS[pair][SEGMENT_JOINTS.index(k)]
            position -= length * rotation.apply((0.0, 0.0, 1.0))
    return position


def foot_phases(legs: Mapping[str, Sequence[str]], c: Mapping[str, np.ndarray]
                ) -> dict[str, float] | None:
    """Return by how much each foot leads the first one in its motion along the body.

    Args:
        legs: leg -> its joints.
        c: joint -> Fourier coefficients of its mean cycle, complex, shape (n + 1,).

    Returns:
        Leg -> phase in cycles, [0, 1), from the first harmonic; None if these are not six legs
            with all joints.

    """
    roles = {leg: _roles(joints) for leg, joints in legs.items()}
    if set(legs) != set(HEXAPOD) or not all(roles.values()):
        return None
    waves = np.exp(2j * np.pi * np.outer(np.arange(POINTS) / POINTS,
                                         np.arange(next(iter(c.values())).size)))
    waves[:, 1:] *= 2.0
    forward = {leg: np.fft.rfft(foot([(waves @ c[name]).real for name in names], leg[1])[:, 0])[1]
               for leg, names in roles.items()}
    first = next(iter(forward.values()))
    return {leg: round(float(np.angle(position / first)) / (2.0 * np.pi) % 1.0, 9) % 1.0
            for leg, position in forward.items()}


#: MIN_MEAN_RATIO: of a joint's mean angle to its RMS motion, for the mean to have a sign.
MIN_MEAN_RATIO = 1.0
#: MIN_CORRELATION_GAIN: of one sense of a joint over the other, to decide between them.
MIN_CORRELATION_GAIN = 0.2
#: MIN_VARIANCE_RATIO: of a joint that decides a leg's phase, over the largest.
MIN_VARIANCE_RATIO = 0.05
#: PHASE_STD: RMS distance of real legs from the phases of their gait, cycles.
PHASE_STD = 0.06
#: SYMMETRY_TOLERANCE: violation over the cells' RMS; SAMPLES: of a cycle for it.
SYMMETRY_TOLERANCE, SAMPLES = 0.2, 128


@dataclass(frozen=True)
class GaitMatch:
    """The gait that matches the legs' phases.

    Attributes:
        gait: None if no gait is near enough.
        nearest: nearest gait.
        distance: from the nearest gait, cycles: RMS over the legs after the best common shift.
        margin: additional distance of the next distinct gait, cycles.
        candidates: gaits that cannot be distinguished from the nearest, including it.
        probability: that the nearest gait is right, given the scatter of legs' phases.
        notes: one line each.

    """

    gait: str | None
    nearest: str
    distance: float
    margin: float
    candidates: tuple[str, ...]
    probability: float
    notes: tuple[str, ...]


def _cross(ahead: np.ndarray, behind: np.ndarray) -> np.ndarray:
    """Return the terms of the cross-correlation of two joints, shape (n + 1,)."""
    terms = ahead * behind.conj()
    terms[0] = 0.0
    return terms


def _power(c: np.ndarray) -> float:
    return float(np.sum(np.abs(c[1:])**2))


def _sense(a: np.ndarray, b: np.ndarray) -> float:
    """Return 1 if two joints have the same sign convention, -1 if opposite ones, 0 if unknown."""
    levels, sizes = (a[0].real, b[0].real), np.sqrt([2.0 * _power(a), 2.0 * _power(b)])
    if all(abs(level) > MIN_MEAN_RATIO * size for level, size in zip(levels, sizes, strict=True)):
        return float(np.sign(levels[0] * levels[1]))
    terms = _cross(a, b)
    gain = best_shift(terms)[1] - best_shift(-terms)[1]
    gain /= max(np.sqrt(_power(a) * _power(b)), 1e-300)
    return float(np.sign(gain)) if abs(gain) > MIN_CORRELATION_GAIN else 0.0


def _pairs(first: Sequence[str], other: Sequence[str]) -> list[tuple[str, str]]:
    """Pair joints of two legs by their names without the leg, or by number."""
    roles = {role_of(name): name for name in first}
    pairs = [(roles[role_of(name)], name) for name in other if role_of(name) in roles]
    bare = {''.join(sign for sign in role_of(name) if sign.isalpha() or sign == ' ').strip()
            for name in (*first, *other)}
    if not pairs and len(bare) == 1 and len(first) == len(other):
        return list(zip(first, other, strict=True))
    return pairs


def leg_phases(legs: Mapping[str, Sequence[str]], c: Mapping[str, np.ndarray]
               ) -> tuple[dict[str, float], tuple[str, ...], tuple[str, ...], tuple[str, ...]]:
    """Return by how much each leg leads the first one.

    Args:
        legs: leg -> its joints, the first leg first.
        c: joint -> Fourier coefficients of its mean cycle, complex, shape (n + 1,).

    Returns:
        Leg -> phase in cycles, [0, 1): x_leg(t) = x_first(t + phase T); notes; legs whose phase
            may be half a cycle off, as their sign convention is unknown; joints with the opposite
            sign convention of the first leg's.

    """
    feet = foot_phases(legs, c)
    if feet is not None:
        return feet, ('phases between legs are those of their feet along the body, by the joints '
                      'of a fly',), (), ()
    phases: dict[str, float] = {}
    notes: list[str] = []
    opposite: list[str] = []
    vague: list[str] = []
    for leg, joints in legs.items():
        if not phases:
            phases[leg] = 0.0
            continue
        # The first leg that has the same joints; or else the first one.
        base, pairs = next(((base_leg, base_pairs) for base_leg in phases
                            if (base_pairs := _pairs(legs[base_leg], joints))), ('', []))
        if pairs:
            ahead, flips, has_sense = _shift(pairs, c)
            opposite += flips
            vague += [] if has_sense else [leg]
        else:
            base = next(iter(phases))
            strongest = [max(names, key=lambda name: np.abs(c[name][1]))
                         for names in (legs[base], joints)]
            ahead = float(np.angle(c[strongest[1]][1] / c[strongest[0]][1])) / (2.0 * np.pi)
            notes.append(f'{leg} has no joint named like one of {base}: its phase is that of '
                         f'{strongest[1]} against {strongest[0]}, half a cycle off if their '
                         'senses differ')
            vague.append(leg)
        # A phase that rounds to a whole cycle is 0.
        phases[leg] = round((phases[base] + ahead) % 1.0, 9) % 1.0
    if opposite:
        notes.append(f'taken to count angles in the opposite sense of {next(iter(legs))}: '
                     f'{", ".join(opposite)}')
    return phases, tuple(notes), tuple(vague), tuple(opposite)


def _shift(pairs: list[tuple[str, str]], c: Mapping[str, np.ndarray]
           ) -> tuple[float, list[str], bool]:
    """Return by how much the second of each pair leads the first, all together.

    Also return the joints with opposite sign conventions, and whether any convention is known.
    """
    power = {pair: _power(c[pair[0]]) * _power(c[pair[1]]) for pair in pairs}
    min_power = MIN_VARIANCE_RATIO**2 * max(power.values())
    senses = {pair: _sense(c[pair[0]], c[pair[1]]) for pair in pairs}
    # Pairs whose sense is known come first: the other pairs have to agree with them.
    pairs = sorted(pairs, key=lambda pair: (not (senses[pair] and power[pair] >= min_power),
                                            -power[pair]))
    has_sense = bool(senses[pairs[0]])
    total: np.ndarray | None = None
    flips = []
    for first, other in pairs:
        terms = _cross(c[other], c[first])
        sense = senses[first, other]
        if total is None:
            sense = sense or 1.0
            total = np.zeros_like(terms)
        elif not sense:
            # Choose the sense that agrees with the pairs that move more.
            phasor = np.exp(-2j * np.pi * np.arange(terms.size) * best_shift(total)[0])
            sense = 1.0 if np.sum(terms * phasor).real >= 0.0 else -1.0
        if sense < 0.0:
            flips.append(other)
        total = total + sense * terms
    assert total is not None
    return float(best_shift(total)[0]), flips, has_sense


def _symmetry(network: type[Network], gait: str) -> Any:
    return network.presets()[gait].network.symmetry(gait)


def _has_reverse(network: type[Network], gait: str, symmetry: Any) -> bool:
    """Tell whether the gait with all shifts negated is another one of the network's."""
    reverse_shifts = {name: -shift % 1 for name, shift in symmetry.shifts}
    others = [_symmetry(network, other) for other in network.gaits() if other != gait]
    # A gait of another group has other names of elements: compare the phases instead.
    return any(dict(other.shifts) == reverse_shifts if other.group == symmetry.group
               else np.allclose(other.phases, -symmetry.phases % 1.0) for other in others)


def _phase_distance(phases: np.ndarray, target: np.ndarray, waves: np.ndarray) -> float:
    """Return the distance of leg phases; between different waveforms any phase is allowed."""
    squares = [nearest_gait(phases[waves == wave], {'': target[waves == wave]})[1]**2
               * np.count_nonzero(waves == wave) for wave in np.unique(waves)]
    return float(np.sqrt(sum(squares) / phases.size))


def _odds(nearest: float, other: float, legs: int) -> float:
    """Return the odds of a gait against the nearest one, from the distances of both."""
    return float(np.exp(-0.5 * legs * (other**2 - nearest**2) / PHASE_STD**2))


def match_gait(phases: Mapping[str, float], network: type[Network]) -> GaitMatch:
    """Name the gait of leg phases.

    Among several gaits within the tolerance the most symmetric is taken, as every walk is a skip,
    too.

    Args:
        phases: leg -> cycles, in the order of the network's legs.
        network: with the gaits.

    """
    values = np.array(list(phases.values()))
    cells = [numbers[0] - 1 for numbers in next(iter(network.legs.values())).values()]
    distance, size = {}, {}
    for gait in (name for name in network.gaits() if name != network.unnamed):
        symmetry = _symmetry(network, gait)
        target, waves = symmetry.phases[cells], symmetry.waves[cells]
        if symmetry.leads:
            # Stated, in either sense, between whatever waveforms.
            distance[gait], size[gait] = _phase_distance(values, target, np.zeros_like(waves)), 0
            continue
        distance[gait] = _phase_distance(values, target, waves)
        # A wave that runs round may do so in both senses, where these are not two gaits.
        if not _has_reverse(network, gait, symmetry):
            distance[gait] = min(distance[gait], _phase_distance(values, -target, waves))
        size[gait] = -symmetry.waves.max()
    fits = [gait for gait in distance
            if distance[gait] <= max(GAIT_TOLERANCE, min(distance.values()))]
    nearest = min(fits, key=lambda gait: (-size[gait], round(distance[gait], 9)))
    # Others with the same phases of the legs; less constrained ones never fit worse.
    candidates = [gait for gait in fits if size[gait] == size[nearest]
                  and abs(distance[gait] - distance[nearest]) < 1e-9]
    margin = min((distance[gait] for gait in distance if gait not in candidates
                  and size[gait] >= size[nearest]), default=np.inf) - distance[nearest]
    rivals = [gait for gait in distance if gait != nearest and size[gait] >= size[nearest]]
    odds = [_odds(distance[nearest], distance[gait], values.size) for gait in rivals]
    notes = []
    if len(candidates) > 1:
        notes.append(f"the legs move alike in {', '.join(candidates)}: only which of a leg's "
                     'cells drives which joint tells them apart')
    order = [leg for leg, _ in sorted(phases.items(), key=lambda item: -item[1] % 1.0)]
    if nearest == 'walk' and len(order) == len(network.girdles) == 4:
        # After a hind leg comes the fore one of its side, or the other; after a fore one not.
        beside = network.sides[order[1]] == network.sides[order[0]]
        kind = 'lateral' if beside == (network.girdles[order[0]] == 'hind') else 'diagonal'
        notes.append(f'{kind} sequence: {", ".join(order).upper()}')
    gait_name = nearest if distance[nearest] <= GAIT_TOLERANCE else None
    return GaitMatch(gait_name, nearest, distance[nearest], margin, tuple(candidates),
                     1.0 / (1.0 + sum(odds)), tuple(notes))


def match_gait_by_cells(c: np.ndarray, network: type[Network]) -> GaitMatch:
    """Name the gait of the signals of all cells, by their symmetry.

    Args:
        c: Fourier coefficients of the cells' mean cycles, complex, shape (n + 1, cells).
        network: whose gaits.

    """
    table = {gait: _symmetry(network, gait) for gait in network.gaits()}
    cycle = evaluate_coefficients(c, np.arange(SAMPLES) / SAMPLES).T
    result = recognise(cycle, next(iter(table.values())).group, table, SYMMETRY_TOLERANCE)
    # What a wave is off from itself that is early by the distance.
    distance, second = (float(np.arcsin(min(0.5 * size, 1.0)) / np.pi)
                        for size in (result.distance, result.distance + result.margin))
    return GaitMatch(result.name, result.nearest, distance, second - distance,
                     (result.nearest,),
                     1.0 / (1.0 + _odds(distance, second, network.cells)), ())


def walk_or_run(match: GaitMatch, contacts: FootContacts | None, falling: float | None
                ) -> GaitMatch:
    """Distinguish walk and run by flight, for legs that move alike in both.

    Args:
        match: by the legs' phases.
        contacts: of the feet, if known.
        falling: fraction of the stride in which the body falls freely, if its height is known.

    """
    if set(match.candidates) != {'walk', 'run'}:
        return match
    evidence = [] if contacts is None else [(contacts.gait, f'by {contacts.source}: {contacts}')]
    if falling is not None:
        # Before what is only estimated of the feet, after what was measured of them.
        evidence.insert(0 if contacts is None or contacts.by_motion else 1, (
            'walk' if falling <= MAX_WALK_FALL else 'run' if falling >= MIN_RUN_FALL else None,
            f'by the height of the body, which falls freely in {falling:.0%} of the stride'))
    gait, reason = next(((name, text) for name, text in evidence if name), (None, ''))
    if gait is None:
        return match
    # The other one was a rival with even odds.
    return replace(match, gait=match.gait and gait, nearest=gait, candidates=(gait,),
                   probability=1.0 / (1.0 / match.probability - 1.0),
                   notes=(f'{gait}, {reason}',))
