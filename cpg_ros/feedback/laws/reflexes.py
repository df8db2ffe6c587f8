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

"""Reflexes: lift a foot over obstacles, reach for missing ground, stop where it lands early."""

import math

from cpg_ros.dynamics.integration.compilation import jit
from cpg_ros.feedback.laws.law import Gain, Law, StateVariable

LAW = Law(
    'reflexes', 'lift feet over obstacles, and reach for ground that is missing', True,
    gains={
        'lift': Gain(0.06, 0.6, 'm',
                     'how far a foot is lifted when it hits something in swing'),
        'reach_rate': Gain(0.3, 3.0, 'm/s',
                           'speed at which a foot that finds no ground in stance reaches for '
                           'it'),
        'reach_most': Gain(0.05, 0.5, 'm',
                           'the most that a foot without ground reaches for it'),
        'reflex_rate': Gain(8.0, 80.0, '1/s',
                            'rate at which the lift, the reach and the height held after an '
                            'early landing decay')},
    memory={
        'reflex_state': StateVariable('of each leg, see LIFT to LANDED', ('legs', 5))})

#: A contact between the fractions STUMBLE_PHASE and LANDING_PHASE of the swing is a stumble, from
#: LANDING_PHASE on an early landing; before STUMBLE_PHASE the foot may not have left the ground
#: yet.
STUMBLE_PHASE, LANDING_PHASE = 0.2, 0.65
#: REACH_PHASE: fraction of the stance from which on a foot without contact reaches for the ground.
REACH_PHASE = 0.1
#: MAX_LEAN_LIFT: lift of a foot by an unexpected lean, m, above which it does not reach: the lean,
#: not a hole, explains why it has no contact.
MAX_LEAN_LIFT = 0.005
#: LIFT_TIME: time, s, in which a foot is lifted in full over an obstacle that it hits.
LIFT_TIME = 0.01
#: Indices of a foot's state. LIFT: lift over an obstacle, m; REACH: reach for the ground, m;
#: HELD_LIFT: lift held after an early landing, m; LANDING_HEIGHT: height of that landing, m;
#: LANDED: 1 after it.
LIFT, REACH, HELD_LIFT, LANDING_HEIGHT, LANDED = range(5)


@jit
def advance(state, contact, swinging, progress, height, lifted, gains, dt):
    """Return how far to draw a foot in, m.

    Args:
        state: of its reflexes, shape (5,), changed in place.
        contact: whether the foot is on the ground.
        swinging: whether it should be in the air.
        progress: completed fraction of that swing or stance.
        height: planned height of the foot, base's frame, m.
        lifted: by an unexpected lean, m.
        gains: of the law.
        dt: s.

    """
    fade = math.exp(-gains.reflex_rate * dt)
    late = swinging and progress >= LANDING_PHASE
    if swinging and contact and STUMBLE_PHASE < progress < LANDING_PHASE:
        state[LIFT] = min(state[LIFT] + gains.lift * dt / LIFT_TIME, gains.lift)
    elif late:
        # Return to the gait's landing: a leg that is drawn in is too short to bear the body.
        state[LIFT] = min(state[LIFT], gains.lift * (1.0 - progress) / (1.0 - LANDING_PHASE))
    elif not swinging:
        state[LIFT] *= fade
    if not (swinging or contact) and progress > REACH_PHASE and lifted < MAX_LEAN_LIFT:
        state[REACH] = min(state[REACH] + gains.reach_rate * dt, gains.reach_most)
    elif swinging:
        state[REACH] *= fade
    if late and contact and not state[LANDED]:
        state[LANDING_HEIGHT], state[LANDED] = height + max(state[LIFT], state[HELD_LIFT]), 1.0
    elif not late:
        state[LANDED] = 0.0
    if state[LANDED]:
        state[HELD_LIFT] = min(max(state[LANDING_HEIGHT] - height, 0.0), gains.lift)
    else:
        state[HELD_LIFT] *= fade
    return max(state[LIFT], state[HELD_LIFT]) - state[REACH]
