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

"""The basins that ``analyze --basin N`` reports: as text, and as JSON."""

from typing import Any

from cpg_ros.files.plain_text import table
from cpg_ros.files.progress_bar import progress_bar
from cpg_ros.search.basin import Basin, basin
from cpg_ros.tools.analysis_report import Analysis


def basins(analysis: Analysis, count: int, seed: int) -> dict[str, Basin]:
    """Find the basin of each gait that attracts by itself, or else with the default gain."""
    gains = {one.gait: 0.0 if one.stable else one.default_gain for one in analysis.existing
             if one.stable or one.stable_with_default_gain}
    found: dict[str, Basin] = {}
    with progress_bar('random states', len(gains) * count) as bar:
        for gait, gain in gains.items():
            orbit, before = analysis.gaits[gait].orbit, len(found) * count
            assert orbit is not None

            def done(states: int, before: int = before) -> None:
                bar(before + states)

            found[gait] = basin(orbit, count, seed, gain, done)
    return found


def text(found: dict[str, Basin]) -> str:
    """Return a table of the basins."""
    if not found:
        return 'Basins: no gait attracts.'
    rows: list[tuple[str, ...]] = [('gait', 'gain', 'return', 'share', '95 % interval', 'others')]
    for gait, one in found.items():
        low, high = one.interval
        others = ', '.join(f'{name} {number}' for name, number in one.others.items())
        rows.append((gait, f'{one.gain:.4f}', str(one.returned), f'{one.share:.1%}',
                     f'{low:.1%} to {high:.1%}', others or '-'))
    first = next(iter(found.values()))
    return '\n'.join([
        f'Basins: of {first.states} random states each (seed {first.seed}; every variable of '
        'every cell evenly over twice its range on',
        'the orbit, and constant before), those that return to the gait, without a symmetry lock '
        'where it is stable, or else',
        'with the default gain; and what the others do:',
        *(f'  {line}' for line in table(rows, '<>>>><'))])


def as_dict(found: dict[str, Basin]) -> dict[str, Any]:
    """Return the basins in plain types, gait -> basin."""
    return {gait: {'symmetry_gain': one.gain, 'states': one.states, 'seed': one.seed,
                   'returned': one.returned, 'share': one.share, 'interval': list(one.interval),
                   'others': dict(one.others)} for gait, one in found.items()}
