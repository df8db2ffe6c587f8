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

"""The rules of the table: what all entrants meet, and what of it is written down.

A row's grounds, directions and wishes come from its own seed, so all entrants meet the same. A
share is given with the number of its runs.
"""

from collections.abc import Callable, Sequence
import itertools
import math
from typing import Any, Protocol
import zlib

from cpg_ros.simulation.scenario import impulse, Scenario, SensorNoise
from cpg_ros.simulation.terrain import Terrain
import numpy as np

#: When pushes begin, over how long their begins are spread, and for how long a robot then has to
#: stay up, s.
PUSHED, SPREAD, AFTER = 3.0, 0.5, 2.5
DIRECTIONS, TIMES = 12, 8
#: Ground counts as crossed at this way, m, within this time, s.
WAY, CROSSING = 5.0, 24.0
#: As a slope does whose top is this far, m, s.
CLIMB, CLIMBING = 3.0, 15.0
SPEED, FRICTION = 0.4, 0.8
#: Asked for after the first second; forward and to the left in m/s, turning in rad/s.
WISHES = {**{f'forward {v:g}': (v, 0.0, 0.0) for v in (0.2, 0.4, 0.7, 1.0, 1.5, 2.0, 3.0)},
          **{f'backward {v:g}': (-v, 0.0, 0.0) for v in (0.1, 0.3, 0.5)},
          **{f'left {v:g}': (0.0, v, 0.0) for v in (0.1, 0.2, 0.4)},
          **{f'turn {v:g}': (0.0, 0.0, v) for v in (0.3, 0.5, 1.0)}}


class Entrant(Protocol):
    """What walks by these rules: `policies.LearnedPolicy`, ``feedback_figures.Subject``."""

    noise: SensorNoise | None

    def run(self, scenarios: Sequence[Scenario], duration: float, goal: float = math.inf) -> Any:
        """Let bodies walk from the stand, one for each scenario."""


def tracking(one: Entrant, rng: np.random.Generator, few: bool) -> dict[str, Any]:
    """Return the velocity reached for each wish, and the cost of transport at 0.4 m/s."""
    ran = one.run([Scenario(FRICTION, speed=0.0, commands=((1.0, *wish),))
                   for wish in ((0.0, 0.0, 0.0), *WISHES.values())], 12.0)
    half = ran.velocity.shape[1] // 2
    mean = np.stack([ran.velocity[:, half:, 0], ran.velocity[:, half:, 1],
                     ran.angular_velocity[:, half:, 2]], axis=2).mean(axis=1)
    found: dict[str, Any] = {'stands': bool(ran.upright[0]),
                             'drift of the stand, m': float(np.hypot(*ran.place[0, -1]))}
    for name, wish, row, up in zip(WISHES, WISHES.values(), mean[1:], ran.upright[1:],
                                   strict=True):
        found[name] = float(row @ np.sign(wish)) if up else 'fell'
    found['cost of transport'] = float(ran.cost[1 + list(WISHES).index('forward 0.4')])
    return found


def pushes(one: Entrant, rng: np.random.Generator, few: bool) -> dict[str, Any]:
    """Push for 0.1 s, harder and harder until hardly any stays up: shares, and where half do."""
    fractions: dict[float, float] = {}
    for size in np.arange(20.0, 101.0, 10.0):
        fractions[size] = pushed(one, size, rng.uniform(0.0, 2.0 * math.pi), few)
        if fractions[size] < 0.15:
            break
    half = None
    for low, high in itertools.pairwise(fractions):
        if fractions[low] >= 0.5 > fractions[high]:
            half = float(np.interp(0.5, [fractions[high], fractions[low]], [high, low]))
    return {'half, N s': half, 'of': DIRECTIONS * TIMES,
            **{f'{size:g} N s': fraction for size, fraction in fractions.items()}}


def pushed(one: Entrant, size: float, first: float, few: bool) -> float:
    """Return the fraction that stays up after pushes of one impulse, N s, while walking."""
    directions, times = (4, 2) if few else (DIRECTIONS, TIMES)
    runs = [Scenario(FRICTION, speed=SPEED, pushes=(impulse(
        PUSHED + SPREAD * k / times, size * math.cos(way), size * math.sin(way)),))
        for way in first + np.arange(directions) * 2.0 * math.pi / directions
        for k in range(times)]
    return float(one.run(runs, PUSHED + SPREAD + AFTER).upright.mean())


