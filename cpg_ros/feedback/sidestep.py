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

"""Sidestep: feet carry the body sideways while they stand, and step back while they swing.

How far they get depends on how the gait rocks the body: what is missing is added up and asked for.
"""

from cpg_ros.integration.jit import jit


@jit
def landing(wanted, stance, gains):
    """Return where a foot is to land, m to the left of where the gait has it.

    Half of the way that the body is to go over the foot.

    Args:
        wanted: speed to the left, m/s.
        stance: how long the foot will stand, s.
        gains: of the law.

    """
    far = 0.5 * stance * gains.sidestep_share * wanted
    return min(max(far, -gains.sidestep_most), gains.sidestep_most)


@jit
def carry(way, wanted, gains, dt):
    """Return how far to the left a foot on the ground is of where the gait has it, m, dt later."""
    way -= dt * gains.sidestep_share * wanted
    return min(max(way, -gains.sidestep_most), gains.sidestep_most)


@jit
def gather(added, missing, wanted, gains, dt):
    """Return what is asked of the feet beyond what is wanted, m/s, dt in s later.

    Nothing where nothing is wanted.

    Args:
        added: so far, m/s.
        missing: speed to the left, m/s.
        wanted: speed to the left, m/s.
        gains: of the law.
        dt: s.

    """
    most = gains.sidestep_more * abs(wanted)
    return min(max(added + dt * gains.sidestep_rate * missing, -most), most)
