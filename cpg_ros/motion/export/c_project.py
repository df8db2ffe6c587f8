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

"""Files of an export: the C of gaits, a test with golden vectors, an Arduino library.

Parts from ``c`` are combined as the network and the form of the export need them.
"""

import math

from cpg_ros.dynamics.integration.c_text import part
from cpg_ros.dynamics.integration.kernel_source import field_source, FieldSource
from cpg_ros.motion.export.gait_data import c_name, check_names, comment, GaitData
from cpg_ros.motion.export.golden import Golden, golden_test
from cpg_ros.motion.phase_readout import PhaseReadout
from cpg_ros.networks.equations import equations_of

SUBSTEP = 0.001
C_TYPES = {'float32': 'float', 'float64': 'double'}


class CProject:
    """Gaits as files of C.

    Attributes:
        data: the gaits.
        title: first line of every file.

    """

    def __init__(self, data: GaitData, title: str, substep: float = SUBSTEP) -> None:
        """Prepare gaits for export; substep is the longest part of a tick while they fade, s.

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
        """Number of nodes in the history of a network."""
        longest = max(plan.orbit.network.delay for plan in self.data.plans)
        return max(2, math.ceil(longest / self.data.step - 1e-9) + 1)

    @property
    def tracks(self) -> int:
        """Largest number of gaits that fade into one another at a time."""
        return min(2, len(self.data.plans))

    @property
    def ram(self) -> int:
        """Size of a struct cpg, bytes, without the padding of its flags."""
        joints, legs = len(self.data.robot.joints), len(self.data.robot.legs)
        track = 5 + 2 * joints + legs
        if self.data.format.form == 'network':
            components = self.data.network.components
            track += self._field.parameters + 3 + (2 * self.nodes + 2) * components
            if self.data.network.readout != 'waveform':
                track += 6 * self.data.network.cells
        steers = self.data.format.steering
        size = 4 if self.data.format.real == 'float32' else 8
        # The number of a ramp's parts, that of a track's gait, the flag of what steers and a
        # track's pointer to it take as much as a number each.
        track += 1 + steers * (1 + joints)
        return 4 + joints + size * (3 * joints + 15 + steers * (3 * legs + 4)
                                    + self.tracks * track)

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
            if data.format.steering:
                values['CPG_STEERING'] = ''
            readout = data.plans[0].readout
            if isinstance(readout, PhaseReadout):
                values |= {'CPG_PHASE_READOUT': '',
                           'CPG_HARMONICS': readout.gait.known.terms.shape[1] - 1}
            else:
                values['CPG_ANGLES'] = data.angles
        return values

    def _defines(self) -> str:
        lines = [f'#define {name} {value}'.rstrip() for name, value in self._sizes().items()]
        for what, names in self._names.items():
            listed = ', '.join(f'CPG_{what.upper()}_{c_name(name)}' for name in names)
            lines += ['', f'enum {{ {listed} }};']
        return '\n'.join(lines)

    def _header(self) -> str:
        suffix = 'f' if self.data.format.real == 'float32' else ''
        return part('cpg.h', {
            'TITLE': self.title, 'REAL': C_TYPES[self.data.format.real],
            'DEFINES': self._defines(), 'TRACKS': str(self.tracks),
            'SUBSTEP': f'{self.substep!r}{suffix}', 'RAMP': part('ramp.h')})

    @property
    def parts(self) -> tuple[str, ...]:
        """Files of ``c`` that make ``cpg.c``."""
        if self.data.format.form == 'table':
            return 'common', 'table_track', 'pattern', 'control'
        readout = (('observe', 'waveform') if self.data.network.readout == 'waveform' else
                   ('phase',))
        steering = ('steering',) if self.data.format.steering else ()
        return ('common', 'kink', 'network', 'seed', 'joints', *readout, 'network_track',
                *steering, 'pattern', 'control')

    def _source(self) -> str:
        texts = [part(f'{name}.c') for name in self.parts]
        return ''.join([f'/* {self.title} */\n', texts[0], self._field.text, *texts[1:]])

    def files(self, golden: Golden | None = None, arduino: bool = False) -> dict[str, str]:
        """Return the files, path -> text.

        Args:
            golden: output of the Python generator, for the test.
            arduino: write an Arduino library with an example sketch.

        """
        folder = 'src/' if arduino else ''
        files = {f'{folder}cpg.h': self._header(), f'{folder}cpg.c': self._source(),
                 f'{folder}gait_data.c': f'/* {self.title} */\n{self.data.text()}'}
        if golden is not None:
            files['extras/test_cpg.c' if arduino else 'test_cpg.c'] = golden_test(
                golden, self.data.format.real, self.title)
        if arduino:
            files['library.properties'] = self._properties()
            joints = len(self.data.robot.joints)
            tick = 20 if golden is None else max(1, round(1000.0 * golden.dt))
            files['examples/walk/walk.ino'] = part('walk.ino', {
                'TICK': str(tick), 'PINS': ', '.join(map(str, range(2, 2 + joints))),
                'CENTRES': ', '.join(['90'] * joints), 'ONES': ', '.join(['1'] * joints),
                'JOINTS': comment(', '.join(joint.name for joint in self.data.robot.joints))})
        return files

    def _properties(self) -> str:
        robot = comment(self.data.robot.name)
        name = f'cpg_{robot}'
        return '\n'.join([
            f'name={name}', 'version=1.0.0', 'author=cpg_ros export',
            'maintainer=the author of the robot file',
            f'sentence=Gaits of {robot} by a central pattern generator.',
            f'paragraph={self.title}', 'category=Device Control',
            'url=https://cpg-ros.invalid', 'architectures=*', 'includes=cpg.h', ''])


# The README of an export: what is in it, how large it is, and how to use it.

README = """\
# {title}

