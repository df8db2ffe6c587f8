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

"""The README of an export: what is in it, how large it is, and how to use it."""

from cpg_ros.export.c_project import CProject
from cpg_ros.export.gait_data import c_name, comment
from cpg_ros.export.golden import Golden

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
{switch}cpg_enable(&c, 0, {ramp});          /* down to the stand */
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
    second_time, ramp = (f'CPG_TICKS({one})' if fixed else f'{one}{f}' for one in (1.0, 2.0))
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
        switch=f'{switch}   /* cross-fade in 1 s */\n' if switch else '')
