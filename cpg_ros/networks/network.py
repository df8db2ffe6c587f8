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

"""Base class of networks: rates, presets, symmetries of gaits, and defaults.

``networks.definition`` defines parameters, cells and equations. In a network of
amplitude-controlled phase oscillators, parameters state the phases of the legs; the gait is the
named one with the nearest phases.
"""

from abc import abstractmethod
from collections.abc import Callable, Mapping
import dataclasses
from dataclasses import dataclass, replace
from functools import cache, lru_cache, wraps
from typing import Any, ClassVar, NamedTuple, TypeAlias, TypeVar

from cpg_ros.common.errors import InputError
from cpg_ros.networks import presets as preset_files
from cpg_ros.networks.definition import leg_count, NetworkDefinition, Range
from cpg_ros.networks.equations import Field, values_of
from cpg_ros.networks.leg_numbers import unpickle
from cpg_ros.networks.symmetry import Symmetry
import numpy as np

#: Names that a file with a user's own network imports from here.
__all__ = ['Network', 'Preset', 'Range', 'known']

AnyNetwork = TypeVar('AnyNetwork', bound='Network')
Preset: TypeAlias = preset_files.Preset['Network']


class LeastCoupling(NamedTuple):
    """A coupling, such as '|c|', its value, and the value that is needed."""

    text: str
    value: float
    least: float


