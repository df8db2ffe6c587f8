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

"""The Go2's trot, pushed over the graph and in process: the same share has to stay on its feet.

Over the graph generator and robot_sim are processes of their own, in lockstep at 500 Hz, and all
that is measured and commanded is messages, the servos' gains among them; after a fall the robot
is put on its feet. In process the batch simulation takes the same steps. Pushes last 0.1 s, at a
wish of 0.4 m/s, from 12 directions at any phase of the stride; shares agree if their 95 %
intervals (Wilson's, of 40 and of 96 pushes) overlap.
"""

import argparse
import math

from bench_feedback import MODEL, ROBOT
from common import emit, log
from cpg_ros.feedback.gains import robot_gains
from cpg_ros.motion.robot_file import read_robot
from cpg_ros.simulation.scenario import PUSH_DURATION
from feedback_figures import interval, pushes, subject
import numpy as np
from processes import enter_workspace
import rclpy
from stage import Stage

SPEED, LOW = 0.4, 0.15
#: Until it walks as it does; from a push until it counts, as in process; to walk on from there, s.
WALKS, AFTER, ON = 4.0, 2.5, 1.5


def over_the_graph(size: float, count: int, seed: int) -> float:
    """Return the fraction of pushes, N s, that are survived."""
    rng, survived = np.random.default_rng(seed), 0
    stage = Stage('unitree_go2', 'delayed', LOW, model=MODEL)
    try:
        stage.spend(1.0)
        stage.drive(SPEED)
        stage.spend(WALKS)
        for k in range(count):
            angle = 2.0 * math.pi * (k % 12 + rng.uniform()) / 12
            stage.drive(SPEED)
            stage.spend(ON + rng.uniform(0.0, 0.5))
            force = size / PUSH_DURATION
            stage.push(force * math.cos(angle), force * math.sin(angle))
            stage.spend(PUSH_DURATION + AFTER)
            survived += stage.upright
            if not stage.upright:
                stage.stand_up()
                stage.spend(1.0)
                stage.drive(SPEED)
                stage.spend(WALKS)
        return survived / count
    finally:
        stage.end()


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--impulses', type=float, nargs='+', default=[48.0, 60.0, 72.0])
    parser.add_argument('--count', type=int, default=40)
    parser.add_argument('--seed', type=int, default=1)
    given = parser.parse_args()
    enter_workspace()
    rclpy.init()
    found, agree = {}, []
    for size in given.impulses:
        one = subject(ROBOT, 'trot', robot_gains(read_robot(ROBOT)), given.seed, False,
                      model=MODEL)
        batch = float(pushes(one, [size])['survived'][f'{size:g}'])
        graph = over_the_graph(size, given.count, given.seed)
        within = interval(batch, 96), interval(graph, given.count)
        agree.append(within[0][0] <= within[1][1] and within[1][0] <= within[0][1])
        found[f'{size:g}'] = {'in_process': batch, 'over_the_graph': graph,
                              'intervals_95': within}
        log(f'{size:g} N s: {found[f"{size:g}"]}')
    emit(benchmark='pushes_live', seed=given.seed, count=given.count, survived=found,
         target='intervals overlap', passed=all(agree))


if __name__ == '__main__':
    main()
