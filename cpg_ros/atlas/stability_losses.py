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

"""Whether a gait is lost softly or hard, at places on a curve where it loses stability."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from cpg_ros.atlas.orbit_plane import OrbitPlane, spectrum
from cpg_ros.dynamics.orbit import NoOrbit, Orbit
from cpg_ros.dynamics.orbit_normal_form import loses_stability, orbit_normal_form
import numpy as np

#: Places on a curve at which the normal form is computed.
PLACES = 5


@dataclass(frozen=True)
class LossOnCurve:
    """What the normal form says at a place on a curve.

    Attributes:
        values: on both axes.
        soft: whether what leaves the gait attracts; None if the normal form cannot tell.
        why: it cannot.

    """

    values: tuple[float, float]
    soft: bool | None
    why: str = ''

    @staticmethod
    def of(stored: dict[str, Any]) -> 'LossOnCurve':
        """Return it from what as_dict has made."""
        one, other = stored['values']
        return LossOnCurve((one, other), stored['soft'], stored['why'])

    def as_dict(self) -> dict[str, Any]:
        """Return it as plain types."""
        return {'values': list(self.values), 'soft': self.soft, 'why': self.why}


def stability_losses(plane: OrbitPlane, part: int, rank: int,
                     curve: Sequence[tuple[np.ndarray, Orbit]]) -> Iterator[LossOnCurve]:
    """Yield the verdicts at places spread evenly over the points of a curve.

    Places where other multipliers are outside the unit circle are left out: there the gait is not
    stable on either side.

    Args:
        plane: of the curve.
        part: number of the subspace in which a multiplier crosses the unit circle.
        rank: how many larger ones that has.
        curve: its points in shares of the ranges, and orbits beside them.

    """
    chosen = np.unique(((np.arange(PLACES) + 0.5) / PLACES * len(curve)).astype(int))
    for share, beside in (curve[k] for k in chosen):
        plane.last = beside
        try:
            orbit = plane.orbit(share)
        except NoOrbit:
            continue
        if loses_stability(orbit):
            multiplier = complex(spectrum(orbit)[part][rank])
            form = orbit_normal_form(orbit, multiplier, part)
            yield LossOnCurve(plane.chart.values_at(share), form.soft, form.why)
