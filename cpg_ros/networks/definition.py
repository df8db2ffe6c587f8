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

"""Definition of a network: parameters, cells, equations, legs and gaits.

A state is a vector of ``components`` numbers, variable by variable: first the variable that legs
read (x or v) of every cell, then the next (w or u). All networks have the form ``dx/dt = f(x(t),
x(t - delay); p)``; networks without delay ignore the second argument.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, fields
from functools import cache
from typing import Any, ClassVar, Literal, TypeVar, Union

from cpg_ros.common.errors import InputError

#: What may stand in an equation.
Number = Union['Term', float]


def _operators(sign: str) -> tuple[Callable[['Term', Number], 'Term'],
                                   Callable[['Term', Number], 'Term']]:
    """Return a binary operator of terms, and the same operator with exchanged operands."""
    return (lambda term, other: Term(f'({term.text} {sign} {_text(other)})'),
            lambda term, other: Term(f'({_text(other)} {sign} {term.text})'))


class Term:
    """Part of an equation, as text that sympy reads."""

    __add__, __radd__ = _operators('+')
    __sub__, __rsub__ = _operators('-')
    __mul__, __rmul__ = _operators('*')
    __truediv__, __rtruediv__ = _operators('/')
    __pow__, __rpow__ = _operators('**')

    def __init__(self, text: str) -> None:
        """Wrap a text."""
        self.text = text

    def __neg__(self) -> 'Term':
        return Term(f'(-{self.text})')

    def __abs__(self) -> 'Term':
        return Term(f'Abs({self.text})')

    def _no_number(self, *_: object) -> Any:
        raise TypeError('terms of an equation are no numbers: they have no comparisons, max or '
                        'functions of math; take functions from cpg_ros.networks.definition, such '
                        'as positive(x) for max(0, x)')

    __lt__ = __le__ = __gt__ = __ge__ = __bool__ = __float__ = _no_number


def _text(value: Number) -> str:
    return value.text if isinstance(value, Term) else repr(value)


def _function(name: str) -> Callable[[Number], Term]:
    return lambda x: Term(f'{name}({_text(x)})')


#: Functions of terms, by the names that they have in mathematics.
_FUNCTION_NAMES = 'tanh', 'cosh', 'exp', 'log', 'sin', 'cos', 'sqrt'
tanh, cosh, exp, log, sin, cos, sqrt = map(_function, _FUNCTION_NAMES)
for _name in _FUNCTION_NAMES:
    # numpy's functions of an object are methods of it.
    setattr(Term, _name, _function(_name))


def positive(x: Number) -> Term:
    """Return max(0, x), which has a kink at 0."""
    return Term(f'(({_text(x)} + Abs({_text(x)})) / 2)')


# A cell of a network and its parameters, as the network's equations see them.

#: The cell from which each cell receives input, from 0.
Source = tuple[int, ...]
#: The same, or a rule: cell -> the cell that it receives input from, modulo the cells.
Inputs = Source | Callable[[int], int]


@dataclass(frozen=True)
class Argument:
    """A state variable in the equations of a cell.

    Attributes:
        variable: index of the variable, from 0.
        source: input cell of each cell; None for the cell itself.
        delayed: whether the value is the one a delay ago.

    """

    variable: int
    source: Source | None
    delayed: bool


class Cell:
    """A cell in the equations of its network."""

    def __init__(self, variables: int, cells: int) -> None:
        """Record the inputs that the equations read."""
        self._variables, self._cells = variables, cells
        self.arguments: list[Argument] = []

    def now(self, source: Inputs | None = None) -> tuple[Term, ...]:
        """Return the variables of the cell itself, or of its inputs."""
        return self._input(source, False)

    def past(self, source: Inputs | None = None) -> tuple[Term, ...]:
        """Return the same variables a delay ago."""
        return self._input(source, True)

    def _input(self, source: Inputs | None, delayed: bool) -> tuple[Term, ...]:
        if callable(source):
            source = tuple(source(i) % self._cells for i in range(self._cells))
        states = []
        for variable in range(self._variables):
            argument = Argument(variable, None if source is None else tuple(source), delayed)
            if argument not in self.arguments:
                self.arguments.append(argument)
            states.append(Term(f'x{self.arguments.index(argument)}'))
        return tuple(states)


class Parameters:
    """Parameters in a network's equations: one number each, or one for each cell; constants."""

    def __init__(self, names: Iterable[str], constants: Mapping[str, tuple[float, 'Range']]
                 ) -> None:
        """Define the parameters, the groups with one parameter for each cell, and constants."""
        self._known, self._constants = set(names), constants

    def __getattr__(self, name: str) -> Number:
        if name in self._constants:
            return self._constants[name][0]
        if name not in self._known:
            raise AttributeError(f"'{name}' is not one of {', '.join(sorted(self._known))}")
        return Term(f'p_{name}')


