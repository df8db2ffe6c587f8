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

"""The gait of a network whose parameters are the phases of its legs.

Such a network (amplitude-controlled phase oscillators) has no symmetry that tells its gaits apart:
its offsets are the gait. They make the named gait whose leg phases are nearest.
"""

from collections.abc import Mapping
from functools import lru_cache

from cpg_ros.common.errors import InputError
from cpg_ros.networks.network import Network
import numpy as np

#: TOLERANCE: largest RMS difference of the legs' phases from a named gait, cycles. A quarter of
#: the way from one gait to the next has about 0.05.
TOLERANCE = 0.06


def stated_gait(network: Network) -> str:
    """Return the gait that the offsets of a network make.

    The named one whose leg phases are within TOLERANCE and nearest, or else the ``unnamed`` one;
    '' where the network has no offsets.
    """
    return _nearest(type(network), network.leads) if network.offsets else ''


def other_gait(network: Network, gait: str) -> str:
    """Return the gait that a network's offsets make instead of another one, or ''."""
    stated = stated_gait(network)
    if stated in ('', gait):
        return ''
    if stated == network.unnamed:
        return f"the offsets make no {gait} and no other gait with a name: it is '{stated}'"
    return f"the offsets make the {stated}, not '{gait}'"


@lru_cache(maxsize=1024)
def _nearest(network: type[Network], leads: tuple[float, ...]) -> str:
    cells = [listed[0] - 1 for listed in next(iter(network.legs.values())).values()]
    presets = network.presets()
    named = {gait: np.array(presets[gait].network.leads)[cells] for gait in network.gaits()
             if gait != network.unnamed and gait in presets}
    if not named or not np.isfinite(leads).all():
        return network.unnamed
    gait, distance, *_ = nearest_gait(np.array(leads)[cells], named)
    return gait if distance <= TOLERANCE else network.unnamed


def nearest_gait(phases: np.ndarray, table: Mapping[str, np.ndarray]
                 ) -> tuple[str, float, str | None, float]:
    """Find the gait whose leg phases are nearest.

    Args:
        phases: of the legs in cycles, shape (legs,).
        table: name -> phases of the same legs. A wave run backwards is a gait of its own.

    Returns:
        Name and distance of the nearest, the second nearest (None if there is no other), and
        how much further that is. Distances are RMS over the legs, in cycles around the circle,
        after the best common shift.

    Raises:
        InputError: a phase is not finite.
        ValueError: table is empty, or shapes do not fit.

    """
    phases = np.asarray(phases, dtype=float)
    if not table:
        raise ValueError('table is empty')
    distances = {}
    for name, reference in table.items():
        target = np.asarray(reference, dtype=float)
        if phases.ndim != 1 or not phases.size or target.shape != phases.shape:
            raise ValueError(f'phases have the shape {phases.shape}, those of {name!r} '
                             f'{target.shape}; both must be (legs,)')
        if not np.isfinite(phases + target).all():
            raise InputError(f'a phase is not finite: {phases}, {name!r} {target}')
        ahead = np.sort((phases - target) % 1.0)
        # The circular mean of least squares cuts the circle between two of the legs.
        cuts = ahead + np.tri(ahead.size, k=-1)
        distances[name] = float(cuts.std(axis=1).min())
    nearest, *others = sorted(distances, key=distances.__getitem__)
    second = others[0] if others else None
    return (nearest, distances[nearest], second,
            distances[second] - distances[nearest] if second is not None else np.inf)
