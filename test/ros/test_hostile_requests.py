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

"""Hundreds of hostile parameter requests; the benchmark sends more and times them."""

import os
from pathlib import Path
import sys

from cpg_ros.networks.library.delayed import PRESETS
from depth import in_depth
from graph import off_grid, until
import numpy as np
import pytest
from rcl_interfaces.msg import Parameter, ParameterType, ParameterValue
from rcl_interfaces.srv import (
    DescribeParameters,
    GetParameters,
    GetParameterTypes,
    ListParameters,
    SetParameters,
    SetParametersAtomically,
)
from stepped import STEP

TYPES = {bool: ParameterType.PARAMETER_BOOL, float: ParameterType.PARAMETER_DOUBLE,
         str: ParameterType.PARAMETER_STRING}
NAMES = ['gait', 'rate', 'frequency', 'amplitude', 'transition', 'ramp', 'symmetry_gain', 'robot',
         'network', 'combined_topic', 'command', 'autostart',
         *(f'delayed.{key}' for key in ('a', 'b', 'c', 'd', 'tau'))]
NETWORKS = {name: {f'delayed.{key}': number for key, number in preset.network.as_dict().items()}
            for name, preset in PRESETS.items()}


@pytest.fixture
def hostile(monkeypatch):
    monkeypatch.syspath_prepend(str(Path(__file__).resolve().parents[2] / 'benchmarks'))
    import hostile
    yield hostile
    del sys.modules['hostile']


@pytest.mark.parametrize('most', [150, *in_depth(2000)])
def test_hostile_requests_change_nothing_they_should_not(stepped, hostile, most):
    generator, watcher = stepped('-p', 'rate:=200', running=False)
    generator.run(0.5)
    values = dict(zip(NAMES, watcher.get(*NAMES), strict=True))
    types = {name: TYPES[type(value)] for name, value in values.items()}
    refused = accepted = 0
    for number, (atomically, batch) in enumerate(hostile.requests(types, most, seed=1)):
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
        generator.run(STEP)
    assert refused > most / 2 and accepted > most / 40, 'the requests have lost their sting'
    assert 'Traceback' not in generator.log
    samples = watcher.samples[:]
    assert np.isfinite([sample[1] for sample in samples]).all()
    # Whatever was asked for, the stamps stay on their grid and no joint outruns its limit.
    assert off_grid([sample[0] for sample in samples], 0.005) < 1e-3
    steps = np.abs(np.diff([sample[1] for sample in samples], axis=0))
    assert steps.max() <= 0.005 * 20.0 * (1.0 + 1e-6)


def cpu(process):
    """Seconds of CPU time that a process has used."""
    fields = Path(f'/proc/{process.pid}/stat').read_text().rpartition(')')[2].split()
    return sum(map(int, fields[11:13])) / os.sysconf('SC_CLK_TCK')


def test_a_request_of_100000_parameters_costs_nothing(start):
    process, watcher = start('-p', 'rate:=50', '-p', 'combined_topic:=joint_states')
    names = [f'name{k}' for k in range(100_000)]
    values = [Parameter(name=name, value=ParameterValue(
        type=ParameterType.PARAMETER_DOUBLE, double_value=1.0)) for name in names]
    watcher.record(0.5)
    for name, kind, request, reason in (
            ('set_parameters', SetParameters, {'parameters': values},
             lambda answer: answer.results[0].reason),
            ('set_parameters_atomically', SetParametersAtomically, {'parameters': values},
             lambda answer: answer.result.reason),
            ('get_parameters', GetParameters, {'names': names},
             lambda answer: not answer.values and process.log),
            ('get_parameter_types', GetParameterTypes, {'names': names},
             lambda answer: not answer.types and process.log),
            ('describe_parameters', DescribeParameters, {'names': names},
             lambda answer: not answer.descriptors and process.log),
            ('list_parameters', ListParameters, {'prefixes': names},
             lambda answer: not answer.result.names and process.log)):
        before, lines, published = cpu(process), len(process.lines), len(watcher.samples)
        answer = watcher.call(kind, f'/cpg_generator/{name}', kind.Request(**request))
        # Converting the values takes 5 s of it, looking up the names more than a second.
        assert cpu(process) - before < 1.0, name
        until(lambda reason=reason, answer=answer: '100000 parameters in one request: at most '
              '1000 are allowed' in str(reason(answer)), f'the reason of {name}')
        until(lambda published=published: len(watcher.samples) > published + 50, 'joint states')
        assert len(process.lines) <= lines + 1
    assert watcher.set(gait='walk')[0].successful
    assert watcher.get('gait', 'rate') == ['walk', 50.0]
