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

"""What the command-line tools share: arguments that are refused in one line, and printing."""

import argparse
import os
import sys
from typing import NoReturn

from cpg_ros.files.plain_text import printable


class Parser(argparse.ArgumentParser):
    """Says what is wrong in one line, with code 2."""

    def error(self, message: str) -> NoReturn:
        """Print the message and end."""
        print(f'{self.prog}: {message}', file=sys.stderr)
        sys.exit(2)


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


def twice(names: list[str]) -> str:
    """Return a name that is there twice, or ''."""
    return next((name for name in names if names.count(name) > 1), '')


def say(text: str) -> None:
    """Print to a reader that may leave, as in ``... | head -1``."""
    try:
        print(printable(text), flush=True)
    except BrokenPipeError:
        # Python flushes once more at its end: into nothing.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
