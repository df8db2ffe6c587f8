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

"""Declaration of a feedback law beside its kernel: switch, gains and state."""

from collections import namedtuple
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
import math
from typing import Any

from cpg_ros.dynamics.integration.compilation import jit


@dataclass(frozen=True)
class Gain:
    """A gain of a law.

    Attributes:
        default: found on a simulated Go2.
        high: upper limit.
        unit: '' for a pure number.
        text: effect, without the unit.
        low: lower limit.

    """

    default: float
    high: float
    unit: str
    text: str
    low: float = 0.0


@dataclass(frozen=True)
class StateVariable:
    """An array that persists between ticks; its first axis is the run.

    Attributes:
        text: meaning, with the unit.
        shape: for one run; 'legs' stands for their number.
        initial: value at the start; its type is the array's.

    """

    text: str
    shape: tuple[int | str, ...] = ()
    initial: float | bool = 0.0


@dataclass(frozen=True)
class Law:
    """A feedback law.

    Attributes:
        name: of its switch.
        text: effect.
        on: whether it is on by default.
        gains: by name; names of all laws differ.
        memory: state variables by name; names of all laws differ.

    """

    name: str
    text: str
    on: bool
    gains: Mapping[str, Gain]
    memory: Mapping[str, StateVariable] = field(default_factory=dict)


@jit
def limited(value, most):
    """Return a value with its size limited."""
    return min(max(value, -most), most)


@jit
def low_passed(value, target, time, dt):
    """Return a low-passed value, dt in s later; the filter's time constant in s."""
    return value + (1.0 - math.exp(-dt / time)) * (target - value)


def named_tuple(name: str, fields: Iterable[str], defaults: Iterable[Any] = ()) -> Any:
    """Return a class of named tuples with fields that the laws name, unknown to mypy."""
    return namedtuple(name, tuple(fields), defaults=tuple(defaults))
