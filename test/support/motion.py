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

"""Recordings of motions that are known: quadrupeds of simple waveforms, networks' orbits."""

from dataclasses import dataclass
from functools import cache

from cpg_ros.dynamics.solve_orbit import solve_preset
from cpg_ros.networks.registry import NETWORKS, PRESETS
import numpy as np

LEGS = ('lh', 'rh', 'lf', 'rf')
JOINTS = ('hip', 'thigh', 'calf')
NAMES = tuple(f'{leg}_{joint}' for leg in LEGS for joint in JOINTS)
BY_LEG = {leg: tuple(f'{leg}_{joint}' for joint in JOINTS) for leg in LEGS}
#: Phases of LH, RH, LF, RF.
GAITS = {'trot': (0.0, 0.5, 0.5, 0.0), 'pace': (0.0, 0.5, 0.0, 0.5),
         'bound': (0.0, 0.0, 0.5, 0.5), 'walk': (0.0, 0.5, 0.75, 0.25)}
#: Mean angle of each joint, rad.
REST = (0.05, 0.8, -1.5)


@dataclass(frozen=True)
class Recorded:
    """What find_stride needs."""

    joints: tuple[str, ...]
    times: np.ndarray
    positions: np.ndarray
    source: str = 'made up'


def leg(phase):
    """Hip, thigh and calf of a leg at phases in cycles, rad; the thigh peaks near 0.005."""
    a = 2.0 * np.pi * phase
    return np.stack([REST[0] + 0.03 * np.sin(a + 1.0),
                     REST[1] + 0.33 * np.cos(a) + 0.08 * np.cos(2 * a + 0.5),
                     REST[2] + 0.25 * np.sin(a) + 0.15 * np.cos(2 * a) + 0.05 * np.sin(3 * a)])


def quadruped(phase, gait='trot', size=1.0):
    """Joint angles at phases in cycles, rad, shape (n, 12); size scales the motion."""
    rest = np.array(REST)[:, None]
    return np.concatenate([rest + size * (leg(phase + ahead) - rest)
                           for ahead in GAITS[gait]]).T


def stamps(rng, duration, rate, jitter=0.2, dropouts=0.01):
    """Return the times of samples with jitter (share of an interval) and dropouts, from 0, s."""
    n = int(duration * rate)
    t = np.arange(n) / rate + jitter * rng.uniform(-1.0, 1.0, n) / rate
    t = t[rng.random(n) >= dropouts]
    return t - t[0]


def noisy(rng, x, fraction=0.02):
    """Add noise of a fraction of each joint's range."""
    return x + fraction * np.ptp(x, axis=0) * rng.standard_normal(x.shape)


@cache
def orbit(network, name):
    return solve_preset(PRESETS[network][name])


class Driven:
    """Two joints a leg, driven by a preset's cells: w_x x + w_y y + offset."""

    READOUT = (('hip', 0.4, 0.1, 0.9), ('knee', 0.25, -0.2, -1.3))

    def __init__(self, network, name):
        self.orbit, cells = orbit(network, name), NETWORKS[network].cells
        legs = next(iter(NETWORKS[network].legs.values()))
        states = self.orbit(np.arange(1024) / 1024 * self.orbit.period)[:, :cells]
        c = np.fft.rfft(states, axis=0)[:9 if network == 'delayed' else 4] / 1024
        c[0] = 0.0
        size = np.abs(np.fft.irfft(c * 1024, 1024, axis=0)).max()
        self.joints, self.by_leg, self.cells, self.gains, self._series = [], {}, {}, {}, []
        n = np.arange(len(c))
        for name_of_leg, own in legs.items():
            listed = []
            for cell, (joint, x, y, offset) in zip(2 * own, self.READOUT, strict=False):
                listed.append(f'{name_of_leg}_{joint}')
                self.cells[listed[-1]], self.gains[listed[-1]] = cell, complex(x, y)
                self._series.append((offset, c[:, cell - 1] / size * (x + 1j * n * y)))
            self.by_leg[name_of_leg] = tuple(listed)
            self.joints += listed

    def __call__(self, phase):
        """Joint angles at phases in cycles, rad, shape (n, joints)."""
        return np.stack([offset + 2.0 * sum((c * np.exp(2j * np.pi * n * phase)).real
                                            for n, c in enumerate(series))
                         for offset, series in self._series], axis=1)

    @property
    def zero(self):
        """Phase at which the first harmonic of the first leg's main joint peaks."""
        first = [self._series[self.joints.index(name)][1][1]
                 for name in next(iter(self.by_leg.values()))]
        return -np.angle(max(first, key=abs)) / (2.0 * np.pi)
