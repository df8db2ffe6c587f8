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

"""Monitoring of how far joints are from their commanded angles."""

from cpg_ros.safety.bridge_settings import BridgeSettings
import numpy as np


class TrackingMonitor:
    """Averages |commanded - measured| of each joint, and finds the joint that does not follow.

    A joint that is stuck amid a gait is at its commanded angle twice in a stride, so the mean
    counts: an exponential one, of the time constant ``tracking_time``. A joint that is late by
    some time has the mean error of its mean speed times that time.
    """

    def __init__(self, settings: BridgeSettings) -> None:
        """Monitor the joints of ``settings`` against its tracking_error."""
        self._settings = settings
        self.reset()

    def reset(self) -> None:
        """Forget all errors."""
        self._mean = np.zeros(len(self._settings.names))

    @property
    def worst(self) -> str:
        """The joint with the largest mean error, and that error in rad."""
        worst = int(self._mean.argmax())
        return f'{self._settings.names[worst]} {self._mean[worst]:.3f}'

    def update(self, commanded: np.ndarray, measured: np.ndarray, dt: float) -> str:
        """Add angles, rad, dt s after those before; return what is wrong, or ''."""
        settings = self._settings
        weight = min(dt / settings.tracking_time, 1.0)
        self._mean += weight * (np.abs(commanded - measured) - self._mean)
        worst = int(self._mean.argmax())
        if not self._mean[worst] > settings.tracking_error:
            return ''
        return (f'{settings.names[worst]} does not follow: it is at {measured[worst]:.2f} rad, '
                f'commanded to {commanded[worst]:.2f}, and was {self._mean[worst]:.2f} rad away '
                f'on average (tracking_error {settings.tracking_error:g} rad)')
