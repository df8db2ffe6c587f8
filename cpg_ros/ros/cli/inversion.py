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

"""Executable ``inversion``: fits a file, or runs the node if no file is named."""

import sys

from cpg_ros.fitting.inversion import inversion


def main() -> int:
    """Run the tool or the node with the arguments of the command line; return the exit code."""
    if sys.argv[1:2] in ([], ['--ros-args']):
        # Files are inverted without ROS, too.
        from cpg_ros.ros.inversion_node import run
        return run()
    return inversion.main()
