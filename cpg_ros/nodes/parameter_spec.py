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

"""What a node's parameters are, and the numbers that they are given."""

from collections.abc import Iterable
from dataclasses import dataclass, replace
import re
from typing import Any

from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor
from rclpy.parameter import Parameter

#: What a value of a type is called.
KINDS = {bool: 'a bool', int: 'an integer', float: 'a double', str: 'a string'}


def one_of(words: Iterable[str], further: str = '') -> str:
    """Return the constraints of a text that is one of some words, and what else it may be."""
    return 'one of: ' + ', '.join(words) + further


def choices(constraints: str) -> list[str]:
    """Return the words that a descriptor's constraints list, if they are those of one_of."""
    found = re.search(r'one of: (.*)', constraints)
    words = found[1].split(', ') if found else []
    return [word for word in words if re.fullmatch(r'[\w.-]+', word)]


@dataclass(frozen=True)
class Spec:
    """One parameter: default, what it is, its range if it is a number, whether it is fixed."""

    default: Any
    text: str
    low: float | None = None
    high: float | None = None
    read_only: bool = False
    constraints: str = ''

    def fixed(self) -> 'Spec':
        """Return the same parameter, to be set at the start only."""
        return replace(self, read_only=True)

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
    """Say what a parameter of a default must be."""
    if isinstance(default, list):
        return f'a list of {KINDS[type(default[0]) if default else str].split()[1]}s'
    return KINDS[type(default)]
