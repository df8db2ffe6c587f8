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

from dataclasses import replace
import re
import shutil
import subprocess

from c_export import compiled, data_of, needs_gcc, output, plans, project_of
from cpg_ros.common.errors import InputError
from cpg_ros.dynamics.integration.stepper import Stepper
from cpg_ros.dynamics.solve_orbit import solve_orbit
from cpg_ros.motion.export.c_project import CProject, readme
from cpg_ros.motion.export.golden import golden_of
from cpg_ros.motion.plan import plan
from cpg_ros.networks.registry import PRESETS
from depth import in_depth
import numpy as np
import pytest

ROBOTS = [('quadruped', 'delayed', ('trot', 'walk', 'bound')),
          ('quadruped', 'quadruped', ('trot', 'walk')), ('quadruped', 'phase', ('walk', 'trot')),
          ('quadruped', 'hopf', ('trot', 'walk')), ('quadruped', 'matsuoka', ('walk', 'pace')),
          ('biped', 'biped', ('walk', 'run')), ('goat', 'delayed', ('trot', 'walk')),
          ('goat', 'quadruped', ('trot', 'walk')), ('unitree_go2', 'delayed', ('trot', 'walk')),
          ('hexapod', 'delayed6', ('tripod', 'ripple')), ('hexapod', 'phase6', ('tripod', 'wave')),
          ('octopod', 'delayed8', ('pace', 'pronk')), ('octopod', 'phase8', ('pace', 'pronk'))]

STEPS = """
#include "cpg.h"
#include <stdio.h>
#include <stdlib.h>
int main(int count, char **words)
{
    static cpg_track t;
    double x[CPG_COMPONENTS];
    (void)count;
    for (int i = 0; i < CPG_COMPONENTS; i++) {
        x[i] = strtod(words[3 + i], NULL);
    }
    cpg_network_hold(&t, (uint8_t)atoi(words[1]), x);
    for (int n = 0; n < atoi(words[2]); n++) {
        cpg_network_step(&t);
        for (int i = 0; i < CPG_COMPONENTS; i++) {
            printf("%.17g ", t.x[t.head][i]);
        }
    }
    return 0;
}
"""

DRIFT = """
#include "cpg.h"
#include <stdio.h>
int main(void)
{
    static cpg c;
    cpg_start(&c, 0, (cpg_real)0.1);
    for (long tick = 0; tick < 64 * 1000L; tick++) {
        cpg_advance(&c, (cpg_real)0.015625);
        if ((tick + 1) % 64 == 0) {
            printf("%.9g ", (double)cpg_leg_phases(&c)[0]);
        }
    }
    return 0;
}
"""

HOSTILE = """
#include "cpg.h"
#include <math.h>
#include <stdio.h>
int main(void)
{
    static cpg c;
    cpg_start(&c, 200, (cpg_real)-1.0);
    for (int tick = 0; tick < 400; tick++) {
        cpg_switch(&c, (uint8_t)tick, (cpg_real)0.1);
        cpg_enable(&c, tick % 7 > 2, (cpg_real)0.0);
        cpg_set_delay(&c, (cpg_real)(tick % 5 - 1));
        if (tick == 300) {
            c.track[0].x[c.track[0].head][0] = (cpg_real)NAN;
        }
        cpg_advance(&c, (cpg_real)(tick % 50 == 0 ? 0.0 : tick == 350 ? 0.5 : 0.01));
        for (int joint = 0; joint < CPG_JOINTS; joint++) {
            printf("%.17g %.17g ", (double)c.position[joint], (double)c.velocity[joint]);
        }
    }
    return 0;
}
"""


@needs_gcc
@pytest.mark.parametrize('robot, network', [
    ('quadruped', 'delayed'), ('biped', 'biped'), ('quadruped', 'hopf'),
    *in_depth(('quadruped', 'quadruped'), ('quadruped', 'phase'), ('quadruped', 'matsuoka'))])
def test_each_step_of_every_preset_is_the_steppers(tmp_path, robot, network):
    made = plans(robot, network)
    assert len(made) >= 2
    plan = compiled(tmp_path, data_of(made, tolerance=1e-3), shim=STEPS)
    draws, worst = np.random.default_rng(35), 0.0
    for number, one in enumerate(made):
        start = one.orbit(np.array(0.0))
        start = start + 0.2 * draws.uniform(-1.0, 1.0, start.size)
        stepper = Stepper(one.orbit.network, start, gain=one.gain, symmetry=one.orbit.symmetry)
        found = np.array(output(plan, number, 500, *map(repr, start.tolist())).split(), float)
        for n, state in enumerate(found.reshape(500, -1), start=1):
            stepper.advance(stepper.step)
            off = np.abs(state - stepper.newest()).max()
            worst = max(worst, off / n)
            assert off < 1e-12 * n, (one.name, n)
    print(f'\n| {network}, {len(made)} presets | {worst:.1e} |')


