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

"""The first feedback of an installation is compiled while the robot walks, by another process."""

from itertools import pairwise

from graph import until
import pytest
from rcl_interfaces.srv import SetParameters
from rclpy.parameter import Parameter


@pytest.mark.deep
def test_what_a_walking_generator_needs_is_compiled_elsewhere(start, tmp_path, monkeypatch):
    # Nothing is compiled yet: a busy machine needs minutes for the network and the feedback.
    monkeypatch.setattr('graph.PATIENCE', 400.0)
    monkeypatch.setenv('NUMBA_CACHE_DIR', str(tmp_path))
    process, watcher = start('-p', 'robot:=unitree_go2', '-p', 'feedback.enabled:=false', '-p',
                             'feedback.joint_states_topic:=measured')
    watcher.record(1.0)
    client = watcher.client(SetParameters, '/cpg_generator/set_parameters')
    answer = client.call_async(SetParameters.Request(parameters=[
        Parameter('feedback.enabled', value=True).to_parameter_msg()]))
    process.wait_for('making the feedback ready in a process of its own')
    assert not answer.done()
    process.wait_for('ready after')
    until(answer.done, 'the answer')
    assert answer.result().results[0].successful
    stamps = [sample[0] for sample in watcher.samples]
    longest = max(after - before for before, after in pairwise(stamps))
    print(f'longest gap {1e3 * longest:.0f} ms of {len(stamps)} samples')
    # What it compiles itself, it announces.
    assert 'compiling the feedback: about' not in process.log
