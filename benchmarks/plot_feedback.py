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

"""Draw what bench_feedback.py has printed: survival over impulse, and ground that is crossed.

python bench_feedback.py > feedback.json; python plot_feedback.py feedback.json --out ../docs
"""

import argparse
import json
from pathlib import Path
from typing import Any

import matplotlib

matplotlib.use('Agg')
import matplotlib.pyplot as plt  # noqa: E402

#: Of the figures on a dark ground, NAME_dark.png.
DARK = Path(__file__).resolve().parent.parent / 'docs' / 'static' / 'dark.matplotlibrc'
LOOKS = {'closed': {'color': '#1f6fb4'}, 'open': {'color': '#c44e35'}}
GROUNDS = {'height_field_6_cm': 'rough, 6 cm', 'height_field_8_cm': 'rough, 8 cm',
           'boxes_5_cm': 'boxes, 5 cm'}


def read(files: list[Path]) -> dict[str, dict[str, dict[str, Any]]]:
    """Return all gaits' figures, those of several files together."""
    found: dict[str, dict[str, dict[str, Any]]] = {}
    for file in files:
        for line in file.read_text().splitlines():
            for gait, ways in json.loads(line)['gaits'].items():
                for way, figures in ways.items():
                    found.setdefault(gait, {'open': {}, 'closed': {}})[way] |= figures
    return found


def survival(found: dict[str, dict[str, dict[str, Any]]], path: Path) -> None:
    gaits = [gait for gait in ('trot', 'walk') if 'pushes' in found[gait]['closed']]
    figure, axes = plt.subplots(1, len(gaits), figsize=(3.6 * len(gaits), 3.0), sharey=True,
                                squeeze=False, layout='constrained')
    for axis, gait in zip(axes[0], gaits, strict=True):
        for way, looks in LOOKS.items():
            if 'pushes' in found[gait][way]:
                fractions = found[gait][way]['pushes']['survived']
                axis.plot([float(x) for x in fractions], [100.0 * y for y in fractions.values()],
                          'o-',
                          label='with feedback' if way == 'closed' else 'without', **looks)
        axis.axhline(50.0, color='0.7', lw=0.8, zorder=0)
        axis.set(title=gait, xlabel='impulse [N s]', ylim=(0.0, 103.0))
        axis.spines[['top', 'right']].set_visible(False)
    axes[0, 0].set_ylabel('pushes survived [%]')
    axes[0, 0].legend(frameon=False)
    figure.savefig(path, dpi=130)


def terrain(found: dict[str, dict[str, dict[str, Any]]], path: Path) -> None:
    gaits = [gait for gait in ('trot', 'walk') if 'ground' in found[gait]['closed']]
    figure, axes = plt.subplots(1, len(gaits), figsize=(3.6 * len(gaits), 3.0), sharey=True,
                                squeeze=False, layout='constrained')
    for axis, gait in zip(axes[0], gaits, strict=True):
        for k, (way, looks) in enumerate(LOOKS.items()):
            fractions = found[gait][way].get('ground')
            if fractions:
                bars = axis.bar([x + 0.4 * (0.5 - k) for x in range(len(GROUNDS))],
                                [100.0 * fractions[name] for name in GROUNDS], 0.38,
                                label='with feedback' if way == 'closed' else 'without', **looks)
                axis.bar_label(bars, fmt='%.0f', fontsize=8)
        axis.set(title=gait, ylim=(0.0, 108.0))
        axis.set_xticks(range(len(GROUNDS)), GROUNDS.values())
        axis.spines[['top', 'right']].set_visible(False)
    axes[0, 0].set_ylabel('crossed [%]')
    figure.legend(*axes[0, 0].get_legend_handles_labels(), frameon=False, ncols=2,
                  loc='outside upper center')
    figure.savefig(path, dpi=130)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('files', nargs='+', type=Path)
    parser.add_argument('--out', type=Path, default=Path('.'))
    args = parser.parse_args()
    found = read(args.files)
    survival(found, args.out / 'feedback_pushes.png')
    terrain(found, args.out / 'feedback_terrain.png')
    with plt.rc_context(fname=DARK):
        survival(found, args.out / 'feedback_pushes_dark.png')
        terrain(found, args.out / 'feedback_terrain_dark.png')


if __name__ == '__main__':
    main()
