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

"""The demonstration as a process, and the processes that it has started."""

from contextlib import contextmanager
import os
import subprocess

from graph import EXECUTABLE, free_domain

DEMO = EXECUTABLE.with_name('demo')


@contextmanager
def demo(folder, *arguments, domain=None, stdin=subprocess.PIPE):
    """Run it in a domain of its own; end it in the end."""
    variables = dict(os.environ, ROS_DOMAIN_ID=str(domain or free_domain()), PYTHONUNBUFFERED='1')
    process = subprocess.Popen([DEMO, '--out', folder, *arguments], env=variables,
                               stdin=stdin, stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
    try:
        yield process
    finally:
        process.terminate()
        process.communicate(timeout=60)


def nodes_of(process):
    """Process ids of its children."""
    with open(f'/proc/{process.pid}/task/{process.pid}/children') as listed:
        return [int(word) for word in listed.read().split()]


def alive(pid):
    """Whether there is such a process, and not only its remains."""
    try:
        with open(f'/proc/{pid}/stat') as stat:
            return stat.read().rpartition(')')[2].split()[0] != 'Z'
    except OSError:
        return False
