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

"""Points on the boundaries of an atlas at which a second condition holds.

Around such a point in the plane of two parameters several boundaries meet, so it says what changes
of gaits there are nearby (Kuznetsov, *Elements of Applied Bifurcation Theory*, chapters 8 and 9).
"""

from dataclasses import dataclass
import math
from typing import Any

from cpg_ros.short_repr import ShortRepr

#: Kind -> its usual abbreviation, as MatCont has it.
LABELS = {'Bautin': 'GH', 'Hopf-Hopf': 'HH', 'zero-Hopf': 'ZH', 'Bogdanov-Takens': 'BT',
          '1:1 resonance': 'R1', '1:2 resonance': 'R2', '1:3 resonance': 'R3',
          '1:4 resonance': 'R4', 'cusp': 'CP'}


@dataclass(frozen=True, eq=False, repr=False)
class CodimensionTwo(ShortRepr):
    """A point of a boundary at which a second condition holds.

    Attributes:
        kind: one of LABELS.
        gait: whose: of several that share a curve each has its own coefficients.
        values: on both axes.
        test: what the function that is zero there is at these values: the first Lyapunov
            coefficient at a Bautin point, the real part of the other root at a Hopf-Hopf or
            zero-Hopf point, the largest residual of the defining equations at others.
        omega: of the curve's own critical root, rad per model time; nan on curves of orbits.
        other: gaits of the classes of the other roots, '' for a class that no gait has.
        other_omega: of the other root; nan where there is none.

    """

    kind: str
    gait: str
    values: tuple[float, float]
    test: float
    omega: float = math.nan
    other: tuple[str, ...] = ()
    other_omega: float = math.nan

    def __str__(self) -> str:
        of = ' and '.join([self.gait, *filter(None, self.other)])
        return f'{self.kind} of {of} at {self.values[0]:.7g}, {self.values[1]:.7g}'

    def as_dict(self) -> dict[str, Any]:
        """Return everything in plain types; what does not apply is None."""
        return {'type': self.kind, 'gait': self.gait, 'values': list(self.values),
                'test': self.test, 'omega': _plain(self.omega), 'other': list(self.other),
                'other_omega': _plain(self.other_omega)}

    @classmethod
    def of(cls, stored: dict[str, Any]) -> 'CodimensionTwo':
        """Make one from what as_dict returned."""
        one, other = stored['values']
        omegas = [math.nan if stored[name] is None else stored[name]
                  for name in ('omega', 'other_omega')]
        return cls(stored['type'], stored['gait'], (one, other), stored['test'], omegas[0],
                   tuple(stored['other']), omegas[1])


def _plain(number: float) -> float | None:
    return None if math.isnan(number) else number
