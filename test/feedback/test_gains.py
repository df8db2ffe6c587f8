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

"""Limits of the feedback's gains: what is outside is refused, and nothing inside is fatal."""

from cpg_ros.common.errors import InputError
from cpg_ros.feedback.estimate import SensorData
from cpg_ros.feedback.feedback import Feedback
from cpg_ros.feedback.gains import GAINS, Gains, LAWS
from cpg_ros.feedback.kinematics import geometry_of
from cpg_ros.feedback.tick import PlannedMotion
from cpg_ros.ros.feedback.switch import PREFIX, SPECS
from go2 import DT, gait_plan, GO2
import numpy as np
import pytest

TROT = gait_plan('trot')


def corrected(gains):
    """Return the angles, rad, of a body that is pushed and whose feet stumble, for 100 ticks."""
    feedback = Feedback(geometry_of(GO2), gains)
    slot, legs, joints = feedback.learn(TROT), len(GO2.legs), len(GO2.joints)
    sensors, found = SensorData.zeros(1, legs, joints), np.empty((100, joints))
    stand = GO2.column('offset')
    for k in range(len(found)):
        phase = np.array([k / len(found)])
        sensors.joint_positions[0] = stand
        sensors.acceleration[0] = 5.0, 5.0, 9.81
        sensors.rpy[0] = 0.1, -0.1, 0.0
        # Every foot on the ground in its swing as well, at times.
        sensors.foot_forces[0] = 0.0 if k % 3 == 0 else 40.0
        planned = PlannedMotion(stand[None], phase, np.full((1, 2), slot), np.zeros(1),
                                np.array([[0.4, 0.1]]), np.zeros(1), np.full(1, 0.5),
                                np.zeros((1, 3)))
        found[k] = feedback.advance(sensors, planned, DT)[0]
    assert np.isfinite(feedback.memory.frequency_scale).all()
    assert np.isfinite(feedback.memory.stride).all()
    return found


@pytest.mark.parametrize(('name', 'value', 'text'), [
    ('stiffen_kp', 0.5, "gain 'stiffen_kp' is 0.5, but must be from 1 to 4"),
    ('stiffen_kp', float('nan'), 'is nan'),
    ('step_most', -0.1, 'must be from 0 to')])
def test_a_gain_outside_its_limits_is_refused(name, value, text):
    """When feedback begins, and when its gains are replaced, before a tick takes them."""
    with pytest.raises(InputError, match=text):
        corrected(Gains()._replace(**{name: value}))
    assert SPECS[PREFIX + name].low == GAINS[name].low


@pytest.mark.parametrize('end', ['low', 'high'])
@pytest.mark.parametrize('name', GAINS)
def test_every_gain_may_be_at_its_limits(name, end):
    """No quotient of zeros reaches a joint."""
    gains = Gains()._replace(**{law.name: True for law in LAWS},
                             **{name: getattr(GAINS[name], end)})
    assert np.isfinite(corrected(gains)).all()
