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

"""Mean cycles made of known parameters, to be fitted."""

from cpg_ros.dynamics.solve_orbit import solve_orbit
from cpg_ros.networks.registry import PRESETS
from made_up import record, weights_of
import numpy as np

TROT = PRESETS['delayed']['trot'].network
CELLS = (1, 1, 7, 2, 3, 4)
CASES = (('delayed', 'walk', ('c', 'tau', 'd')), ('quadruped', 'trot', ('alpha', 'delta')),
         ('quadruped', 'walk', ('gamma', 'xi')), ('biped', 'walk', ('w_a', 'phi')),
         ('biped', 'skip', ('w_43', 'current')))


def truth_of(network, name):
    return getattr(network, network.groups.get(name, (name,))[0])


def trot(seed=0, cells=CELLS, order=3, network=TROT, **settings):
    rng = None if seed is None else np.random.default_rng(seed)
    return record(solve_orbit(network, 'trot'), cells, weights_of(len(cells), order), rng,
                  **settings)
