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

"""Faults of the sensors of a walking humanoid, in process: what becomes of it, limits crossed.

Every fault of ``test/support/sensor_faults.py``, as messages that the generator's own input reads,
in a walk at 0.3 m/s from 1 s on, with 4 ms of delay and the noise of bench_humanoid. Faults that
begin in the walk do so at 3 s and a fifth of a stride later with each seed. A run ends 2.5 s after
the fault, or at 6.5 s if it lasts, in a 'walk', a 'stand', a 'crouch', or a 'fall':
the base leans by more than 60 degrees or lies on the floor at any time.

usage: bench_humanoid_faults.py [--robot humanoid] [--seeds 5] [--first-seed 0] [--only NAME]
                                [--jobs 2]
"""

import argparse
from collections import Counter
from concurrent.futures import ProcessPoolExecutor
import math
import multiprocessing
import sys

from common import emit, log, ROOT

sys.path.insert(0, str(ROOT / 'test' / 'support'))
from humanoid_under_fault import HumanoidUnderFault  # noqa: E402
from sensor_faults import FAULTS  # noqa: E402

#: When a fault begins, s; a fifth of a stride at 1.65 Hz; how long a run takes after a fault that
#: ends, and with one that lasts.
BEGINS, FIFTH, AFTER, LASTS = 3.0, 0.2 / 1.65, 2.5, 6.5


def measure(job: tuple[str, str, int]) -> tuple[str, str, int]:
    robot, fault, seed = job
    humanoid = HumanoidUnderFault(fault, seed, name=robot, begins=BEGINS + seed % 5 * FIFTH)
    ends = humanoid.faults.ends
    return fault, humanoid.run(LASTS if math.isinf(ends) else ends + AFTER), humanoid.crossed


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--robot', default='humanoid')
    parser.add_argument('--seeds', type=int, default=5)
    parser.add_argument('--first-seed', type=int, default=0)
    parser.add_argument('--only', default='', help='faults with this in their names')
    parser.add_argument('--jobs', type=int, default=2)
    given = parser.parse_args()
    jobs = [(given.robot, fault, seed) for fault in FAULTS if given.only in fault
            for seed in range(given.first_seed, given.first_seed + given.seeds)]
    found: dict[str, Counter[str]] = {fault: Counter() for _, fault, _ in jobs}
    crossed: Counter[str] = Counter()
    with ProcessPoolExecutor(given.jobs, multiprocessing.get_context('spawn')) as pool:
        for fault, end, count in pool.map(measure, jobs):
            found[fault][end] += 1
            crossed[fault] += count
            if sum(found[fault].values()) == given.seeds:
                log(f'{fault}: {dict(found[fault])}, {crossed[fault]} limits crossed')
    emit(benchmark='humanoid_faults', robot=given.robot, seeds=given.seeds,
         first_seed=given.first_seed,
         **{fault: {**ends, 'crossed': crossed[fault]} for fault, ends in found.items()},
         passed=not any(crossed.values()))


if __name__ == '__main__':
    main()
