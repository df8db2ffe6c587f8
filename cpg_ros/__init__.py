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

"""Central pattern generators of legged locomotion, true to the theory and running on ROS 2.

What is used most is here by name, and loaded when it is first asked for; the rest is in the rooms.
"""

import os

# Matrices here are small: threads of BLAS cost more than they give, and its idle ones spin on the
# cores that the publishing thread needs. It is read when numpy loads, so before anything else.
os.environ.setdefault('OPENBLAS_NUM_THREADS', '1')

# As in typing, which would take longer to load than all of this.
TYPE_CHECKING = False
if TYPE_CHECKING:
    from cpg_ros.dynamics.continuation import follow  # noqa: I300
    from cpg_ros.dynamics.floquet import multipliers
    from cpg_ros.dynamics.hopf_search import hopf_points
    from cpg_ros.dynamics.orbit import NoOrbit, solve_orbit
    from cpg_ros.errors import CpgError
    from cpg_ros.integration.simulate import simulate
    from cpg_ros.integration.stepper import Stepper
    from cpg_ros.inversion.recording_fit import inverted
    from cpg_ros.motion.pattern import Pattern
    from cpg_ros.motion.plan import plan
    from cpg_ros.networks.registry import NETWORKS, PRESETS
    from cpg_ros.recordings.bag_reader import read_bag
    from cpg_ros.recordings.csv_reader import read_csv
    from cpg_ros.recordings.formats import read_recording
    from cpg_ros.robots.robot_file import find_robot

__version__ = '0.1.0'
__all__ = ['NETWORKS', 'PRESETS', 'CpgError', 'NoOrbit', 'Pattern', 'Stepper', 'find_robot',
           'follow', 'hopf_points', 'inverted', 'multipliers', 'plan', 'read_bag', 'read_csv',
           'read_recording', 'simulate', 'solve_orbit']

_PLACES = {
    'NETWORKS': 'networks.registry', 'PRESETS': 'networks.registry', 'CpgError': 'errors',
    'NoOrbit': 'dynamics.orbit', 'Pattern': 'motion.pattern', 'Stepper': 'integration.stepper',
    'find_robot': 'robots.robot_file', 'follow': 'dynamics.continuation',
    'hopf_points': 'dynamics.hopf_search', 'inverted': 'inversion.recording_fit',
    'multipliers': 'dynamics.floquet', 'plan': 'motion.plan', 'read_bag': 'recordings.bag_reader',
    'read_csv': 'recordings.csv_reader', 'read_recording': 'recordings.formats',
    'simulate': 'integration.simulate', 'solve_orbit': 'dynamics.orbit'}


def __getattr__(name: str) -> object:
    if name not in _PLACES:
        raise AttributeError(f'module {__name__!r} has no attribute {name!r}')
    from importlib import import_module
    value = globals()[name] = getattr(import_module(f'{__name__}.{_PLACES[name]}'), name)
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
