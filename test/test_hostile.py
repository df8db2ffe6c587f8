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

"""Two thousand hostile parameter requests; the benchmark sends more and times them."""

from pathlib import Path
import sys

from cpg_ros.networks.delayed import PRESETS
from graph import off_grid
import numpy as np
import pytest
from rcl_interfaces.msg import ParameterType
from rcl_interfaces.srv import SetParameters, SetParametersAtomically

TYPES = {bool: ParameterType.PARAMETER_BOOL, float: ParameterType.PARAMETER_DOUBLE,
         str: ParameterType.PARAMETER_STRING}
NAMES = ['gait', 'rate', 'frequency', 'amplitude', 'transition', 'ramp', 'symmetry_gain', 'robot',
         'network', 'combined_topic', 'command', 'autostart',
         *(f'delayed.{key}' for key in ('a', 'b', 'c', 'd', 'tau'))]
NETWORKS = {name: {f'delayed.{key}': number for key, number in preset.network.as_dict().items()}
            for name, preset in PRESETS.items()}


@pytest.fixture
def hostile(monkeypatch):
    monkeypatch.syspath_prepend(str(Path(__file__).resolve().parent.parent / 'benchmarks'))
    import hostile
    yield hostile
    del sys.modules['hostile']


def test_hostile_requests_change_nothing_they_should_not(start, hostile):
    process, watcher = start('-p', 'rate:=200')
    values = dict(zip(NAMES, watcher.get(*NAMES), strict=True))
    types = {name: TYPES[type(value)] for name, value in values.items()}
    refused = accepted = 0
    for number, (atomically, batch) in enumerate(hostile.requests(types, 2000, seed=1)):
        if atomically:
            results = [watcher.call(SetParametersAtomically,
                                    '/cpg_generator/set_parameters_atomically',
                                    SetParametersAtomically.Request(parameters=batch)).result]
        else:
            results = watcher.call(SetParameters, '/cpg_generator/set_parameters',
                                   SetParameters.Request(parameters=batch)).results
        after = dict(zip(NAMES, watcher.get(*NAMES), strict=True))
        expected = hostile.effect(values, atomically, batch, results, NETWORKS)
        assert after == {name: expected[name] for name in NAMES}, (number, batch, results)
        assert all(result.successful or result.reason for result in results), (number, batch)
        refused += sum(not result.successful for result in results)
        accepted += sum(result.successful for result in results)
        values = after
    assert process.alive
    assert refused > 1000 and accepted > 50, 'the requests have lost their sting'
    assert 'Traceback' not in process.log
    samples = watcher.samples[:]
    assert np.isfinite([sample[1] for sample in samples]).all()
    # Whatever was asked for, the stamps stay on their grid and no joint outruns its limit.
    assert off_grid([sample[0] for sample in samples], 0.005) < 1e-3
    steps = np.abs(np.diff([sample[1] for sample in samples], axis=0))
    assert steps.max() <= 0.005 * 20.0 * (1.0 + 1e-6)
