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

"""Draw the footfalls of a network's gaits: python docs/footfalls.py FILE NETWORK."""

from pathlib import Path
import sys

from cpg_ros.analysis.gait_diagram import draw
from cpg_ros.dynamics.solve_orbit import solve_preset
from cpg_ros.networks.network import Network
from cpg_ros.networks.registry import find_network
import matplotlib

matplotlib.use('Agg')
from matplotlib import pyplot  # noqa: E402


def picture(network: type[Network], path: Path) -> None:
    """Write the picture of a network's gaits, each from the preset of its name."""
    presets = {name: preset for name, preset in network.presets().items() if name == preset.gait}
    columns = 3
    lines = -(-len(presets) // columns)
    figure, grid = pyplot.subplots(lines, columns, figsize=(10.5, 0.4 + 2.4 * lines), sharex=True,
                                   sharey=True, layout='constrained')
    for axes in grid.flat[len(presets):]:
        axes.axis('off')
    for axes, (name, preset) in zip(grid.flat, presets.items(), strict=False):
        orbit = solve_preset(preset)
        draw(axes, orbit, f'{name.replace("_", " ")}   (period {orbit.period:.4f})')
    for axes in grid[-1]:
        axes.set_xlabel('time [strides]')
    bars = ('Bars: the cell is above the middle of its range.' if network.muscles else
            'Bars: the leg stands, while the signal that drives it falls.')
    figure.suptitle(f'{bars} Lines: the cell. Periods in model time.', fontsize=10)
    figure.savefig(path, dpi=130)


if __name__ == '__main__':
    picture(find_network(sys.argv[2]), Path(sys.argv[1]))
