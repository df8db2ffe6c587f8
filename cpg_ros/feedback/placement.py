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

"""Placement: a body that is too fast steps further in that direction."""

import math

from cpg_ros.feedback.law import Gain, Law, StateVariable
from cpg_ros.integration.jit import jit

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
        'step_most': Gain(0.17, 1.7, 'm', 'the most that placement moves a foot'),
        'step_decay': Gain(3.1, 31.0, '1/s',
                           "rate at which placement's displacement decays in stance"),
        'give': Gain(0.0, 1.0, '',
                     'share of the forward velocity error to which feet in stance yield'),
        'give_left': Gain(0.8, 8.0, '',
                          'share of the sideways velocity error to which feet in stance yield')},
    memory={
        'placement_displacement': StateVariable('of each foot [m]', ('legs', 2))})


@jit
def step(velocity, rate, gain, rate_gain, gains):
    """Return how much further to put feet down, m, forward or to the left.

    Args:
        velocity: in that direction beyond what is expected, m/s.
        rate: of pitch or roll beyond what is expected, rad/s.
        gain: of the first.
        rate_gain: of the second.
        gains: of the law.

    """
    return min(max(gain * velocity + rate_gain * rate, -gains.step_most), gains.step_most)


@jit
def in_swing(displacement, wanted, gains, dt):
    """Return the displacement of a foot in the air, m, dt in s later, on its way to a wanted."""
    return displacement + (1.0 - math.exp(-dt / gains.step_filter)) * (wanted - displacement)


@jit
def in_stance(displacement, yielding, gains, dt):
    """Return the displacement of a foot on the ground, m, which decays and yields at a speed.

    The speed in m/s, dt in s.
    """
    found = displacement * math.exp(-gains.step_decay * dt) - dt * yielding
    return min(max(found, -gains.step_most), gains.step_most)


@jit
def advance(displacement, swinging, step_x, step_y, vx, vy, gains, dt):
    """Advance a foot's displacement forward and to the left, m, shape (2,), in place.

    Args:
        displacement: of the foot.
        swinging: whether it is meant to be in the air.
        step_x: how much further forward to put it down, m.
        step_y: how much further to the left, m.
        vx: forward velocity beyond what is expected, m/s.
        vy: the same to the left.
        gains: of the law.
        dt: s.

    """
    if swinging:
        displacement[0] = in_swing(displacement[0], step_x, gains, dt)
        displacement[1] = in_swing(displacement[1], step_y, gains, dt)
    else:
        displacement[0] = in_stance(displacement[0], gains.give * vx, gains, dt)
        displacement[1] = in_stance(displacement[1], gains.give_left * vy, gains, dt)
