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

"""Touchdown reset: a foot that lands begins its stance, whatever the clock says.

Aoi and Tsuchiya, "Locomotion control of a biped robot using nonlinear oscillators", Autonomous
Robots 19 (2005) 219-232, set the phase to that of touchdown. Here legs with locked phases share
the change, and the stride frequency makes it gradually, so that joints do not jump.
"""

from cpg_ros.dynamics.integration.compilation import jit
from cpg_ros.feedback.laws.law import Gain, Law, limited, StateVariable

LAW = Law(
    'touchdown', "begin a leg's stance when its foot lands", False,
    gains={
        'touchdown_gain': Gain(0.5, 5.0, '',
                               "fraction of a landing's phase error that is corrected")},
    memory={
        'phase_correction': StateVariable('still to be made after landings [cycles]')})

#: SETTLING: time constant with which a change of the phase is made, s; MOST: largest relative
#: change of the stride frequency.
SETTLING, MOST = 0.05, 0.5
#: EARLIEST: fraction of the swing before which a contact is an obstacle, not the ground.
EARLIEST = 0.5


@jit
def phase_change(swinging, progress, duty, gains):
    """Return the change of a leg's phase when its foot lands, cycles.

    Args:
        swinging: whether it should be in the air.
        progress: completed fraction of that swing or stance.
        duty: fraction of the stride that it stands.
        gains: of the law.

    """
    if swinging:
        early = (1.0 - progress) * (1.0 - duty)
        return gains.touchdown_gain * early if progress > EARLIEST else 0.0
    late = progress * duty
    return -gains.touchdown_gain * late if progress < 1.0 - EARLIEST else 0.0


@jit
def frequency_change(correction, frequency):
    """Return the relative change of the stride frequency.

    The remaining correction of the phase is in cycles, the frequency in Hz.
    """
    return limited(correction / (SETTLING * frequency), MOST)
