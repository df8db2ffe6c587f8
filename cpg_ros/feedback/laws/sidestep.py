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

"""Sidestep: feet carry the body sideways in stance, and step back in swing.

The resulting speed depends on how the gait rocks the body, so an integral corrects it. A gait also
drifts sideways when it turns, and on a slope; the same integral acts then.
"""

from cpg_ros.dynamics.integration.compilation import jit
from cpg_ros.feedback.laws.law import Gain, Law, limited, low_passed, StateVariable

#: LEVEL_ANGLE: largest angle of ground that counts as level, rad; FAST_SPEED: forward speed above
#: which a straight run drifts aside, m/s.
LEVEL_ANGLE, FAST_SPEED = 0.05, 1.0

LAW = Law(
    'sidestep', 'follow the sideways speed of cmd_vel', True,
    gains={
        'sidestep_share': Gain(1.1, 11.0, '',
                               'fraction of the commanded sideways motion that feet carry out'),
        'sidestep_most': Gain(0.08, 0.8, 'm', 'the most that a foot is carried sideways'),
        'sidestep_rate': Gain(0.5, 5.0, '1/s',
                              'how fast the sideways speed that feet are asked for is '
                              'corrected by what is missing of it'),
        'sidestep_more': Gain(1.0, 10.0, '',
                              'largest such correction, as a fraction of the commanded sideways '
                              'speed'),
        'sidestep_turning': Gain(0.5, 5.0, 'm',
                                 'and, while a turn is commanded, this times its rad/s'),
        'sidestep_slope': Gain(1.0, 10.0, 'm/s',
                               'and, on a slope, this times the angle of the ground above '
                               f'{LEVEL_ANGLE:g} rad'),
        'sidestep_fast': Gain(0.1, 1.0, '',
                              'and, forward, this times the speed above '
                              f'{FAST_SPEED:g} m/s'),
        'sidestep_filter': Gain(0.5, 5.0, 's', 'time constant of the filter on that turn')},
    memory={
        'sidestep_displacement': StateVariable('of each foot to the left [m]', ('legs',)),
        'sidestep_correction': StateVariable('added to the commanded sideways speed [m/s]'),
        'commanded_turn': StateVariable('low-passed [rad/s]')})


@jit
def landing(target, stance, gains):
    """Return the touchdown target of a foot, m to the left of the gait's own.

    It is half of the distance that the body moves over the foot.

    Args:
        target: speed to the left, m/s.
        stance: duration of the stance, s.
        gains: of the law.

    """
    return limited(0.5 * stance * gains.sidestep_share * target, gains.sidestep_most)


@jit
def carry(displacement, target, gains, dt):
    """Return the displacement to the left of a foot on the ground, m, dt in s later."""
    return limited(displacement - dt * gains.sidestep_share * target, gains.sidestep_most)


@jit
def advance(displacement, swinging, target, stance, gains, dt):
    """Return the displacement of a foot to the left, m, dt in s later.

    Args:
        displacement: present one, m.
        swinging: whether the foot should be in the air.
        target: speed to the left, m/s.
        stance: duration of the stance, s.
        gains: of the law.
        dt: s.

    """
    if swinging:
        return low_passed(displacement, landing(target, stance, gains), gains.step_filter, dt)
    return carry(displacement, target, gains, dt)


@jit
def correct_speed(correction, missing, target, turn, slope, forward, gains, dt):
    """Return the correction of the commanded speed to the left, m/s, dt in s later.

    It is 0 on level ground where neither a speed to the left nor a turn is commanded.

    Args:
        correction: present one, m/s.
        missing: speed to the left, m/s.
        target: commanded speed to the left, m/s.
        turn: commanded yaw rate, low-passed, rad/s.
        slope: angle of the ground, rad.
        forward: commanded speed, m/s.
        gains: of the law.
        dt: s.

    """
    most = (gains.sidestep_more * abs(target) + gains.sidestep_turning * abs(turn)
            + gains.sidestep_slope * max(slope - LEVEL_ANGLE, 0.0)
            + gains.sidestep_fast * max(forward - FAST_SPEED, 0.0))
    return limited(correction + dt * gains.sidestep_rate * missing, most)
