"""What the command-line tools share: arguments that are refused in one line, and output."""

import argparse
import json
import math
import os
import sys
from typing import Any, NoReturn


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


def finite(tree: Any) -> Any:
    """Return the tree with None for numbers that JSON does not know."""
    if isinstance(tree, dict):
        return {key: finite(value) for key, value in tree.items()}
    if isinstance(tree, list | tuple):
        return [finite(value) for value in tree]
    return None if isinstance(tree, float) and not math.isfinite(tree) else tree


def as_json(tree: Any) -> str:
    """Return a tree of plain types as JSON."""
    return json.dumps(finite(tree), indent=2)


def say(text: str) -> None:
    """Print to a reader that may leave, as in ``... | head -1``."""
    try:
        print(text, flush=True)
    except BrokenPipeError:
        # Python flushes once more at its end: into nothing.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def table(rows: list[tuple[str, ...]], right: str = '') -> list[str]:
    """Align rows in columns, the first row being the head.

    Args:
        rows: texts.
        right: for each column '<' or '>', '<' for those not given.

    """
    widths = [max(len(row[k]) for row in rows) for k in range(len(rows[0]))]
    sides = right.ljust(len(widths), '<')
    return ['  '.join(f'{text:{side}{width}}' for text, side, width
                      in zip(row, sides, widths, strict=True)).rstrip() for row in rows]
