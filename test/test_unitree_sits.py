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

"""A robot whose generator is gone in mid-stride sits down and does not topple, in MuJoCo."""

import math

import pytest

pytest.importorskip('mujoco', reason='the extra [sim] is not installed')

from cpg_ros.motion.pattern import Pattern  # noqa: E402, I100
from cpg_ros.simulation.body import Body  # noqa: E402
from cpg_ros.unitree.models import MODELS  # noqa: E402
from cpg_ros.unitree.settings import settings_of  # noqa: E402
from cpg_ros.unitree.supervisor import Phase, Supervisor  # noqa: E402
from go2 import DT, GO2, program  # noqa: E402


# Moments of the trot at which a robot that held its legs as they were fell on its back.
@pytest.mark.parametrize('last', [5.6, 5.9])
def test_it_does_not_topple(last):
    body, told = Body('go2', GO2, timestep=DT), []
    machine = Supervisor(settings_of(GO2, MODELS['go2'], [60.0], [2.0]),
                         lambda phase, reason: told.append((phase, reason)))
    pattern, state, model, now = Pattern(program('trot')), machine.state, body.model, 0.0
    for k in range(round((last + 2.0) / DT)):
        now += DT
        state.q[:], state.dq[:] = body.position, body.velocity
        state.quaternion[:] = body.quaternion
        machine.heard(now)
        if k == 5:
            assert not machine.rise(now)
        if 2.1 < now < last:
            pattern.advance(DT)
            machine.ask(pattern.position[GO2.places].copy(), now)
        machine.step(now)
        command = machine.command
        model.actuator_gainprm[:, 0] = command.kp
        model.actuator_biasprm[:, 1], model.actuator_biasprm[:, 2] = -command.kp, -command.kd
        body.command(command.q)
        body.step()
    assert [phase for phase, _ in told][-3:] == [Phase.FOLLOWING, Phase.SITTING, Phase.DAMPING]
    assert 'sat down' in told[-1][1]
    assert machine.state.tilt_cosine > math.cos(math.radians(10.0)) and body.base[2] < 0.15
