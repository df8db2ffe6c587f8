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

"""Who may move a robot."""

from cpg_ros.ros.panel.teleop import Lease, LEASE_TIMEOUT, LeaseError
import pytest


def test_the_first_gets_it_and_keeps_it():
    lease = Lease()
    assert lease.holder is None
    lease.acquire('page 1', 0.0)
    lease.acquire('page 1', 1.0)
    with pytest.raises(LeaseError, match='page 1 has control of the robot: take over first'):
        lease.acquire('page 2', 1.0)
    assert lease.holder == 'page 1'


def test_whoever_takes_over_has_it_and_the_other_has_not():
    lease = Lease()
    assert lease.take_over('page 1', 0.0) is None
    assert lease.take_over('page 1', 0.0) is None
    assert lease.take_over('page 2', 0.0) == 'page 1'
    with pytest.raises(LeaseError, match='page 2'):
        lease.acquire('page 1', 0.0)
    assert not lease.release('page 1') and lease.holder == 'page 2'


def test_what_is_released_is_free():
    lease = Lease()
    assert not lease.release('page 1')
    lease.acquire('page 1', 0.0)
    assert lease.release('page 1') and lease.holder is None
    lease.acquire('page 2', 0.0)


def test_a_holder_that_is_silent_loses_it():
    lease = Lease()
    assert lease.expire(100.0) is None
    lease.acquire('page 1', 100.0)
    assert lease.expire(100.0 + LEASE_TIMEOUT) is None
    lease.renew('page 1', 101.0)
    lease.renew('page 2', 109.0)
    assert lease.expire(101.0 + LEASE_TIMEOUT) is None and lease.holder == 'page 1'
    assert lease.expire(101.1 + LEASE_TIMEOUT) == 'page 1' and lease.holder is None
    lease.acquire('page 2', 200.0)
    assert lease.expire(200.0) is None


def test_others_that_publish_are_confirmed_by_taking_over_alone():
    lease = Lease()
    lease.acquire('page 1', 0.0)
    assert lease.confirmed == frozenset()
    lease.take_over('page 1', 0.0, frozenset({b'teleop'}))
    lease.acquire('page 1', 0.0)
    assert lease.confirmed == {b'teleop'}
    lease.take_over('page 2', 0.0)
    assert lease.confirmed == frozenset()
    lease.take_over('page 2', 0.0, frozenset({b'teleop'}))
    lease.release('page 2')
    assert lease.confirmed == frozenset()
