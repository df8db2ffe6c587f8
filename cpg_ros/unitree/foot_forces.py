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

"""Forces on the feet, from sensors whose unit and zero differ from foot to foot."""

from collections.abc import Sequence

from cpg_ros.errors import InputError
import numpy as np


class FootForces:
    """Readings of foot sensors as forces."""

    def __init__(self, feet: int, scale: float, offset: Sequence[float],
                 threshold: Sequence[float]) -> None:
        """Convert the readings of some feet.

        Args:
            feet: number of feet.
            scale: force per unit of the sensors, N.
            offset: readings in the air, in the sensors' units; one number or one for each foot.
            threshold: forces below which a foot is in the air, N; likewise.

        Raises:
            InputError: a sequence has another length, or a value that is not a finite number.

        """
        self._scale = scale
        self._offset, self._threshold = (
            _per_foot(name, values, feet) for name, values in (
                ('foot_offset', offset), ('foot_threshold', threshold)))

    def newtons(self, raw: np.ndarray) -> np.ndarray:
        """Return the forces of raw readings, N, shape (feet,); 0 in the air, never negative."""
        force = self._scale * (raw - self._offset)
        return np.where(force >= self._threshold, np.maximum(force, 0.0), 0.0)


def _per_foot(name: str, values: Sequence[float], feet: int) -> np.ndarray:
    if len(values) not in (1, feet):
        raise InputError(f'parameter {name} has {len(values)} numbers, not 1 or {feet}')
    if not np.isfinite(values).all():
        raise InputError(f'parameter {name}: {list(values)} is not finite')
    return np.broadcast_to(np.array(values, dtype=float), feet)
