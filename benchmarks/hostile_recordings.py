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

"""Seeded tables of joint angles as they should not be, each spoiled in one of many ways.

``spoiled`` is what the benchmark and the tests share. Each knows what it would be right to say.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

LEGS = ('lh', 'rh', 'lf', 'rf')
GAITS = {'trot': (0.0, 0.5, 0.5, 0.0), 'pace': (0.0, 0.5, 0.0, 0.5), 'bound': (0.0, 0.0, 0.5, 0.5),
         'walk': (0.0, 0.5, 0.75, 0.25), 'pronk': (0.0, 0.0, 0.0, 0.0)}
#: Of the files that the tests read.
SEED = 19
NAMES = [f'{leg}_{joint}' for leg in LEGS for joint in ('hip', 'knee')]


@dataclass
class Walked:
    """A table in the making: names, times (s), angles (rad), and the gait and frequency in it."""

    names: list[str]
    t: np.ndarray
    x: np.ndarray
    gait: str
    frequency: float

    def text(self, delimiter: str = ',') -> str:
        """Return the table as a program would write it."""
        rows = [delimiter.join(['time', *self.names])]
        rows += [delimiter.join([f'{time:.6f}', *(f'{value:.5f}' for value in row)])
                 for time, row in zip(self.t, self.x, strict=True)]
        return '\n'.join(rows) + '\n'


def walked(rng: np.random.Generator, seconds: float = 8.0, rate: float = 100.0) -> Walked:
    """Make hips and knees of a robot that walks on, with a little noise."""
    gait, frequency = str(rng.choice(list(GAITS))), float(rng.uniform(1.0, 2.5))
    t = np.arange(round(seconds * rate)) / rate
    columns = []
    for phase in GAITS[gait]:
        turn = 2.0 * np.pi * (frequency * t + phase)
        columns += [0.7 + 0.3 * np.cos(turn) + 0.05 * np.cos(2.0 * turn),
                    -1.4 + 0.3 * np.sin(turn) + 0.08 * np.sin(2.0 * turn + 0.5)]
    x = np.array(columns).T
    return Walked(list(NAMES), t, x + 0.005 * rng.normal(size=x.shape), gait, frequency)


def _scaled(column: str, scale: float) -> Callable[[Walked, np.random.Generator], str]:
    def change(made: Walked, rng: np.random.Generator) -> str:
        setattr(made, column, getattr(made, column) * scale)
        return made.text()
    return change


def _spot(made: Walked, rng: np.random.Generator) -> str:
    lift = np.maximum(made.x[:, 1::2] + 1.4, 0.0)
    made.x[:, ::2], made.x[:, 1::2] = 0.7 + 0.5 * lift, -1.4 - lift
    return made.text()


def _turn(made: Walked, rng: np.random.Generator) -> str:
    made.x[:, [0, 4]] = 1.4 - made.x[:, [0, 4]]
    return made.text()


def _slow_change(made: Walked, rng: np.random.Generator) -> str:
    slipped = made.t - 0.5 * (made.t - made.t[0]) / np.ptp(made.t) / made.frequency
    for column in range(4, 8):
        made.x[:, column] = np.interp(slipped, made.t, made.x[:, column])
    return made.text()


def _wild(made: Walked, rng: np.random.Generator) -> str:
    rows, columns = rng.integers(0, len(made.t), 40), rng.integers(0, 8, 40)
    made.x[rows, columns] = rng.choice([1e300, -1e12, np.nan, np.inf, 40.0], 40)
    return made.text()


def _holes(made: Walked, rng: np.random.Generator) -> str:
    keep = np.sort(rng.choice(len(made.t), len(made.t) // 2, replace=False))
    made.t, made.x = made.t[keep], made.x[keep]
    return made.text()


def _stamp(made: Walked, rng: np.random.Generator) -> str:
    made.t[int(rng.integers(5, len(made.t) - 5))] += 3e7
    return made.text()


def _shuffled(made: Walked, rng: np.random.Generator) -> str:
    made.t = rng.permutation(made.t)
    return made.text()


def _noise(made: Walked, rng: np.random.Generator) -> str:
    made.x = rng.normal(size=made.x.shape)
    return made.text()


def _standing(made: Walked, rng: np.random.Generator) -> str:
    made.x[:] = 0.7
    return made.text()


def _sparse(made: Walked, rng: np.random.Generator) -> str:
    some = slice(None, None, int(100.0 / made.frequency / rng.uniform(1.3, 3.0)))
    made.t, made.x = made.t[some], made.x[some]
    return made.text()


def _few(made: Walked, rng: np.random.Generator) -> str:
    count = int(rng.uniform(0.5, 2.0) * 100.0 / made.frequency)
    made.t, made.x = made.t[:count], made.x[:count]
    return made.text()


def _cut(made: Walked, rng: np.random.Generator) -> str:
    return made.text()[:int(rng.integers(0, 4000))]


def _bytes(made: Walked, rng: np.random.Generator) -> bytes:
    data = bytearray(made.text().encode())
    for place in rng.integers(0, len(data), 20):
        data[place] = int(rng.integers(0, 256))
    return bytes(data)


def _words(made: Walked, rng: np.random.Generator) -> str:
    text = made.text().split('\n')
    text[int(rng.integers(1, len(text) - 1))] = str(rng.choice(
        ['END', ',,,,,,,,', 'nan', '1,2,3', '#', '"', 'time,' + ','.join(NAMES)]))
    return '\n'.join(text)


def _names(made: Walked, rng: np.random.Generator) -> str:
    made.names = list(rng.choice([*NAMES, '', 'x', 'tail', 'lh', 'arm_l', 'LF_'], 8))
    return made.text()


def _commas(made: Walked, rng: np.random.Generator) -> str:
    return made.text(';').replace('.', ',')


def _limp(made: Walked, rng: np.random.Generator) -> str:
    made.x[:, 4:6] = 0.3 * made.x[:, 4:6] + 0.7 * made.x[:, 4:6].mean(axis=0)
    return made.text()


def _between(made: Walked, rng: np.random.Generator) -> str:
    """Shift the fore legs by a quarter of a cycle in the middle third."""
    middle = np.abs(made.t - made.t.mean()) < np.ptp(made.t) / 6.0
    for column in range(4, 8):
        made.x[middle, column] = np.interp(made.t[middle] - 0.25 / made.frequency, made.t,
                                           made.x[:, column].copy())
    return made.text()


def _noisy(made: Walked, rng: np.random.Generator) -> str:
    made.x += 0.15 * rng.normal(size=made.x.shape)
    return made.text()


def _bursts(made: Walked, rng: np.random.Generator) -> str:
    """Keep six samples in thirty."""
    some = np.arange(len(made.t)) % 30 < 6
    made.t, made.x = made.t[some], made.x[some]
    return made.text()


def _as_it_is(made: Walked, rng: np.random.Generator) -> str:
    return made.text()


#: Ways to spoil a table.
WAYS: dict[str, Callable[[Walked, np.random.Generator], str | bytes]] = {
    'as it is': _as_it_is, 'milliseconds': _scaled('t', 1e3), 'microseconds': _scaled('t', 1e6),
    'degrees': _scaled('x', 180.0 / np.pi), 'on the spot': _spot, 'turn': _turn,
    'slow change': _slow_change, 'wild values': _wild, 'half of the rows': _holes,
    'a stamp far off': _stamp, 'shuffled': _shuffled, 'noise': _noise, 'standing': _standing,
    'sparse': _sparse, 'few strides': _few, 'cut': _cut, 'bytes': _bytes, 'words': _words,
    'names': _names, 'decimal commas': _commas, 'limp': _limp, 'another between': _between,
    'noisy': _noisy, 'bursts': _bursts}


def spoiled(number: int, seed: int = SEED) -> tuple[str, bytes, Walked]:
    """Return hostile file `number`: how it is spoiled, its bytes, and what walked before that."""
    rng = np.random.default_rng([seed, number])
    way = list(WAYS)[number % len(WAYS)]
    made = walked(rng)
    text = WAYS[way](made, rng)
    return way, text if isinstance(text, bytes) else text.encode(), made
