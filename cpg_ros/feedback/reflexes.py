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

"""Reflexes: over what a foot hits, down to what it misses, and no further where it has landed."""

import math

from cpg_ros.integration.jit import jit

#: Shares of the swing in which a foot may stumble, and from which on it may land early; before,
#: it may still be on its way off the ground.
STUMBLE, EARLY = 0.2, 0.65
#: Share of the stance from which on a foot that has no ground reaches for it.
MISSED = 0.1
#: A foot that a lean lifts by more has its ground where it was, m.
LEANS = 0.005
#: Time in which a foot is lifted over what it hits, s.
LIFTING = 0.01
#: What a foot's reflexes have built up: the lift over an obstacle, the reach for the ground and
#: the height held after an early landing, m; the height at which it landed, m; whether it has.
LIFT, REACH, HELD, HEIGHT, LANDED = range(5)


@jit
def advance(built, contact, swinging, progress, height, lifted, gains, dt):
    """Return how far to draw a foot in, m.

    Args:
        built: by its reflexes, shape (5,), changed in place.
        contact: whether the foot is on the ground.
        swinging: whether it is meant to be in the air.
        progress: share of that swing, or else of its stance, that is over.
        height: of the foot that is planned, base's frame, m.
        lifted: by an unexpected lean, m.
        gains: of the law.
        dt: s.

    """
    fade = math.exp(-gains.reflex_rate * dt)
    late = swinging and progress >= EARLY
    if swinging and contact and STUMBLE < progress < EARLY:
        built[LIFT] = min(built[LIFT] + gains.lift * dt / LIFTING, gains.lift)
    elif late:
        # Back to where the gait lands, or the leg were too short for the body's weight.
        built[LIFT] = min(built[LIFT], gains.lift * (1.0 - progress) / (1.0 - EARLY))
    elif not swinging:
        built[LIFT] *= fade
    if not (swinging or contact) and progress > MISSED and lifted < LEANS:
        built[REACH] = min(built[REACH] + gains.reach_rate * dt, gains.reach_most)
    elif swinging:
        built[REACH] *= fade
    if late and contact and not built[LANDED]:
        built[HEIGHT], built[LANDED] = height + max(built[LIFT], built[HELD]), 1.0
    elif not late:
        built[LANDED] = 0.0
    if built[LANDED]:
        built[HELD] = min(max(built[HEIGHT] - height, 0.0), gains.lift)
    else:
        built[HELD] *= fade
    return max(built[LIFT], built[HELD]) - built[REACH]