@needs_gcc
@pytest.mark.parametrize('robot, network, gaits', ROBOTS[:1] + in_depth(*ROBOTS[1:]))
def test_ten_switches_are_those_of_the_generator(tmp_path, robot, network, gaits):
    made = plans(robot, network, gaits)
    for form, real, steering, degrees in (
            ('network', 'float64', False, 2e-4), ('network', 'float32', False, 0.05),
            ('network', 'float64', True, 2e-4), ('network', 'float32', True, 0.05),
            ('table', 'float32', False, 0.05)):
        data = data_of(made, form, real, steering=steering)
        text = output(compiled(tmp_path, data, golden_of(data, 0.002)))
        off = float(re.search(r'rad, ([\d.e+-]+) degrees', text)[1])
        print(f'\n| {robot}, {network}, {", ".join(gaits)} | {form}, {real}, '
              f'steering {steering} | {off:.1e} |')
        assert 'pattern: 10 switches' in text and off < degrees, (form, real, steering, text)


@needs_gcc
@pytest.mark.parametrize('robot, network, gaits', ROBOTS[:1] + in_depth(*ROBOTS[1:6]))
@pytest.mark.parametrize('form', ['network', 'table'])
def test_float32_drifts_by_less_than_a_ten_thousandth_of_a_cycle_in_1000_strides(
        tmp_path, robot, network, gaits, form):
    found = []
    for real in ('float64', 'float32'):
        data = data_of(plans(robot, network, gaits[:1]), form, real, 1e-5)
        found.append(np.array(output(compiled(
            tmp_path, data, shim=DRIFT, options=('-std=c99', '-O2'))).split(), float))
    drift = (found[1] - found[0] + 0.5) % 1.0 - 0.5
    print(f'\n| {network} | {form} | {np.abs(drift - drift[9]).max():.1e} |')
    assert drift.size == 1000 and np.abs(drift - drift[9]).max() < 1e-4


@needs_gcc
def test_nothing_takes_joints_out_of_their_limits(tmp_path):
    made = plans('quadruped', 'delayed', ('trot', 'walk', 'bound'))
    plan = compiled(tmp_path, data_of(made, real='float32'), shim=HOSTILE)
    robot = made[0].robot
    found = np.array(output(plan).split(), float).reshape(400, -1, 2)
    assert np.isfinite(found).all()
    lower, upper, fastest = (robot.column(key) for key in ('lower', 'upper', 'velocity'))
    assert (found[..., 0] >= lower - 1e-6).all() and (found[..., 0] <= upper + 1e-6).all()
    assert (np.abs(found[..., 1]) <= fastest * (1.0 + 1e-6)).all()
    assert np.abs(np.diff(found[:, :, 0], axis=0)).max() > 1e-3


TIMES = """
#include "cpg.h"
#include <math.h>
#include <stdio.h>
int main(void)
{
    static cpg c;
    const cpg_real times[] = {(cpg_real)-1.0, (cpg_real)NAN, (cpg_real)INFINITY,
                              (cpg_real)-INFINITY, (cpg_real)1e30, (cpg_real)-1e30, 0};
    for (int first = 0; first < 7; first++) {
        cpg_start(&c, 0, times[first]);
        for (int n = 0; n < 7; n++) {
            cpg_advance(&c, (cpg_real)0.01);
            cpg_switch(&c, 1, times[n]);
            cpg_advance(&c, times[first]);
            cpg_enable(&c, 0, times[n]);
            cpg_advance(&c, times[n]);
            cpg_enable(&c, 1, times[first]);
        }
        cpg_enable(&c, 1, (cpg_real)0.1);
        for (int n = 0; n < 300; n++) {
            cpg_advance(&c, (cpg_real)0.01);
            for (int joint = 0; joint < CPG_JOINTS; joint++) {
                printf("%.9g ", (double)c.position[joint]);
            }
        }
    }
    return 0;
}
"""


@needs_gcc
@pytest.mark.parametrize('form', ['network', 'table'])
def test_times_that_are_none_break_nothing(tmp_path, form):
    # Compiled with checks of addresses and of what C does not define.
    made = plans('quadruped', 'delayed', ('trot', 'walk'))
    plan = compiled(tmp_path, data_of(made, form, 'float32'), shim=TIMES)
    found = np.array(output(plan).split(), float).reshape(7, 300, -1)
    assert np.isfinite(found).all()
    assert (np.ptp(found[:, -100:], axis=1).max(axis=1) > 0.1).all(), 'it walks on'
    assert np.abs(np.diff(found, axis=1)).max() <= 0.01 * made[0].robot.column('velocity').max()


def with_joints(made, change):
    """Return plans for a robot whose joints are changed."""
    robot = made[0].robot
    legs = {leg: tuple(map(change, joints)) for leg, joints in robot.legs.items()}
    return [plan(replace(robot, legs=legs), one.name, PRESETS['delayed'][one.name],
                 one.orbit.network, one.frequency) for one in made]


def test_names_that_are_one_in_c_are_refused():
    made = with_joints(plans('quadruped', 'delayed', ('trot',)), lambda joint: replace(
        joint, name=joint.name.replace('lh_hip_joint', 'a.b').replace('rh_hip_joint', 'a-b')))
    with pytest.raises(InputError, match=r"joint 'a\.b' and 'a-b' are both A_B in C"):
        project_of(data_of(made))


