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

"""Loads on the feet, beside the joint states of a recording."""

from dataclasses import dataclass

from cpg_ros.short_repr import ShortRepr
import numpy as np


@dataclass(frozen=True, eq=False, repr=False)
class FootLoads(ShortRepr):
    """Loads on the feet over time.

    Attributes:
        legs: their names, or those of columns that name them, such as FR_force.
        times: s from the recording's start, rising, shape (n,).
        loads: in the robot's unit, such as N, or 1 for contact; shape (n, legs).

    """

    legs: tuple[str, ...]
    times: np.ndarray
    loads: np.ndarray

    def _summary(self) -> str:
        return f'{len(self.times)} loads on {", ".join(self.legs)}'
