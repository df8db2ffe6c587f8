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

"""Unitree's own simulator bridge as the robot, headless: run by Python 3.10 with cyclonedds 0.10.

usage: python unitree_sdk_robot.py FOLDER DOMAIN INTERFACE ROBOT    FOLDER has unitree_mujoco and
unitree_sdk2_python as fetched; ROBOT is go2, or g1, which hangs in a rack. Prints a line of JSON
every second, and at the end.
"""

import json
import math
from pathlib import Path
import sys
import threading
import time

folder, domain, interface = Path(sys.argv[1]), int(sys.argv[2]), sys.argv[3]
humanoid = sys.argv[4] == 'g1'
sys.path[:0] = [str(folder / 'unitree_sdk2_python'),
                str(folder / 'unitree_mujoco' / 'simulate_python')]

import mujoco  # noqa: E402

import config  # noqa: E402

config.ROBOT = sys.argv[4]
from unitree_sdk2py.core.channel import (  # noqa: E402
    ChannelFactoryInitialize,
    ChannelSubscriber,
)
from unitree_sdk2py.utils.crc import CRC  # noqa: E402
from unitree_sdk2py_bridge import LowCmd_, UnitreeSdk2Bridge  # noqa: E402

DT = 0.002
#: As it lies on its belly, rad: hip, thigh, calf of each leg.
LYING = (0.0, 1.36, -2.65)


def model():
    """Their robot on their floor, without stairs and pictures."""
    path = folder / 'unitree_mujoco' / 'unitree_robots' / config.ROBOT / (
        'scene_29dof.xml' if humanoid else 'scene.xml')
    spec = mujoco.MjSpec.from_file(str(path))
    for geom in list(spec.geoms):
        if geom.type == mujoco.mjtGeom.mjGEOM_MESH or (
                geom.type == mujoco.mjtGeom.mjGEOM_BOX and geom.parent == spec.worldbody):
            spec.delete(geom)
    for mesh in list(spec.meshes):
        spec.delete(mesh)
    spec.option.timestep = DT
    return spec.compile()


seen = {'commands': 0, 'wrong': 0, 'states': 0}
crc = CRC()


def checked(command):
    seen['commands'] += 1
    seen['wrong'] += crc.Crc(command) != command.crc


class Bridge(UnitreeSdk2Bridge):
    """Theirs, counting."""

    def PublishLowState(self):
        seen['states'] += 1
        super().PublishLowState()


def main():
    world = model()
    data = mujoco.MjData(world)
    if not humanoid:
        data.qpos[7:] = LYING * 4
    data.qpos[2] = 1.5 if humanoid else 0.12
    place = data.qpos[:7].copy()
    mujoco.mj_forward(world, data)
    ChannelFactoryInitialize(domain, interface)
    bridge = Bridge(world, data)
    subscriber = ChannelSubscriber('rt/lowcmd', LowCmd_)
    subscriber.Init(checked, 100)
    ending = threading.Event()
    threading.Thread(target=lambda: (sys.stdin.read(), ending.set()), daemon=True).start()
    due, told, before, slow = time.perf_counter(), time.perf_counter(), dict(seen), 0
    # Of the fourth joint, the knee of a G1, within a second, rad.
    fallen, low, high = 0, math.inf, -math.inf
    while not ending.is_set():
        due += DT
        if (wait := due - time.perf_counter()) > 0:
            time.sleep(wait)
        elif wait < -0.05:
            slow += 1
            due = time.perf_counter()
        mujoco.mj_step(world, data)
        if humanoid:
            data.qpos[:7], data.qvel[:6] = place, 0.0
        knee = float(data.qpos[10])
        low, high = min(low, knee), max(high, knee)
        x, y = data.qpos[4:6]
        lean = math.degrees(math.acos(max(-1.0, 1 - 2 * (x * x + y * y))))
        fallen += lean > 60.0
        if (now := time.perf_counter()) - told > 1.0:
            rates = {key: round((seen[key] - before[key]) / (now - told), 1) for key in seen}
            told, before = now, dict(seen)
            swing, low, high = high - low, knee, knee
            print(json.dumps({
                'time': round(data.time, 2), 'rates': rates, 'wrong': seen['wrong'],
                'commands': seen['commands'], 'x': round(float(data.qpos[0]), 3),
                'y': round(float(data.qpos[1]), 3),
                'height': round(float(data.qpos[2]), 3), 'lean': round(lean, 1),
                'swing': round(swing, 3),
                'torque': round(float(abs(data.ctrl).max()), 2), 'slow': slow,
                'fallen': fallen}), flush=True)
    del bridge


main()
