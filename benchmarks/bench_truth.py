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

"""Whether fits tell the truth: parameters of made-up recordings within their 95 % intervals.

Each recording is 24 strides read off an exact gait by the generator's own readout, with noise of
2 % of each joint's range, stamps off by 0.5 ms and 1 % of the samples missing, averaged. A fit
starts from other values than the truth. By chance 95 of 100 intervals hold it.

Then networks with parameters drawn within a tenth of a drawn gait's preset, or phases within a
twentieth of a cycle, fitted as ``inversion`` does, with noise of 1 %; and the same as whole
recordings of 14 s, 1 to 5 % of whose samples are missing, or repeat the pose in which a generator
was held up, 30 to 250 ms at a time. ``--readouts`` also makes recordings with more noise or by
other readouts than the fit's: three harmonics without Lanczos' factors, legs retimed to a duty, or
another order.

Last, what the generator publishes of every shipped robot, network and gait, 14 s of it with noise
of 1 %, fitted with the robot file as ``inversion`` does, five seeds each.
"""

import argparse
from collections.abc import Callable, Iterator
from functools import partial
import sys
import time

from common import emit, log, ROOT
import numpy as np
from scipy.stats import binomtest

sys.path.append(str(ROOT / 'test' / 'support'))

from cpg_ros.common.errors import CpgError  # noqa: E402
from cpg_ros.dynamics.solve_orbit import solve_preset  # noqa: E402, I100
from cpg_ros.fitting.gaits.stride import find_stride  # noqa: E402
from cpg_ros.fitting.inversion.free_parameters import free_numbers, with_values  # noqa: E402
from cpg_ros.fitting.inversion.invert import invert  # noqa: E402
from cpg_ros.fitting.inversion.leg_duty import GAIT_DUTY  # noqa: E402
from cpg_ros.fitting.inversion.recording_fit import (  # noqa: E402
    fit_recording,
    fit_with_fallbacks,
)
from cpg_ros.motion.plan import gait_of, validate_orbit  # noqa: E402
from cpg_ros.motion.robot import NUM_HARMONICS  # noqa: E402
from cpg_ros.motion.robot_file import load_robot  # noqa: E402
from cpg_ros.networks.registry import NETWORKS, PRESETS  # noqa: E402
from generated import generated, walks  # noqa: E402
from made_up import joint_angles, plain_readout, record, weights_of  # noqa: E402
from motion import Driven, noisy, Recorded, stamps  # noqa: E402

SEEDS, GOAL, GENERATED = 100, 0.9, 5
#: Network, gait, order of the readouts, cells of the joints, and how far off each start is.
QUADRUPED, BIPED = (1, 1, 7, 2, 2, 8, 3, 3, 5, 4, 4, 6), (1, 1, 3, 2, 2, 4)
LEGS = (1, 1, 1, 2, 2, 2, 3, 3, 3, 4, 4, 4)
JOINTS = {'biped': BIPED, 'hopf': LEGS, 'matsuoka': LEGS}
CASES = (('delayed', 'trot', 3, QUADRUPED, {'c': 1.05, 'tau': 1.1}),
         ('delayed', 'walk', 2, QUADRUPED, {'c': 0.95, 'tau': 1.1}),
         ('quadruped', 'trot', 3, QUADRUPED, {'alpha': 0.97, 'beta': 1.03}),
         ('biped', 'walk', 3, BIPED, {'current': 1.03, 'phi': 0.95, 'w_a': 0.95}),
         ('hopf', 'trot', 3, LEGS, {'duty': 0.95}),
         ('matsuoka', 'trot', 3, LEGS, {'beta': 1.05}),
         ('matsuoka', 'walk', 3, LEGS, {'beta': 1.05, 'a': 0.97}))
