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

"""Who may come in to the panel, and what may be asked of it."""

from dataclasses import replace
from functools import partial
import json

import pytest

pytest.importorskip('websockets')

from cpg_ros.common.files import is_loopback  # noqa: E402, I100
from cpg_ros.motion.robot_file import load_robot  # noqa: E402
from cpg_ros.networks.registry import NETWORKS  # noqa: E402
from cpg_ros.ros.generator_parameters import gait_spec  # noqa: E402
from cpg_ros.ros.node.parameters import choices, untuned_among  # noqa: E402
from cpg_ros.ros.panel.pages import MAX_TEXT_LENGTH, read, RequestError  # noqa: E402
from cpg_ros.ros.panel.robot_view import unit  # noqa: E402
from cpg_ros.ros.panel.web_server import AccessError, rejected, token_for  # noqa: E402


@pytest.mark.parametrize(('host', 'only_here'), [
    ('127.0.0.1', True), ('127.9.9.9', True), ('::1', True), ('localhost', True),
    ('0.0.0.0', False), ('::', False), ('192.168.1.5', False), ('robot.local', False),
    ('localhost.evil.example', False), ('127.0.0.1.evil.example', False), ('', False)])
def test_what_is_loopback(host, only_here):
    assert is_loopback(host) == only_here


LONG = 'a_token-of-128-bits_22'


@pytest.mark.parametrize(('wish', 'said'), [
    ('', r"host '0\.0\.0\.0'.* set the parameter token"), ('word', 'the token has 4 characters'),
    ('x' * 21, 'token:=auto makes one'), ('auto', 'there is none: make one')])
def test_another_host_needs_a_token_that_cannot_be_guessed(wish, said):
    with pytest.raises(AccessError, match=said):
        token_for('0.0.0.0', wish, terminal=False)


def test_tokens():
    assert token_for('0.0.0.0', LONG, terminal=False) == LONG
    assert token_for('127.0.0.1', '', terminal=False) == ''
    with pytest.raises(AccessError, match='the token has 4 characters'):
        token_for('127.0.0.1', 'word', terminal=False)
    made = {token_for('0.0.0.0', 'auto', terminal=True) for _ in range(100)}
    # 6 bits a character.
    assert len(made) == 100 and all(6 * len(one) >= 128 for one in made)


@pytest.mark.parametrize(('path', 'host', 'origin', 'said'), [
    ('/socket', 'localhost:8080', '', ''),
    ('/socket', 'localhost:8080', 'http://localhost:8080', ''),
    ('/socket', '[::1]:8080', 'http://[::1]:8080', ''),
    ('/socket', 'localhost:9000', 'http://localhost:9000', ''),  # by ssh -L
    ('/socket', 'localhost:8080', 'http://evil.example', 'another site'),
    ('/socket', 'localhost:8080', 'http://localhost:8080.evil.example', 'another site'),
    ('/socket', 'localhost:8080', 'null', 'another site'),
    ('/socket', 'localhost:8080', 'http://localhost:8081', 'another site'),
    ('/socket', 'evil.example:8080', 'http://evil.example:8080', 'not a name of this machine'),
    ('/socket', '', '', 'not a name of this machine')])
def test_on_loopback_pages_of_this_machine_come_in(path, host, origin, said):
    found = rejected('', path, host, origin)
    assert (said in found) if said else not found


@pytest.mark.parametrize('query', ['', '?token=', '?token=wor', '?token=wordy', '?token=WORD',
                                   '?Token=word', '?token=w%00ord', '?token=\udcff'])
def test_a_wrong_token_does_not(query):
    assert 'token' in rejected('word', f'/socket{query}', 'robot:8080', '')


def test_the_token_does_from_anywhere_but_another_sites_page():
    door = partial(rejected, 'a b&c')
    assert not door('/socket?token=a%20b%26c', 'robot:8080', 'http://robot:8080')
    assert door('/socket?token=a%20b%26c', 'robot:8080', 'http://evil.example')


@pytest.mark.parametrize('text', [
    '', '{', '[]', '3', 'null', '{}', '{"do": 3}', '{"do": null}', '{"do": "shutdown"}',
    '{"do": "stop", "now": true}', '{"do": "set", "name": "rate"}', '{"do": ["set"]}',
    '{"do": "set", "name": 3, "value": 1.0}', '{"do": "set", "name": "rate", "value": NaN}',
    '{"do": "set", "name": "rate", "value": 1e999}', '{"do": "set", "name": "r", "value": [1]}',
    '{"do": "set", "name": "rate", "value": null}', '{"do": "set", "name": "r", "value": {}}',
    '{"do": "set", "name": "rate", "value": 9223372036854775808}',
    '{"do": "steer", "speed": 1.01, "turn": 0}', '{"do": "steer", "speed": true, "turn": 0}',
    '{"do": "steer", "speed": "1", "turn": 0}', '{"do": "steer", "speed": -Infinity, "turn": 0}',
    '{"do": "push", "force": -1, "direction": 0}', '{"do": "push", "force": 1e6, "direction": 0}',
    '{"do": "enable", "on": 1}', '{"do": "enable", "on": "true"}', '{"do": "record", "on": null}',
    '{"do": "set", "name": "a\\u0000b", "value": 1}', '[' * 4000, b'\x00\xff', b'{"do": "stop"}',
    json.dumps({'do': 'choose', 'node': 'x' * (MAX_TEXT_LENGTH + 1)})])
def test_what_is_not_understood(text):
    with pytest.raises(RequestError) as refused:
        read(text)
    assert '\n' not in str(refused.value)


def test_what_is_understood():
    asked = read('{"do": "steer", "speed": -1, "turn": 0.25}')
    assert asked.action == 'steer' and asked.values == {'speed': -1.0, 'turn': 0.25}
    assert read('{"do": "set", "name": "gait", "value": "walk"}').values == {
        'name': 'gait', 'value': 'walk'}


def test_a_gait_says_on_which_tuned_robots_it_walks_badly():
    robot, delayed = load_robot('unitree_go2'), NETWORKS['delayed']
    motion, tried = robot.motions['trot'], {}
    for verdict in ('good: 0.4 m/s', 'poor: it falls', ''):
        tried[verdict] = replace(robot, motions={
            'trot': replace(motion, verdict='good'), 'pace': replace(motion, verdict=verdict)})
    bad = {verdict: untuned_among(gait_spec(delayed, delayed.presets(), robot=one).constraints)
           for verdict, one in tried.items()}
    assert 'trot' not in bad['good: 0.4 m/s'] and {'walk', 'bound'} <= set(bad['good: 0.4 m/s'])
    assert 'pace' in bad['poor: it falls'] and 'pace' not in bad['']
    assert not untuned_among(gait_spec(delayed, delayed.presets(), robot=robot).constraints)


def test_what_a_descriptor_says():
    assert choices('one of: walk, trot, my-own.gait') == ['walk', 'trot', 'my-own.gait']
    assert choices('one of: delayed, biped, or the path of a Python file that defines one') == [
        'delayed', 'biped']
    assert choices('a shipped name, or a path') == []
    told = 'one of: walk, trot; presets: goat_walk; not tuned for this robot: trot, goat_walk'
    assert choices(told) == ['walk', 'trot', 'goat_walk']
    assert untuned_among(told) == ['trot', 'goat_walk'] and not untuned_among('one of: walk')
    assert unit('strides per second [Hz]; 0 runs in model time') == 'Hz'
    assert unit('damping [N m s/rad]') == 'N m s/rad' and unit('factor') == ''
