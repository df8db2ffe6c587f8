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

"""Launch files started by ROS's own launch, where launch_ros is installed."""

import os
from pathlib import Path
import re
import signal
import subprocess
import sys

from ament_index_python.packages import get_package_share_directory
from graph import free_domain, PATIENCE, until
import pytest

pytest.importorskip('launch_ros', reason='launch_ros is not on PyPI: install ROS 2')
pytestmark = pytest.mark.live

SHARE = Path(get_package_share_directory('cpg_ros'))
#: What ros2 launch does, without ros2cli.
START = """
import sys
from launch import LaunchDescription, LaunchService
from launch.actions import IncludeLaunchDescription
from launch.launch_description_sources import PythonLaunchDescriptionSource
path, *words = sys.argv[1:]
service = LaunchService()
service.include_launch_description(LaunchDescription([IncludeLaunchDescription(
    PythonLaunchDescriptionSource(path),
    launch_arguments=[tuple(word.split(':=', 1)) for word in words])]))
sys.exit(service.run())
"""


class Launched:
    """A launch file in a process group and a domain of its own, its output kept."""

    def __init__(self, file, words, folder):
        self.log = folder / 'log'
        variables = dict(os.environ, ROS_DOMAIN_ID=str(free_domain()), PYTHONUNBUFFERED='1',
                         ROS_LOG_DIR=str(folder))
        with open(self.log, 'w') as log:
            self.process = subprocess.Popen(
                [sys.executable, '-c', START, SHARE / 'launch' / file, *words], cwd=folder,
                env=variables, stdout=log, stderr=subprocess.STDOUT, start_new_session=True)

    def said(self):
        return self.log.read_text()

    def end(self):
        """Ctrl-C; return the exit code, and whether any process is left."""
        if self.process.poll() is None:
            os.killpg(self.process.pid, signal.SIGINT)
        code = self.process.wait(PATIENCE)
        try:
            os.killpg(self.process.pid, signal.SIGKILL)
            left = True
        except ProcessLookupError:
            left = False
        return code, left


@pytest.mark.parametrize(('file', 'words', 'sign'), [
    ('generator.launch.py', ['gait:=walk'], "publishing 12 joints of 'quadruped'"),
    ('inversion.launch.py', [], 'listening to '),
    ('go2.launch.py', ['film:=none', 'footfalls:=none'], 'standing at the origin|publishing 12')])
def test_a_launch_file_starts_and_ends_its_nodes(file, words, sign, tmp_path):
    launched = Launched(file, words, tmp_path)
    try:
        until(lambda: any(one in launched.said() for one in sign.split('|'))
              or launched.process.poll() is not None, f'{sign} in\n{launched.said()}')
        assert launched.process.poll() is None, launched.said()
    finally:
        code, left = launched.end()
    assert code == 0 and not left, launched.said()
    assert 'Traceback' not in launched.said()


@pytest.mark.parametrize(('file', 'words', 'why'), [
    ('generator.launch.py', ['rate:=fast'], 'rate:=fast is not a number'),
    ('generator.launch.py', ['gait:=dance'], "gait 'dance' is not one of"),
    ('go2.launch.py', ['kp:=high'], 'kp:=high is not a number'),
    ('rviz.launch.py', ['network:=biped', 'robot:=nowhere'], 'nowhere|sudo apt install ros-')])
def test_a_launch_file_that_cannot_start_says_why_and_leaves_nothing(file, words, why, tmp_path):
    launched = Launched(file, words, tmp_path)
    try:
        until(lambda: launched.process.poll() is not None, f'the end of\n{launched.said()}')
    finally:
        code, left = launched.end()
    assert code != 0 or 'finished' in launched.said() or 'died' in launched.said()
    assert not left and re.search(why, launched.said()), launched.said()