AnyDefinition = TypeVar('AnyDefinition', bound='NetworkDefinition')


@dataclass(frozen=True)
class Range:
    """Range and meaning of a parameter.

    Attributes:
        low: smallest value, in the parameter's own unit.
        high: largest value, in the same unit.
        text: description, with the unit in brackets if there is one.

    """

    low: float
    high: float
    text: str


class NetworkDefinition(ABC):
    """Parameters, cells and equations of a network, as a frozen dataclass of floats.

    Attributes:
        name: on the command line and in files.
        cells: number of cells.
        states: names of a cell's variables; legs read the first.
        variables: number of states of a cell.
        readout: signal that joints follow: the waveform of smooth cells, or the phase of
            relaxation oscillators, computed from two variables.
        delay_parameter: name of the delay, '' for an ordinary differential equation.
        longest_delay: largest delay at run time, model time.
        needed: parameter that must not be 0 -> consequence of 0.
        step: integration step in real time, model time; the error on an orbit is about 1e-9 a
            cycle.
        ranges: parameter -> range at run time.
        constants: constant of the equations -> value and range; see Network.varying.
        legs: assignment -> leg -> cells from 1; the first cell gives the leg's phase. The first
            assignment is the default.
        family: network from which this one was derived for another number of legs.
        sides: leg -> left or right; a robot file may state it instead.
        girdles: leg -> fore, middle or hind; a robot file may state it instead.
        muscles: muscle -> cell from 1, for reports and diagrams; empty where a cell drives a leg,
            which is in stance while the cell's signal falls.
        groups: name -> parameters that it sets together.
        own_of_cells: name in the equations -> parameter of each cell, where no group sets them
            together.
        kinks: variables at whose zeros the rates are not differentiable.
        couplings: parameters without which the cells are uncoupled.
        offsets: leg -> parameter with its phase lead in cycles, where any phases are a gait.
        unnamed: gait name of such a network for phases without a name.
        rests: whether a cell without input has an equilibrium, at which gaits bifurcate.
        usual_gait: default gait, and name of the default preset.
        usual_robot: default robot, a file or a shipped name.
        free: parameters or groups that a fit to a recording varies by default.
        line: default line in parameter space for Hopf points and branches, see ParameterLine.
        span: range of values on the line, or None for multiples of the delay.
        searched: parameter or group -> bounds of a search for weights; equal bounds fix it. Empty
            for no search.
        typical_cycle: middle, half range and lag in cycles of each variable on the cycle from
            which the search starts.

    """

    name: ClassVar[str]
    family: ClassVar['type[Any] | None'] = None
    cells: ClassVar[int]
    states: ClassVar[tuple[str, ...]]
    variables: ClassVar[int]
    readout: ClassVar[Literal['waveform', 'phase']]
    delay_parameter: ClassVar[str] = ''
    longest_delay: ClassVar[float] = 0.0
    needed: ClassVar[dict[str, str]] = {}
    step: ClassVar[float]
    ranges: ClassVar[dict[str, Range]]
    constants: ClassVar[dict[str, tuple[float, Range]]] = {}
    legs: ClassVar[dict[str, dict[str, tuple[int, ...]]]]
    sides: ClassVar[dict[str, str]] = {}
    girdles: ClassVar[dict[str, str]] = {}
    muscles: ClassVar[dict[str, int]] = {}
    groups: ClassVar[dict[str, tuple[str, ...]]] = {}
    own_of_cells: ClassVar[dict[str, tuple[str, ...]]] = {}
    kinks: ClassVar[tuple[str, ...]] = ()
    couplings: ClassVar[tuple[str, ...]] = ()
    offsets: ClassVar[dict[str, str]] = {}
    unnamed: ClassVar[str] = ''
    rests: ClassVar[bool] = True
    usual_gait: ClassVar[str]
    usual_robot: ClassVar[str] = ''
    free: ClassVar[tuple[str, ...]]
    line: ClassVar[str]
    span: ClassVar[tuple[float, float] | None] = None
    searched: ClassVar[dict[str, tuple[float, float]]] = {}
    typical_cycle: ClassVar[tuple[tuple[float, float, float], ...]] = ()

    def __init_subclass__(cls, **options: Any) -> None:
        super().__init_subclass__(**options)
        if hasattr(cls, 'states'):
            cls.variables = len(cls.states)

    @classmethod
    def fitted(cls, legs: int) -> dict[str, Any]:
        """Return the class attributes of this network for another number of legs: name -> value.

        A network for any even number derives cells, legs, sides, girdles and everything that
        depends on them by a rule; its ``equations`` state inputs by rules, too. The optional key
        ``fields`` names the parameters of the legs.

        Raises:
            InputError: the network does not take this number of legs.

        """
        raise InputError(f'the network {cls.name} has {leg_count(cls)} legs, not {legs}')

    def as_dict(self) -> dict[str, float]:
        """Return the parameters by name, in their order of declaration."""
        return {name: getattr(self, name) for name in self.parameters()}

    @classmethod
    def parameters(cls) -> tuple[str, ...]:
        """Return the names of the parameters, in their order of declaration."""
        return _names(cls)

    @classmethod
    def members(cls, name: str) -> tuple[str, ...]:
        """Return the parameters of a group, or the parameter of this name.

        Raises:
            InputError: the name is neither a parameter nor a group of the network.

        """
        members = cls.groups.get(name, (name,))
        if name in cls.constants:
            raise InputError(f"'{name}' is a constant of the network {cls.name}; it is a "
                             f'parameter of {cls.name}+{name}')
        if not set(members) <= set(cls.parameters()):
            names = ', '.join((*cls.groups, *cls.parameters()))
            raise InputError(f"'{name}' is not one of {names}")
        return members

    @property
    def components(self) -> int:
        """Length of a state."""
        return self.cells * self.variables

    @property
    def delay(self) -> float:
        """Delay of the rates, model time; 0 for an ordinary differential equation."""
        return float(getattr(self, self.delay_parameter)) if self.delay_parameter else 0.0

    @staticmethod
    @abstractmethod
    def equations(cell: Cell, p: Any) -> tuple[Number, ...]:
        """Return the rate of each variable of a cell; the same equations hold for all cells.

        Args:
            cell: gives variables: ``cell.now()`` those of the cell, ``cell.now(source)`` those of
                its input, ``cell.past(source)`` the same a delay ago. A source is a tuple of
                cells, or a function of a cell, modulo the number of cells.
            p: parameters by name, and groups with one parameter for each cell.

        """

    @classmethod
    @abstractmethod
    def gaits(cls) -> tuple[str, ...]:
        """Return the names of the gaits."""

    @classmethod
    def by_cell(cls) -> dict[str, tuple[str, ...]]:
        """Return name in the equations -> parameters of the cells."""
        return {**{name: members for name, members in cls.groups.items()
                   if len(members) == cls.cells}, **cls.own_of_cells}


def leg_count(network: type[NetworkDefinition]) -> int:
    """Return the number of legs of a network."""
    return len(next(iter(network.legs.values())))


@cache
def _names(network: type[NetworkDefinition]) -> tuple[str, ...]:
    return tuple(field.name for field in fields(network))  # type: ignore[arg-type]
