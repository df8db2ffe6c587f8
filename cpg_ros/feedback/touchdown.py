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
Robots 19 (2005) 219-232, set the phase to that of touchdown. Here legs whose phases are locked
share the change, and the clock makes up for it in a while: joints do not jump.
"""

from cpg_ros.integration.jit import jit

#: In this time the clock makes up for most of a change, s; by this much it is faster at most.
WHILE, MOST = 0.05, 0.5
#: A foot that lands earlier than this share of its swing has met something else.
EARLIEST = 0.5


@jit
def change(swinging, progress, duty, gains):
    """Return by how much a leg's phase is to be changed when its foot lands, cycles.

    Args:
        swinging: whether it is meant to be in the air.
        progress: share of that swing, or else of its stance, that is over.
        duty: share of the stride that it stands.
        gains: of the law.

    """
    if swinging:
        early = (1.0 - progress) * (1.0 - duty)
        return gains.touchdown_gain * early if progress > EARLIEST else 0.0
    late = progress * duty
    return -gains.touchdown_gain * late if progress < 1.0 - EARLIEST else 0.0


@jit
def hurry(owed, frequency):
    """Return what is added to the clock's factor; what is owed in cycles, the frequency in Hz."""
    return min(max(owed / (WHILE * frequency), -MOST), MOST)
