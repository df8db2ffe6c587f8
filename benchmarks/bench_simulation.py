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

"""Simulation against jitcdde, at equal error, and against the same method written in C.

Example 1 of Liu & Zhang (the walk) for 20 time units, output every 0.01, at most 1e-6 wrong at
the end. jitcdde runs the fastest of its ways with the loosest setting that is good enough: either
adaptive, stepping on the discontinuities, or with fixed steps (a tiny first one, because it takes
the slope of the constant history for the first stage otherwise). The batch is 64 starts in the
walk's symmetry class, where rounding stays symmetric in both and nothing unstable can grow.
Compilation counts for neither.
"""

import os
import subprocess
import sys
import tempfile

from common import by_turns, emit, log, ROOT
from cpg_ros.dynamics.integration.simulate import simulate
from cpg_ros.networks.library.delayed import Delayed
import numpy as np
from peers import A, B, C, D, END, InC, Jitcdde, OUTPUT, START, TAU

ERROR = 1e-6
NETWORK = Delayed(A, B, C, D, TAU)
TARGETS = {'speedup_single': 20.0, 'speedup_batch_per_trajectory': 60.0, 'ratio_to_c': 1.5}
ROUNDS = 15


def walk_starts(count: int) -> np.ndarray:
    """Constant histories in the walk's class: x_{s(i)} = x_{i+4} = -x_i."""
    rng = np.random.default_rng(1)
    radius, angle = rng.uniform(0.05, 0.25, count), rng.uniform(0.0, 2.0 * np.pi, count)
    u, v = radius * np.cos(angle), radius * np.sin(angle)
    return np.stack([u, -u, v, -v, -u, u, -v, v], axis=1)


def ours(start: np.ndarray, step: float) -> np.ndarray:
    """States at the output times, shape (..., times, cells); the step divides OUTPUT."""
    every = round(OUTPUT / step)
    return simulate(NETWORK, start, END, step, progress=False).x[..., every::every, :]


def class_drift(x: np.ndarray) -> float:
    """How far a walk is from its symmetry class: rounding that differs by cell would grow."""
    return max(float(np.abs(x[..., ::2] + x[..., 1::2]).max()),
               float(np.abs(x[..., :4] + x[..., 4:]).max()))


def error(run, setting: float, starts: np.ndarray, ends: np.ndarray) -> float:
    return max(np.abs(run(start, setting)[-1] - end).max()
               for start, end in zip(starts, ends, strict=True))


def loosest(run, settings: list[float], starts: np.ndarray, ends: np.ndarray) -> float:
    """First of the settings, from loose to tight, that is good enough from all the starts."""
    return next(s for s in settings if error(run, s, starts, ends) <= ERROR)


def compile_ours() -> float:
    """Seconds to compile what this benchmark uses, in a new process with an empty cache."""
    code = ('import sys, time; sys.path.append(sys.argv[1]); import bench_simulation as b; '
            'began = time.perf_counter(); b.ours(b.START, 0.01); b.ours(b.walk_starts(9), 0.01);'
            'print(time.perf_counter() - began)')
    with tempfile.TemporaryDirectory() as folder:
        return float(subprocess.run(
            [sys.executable, '-c', code, str(ROOT / 'benchmarks')], check=True, text=True,
            stdout=subprocess.PIPE, env={**os.environ, 'NUMBA_CACHE_DIR': folder}).stdout)


def main() -> None:
    log('compiling')
    compile_s, peer = compile_ours(), Jitcdde()
    starts = np.concatenate([START[None], walk_starts(64)])
    ends = ours(starts, TAU / 1280)[:, -1]
    check = error(peer.fixed, OUTPUT / 100, starts[:1], ends[:1])
    assert check < 1e-8, f'reference and jitcdde differ by {check}'
    few = slice(0, 5)
    with tempfile.TemporaryDirectory() as folder:
        in_c = [InC(folder), InC(folder, '-march=native')]

        log('choosing steps and tolerances')
        steps = [OUTPUT / m for m in range(1, 20)]
        step, batch_step = (loosest(ours, steps, starts[s], ends[s]) for s in (slice(1), few))
        while np.abs(ours(starts, batch_step)[:, -1] - ends).max() > ERROR:
            batch_step = OUTPUT / (round(OUTPUT / batch_step) + 1)
        rtols = [10.0 ** (-k / 4) for k in range(20, 40)]
        ways = {}
        for some, name in ((slice(1), 'one'), (few, 'each')):
            settings = {run: loosest(run, choice, starts[some], ends[some])
                        for run, choice in ((peer.adaptive, rtols), (peer.fixed, steps))}
            spent = by_turns({run: (lambda r=run, s=s: r(START, s), 1)
                              for run, s in settings.items()}, 5)
            run = min(spent, key=lambda r: spent[r]['best'])
            ways[name] = (run, settings[run])
        (run, setting), (run_each, setting_each) = ways['one'], ways['each']

        spent = by_turns({
            'jitcdde': (lambda: run(START, setting), 1), 'ours': (lambda: ours(START, step), 10),
            'c': (lambda: in_c[0](step), 5), 'c_native': (lambda: in_c[1](step), 5),
            'jitcdde_each': (lambda: [run_each(s, setting_each) for s in starts[few]], 1),
            'batch': (lambda: ours(starts[1:], batch_step), 2)}, ROUNDS)
        error_c = np.abs(in_c[0](step)[-1] - ends[0]).max()

    def ms(name: str, each: int = 1) -> list[float]:
        return [spent[name][key] / each for key in ('best', 'median')]
    ours_ms, jitcdde_ms = ms('ours'), ms('jitcdde')
    c_ms = min(ms('c'), ms('c_native'))
    ours_each, jitcdde_each = ms('batch', 64), ms('jitcdde_each', 5)
    figures = {'speedup_single': jitcdde_ms[0] / ours_ms[0],
               'speedup_batch_per_trajectory': jitcdde_each[0] / ours_each[0],
               'ratio_to_c': ours_ms[0] / c_ms[0]}
    errors = {'error_ours': error(ours, step, starts[:1], ends[:1]),
              'error_jitcdde': error(run, setting, starts[:1], ends[:1]),
              'error_batch_ours': np.abs(ours(starts[1:], batch_step)[:, -1] - ends[1:]).max(),
              'error_batch_jitcdde': error(run_each, setting_each, starts[few], ends[few])}
    emit(benchmark='simulation', jitcdde_ms=jitcdde_ms, ours_ms=ours_ms, c_ms=c_ms,
         batch_ms_per_trajectory=ours_each, jitcdde_batch_ms_per_trajectory=jitcdde_each,
         **figures, **errors, error_c=error_c, reference_cross_check=check,
         class_drift_ours=class_drift(ours(starts, batch_step)),
         class_drift_jitcdde=max(class_drift(run_each(s, setting_each)) for s in starts[few]),
         step_ours=[step, batch_step], jitcdde=[[run.__name__, setting],
                                                [run_each.__name__, setting_each]],
         compile_s_ours=compile_s, compile_s_jitcdde=peer.compile_s, cores=os.cpu_count(),
         targets=TARGETS,
         passed=all(value <= ERROR for value in errors.values()) and all(
             figures[key] <= goal if key == 'ratio_to_c' else figures[key] >= goal
             for key, goal in TARGETS.items()))


if __name__ == '__main__':
    main()
