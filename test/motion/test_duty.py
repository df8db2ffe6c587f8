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

"""The duty factor: how much of a stride legs stand, whatever the network does."""

from dataclasses import replace
from functools import cache
import math
from pathlib import Path

from cpg_ros.feedback.gait_tables import Timetable
from cpg_ros.feedback.kinematics import geometry_of
from cpg_ros.motion.pattern import Pattern
from cpg_ros.motion.plan import plan, PlanError
from cpg_ros.motion.readout import Duty, retimed_phase
from cpg_ros.motion.robot import Motion
from cpg_ros.motion.robot_file import read_robot, RobotError
from cpg_ros.networks.registry import find_network
from depth import examples, in_depth
from hypothesis import given
from hypothesis import strategies as st
import numpy as np
import pytest

CONFIG = Path(__file__).parents[2] / 'config'
CASES = [('quadruped', 'delayed', 'walk'), ('quadruped', 'quadruped', 'trot'),
         ('biped', 'biped', 'walk'), ('biped', 'biped', 'run'), ('hexapod', 'delayed6', 'wave')]


@cache
def gait_plan(robot, network, gait, duty=0.0):
    """A gait on legs of one joint more, which is the driving signal itself."""
    known = read_robot(CONFIG / f'{robot}.yaml')
    legs = {}
    for leg, joints in known.legs.items():
        one = replace(joints[0], name=f'{leg}_signal', weights=(1.0,), offset=0.0, lower=-9.0,
                      upper=9.0,
                      velocity=1e3,
                      cell=known.leg_cells[list(known.legs).index(leg)] + 1)
        legs[leg] = (one,)
    order = tuple(joint.name for joints in legs.values() for joint in joints)
    preset = find_network(network).presets()[gait]
    robot = replace(known, legs=legs, order=order, motions={}, geometry=None)
    return plan(robot, gait, preset, preset.network, 1.0, duty=duty)


def falling(pattern, strides=3, ticks=2000):
    """Share of the time in which each joint falls; ticks to a stride, of 1 s."""
    positions = []
    for _ in range(strides * ticks):
        pattern.advance(1.0 / ticks)
        positions.append(pattern.position.copy())
    return (np.diff(positions, axis=0) < 0.0).mean(axis=0)


@examples(100)
@given(st.floats(0.05, 0.95), st.floats(0.3, 0.9), st.floats(-1.0, 1.0), st.floats(-3.0, 3.0))
def test_the_map_takes_stance_to_stance_and_is_smooth(own, asked, begin, phase):
    k = math.tan(0.5 * math.pi * own) / math.tan(0.5 * math.pi * asked)
    one = k, begin + 0.5 * asked, begin + 0.5 * own
    gap = retimed_phase(begin + asked, *one)[0] - begin - own
    assert abs(gap - round(gap)) < 1e-12 and abs(retimed_phase(begin, *one)[0] - begin) < 1e-12
    slope, bend = retimed_phase(phase, *one)[1:]
    h = 1e-6
    after, before = retimed_phase(phase + h, *one), retimed_phase(phase - h, *one)
    rise = (after[0] - before[0] + 0.5) % 1.0 - 0.5
    assert slope > 0.0 and abs(rise / (2.0 * h) - slope) < 1e-5 * (1.0 + slope**3)
    assert abs((after[1] - before[1]) / (2.0 * h) - bend) < 1e-4 * (1.0 + abs(bend) + slope**3)
    # Of halves it is hardly steeper than it has to be.
    half = retimed_phase(phase, 1.0 / math.tan(0.5 * math.pi * asked), 0.0, 0.0)[1]
    assert half < 4.0 / math.pi * 0.5 / min(asked, 1.0 - asked) + 1e-9


@pytest.mark.parametrize('duty', [0.3, 0.75, *in_depth(0.5, 0.62, 0.9)])
@pytest.mark.parametrize('case', CASES, ids=' '.join)
def test_legs_stand_for_as_long_as_was_asked(case, duty):
    one = gait_plan(*case, duty)
    assert np.allclose(one.duty, duty)
    pattern = Pattern(one, ramp=0.01)
    falling(pattern, 1)
    assert np.abs(falling(pattern) - duty).max() < 0.01


@pytest.mark.parametrize('case', CASES, ids=' '.join)
def test_without_being_asked_nothing_changes(case):
    own = gait_plan(*case)
    pattern, other = Pattern(own, ramp=0.01), Pattern(gait_plan(*case, float(own.duty[0])), 0.01)
    for _ in range(300):
        pattern.advance(0.004)
        other.advance(0.004)
    # Legs of one gait may differ; the shares asked for are the first one's.
    if np.ptp(own.duty) == 0.0:
        assert np.array_equal(pattern.position, other.position)
    assert np.abs(falling(pattern) - own.duty).max() < 0.01


