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

"""A robot whose gaits have motions of their own and can be steered, for tests."""

import copy
from pathlib import Path

import yaml

CONFIG = Path(__file__).resolve().parents[2] / 'config'
#: Swing, bend; x and y of a leg's cell. In place the thigh stands still and the calf lifts.
STEERING = {'speed': [-0.2, 0.0, 0.4], 'stride': [-0.6, -0.1, 0.9],
            'frequency': [1.5, 1.0, 2.0], 'turn': [0.5, 0.5, 1.0]}


def tree() -> dict:
    """Return the generic quadruped's file with motions for trot (steered), walk and pace."""
    made = yaml.safe_load((CONFIG / 'quadruped.yaml').read_text())
    names = [joint['name'] for leg in made['legs'].values() for joint in leg['joints']]
    joints = {}
    for name in names:
        if 'thigh' in name:
            joints[name] = {'offset': 0.9, 'weights': [-0.2, 0.05, 0.02, 0.0]}
        elif 'calf' in name:
            joints[name] = {'offset': -1.6, 'weights': [0.0, -0.25, 0.1, 0.05, 0.02, 0.01],
                            'in_place': [0.0, -0.2, 0.1, 0.0]}
    made['gaits'] = {'trot': {'frequency': 2.0, 'joints': joints,
                              'steering': copy.deepcopy(STEERING)},
                     'walk': {'frequency': 1.25, 'joints': copy.deepcopy(joints),
                              'steering': dict(STEERING, frequency=[1.0, 1.0, 1.25])},
                     'pace': {'joints': {names[0]: {'amplitude': 0.05}}}}
    return made


def write(folder: Path) -> Path:
    """Write the file and return its path."""
    path = folder / 'steered.yaml'
    path.write_text(yaml.safe_dump(tree()))
    return path
