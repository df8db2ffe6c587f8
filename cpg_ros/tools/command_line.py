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

"""What every tool shares: its parser, messages of one line, and exit codes.

A tool is one file with a parser, a function that takes the parsed arguments and returns the exit
code, and ``main``, which passes both to ``run``. 0 is success, 1 a negative result, 2 unusable
input and 130 Ctrl-C; errors carry their own exit code (``CpgError.exit_code``).
"""

import argparse
from collections.abc import Callable, Sequence
import os
import shlex
import sys
from typing import Any, NoReturn

from cpg_ros.errors import CpgError
from cpg_ros.files.plain_text import printable

#: Exit code after Ctrl-C: 128 + the number of SIGINT.
INTERRUPTED = 130


class Parser(argparse.ArgumentParser):
    """Keeps the line breaks of its texts, and reports an error in one line, with code 2."""

    def __init__(self, **options: Any) -> None:
        super().__init__(**{'formatter_class': argparse.RawDescriptionHelpFormatter, **options})

    def error(self, message: str) -> NoReturn:
        """Print the message and exit."""
        note(self.prog, message)
        sys.exit(CpgError.exit_code)


def run(parser: Parser, work: Callable[[argparse.Namespace], int],
        arguments: Sequence[str] | None = None, stopped: str = 'stopped') -> int:
    """Parse a tool's command line and do its work; return the exit code.

    Args:
        parser: of the tool, whose name begins every message.
        work: takes the parsed arguments, and ``command``, the command line as one string; prints
            the result and returns the exit code. A CpgError or OSError that it raises becomes one
            line on stderr.
        arguments: default: those of the process.
        stopped: message after Ctrl-C, unless the KeyboardInterrupt has one; '' prints nothing.

    """
    words = sys.argv[1:] if arguments is None else list(arguments)
    chosen = parser.parse_args(words)
    chosen.command = shlex.join([parser.prog, *words])
    try:
        return work(chosen)
    except CpgError as error:
        note(parser.prog, str(error))
        return error.exit_code
    except OSError as error:
        named = error.filename is not None and error.strerror is not None
        note(parser.prog, f'{error.filename}: {error.strerror}' if named else str(error))
        return CpgError.exit_code
    except KeyboardInterrupt as interrupt:
        if message := str(interrupt) or stopped:
            note(parser.prog, message)
        return INTERRUPTED


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