#: Networks whose parameters are drawn.
DRAWN = ('delayed', 'quadruped', 'biped', 'hopf', 'matsuoka', 'phase')
#: Noise over each joint's range, readout of the recordings, order of the fit, and stalls.
READOUTS = {'exact': (0.01, joint_angles, 3, ''), 'noise of 3 %': (0.03, joint_angles, 3, ''),
            'no Lanczos factors': (0.01, plain_readout, 3, ''),
            'duty 0.65': (0.01, partial(joint_angles, duty=0.65), 3, ''),
            'order 2': (0.01, joint_angles, 2, ''),
            'samples missing': (0.01, joint_angles, 3, 'missing'),
            'poses repeated': (0.01, joint_angles, 3, 'repeated')}
#: Samples a second, fraction of them that are stalled, and how long one stall lasts, s.
RATE, STALLED, STALL = 200.0, (0.01, 0.05), (0.03, 0.25)
#: Gaits whose phases are read off the legs, recorded for so long (s) at so many strides a second.
STATED, LASTING, STRIDES = (('phase', 'canter_left'), ('phase', 'unnamed')), 14.0, 1.7


def covered(name: str, gait: str, order: int, cells: tuple[int, ...], off: dict[str, float]
            ) -> dict[str, object]:
    preset = PRESETS[name][gait]
    orbit, network = solve_preset(preset), preset.network
    truth = {free: getattr(network, network.groups.get(free, (free,))[0]) for free in off}
    start = {free: fraction * truth[free] for free, fraction in off.items()}
    inside, errors, spent = dict.fromkeys(off, 0), {free: [] for free in off}, []
    for seed in range(SEEDS):
        recording, assigned = record(orbit, cells, weights_of(len(cells), order),
                                     np.random.default_rng(seed))
        began = time.perf_counter()
        fit = invert(recording, assigned, network, gait, tuple(off), order, [start])
        spent.append(1e3 * (time.perf_counter() - began))
        for free, one in fit.parameters.items():
            inside[free] += one.low <= truth[free] <= one.high
            errors[free].append((one.value - truth[free]) / one.stderr)
    log(f'{name} {gait} order {order}: {inside} of {SEEDS} inside')
    return {'inside': {free: count / SEEDS for free, count in inside.items()},
            'error_over_stderr': {free: float(np.sqrt(np.mean(np.square(each))))
                                  for free, each in errors.items()},
            'median_ms': float(np.median(spent))}


def phases_covered(name: str, gait: str) -> dict[str, object]:
    """Legs' phases of whole recordings within the intervals that the scatter of strides gives."""
    driven, rng = Driven(name, gait), np.random.default_rng(0)
    legs = list(driven.by_leg)
    truth = dict(zip(legs, driven.orbit.phases, strict=True))
    inside, off = dict.fromkeys(legs[1:], 0), {leg: [] for leg in legs[1:]}
    for _ in range(SEEDS):
        t = stamps(rng, LASTING, RATE)
        told = t + 5e-4 * rng.standard_normal(t.size)
        seen = Recorded(tuple(driven.joints), told, noisy(rng, driven(0.3 + STRIDES * t)))
        stride = find_stride(seen, driven.by_leg, NETWORKS[name], driven.cells, driven.gains)
        for leg in inside:
            error = (stride.phases[leg] - truth[leg] + 0.5) % 1.0 - 0.5
            inside[leg] += abs(error) <= stride.scatter[leg].half_width
            off[leg].append(error / stride.scatter[leg].error)
    log(f'{name} {gait} phases: {inside} of {SEEDS} inside')
    return {'inside': {leg: count / SEEDS for leg, count in inside.items()},
            'error_over_stderr': {leg: float(np.sqrt(np.mean(np.square(each))))
                                  for leg, each in off.items()}}


