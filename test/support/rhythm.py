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

"""Signals with a known symmetry, drawn at random, and the gaits' symmetries by name."""

from dataclasses import dataclass

from cpg_ros.networks.symmetry import D2, Group, symmetries, Symmetry, Z4_Z2
from hypothesis import strategies as st
import numpy as np

Z6 = Group(6, (('w', (1, 2, 3, 4, 5, 0)),))
GROUPS = (Z4_Z2, D2, Z6)
QUADRUPED = {name: Symmetry.of(Z4_Z2, {'omega': omega, 'kappa': kappa})
             for name, omega, kappa in (
                 ('pronk', 0, 0), ('pace', 0, 0.5), ('bound', 0.5, 0), ('trot', 0.5, 0.5),
                 ('jump', 0.75, 0), ('walk', 0.75, 0.5))}
BIPED = {name: Symmetry.of(D2, shifts) for name, shifts in (
    ('walk', {'rho': 0.5, 'tau': 0.5}), ('run', {'rho': 0.5, 'tau': 0}),
    ('jump', {'rho': 0, 'tau': 0.5}), ('hop', {'rho': 0, 'tau': 0}), ('skip', {'rho': 0.5}),
    ('gallop', {'tau': 0.5}), ('hesitation_walk', {'rho tau': 0.5}),
    ('asymmetric_hop', {'rho tau': 0}), ('one_legged_hop', {'tau': 0}))}
NAMED = [(table, name) for table in (QUADRUPED, BIPED) for name in table]
EVERY = [symmetry for group in (Z4_Z2, D2) for symmetry in symmetries(group)]


@dataclass
class Rhythm:
    """Signals with a symmetry: series drawn at random, one for each waveform."""

    symmetry: Symmetry
    seed: int
    harmonics: int = 5

    def __post_init__(self):
        draw = np.random.default_rng(self.seed)
        group = self.symmetry.group
        self.series, self.place = [], {}
        for cell in range(group.cells):
            if cell not in self.place:
                series = draw.uniform(-0.6, 0.6, (self.harmonics, 2)) @ [1, 1j]
                series[0] = np.exp(2j * np.pi * draw.uniform())
                # Own offset and size, so that two waveforms are never nearly one.
                wave = len(self.series)
                self.series.append((wave, (1.0 + 0.3 * wave) * series))
                for name, shift in self.symmetry.shifts:
                    self.place[group.elements[name][cell]] = (wave, float(shift))

    def __call__(self, phases):
        """Values at phases in cycles, shape (m, cells)."""
        n = np.arange(1, self.harmonics + 1)
        columns = []
        for cell in range(self.symmetry.group.cells):
            wave, shift = self.place[cell]
            offset, series = self.series[wave]
            columns.append(offset + (np.exp(2j * np.pi * np.outer(phases + shift, n))
                                     @ series).real)
        return np.stack(columns, axis=1)


def around(phases):
    """Distances from whole cycles."""
    return np.abs((np.asarray(phases) + 0.5) % 1.0 - 0.5)


def phase_error(phases, symmetry):
    """Largest error among the phases of cells with one waveform."""
    off = phases - symmetry.phases
    return max(around(off - off[np.argmax(symmetry.waves == wave)])[symmetry.waves == wave].max()
               for wave in range(symmetry.waves.max() + 1))


seeds = st.integers(0, 2 ** 32)
