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

"""What check_robot makes of each URDF and MJCF file of a folder: legs and joints, or the reason.

Usage: python3 benchmarks/sweep_descriptions.py FOLDER
"""

from pathlib import Path
import sys

from cpg_ros.common.errors import CpgError
from cpg_ros.simulation.robot_setup.description_match import walking_faults
from cpg_ros.simulation.robot_setup.first_robot import robot_from
from cpg_ros.simulation.robot_setup.leg_chains import legs_in
from cpg_ros.simulation.robot_setup.model_reading import load_description


def found_in(path: Path) -> list[str]:
    """Return what each leg's joints do and what is held, or the reason why there is no robot."""
    try:
        known = load_description(str(path))
        legs = legs_in(known)
        robot, notes = robot_from(known, path.stem, legs)
        faults = walking_faults(robot, known)
    except CpgError as error:
        return [f'refused: {error}']
    lines = [*notes.splitlines(), *(f'refused: {fault}' for fault in faults)]
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
