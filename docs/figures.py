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
"""

import argparse
import base64
import os
from pathlib import Path
import shutil
import subprocess
import sys
import tempfile

DOCS = Path(__file__).resolve().parent
DARK = DOCS / 'static' / 'dark.matplotlibrc'
WALK = DOCS.parent / 'test' / 'data' / 'human_walking.csv'
#: Figure -> module, its arguments, in which FOLDER stands for where it writes, and the file there.
FIGURES = {
    **{name: ('gait_diagram', ['FOLDER/it.png', '--network', network], 'it.png')
       for name, network in {'footfalls': 'delayed', 'quadruped': 'quadruped', 'biped': 'biped',
                             'phase': 'phase', 'hopf': 'hopf', 'matsuoka': 'matsuoka'}.items()},
    'branches': ('analyze', ['--network', 'delayed', '--set', 'a=-4.5', 'b=1', 'c=6.5', 'd=-2',
                             'tau=0.4', '--plot', 'FOLDER/it.png'], 'it.png'),
    'branches_quadruped': ('analyze', ['--network', 'quadruped', '--preset', 'pace', '--along',
                                       'alpha=beta', '--range=-0.1:0.6', '--plot',
                                       'FOLDER/it.png'], 'it.png'),
    'phase_response': ('analyze', ['--network', 'quadruped', '--preset', 'trot', '--prc',
                                   'FOLDER/it.png'], 'it.png'),
    'inversion': ('inversion', ['--csv', str(WALK), '--out', 'FOLDER/fitted.yaml', '--report',
                                'FOLDER/report.html'], 'report.html'),
    'tour': ('demo', ['--tour', '--no-panel', '--out', 'FOLDER'], 'footfalls.png'),
    'hexapod_footfalls': ('demo', ['--hexapod', '--tour', 'tripod', 'ripple', 'wave', '--every',
                                   '4', '--no-panel', '--out', 'FOLDER'],
                          'footfalls.png')}
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
        command = [sys.executable, '-m', f'cpg_ros.ros.{module}',
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


def main() -> int:
    """Draw what is asked for; return the exit code."""
    parser = argparse.ArgumentParser(description=__doc__.partition('\n')[0])
    parser.add_argument('figures', nargs='*', metavar='NAME',
                        help=f'which (default: all of {", ".join(FIGURES)})')
    args = parser.parse_args().figures or list(FIGURES)
    if wrong := [name for name in args if name not in FIGURES]:
        parser.error(f"'{wrong[0]}' is not one of {', '.join(FIGURES)}")
    for name in args:
        for dark in (False, True):
            print(draw(name, dark), flush=True)
    return 0


if __name__ == '__main__':
    sys.exit(main())