def drawn(name: str, runs: int, seed: int) -> Iterator[tuple]:
    """Yield rng, preset, true numbers and the orbit, where there is one.

    The numbers are the free parameters by name, or the phases of the legs where these are stated.
    """
    gaits = [gait for gait, preset in PRESETS[name].items() if preset.gait == gait]
    for run in range(runs):
        rng = np.random.default_rng([seed, run])
        preset = PRESETS[name][gaits[rng.integers(len(gaits))]]
        network = preset.network
        if network.offsets:
            first, *others = network.offsets.values()
            truth = {offset: getattr(network, offset) - getattr(network, first)
                     + rng.uniform(-0.05, 0.05) for offset in others}
            made = network.replace(**{first: 0.0}, **truth)
        else:
            numbers = free_numbers(network, preset.gait, network.free)
            values = [one.value(network) for one in numbers]
            values = [value * rng.uniform(0.9, 1.1) if value else rng.uniform(-0.1, 0.1)
                      for value in values]
            truth = {one.name: value for one, value in zip(numbers, values, strict=True)}
            made = with_values(network, numbers, values)
        try:
            orbit, _ = gait_of(preset, made)
        except CpgError:
            continue
        if network.offsets or not validate_orbit(orbit, preset.gait, NUM_HARMONICS):
            yield rng, preset, truth, orbit


def recorded(name: str, rng: np.random.Generator, orbit: object, noise: float, angles: Callable,
             stalls: str) -> tuple:
    """Return a recording, the joints of its legs, and their cells.

    In stalls samples are 'missing', or the pose in which the robot was held up is 'repeated'.
    """
    legs = next(iter(NETWORKS[name].legs.values()))
    cells = {f'{leg}_{joint}': cell for leg, own in legs.items()
             for joint, cell in zip(('hip', 'thigh', 'calf'), (own[0], own[0], own[-1]),
                                    strict=True)}
    times, fraction = np.arange(0.0, LASTING, 1.0 / RATE), rng.uniform(*STALLED)
    stalled = np.zeros(times.size, bool)
    while stalls and stalled.mean() < fraction:
        begin = rng.integers(times.size)
        stalled[begin:begin + int(RATE * rng.uniform(*STALL))] = True
    steps = np.where(stalled & (stalls == 'repeated'), 0.0, STRIDES / RATE)
    weights = np.tile(weights_of(3, 3, int(rng.integers(1 << 30))), (len(legs), 1))
    clean = angles(orbit, tuple(cells.values()), weights, rng.random() + np.cumsum(steps)).T
    seen = noisy(rng, 0.1 + clean, noise)
    there = ~stalled if stalls == 'missing' else np.full(times.size, True)
    by_leg = {leg: tuple(joint for joint in cells if joint.startswith(leg)) for leg in legs}
    return Recorded(tuple(cells), times[there], seen[there]), by_leg, cells


def misread_covered(name: str, which: str, runs: int, seed: int) -> dict[str, object]:
    """Count the truths inside of recordings that are made otherwise than the fit assumes."""
    noise, angles, order, stalls = READOUTS[which]
    inside = total = open_ends = none = 0
    began = time.process_time()
    for rng, preset, truth, orbit in drawn(name, runs, seed):
        try:
            if stalls or preset.network.offsets:
                seen, by_leg, cells = recorded(name, rng, orbit, noise, angles, stalls)
                cycle = find_stride(seen, by_leg, NETWORKS[name], cells)
            else:
                joints = JOINTS.get(name, QUADRUPED)
                cycle, cells = record(orbit, joints, weights_of(len(joints), 3, int(rng.integers(
                    1 << 30))), rng, noise=noise, jitter=0.0, dropouts=0.0, angles=angles)
            if preset.network.offsets:
                found = {preset.network.offsets[leg]: (
                    cycle.phases[leg] - scatter.half_width,
                    cycle.phases[leg] + scatter.half_width, True)
                         for leg, scatter in list(cycle.scatter.items())[1:]}
            else:
                fit, _ = fit_with_fallbacks(cycle, cells, preset.network, preset.gait,
                                            order=order)
                found = {key: (one.low, one.high, one.bounded)
                         for key, one in fit.parameters.items() if key in truth}
        except CpgError:
            none += 1
            continue
        for key, (low, high, bounded) in found.items():
            # Phases are the same a whole cycle on.
            value = truth[key] + (np.round(0.5 * (low + high) - truth[key])
                                  if preset.network.offsets else 0.0)
            total += 1
            inside += bool(low <= value <= high)
            open_ends += not bounded
    low, high = binomtest(inside, max(total, 1)).proportion_ci(0.95, 'wilson')
    log(f'{name} {which}: {inside} of {total} inside ({low:.0%} to {high:.0%}), {open_ends} not '
        f'bounded, {none} not fitted, {time.process_time() - began:.1f} s')
    return {'inside': inside, 'intervals': total, 'wilson': [low, high], 'unbounded': open_ends,
            'not_fitted': none}


