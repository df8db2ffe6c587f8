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

"""Gains of robots of other sizes: scaled by Froude's number, or the robot file's own."""

from dataclasses import replace
import math

from cpg_ros.common.errors import InputError
from cpg_ros.feedback.gains import (
    dimensionless,
    GAINS,
    Gains,
    leg_length,
    robot_gains,
    scaled_gains,
)
from cpg_ros.feedback.kinematics import geometry_of
from cpg_ros.motion.body_file import OwnFeedback
from go2 import GO2
import numpy as np
import pytest

LENGTH = leg_length(geometry_of(GO2))
#: Powers of the length by Froude's scaling: 1 of lengths, 1/2 of times.
POWERS = {'m': 1.0, 's': 0.5, 'm/s': 0.5, 's/m': -0.5, '1/s': -0.5, '1/m': -1.0, 's/rad': 0.5,
          '1/rad': 0.0, 'rad/s': -0.5, 'm s/rad': 1.5, '1/s^2': -1.0, '': 0.0}


def of_size(ratio):
    """Return the Go2 with legs that are so many times as long."""
    body = GO2.geometry
    legs = {name: replace(leg, **{part: tuple(ratio * x for x in getattr(leg, part))
                                  for part in ('hip', 'thigh', 'calf', 'foot')})
            for name, leg in body.legs.items()}
    return replace(GO2, geometry=replace(body, legs=legs), feedback=None)


def test_a_go2_has_the_usual_gains():
    assert robot_gains(GO2) == Gains(servo_kp=60.0, servo_kd=2.0)
    assert pytest.approx(0.213 + math.hypot(0.213, 0.002)) == LENGTH
    assert robot_gains(replace(GO2, geometry=None)) == Gains()


@pytest.mark.parametrize('ratio', [0.25, 0.8, 1.3])
def test_gains_go_with_the_length_of_the_legs_by_their_units(ratio):
    found, usual = robot_gains(of_size(ratio)), Gains()
    for name, gain in GAINS.items():
        expected = getattr(usual, name) * ratio**POWERS[gain.unit]
        # Written in three digits.
        assert getattr(found, name) == pytest.approx(expected, rel=5e-3), name
    assert found._replace(**{name: gain.default for name, gain in GAINS.items()}) == usual


def test_scaled_gains_keep_to_their_limits():
    for length in (1e-3, 50.0):
        scaled_gains(length).check()


def test_own_gains_are_shares_of_the_length_and_of_the_time_of_its_pendulum():
    own = OwnFeedback(laws={'reflexes': False, 'virtual_stiffness': True},
                      gains={'step_most': 0.4, 'step': 0.5, 'roll': 2.0, 'pace_from': 0.1})
    for ratio in (0.25, 1.0):
        length = ratio * LENGTH
        found = robot_gains(replace(of_size(ratio), feedback=own))
        assert not found.reflexes and found.virtual_stiffness and found.posture
        assert found.step_most == pytest.approx(0.4 * length)
        assert found.step == pytest.approx(0.5 * math.sqrt(length / 9.81))
        assert found.roll == 2.0
        assert found.pace_from == pytest.approx(0.1 * math.sqrt(9.81 * length))
        assert found.lift == scaled_gains(length).lift


def test_dimensionless_gains_come_back_as_they_were():
    own = OwnFeedback(gains=dimensionless(Gains(), LENGTH))
    assert np.array(robot_gains(replace(GO2, feedback=own)), dtype=float) == pytest.approx(
        np.array(Gains(), dtype=float), rel=1e-3)


@pytest.mark.parametrize('own, words', [
    (OwnFeedback(laws={'postures': True}), "feedback.laws has 'postures', which is not one"),
    (OwnFeedback(gains={'steps': 1.0}), "feedback.gains has 'steps', which is not one of"),
    (OwnFeedback(gains={'step_most': 9.0}), "gain 'step_most' is 3.83.*from 0 to 1.7")])
def test_what_is_wrong_with_own_gains_is_said(own, words):
    with pytest.raises(InputError, match=f"^robot file 'unitree_go2'.*{words}"):
        robot_gains(replace(GO2, feedback=own))
