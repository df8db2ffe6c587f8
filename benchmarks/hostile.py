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

"""Random requests to a generator's parameter services that no sane client would send.

``requests`` is seeded and knows nothing of the node but its parameters' names and types;
``effect`` says what an answer must have done to the values. The benchmark and the tests use both.
Never in a request: a rate that may be accepted (a rate of 1 Hz is a fair wish, but it would hide
whether publishing pauses).
"""

from collections.abc import Iterator, Mapping, Sequence
import math
import random

from rcl_interfaces.msg import Parameter, ParameterValue, SetParametersResult

FIELDS = {1: 'bool_value', 2: 'integer_value', 3: 'double_value', 4: 'string_value',
          5: 'byte_array_value', 6: 'bool_array_value', 7: 'integer_array_value',
          8: 'double_array_value', 9: 'string_array_value'}
NUMBERS = (math.nan, math.inf, -math.inf, -1.0, -0.0, 0.0, 1e-320, -1e-300, 1e-12, 1e9, -1e9, 1e18,
           1.7976931348623157e308, -1.7976931348623157e308, 0.285, 2.5e-3, 4.9999, 1e5)
INTEGERS = (0, -1, 1, 7, 2**31, -2**31, 2**53 + 1, 2**63 - 1, -2**63)
STRINGS = ('', ' ', 'nan', 'trot ', 'TROT', 'gallop', '../../etc/passwd', "'; drop", '\n\t\r',
           'a' * 70_000, 'ü∂🐐' * 5_000, '%s%n{0}', 'None', '1.0')
#: Values that may well be accepted, so that the node's state changes between the refusals.
GAITS = ('walk', 'trot', 'pace', 'bound', 'jump', 'pronk', 'liu2024_pace', 'goat_trot')
FAIR = {'frequency': (0.0, 3.0), 'amplitude': (0.0, 1.2), 'transition': (0.0, 3.0),
        'ramp': (0.0, 2.0), 'symmetry_gain': (0.0, 30.0), 'delayed.a': (-6.0, -1.0),
        'delayed.b': (0.0, 2.0), 'delayed.c': (-8.0, 8.0), 'delayed.d': (-3.0, 3.0),
        'delayed.tau': (0.1, 1.0)}
UNKNOWN = ('', 'nope', 'delayed', 'delayed.', 'delayed.e', '.a', 'gait.gait', 'Gait', 'x' * 10_000,
           'quadruped.alpha', 'delayed.tau ', '/cpg_generator/gait', 'qos_overrides', '✓')


def value(code: int, content: object = None) -> ParameterValue:
    """Return a value with a type code; codes from 10 on do not exist."""
    message = ParameterValue(type=code)
    if code in FIELDS and content is not None:
        setattr(message, FIELDS[code], content)
    return message


def _wrong(rng: random.Random, kinds: Sequence[int]) -> ParameterValue:
    """Return a value of one of the kinds, with odd content."""
    code = rng.choice(kinds)
    content = {1: rng.random() < 0.5, 2: rng.choice(INTEGERS), 3: rng.choice(NUMBERS),
               4: rng.choice(STRINGS), 5: [b'\x00', b'\xff'], 6: [True, False],
               7: rng.choices(INTEGERS, k=rng.randrange(4)),
               8: rng.choices(NUMBERS, k=rng.randrange(4)),
               9: rng.choices(STRINGS[:9], k=rng.randrange(4))}.get(code)
    return value(code, content)


def _fair(rng: random.Random) -> Parameter:
    """Return what a sane client would send, though it may be refused."""
    if rng.random() < 0.3:
        return Parameter(name='gait', value=value(4, rng.choice(GAITS)))
    name = rng.choice(list(FAIR))
    return Parameter(name=name, value=value(3, rng.uniform(*FAIR[name])))


def _odd(rng: random.Random, types: Mapping[str, int], names: Sequence[str]) -> Parameter:
    """Return one hostile parameter."""
    style = rng.randrange(10)
    if style == 0:
        return Parameter(name=rng.choice(UNKNOWN), value=_wrong(rng, range(10)))
    name = rng.choice(names)
    if style == 1:
        return Parameter(name=name, value=value(0))
    if style == 2:
        return Parameter(name=name, value=value(rng.choice((10, 11, 42, 127, 128, 255))))
    if style < 5:
        return Parameter(name=name, value=_wrong(rng, range(1, 10)))
    # The right type, the wrong content.
    return Parameter(name=name, value=_wrong(rng, (types[name],)))


def requests(types: Mapping[str, int], count: int, seed: int = 0
             ) -> Iterator[tuple[bool, list[Parameter]]]:
    """Yield requests: whether to set atomically, and the batch.

    Args:
        types: name -> type code of every parameter of the node, read-only ones included.
        count: how many requests.
        seed: the same seed gives the same requests.

    """
    rng = random.Random(seed)
    names = sorted(types)
    for _ in range(count):
        style = rng.randrange(20)
        if style == 0:
            batch = []
        elif style < 3:
            batch = [_fair(rng) for _ in range(rng.randrange(1, 4))]
        elif style < 7:
            # Half valid.
            batch = [_fair(rng), _odd(rng, types, names), _fair(rng)]
            rng.shuffle(batch)
        elif style < 9:
            # The same name more than once.
            one = _odd(rng, types, names)
            batch = [one, Parameter(name=one.name, value=_wrong(rng, range(12))), one]
        elif style == 9:
            batch = [_odd(rng, types, names) for _ in range(rng.randrange(20, 60))]
        else:
            batch = [_odd(rng, types, names) for _ in range(rng.randrange(1, 4))]
        yield rng.random() < 0.5, [p for p in batch if not _may_set_rate(p)]


def _may_set_rate(parameter: Parameter) -> bool:
    number = {2: parameter.value.integer_value, 3: parameter.value.double_value}
    return parameter.name == 'rate' and 0.9 < number.get(parameter.value.type, 0.0) < 2100.0


def effect(before: Mapping[str, object], atomically: bool, batch: Sequence[Parameter],
           results: Sequence[SetParametersResult], presets: Mapping[str, Mapping[str, float]]
           ) -> dict[str, object]:
    """Values that the node must have after it has answered.

    What was refused has changed nothing. What was accepted has its value; in one batch the last
    of several values of a name counts, a gait loads its preset, and network parameters in the
    same batch override that.
    """
    after = dict(before)
    parts = [(batch, results[0])] if atomically else [
        ([one], result) for one, result in zip(batch, results, strict=True)]
    for part, result in parts:
        if not result.successful:
            continue
        given = {p.name: getattr(p.value, FIELDS.get(p.value.type, 'type')) for p in part}
        after.update(presets.get(given.get('gait'), {}))
        after.update({name: float(new) if isinstance(after.get(name), float) else new
                      for name, new in given.items()})
    return after
