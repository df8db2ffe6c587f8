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

"""Points of branches against AUTO-07p and DDE-BIFTOOL, each where it is installed.

AUTO (Debian: auto-07p and gfortran) follows the quadruped's pace along alpha=beta with ntst 60,
ncol 4, EPSL 1e-9, multipliers and detection in it; so have ours, at 1e-11. DDE-BIFTOOL (Octave,
and its public repository in the folder that DDE_BIFTOOL names) follows the delayed trot and walk
reduced by symmetry to one and two equations, its best case, with degree 8 on 20 intervals.
Processor time in all of them, the peer's by its own count. Where one is missing, the line says so.
"""

import os
from pathlib import Path
import shutil
import subprocess
import tempfile
import time

from common import emit, log, ROOT
from cpg_ros.dynamics.continuation import bifurcations, Branch, continue_orbit
from cpg_ros.dynamics.floquet import multipliers
from cpg_ros.dynamics.solve_orbit import solve_orbit, solve_preset
from cpg_ros.networks.library.delayed import Delayed
from cpg_ros.networks.library.quadruped import Quadruped
from cpg_ros.networks.network import ParameterLine
from cpg_ros.networks.registry import PRESETS
import numpy as np

#: Preset, ends of the range, and values at which periods are compared.
RUNS = {'pace': ((-1.0, 0.55), (0.3, 0.4, 0.5)), 'pronk': ((-1.0, 0.345), (0.1, 0.3))}
TARGETS = {'ratio_auto': 2.0, 'period_difference_auto': 1e-7, 'ratio_dde_biftool': 300.0}


def output_rows(command: list[str], folder: Path) -> list[list[str]]:
    """Words of the lines that begin with RESULT."""
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=True)
    return [line.split()[1:] for line in done.stdout.splitlines() if line.startswith('RESULT')]


def ours(preset: str, low: float, high: float) -> tuple[Branch, float]:
    """Return the branch, and processor time of a point, its multipliers and detection in ms."""
    orbit, line = solve_preset(PRESETS['quadruped'][preset]), ParameterLine.parse(
        'alpha=beta', Quadruped)
    for _ in range(2):
        # The first time compiles, or loads what was compiled.
        began = time.process_time()
        branch = continue_orbit(orbit, line, low, high, most=60)
        judged = [multipliers(point.orbit) for point in branch.points]
        bifurcations(branch, judged)
        spent = time.process_time() - began
    return branch, 1e3 * spent / len(branch.points)


def auto() -> dict[str, object]:
    """Ratios and differences of periods, preset by preset, or why not."""
    if not shutil.which('autox') or not shutil.which('gfortran'):
        return {'skipped': 'AUTO-07p is not installed (Debian: auto-07p, gfortran)'}
    rows: dict[str, object] = {}
    for preset, ((low, high), values) in RUNS.items():
        branch, mine = ours(preset, low, high)
        known = PRESETS['quadruped'][preset]
        orbit = solve_preset(known)
        with tempfile.TemporaryDirectory() as name:
            folder = Path(name)
            for file in (ROOT / 'benchmarks' / 'auto07p').iterdir():
                shutil.copy(file, folder)
            theta = np.linspace(0.0, 1.0, 401)
            np.savetxt(folder / 'start.dat', np.column_stack([
                theta * orbit.period, orbit(theta * orbit.period)]), fmt='%.15g')
            found = output_rows(['autox', 'branch.py', 'start', f'{low},{high}',
                          ','.join(map(str, values)),
                          ','.join(map(str, known.network.as_dict().values())),
                          str(known.network.alpha)], folder)
        count = sum(int(row[1]) for row in found if row[0] == 'points')
        peer = 1e3 * sum(float(row[2]) for row in found if row[0] == 'points') / count
        apart = []
        for value in values:
            periods = [float(row[2]) for row in found
                       if row[0] == 'UZ' and abs(float(row[1]) - value) < 1e-8]
            own = [orbit.period for orbit in branch.at(value)]
            apart += [min(abs(one / other - 1.0) for other in own) for one in periods]
        rows[preset] = {'ours_ms': mine, 'auto_ms': peer, 'ratio': peer / mine,
                        'points': len(branch.points), 'auto_points': count,
                        'period_difference': max(apart, default=float('nan'))}
        log(f'{preset}: {rows[preset]}')
    return rows


def dde_biftool() -> dict[str, object]:
    """Return the same against DDE-BIFTOOL."""
    place = os.environ.get('DDE_BIFTOOL', '')
    if not shutil.which('octave-cli'):
        return {'skipped': 'Octave is not installed (Debian: octave)'}
    if not Path(place, 'ddebiftool').is_dir():
        return {'skipped': 'DDE_BIFTOOL names no folder with DDE-BIFTOOL in it'}
    rows: dict[str, object] = {}
    for gait, count, peer, period in output_rows(
            ['octave-cli', '--norc', 'reduced.m'], ROOT / 'benchmarks' / 'dde_biftool'):
        orbit = solve_orbit(Delayed(-4.5, 1.0, 6.5, -2.0, 0.4), gait)
        line = ParameterLine.parse('tau', Delayed)
        times = []
        for _ in range(5):
            began = time.process_time()
            branch = continue_orbit(orbit, line, 0.2, 0.5)
            times.append((time.process_time() - began) / len(branch.points))
        rows[gait] = {'ours_ms': 1e3 * min(times), 'dde_biftool_ms': float(peer),
                      'ratio': float(peer) / (1e3 * min(times)), 'points': len(branch.points),
                      'dde_biftool_points': int(count),
                      'period_difference': abs(float(period) / orbit.period - 1.0)}
    return rows


def main() -> None:
    by_auto, by_dde = auto(), dde_biftool()

    def least(rows: dict, key: str, worst=min) -> float | None:
        return None if 'skipped' in rows else worst(row[key] for row in rows.values())

    ratio, delayed = least(by_auto, 'ratio'), least(by_dde, 'ratio')
    apart = least(by_auto, 'period_difference', max)
    emit(benchmark='peers', ratio_auto=ratio, period_difference_auto=apart,
         ratio_dde_biftool=delayed, auto=by_auto, dde_biftool=by_dde, targets=TARGETS,
         passed=((ratio is None or ratio >= TARGETS['ratio_auto'])
                 and (apart is None or apart <= TARGETS['period_difference_auto'])
                 and (delayed is None or delayed >= TARGETS['ratio_dde_biftool'])))


if __name__ == '__main__':
    main()
