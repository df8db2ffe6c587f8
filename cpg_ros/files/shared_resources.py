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

"""Where the package's shipped files are, installed or in a source tree."""

from pathlib import Path


def share() -> Path:
    """Return the folder that holds ``config``: that of the sources, or share/cpg_ros above.

    Raises:
        FileNotFoundError: the installation is incomplete.

    """
    package = Path(__file__).resolve().parents[1]
    for folder in (package.parent, *(above / 'share' / 'cpg_ros' for above in package.parents)):
        if (folder / 'config' / 'presets').is_dir():
            return folder
    raise FileNotFoundError(f'share/cpg_ros/config is missing from the installation at {package}')
