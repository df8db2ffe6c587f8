"""Kernels on disk: compiled for one network in one process, loaded with others in the next."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import cpg_ros
from cpg_ros.files.shared_resources import share

WARM = 'from cpg_ros.motion.precompile import precompile; precompile({network!r})'
STEP = '''
import numpy as np
from cpg_ros.integration.stepper import Stepper
from cpg_ros.networks.biped import Biped
Stepper(Biped.symmetric(0.229, 0.254, 0.39, -0.681, 0.489), np.zeros(8)).advance(0.1)
'''
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


@pytest.mark.parametrize('source', ['integration/jit.py', 'motion/readout.py',
                                    'networks/derivation.py'])
def test_a_changed_source_is_compiled_again(tmp_path, source):
    # numba watches only the file that a kernel stands in, and the rooms have several.
    package = tmp_path / 'package'
    shutil.copytree(Path(cpg_ros.__file__).parent, package / 'cpg_ros',
                    ignore=shutil.ignore_patterns('__pycache__'))
    shutil.copytree(share() / 'config', package / 'config')
    cache = tmp_path / 'cache'
    environment = dict(os.environ, NUMBA_CACHE_DIR=str(cache), PYTHONPATH=os.pathsep.join(
        [str(package), os.environ.get('PYTHONPATH', '')]))

    def kernels_after_a_start():
        subprocess.run([sys.executable, '-c', STEP], env=environment, check=True, cwd=package)
        return sorted(cache.rglob('*.nbc'))

    first = kernels_after_a_start()
    assert first and kernels_after_a_start() == first
    changed = package / 'cpg_ros' / source
    changed.write_text(changed.read_text() + '\n# Changed.\n')
    assert set(kernels_after_a_start()) > set(first)
