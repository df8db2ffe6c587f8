"""Executable cpg: a running generator asked and changed, as by ROS's own command line."""

import os
import subprocess

import pytest
from graph import EXECUTABLE, free_domain


def ask(domain, *words):
    variables = dict(os.environ, ROS_DOMAIN_ID=str(domain),
                     ROS_AUTOMATIC_DISCOVERY_RANGE='LOCALHOST')
    found = subprocess.run([EXECUTABLE.with_name('cpg'), *words], env=variables, text=True,
                           capture_output=True, timeout=120, check=False)
    return found.returncode, found.stdout.strip(), found.stderr.strip()


def test_parameters_and_topics_of_a_running_generator(running):
    process, watcher = running
    domain = process.domain
    assert ask(domain, 'set', 'gait', 'walk') == (0, '', '')
    assert ask(domain, 'get', 'gait') == (0, 'walk', '')
    assert watcher.get('gait') == ['walk']
    # An integer for a double.
    assert ask(domain, 'set', 'frequency', '2') == (0, '', '')
    code, _, why = ask(domain, 'set', 'delayed.tau', '0.2')
    assert code == 1 and "below the walk's critical delay" in why and '\n' not in why
    code, told, _ = ask(domain, 'list')
    assert code == 0 and 'delayed.tau  delay between opposite legs' in told
    code, told, _ = ask(domain, 'echo', 'joint_states')
    assert code == 0 and 'lf_calf_joint' in told and 'velocity: ' in told
    assert ask(domain, 'disable')[:2] == (0, 'ramping down over 1 s')
    assert ask(domain, 'enable')[:2] == (0, 'ramping up over 1 s')
    assert ask(domain, 'get', 'nothing')[::2] == (
        1, "cpg: /cpg_generator has no parameter 'nothing'")


@pytest.mark.parametrize(('words', 'code', 'said'), [
    (['--wait', '0.2', 'get', 'gait'], 1, '/cpg_generator does not answer'),
    (['--wait', '0.2', 'echo', 'joint_states'], 1, 'nobody publishes on /joint_states'),
    (['set', 'gait', '{a: 1}'], 2, "'{a: 1}' is no value of a parameter"),
    (['--node', 'a b', 'get', 'gait'], 2, 'Invalid service name'),
    (['echo', 'a b'], 2, 'topic name must not contain'),
    (['dance'], 2, 'dance')])
def test_what_it_cannot_do_is_one_line(words, code, said):
    found = ask(free_domain(), *words)
    assert found[0] == code and not found[1]
    assert said in found[2] and '\n' not in found[2]
