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

"""Map where a network's gaits live over two parameters: whether each exists and is stable, with
what symmetry lock, its period, amplitude, leading multiplier and basin. A coarse grid is refined
where neighbours differ; Hopf points, folds, torus points, period doublings, branch points and the
places at which a period grows without bound are followed as exact curves and drawn on top, with
the points at which a second condition holds: Bautin, Hopf-Hopf, zero-Hopf and Bogdanov-Takens
points, resonances of torus points, cusps.
"""

import argparse
from collections.abc import Iterable, Iterator, Mapping, Sequence
from concurrent.futures import Executor, ThreadPoolExecutor
from dataclasses import dataclass
from functools import partial
from itertools import chain
from pathlib import Path
import sys
from tempfile import TemporaryDirectory
from typing import Any

from cpg_ros.analysis.atlas import hopf_curves
from cpg_ros.analysis.atlas.chart import chart_of, ParameterPlane
from cpg_ros.analysis.atlas.fold_curves import (
    bautin_folds,
    distinct,
    edges_without_orbit,
    fold_curves,
)
from cpg_ros.analysis.atlas.grid import assess_row, AtlasRow, GaitMap, refine, uncrossed_edges
from cpg_ros.analysis.atlas.map import AtlasFolder, columns, draw_map
from cpg_ros.analysis.atlas.orbit_curves import edges, orbit_curves
from cpg_ros.common.command_line import named_interval, note, Parser, refuse_repeated, run, say
from cpg_ros.common.errors import InputError, ShortRepr
from cpg_ros.common.jobs import JobProgress, outcomes, ResilientExecutor
from cpg_ros.common.workers import add_options, INTERRUPT_MESSAGE, working
from cpg_ros.fitting.inversion.results import library
from cpg_ros.networks.network import known, Network
from cpg_ros.networks.network_options import add_network_options, network_from
from cpg_ros.networks.registry import reference
import numpy as np

EPILOG = """\
files: atlas.parquet (a row for each point and gait), boundaries.json, map.png, and index.html
with --interactive. Run the same command again to continue where it stopped.

exit codes: 0 drawn, 2 invalid arguments, 130 stopped (finished parts are kept)."""


def _points(text: str) -> tuple[int, int]:
    rows, sign, columns = text.partition('x')
    if not (rows.isdecimal() and (columns.isdecimal() or not sign)):
        raise argparse.ArgumentTypeError(f"'{text}' is not of the form 200x200")
    return int(rows), int(columns or rows)


def _parser() -> Parser:
    parser = Parser(prog='atlas', description=__doc__, epilog=EPILOG)
    add_network_options(parser)
    parser.add_argument('--over', nargs=2, required=True, metavar='PARAMETER=LOW:HIGH',
                        type=partial(named_interval, name='parameter'),
                        help='the two parameters, or lines of them, such as alpha=beta=0:0.5')
    parser.add_argument('--gait', dest='gaits', nargs='+', default=[], metavar='GAIT',
                        help='gaits to map (default: all)')
    parser.add_argument('--points', type=_points, default=(200, 200), metavar='NxM',
                        help='points of the grid (default: 200x200)')
    parser.add_argument('--interactive', action='store_true', help='also write index.html, '
                        'where a click on the map shows waveforms, footfalls and a preset to copy')
    add_options(parser)
    parser.add_argument('--out', type=Path, default=Path('atlas'), metavar='DIR',
                        help='folder for the files (default: %(default)s)')
    return parser


def _planned(args: argparse.Namespace) -> tuple[ParameterPlane, tuple[str, ...]]:
    base = network_from(args)
    for gait in args.gaits:
        known(gait, base.gaits())
    return (chart_of(reference(base.name), base, args.over, args.points),
            tuple(args.gaits or base.gaits()))


@dataclass(frozen=True, eq=False, repr=False)
class Atlas(ShortRepr):
    """Where gaits live over two parameters.

    Attributes:
        plane: parameters and grid.
        gaits: gait -> its map on the grid.
        boundaries: exact curves.

    """

    plane: ParameterPlane
    gaits: dict[str, GaitMap]
    boundaries: list[hopf_curves.Boundary]

    def table(self) -> dict[str, np.ndarray]:
        """Columns with a row for each gait and point, for numpy.savez or a data frame.

        Gait, both parameters, whether the gait exists, its state in words, whether the point was
        computed, and its numbers: period and lock in model units, amplitude, leading multiplier,
        basin; nan where there is none.
        """
        parts = list(columns(self.plane, self.gaits))
        return {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}

    def boundary_table(self) -> dict[str, np.ndarray]:
        """Columns with a row for each point of each boundary: its number, kind, gaits, values."""
        sizes = [len(curve.points) for curve in self.boundaries]
        values = np.concatenate([np.zeros((0, 2)), *(
            curve.points[:, :2] for curve in self.boundaries)]).T
        lines = str(self.plane.first.line), str(self.plane.second.line)
        return {'boundary': np.repeat(np.arange(len(sizes)), sizes),
                'kind': np.repeat([curve.kind for curve in self.boundaries], sizes),
                'gaits': np.repeat([' '.join(curve.gaits) for curve in self.boundaries], sizes),
                **dict(zip(lines, values, strict=True))}