Written by `{command}`. C99 without dependencies but the C library's mathematics; no memory is
allocated, nothing recurses, and a tick takes no longer than the steps and parts it consists of.

| what | bytes |
|---|---|
| state (`struct cpg`) | {ram} |
| constants | {constants} |

{form}

## Test

```sh
{test} && ./test_cpg
```

It compares with what the Python generator does{network}: {switches} switches between gaits, the
ramp to the stand at the end, {samples} samples of every joint. It passes if no joint differs by
more than {tolerance:g} rad.

## Use

```c
#include "cpg.h"

static cpg c;                       /* {ram} bytes */

cpg_start(&c, CPG_GAIT_{first}, {ramp});   /* stand, then into the gait within 2 s */
for (;;) {{                          /* {rate:g} times a second */
    cpg_advance(&c{dt});
    /* c.position[joint] in rad and c.velocity[joint] in rad/s: {joints} ... */
}}
{switch}{steer}cpg_enable(&c, 0, {ramp});          /* down to the stand */
```

Call all functions from one thread, or interrupt. There is no watchdog: a state that leaves the
orbit is not put back on it. Positions stay within their limits whatever happens.
"""
FORM_TEXTS = {
    'network': 'The network runs with steps of {step:g} of model time{history}.',
    'table': "The gaits' orbits are tables of at most {points} points, advanced by their phase: "
             'there is no network, and so nothing to disturb.'}


def readme(project: CProject, golden: Golden, command: str, arduino: bool = False) -> str:
    """Return the README.

    Args:
        project: the export.
        golden: output with which its test compares.
        command: command line of the export.
        arduino: whether it is an Arduino library.

    """
    data = project.data
    delay = max(plan.orbit.network.delay for plan in data.plans)
    history = f', and keeps {project.nodes} of them for the delay of {delay:g}' if delay else ''
    form = FORM_TEXTS[data.format.form].format(step=data.step, history=history, points=data.points)
    f = 'f' if data.format.real == 'float32' else ''
    second = data.plans[1].name if len(data.plans) > 1 else ''
    switch = f'cpg_switch(&c, CPG_GAIT_{c_name(second)}, 1.0{f});' if second else ''
    return README.format(
        title=project.title, command=command, ram=project.ram, constants=data.bytes, form=form,
        test=('cc -std=c99 -Isrc src/*.c extras/test_cpg.c -lm -o test_cpg' if arduino else
              'cc -std=c99 cpg.c gait_data.c test_cpg.c -lm -o test_cpg'),
        network=', the network step by step' if data.format.form == 'network' else '',
        switches=golden.switches, samples=len(golden.positions), tolerance=golden.tolerance,
        first=c_name(data.plans[0].name), rate=1.0 / golden.dt,
        ramp=f'2.0{f}', dt=f', {golden.dt!r}{f}',
        joints=comment(', '.join(joint.name for joint in data.robot.joints[:3])),
        switch=f'{switch}   /* cross-fade in 1 s */\n' if switch else '',
        steer='cpg_steer(&c, strides, pace);   /* each leg, -1 to 1; the pace, 0 to 2 */\n'
        if data.format.steering else '')
