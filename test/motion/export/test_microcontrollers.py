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

"""Exports on simulated processors: cycles of simavr, instructions of qemu, flash and RAM.

``make test-export`` runs these and prints the table of docs/benchmarks.md.
"""

from pathlib import Path
import shutil
import subprocess

from c_export import compiled, data_of, needs_gcc, output, plans, project_of
import numpy as np
import pytest

PROGRAMS = Path(__file__).parents[2] / 'data' / 'export'
AVR = ('avr-gcc', 'avr-size', 'simavr')
ARM = ('arm-none-eabi-gcc', 'arm-none-eabi-size', 'qemu-system-arm')
CORTEX = {'Cortex-M0+': (('-mcpu=cortex-m0plus',), 'mps2-an385'),
          'Cortex-M3': (('-mcpu=cortex-m3',), 'mps2-an385'),
          'Cortex-M4F': (('-mcpu=cortex-m4', '-mfpu=fpv4-sp-d16', '-mfloat-abi=hard'),
                         'mps2-an386')}
HOST = """
#include "cpg.h"
#include <stdio.h>

int main(void)
{
    static cpg c;
    cpg_start(&c, 0, 1.0f);
    for (int tick = 0; tick < 200; tick++) {
        if (tick == 100) {
            cpg_switch(&c, CPG_GAITS - 1, 1.0f);
        }
        cpg_advance(&c, 0.02f);
    }
    for (int joint = 0; joint < CPG_JOINTS; joint++) {
        printf("%.8g ", (double)c.position[joint]);
    }
    return 0;
}
"""


def project(form, gaits):
    """Return what a small board runs: a step of 0.05, one part a tick."""
    made = plans('quadruped', 'delayed', gaits)
    steered = form == 'steered'
    data = data_of(
        made, 'network' if steered else form, 'float32', steering=steered,
        step=None if form == 'table' else 0.05)
    return data, project_of(data, 0.02)


def needed(plans):
    missing = [name for name in plans if shutil.which(name) is None]
    if missing:
        pytest.skip(f'{plans[0]} or its simulator is not installed')


def run(words, folder):
    done = subprocess.run(words, cwd=folder, capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr[:2000]
    return done.stdout + done.stderr


def figures(text):
    """Return name -> number of a program's lines, and its positions in rad."""
    found, positions = {}, []
    for line in text.splitlines():
        words = line.replace('\x1b[32m', '').replace('\x1b[0m', '').rstrip('.').split()
        if len(words) == 2 and words[1].lstrip('-').isdigit():
            if words[0] == 'position':
                positions.append(float(words[1]) * 1e-5)
            found[words[0]] = int(words[1])
    return found, np.array(positions)


def sizes(size, folder):
    text, data, bss = map(int, run([size, 'on_board'], folder).splitlines()[1].split()[:3])
    return text + data, data + bss


def check(name, form, folder, found, positions, memory, unit):
    shim = output(compiled(folder, project(form, GAITS[form])[0], shim=HOST,
                           options=('-std=c99', '-O2'), substep=0.02))
    assert np.abs(positions - np.array(shim.split(), float)).max() < 2e-4
    step = f'{found["step"]:,}' if 'step' in found else '-'
    print(f'\n| {name} | {form} | {", ".join(GAITS[form])} | {memory[0]:,} | {memory[1]:,} | '
          f'{found.get("stack", "-")} | {step} | {found["tick"]:,} | {found["fading"]:,} | {unit}')


#: Of each form; steered is the network's, with steering.
GAITS = {'network': ('trot',), 'steered': ('trot',), 'table': ('trot', 'walk')}


@needs_gcc
@pytest.mark.parametrize('form', GAITS)
@pytest.mark.parametrize('chip', ['atmega328p', 'atmega2560'])
def test_an_atmega_has_the_time_and_the_memory(tmp_path, chip, form):
    needed(AVR)
    for name, text in project(form, GAITS[form])[1].files().items():
        (tmp_path / name).write_text(text)
    run(['avr-gcc', f'-mmcu={chip}', '-std=gnu99', '-Os', '-Wall', '-Wextra', '-Werror', '-I.',
         'cpg.c', 'gait_data.c', PROGRAMS / 'avr.c', '-lm', '-o', 'on_board'], tmp_path)
    flash, ram = sizes('avr-size', tmp_path)
    found, positions = figures(run(['simavr', '-m', chip, '-f', '16000000', 'on_board'],
                                   tmp_path))
    # At 16 MHz within 40 ms, the table within 20; in 32 kB, and in 2 kB with what the stack takes.
    assert 0 < found['tick'] < 640_000 and flash < 32_768
    assert ram + found['stack'] < 2048
    if form == 'table':
        assert found['state'] < 1024 and found['tick'] < 64_000 and found['fading'] < 320_000
    check(chip, form, tmp_path, found, positions, (flash, ram), 'cycles')


@needs_gcc
@pytest.mark.parametrize('form', GAITS)
@pytest.mark.parametrize('core', CORTEX)
def test_a_cortex_m_does_the_same(tmp_path, core, form):
    needed(ARM)
    options, board = CORTEX[core]
    for name, text in project(form, GAITS[form])[1].files().items():
        (tmp_path / name).write_text(text)
    run(['arm-none-eabi-gcc', *options, '-mthumb', '-std=gnu99', '-Os', '-Wall', '-I.',
         '-nostartfiles', '--specs=nosys.specs', '--specs=nano.specs', '-T',
         PROGRAMS / 'cortex_m.ld', 'cpg.c', 'gait_data.c', PROGRAMS / 'cortex_m.c', '-lm', '-o',
         'on_board'], tmp_path)
    found, positions = figures(run(
        ['qemu-system-arm', '-M', board, '-nographic', '-semihosting', '-icount', 'shift=0',
         '-kernel', 'on_board'], tmp_path))
    assert found['tick'] > 0
    check(core, form, tmp_path, found, positions, sizes('arm-none-eabi-size', tmp_path),
          'instructions')
