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

Common names are available here and loaded on first use; all others are in the subpackages.
"""

import os

# Matrices here are small: threads of BLAS cost more than they give, and its idle ones spin on the
# cores that the publishing thread needs. It is read when numpy loads, so before anything else.
os.environ.setdefault('OPENBLAS_NUM_THREADS', '1')

# As in typing, which would take longer to load than all of this.
TYPE_CHECKING = False
if TYPE_CHECKING:
    from cpg_ros.analysis.atlas.atlas import atlas
    from cpg_ros.common.errors import CpgError
    from cpg_ros.dynamics.arclength import NoOrbit
    from cpg_ros.dynamics.continuation import bifurcations, continue_orbit  # noqa: I300
    from cpg_ros.dynamics.floquet import multipliers
    from cpg_ros.dynamics.hopf import hopf_points
    from cpg_ros.dynamics.integration.simulate import simulate
    from cpg_ros.dynamics.integration.stepper import Stepper
    from cpg_ros.dynamics.phase_response import phase_response
    from cpg_ros.dynamics.solve_orbit import coexisting_orbits, solve_orbit
    from cpg_ros.dynamics.stability import stability, verdicts
    from cpg_ros.fitting.inversion.parameter_files import write_fitted
    from cpg_ros.fitting.inversion.recording_fit import fit_recording
    from cpg_ros.fitting.recordings.bag_reader import read_bag
    from cpg_ros.fitting.recordings.csv_reader import read_csv
    from cpg_ros.fitting.recordings.formats import read_recording
    from cpg_ros.motion.pattern import Pattern
    from cpg_ros.motion.plan import plan
    from cpg_ros.motion.robot_file import load_robot
    from cpg_ros.networks.definition import Range
    from cpg_ros.networks.network import Network, ParameterLine
    from cpg_ros.networks.presets import Preset
    from cpg_ros.networks.registry import NETWORKS, PRESETS
    from cpg_ros.networks.symmetry import Symmetry

__version__ = '0.2.0'
__all__ = ['NETWORKS', 'PRESETS', 'CpgError', 'Network', 'NoOrbit', 'ParameterLine', 'Pattern',
           'Preset', 'Range', 'Stepper', 'Symmetry', 'atlas', 'bifurcations', 'coexisting_orbits',
           'continue_orbit', 'fit_recording', 'hopf_points', 'load_robot', 'multipliers',
           'phase_response', 'plan', 'read_bag', 'read_csv', 'read_recording', 'simulate',
           'solve_orbit', 'stability', 'verdicts', 'write_fitted']

_PLACES = {
    'NETWORKS': 'networks.registry', 'PRESETS': 'networks.registry', 'CpgError': 'common.errors',
    'Network': 'networks.network', 'NoOrbit': 'dynamics.solve_orbit',
    'ParameterLine': 'networks.network', 'Pattern': 'motion.pattern',
    'Preset': 'networks.presets', 'Range': 'networks.definition',
    'Stepper': 'dynamics.integration.stepper', 'Symmetry': 'networks.symmetry',
    'atlas': 'analysis.atlas.atlas', 'bifurcations': 'dynamics.continuation',
    'coexisting_orbits': 'dynamics.solve_orbit',
    'continue_orbit': 'dynamics.continuation', 'fit_recording': 'fitting.inversion.recording_fit',
    'hopf_points': 'dynamics.hopf', 'load_robot': 'motion.robot_file',
    'multipliers': 'dynamics.floquet', 'phase_response': 'dynamics.phase_response',
    'plan': 'motion.plan',
    'read_bag': 'fitting.recordings.bag_reader',
    'read_csv': 'fitting.recordings.csv_reader', 'read_recording': 'fitting.recordings.formats',
    'simulate': 'dynamics.integration.simulate', 'solve_orbit': 'dynamics.solve_orbit',
    'stability': 'dynamics.stability', 'verdicts': 'dynamics.stability',
    'write_fitted': 'fitting.inversion.parameter_files'}


def __getattr__(name: str) -> object:
    if name not in _PLACES:
        raise AttributeError(f'module {__name__!r} has no attribute {name!r}')
    from importlib import import_module
    value = globals()[name] = getattr(import_module(f'{__name__}.{_PLACES[name]}'), name)
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
