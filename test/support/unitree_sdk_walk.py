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

"""The generator and the bridge walk Unitree's simulated robot, in a network namespace of its own.

usage: unshare --net python unitree_sdk_walk.py FOLDER [SECONDS_A_GAIT SECONDS_A_SWITCH [ROBOT]]
ROBOT is go2, or g1, which hangs in a rack and has one gait. Prints JSON: what the robot saw.
"""

import json
import math
import os
from pathlib import Path
import signal
import subprocess
import sys
import threading
import time

folder = Path(sys.argv[1]).resolve()
GAIT, SWITCH = map(float, sys.argv[2:4] or ('10', '3'))
ROBOT = sys.argv[4] if len(sys.argv) > 4 else 'go2'
os.environ.update(ROS_AUTOMATIC_DISCOVERY_RANGE='SUBNET', ROS_DOMAIN_ID='1')
os.environ.pop('FASTRTPS_DEFAULT_PROFILES_FILE', None)
for words in ('link set lo up', 'link set lo multicast on', 'route add 224.0.0.0/4 dev lo'):
    subprocess.run(['ip', *words.split()], check=True)

from graph import EXECUTABLE, Process, until, Watcher  # noqa: E402
from rclpy.qos import DurabilityPolicy, QoSProfile  # noqa: E402
from std_msgs.msg import String  # noqa: E402
from std_srvs.srv import Trigger  # noqa: E402

GAITS = ('walk',) if ROBOT == 'g1' else ('trot', 'walk', 'pace', 'bound', 'jump', 'pronk')
SUBNET = {'ROS_AUTOMATIC_DISCOVERY_RANGE': 'SUBNET', 'ROS_PYTHON_CHECK_FIELDS': '0'}


def switches():
    """All 30 switches as one way from the first gait back to it (Hierholzer's)."""
    left = {gait: [one for one in GAITS if one != gait] for gait in GAITS}
    open_, way = [GAITS[0]], []
    while open_:
        if left[open_[-1]]:
            open_.append(left[open_[-1]].pop())
        else:
            way.append(open_.pop())
    return way[-2::-1]


def process(name, *parameters):
    return Process(*(word for one in parameters for word in ('-p', one)), domain=1,
                   executable=EXECUTABLE.with_name(name), environment=SUBNET)


clean = {key: value for key, value in os.environ.items() if key in ('HOME', 'PATH')}
robot = subprocess.Popen(
    [folder / 'venv/bin/python', Path(__file__).with_name('unitree_sdk_robot.py'), folder, '1',
     'lo', ROBOT], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, env=clean)
seen = []


def read():
    for line in robot.stdout:
        if line.startswith('{'):
            seen.append(json.loads(line))


threading.Thread(target=read, daemon=True).start()
generator = process('generator', f'robot:=unitree_{ROBOT}',
                    'network:=' + ('biped' if ROBOT == 'g1' else 'delayed'), 'rate:=500.0',
                    "combined_topic:=''", 'feedback.enabled:=false',
                    'command:=forward_position', 'assume_stand:=true', f'gait:={GAITS[0]}')
bridge = process('unitree_bridge', f'model:={ROBOT}', f'robot:=unitree_{ROBOT}',
                 'command:=forward_position', 'motion_switcher:=false', 'state_timeout:=0.2',
                 # Their simulator keeps the last command's torque: light limbs need low gains.
                 *(('kp:=[40.0]', 'kd:=[1.0]') if ROBOT == 'g1' else ()))
watcher = Watcher(1)
states = []
watcher.node.create_subscription(
    String, '/unitree_bridge/state', lambda message: states.append(message.data),
    QoSProfile(depth=10, durability=DurabilityPolicy.TRANSIENT_LOCAL))
result = {'gaits': {}}
try:
    if ROBOT == 'g1':
        until(lambda: 'hanging' in states or 'damping' in states, 'hanging')
        time.sleep(1.0)
        watcher.call(Trigger, '/unitree_bridge/start', Trigger.Request())
    until(lambda: 'following' in states or 'damping' in states, 'following')
    time.sleep(2.0)
    for gait in GAITS:
        answer, = watcher.set(gait=gait)
        assert answer.successful, answer.reason
        time.sleep(2.0)
        first = len(seen)
        time.sleep(GAIT)
        rows = seen[first:]
        result['gaits'][gait] = {
            'distance': round(math.dist(*((one['x'], one['y'])
                                          for one in (rows[0], rows[-1]))), 2),
            'most lean': max(row['lean'] for row in rows),
            'least height': min(row['height'] for row in rows)}
    watcher.set(gait=GAITS[0])
    time.sleep(3.0)
    done = 0
    for gait in switches() if len(GAITS) > 1 else ():
        done += watcher.set(gait=gait)[0].successful
        time.sleep(SWITCH)
        if states[-1] != 'following':
            break
    result['switches'] = done
    result['state at the end'] = states[-1]
    bridge.signal(signal.SIGINT)
    bridge.wait()
    time.sleep(1.5)
except AssertionError:
    print(bridge.log, seen[-3:], sep='\n', file=sys.stderr)
    raise
finally:
    for one in (generator, bridge, watcher):
        one.end()
    robot.stdin.close()
    robot.terminate()
walking = seen[3:]
result |= {'states': states, 'last': seen[-1], 'wrong': seen[-1]['wrong'],
           'commands': seen[-1]['commands'],
           'states a second': [f(row['rates']['states'] for row in walking) for f in (min, max)],
           'commands a second': [f(row['rates']['commands'] for row in walking)
                                 for f in (min, max)],
           'largest swing': max(row['swing'] for row in rows),
           'largest torque': max(row['torque'] for row in seen), 'fallen': seen[-1]['fallen'],
           'log': bridge.log.splitlines()[-6:]}
print(json.dumps(result))
