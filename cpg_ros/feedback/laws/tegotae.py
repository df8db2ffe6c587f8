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

"""Tegotae: load on a leg holds it in stance, lack of load lets it swing.

Owaki, Kano, Nagasawa, Tero and Ishiguro, "Simple robot suggests physical interlimb communication
is essential for quadruped walking", J. R. Soc. Interface 10 (2013) 20120669: each leg's phase
obeys d phi / dt = omega - sigma N cos phi, sin phi < 0 in stance. Legs with locked phases share
their mean.
"""

import math

from cpg_ros.dynamics.integration.compilation import jit
from cpg_ros.feedback.laws.law import Gain, Law

LAW = Law(
    'tegotae', 'keep a leg that bears load in its stance', False,
    gains={
        'tegotae_gain': Gain(4.0, 40.0, 'rad/s',
                             "largest change of the phase's rate when a leg bears the whole "
                             'weight')})


@jit
def rate(load, swinging, progress, gains):
    """Return the change of a leg's phase rate by its load, rad/s.

    Args:
        load: on the foot, fraction of the weight.
        swinging: whether it should be in the air.
        progress: completed fraction of that swing or stance.
        gains: of the law.

    """
    angle = math.pi * progress if swinging else math.pi * (1.0 + progress)
    return -gains.tegotae_gain * load * math.cos(angle)
