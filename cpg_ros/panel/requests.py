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

"""The requests of a page, checked completely before they are carried out."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
import json
import math
from typing import Any

from cpg_ros.errors import CpgError

#: Longest text in a request, characters.
LONGEST = 500
#: Hardest push, N.
HARDEST = 500.0


class RequestError(CpgError):
    """A page's request is invalid, or cannot be carried out; one line for that page."""


@dataclass(frozen=True)
class Request:
    """An action and its values; ``stamp`` is the newest one that the page had received, s."""

    action: str
    values: Mapping[str, Any] = field(default_factory=dict)
    stamp: float | None = None


def _text(value: Any) -> str:
    if not isinstance(value, str) or len(value) > LONGEST or not value.isprintable():
        raise RequestError(f'must be text of at most {LONGEST} characters')
    return value


def _flag(value: Any) -> bool:
    if not isinstance(value, bool):
        raise RequestError('must be true or false')
    return value


def _number(low: float, high: float) -> Callable[[Any], float]:
    def check(value: Any) -> float:
        if (isinstance(value, bool) or not isinstance(value, (int, float))
                or not low <= value <= high):
            raise RequestError(f'must be a number from {low:g} to {high:g}')
        return float(value)

    return check


def _setting(value: Any) -> bool | int | float | str:
    """Return the value for a parameter; its node checks kind and range."""
    if isinstance(value, str):
        return _text(value)
    if isinstance(value, bool):
        return value
    if isinstance(value, int) and -2**63 <= value < 2**63:
        return value
    if isinstance(value, float) and math.isfinite(value):
        return value
    raise RequestError('must be true or false, text or a finite number')


#: Action -> its values, and the check of each. A direction is in degrees to the left.
ACTIONS: dict[str, dict[str, Callable[[Any], Any]]] = {
    'choose': {'node': _text}, 'set': {'name': _text, 'value': _setting},
    'steer': {'speed': _number(-1.0, 1.0), 'turn': _number(-1.0, 1.0)},
    'alive': {}, 'take_over': {}, 'release': {}, 'stop': {}, 'enable': {'on': _flag}, 'reset': {},
    'sit': {'bridge': _text}, 'damp': {'bridge': _text},
    'push': {'force': _number(0.0, HARDEST), 'direction': _number(-360.0, 360.0)},
    'record': {'on': _flag}, 'fit': {}}


def _constant(name: str) -> float:
    raise RequestError(f'{name} is not a number')


def read(text: str | bytes) -> Request:
    """Parse a message of a page.

    Raises:
        RequestError: anything in it is invalid.

    """
    if not isinstance(text, str):
        raise RequestError('a request must be text')
    try:
        found = json.loads(text, parse_constant=_constant)
    except RequestError:
        raise
    except (ValueError, RecursionError) as error:
        raise RequestError('the request is not JSON') from error
    if not isinstance(found, dict):
        raise RequestError('a request must be a JSON object')
    action = found.pop('do', None)
    if not isinstance(action, str) or action not in ACTIONS:
        raise RequestError(f"'do' is not one of {', '.join(ACTIONS)}")
    wanted = ACTIONS[action]
    stamp = found.pop('stamp', None)
    if stamp is not None:
        try:
            stamp = _number(0.0, 1e12)(stamp)
        except RequestError as error:
            raise RequestError(f'{action}: stamp {error}') from error
    if set(found) != set(wanted):
        raise RequestError(f"'{action}' takes {', '.join(wanted) or 'nothing'}")
    values = {}
    for name, check in wanted.items():
        try:
            values[name] = check(found[name])
        except RequestError as error:
            raise RequestError(f'{action}: {name} {error}') from error
    return Request(action, values, stamp)
