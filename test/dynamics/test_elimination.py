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

"""The compiled elimination of an interval's inner values, against the library's."""

from cpg_ros.dynamics.mesh import collocation
from cpg_ros.dynamics.mesh.collocation import chained, transfer
import numpy as np
import pytest


@pytest.mark.parametrize('d', [1, 2, 4, 8, 9])
def test_every_interval_is_solved(d):
    rng = np.random.default_rng(d)
    jacobians = rng.normal(size=(3, collocation.S, d, d))
    lengths, sources = rng.uniform(0.1, 2.0, 3), rng.normal(size=(3, collocation.S, d, 2))
    answers = transfer(jacobians, lengths, sources)
    for k in range(3):
        for right, found in ((np.broadcast_to(np.eye(d), (collocation.S, d, d)), slice(0, d)),
                             (sources[k], slice(d, None))):
            # dY = right + L h A J dY, node by node.
            own = answers[k][..., found]
            there = right + lengths[k] * np.einsum('ab,bij,bjc->aic', collocation.A,
                                                   jacobians[k], own)
            assert own == pytest.approx(there, abs=1e-10 * np.abs(own).max())


def test_a_singular_interval_is_an_error():
    jacobians = np.full((1, collocation.S, 2, 2), np.nan)
    with pytest.raises(np.linalg.LinAlgError):
        transfer(jacobians, np.ones(1), np.zeros((1, collocation.S, 2, 1)))


def test_intervals_behind_one_another():
    rng = np.random.default_rng(0)
    steps = rng.normal(size=(5, 3, 4))
    start, at = rng.normal(size=3), None
    reached = chained(steps)
    for k in range(6):
        at = start if k == 0 else steps[k - 1, :, :3] @ at + steps[k - 1, :, 3]
        assert reached[k, :, :3] @ start + reached[k, :, 3] == pytest.approx(at)
