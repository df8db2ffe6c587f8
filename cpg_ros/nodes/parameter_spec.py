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

"""Descriptions of a node's parameters, and conversions of their values."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
import re
from typing import Any

from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor
from rclpy.parameter import Parameter

#: Name of a value of each type, for messages.
KINDS = {bool: 'a bool', int: 'an integer', float: 'a double', str: 'a string'}


#: In the constraints of a gait: what follows are presets whose names are not those of gaits.
PRESETS = '; presets: '


def one_of(words: Iterable[str], further: str = '') -> str:
    """Return the constraints of a parameter that is one of some words; ``further`` is added."""
    return 'one of: ' + ', '.join(words) + further


def choices(constraints: str) -> list[str]:
    """Return the words that a descriptor's constraints list, if they are those of one_of."""
    found = re.search(r'one of: (.*)', constraints)
    words = re.split(f', |{PRESETS}', found[1]) if found else []
    return [word for word in words if re.fullmatch(r'[\w.-]+', word)]


def presets_among(constraints: str) -> list[str]:
    """Return those of the choices that the constraints list as presets with other names."""
    return choices(f'one of: {constraints.partition(PRESETS)[2]}')


@dataclass(frozen=True)
class Spec:
    """One parameter: default, description, range of a number, whether it is read-only."""

    default: Any
    text: str
    low: float | None = None
    high: float | None = None
    read_only: bool = False
    constraints: str = ''

    def descriptor(self) -> ParameterDescriptor:
        """Return it as a ROS descriptor."""
        made = ParameterDescriptor(description=self.text, read_only=self.read_only,
                                   additional_constraints=self.constraints)
        if self.low is not None and self.high is not None:
            if isinstance(self.default, int):
                made.integer_range = [IntegerRange(from_value=int(self.low),
                                                   to_value=int(self.high), step=1)]
            else:
                made.floating_point_range = [FloatingPointRange(from_value=self.low,
                                                                to_value=self.high)]
        return made


def fixed(specs: Mapping[str, Spec]) -> dict[str, Spec]:
    """Return the same parameters, which can be set at the start only."""
    return {name: replace(spec, read_only=True) for name, spec in specs.items()}


def as_doubles(parameters: list[Parameter], doubles: set[str]) -> list[Parameter]:
    """Turn whole numbers given for floating-point parameters into doubles.

    ``ros2 param set /cpg_generator frequency 2`` sends an integer; refusing it would be pedantry.
    """
    return [Parameter(p.name, Parameter.Type.DOUBLE, float(p.value))
            if p.name in doubles and p.type_ == Parameter.Type.INTEGER else p
            for p in parameters]


def as_list(parameter: Parameter, default: list) -> Parameter:
    """Turn one value, or whole numbers, given for a list of such values into the list."""
    value = parameter.value
    given = value if parameter.type_.name.endswith('_ARRAY') else [value]
    wanted = type(default[0]) if default else str
    if wanted is float and all(type(one) in (int, float) for one in given):
        return Parameter(parameter.name, Parameter.Type.DOUBLE_ARRAY, [float(x) for x in given])
    return Parameter(parameter.name, value=[value]) if type(value) is wanted else parameter


def kind_of(default: Any) -> str:
    """Return what a parameter with a default must be, for messages."""
    if isinstance(default, list):
        return f'a list of {KINDS[type(default[0]) if default else str].split()[1]}s'
    return KINDS[type(default)]
