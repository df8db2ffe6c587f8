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

"""Draws the documentation's figures with the project's own commands: `make figures`.

Every figure is made twice, on a light and on a dark ground (NAME.png and NAME_dark.png); the site
shows the one that fits the reader's theme. The pictures of the simulation take a minute each.
Diagrams are written by hand (NAME.svg); here they get their dark copy.
"""

import argparse
import base64
import os
from pathlib import Path
import re
import shutil
import subprocess
import sys
import tempfile

DOCS = Path(__file__).resolve().parent
DARK = DOCS / 'static' / 'dark.matplotlibrc'
WALK = DOCS.parent / 'test' / 'data' / 'human_walking.csv'
#: Figure -> module or script, its arguments (FOLDER: where it writes), and the file there.
FIGURES = {
    **{name: (str(DOCS / 'footfalls.py'), ['FOLDER/it.png', network], 'it.png')
       for name, network in {'footfalls': 'delayed', 'quadruped': 'quadruped', 'biped': 'biped',
                             'phase': 'phase', 'hopf': 'hopf', 'matsuoka': 'matsuoka'}.items()},
    'branches': ('analysis.analyze', [
        '--network', 'delayed', '--set', 'a=-4.5', 'b=1', 'c=6.5', 'd=-2', 'tau=0.4',
        '--plot', 'FOLDER/it.png'], 'it.png'),
    'branches_quadruped': ('analysis.analyze', [
        '--network', 'quadruped', '--preset', 'pace', '--along', 'alpha=beta',
        '--range=-0.1:0.6', '--plot', 'FOLDER/it.png'], 'it.png'),
    'phase_response': ('analysis.analyze', [
        '--network', 'quadruped', '--preset', 'trot', '--prc', 'FOLDER/it.png'], 'it.png'),
    'inversion': ('ros.cli.inversion', [
        '--csv', str(WALK), '--out', 'FOLDER/fitted.yaml', '--report', 'FOLDER/report.html'],
        'report.html'),
    'tour': ('ros.cli.demo', ['--tour', '--no-panel', '--out', 'FOLDER'], 'footfalls.png'),
    'hexapod_footfalls': ('ros.cli.demo', [
        '--hexapod', '--tour', 'tripod', 'ripple', 'wave', '--every', '4', '--no-panel',
        '--out', 'FOLDER'], 'footfalls.png')}
#: Diagrams, and the colours of their dark copies.
DIAGRAMS = 'rooms', 'threads', 'tick'
DARK_COLOURS = (':root { --ink: #e6edf3; --faint: #9da7b3; --ground: #131416; --line: #6e7681; '
                '--cool: #1d3557; --warm: #4a3419; --mild: #21402a }')
#: Heading of the picture that is taken from a report.
HEADING = '<h2>Recorded and fitted</h2>'


def draw(name: str, dark: bool) -> Path:
    """Draw a figure; return the file.

    Raises:
        subprocess.CalledProcessError: the command failed; what it said stands before.

    """
    module, words, left = FIGURES[name]
    out = DOCS / f'{name}{"_dark" if dark else ""}.png'
    with tempfile.TemporaryDirectory() as folder:
        command = [sys.executable, *([module] if module.endswith('.py') else
                                     ['-m', f'cpg_ros.{module}']),
                   *(word.replace('FOLDER', folder) for word in words)]
        variables = dict(os.environ, **{'MATPLOTLIBRC': str(DARK)} if dark else {})
        subprocess.run(command, env=variables, stdin=subprocess.DEVNULL,
                       stdout=subprocess.DEVNULL, check=True)
        made = Path(folder) / left
        if made.suffix == '.html':
            picture = made.read_text().partition(HEADING)[2].partition('base64,')[2]
            out.write_bytes(base64.b64decode(picture.partition('"')[0]))
        else:
            shutil.move(made, out)
    return out


def darken(name: str) -> Path:
    """Write the dark copy of a diagram; return the file."""
    out = DOCS / f'{name}_dark.svg'
    light = (DOCS / f'{name}.svg').read_text()
    out.write_text(re.sub(r':root \{.*\}', DARK_COLOURS, light))
    return out


def main() -> int:
    """Draw what is asked for; return the exit code."""
    parser = argparse.ArgumentParser(description=__doc__.partition('\n')[0])
    every = [*FIGURES, *DIAGRAMS]
    parser.add_argument('figures', nargs='*', metavar='NAME',
                        help=f'which (default: all of {", ".join(every)})')
    args = parser.parse_args().figures or every
    if wrong := [name for name in args if name not in every]:
        parser.error(f"'{wrong[0]}' is not one of {', '.join(every)}")
    for name in args:
        if name in DIAGRAMS:
            print(darken(name), flush=True)
            continue
        for dark in (False, True):
            print(draw(name, dark), flush=True)
    return 0


if __name__ == '__main__':
    sys.exit(main())
