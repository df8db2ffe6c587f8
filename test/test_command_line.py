"""Every executable: help, and words that are not for it."""

import os
import subprocess

import pytest
from graph import EXECUTABLE, free_domain

NODES = ('generator', 'robot_sim', 'inversion')
TOOLS = ('demo', 'analyze', 'check_robot', 'optimize', 'reproduce', 'tune')


def run(executable, *words):
    variables = dict(os.environ, ROS_DOMAIN_ID=str(free_domain()))
    return subprocess.run([EXECUTABLE.with_name(executable), *words], env=variables, text=True,
                          capture_output=True, timeout=60, check=False)


@pytest.mark.parametrize('word', ['--help', '-h'])
@pytest.mark.parametrize('executable', [*NODES, *TOOLS])
def test_help(executable, word):
    found = run(executable, word)
    assert found.returncode == 0 and not found.stderr
    assert found.stdout.startswith('usage: ') and executable in found.stdout
    if executable in ('generator', 'robot_sim'):
        assert '\n  command  ' in found.stdout


@pytest.mark.parametrize(('executable', 'words', 'said'), [
    *((executable, ['--nonsense'], '--nonsense') for executable in NODES if executable !=
      'inversion'),
    *((executable, ['--nonsense'], '') for executable in ('inversion', *TOOLS)),
    ('generator', ['--gait', 'walk'], 'not understood: --gait walk (parameters: --ros-args -p '),
    ('generator', ['walk', '--help'], 'not understood: walk'),
    ('generator', ['--ros-args', '-p', 'gait:=walk', '--', 'walk'], 'not understood: walk'),
    ('inversion', ['--ros-args', '-p', 'order:=1', '--', 'walk'], 'not understood: walk'),
    ('generator', ['--ros-args', '-p', 'gait'], "Couldn't parse parameter override rule"),
    ('robot_sim', ['--ros-args', '--nonsense'], '--nonsense')])
def test_words_that_are_not_for_it(executable, words, said):
    found = run(executable, *words)
    assert found.returncode == 2 and not found.stdout
    assert len(found.stderr.splitlines()) == 1, found.stderr
    assert said in found.stderr
