"""Kernels on disk: compiled for one network in one process, loaded with others in the next."""

import os
import subprocess
import sys

WARM = 'from cpg_ros.motion.precompile import precompile; precompile({network!r})'
CHECK = '''
import numpy as np
from cpg_ros.integration.stepper import Stepper
from cpg_ros.networks.registry import PRESETS
for name in ('biped', 'quadruped', 'biped'):
    network = PRESETS[name]['walk'].network
    start = 0.1 * np.arange(network.components) % 0.7
    stepper = Stepper(network, start)
    state, slope, _ = stepper.advance(3.0 * network.step)
    assert np.abs(state - start).max() > 1e-4, name
    assert np.allclose(slope, network.rates(state), atol=1e-12), name
print('agree')
'''


def test_networks_compiled_apart_keep_their_own_code(tmp_path):
    # numba told them apart by a number that is the same in either process: one network's loop ran
    # on the other's arrays.
    environment = dict(os.environ, NUMBA_CACHE_DIR=str(tmp_path))
    for network in ('quadruped', 'biped'):
        subprocess.run([sys.executable, '-c', WARM.format(network=network)], env=environment,
                       check=True)
    before = sorted(tmp_path.rglob('*.nbc'))
    found = subprocess.run([sys.executable, '-c', CHECK], env=environment, check=True,
                           stdout=subprocess.PIPE, text=True)
    assert found.stdout == 'agree\n'
    assert sorted(tmp_path.rglob('*.nbc')) == before, 'the cache was not used'