class Network(NetworkDefinition):
    """Parameters of a network, as a frozen dataclass of floats; see NetworkDefinition.

    Attributes:
        varied: network from which this one was derived by ``varying``, and the constants; or ().

    """

    varied: ClassVar[tuple[Any, ...]] = ()

    def __init_subclass__(cls, **options: Any) -> None:
        super().__init_subclass__(**options)
        if 'symmetry' in cls.__dict__:
            cls.symmetry = _of_cell(cls.symmetry)  # type: ignore[assignment,method-assign]

    def __reduce__(self) -> Any:
        if self.varied:
            return _unpickle, (*self.varied, tuple(self.as_dict().values()))
        if self.family is None:
            return super().__reduce__()
        return unpickle, (self.family, leg_count(type(self)), tuple(self.as_dict().values()))

    def rates(self, x: np.ndarray, past: np.ndarray | None = None) -> np.ndarray:
        """Return the right-hand side at a state now and a delay ago, by default the same state."""
        return Field(self).rates(x, past)

    def jacobian(self, x: np.ndarray, past: np.ndarray | None = None) -> np.ndarray:
        """Return the derivative of the rates by the state now, (..., components, components)."""
        return Field(self).linearised(x, past)[1]

    def by_parameter(self, x: np.ndarray, past: np.ndarray | None = None) -> np.ndarray:
        """Return the derivative of the rates by the parameters, (..., components, parameters)."""
        return Field(self).by_parameter(x, past)

    def replace(self: AnyNetwork, **values: float) -> AnyNetwork:
        """Return the network with other values of parameters or groups, by name.

        Raises:
            InputError: a name is neither a parameter nor a group of the network.

        """
        changes: dict[str, float] = {}
        for name, value in values.items():
            changes |= dict.fromkeys(self.members(name), value)
        return dataclasses.replace(self, **changes)  # type: ignore[type-var]

    def grouped(self) -> dict[str, float]:
        """Return name -> value, with one entry for each group of parameters that are equal."""
        values = self.as_dict()
        for name, members in self.groups.items():
            if len({values[member] for member in members}) == 1:
                values = {name if key == members[0] else key: value for key, value
                          in values.items() if key == members[0] or key not in members}
        return values

    @property
    def coefficients(self) -> np.ndarray:
        """Parameters as the kernel takes them, one value for each cell, shape (rows, cells)."""
        return np.array([np.broadcast_to(value, self.cells) for value in values_of(self)],
                        dtype=float)

    @classmethod
    def varying(cls, *names: str) -> 'type[Network]':
        """Return this network with constants of its equations as further parameters.

        Its name is ``quadruped+current`` for the constant ``current`` of the network quadruped.

        Raises:
            InputError: a name is not that of a constant.

        """
        for name in names:
            if name not in cls.constants:
                raise InputError(f"'{name}' is not a constant of the network {cls.name}: "
                                 f'{", ".join(cls.constants) or "it has none"}')
        return _varying(cls, tuple(dict.fromkeys(names))) if names else cls

    @classmethod
    def presets(cls) -> dict[str, Preset]:
        """Return the presets, from the file beside the network's module or the shipped one.

        Raises:
            PresetError: there is no such file, or it cannot be used.

        """
        return preset_files.own_presets(cls)

    @abstractmethod
    def symmetry(self, gait: str) -> Symmetry:
        """Return the gait's symmetry: phases and waves of the cells, basis of the symmetry lock.

        Raises:
            ValueError: the network has no gait of this name.

        """

    @property
    def leads(self) -> tuple[float, ...]:
        """Phase of each cell relative to cell 1, cycles, where parameters state it; else ()."""
        if not self.offsets:
            return ()
        by_cell = [0.0] * self.cells
        for leg, cells in next(iter(self.legs.values())).items():
            for cell in cells:
                by_cell[cell - 1] = float(getattr(self, self.offsets[leg]))
        return tuple((lead - by_cell[0]) % 1.0 for lead in by_cell)

    def with_phases(self: AnyNetwork, phases: Mapping[str, float]) -> AnyNetwork:
        """Return the network with these phases of its legs, cycles; itself if it states none."""
        offsets = {self.offsets[leg]: float((phase + 0.5) % 1.0 - 0.5)
                   for leg, phase in phases.items() if leg in self.offsets}
        return self.replace(**offsets) if offsets else self

    def on_orbit(self, gait: str) -> tuple[np.ndarray, float] | None:
        """Return a state near the gait's orbit and its period, where both are known in advance.

        The state has shape (components,), with cell 1 at its peak; the period is in model time.
        """
        return None

    def at_rest(self) -> np.ndarray | None:
        """Return the equilibrium of every cell, (variables,), where it is known in advance."""
        return None

    @classmethod
    def families(cls, symmetry: Symmetry) -> tuple[tuple[str, ...], ...]:
        """Return the sets of parameters that a gait's symmetry makes equal."""
        return tuple((name,) for name in cls.parameters())

    def sufficient_gain(self, rate: float) -> float | None:
        """Return a symmetry gain at which every gait is attracting in any state, 1/model time.

        Return None where no such bound is known; the gain then follows from the gait's
        multipliers.

        Args:
            rate: decay of disturbances transverse to the gait's class, 1/model time.

        """
        return None

    def least_coupling(self, gait: str) -> LeastCoupling | None:
        """Return the coupling above which a gait bifurcates at some delay, if it is known."""
        return None

    def validate_gait(self, gait: str) -> str:
        """Return why the parameters rule a gait out, if it is known in advance, or ''."""
        return ''

    def broken(self, symmetry: Symmetry) -> str:
        """Name parameters that the symmetry requires to be equal and that differ, or ''."""
        values = self.as_dict()
        return next((', '.join(family) for family in self.families(symmetry)
                     if len({values[name] for name in family}) > 1), '')

    def character(self, gait: str, assignment: str) -> str:
        """Tell whether a gait is walk-like or run-like (Buono & Golubitsky 2001, section 7).

        Walk-like: the two cells of every leg, flexor and extensor, are half a cycle apart;
        run-like: they are in phase. Otherwise, and where a leg does not have two cells, it is
        neither.

        Raises:
            ValueError: an unknown gait, or an assignment that is not in ``legs``.

        """
        if assignment not in self.legs:
            raise InputError(f"assignment '{assignment}' is not one of {', '.join(self.legs)}")
        symmetry = self.symmetry(gait)
        legs = self.legs[assignment].values()
        if any(len(cells) != 2 for cells in legs):
            return 'neither'
        pairs = [(a - 1, b - 1) for a, b in legs]
        same_wave = all(symmetry.waves[a] == symmetry.waves[b] for a, b in pairs)
        shifts = {float((symmetry.phases[b] - symmetry.phases[a]) % 1.0) for a, b in pairs}
        return ('run-like' if same_wave and shifts == {0.0} else
                'walk-like' if same_wave and shifts == {0.5} else 'neither')