def delays(one: Entrant, rng: np.random.Generator, few: bool) -> dict[str, Any]:
    """Push with 30 N s while all that is measured comes late."""
    first, found = rng.uniform(0.0, 2.0 * math.pi), {'of': DIRECTIONS * TIMES}
    for late in (10, 20, 30, 40, 60):
        one.noise = SensorNoise(delay=1e-3 * late)
        found[f'{late} ms'] = pushed(one, 30.0, first, few)
    one.noise = None
    return found


def rough(one: Entrant, rng: np.random.Generator, few: bool) -> dict[str, Any]:
    """Cross height fields, boxes and waves."""
    return {'of': 20} | {
        f'{kind} {100 * size:g} cm': crossed(one, kind, size, rng, few)
        for kind, sizes in (('height_field', (0.06, 0.08, 0.10, 0.14)),
                            ('boxes', (0.05, 0.07, 0.10, 0.14)), ('waves', (0.08, 0.12, 0.16)))
        for size in sizes}


def stairs(one: Entrant, rng: np.random.Generator, few: bool) -> dict[str, Any]:
    """Cross stairs, up and down."""
    return {'of': 20} | {f'{100 * size:g} cm': crossed(one, 'stairs', size, rng, few)
                         for size in (0.05, 0.08, 0.10, 0.13, 0.16, 0.20)}


def crossed(one: Entrant, kind: str, size: float, rng: np.random.Generator, few: bool) -> float:
    """Return the fraction of 20 grounds that is crossed; friction is that of 0.6 to 1."""
    runs = [Scenario(rng.uniform(0.6, 1.0), terrain=Terrain(kind, size, int(seed)), speed=SPEED,
                     phase=rng.uniform()) for seed in rng.integers(0, 2**31, 2 if few else 20)]
    return float(np.isfinite(one.run(runs, CROSSING, goal=WAY).arrived).mean())


def slopes(one: Entrant, rng: np.random.Generator, few: bool) -> dict[str, Any]:
    """Go up and down slopes."""
    found: dict[str, Any] = {'of': 12}
    for degrees in (10.0, 15.0, 20.0, 25.0, 30.0):
        runs = [Scenario(rng.uniform(0.6, 1.0), terrain=Terrain('ramp', sign * degrees),
                         speed=SPEED, phase=rng.uniform())
                for sign in (1.0, -1.0) for _ in range(1 if few else 12)]
        arrived = np.isfinite(one.run(runs, CLIMBING, goal=CLIMB).arrived).reshape(2, -1)
        found |= {f'up {degrees:g} degrees': float(arrived[0].mean()),
                  f'down {degrees:g} degrees': float(arrived[1].mean())}
    return found


def floors(one: Entrant, rng: np.random.Generator, few: bool) -> dict[str, Any]:
    """Follow random wishes on slippery floors and with payloads."""
    found: dict[str, Any] = {'of': 12}
    for name, changes in (*((f'friction {value:g}', {'friction': value})
                            for value in (0.2, 0.3, 0.5, 1.0)),
                          *((f'payload {value:g} kg', {'payload': value})
                            for value in (-1.0, 1.0, 3.0, 5.0))):
        runs = [Scenario(**{'friction': FRICTION, **changes}, phase=rng.uniform(), commands=tuple(
            (3.0 * k, rng.uniform(0.0, 0.4), rng.uniform(-0.1, 0.1), rng.uniform(-0.5, 0.5))
            for k in range(1, 6))) for _ in range(2 if few else 12)]
        found[name] = float(one.run(runs, 18.0).upright.mean())
    return found


ROWS: dict[str, Callable[[Entrant, np.random.Generator, bool], dict[str, Any]]] = {
    'tracking': tracking, 'pushes': pushes, 'delays': delays, 'rough': rough, 'stairs': stairs,
    'slopes': slopes, 'floors': floors}


def draws(seed: int, row: str) -> np.random.Generator:
    """Return where a row's grounds and directions come from."""
    return np.random.default_rng([seed, zlib.crc32(row.encode())])
