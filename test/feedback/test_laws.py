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

"""Each law of the feedback by itself: what it does to a foot, a stride or the pace."""

import math

from cpg_ros.feedback.gains import Gains
from cpg_ros.feedback.kinematics import wrapped
from cpg_ros.feedback.laws import (
    clearance,
    heading,
    pace,
    placement,
    posture,
    reflexes,
    sidestep,
    slope,
    speed,
    stiffen,
    virtual_stiffness,
)
from cpg_ros.feedback.laws.law import low_passed
from go2 import DT
import numpy as np
import pytest

GAINS = Gains()
#: Feet of the legs lh, rh, lf, rf, m.
FEET = ((-0.2, 0.14), (-0.2, -0.14), (0.2, 0.14), (0.2, -0.14))


def test_posture_draws_in_the_high_side_and_stretches_the_low_one():
    rolled = [posture.in_stance(x, y, 0.1, 0.0, 0.0, 0.0, 0.0, GAINS) for x, y in FEET]
    assert (np.sign(rolled) == [1, -1, 1, -1]).all()
    nodding = [posture.in_stance(x, y, 0.0, 0.0, 0.0, 1.0, 0.0, GAINS) for x, y in FEET]
    assert (np.sign(nodding) == [1, 1, -1, -1]).all()
    far = [posture.in_stance(x, y, 9.0, -9.0, 0.0, 0.0, 0.0, GAINS) for x, y in FEET]
    assert np.abs(far).max() == GAINS.posture_most


def test_a_swing_foot_stays_level():
    """Heights over ground of a body that leans are those of one that does not."""
    for x, y in FEET:
        moved = posture.in_swing(x, y, 0.02, -0.03, GAINS)
        assert 0.02 * y + 0.03 * x + moved == pytest.approx(0.0, abs=1e-12)


def test_a_body_that_goes_too_fast_steps_further():
    assert placement.step(0.3, 0.0, GAINS.step, 0.0, GAINS) == pytest.approx(GAINS.step * 0.3)
    assert placement.step(-9.0, 0.0, GAINS.step, 0.0, GAINS) == -GAINS.step_most
    assert placement.step(0.0, 1.0, 0.0, GAINS.step_pitch_rate, GAINS) > 0.0


def test_feet_in_the_air_go_to_their_steps_and_those_on_the_ground_yield():
    swung = stood = 0.0
    for _ in range(100):
        swung = low_passed(swung, 0.05, GAINS.step_filter, DT)
        stood = placement.in_stance(stood, 0.1, GAINS, DT)
    assert swung == pytest.approx(0.05, abs=1e-3)
    assert -0.1 * 0.2 < stood < 0.0


def test_feet_in_stance_yield_more_to_the_side_while_the_body_recovers():
    calm, pushed = (placement.yielding(0.2, -0.3, recovering, GAINS)
                    for recovering in (False, True))
    assert calm == pytest.approx((GAINS.give * 0.2, -GAINS.give_left * 0.3))
    assert pushed == pytest.approx((calm[0], GAINS.give_recovering * calm[1]))
    assert GAINS.give_recovering > 1.0


def test_a_sidestep_begins_as_far_on_one_side_as_it_ends_on_the_other():
    way = first = sidestep.landing(0.2, 0.4, GAINS)
    for _ in range(200):
        way = sidestep.carry(way, 0.2, GAINS, DT)
    assert first > 0.0 and way == pytest.approx(-first)


def test_pace_quickens_with_the_error_up_to_its_most():
    found = [pace.frequency_change(v, 0.0, GAINS) for v in (0.0, 0.1, 0.2, 0.3, 5.0)]
    assert found[0] == found[1] == 0.0 < found[2] < found[3] < found[4] == GAINS.pace_most


def test_pace_tires_of_what_lasts():
    """A velocity that stays, hurried or not, is no push: a fraction 1 / (1 + fatigue) is left."""
    fatigue = 0.0
    for k in range(round(8.0 * GAINS.pace_memory / DT)):
        added = pace.frequency_change(5.0, fatigue, GAINS)
        if k * DT < 0.1:
            assert added > 0.9 * GAINS.pace_most
        fatigue = low_passed(fatigue, added, GAINS.pace_memory, DT)
    assert added == pytest.approx(GAINS.pace_most / (1.0 + GAINS.pace_fatigue), rel=0.01)


