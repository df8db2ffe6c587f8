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

from collections.abc import Sequence
import math

from cpg_ros.common.errors import InputError
from cpg_ros.dynamics.integration.c_text import braces, part
from cpg_ros.dynamics.integration.kernel_source import field_source, FieldSource
from cpg_ros.motion.export.gait_data import c_name, check_names, comment, GaitData
from cpg_ros.motion.export.golden import Golden, golden_test
from cpg_ros.motion.phase_readout import PhaseReadout
from cpg_ros.motion.plan import GaitPlan
from cpg_ros.motion.robot import Robot
from cpg_ros.networks.equations import equations_of
import numpy as np

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
        """Nodes of the history that a network keeps."""
        longest = max(plan.orbit.network.delay for plan in self.data.plans)
        return max(2, math.ceil(longest / self.data.step - 1e-9) + 1)

    @property
    def tracks(self) -> int:
        """Most gaits that fade into one another at a time."""
        return min(2, len(self.data.plans))

    @property
    def ram(self) -> int:
        """Memory of a struct cpg, bytes, without the padding of its flags."""
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
            golden: what the Python generator does, for the test.
            arduino: as an Arduino library with an example sketch.

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
            fixed = self.data.format.real == 'fixed'
            files['examples/walk/walk.ino'] = part('walk.ino', {
                'TICK': str(tick), 'RAMP': 'CPG_TICKS(3)' if fixed else '3',
                'TIME': '' if fixed else ', cpg_real(TICK) / 1000',
                'PINS': ', '.join(map(str, range(2, 2 + joints))),
                'ONES': ', '.join(['1'] * joints),
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

TEXT = """\
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
    /* {result}: {joints} ... */
}}
{switch}{steer}cpg_enable(&c, 0, {ramp});          /* down to the stand */
```

Call all functions from one thread, or interrupt. There is no watchdog: a state that leaves the
orbit is not put back on it. Positions stay within their limits whatever happens.
"""
FORMS = {
    'network': 'The network runs with steps of {step:g} of model time{history}.',
    'table': "The gaits' orbits are tables of at most {points} points, advanced by their phase: "
             'there is no network, and so nothing to disturb.'}


def readme(project: CProject, golden: Golden, command: str, arduino: bool = False) -> str:
    """Return the README.

    Args:
        project: the export.
        golden: what its test compares with.
        command: that wrote it.
        arduino: as an Arduino library.

    """
    data = project.data
    delay = max(plan.orbit.network.delay for plan in data.plans)
    history = f', and keeps {project.nodes} of them for the delay of {delay:g}' if delay else ''
    form = FORMS[data.format.form].format(step=data.step, history=history, points=data.points)
    fixed, f = data.format.real == 'fixed', 'f' if data.format.real == 'float32' else ''
    second_time, ramp = (f'CPG_TICKS({seconds})' if fixed else f'{seconds}{f}'
                         for seconds in (1.0, 2.0))
    second = data.plans[1].name if len(data.plans) > 1 else ''
    switch = f'cpg_switch(&c, CPG_GAIT_{c_name(second)}, {second_time});' if second else ''
    return TEXT.format(
        title=project.title, command=command, ram=project.ram, constants=data.bytes, form=form,
        test=('cc -std=c99 -Isrc src/*.c extras/test_cpg.c -lm -o test_cpg' if arduino else
              'cc -std=c99 cpg.c gait_data.c test_cpg.c -lm -o test_cpg'),
        network=', the network step by step' if data.format.form == 'network' else '',
        switches=golden.switches, samples=len(golden.positions), tolerance=golden.tolerance,
        first=c_name(data.plans[0].name), rate=1.0 / golden.dt,
        ramp=ramp, dt='' if fixed else f', {golden.dt!r}{f}',
        result='c.position[joint] in 2^-13 rad' if fixed else
        'c.position[joint] in rad and c.velocity[joint] in rad/s',
        joints=comment(', '.join(joint.name for joint in data.robot.joints[:3])),
        switch=f'{switch}   /* cross-fade in 1 s */\n' if switch else '',
        steer='cpg_steer(&c, strides, pace);   /* each leg, -1 to 1; the pace, 0 to 2 */\n'
        if data.format.steering else '')


# Gaits as skill arrays of Petoi's OpenCat: one cycle in frames of whole degrees.

#: Limits of a skill array. MOST_BYTES: size in the robot's memory, bytes; MOST_FRAMES: number of
#: frames, which the first number, an int8, states.
MOST_BYTES, MOST_FRAMES = 450, 127
HEAD = 4
LEGS = (('lf', 'fl'), ('rf', 'fr'), ('rh', 'hr', 'rb', 'br', 'rr'), ('lh', 'hl', 'lb', 'bl', 'rl'))


def joint_order(robot: Robot) -> np.ndarray:
    """Return which of the robot's joints each number of a frame is.

    Raises:
        InputError: the robot has not four legs, of these names, with two or three joints each.

    """
    by_name = {leg.lower(): leg for leg in robot.legs}
    legs = [by_name[name] for names in LEGS for name in names if name in by_name]
    joints = {len(robot.legs[leg]) for leg in legs}
    if len(legs) != len(LEGS) or len(robot.legs) != len(LEGS) or not joints <= {2, 3} \
            or len(joints) != 1:
        raise InputError(f'robot {robot.name}: skill arrays are for four legs, named lf, rf, rh '
                         f'and lh, with two or three joints each; it has {", ".join(robot.legs)}')
    names = [joint.name for joint in robot.joints]
    return np.array([names.index(robot.legs[leg][number].name)
                     for number in range(joints.pop()) for leg in legs])


def skill(plan: GaitPlan) -> np.ndarray:
    """Return a gait's array of int8, from where its first leg's phase is 0.

    Raises:
        InputError: an angle is beyond twice the range of int8, or the robot is none of Petoi's.

    """
    order, readout, robot = joint_order(plan.robot), plan.readout, plan.robot
    frames = min(MOST_FRAMES, (MOST_BYTES - HEAD) // order.size)
    phases = np.arange(frames) / frames - readout.start
    grid = np.arange(readout.angles.shape[1]) / readout.angles.shape[1]
    stand = plan.shift + robot.column('offset')
    degrees = np.degrees([stand[joint] + np.interp(
        phases + plan.orbit.phases[robot.cells[joint]], grid, readout.angles[joint], period=1.0)
        for joint in order]).T
    ratio = 1 if np.abs(degrees).max() <= 127.0 else 2
    steps = np.rint(degrees / ratio).astype(int)
    if np.abs(steps).max() > 127:
        raise InputError(f'{plan.name}: an angle of {np.abs(degrees).max():.0f} degrees; skill '
                         'arrays go to 254')
    return np.concatenate([[frames, 0, 0, ratio], steps.ravel()]).astype(np.int8)


def skills(plans: Sequence[GaitPlan], title: str) -> str:
    """Write gaits as arrays of C.

    Raises:
        InputError: as of skill, or two gaits have the same name in C.

    """
    check_names('gait', [plan.name for plan in plans])
    arrays = []
    for plan in plans:
        data = skill(plan)
        rows = [data[:HEAD], *data[HEAD:].reshape(data[0], -1)]
        numbers = ',\n'.join('    ' + braces(row, 'int8')[1:-1] for row in rows)
        arrays.append(f'/* {data[0]} frames a stride: {plan.frequency:g} strides per second are '
                      f'{data[0] * plan.frequency:g} frames per second. */\n'
                      f'const int8_t {c_name(plan.name).lower()}[] PROGMEM = {{\n{numbers}}};\n')
    return '\n'.join([f'/* {comment(title)}, as skill arrays of OpenCat. */', *arrays])