def generated_covered(seeds: range, only: str = '') -> dict[str, object]:
    """Count the truths inside of what the generator publishes of everything shipped."""
    inside = total = unbounded = none = 0
    missed: dict[str, int] = {}
    for robot, network, gait in walks():
        if only not in f'{robot} {network} {gait}':
            continue
        preset, began, held = NETWORKS[network].presets()[gait].network, time.process_time(), []
        for seed in seeds:
            try:
                fit = fit_recording(generated(robot, network, gait, seed), load_robot(robot),
                                    network, gait).fit
            except CpgError as error:
                none += 1
                log(f'{robot} {network} {gait} seed {seed}: {error}')
                continue
            truth = {**preset.as_dict(), GAIT_DUTY: load_robot(robot).motion(gait, gait).duty}
            for name in fit.free:
                one = fit.parameters[name]
                value = truth[preset.groups.get(name, (name,))[0]] if name != GAIT_DUTY else (
                    truth[name])
                held.append(value is not None and one.low <= value <= one.high)
                unbounded += not one.bounded
                if not held[-1]:
                    key = f'{robot} {network} {gait} {name}'
                    missed[key] = missed.get(key, 0) + 1
                    log(f'{key} seed {seed}: {value} not in {one.low:.6g} to {one.high:.6g}')
        inside, total = inside + sum(held), total + len(held)
        log(f'{robot} {network} {gait}: {sum(held)} of {len(held)} inside, '
            f'{time.process_time() - began:.2f} s; {inside} of {total} so far')
    return {'fits_failed': none, 'intervals': total, 'inside': inside / max(total, 1),
            'unbounded': unbounded, 'missed': missed}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--runs', type=int, default=240, help='of drawn parameters')
    parser.add_argument('--seed', type=int, default=1)
    parser.add_argument('--generator', nargs='?', const='', metavar='WORDS', help='only what the '
                        'generator publishes, of robots, networks and gaits with these words')
    parser.add_argument('--seeds', type=int, nargs=2, default=(0, GENERATED),
                        metavar=('FROM', 'TO'),
                        help='of the noise of what the generator publishes')
    parser.add_argument('--readouts', nargs='*', metavar='NETWORK', help='only drawn parameters '
                        'read otherwise than the fit does, of these networks or all')
    parser.add_argument('--which', nargs='+', choices=READOUTS, default=list(READOUTS),
                        metavar='READOUT', help='of the readouts: '
                        + ', '.join(READOUTS).replace('%', '%%'))
    given = parser.parse_args()
    if given.readouts is not None:
        emit(benchmark='truth', seed=given.seed, readouts={
            f'{name} {which}': misread_covered(name, which, given.runs, given.seed)
            for which in given.which for name in given.readouts or DRAWN})
        return
    seeds = range(*given.seeds)
    if given.generator is not None:
        emit(benchmark='truth', generator=generated_covered(seeds, given.generator))
        return
    random = {f'{name} {which}': misread_covered(name, which, given.runs, given.seed)
              for which in ('exact', 'samples missing', 'poses repeated') for name in DRAWN}
    found = {f'{case[0]} {case[1]} order {case[2]}': covered(*case) for case in CASES}
    found |= {f'{name} {gait} phases': phases_covered(name, gait) for name, gait in STATED}
    worst = min(fraction for case in found.values() for fraction in case['inside'].values())
    generator = generated_covered(seeds)
    emit(benchmark='truth', seeds=SEEDS, cases=found, worst=worst, target=GOAL, seed=given.seed,
         drawn=random, generator=generator,
         passed=min(worst, generator['inside']) >= GOAL and not generator['fits_failed'])


if __name__ == '__main__':
    main()
