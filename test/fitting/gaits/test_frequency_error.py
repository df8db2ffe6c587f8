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

"""How sure a recording's frequency is, against made-up strides whose lengths are known."""

from cpg_ros.fitting.gaits.stride import find_stride, NoSteadyGait
from cpg_ros.fitting.recordings.recording import Recording
from cpg_ros.networks.library.delayed import Delayed
import numpy as np
import pytest
from walks import LEGS


@pytest.mark.parametrize('cycles', [2.2, 3.0, 3.8, 6.0, 12.0, 30.0])
def test_the_frequency_is_as_sure_as_its_error_says(cycles):
    rng = np.random.default_rng(round(10 * cycles))
    legs = {leg: (f'{leg}_hip', f'{leg}_knee') for leg in LEGS}
    names = tuple(name for listed in legs.values() for name in listed)
    off = []
    for _ in range(24 if cycles < 10.0 else 16):
        t = np.arange(round(60 * cycles)) / 60.0
        # A stride a second on average, each a few per cent longer or shorter; noise from little
        # to much.
        rates = 1.0 + 0.03 * rng.normal(size=int(1.2 * cycles) + 5)
        speed = np.interp(t + rng.uniform(0.0, 1.0), np.arange(rates.size), rates)
        phase = np.append(0.0, np.cumsum(speed[:-1] / 60.0))
        terms = rng.normal(size=(2, 3)) + 1j * rng.normal(size=(2, 3))
        turns = np.exp(2j * np.pi * np.arange(1, 4) * (
            phase[:, None, None] + np.array([0.0, 0.5, 0.5, 0.0])[:, None]))
        angles = np.array([0.1, -1.2]) + np.einsum(
            'jn,n,tln->tlj', terms, [0.3, 0.12, 0.06], turns).real
        angles = angles.reshape(t.size, 8) + rng.choice([0.01, 0.1]) * rng.normal(
            size=(t.size, 8))
        try:
            found = find_stride(Recording(names, t, angles, 'made up'), legs, Delayed)
        except NoSteadyGait:
            continue
        begin, end = np.interp([found.begin, found.end], t, phase)
        off.append((found.frequency - (end - begin) / (found.end - found.begin))
                   / found.frequency_error)
    assert len(off) > 8 and 0.4 < np.sqrt(np.mean(np.square(off))) < 1.7
