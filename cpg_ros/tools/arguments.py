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

"""Types of the tools' options: numbers, name=value, low:high, names without repetition."""

import argparse
from collections.abc import Sequence

from cpg_ros.errors import InputError


def number(text: str) -> float:
    """Read a number.

    Raises:
        argparse.ArgumentTypeError: it is none.

    """
    try:
        return float(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"'{text}' is not a number") from None


def assignment(text: str) -> tuple[str, float]:
    """Read ``name=value``.

    Raises:
        argparse.ArgumentTypeError: it is not of this form.

    """
    name, sign, value = text.partition('=')
    if not (name and sign):
        raise argparse.ArgumentTypeError(f"'{text}' is not of the form name=value")
    return name, number(value)


def interval(text: str) -> tuple[float, float]:
    """Read ``low:high``.

    Raises:
        argparse.ArgumentTypeError: it is not of this form.

    """
    low, colon, high = text.partition(':')
    if not colon:
        raise argparse.ArgumentTypeError(f"'{text}' is not of the form low:high")
    return number(low), number(high)


def named_interval(text: str, name: str = 'name') -> tuple[str, tuple[float, float]]:
    """Read ``name=low:high``, where the name may be a line of parameters, as ``alpha=beta``.

    Args:
        text: to read.
        name: what the message calls the name.

    Raises:
        argparse.ArgumentTypeError: it is not of this form.

    """
    line, sign, limits = text.rpartition('=')
    if not (line and sign and ':' in limits):
        raise argparse.ArgumentTypeError(f"'{text}' is not of the form {name}=low:high")
    return line, interval(limits)


def refuse_repeated(option: str, names: Sequence[str]) -> None:
    """Refuse names that an option gives twice.

    Raises:
        InputError: one is; the message begins with the option.

    """
    if name := next((name for name in names if names.count(name) > 1), ''):
        raise InputError(f'{option}: {name} is given twice')
