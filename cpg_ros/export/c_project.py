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

"""The files of an export: the C of gaits, a test with golden vectors, an Arduino library.

The parts in ``c`` are put together as a network and a form need them.
"""

import math

from cpg_ros.export.c_text import part
from cpg_ros.export.field_source import field_source, FieldSource
from cpg_ros.export.gait_data import c_name, check_names, comment, GaitData
from cpg_ros.export.golden import Golden, golden_test
from cpg_ros.motion.phase_readout import PhaseReadout
from cpg_ros.networks.equations import equations_of

SUBSTEP = 0.001
TYPES = {'float32': 'float', 'float64': 'double'}


class CProject:
    """Gaits as files of C.

    Attributes:
        data: the gaits.
        title: the first line of every file.

    """

    header = 'cpg.h'

    def __init__(self, data: GaitData, title: str, substep: float = SUBSTEP) -> None:
        """Take gaits, and the longest part of a tick while they fade, s.

        Raises:
            InputError: two gaits, legs or joints have the same name in C.

        """
        self.data, self.title, self.substep = data, comment(title), substep
        for what, names in self._names.items():
            check_names(what, names)
        self._field = FieldSource('', 0, 0)
        if data.format.form == 'network':
            self._field = field_source(equations_of(type(data.network)), data.network.cells)

    @property
    def _names(self) -> dict[str, list[str]]:
        robot = self.data.robot
        return {'gait': [plan.name for plan in self.data.plans], 'leg': list(robot.legs),
                'joint': [joint.name for joint in robot.joints]}

    @property
    def nodes(self) -> int:
        """Nodes of the history that a network keeps."""
        longest = max(plan.orbit.network.delay for plan in self.data.plans)
        return max(2, math.ceil(longest / self.data.step - 1e-9) + 1)

    @property
    def tracks(self) -> int:
        """Gaits that may fade into one another at a time."""
        return min(2, len(self.data.plans))

    @property
    def ram(self) -> int:
        """Memory of a struct cpg, bytes, to which come a few small integers."""
        joints, legs = len(self.data.robot.joints), len(self.data.robot.legs)
        track = 5 + 2 * joints + legs
        if self.data.format.form == 'network':
            components = self.data.network.components
            track += self._field.parameters + 3 + (2 * self.nodes + 2) * components
            if self.data.network.readout != 'waveform':
                track += 6 * self.data.network.cells
        size = 4 if self.data.format.real == 'float32' else 8
        return joints + size * (3 * joints + 16 + self.tracks * track)

    def _sizes(self) -> dict[str, object]:
        data, robot, network = self.data, self.data.robot, self.data.network
        suffix = 'f' if data.format.real == 'float32' else ''
        values: dict[str, object] = {
            'CPG_GAITS': len(data.plans), 'CPG_LEGS': len(robot.legs),
            'CPG_JOINTS': len(robot.joints)}
        if data.format.real == 'float32':
            values['CPG_FLOAT32'] = ''
        if data.format.form == 'table':
            values['CPG_TABLE'] = ''
        else:
            values |= {
                'CPG_CELLS': network.cells, 'CPG_VARIABLES': network.variables,
                'CPG_COMPONENTS': network.components, 'CPG_STEP': f'{data.step!r}{suffix}',
                'CPG_NODES': self.nodes, 'CPG_MAX_DELAY': f'{float(self.nodes - 1)!r}{suffix}',
                'CPG_PARAMETERS': max(1, self._field.parameters),
                'CPG_DRIVEN': self._field.driven,
                'CPG_DRIVEN_ROOM': max(1, self._field.driven * network.cells),
                'CPG_WEIGHTS': data.weights, 'CPG_MAPS': len(robot.joints)}
            if data.retimed:
                values['CPG_RETIMED'] = ''
            readout = data.plans[0].readout
            if isinstance(readout, PhaseReadout):
                values |= {'CPG_PHASE_READOUT': '',
                           'CPG_HARMONICS': readout.gait.known.terms.shape[1] - 1}
            else:
                values['CPG_LEAD'] = data.lead
        return values

    def _defines(self) -> str:
        lines = [f'#define {name} {value}'.rstrip() for name, value in self._sizes().items()]
        for what, names in self._names.items():
            listed = ', '.join(f'CPG_{what.upper()}_{c_name(name)}' for name in names)
            lines += ['', f'enum {{ {listed} }};']
        return '\n'.join(lines)

    def _header(self) -> str:
        suffix = 'f' if self.data.format.real == 'float32' else ''
        return part(self.header, {
            'TITLE': self.title, 'REAL': TYPES.get(self.data.format.real, ''),
            'DEFINES': self._defines(), 'TRACKS': str(self.tracks),
            'SUBSTEP': f'{self.substep!r}{suffix}'})

    @property
    def parts(self) -> tuple[str, ...]:
        """Files of ``c`` that make ``cpg.c``."""
        if self.data.format.form == 'table':
            return 'common', 'table_track', 'pattern'
        readout = 'waveform' if self.data.network.readout == 'waveform' else 'phase'
        return 'common', 'kink', 'network', 'seed', readout, 'network_track', 'pattern'

    def _source(self) -> str:
        texts = [part(f'{name}.c') for name in self.parts]
        return ''.join([f'/* {self.title} */\n', texts[0], self._field.text, *texts[1:]])

    def files(self, golden: Golden | None = None, arduino: bool = False) -> dict[str, str]:
        """Return the files, path -> text.

        Args:
            golden: what the Python generator does, for the test.
            arduino: as an Arduino library with an example sketch.

        """
        folder = 'src/' if arduino else ''
        found = {f'{folder}cpg.h': self._header(), f'{folder}cpg.c': self._source(),
                 f'{folder}gait_data.c': f'/* {self.title} */\n{self.data.text()}'}
        if golden is not None:
            found['extras/test_cpg.c' if arduino else 'test_cpg.c'] = golden_test(
                golden, self.data.format.real, self.title)
        if arduino:
            found['library.properties'] = self._properties()
            joints = len(self.data.robot.joints)
            tick = 20 if golden is None else max(1, round(1000.0 * golden.dt))
            fixed = self.data.format.real == 'fixed'
            found['examples/walk/walk.ino'] = part('walk.ino', {
                'TICK': str(tick), 'RAMP': 'CPG_TICKS(3)' if fixed else '3',
                'TIME': '' if fixed else ', cpg_real(TICK) / 1000',
                'PINS': ', '.join(map(str, range(2, 2 + joints))),
                'ONES': ', '.join(['1'] * joints),
                'JOINTS': comment(', '.join(joint.name for joint in self.data.robot.joints))})
        return found

    def _properties(self) -> str:
        robot = comment(self.data.robot.name)
        name = f'cpg_{robot}'
        return '\n'.join([
            f'name={name}', 'version=1.0.0', 'author=cpg_ros export',
            'maintainer=the author of the robot file',
            f'sentence=Gaits of {robot} by a central pattern generator.',
            f'paragraph={self.title}', 'category=Device Control',
            'url=https://cpg-ros.invalid', 'architectures=*', 'includes=cpg.h', ''])
