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
import os
from pathlib import Path
import shutil
import subprocess
import sys
import tempfile

DOCS = Path(__file__).resolve().parent
DARK = DOCS / 'static' / 'dark.matplotlibrc'
#: Figure -> module, and its arguments; OUT stands for the file to write.
FIGURES = {
    'footfalls': ('gait_diagram', ['OUT']),
    'quadruped': ('gait_diagram', ['OUT', '--network', 'quadruped']),
    'biped': ('gait_diagram', ['OUT', '--network', 'biped']),
    'phase': ('gait_diagram', ['OUT', '--network', 'phase']),
    'hopf': ('gait_diagram', ['OUT', '--network', 'hopf']),
    'matsuoka': ('gait_diagram', ['OUT', '--network', 'matsuoka']),
    'branches': ('analyze', ['--network', 'delayed', '--set', 'a=-4.5', 'b=1', 'c=6.5', 'd=-2',
                             'tau=0.4', '--plot', 'OUT']),
    'branches_quadruped': ('analyze', ['--network', 'quadruped', '--preset', 'pace', '--along',
                                       'alpha=beta', '--range=-0.1:0.6', '--plot', 'OUT'])}


def draw(name: str, dark: bool) -> Path:
    """Draw a figure; return the file.

    Raises:
        subprocess.CalledProcessError: the command failed; what it said stands before.

    """
    module, words = FIGURES[name]
    out = DOCS / f'{name}{"_dark" if dark else ""}.png'
    with tempfile.TemporaryDirectory() as folder:
        made = Path(folder) / out.name
        command = [sys.executable, '-m', f'cpg_ros.tools.{module}',
                   *(str(made) if word == 'OUT' else word for word in words)]
        variables = dict(os.environ, **{'MATPLOTLIBRC': str(DARK)} if dark else {})
        subprocess.run(command, env=variables, stdout=subprocess.DEVNULL, check=True)
        shutil.move(made, out)
    return out


def main() -> int:
    """Draw what is asked for; return the exit code."""
    parser = argparse.ArgumentParser(description=__doc__.partition('\n')[0])
    parser.add_argument('figures', nargs='*', metavar='NAME',
                        help=f'which (default: all of {", ".join(FIGURES)})')
    chosen = parser.parse_args().figures or list(FIGURES)
    if wrong := [name for name in chosen if name not in FIGURES]:
        parser.error(f"'{wrong[0]}' is not one of {', '.join(FIGURES)}")
    for name in chosen:
        for dark in (False, True):
            print(draw(name, dark), flush=True)
    return 0


if __name__ == '__main__':
    sys.exit(main())