@cache
def _varying(network: type[Network], names: tuple[str, ...]) -> type[Network]:
    values = {name: network.constants[name][0] for name in names}
    limits = {name: network.constants[name][1] for name in names}

    def presets(cls: type[Network]) -> dict[str, Preset]:
        return {name: replace(preset, network=cls(**preset.network.as_dict()))
                for name, preset in network.presets().items()}

    return dataclass(frozen=True)(type(f'{network.__name__}With{"And".join(names)}', (network,), {
        '__module__': network.__module__, '__doc__': network.__doc__,
        '__annotations__': dict.fromkeys(names, float), **values,
        'name': '+'.join((network.name, *names)), 'varied': (network, names),
        'ranges': network.ranges | limits, 'presets': classmethod(presets),
        'constants': {name: value for name, value in network.constants.items()
                      if name not in names},
        'searched': network.searched and network.searched | {
            name: (value, value) for name, value in values.items()}}))


def _unpickle(network: type[Network], names: tuple[str, ...], values: tuple[float, ...]
              ) -> Network:
    return network.varying(*names)(*values)


def _of_cell(symmetry: Callable[[Any, str], Symmetry]) -> Callable[[Any, str], Symmetry]:
    """Give symmetries the number of variables of the network's cells."""
    @wraps(symmetry)
    def sized(network: Any, gait: str) -> Symmetry:
        return symmetry(network, gait).with_variables(type(network).variables)

    return sized


def known(gait: str, gaits: tuple[str, ...]) -> str:
    """Return the gait's name if it is one of the network's.

    Raises:
        ValueError: it is not.

    """
    if gait not in gaits:
        raise InputError(f"gait '{gait}' is not one of {', '.join(gaits)}")
    return gait


@dataclass(frozen=True)
class ParameterLine:
    """Parameters that are plus or minus one value; written ``alpha=-beta``.

    Attributes:
        names: of the parameters.
        signs: 1.0 or -1.0 for each; the first is 1.

    """

    names: tuple[str, ...]
    signs: tuple[float, ...]

    @classmethod
    def parse(cls, text: str, network: type[Network]) -> 'ParameterLine':
        """Read ``tau``, ``alpha=beta``, ``alpha=-beta`` or a group of the network (``w_a``).

        Raises:
            InputError: a name is not a parameter of the network, or occurs twice.

        """
        names: list[str] = []
        signs: list[float] = []
        for term in text.split('='):
            name = term.strip().removeprefix('-')
            members = network.members(name)
            for member in members:
                if member in names:
                    raise InputError(f"'{text}' names {member} twice")
            sign = -1.0 if term.strip().startswith('-') else 1.0
            if not names and sign < 0.0:
                raise InputError(f"'{text}' must not begin with a minus")
            names.extend(members)
            signs.extend([sign] * len(members))
        return cls(tuple(names), tuple(signs))

    @classmethod
    def of(cls, line: 'ParameterLine | str', network: type[Network]) -> 'ParameterLine':
        """Return the line itself, or the line that a text names; see parse."""
        return cls.parse(line, network) if isinstance(line, str) else line

    def __str__(self) -> str:
        return '='.join(('' if sign > 0.0 else '-') + name
                        for name, sign in zip(self.names, self.signs, strict=True))

    def value(self, network: Network) -> float:
        """Return the network's value on the line: its first parameter."""
        return network.as_dict()[self.names[0]]

    def direction(self, network: Network) -> np.ndarray:
        """Return the derivative of the parameters by the value on the line, (parameters,)."""
        signs = dict(zip(self.names, self.signs, strict=True))
        return np.array([signs.get(name, 0.0) for name in network.parameters()])

    def at(self, network: AnyNetwork, value: float) -> AnyNetwork:
        """Return the network with the parameters set."""
        return replace(network, **{  # type: ignore[type-var]
            name: sign * value for name, sign in zip(self.names, self.signs, strict=True)})


#: MAX_ASYMMETRY: change of the rates by a symmetry, over their size, that may be a rounding
#: error; NUM_STATES: random states at which it is computed.
MAX_ASYMMETRY, NUM_STATES = 1e-9, 8


