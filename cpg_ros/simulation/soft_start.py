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

"""Soft start: the path to commanded angles that are far from the joints, or already moving."""

from cpg_ros.motion.strides import smoothstep
import numpy as np

#: NEAR: distance up to which commanded angles are followed at once, rad.
NEAR = 0.05


class Approach:
    """Leads joints from their present angles to commanded ones, each leg in a smooth step.

    So a driver does that is switched on under a running controller: nothing jerks, and a gait
    that is in full swing grows out of the stand. What begins where a leg is, as with a generator
    that ramps in from the stand, is followed from the first instant on. A leg may be commanded
    earlier than another.
    """

    def __init__(self, steps: int, angles: np.ndarray, legs: np.ndarray) -> None:
        """Be ready at the angles where the joints are.

        Args:
            steps: calls of ``towards`` that an approach takes, at least one.
            angles: rad, shape (joints,).
            legs: index from 0 of each joint's leg, shape (joints,).

        """
        self._steps, self._legs = steps, legs
        self.begin(angles)

    def begin(self, angles: np.ndarray) -> None:
        """Be at these angles, rad; the next ones that differ are approached."""
        self._start = np.array(angles, dtype=float)
        self._done = np.zeros(self._legs.max() + 1, dtype=int)
        self._there = False

    def towards(self, commanded: np.ndarray) -> np.ndarray:
        """Return the target angles of this step, rad, shape (joints,)."""
        if self._there:
            return commanded
        way, done, steps = commanded - self._start, self._done, self._steps
        far = np.zeros(len(done))
        np.maximum.at(far, self._legs, np.abs(way))
        done[(done == 0) & (far > 0.0) & (far <= NEAR)] = steps
        done[((done > 0) | (far > 0.0)) & (done < steps)] += 1
        self._there = bool((done == steps).all())
        fraction = smoothstep(done / steps)
        return np.where((done == steps)[self._legs], commanded,
                        self._start + fraction[self._legs] * way)
