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

"""Placement: step further in the direction in which the body is too fast."""

import math

from cpg_ros.dynamics.integration.compilation import jit
from cpg_ros.feedback.laws.law import Gain, Law, limited, low_passed, StateVariable

LAW = Law(
    'placement', 'put feet down further in the direction in which the body is too fast', True,
    gains={
        'step': Gain(0.16, 1.6, 's',
                     'how much further a foot is put forward per m/s of forward velocity '
                     'error'),
        'step_left': Gain(0.16, 1.6, 's',
                          'how much further a foot is put sideways per m/s of sideways '
                          'velocity error'),
        'step_pitch_rate': Gain(0.02, 0.2, 'm s/rad',
                                'how much further a foot is put forward per rad/s of pitch '
                                'rate error'),
        'step_roll_rate': Gain(0.0, 1.0, 'm s/rad',
                               'how much further a foot is put sideways per rad/s of roll '
                               'rate error'),
        'step_filter': Gain(0.032, 0.32, 's',
                            'time constant with which a foot in swing is moved'),
        'step_stance': Gain(0.32, 3.2, 's',
                            'duration of a stance up to which placement, pace and stiffen count '
                            'velocity errors in proportion to it', low=1e-3),
        'step_most': Gain(0.17, 1.7, 'm', 'the most that placement moves a foot'),
        'step_decay': Gain(3.1, 31.0, '1/s',
                           "rate at which placement's displacement decays in stance"),
        'give': Gain(0.0, 1.0, '',
                     'fraction of the forward velocity error to which feet in stance yield'),
        'give_left': Gain(0.8, 8.0, '',
                          'fraction of the sideways velocity error to which feet in stance yield'),
        # A trot, whose feet in stance all yield at once, would sway for seconds.
        'give_recovering': Gain(1.35, 5.0, '',
                                'factor of give_left while the body recovers from a push, as '
                                'stiffen has it, in gaits whose legs swing one by one')},
    memory={
        'placement_displacement': StateVariable('of each foot [m]', ('legs', 2))})


@jit
def step(velocity, rate, gain, rate_gain, gains):
    """Return how much further to put feet down, m, forward or to the left.

    Args:
        velocity: in that direction beyond the expected one, m/s.
        rate: of pitch or roll beyond the expected one, rad/s.
        gain: of the velocity.
        rate_gain: of the rate.
        gains: of the law.

    """
    return limited(gain * velocity + rate_gain * rate, gains.step_most)


@jit
def in_stance(displacement, yielding, gains, dt):
    """Return the displacement of a foot on the ground, m, which decays and yields at a speed.

    The speed in m/s, dt in s.
    """
    return limited(displacement * math.exp(-gains.step_decay * dt) - dt * yielding,
                   gains.step_most)


@jit
def yielding(vx, vy, recovering, gains):
    """Return the speeds forward and to the left to which feet in stance yield, m/s.

    Args:
        vx: forward velocity beyond the expected one, m/s.
        vy: the same to the left.
        recovering: whether the body recovers from a push in a gait whose legs swing one by one.
        gains: of the law.

    """
    more = gains.give_recovering if recovering else 1.0
    return gains.give * vx, more * gains.give_left * vy


@jit
def advance(displacement, swinging, target, yielded, gains, dt):
    """Advance a foot's displacement forward and to the left, m, shape (2,), in place.

    Args:
        displacement: of the foot.
        swinging: whether it should be in the air.
        target: how much further forward and to the left to put it down, m.
        yielded: speeds to which it yields in stance, m/s, see yielding.
        gains: of the law.
        dt: s.

    """
    for k in range(2):
        displacement[k] = (
            low_passed(displacement[k], target[k], gains.step_filter, dt) if swinging else
            in_stance(displacement[k], yielded[k], gains, dt))
