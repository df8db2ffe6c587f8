"""What a node's parameters are, and the numbers that they are given."""

from dataclasses import dataclass, replace
from typing import Any

from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor
from rclpy.parameter import Parameter

#: What a value of a type is called.
KINDS = {bool: 'a bool', int: 'an integer', float: 'a double', str: 'a string',
         list: 'a list of strings'}


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


def of_numbers(default: object) -> bool:
    """Tell whether a default is a list of numbers, and not one of strings."""
    return isinstance(default, list) and bool(default) and isinstance(default[0], float)


def kind_of(default: object) -> str:
    """Return what values like a default are called."""
    return 'a list of numbers' if of_numbers(default) else KINDS[type(default)]


def as_numbers(parameter: Parameter) -> Parameter:
    """Turn one number or whole numbers, given for a list of numbers, into such a list."""
    types = Parameter.Type
    if parameter.type_ in (types.INTEGER, types.DOUBLE):
        return Parameter(parameter.name, types.DOUBLE_ARRAY, [float(parameter.value)])
    if parameter.type_ == types.INTEGER_ARRAY:
        return Parameter(parameter.name, types.DOUBLE_ARRAY, [float(x) for x in parameter.value])
    return parameter
