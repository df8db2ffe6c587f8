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
from cpg_ros.motion.plan import plan  # noqa: E402
from cpg_ros.networks.registry import PRESETS  # noqa: E402
from cpg_ros.ros.bridges.supervisor import BridgeState, Supervisor  # noqa: E402
from cpg_ros.ros.bridges.unitree.messages import (  # noqa: E402
    LowCmd,  # noqa: E402
    LowState,  # noqa: E402
    MODELS,
    settings_of,
)
from cpg_ros.simulation.body import Body  # noqa: E402
from depth import in_depth  # noqa: E402
from go2 import DT, GO2  # noqa: E402

#: The gait is at its full speed for some strides by then, s.
WALKING = 5.5


def hastened(gait, factor):
    """Return a gait, and its stride frequency in Hz, by a factor above that of the robot file."""
    preset, frequency = PRESETS['delayed'][gait], factor * GO2.motion(gait, gait).frequency
    return plan(GO2, gait, preset, preset.network, frequency), frequency


def sits(plan, last, goes_on):
    """Sit down at a time s; return the largest lean, rad, the last height, m, and the states.

    Either no target comes from then on, or they go on, and the bridge is states to sit.
    """
    body, states = Body('go2', GO2, timestep=DT), []
    state = LowState()
    machine = Supervisor(settings_of(GO2, MODELS['go2'], [60.0], [2.0]), state, LowCmd(),
                         lambda *change: states.append(change))
    pattern, model, now, leans = Pattern(plan), body.model, 0.0, []
    for k in range(round((last + 2.5) / DT)):
        now += DT
        state.q[:], state.dq[:] = body.position, body.velocity
        state.quaternion[:] = body.quaternion
        machine.state_received(now)
        if k == 5:
            assert not machine.rise(now)
        if now > 2.1 and (goes_on or now < last):
            pattern.advance(DT)
            machine.set_target(pattern.position[GO2.order_indices].copy(), now)
        if goes_on and now >= last:
            machine.sit(now, 'SIGINT')
        machine.step(now)
        command = machine.command
        model.actuator_gainprm[:, 0] = command.kp
        model.actuator_biasprm[:, 1], model.actuator_biasprm[:, 2] = -command.kp, -command.kd
        body.command(command.q)
        body.step()
        leans.append(math.acos(min(1.0, state.tilt_cosine)))
    assert 'sat down' in states[-1][1]
    return max(leans[round(last / DT):]), body.base[2], [one for one, _ in states]


# Faster than the robot file's; held as they were for 0.1 s, these toppled at some of the moments.
@pytest.mark.parametrize(('gait', 'factor'), [('trot', 1.5), ('bound', 1.0), ('pronk', 1.0)])
@pytest.mark.parametrize('goes_on', [False, True], ids=['silent', 'interrupted'])
@pytest.mark.parametrize('moment', [0.625, *in_depth(0.125, 0.375, 0.875)])
def test_it_does_not_topple(gait, factor, goes_on, moment):
    plan, frequency = hastened(gait, factor)
    lean, height, states = sits(plan, WALKING + moment / frequency, goes_on)
    assert states[-3:] == [BridgeState.FOLLOWING, BridgeState.SITTING, BridgeState.DAMPING]
    assert height < 0.15 and lean < math.radians(25.0 if goes_on else 45.0)