def test_pushes_forward_count_less_than_sideways_ones():
    assert pace.velocity_error(0.0, -0.3, GAINS) == pytest.approx(0.3)
    assert pace.velocity_error(0.3, 0.4, GAINS) == pytest.approx(math.hypot(0.7 * 0.3, 0.4))


def test_servos_are_stiff_while_the_error_is_large_and_for_a_while_after():
    errors = np.zeros(round(3.0 / DT))
    errors[100:150] = 1.01 * GAINS.stiffen_from
    errors[150:] = 0.99 * GAINS.stiffen_from
    left, stiff = 0.0, []
    for error in errors:
        left = stiffen.remaining(left, error, GAINS, DT)
        stiff.append(left > 0.0)
    assert np.flatnonzero(stiff).tolist() == list(range(
        100, 150 + round(GAINS.stiffen_hold / DT) - 1))


def test_virtual_stiffness_acts_for_a_limited_time_and_rests_after_it():
    spent, acted = 0.0, []
    for _ in range(round(2.0 * (GAINS.stiffen_longest + GAINS.stiffen_rest) / DT)):
        acting = virtual_stiffness.acts(spent, True, 0.002, GAINS)
        spent = virtual_stiffness.spend(spent, acting, GAINS, DT)
        acted.append(acting)
    edges = np.flatnonzero(np.diff(acted)) + 1
    assert np.diff([0, *edges]) * DT == pytest.approx(
        [GAINS.stiffen_longest, GAINS.stiffen_rest, GAINS.stiffen_longest], abs=1.5 * DT)


def test_virtual_stiffness_does_not_act_on_old_angles():
    for delay, acts in ((0.0, True), (0.0099, True), (0.0101, False), (math.inf, False)):
        assert virtual_stiffness.acts(0.0, True, delay, GAINS) is acts
    assert not virtual_stiffness.acts(0.0, False, 0.0, GAINS)


def test_virtual_targets_give_the_torque_of_stiffer_servos():
    """kp (target - angle) is s kp (wanted - angle), unless a limit holds the target."""
    wanted, measured = np.array([[0.2, -0.1], [0.2, -0.1]]), np.array([[0.1, 0.4], [0.1, 0.4]])
    limits, found = np.array([[-10.0, -0.3], [10.0, 10.0]]), wanted.copy()
    virtual_stiffness.stretch(found, measured, np.array([True, False]), GAINS, limits)
    factor = GAINS.stiffen_distance
    assert 60.0 * (found[0, 0] - 0.1) == pytest.approx(60.0 * factor * (0.2 - 0.1))
    assert found[0, 1] == -0.3 and (found[1] == wanted[1]).all()


def test_feet_that_stumble_are_lifted_higher_and_lower_again_later():
    fraction = 0.0
    assert not clearance.stumbles(True, True, 0.1) and clearance.stumbles(True, True, 0.4)
    assert not clearance.stumbles(True, False, 0.4) and not clearance.stumbles(False, True, 0.4)
    for _ in range(round(2.0 * GAINS.clearance_rise / DT)):
        fraction = clearance.update(fraction, 1, GAINS, DT)
    assert fraction == 1.0
    assert clearance.lift(fraction, 0.5, GAINS) == pytest.approx(GAINS.clearance_most)
    assert clearance.lift(fraction, 0.0, GAINS) == clearance.lift(fraction, 1.0, GAINS) == 0.0
    # An edge may be near where the foot lifts off or lands.
    assert min(clearance.lift(fraction, 0.2, GAINS), clearance.lift(fraction, 0.8, GAINS)) > (
        0.85 * GAINS.clearance_most)
    for _ in range(round(GAINS.clearance_memory / DT)):
        fraction = clearance.update(fraction, 0, GAINS, DT)
    assert fraction == pytest.approx(math.exp(-1.0))


def test_feet_stand_under_the_body_on_a_slope():
    ground = 0.0
    for _ in range(2000):
        ground = low_passed(ground, -0.2, GAINS.slope_filter, DT)
    assert ground == pytest.approx(-0.2, abs=1e-3)
    assert slope.shift(ground, 0.7, GAINS) == pytest.approx(
        -0.7 * GAINS.slope_height * math.tan(0.2), abs=1e-3)
    assert slope.shift(1.5, 0.7, GAINS) == GAINS.slope_most


