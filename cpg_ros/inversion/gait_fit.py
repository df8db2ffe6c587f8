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

"""A gait fitted to a recording: parameters, readouts, errors and uncertainties."""

from dataclasses import dataclass
from functools import cached_property

from cpg_ros.dynamics.gait_assessment import GaitAssessment
from cpg_ros.dynamics.hopf_point import first_hopf, HopfPoint
from cpg_ros.dynamics.periodic import Orbit
from cpg_ros.inversion.fit_starts import distinct
from cpg_ros.inversion.identifiability import Estimate
from cpg_ros.inversion.trust_region import Minimisation
from cpg_ros.networks.network import Network
from cpg_ros.short_repr import ShortRepr, shown
import numpy as np

#: A joint whose mean cycle has a smaller range stands (rad).
STANDS = 0.01


def mean_share(recorded: np.ndarray, errors: np.ndarray) -> float:
    """Return the mean of RMS error over range over the joints that move; 0 if none does.

    Args:
        recorded: rad, shape (joints, m).
        errors: fitted minus recorded, rad, the same.

    """
    spans = np.ptp(recorded, axis=1)
    moving = spans > STANDS
    shares = np.sqrt(np.mean(errors[moving]**2, axis=1)) / spans[moving]
    return float(shares.sum() / max(shares.size, 1))


@dataclass(frozen=True, eq=False, repr=False)
class Fit(ShortRepr):
    """A gait fitted to a mean cycle.

    Attributes:
        network: the fitted parameters.
        gait: one of its gaits.
        orbit: the gait's.
        order: of the readouts.
        shares: order of the readout -> mean RMS error over range with that, the parameters kept.
        harmonics: of a Morris-Lecar cell's waveform that joints follow.
        duty: share of the stride that legs are to stand; None for what the network's cells do.
        stance: phase at which legs begin to stand by themselves, and for which share, as in a
            robot file; None if they stand while their cells fall.
        parameters: free number -> estimate; then those that were read off the legs' phases.
        correlation: of the free numbers, in their order; nan where the data do not separate one
            from others.
        cells: joint -> the cell behind it, from 1.
        readouts: joint -> offset and weights, rad, as a robot file takes them.
        theta: cycles, shape (m,).
        recorded: mean cycle of each joint, rad, shape (joints, m).
        errors: fitted minus recorded, rad, shape (joints, m).
        phase: of the orbit where theta is 0, cycles.
        cost: half the sum of squares of the errors over their sizes.
        sizes: joint -> standard error of its mean cycle as far as it counts: the stated one,
            or what the readout leaves if that is more, rad.
        misfit: joint -> what the readout leaves, over the stated standard error of the mean.
        sharing: instants that share one independent error.
        starts: what came of every start.
        warnings: one line each.

    """

    network: Network
    gait: str
    orbit: Orbit
    order: int
    shares: dict[int, float]
    harmonics: int
    duty: float | None
    stance: tuple[float, float] | None
    parameters: dict[str, Estimate]
    correlation: np.ndarray
    cells: dict[str, int]
    readouts: dict[str, tuple[float, tuple[float, ...]]]
    theta: np.ndarray
    recorded: np.ndarray
    errors: np.ndarray
    phase: float
    cost: float
    sizes: dict[str, float]
    misfit: dict[str, float]
    sharing: float
    starts: tuple[Minimisation, ...]
    warnings: tuple[str, ...]

    def _summary(self) -> str:
        return (f'{self.gait} of {self.network.name} to {len(self.joints)} joints: RMS error '
                f'{100.0 * self.mean_rms_share:.3g} % of range, '
                f'{shown({name: one.value for name, one in self.parameters.items()})}')

    @property
    def joints(self) -> tuple[str, ...]:
        """Names of the joints."""
        return tuple(self.readouts)

    @property
    def fitted(self) -> np.ndarray:
        """The fitted joints at theta, rad, shape (joints, m)."""
        return self.recorded + self.errors

    @property
    def free(self) -> tuple[str, ...]:
        """Names of the parameters that the starts began and ended with."""
        return tuple(self.parameters)[:len(self.correlation)]

    @property
    def minima(self) -> list[Minimisation]:
        """Where the starts ended, each place once, the least cost first."""
        found: list[Minimisation] = []
        for trial in sorted(self.starts, key=lambda one: one.cost):
            if not trial.why and all(distinct(trial.values[:-1], one.values[:-1])
                                     for one in found):
                found.append(trial)
        return found

    @property
    def rms(self) -> dict[str, float]:
        """Root mean square error of each joint, rad."""
        return dict(zip(self.readouts, np.sqrt(np.mean(self.errors**2, axis=1)).tolist(),
                        strict=True))

    @property
    def rms_share(self) -> dict[str, float]:
        """That over the joint's range; 0 for a joint that stands."""
        spans = np.ptp(self.recorded, axis=1)
        return {name: rms / span if span > STANDS else 0.0
                for (name, rms), span in zip(self.rms.items(), spans.tolist(), strict=True)}

    @property
    def mean_rms_share(self) -> float:
        """Mean over the joints that move; 0 if none does."""
        return mean_share(self.recorded, self.errors)

    def synchronisation(self, points: int = 20) -> tuple[np.ndarray, np.ndarray]:
        """Errors at even instants, as in Liu & Zhang's Figures 5, 6, 8 and 9.

        Returns:
            Cycles, shape (points,), and errors, rad, shape (joints, points).

        """
        theta = np.arange(points) / points
        return theta, np.array([np.interp(theta, self.theta, row, period=1.0)
                                for row in self.errors])

    @cached_property
    def hopf(self) -> HopfPoint | None:
        """Where the gait is born as the delay grows; None for networks without delay."""
        return first_hopf(self.network, self.gait)

    @cached_property
    def verdict(self) -> GaitAssessment:
        """How stable the gait is."""
        return GaitAssessment(self.gait, self.orbit)
