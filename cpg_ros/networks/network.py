"""What every network has: named parameters, cells with one or two variables, compiled rates.

States are vectors of ``components`` numbers, variable by variable: first that of every cell
which the legs read (x or v), then the second one (w or u). All three networks have the form
``dx/dt = f(x(t), x(t - delay); p)``; networks without delay ignore the second argument.
"""

from abc import ABC, abstractmethod
from dataclasses import asdict, dataclass, fields
from typing import Any, ClassVar

import numpy as np

from cpg_ros.errors import InputError


@dataclass(frozen=True)
class Range:
    """A parameter's range and meaning."""

    low: float
    high: float
    text: str


class Network(ABC):
    """Parameters of a network, as a frozen dataclass of floats.

    Attributes:
        name: by which it is chosen.
        kind: number of its compiled rates in the kernel.
        cells: how many.
        variables: state variables of each cell.
        longest_delay: that may be set at run time, model time.
        step: model time per step in real time; an orbit is followed to about 1e-9 a cycle.
        ranges: parameter -> range in which it may be set at run time.
        legs: assignment of cells to legs -> leg -> cells numbered from 1, the first of which
            gives the leg's phase; the first assignment is the usual one.
        groups: name -> parameters that can be set together under it.

    """

    name: ClassVar[str]
    kind: ClassVar[int]
    cells: ClassVar[int]
    variables: ClassVar[int] = 1
    longest_delay: ClassVar[float] = 0.0
    step: ClassVar[float]
    ranges: ClassVar[dict[str, Range]]
    legs: ClassVar[dict[str, dict[str, tuple[int, ...]]]]
    groups: ClassVar[dict[str, tuple[str, ...]]] = {}

    def as_dict(self) -> dict[str, float]:
        """Return the parameters by name, in their own order."""
        return asdict(self)  # type: ignore[call-overload]

    @classmethod
    def parameters(cls) -> tuple[str, ...]:
        """Names of the parameters, in their own order."""
        return tuple(field.name for field in fields(cls))  # type: ignore[arg-type]

    @property
    def components(self) -> int:
        """Length of a state."""
        return self.cells * self.variables

    @property
    def delay(self) -> float:
        """How far back the rates look, model time; 0 for an ordinary differential equation."""
        return 0.0

    @property
    @abstractmethod
    def coefficients(self) -> np.ndarray:
        """The kernel's coefficients, shape (rows, components)."""

    @classmethod
    @abstractmethod
    def gaits(cls) -> tuple[str, ...]:
        """Names of the gaits it knows."""

    @abstractmethod
    def symmetry(self, gait: str) -> Any:
        """Return the gait's symmetry in this network: phases and waves of cells, lock's basis.

        Raises:
            ValueError: it has no gait of this name.

        """

    @classmethod
    def families(cls, symmetry: Any) -> tuple[tuple[str, ...], ...]:
        """Parameters that a gait's symmetry carries into one another, and so has to find equal."""
        return tuple((name,) for name in cls.parameters())

    def broken(self, gait: str) -> str:
        """Name parameters that would have to be equal for the gait, or '' if all are."""
        values = self.as_dict()
        return next((', '.join(family) for family in self.families(self.symmetry(gait))
                     if len({values[name] for name in family}) > 1), '')

    def character(self, gait: str, assignment: str) -> str:
        """Tell whether a gait is walk-like or run-like (Buono & Golubitsky 2001, section 7).

        Walk-like: the two cells of every leg, its flexors and extensors, are half a cycle
        apart; run-like: in phase; neither otherwise.

        Raises:
            ValueError: an unknown gait, or an assignment that is not one of ``legs``.

        """
        if assignment not in self.legs:
            raise InputError(f"assignment '{assignment}' is not one of {', '.join(self.legs)}")
        symmetry = self.symmetry(gait)
        pairs = [(a - 1, b - 1) for a, b in self.legs[assignment].values()]
        alike = all(symmetry.waves[a] == symmetry.waves[b] for a, b in pairs)
        apart = {float((symmetry.phases[b] - symmetry.phases[a]) % 1.0) for a, b in pairs}
        return ('run-like' if alike and apart == {0.0} else
                'walk-like' if alike and apart == {0.5} else 'neither')


@dataclass(frozen=True)
class Preset:
    """A named parameter set and the gait it runs.

    Attributes:
        gait: one of the network's gaits.
        network: parameters.
        start: a state on the gait's orbit, shape (components,), where it has to be told from
            other orbits and from rest; None where the solver finds it by itself.
        period: of that orbit, model time, to about a per cent.

    """

    gait: str
    network: Network
    start: tuple[float, ...] | None = None
    period: float = 0.0


def known(gait: str, gaits: tuple[str, ...]) -> str:
    """Return the gait's name if it is one of the network's.

    Raises:
        ValueError: it is not.

    """
    if gait not in gaits:
        raise InputError(f"gait '{gait}' is not one of {', '.join(gaits)}")
    return gait
