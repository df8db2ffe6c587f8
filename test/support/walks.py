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

"""Recordings of a robot that walks, made of an orbit: as arrays, bags and CSV files."""

import csv

from bags import joint_state, START, write_bag
from cpg_ros.dynamics.solve_orbit import solve_preset
from cpg_ros.networks.registry import PRESETS
import numpy as np

LEGS = {'lh': 1, 'rh': 2, 'lf': 3, 'rf': 4}


def walked(name='trot', frequency=2.0, seconds=12.0, rate=200.0, noise=0.0, stands=0.0, seed=0):
    """Joint names, times and angles of a robot that stands, walks and stands again.

    Hip and knee of each leg are polynomials of the leg's cell on the preset's orbit: written
    out here, not read off by the package.
    """
    orbit = solve_preset(PRESETS['delayed'][name])
    t = np.arange(round((seconds + 2.0 * stands) * rate)) / rate
    theta = frequency * np.clip(t - stands, 0.0, seconds)
    names, columns = [], []
    for leg, cell in LEGS.items():
        place = theta + orbit.phases[cell - 1]
        x = orbit.waveform(place) / orbit.peak
        y = orbit.waveform(place, 1) / (2.0 * np.pi * orbit.peak)
        names += [f'{leg}_hip', f'{leg}_knee']
        columns += [0.1 + 0.4 * x - 0.1 * y, -1.2 + 0.2 * x + 0.3 * y + 0.25 * x * x - 0.1 * x * y]
    angles = np.array(columns).T
    moving = (t >= stands) & (t < stands + seconds)
    angles = np.where(moving[:, None], angles, angles[0])
    rng = np.random.default_rng(seed)
    return names, t, angles + noise * np.ptp(angles, axis=0) * rng.standard_normal(angles.shape)


def bag_of(path, names, t, angles, **options):
    stamps = START + np.round(1e9 * t).astype(np.int64)
    return write_bag(path, [
        ('/joint_states', int(stamp) + 1000, joint_state(int(stamp), names, row))
        for stamp, row in zip(stamps, angles, strict=True)], **options)


def table_of(path, names, t, angles, unit=''):
    with path.open('w', newline='') as file:
        rows = csv.writer(file)
        rows.writerow(['time', *(f'{name}{unit}' for name in names)])
        rows.writerows([f'{time:.6f}', *row] for time, row in zip(t, angles.tolist(), strict=True))
    return path
