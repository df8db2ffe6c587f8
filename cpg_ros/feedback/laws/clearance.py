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

"""Clearance: lift swing feet higher while the ground makes them stumble, as on stairs."""

import math

from cpg_ros.dynamics.integration.compilation import jit
from cpg_ros.feedback.laws.law import Gain, Law, StateVariable

LAW = Law(
    'clearance', 'lift feet higher in swing while they stumble again and again', True,
    gains={
        'clearance_most': Gain(0.08, 0.2, 'm', 'the most by which a foot is lifted in mid-swing'),
        'clearance_rise': Gain(0.01, 0.2, 's',
                               'time for which a foot has to stumble until all are lifted so far'),
        'clearance_memory': Gain(10.0, 100.0, 's', 'time constant with which the lift fades')},
    memory={
        'clearance_share': StateVariable('fraction of the largest lift')})


#: A contact between the fractions FIRST_PHASE and LAST_PHASE of the swing is a stumble. A trot's
#: feet may touch flat ground before FIRST_PHASE. They meet risers later than LANDING_PHASE of
#: reflexes, which holds such a foot where it is.
FIRST_PHASE, LAST_PHASE = 0.3, 0.75


@jit
def stumbles(contact, swinging, progress):
    """Return whether a swinging foot has hit something; the progress is that of the swing."""
    return contact and swinging and FIRST_PHASE < progress < LAST_PHASE


@jit
def update(before, stumbling, gains, dt):
    """Return the fraction of the largest lift, dt in s later.

    Args:
        before: fraction dt earlier.
        stumbling: number of feet that stumble.
        gains: of the law.
        dt: s.

    """
    faded = before * math.exp(-dt / gains.clearance_memory)
    if stumbling == 0.0:
        # This also avoids 0 / 0 for a rise of 0.
        return faded
    return min(faded + stumbling * dt / gains.clearance_rise, 1.0)


@jit
def lift(fraction, progress, gains):
    """Return how far to draw a foot in, m; the progress is the fraction of its swing.

    The foot is high for most of the swing: an edge may be near where it lifts off or lands.
    """
    return fraction * gains.clearance_most * (1.0 - (2.0 * progress - 1.0)**4)
