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

"""The parser, messages and exit codes of all executables.

A tool is one file with a parser, a function that takes the parsed arguments and returns the exit
code, and ``main``, which passes both to ``run``. 0 is success, 1 a negative result, 2 unusable
input and 130 Ctrl-C; errors carry their own exit code (``CpgError.exit_code``).
"""

import argparse
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
import json
import math
import os
import re
import shlex
import sys
import time
from typing import Any, NoReturn

from cpg_ros.common.errors import CpgError, InputError

# Types of the tools' options: numbers, name=value, low:high, names without repetition.

def number(text: str) -> float:
    """Read a number.

    Raises:
        argparse.ArgumentTypeError: the text is not a number.

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
    """Read ``name=low:high``, where the name may be a line of parameters, such as ``alpha=beta``.

    Args:
        text: to read.
        name: of the name, for the message.

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
        InputError: a name is repeated; the message begins with the option.

    """
    if name := next((name for name in names if names.count(name) > 1), ''):
        raise InputError(f'{option}: {name} is given twice')


# Plain text: JSON without numbers that it lacks, and tables in aligned columns.

#: Characters that stand for bytes of a file's name that are not UTF-8 (surrogate escapes).
_SURROGATE = re.compile('[\udc80-\udcff]')


def printable(text: str) -> str:
    r"""Return a text that UTF-8 can encode; undecodable bytes are written as \xff."""
    text = _SURROGATE.sub(lambda byte: f'\\x{ord(byte[0]) - 0xdc00:02x}', text)
    return text.encode(errors='backslashreplace').decode()


def finite(tree: Any) -> Any:
    """Return the tree with None for numbers that JSON does not have."""
    if isinstance(tree, dict):
        return {key: finite(value) for key, value in tree.items()}
    if isinstance(tree, list | tuple):
        return [finite(value) for value in tree]
    return None if isinstance(tree, float) and not math.isfinite(tree) else tree


def as_json(tree: Any) -> str:
    """Return a tree of plain types as JSON."""
    return json.dumps(finite(tree), indent=2)


def table(rows: Sequence[tuple[str, ...]], right: str = '') -> list[str]:
    """Align rows in columns; the first row is the head.

    Args:
        rows: texts.
        right: '<' or '>' for each column, '<' by default.

    """
    widths = [max(len(row[k]) for row in rows) for k in range(len(rows[0]))]
    sides = right.ljust(len(widths), '<')
    return ['  '.join(f'{text:{side}{width}}' for text, side, width
                      in zip(row, sides, widths, strict=True)).rstrip() for row in rows]


# A progress bar on standard error, shown only when work takes longer than two seconds.

PROGRESS_DELAY = 2.0
BAR_WIDTH = 30


@contextmanager
def progress_bar(what: str, total: int, enabled: bool = True) -> Iterator[Callable[[int], None]]:
    """Yield a function that takes the finished amount.

    On a terminal the bar is redrawn in place; elsewhere (a log) it is a line every tenth.
    """
    started = time.monotonic()
    live = sys.stderr.isatty()
    last = -1

    def update(count: int) -> None:
        nonlocal last
        elapsed = time.monotonic() - started
        if not enabled or elapsed < PROGRESS_DELAY or (count >= total and last < 0):
            return
        fraction = count / total
        mark = int(fraction * (100 if live else 10))
        if mark == last:
            return
        last = mark
        bar = '#' * int(fraction * BAR_WIDTH)
        line = f'{what} [{bar:<{BAR_WIDTH}}] {fraction:4.0%}' + (
            f', {elapsed / fraction - elapsed:.0f} s left' if fraction else '')
        sys.stderr.write(f'\r{line}\x1b[K' if live else line + '\n')
        sys.stderr.flush()

    try:
        yield update
    finally:
        if live and last >= 0:
            sys.stderr.write('\n')


#: Exit code after Ctrl-C: 128 + the number of SIGINT.
EXIT_INTERRUPTED = 130


class Parser(argparse.ArgumentParser):
    """Parser that keeps line breaks, and reports an error in one line, with exit code 2."""

    def __init__(self, **options: Any) -> None:
        super().__init__(**{'formatter_class': argparse.RawDescriptionHelpFormatter, **options})
        self.description = self.description and self.description.strip()
        # So that a value such as -0.6:0.2 is not taken for an option.
        self._negative_number_matcher = re.compile(r'-\.?\d')

    def error(self, message: str) -> NoReturn:
        """Print the message and exit."""
        note(self.prog, message)
        sys.exit(CpgError.exit_code)


def run(parser: Parser, work: Callable[[argparse.Namespace], int],
        arguments: Sequence[str] | None = None, stopped: str = 'stopped') -> int:
    """Parse a tool's command line and do its work; return the exit code.

    Args:
        parser: of the tool, whose name begins every message.
        work: takes the parsed arguments, with the command line in ``command``; prints the result
            and returns the exit code. A CpgError or OSError becomes one line on stderr.
        arguments: by default those of the process.
        stopped: message after Ctrl-C, unless the KeyboardInterrupt has one; '' prints nothing.

    """
    words = sys.argv[1:] if arguments is None else list(arguments)
    args = parser.parse_args(words)
    args.command = shlex.join([parser.prog, *words])
    try:
        return work(args)
    except CpgError as error:
        note(parser.prog, str(error))
        return error.exit_code
    except OSError as error:
        has_path = error.filename is not None and error.strerror is not None
        note(parser.prog, f'{error.filename}: {error.strerror}' if has_path else str(error))
        return CpgError.exit_code
    except KeyboardInterrupt as interrupt:
        if message := str(interrupt) or stopped:
            note(parser.prog, message)
        return EXIT_INTERRUPTED


def note(tool: str, line: str) -> None:
    """Print a tool's line on stderr."""
    print(f'{tool}: {line}', file=sys.stderr, flush=True)


def say(text: str) -> None:
    """Print to a pipe whose reader may close it, as in ``... | head -1``."""
    try:
        print(printable(text), flush=True)
    except BrokenPipeError:
        # Python flushes once more at its end: into nothing.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