def test_feet_are_moved_less_uphill_than_downhill():
    up, down = (slope.shift_ahead(ground, 0.0, 0.0, GAINS) for ground in (-0.2, 0.2))
    assert up < 0.0 < down
    assert up / down == pytest.approx(-GAINS.slope_share_up / GAINS.slope_share)
    assert slope.shift_ahead(0.0, 0.0, 0.0, GAINS) == 0.0
    # A walk, three of whose feet stand, has the room.
    assert slope.shift_ahead(-0.2, 1.0, 0.0, GAINS) == pytest.approx(-down)
    assert slope.shift_ahead(-0.2, 1.0, 1.0, GAINS) == pytest.approx(-down)
    # On steps feet move below the centre of mass, halfway while feet are lifted half the way.
    steps = slope.shift_ahead(-0.2, 0.0, 1.0, GAINS)
    assert steps == slope.shift(-0.2, 1.0, GAINS) < up
    assert slope.shift_ahead(-0.2, 0.0, 0.5, GAINS) == pytest.approx((steps + up) / 2.0)


def test_heading_turns_back_by_the_shorter_way():
    found = [heading.yaw_rate(wrapped(wanted - yaw), 0.0, GAINS) for wanted, yaw in
             ((0.0, 0.1), (3.1, -3.1), (0.0, -2.0))]
    assert found == pytest.approx(
        [-0.1 * GAINS.turn, -GAINS.turn * (2 * math.pi - 6.2), GAINS.turn_most])


def test_a_gait_that_turns_by_itself_keeps_no_heading_error():
    """With the law alone, a drift of 0.1 rad/s would leave 0.1 / turn rad."""
    off = integral = 0.0
    for _ in range(round(20.0 / DT)):
        integral = heading.integrate(integral, off, GAINS, DT)
        off -= DT * (0.1 + heading.yaw_rate(off, integral, GAINS))
    assert off == pytest.approx(0.0, abs=2e-3) and integral == pytest.approx(-0.1, abs=2e-3)
    # A push that turns the robot far is no drift.
    assert heading.integrate(0.05, 0.5, GAINS, DT) == 0.05


def test_strides_lengthen_while_speed_is_missing():
    way = 0.0
    for _ in range(100):
        way = speed.integrate(way, 0.1, GAINS, DT)
    assert speed.stride_change(0.1, way, GAINS) == pytest.approx(
        0.1 * GAINS.speed_share + 0.02 * GAINS.speed_rate)
    assert speed.stride_change(9.0, way, GAINS) == GAINS.speed_most
    for _ in range(100):
        way = speed.integrate(way, 1e3, GAINS, DT)
    assert speed.stride_change(0.0, way, GAINS) <= GAINS.speed_most


def reflex(built, contact, swinging, progress, height=-0.3, steps=100, lifted=0.0):
    for _ in range(steps):
        found = reflexes.advance(built, contact, swinging, progress, height, lifted, GAINS, DT)
    return found


def test_reflexes_lift_reach_hold_and_fade():
    assert reflex(np.zeros(5), True, True, 0.4) == pytest.approx(GAINS.lift)
    assert reflex(np.zeros(5), False, True, 0.4) == 0.0
    assert reflex(np.zeros(5), False, False, 0.5, steps=50) == pytest.approx(
        -0.1 * GAINS.reach_rate)
    assert reflex(np.zeros(5), False, False, 0.5, steps=500) == -GAINS.reach_most
    # A lean has taken this foot from its ground: posture's matter, no hole.
    assert reflex(np.zeros(5), False, False, 0.5, lifted=0.02) == 0.0
    stumbled = np.zeros(5)
    reflex(stumbled, True, True, 0.4)
    assert reflex(stumbled, False, True, 0.7, steps=1) > 0.8 * GAINS.lift
    assert reflex(stumbled, False, True, 0.999, steps=1) < 0.01 * GAINS.lift
    landed = np.zeros(5)
    reflex(landed, True, True, 0.8, height=-0.27, steps=1)
    assert reflex(landed, True, True, 0.9, height=-0.30, steps=1) == pytest.approx(0.03)
    assert abs(reflex(landed, True, False, 0.5, steps=1000)) < 1e-6