@needs_gcc
def test_names_that_would_end_a_comment(tmp_path):
    made = with_joints(plans('quadruped', 'delayed', ('trot',)), lambda joint: replace(
        joint, name=joint.name.replace('lh_hip', 'a*/int x;/*é')))
    data = data_of(made, real='float32')
    project = CProject(data, 'Gaits of a */ robot /*')
    files = project.files(golden_of(data, 0.01), arduino=True)
    files['README.md'] = readme(project, golden_of(data, 0.01), 'export')
    (line,) = [line for line in files['examples/walk/walk.ino'].splitlines() if 'int x' in line]
    assert line.count('*/') == 1 and line.endswith(' */')
    assert all(text.count('/*') == text.count('*/') for text in files.values())
    output(compiled(tmp_path, data, golden_of(data, 0.01)))


@needs_gcc
def test_the_golden_test_fails_where_a_number_is_wrong(tmp_path):
    data = data_of(plans('goat', 'delayed', ('trot', 'walk')), real='float32')
    plan = compiled(tmp_path, data, golden_of(data, 0.01))
    output(plan)
    source = tmp_path / 'gait_data.c'
    text = source.read_text()
    period = f'.period = {data.plans[0].orbit.period:.9g}f'
    assert period in text
    source.write_text(text.replace(period, f'.period = {1.02 * data.plans[0].orbit.period:.9g}f'))
    subprocess.run(['gcc', '-std=c99', 'cpg.c', 'gait_data.c', 'test_cpg.c', '-lm', '-o',
                    'test_cpg'], cwd=tmp_path, check=True)
    assert subprocess.run([plan], capture_output=True).returncode == 1


@needs_gcc
def test_a_delay_can_change_while_it_runs(tmp_path):
    """The period after a change of the delay is that of the orbit with the new one."""
    made = plans('quadruped', 'delayed', ('trot',))
    network = made[0].orbit.network
    shim = """
#include "cpg.h"
#include <stdio.h>
int main(void)
{
    static cpg c;
    cpg_start(&c, 0, (cpg_real)0.1);
    cpg_set_delay(&c, (cpg_real)0.3);
    for (int step = 0; step < 20000; step++) {
        const double before = c.track[0].x[c.track[0].head][0];
        cpg_network_step(&c.track[0]);
        const double now = c.track[0].x[c.track[0].head][0];
        if (before < 0.0 && now >= 0.0) {
            printf("%.12g ", (step + 1 - now / (now - before)) * CPG_STEP);
        }
    }
    return 0;
}
"""
    plan = compiled(tmp_path, data_of(made), shim=shim)
    times = np.array(output(plan).split(), float)
    wanted = solve_orbit(network.replace(tau=0.3), 'trot').period
    assert (times[-1] - times[-11]) / 10 == pytest.approx(wanted, rel=1e-6)


#: Rules of MISRA C:2012 that an export departs from, and why; all others are kept.
DEPARTURES = {
    '2.2': 'factors of 1 for networks of one variable', '2.4': 'the tag of struct cpg',
    '2.5': 'macros that are for the user',
    '8.4': 'declared where CPG_INTERNAL is set, or CPG_TABLE is not; cppcheck misses that',
    '8.9': 'tables of cells are beside the equations', '9.2': 'structs name their fields',
    '9.3': 'arrays that begin as zeros',
    '10.1': 'signed numbers are shifted to the right: all supported compilers keep the sign',
    '10.3': 'constants of the type int', '10.4': 'constants of the type int, float beside double',
    '10.8': 'products are widened before they are cast', '12.1': 'usual precedence',
    '12.3': 'declarations of several variables', '13.3': 'one entry added to a list',
    '13.4': 'several variables set to one value', '14.1': 'substeps are counted in cpg_real',
    '14.4': 'flags are uint8_t', '15.5': 'guards return early', '15.7': 'no else is needed',
    '17.8': 'an argument is put within its limits', '18.4': 'tables are walked by pointers',
    '20.10': 'names are pasted to choose between float and double'}


@needs_gcc
@pytest.mark.skipif(shutil.which('cppcheck') is None, reason='cppcheck is not installed')
@pytest.mark.parametrize('form', ['network', 'table'])
def test_cppcheck_finds_nothing_beyond_what_is_departed_from(tmp_path, form):
    made = plans('quadruped', 'delayed', ('trot', 'walk'))
    for name, text in project_of(data_of(made, form, 'float32')).files().items():
        (tmp_path / name).write_text(text)
    done = subprocess.run(
        ['cppcheck', '--std=c99', '--enable=warning,performance,portability', '--addon=misra',
         '--suppress=missingIncludeSystem', '-I.', 'cpg.c', 'gait_data.c'],
        cwd=tmp_path, capture_output=True, text=True, timeout=300)
    found = set(re.findall(r': (?:error|warning|performance|portability|style): .*\[(.+)\]$',
                           done.stderr, re.MULTILINE))
    print(f'\n| cppcheck, {form} | {", ".join(sorted(found))} |')
    assert done.returncode == 0
    assert found <= {f'misra-c2012-{rule}' for rule in DEPARTURES}, done.stderr[-3000:]