@lru_cache(maxsize=256)
def asymmetry(network: Network, symmetry: Symmetry) -> float:
    """Return by how much a stated symmetry changes the rates, over their size, at random states.

    It is 0 up to rounding if the equations have the symmetry.
    """
    field, variables = Field(network), network.variables
    cells = np.arange(variables)[:, None] * network.cells
    now, past = np.random.default_rng(0).standard_normal((2, NUM_STATES, network.components))
    images = [((cells + np.array(symmetry.group.elements[name])).ravel(), 1.0)
              for name in symmetry.h]
    if symmetry.odd:
        images.append((np.arange(network.components), -1.0))
    with np.errstate(all='ignore'):
        rates = field.rates(now, past)
        sizes = np.abs(rates).reshape(NUM_STATES, variables, -1).max(axis=(0, 2))
        gaps = [np.abs(field.rates(sign * now[:, image], sign * past[:, image])
                       - sign * rates[:, image]) / sizes.repeat(network.cells)
                for image, sign in images]
    return float(np.nan_to_num(gaps, nan=0.0, posinf=0.0).max())


#: Largest RMS difference of the legs' phases from a named gait, cycles. A quarter of the way from
#: one gait to the next has about 0.05.
GAIT_TOLERANCE = 0.06


def stated_gait(network: Network) -> str:
    """Return the gait that a network's offsets state.

    It is the nearest named one within GAIT_TOLERANCE, otherwise the ``unnamed`` one; '' for a
    network without offsets.
    """
    return _nearest(type(network), network.leads) if network.offsets else ''


def other_gait(network: Network, gait: str) -> str:
    """Return the gait that a network's offsets state instead of another one, or ''."""
    gait_name = stated_gait(network)
    if gait_name in ('', gait):
        return ''
    if gait_name == network.unnamed:
        return f"the offsets make no {gait} and no other gait with a name: it is '{gait_name}'"
    return f"the offsets make the {gait_name}, not '{gait}'"


@lru_cache(maxsize=1024)
def _nearest(network: type[Network], leads: tuple[float, ...]) -> str:
    cells = [numbers[0] - 1 for numbers in next(iter(network.legs.values())).values()]
    presets = network.presets()
    phases_of = {gait: np.array(presets[gait].network.leads)[cells] for gait in network.gaits()
                 if gait != network.unnamed and gait in presets}
    if not phases_of or not np.isfinite(leads).all():
        return network.unnamed
    gait, distance, *_ = nearest_gait(np.array(leads)[cells], phases_of)
    return gait if distance <= GAIT_TOLERANCE else network.unnamed


def nearest_gait(phases: np.ndarray, table: Mapping[str, np.ndarray]
                 ) -> tuple[str, float, str | None, float]:
    """Find the gait with the nearest leg phases.

    Args:
        phases: of the legs, cycles, shape (legs,).
        table: name -> phases of the same legs; a reversed wave is a gait of its own.

    Returns:
        Name and distance of the nearest gait, the second nearest (None if there is no other), and
            the difference of their distances. Distances are RMS over the legs, in cycles, after
            the best common shift.

    Raises:
        InputError: a phase is not finite.
        ValueError: the table is empty, or shapes do not fit.

    """
    phases = np.asarray(phases, dtype=float)
    if not table:
        raise ValueError('table is empty')
    distances = {}
    for name, reference in table.items():
        target = np.asarray(reference, dtype=float)
        if phases.ndim != 1 or not phases.size or target.shape != phases.shape:
            raise ValueError(f'phases have the shape {phases.shape}, those of {name!r} '
                             f'{target.shape}; both must be (legs,)')
        if not np.isfinite(phases + target).all():
            raise InputError(f'a phase is not finite: {phases}, {name!r} {target}')
        ahead = np.sort((phases - target) % 1.0)
        # The circular mean of least squares cuts the circle between two of the legs.
        cuts = ahead + np.tri(ahead.size, k=-1)
        distances[name] = float(cuts.std(axis=1).min())
    nearest, *others = sorted(distances, key=distances.__getitem__)
    second = others[0] if others else None
    return (nearest, distances[nearest], second,
            distances[second] - distances[nearest] if second is not None else np.inf)