@pytest.mark.parametrize('case', CASES, ids=' '.join)
def test_phases_between_legs_stay_and_paths_too(case):
    first, other = gait_plan(*case), gait_plan(*case, 0.75)
    assert np.allclose(first.readout.angles.max(axis=1), other.readout.angles.max(axis=1),
                       atol=1e-3)
    assert np.allclose(first.readout.angles.min(axis=1), other.readout.angles.min(axis=1),
                       atol=1e-3)
    # What begins the stance, the peak, comes when it did.
    assert np.abs(first.readout.angles.argmax(axis=1)
                  - other.readout.angles.argmax(axis=1)).max() <= 1


@examples(6)
@given(st.sampled_from(CASES), st.floats(0.3, 0.9), st.floats(0.3, 0.9),
       st.sampled_from([0.3, 1.0]))
def test_a_change_is_smooth_within_the_gaits_speeds_and_velocities_are_derivatives(
        case, before, after, transition):
    one, two = gait_plan(*case, before), gait_plan(*case, after)
    pattern, dt = Pattern(one, ramp=0.1), 0.0005
    for _ in range(round(0.7 / dt)):
        pattern.advance(dt)
    pattern.apply(two, transition)
    positions, velocities = [], []
    for _ in range(round((transition + 0.6) / dt)):
        pattern.advance(dt)
        positions.append(pattern.position.copy())
        velocities.append(pattern.velocity.copy())
    positions, velocities = np.array(positions), np.array(velocities)
    fastest = np.maximum(one.speed, two.speed)
    assert (np.abs(velocities) <= fastest * 1.02 + 1e-9).all()
    quotient = (positions[2:] - positions[:-2]) / (2.0 * dt)
    assert np.abs(quotient - velocities[1:-1]).max() < 0.02 * fastest.max()
    assert np.abs(np.diff(velocities, axis=0)).max() < 0.15 * fastest.max()
    assert pattern.held == 0 and pattern.faults == 0


def test_what_weights_were_made_for_can_be_said(tmp_path):
    case = CASES[0]
    one = gait_plan(*case)
    preset = find_network('delayed').presets()['walk']
    robot = replace(one.robot, motions={'walk': Motion(duty=0.8, stance=(-0.1, 0.6))})
    made = plan(robot, 'walk', preset, preset.network, 1.0)
    assert np.allclose(made.duty, 0.8)
    by_itself = plan(replace(robot, motions={'walk': Motion(stance=(-0.1, 0.6))}), 'walk', preset,
                     preset.network, 1.0)
    assert np.allclose(by_itself.duty, 0.6)
    assert np.array_equal(by_itself.readout.angles, one.readout.angles)
    # From -0.1 to 0.7 it goes through what it went through from -0.1 to 0.5.
    grid = np.arange(512) / 512
    ahead, behind = (np.interp(np.array([-0.1, 0.3, 0.7]) % 1.0, grid, made.readout.angles[0]),
                     np.interp(np.array([-0.1, 0.2, 0.5]) % 1.0, grid, one.readout.angles[0]))
    assert np.allclose(ahead, behind, atol=1e-3)


@pytest.mark.parametrize('duty', [0.55, 0.684, 0.8])
def test_feet_of_a_tuned_walk_go_back_for_as_long_as_was_asked(duty):
    robot = read_robot(CONFIG / 'unitree_go2.yaml')
    preset = find_network('delayed').presets()['walk']
    walk = plan(robot, 'walk', preset, preset.network, 1.0, duty=duty)
    swinging = Timetable(walk, geometry_of(robot)).swinging
    assert np.abs(1.0 - swinging.mean(axis=0) - duty).max() < 0.01


def test_what_is_no_share_of_a_stride_is_refused(tmp_path):
    for duty in (0.29, 0.91, 1e-3):
        with pytest.raises(PlanError, match=r'is not from 0\.3 to 0\.9'):
            gait_plan(*CASES[0], duty)
    for line, message in (('duty: 0.2', r'gaits\.walk\.duty: 0\.2 is not from 0\.3'),
                          ('stance: [0.1]', 'takes a phase'),
                          ('stance: [0, 1.2]', 'takes a')):
        path = tmp_path / 'robot.yaml'
        text = (CONFIG / 'quadruped.yaml').read_text().partition('\ngaits:')[0]
        path.write_text(f'{text}\ngaits: {{walk: {{{line}}}}}\n')
        with pytest.raises(RobotError, match=message):
            read_robot(path)


def test_a_duty_needs_cells_of_legs():
    one = gait_plan(*CASES[0])
    legs = one.robot.leg_cells
    maps = Duty(one.orbit, legs, np.zeros(4), np.full(4, 0.5), np.full(4, 0.7))
    found = maps.of_cells(np.array([0, 0]), np.array([0, 6]))
    # The second cell of a leg is told what it has at the leg's phase.
    ahead = one.orbit.phases[6] - one.orbit.phases[0]
    assert np.allclose(found[1] - found[0], [0.0, ahead, ahead])
