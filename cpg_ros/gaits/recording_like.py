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

"""What the analysis of gaits needs of a recording, wherever it comes from."""

from typing import Protocol

import numpy as np


class RecordingLike(Protocol):
    """What is needed of a recording; see Recording."""

    @property
    def joints(self) -> tuple[str, ...]:
        """Names."""

    @property
    def times(self) -> np.ndarray:
        """Rising, s, shape (n,)."""

    @property
    def positions(self) -> np.ndarray:
        """Angles in rad, nan where missing, shape (n, joints)."""

    @property
    def source(self) -> str:
        """What to call it."""


class FootLoadsLike(Protocol):
    """What is needed of loads on the feet; see FootLoads."""

    @property
    def legs(self) -> tuple[str, ...]:
        """Names."""

    @property
    def times(self) -> np.ndarray:
        """Rising, s, shape (n,)."""

    @property
    def loads(self) -> np.ndarray:
        """In any unit, shape (n, legs)."""
