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

from pathlib import Path
import re
import shutil
import subprocess

from cpg_ros.motion.export import export
import pytest

TUTORIAL = Path(__file__).parents[3] / 'docs' / 'tutorials' / 'own_network.md'
CORE = Path('/usr/share/arduino/hardware/arduino/avr')
#: Debian has the core, not the library of servos.
SERVO = 'struct Servo { void attach(int pin); void write(int degrees); };\n'
WORDS = ['--robot', 'goat', '--network', 'delayed', '--gait', 'trot', 'walk']


def test_it_writes_c_with_a_test_that_passes(tmp_path, capsys):
    out = tmp_path / 'gait'
    assert export.main([*WORDS, '--rate', '100', '--out', str(out)]) == 0
    assert sorted(path.name for path in out.iterdir()) == [
        'README.md', 'cpg.c', 'cpg.h', 'gait_data.c', 'test_cpg.c']
    assert 'cpg.c' in capsys.readouterr().out
    readme = (out / 'README.md').read_text()
    assert 'CPG_GAIT_TROT' in readme and 'CPG_GAIT_WALK' in readme
    if shutil.which('gcc'):
        command = next(line for line in readme.splitlines() if line.startswith('cc '))
        done = subprocess.run(command.replace('cc ', 'gcc ', 1), shell=True, cwd=out,
                              capture_output=True, text=True)
        assert done.returncode == 0, done.stderr
        assert 'pattern: 10 switches' in done.stdout


@pytest.mark.skipif(shutil.which('gcc') is None, reason='gcc is not installed')
@pytest.mark.parametrize('words', [
    ['--form', 'table', '--rate', '50', '--substep', '0.02'],
    ['--step', '0.05', '--rate', '25', '--substep', '0.04']])
def test_slow_boards_with_long_ticks_do_what_the_generator_does_with_such(tmp_path, words):
    assert export.main(['--robot', 'quadruped', '--gait', 'trot', 'walk', *words, '--out',
                        str(tmp_path)]) == 0
    subprocess.run(['gcc', '-std=c99', 'cpg.c', 'gait_data.c', 'test_cpg.c', '-lm', '-o',
                    'test_cpg'], cwd=tmp_path, check=True)
    done = subprocess.run([tmp_path / 'test_cpg'], capture_output=True, text=True)
    print(done.stdout)
    assert done.returncode == 0, done.stdout


def test_an_arduino_library(tmp_path):
    assert export.main([*WORDS, '--target', 'arduino', '--form', 'table', '--rate', '50',
                        '--substep', '0.02', '--out', str(tmp_path)]) == 0
    properties = dict(line.split('=', 1) for line in
                      (tmp_path / 'library.properties').read_text().splitlines())
    assert {'name', 'version', 'author', 'maintainer', 'sentence', 'paragraph', 'category', 'url',
            'architectures'} <= set(properties)
    assert (tmp_path / 'src' / 'cpg.c').is_file()
    sketch = (tmp_path / 'examples' / 'walk' / 'walk.ino').read_text()
    assert '@' not in sketch and 'TICK = 20;' in sketch


@pytest.mark.parametrize('words, message', [
    (['--steering', '--form', 'table'], 'argument --steering: needs --form network'),
    (['--gait', 'canter'], "argument --gait: 'canter' is not one of"),
    (['--gait', 'trot', 'trot'], 'trot is given twice'),
    (['--network', 'biped'], "'biped' does not drive goat"),
    (['--step', '0.5'], 'argument --step: 0.5 is not from'),
    (['--step', '-1'], 'argument --step: -1 is not above 0'),
    (['--rate', 'nan'], 'argument --rate: nan is not above'),
    (['--substep', '2'], 'argument --substep: 2 is not above 0 and up to 1')])
def test_arguments_of_no_use_are_refused_in_one_line(tmp_path, capsys, words, message):
    out = tmp_path / 'gait'
    assert export.main([*WORDS[:4], *words, '--out', str(out)]) == 2
    printed = capsys.readouterr().err
    assert message in printed and printed.count('\n') == 1
    assert not out.exists()


@pytest.mark.parametrize('words', [['--target', 'petoi'], ['--real', 'fixed']])
def test_what_is_no_choice_is_refused_in_one_line(tmp_path, capsys, words):
    with pytest.raises(SystemExit, match='2'):
        export.main([*WORDS, *words, '--out', str(tmp_path)])
    printed = capsys.readouterr().err
    assert f"argument {words[0]}: invalid choice: '{words[1]}'" in printed
    assert printed.count('\n') == 1 and not list(tmp_path.iterdir())


def test_a_gait_that_cannot_run_is_refused(tmp_path, capsys):
    assert export.main([*WORDS, '--frequency', '10', '--out', str(tmp_path)]) == 1
    assert 'above its limit' in capsys.readouterr().err
    assert not list(tmp_path.iterdir())


