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

from glob import glob
from pathlib import Path
import tomllib

from setuptools import find_packages, setup
from setuptools.command.dist_info import dist_info
from setuptools.command.install_scripts import install_scripts

#: Ctrl-C is no traceback from the first line on, and nobody looks for the package's metadata.
SCRIPT = """{shebang}
import os
import signal

if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
    signal.signal(signal.SIGINT, lambda *_: os._exit(130))

from cpg_ros.ros.cli.executables import start

if __name__ == '__main__':
    raise SystemExit(start('{name}'))
"""


GROUPS = tomllib.loads(
    Path(__file__).with_name('pyproject.toml').read_text())['dependency-groups']


class Scripts(install_scripts):
    """Executables that can be interrupted as soon as Python runs them."""

    def run(self):
        super().run()
        for path in map(Path, self.outfiles):
            shebang, _, _ = path.read_text().partition('\n')
            python = shebang.removeprefix('#!').strip('"')
            if ' ' in python and Path(python).exists():
                # No #! can name it: the shell starts it, and Python reads that as a text.
                shebang = f"#!/bin/sh\n'''exec' '{python}' \"$0\" \"$@\"\n' '''"
            path.write_text(SCRIPT.format(shebang=shebang, name=path.name))


class WheelMetadata(dist_info):
    """Of a wheel, whose executables stand among those of others: cpg, cpg-demo, cpg-robot-sim."""

    def finalize_options(self):
        super().finalize_options()
        scripts = dict(one.split(' = ')
                       for one in self.distribution.entry_points['console_scripts'])
        self.distribution.entry_points['console_scripts'] = [
            f'{name if name == "cpg" else "cpg-" + name.replace("_", "-")} = {where}'
            for name, where in scripts.items()]


setup(
    name='cpg_ros',
    version='0.2.0',
    cmdclass={'install_scripts': Scripts, 'dist_info': WheelMetadata},
    packages=find_packages(include=['cpg_ros', 'cpg_ros.*']),
    package_data={'cpg_ros': ['py.typed', 'analysis/atlas/map.[chj]*', 'analysis/papers/*.yaml',
                              'common/*.css', 'ros/node/*.[cx]*', 'ros/panel/page/*',
                              'dynamics/integration/c/*']},
    data_files=[
        ('share/ament_index/resource_index/packages', ['resource/cpg_ros']),
        ('share/cpg_ros', ['package.xml']),
        ('share/cpg_ros/config', glob('config/*.yaml')),
        ('share/cpg_ros/config/presets', glob('config/presets/*.yaml')),
        ('share/cpg_ros/config/segments', glob('config/segments/*.yaml')),
        ('share/cpg_ros/launch', glob('launch/*.launch.py')),
        ('share/cpg_ros/models', glob('resource/models/*.xml')),
        ('share/cpg_ros/urdf', glob('resource/urdf/*.urdf')),
        ('share/cpg_ros/rviz', glob('resource/rviz/*.rviz')),
        ('share/cpg_ros/plotjuggler', glob('resource/plotjuggler/*.xml')),
        ('share/cpg_ros/foxglove', glob('resource/foxglove/*.json')),
    ],
    python_requires='>=3.11',
    install_requires=['setuptools', *GROUPS['core'], *GROUPS['numba']],
    extras_require={'sim': GROUPS['sim'] + GROUPS['models'],
                    **{name: GROUPS[name]
                       for name in ('ros', 'compiler', 'panel', 'c3d', 'h5', 'optimize',
                                    'fleet', 'test')}},
    zip_safe=False,
    maintainer='cpg_ros maintainers',
    maintainer_email='issue-tracker@cpg-ros.invalid',
    description='Central pattern generators for legged robots on ROS 2',
    license='Apache-2.0',
    entry_points={'console_scripts': [
        'generator = cpg_ros.ros.cli.executables:generator',
        'robot_sim = cpg_ros.ros.cli.executables:robot_sim',
        'unitree_bridge = cpg_ros.ros.cli.executables:unitree_bridge',
        'servo_bridge = cpg_ros.ros.cli.executables:servo_bridge',
        'servo_bus = cpg_ros.ros.cli.executables:servo_bus',
        'panel = cpg_ros.ros.cli.executables:panel',
        'inversion = cpg_ros.ros.cli.executables:inversion',
        'cpg = cpg_ros.ros.cli.executables:cpg',
        'demo = cpg_ros.ros.cli.executables:demo',
        'analyze = cpg_ros.ros.cli.executables:analyze',
        'check_robot = cpg_ros.ros.cli.executables:check_robot',
        'optimize = cpg_ros.ros.cli.executables:optimize',
        'reproduce = cpg_ros.ros.cli.executables:reproduce',
        'tune = cpg_ros.ros.cli.executables:tune',
        'calibrate = cpg_ros.ros.cli.executables:calibrate',
        'atlas = cpg_ros.ros.cli.executables:atlas',
        'export = cpg_ros.ros.cli.executables:export']},
)
