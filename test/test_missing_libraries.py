"""What happens where a library is not installed: one line, or nothing at all."""

import subprocess
import sys

import pytest


def run(missing, text):
    script = f'import sys; sys.modules[{missing!r}] = None; {text}'
    return subprocess.run([sys.executable, '-c', script], capture_output=True, text=True,
                          check=False)


@pytest.mark.parametrize(('missing', 'module'), [
    ('numba', 'cpg_ros.nodes.generator'), ('numba', 'cpg_ros.tools.analyze'),
    ('numba', 'cpg_ros.motion.readout'), ('rosbags', 'cpg_ros.tools.inversion'),
    ('websockets', 'cpg_ros.panel.panel_node')])
def test_one_line_says_how_to_get_it(missing, module):
    found = run(missing, f'import {module}')
    assert found.returncode == 1 and not found.stdout
    (line,) = found.stderr.splitlines()
    assert f'needs {missing}' in line and f'pip install {missing}' in line


@pytest.mark.parametrize(('missing', 'module'), [
    ('numba', 'cpg_ros'), ('numba', 'cpg_ros.networks.registry'),
    ('rosbags', 'cpg_ros.nodes.generator'), ('matplotlib', 'cpg_ros.nodes.generator'),
    ('mujoco', 'cpg_ros.nodes.generator'), ('pymoo', 'cpg_ros.nodes.generator')])
def test_what_does_without_it(missing, module):
    found = run(missing, f'import {module}')
    assert found.returncode == 0, found.stderr


def test_other_errors_are_shown_as_ever():
    found = run('numba', '''
try:
    import cpg_ros.integration
except ImportError:
    1 / 0''')
    assert found.returncode == 1 and 'ZeroDivisionError' in found.stderr
    assert len(found.stderr.splitlines()) > 1
