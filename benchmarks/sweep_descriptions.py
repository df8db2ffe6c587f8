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

"""What check_robot finds in each URDF and MJCF file of a folder: legs and joints, or the reason.

Usage: python3 benchmarks/sweep_descriptions.py FOLDER
"""

from pathlib import Path
import sys

from cpg_ros.common.errors import CpgError
from cpg_ros.motion.description import load_urdf
from cpg_ros.simulation.robot_setup.leg_chains import legs_in
from cpg_ros.simulation.robot_setup.model_reading import load_mjcf


def found_in(path: Path) -> list[str]:
    """Return a line for each leg and for what is held, or the reason why there are no legs."""
    try:
        legs = legs_in(load_urdf(path) if path.suffix == '.urdf' else load_mjcf(str(path)))
    except CpgError as error:
        return [f'refused: {error}']
    lines = [f'{leg}: {" ".join(legs[leg])}' for leg in legs]
    lines += legs.explanation.splitlines()
    return lines + ([f'of no leg: {" ".join(legs.unassigned)}'] if legs.unassigned else [])


def main(folder: Path) -> None:
    """Print what is found in every file, by its path in the folder."""
    for path in sorted(folder.rglob('*')):
        if path.suffix in ('.urdf', '.xml') and path.name != 'package.xml':
            print(path.relative_to(folder))
            for line in found_in(path):
                print(f'  {line}')


if __name__ == '__main__':
    main(Path(sys.argv[1]))
