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

"""The simulated robot beside the generator in real time, and bare MuJoCo in the same run.

robot_sim at 500 Hz takes the generator's commands by leg for 20 s: the real-time factor that it
holds, how late its control periods begin, counted from their deadlines, and the CPU time of both
nodes. Lockstep: how many periods a second the two manage as fast as they can. The peer is a loop
over MuJoCo's own mj_step with the same model and commands, without ROS.
"""

import argparse
from pathlib import Path
import re
import sys
import tempfile
import time

from common import emit, log, ROOT
import numpy as np
from processes import enter_workspace, GENERATOR, Process

SIM = str(ROOT / 'install/cpg_ros/lib/cpg_ros/robot_sim')
RATE = 500.0
TARGETS = {'real_time_factor_error': 0.01}
#: The node with its periods' delays kept: a line on standard output at its end.
MEASURED = """
import sys
from cpg_ros.ros.node import ticker
from cpg_ros.ros.robot_sim import main
delays, handle = [], ticker.Ticker._handle
def noted(self, event):
    delays.append(self.loop.behind)
    handle(self, event)
ticker.Ticker._handle = noted
code = main(sys.argv[1:])
import numpy
print('late', *numpy.percentile(numpy.array(delays[500:]) * 1e-3, [50, 99, 99.9]), flush=True)
sys.exit(code)
"""


def bare(robot: str, seconds: float) -> float:
    """Return the steps a second of MuJoCo alone, marching on the spot."""
    from cpg_ros.motion.robot_file import load_robot
    from cpg_ros.simulation.body import Body
    import mujoco
    body = Body('go2', load_robot(robot))
    offsets, step, data = body.stand, mujoco.mj_step, body.data
    swing = np.tile([0.0, 0.1, -0.2], 4) * np.repeat([1, -1, -1, 1], 3)
    began, steps = time.perf_counter(), round(seconds * RATE)
    for k in range(steps):
        data.ctrl[:] = offsets + np.sin(0.03 * k) * swing
        step(body.model, data)
    return steps / (time.perf_counter() - began)


def generator(robot: str, **more: object) -> Process:
    return Process(GENERATOR, robot=robot, rate=RATE, frequency=2.5, combined_topic="''", **more)


def summary(output: str) -> dict[str, float | str]:
    found = re.search(r'([\d.]+) m from the start.*(upright|fallen), ([\d.]+) times', output)
    if found is None:
        raise RuntimeError(f'no summary from robot_sim:\n{output}')
    return {'distance_m': float(found[1]), 'posture': found[2],
            'real_time_factor': float(found[3])}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--seconds', type=float, default=20.0)
    parser.add_argument('--robot', default='unitree_go2')
    arguments = parser.parse_args()
    enter_workspace()
    seconds, robot = arguments.seconds, arguments.robot

    with tempfile.TemporaryDirectory() as folder:
        script = Path(folder) / 'measured.py'
        script.write_text(MEASURED)
        log(f'real time: {seconds:.0f} s')
        with (generator(robot).wait_for('publishing') as rhythm,
              Process([sys.executable, str(script)], robot=robot) as sim):
            sim.wait_for('simulating')
            time.sleep(1.0)
            before, began = (rhythm.cpu_s(), sim.cpu_s()), time.monotonic()
            time.sleep(seconds)
            spent = time.monotonic() - began
            cpu = {'generator': 100.0 * (rhythm.cpu_s() - before[0]) / spent,
                   'robot_sim': 100.0 * (sim.cpu_s() - before[1]) / spent}
            sim.end()
            real = summary(sim.output)
            p50, p99, p999 = map(float, re.search(
                r'late ([\d.e+-]+) ([\d.e+-]+) ([\d.e+-]+)', sim.output).groups())  # type: ignore
    log(f'lockstep: {seconds:.0f} s of simulated time')
    with (generator(robot, use_sim_time=True).wait_for('publishing'),
          Process([SIM], robot=robot, real_time_factor=0.0, duration=seconds) as sim):
        sim.wait(20.0 * seconds + 60.0)
        lockstep = summary(sim.output)
    alone = bare(robot, seconds)
    error = abs(float(real['real_time_factor']) - 1.0)
    emit(benchmark='robot_sim', rate=RATE, seconds=seconds, **real,
         period_late_us={'p50': p50, 'p99': p99, 'p99.9': p999}, cpu_percent=cpu,
         lockstep_periods_per_s=RATE * float(lockstep['real_time_factor']),
         mujoco_alone_steps_per_s=alone, targets=TARGETS,
         passed=error <= TARGETS['real_time_factor_error'] and real['posture'] == 'upright')


if __name__ == '__main__':
    main()