def atlas(network: Network, over: Mapping[str, tuple[float, float]], gaits: Sequence[str] = (),
          points: tuple[int, int] = (40, 40), folder: str | Path | None = None,
          executor: Executor | None = None) -> Atlas:
    """Map where a network's gaits live over two parameters.

    Args:
        network: a shipped one, or one of a file; gives the other parameters.
        over: the two parameters, or lines of them such as ``alpha=beta``, with their ranges.
        gaits: to map; all by default.
        points: of the grid along each.
        folder: keeps finished parts; the same call with the same folder continues there, and
            returns a finished atlas at once.
        executor: for the rows and curves; None for this process.

    Raises:
        InputError: an unknown gait, or lines, ranges or points that cannot be used; the folder
            holds something else.

    """
    for gait in gaits:
        known(gait, network.gaits())
    if len(over) != 2:
        raise InputError(f'an atlas is over two parameters, not {len(over)}')
    plane = chart_of(reference(network.name), network, list(over.items()), points)
    with TemporaryDirectory() as scratch, ThreadPoolExecutor(1) as here:
        stored = AtlasFolder(Path(folder or scratch), plane, tuple(gaits or network.gaits()))
        return _computed(stored, ResilientExecutor(executor or here), quiet=True)


def _computed(stored: AtlasFolder, fleet: ResilientExecutor, quiet: bool = False) -> Atlas:
    """Compute an atlas on a fleet, and keep its parts; say how far it is unless quiet."""
    chart, gaits = stored.chart, stored.gaits

    def run(jobs: Iterable[AtlasRow],
            count: int) -> Iterator[tuple[AtlasRow, list[dict[str, Any]]]]:
        with JobProgress('rows', count, not quiet) as tally:
            left = []
            for row in jobs:
                done = stored.get(row)
                if done is None:
                    left.append(row)
                else:
                    tally.add(kept=True)
                    yield row, done
            for outcome in outcomes(fleet, assess_row, left, tally.tick):
                if outcome.error is not None:
                    raise outcome.error
                tally.add()
                yield outcome.job, stored.put(outcome.job, outcome.value)

    curves = stored.curves()
    if curves is None:
        fleet.what = '' if quiet else 'lines'
        hopf = hopf_curves.hopf_curves(chart, gaits, fleet.map)
    else:
        hopf = [curve for curve in curves if curve.kind == 'Hopf']
    sheets = refine(chart, gaits, hopf, run)
    if curves is None:
        fleet.what = '' if quiet else 'edges'
        missed = hopf_curves.curves_from(chart, chain(*fleet.map(hopf_curves.hopf_starts, [
            edge for gait, sheet in sheets.items()
            for edge in uncrossed_edges(chart, gait, sheet, hopf)])))
        if missed:
            hopf += missed
            sheets = refine(chart, gaits, hopf, run)
        fleet.what = '' if quiet else 'boundaries'
        hopf = [*fleet.map(hopf_curves.with_degeneracies, [(chart, curve) for curve in hopf])]
        jobs: list[tuple[Any, ...]] = [
            *((bautin_folds, (chart, curve)) for curve in hopf),
            *((orbit_curves, (chart, gait, edges(chart, sheet)))
              for gait, sheet in sheets.items()),
            *((fold_curves, (chart, gait, edges_without_orbit(chart, sheet)))
              for gait, sheet in sheets.items())]
        curves = [*hopf, *distinct(chart, chain(*fleet.map(_called, jobs)))]
        stored.put_curves(curves)
    return Atlas(chart, sheets, curves)


def _called(job: tuple[Any, ...]) -> Any:
    function, outcome = job
    return function(outcome)


def _map(args: argparse.Namespace) -> int:
    refuse_repeated('argument --gait', args.gaits)
    library()
    chart, gaits = _planned(args)
    with working(args, '', partial(note, 'atlas')) as fleet:
        stored = AtlasFolder(args.out, chart, gaits)
        result = _computed(stored, fleet)
    sheets, curves, picture = result.gaits, result.boundaries, args.out / 'map.png'
    written = [stored.write(sheets), args.out / 'boundaries.json', picture]
    draw_map(picture, chart, sheets, curves)
    if args.interactive:
        # Only pages need it.
        from cpg_ros.analysis.atlas.map import write_page
        written.append(write_page(args.out / 'index.html', chart, sheets, curves))
    counted = ', '.join(f'{gait} {100 * (sheet.label > 0).mean():.0f} %'
                        for gait, sheet in sheets.items())
    special = dict.fromkeys(str(point) for curve in curves for point in curve.codimension_two)
    say(f'fraction of the plane in which each gait exists: {counted}\n'
        f'boundaries: {", ".join(map(str, curves)) or "none"}\n'
        f'of codimension two: {"; ".join(special) or "none found"}\n'
        f'written: {", ".join(map(str, written))}')
    return 0


def main(arguments: Sequence[str] | None = None) -> int:
    """Draw an atlas; return the exit code."""
    return run(_parser(), _map, arguments, INTERRUPT_MESSAGE)


if __name__ == '__main__':
    sys.exit(main())
