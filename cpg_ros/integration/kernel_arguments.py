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

"""What the integrator's compiled functions take together: a network, its history, its samples."""

from typing import NamedTuple

import numpy as np


class System(NamedTuple):
    """The network that is integrated, and its symmetry lock.

    Attributes:
        p: coefficients, a row for each parameter of the equations, shape (rows, cells * lanes).
        tau: delay of each lane in model time, shape (lanes,).
        gain: of the symmetry lock, 1/model time.
        basis: of the subspace that the lock leaves alone, shape (r, components).

    """

    p: np.ndarray
    tau: np.ndarray
    gain: float
    basis: np.ndarray


class Ring(NamedTuple):
    """A history, step apart in model time, used as a ring.

    Attributes:
        step: model time between nodes.
        x: states at the nodes, shape (nodes, components * lanes).
        after: slopes that leave the nodes, the same shape.
        before: slopes that arrive at the nodes, the same shape.

    """

    step: float
    x: np.ndarray
    after: np.ndarray
    before: np.ndarray


class Samples(NamedTuple):
    """What is kept of the steps taken.

    Attributes:
        every: keep every so many steps only.
        states: at the steps kept, shape (lanes, rows, components).
        slopes: there, the same shape.

    """

    every: int
    states: np.ndarray
    slopes: np.ndarray
