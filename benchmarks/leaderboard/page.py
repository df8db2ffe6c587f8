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

"""Print the table of bench_leaderboard.py in Markdown, and draw it if it has all rows.

python leaderboard/page.py leaderboard.json --out ../docs > table.md
"""

import argparse
from collections.abc import Callable
import json
from pathlib import Path
from typing import Any

import matplotlib

matplotlib.use('Agg')
import matplotlib.pyplot as plt  # noqa: E402
from rules import ROWS, WISHES  # noqa: E402

#: Of the picture on a dark ground, NAME_dark.png.
DARK = Path(__file__).resolve().parents[2] / 'docs' / 'static' / 'dark.matplotlibrc'
COLORS = {'go2 trot': '#1f6fb4', 'go2 walk': '#5fa8e0', 'go2 run': '#0b3d66',
          'go1 trot': '#17a398'}
OTHERS = ('#c44e35', '#e0974a', '#8c6bb1', '#b0679b', '#9a8f45')
Found = dict[str, dict[str, Any]]


def table(found: Found) -> str:
    """Return the figures of all entrants, a column each."""
    heads = {name: one['what'] for name, one in found.items()}
    lines = [['', *(f'{what["robot"]}: {_label(name)}' for name, what in heads.items())],
             ['---'] * (1 + len(found))]

    def row(label: str, value: Callable[[dict[str, Any]], Any]) -> None:
        lines.append([label, *(str(value(one)) for one in found.values())])

    first = next(iter(found.values()))

    def figures(rows: str, label: str, *keys: str, factor: float = 100.0, unit: str = '%') -> None:
        if rows in first:
            row(f'{label} [{unit}]', lambda one: ', '.join(
                _number(one[rows].get(key), factor) for key in keys))

    row('velocity of the base', lambda one: one['what']['velocity'])
    row('servos, kp, kd', lambda one: f'{one["what"]["kp"]:g}, {one["what"]["kd"]:g}')
    for way in ('forward', 'backward', 'left', 'turn'):
        keys = [name for name in WISHES if name.startswith(way)]
        asked = ', '.join(key.split()[1] for key in keys)
        unit = 'rad/s' if way == 'turn' else 'm/s'
        figures('tracking', f'{way}, asked {asked}', *keys, factor=1.0, unit=unit)
    if 'tracking' in first:
        row('cost of transport at 0.4 m/s',
            lambda one: f'{one["tracking"]["cost of transport"]:.2f}')
    figures('pushes', 'pushes that half survive', 'half, N s', factor=1.0, unit='N s')
    figures('pushes', 'pushes of 30, 40, 50, 60, 70 N s survived',
            *(f'{size} N s' for size in (30, 40, 50, 60, 70)))
    figures('delays', 'of 30 N s, all that is measured late by 10, 20, 30, 40, 60 ms',
            *(f'{late} ms' for late in (10, 20, 30, 40, 60)))
    for kind, label in (('height_field', 'rough ground'), ('boxes', 'blocks'), ('waves', 'waves')):
        keys = [key for key in first.get('rough', ()) if key.startswith(kind)]
        sizes = ', '.join(key.split()[1] for key in keys)
        figures('rough', f'{label} of {sizes} cm crossed', *keys)
    for rows, label, unit in (('stairs', 'stairs of', 'cm'), ('slopes', 'up', 'degrees'),
                              ('slopes', 'down', 'degrees'), ('floors', 'friction', ''),
                              ('floors', 'payload', 'kg')):
        keys = [key for key in first.get(rows, ())
                if key != 'of' and (rows == 'stairs' or key.startswith(label))]
        sizes = ', '.join(key.removeprefix(label).split()[0] for key in keys)
        ends = {'stairs': 'crossed', 'slopes': 'climbed' if label == 'up' else 'descended',
                'floors': 'upright'}[rows]
        figures(rows, f'{label} {sizes} {unit} {ends}'.replace('  ', ' '), *keys)
    return '\n'.join('| ' + ' | '.join(line) + ' |' for line in lines)


def _label(name: str) -> str:
    """Return how an entrant is called, without its robot."""
    _, _, gait = name.partition(' ')
    return f'cpg_ros, {gait}' if gait else name


def _number(value: Any, factor: float) -> str:
    """Return a figure in few digits; a dash for what was not measured."""
    if value is None:
        return '-'
    return value if isinstance(value, str) else f'{factor * value:.0f}' if factor > 1.0 else (
        f'{value:.0f}' if value >= 10.0 else f'{abs(value):.2f}' if abs(value) < 0.005 else
        f'{value:.2f}')


def picture(found: Found, path: Path) -> None:
    """Draw six panels: shares over what makes it harder, and speeds reached over those asked."""
    figure, axes = plt.subplots(2, 3, figsize=(10.0, 6.4), layout='constrained')
    others = iter(OTHERS)
    panels = (('pushes', ' N s', 'impulse of a push [N s]', 'upright [%]'),
              ('delays', ' ms', 'delay of all that is measured [ms]', 'upright, 30 N s [%]'),
              ('rough', 'height_field ', 'height of rough ground [cm]', 'crossed [%]'),
              ('stairs', ' cm', 'height of steps [cm]', 'crossed [%]'),
              ('slopes', 'up ', 'slope up [degrees]', 'climbed [%]'))
    for name, one in found.items():
        robot = one['what']['robot']
        looks = {'color': COLORS.get(name) or next(others), 'label': f'{robot}: {_label(name)}',
                 'marker': 'o', 'ms': 3.0, 'lw': 2.0 if name in COLORS else 1.2,
                 'ls': '--' if robot == 'go1' else '-'}
        for axis, (row, key, across, up) in zip(axes.flat, panels, strict=False):
            fractions = {float(label.replace(key, '').split()[0]): 100.0 * fraction
                      for label,
                         fraction in one[row].items() if key in label and 'half' not in label}
            axis.plot(list(fractions), list(fractions.values()), **looks)
            axis.set(xlabel=across, ylabel=up, ylim=(-3.0, 103.0))
        reached = {WISHES[label][0]: value for label, value in one['tracking'].items()
                   if label.startswith('forward') and value != 'fell'}
        axes[1, 2].plot(list(reached), list(reached.values()), **looks)
    axes[1, 2].plot([0.0, 3.0], [0.0, 3.0], color='0.6', lw=0.8, zorder=0)
    axes[1, 2].set(xlabel='speed asked for [m/s]', ylabel='speed reached [m/s]')
    for axis in axes.flat:
        axis.spines[['top', 'right']].set_visible(False)
    figure.legend(*axes[0, 0].get_legend_handles_labels(), frameon=False, ncols=4,
                  loc='outside lower center')
    figure.savefig(path, dpi=110)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('file', type=Path)
    parser.add_argument('--out', type=Path, default=Path('.'))
    parser.add_argument('--name', default='leaderboard', help='of the picture')
    args = parser.parse_args()
    entrants = json.loads(args.file.read_text())['entrants']
    found = dict(sorted(((name, one) for name, one in entrants.items() if 'skipped' not in one),
                        key=lambda item: item[1]['what']['robot'], reverse=True))
    if all(set(ROWS) <= set(one) for one in found.values()):
        picture(found, args.out / f'{args.name}.png')
        with plt.rc_context(fname=DARK):
            picture(found, args.out / f'{args.name}_dark.png')
    print(table(found))


if __name__ == '__main__':
    main()
