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

"""The smooth step by which ramps, cross-fades and approaches go."""

from typing import TypeVar

import numpy as np

Real = TypeVar('Real', float, np.ndarray)


def smoothstep(s: Real) -> tuple[Real, Real]:
    """Smooth step from 0 to 1 and its derivative: 3 s^2 - 2 s^3."""
    return s * s * (3.0 - 2.0 * s), 6.0 * s * (1.0 - s)