def test_a_file_in_place_of_the_folder_is_refused(tmp_path, capsys):
    (tmp_path / 'gait').write_text('mine')
    assert export.main([*WORDS, '--out', str(tmp_path / 'gait')]) == 2
    assert 'is not a directory' in capsys.readouterr().err
    assert (tmp_path / 'gait').read_text() == 'mine'


def test_a_network_of_your_own(tmp_path):
    """That of the tutorial, with its robot file."""
    for name, text in re.findall(r'```\{code-block\} \w+\n:name: (two_legs\.\w+)\n\n(.*?)```',
                                 TUTORIAL.read_text(), re.DOTALL):
        # Under a name of its own: others in this process may have loaded the tutorial's.
        (tmp_path / name.replace('two', 'exported')).write_text(
            text.replace('two_legs', 'exported_legs'))
    out = tmp_path / 'gait'
    assert export.main(['--robot', str(tmp_path / 'exported_legs.yaml'), '--network',
                        str(tmp_path / 'exported_legs.py'), '--gait', 'walk', 'hop', '--real',
                        'float64', '--rate', '200', '--out', str(out)]) == 0
    if shutil.which('gcc'):
        subprocess.run(['gcc', '-std=c99', 'cpg.c', 'gait_data.c', 'test_cpg.c', '-lm', '-o',
                        'test_cpg'], cwd=out, check=True)
        done = subprocess.run([out / 'test_cpg'], capture_output=True, text=True)
        assert done.returncode == 0 and 'pattern: 10 switches' in done.stdout, done.stdout


@pytest.mark.skipif(shutil.which('avr-g++') is None or not CORE.is_dir(),
                    reason='avr-gcc or arduino-core-avr is not installed')
@pytest.mark.parametrize('board, chip', [('standard', 'atmega328p'), ('mega', 'atmega2560')])
def test_the_sketch_compiles_for_a_board(tmp_path, board, chip):
    assert export.main([*WORDS, '--target', 'arduino', '--form', 'table', '--rate', '50',
                        '--substep', '0.02', '--out', str(tmp_path)]) == 0
    (tmp_path / 'Servo.h').write_text(SERVO)
    common = [f'-mmcu={chip}', '-DF_CPU=16000000L', '-DARDUINO=10819', '-Os', '-Wall', '-Wextra',
              '-Werror', f'-I{CORE}/cores/arduino', f'-I{CORE}/variants/{board}', '-Isrc', '-I.',
              '-c']
    for words in (['avr-g++', '-std=gnu++11', '-include', 'Arduino.h', '-x', 'c++',
                   'examples/walk/walk.ino', '-o', 'walk.o'],
                  ['avr-gcc', '-std=gnu11', 'src/cpg.c', '-o', 'cpg.o'],
                  ['avr-gcc', '-std=gnu11', 'src/gait_data.c', '-o', 'gait_data.o']):
        done = subprocess.run([*words, *common], cwd=tmp_path, capture_output=True, text=True)
        assert done.returncode == 0, done.stderr
    done = subprocess.run(['avr-gcc', '-std=c99', 'src/cpg.c', *common], cwd=tmp_path,
                          capture_output=True, text=True)
    assert done.returncode and 'compile with -std=gnu99' in done.stderr


#: A board without time, whose servos print what they are told.
BOARD = """
#include <cstdio>
#include <cstdint>
static unsigned long millis() { return 0; }
static void delay(int) {}
struct Servo { void attach(int) {} void write(int degrees) { std::printf("%d ", degrees); } };
#include "walk.ino"
int main() { setup(); }
"""


@pytest.mark.skipif(shutil.which('g++') is None, reason='g++ is not installed')
def test_each_servo_of_the_sketch_has_a_centre_of_its_own(tmp_path):
    assert export.main([*WORDS, '--target', 'arduino', '--form', 'table', '--rate', '50',
                        '--out', str(tmp_path)]) == 0
    (tmp_path / 'Servo.h').touch()
    (tmp_path / 'main.cpp').write_text(BOARD)
    sketch = tmp_path / 'examples' / 'walk' / 'walk.ino'
    text = sketch.read_text()
    joints = text.count('90,') + 1

    def compiled(centre):
        sketch.write_text(text.replace('{90, 90', f'{{{centre}, 90', 1))
        return subprocess.run(
            ['g++', '-std=gnu++11', '-Wall', '-Wextra', '-Isrc', '-I.', '-Iexamples/walk',
             'main.cpp', '-x', 'c', 'src/cpg.c', 'src/gait_data.c', '-lm', '-o', 'board'],
            cwd=tmp_path, capture_output=True, text=True)

    def stand(centre):
        done = compiled(centre)
        assert done.returncode == 0, done.stderr
        return list(map(int, subprocess.run(
            [tmp_path / 'board'], capture_output=True, text=True).stdout.split()))

    level, moved = stand(90), stand(135)
    assert len(level) == joints and moved[1:] == level[1:]
    assert moved[0] == min(180, level[0] + 45)
    for centre in (-1, 181, 300):
        done = compiled(centre)
        assert done.returncode and 'CENTRE: degrees from 0 to 180' in done.stderr
