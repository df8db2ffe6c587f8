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

"""The package stays as small, and as clear, as it is; CONTRIBUTING.md has the rule."""

import pytest
from structure import circles, measure


@pytest.fixture(scope='module')
def measured():
    return measure()


def test_rooms(measured):
    assert measured['rooms'] == ['analysis', 'common', 'dynamics', 'feedback', 'fitting',
                                 'motion', 'networks', 'ros', 'simulation']


@pytest.mark.parametrize(('name', 'most'), [
    ('files', 300), ('modules with a single reader', 40), ('arrows between rooms', 40),
    ('circles of imports', 0)])
def test_limits(measured, name, most):
    assert len(measured[name]) <= most, f'{name}: ' + ', '.join(measured[name])


def test_a_circle_is_seen():
    graph = {'a': {'b'}, 'b': {'c'}, 'c': {'a', 'd'}, 'd': set()}
    assert circles(graph) == [{'a', 'b', 'c'}]
