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

"""Writes the playground: a page that runs all networks in the browser, without a server.

Equations in JavaScript come from the text that ``cpg_ros.motion.export`` writes as C, from the
same sympy
expressions as the compiled kernels; gaits, their starts and what joints do with them from plans.
"""

import json
import math
from pathlib import Path
import re
import shutil
from typing import Any

from cpg_ros.common.errors import CpgError
from cpg_ros.dynamics.integration.kernel_source import field_source
from cpg_ros.motion.export.gait_data import CFormat, distinct_joints, GaitData, leg_phases
from cpg_ros.motion.plan import GaitPlan, plan
from cpg_ros.motion.robot_file import load_robot
from cpg_ros.networks.equations import equations_of
from cpg_ros.networks.registry import find_network, SHIPPED
import numpy as np
from sphinx.application import Sphinx

SOURCE = Path(__file__).parents[1] / 'playground'
ROBOTS = {'biped': 'biped'}
TOLERANCE = 1e-6
POINTS = 64
ARGUMENT = re.compile(r'\*(\w+)')
#: How C is written in JavaScript, in this order.
TRANSLATION = (
    (r'static CPG_ROM uint8_t (\w+)\[CPG_CELLS\] = \{(.*?)\};', r'const \1 = [\2];'),
    (r'static void (\w+)\(([^)]*)\)', lambda found: (
        f'function {found[1]}({", ".join(re.findall(ARGUMENT, found[2]))})')),
    (r'    cpg_real (\w+)\[CPG_CELLS\];\n', r'    const \1 = new Float64Array(CELLS);\n'),
    (r'    \(void\)\w+;\n', ''), (r'const cpg_real ', 'const '), (r'int16_t i', 'let i'),
    (r'F\(fabs\)', 'Math.abs'), (r'F\((\w+)\)', r'Math.\1'), (r'R\(([^()]*)\)', r'\1'),
    (r'CPG_CELLS', 'CELLS'))


def javascript(network: type) -> str:
    """Return a function that makes the functions of a network's right-hand side."""
    found = field_source(equations_of(network), network.cells)  # type: ignore[attr-defined]
    text = found.text
    for pattern, new in TRANSLATION:
        text = re.sub(pattern, new, text, flags=re.DOTALL if 'static' in pattern else 0)
    left = re.search(r'CPG_|cpg_|\b[RF]\(|static|int16_t', text)
    if left:
        raise ValueError(f'{network}: {left[0]} of C has no translation')
    body = text.strip().replace('\n', '\n    ')
    drive = 'drive' if found.driven else 'null'
    return (f'(function (CELLS) {{\n    {body}\n'
            f'    return {{drive: {drive}, driven: {found.driven}, field}};\n}})')


def rounded(values: Any, digits: int = 6) -> Any:
    """Return numbers for JSON."""
    return np.round(np.asarray(values, float), digits).tolist()


def gait_of(data: GaitData, number: int) -> dict[str, Any]:
    """Return what the page needs of a gait: its start, its lock, and its joints over a cycle."""
    one: GaitPlan = data.plans[number]
    orbit, readout, network = one.orbit, one.readout, one.orbit.network
    first, place = distinct_joints(one)
    every = readout.angles.shape[1] // POINTS
    phases = np.arange(2048) / 2048
    shapes = np.stack([orbit.waveform(phases, 0, wave, 0)
                       for wave in range(int(orbit.waves.max()) + 1)])
    levels = 0.5 * (shapes.max(axis=1) + shapes.min(axis=1))
    rising = [int(np.argmax((row < level) & (np.roll(row, -1) >= level)))
              for row, level in zip(shapes, levels, strict=True)]
    found = {
        'values': {name: getattr(network, name) for name in network.ranges},
        'period': orbit.period, 'gain': one.gain, 'frequency': one.frequency,
        'basis': orbit.symmetry.basis.tolist() if one.gain else [],
        'start': orbit(np.array(0.0)).tolist(), 'phases': orbit.phases.tolist(),
        'waves': orbit.waves.tolist(), 'levels': levels.tolist(),
        'rising': [one / 2048 for one in rising], 'range': np.ptp(shapes, axis=1).tolist(),
        'legs': rounded(leg_phases(one) % 1.0),
        'tables': rounded(readout.angles[first][:, ::every]), 'joints': place.tolist(),
        'stand': rounded(one.shift + one.robot.column('offset'))}
    if network.delay:
        waves = data._waves(orbit)
        found['history'] = waves.reshape(-1, network.variables, *waves.shape[1:]).tolist()
    return found


def network_of(name: str) -> tuple[str, dict[str, Any]]:
    """Return a network's equations and the rest of it."""
    network = find_network(name)
    robot = load_robot(ROBOTS.get(name, 'quadruped'))
    plans = []
    for key, preset in network.presets().items():
        try:
            plans.append(plan(robot, key, preset, preset.network, robot.motion(
                key, preset.gait).frequency or 1.0))
        except CpgError:
            continue  # The robot cannot walk it; the page has those that it can.
    data = GaitData(plans, CFormat('network', 'float64', TOLERANCE))
    equations = equations_of(network)
    p = [one for row in equations.rows for one in equations.by_cell.get(row, (row,))]
    return javascript(network), {
        'cells': network.cells, 'states': network.states, 'delay': network.delay_parameter,
        'step': network.step, 'p': p, 'usual': network.usual_gait,
        'ranges': {key: [one.low if math.isfinite(one.low) else -1e3,
                         one.high if math.isfinite(one.high) else 1e3, one.text]
                   for key, one in network.ranges.items()},
        'legs': {leg: int(cell) for leg, cell in zip(robot.legs, robot.leg_cells, strict=True)},
        'robot': [{'name': joint.name, 'leg': joint.leg, 'cell': int(cell)}
                  for joint, cell in zip(robot.joints, robot.cells, strict=True)],
        'gaits': {one.name: gait_of(data, number) for number, one in enumerate(plans)}}


def build(folder: Path, names: tuple[str, ...] = tuple(SHIPPED)) -> None:
    """Write the page into a folder."""
    folder.mkdir(parents=True, exist_ok=True)
    for path in SOURCE.iterdir():
        shutil.copyfile(path, folder / path.name)
    lines = ['// Written by docs/extensions/playground.py.', 'const NETWORKS = {};']
    for name in names:
        equations, rest = network_of(name)
        lines += [f'NETWORKS.{name} = {json.dumps(rest, separators=(",", ":"))};',
                  f'NETWORKS.{name}.equations = {equations};']
    (folder / 'networks.js').write_text('\n'.join([*lines, '']))


def finished(app: Sphinx, exception: Exception | None) -> None:
    """Write the page beside the built pages."""
    if exception is None and app.builder.name == 'html':
        build(Path(app.outdir) / 'playground')


def setup(app: Sphinx) -> dict[str, Any]:
    """Extend Sphinx."""
    app.connect('build-finished', finished)
    return {'parallel_read_safe': True}
