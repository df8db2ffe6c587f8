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

"""Clock of a biped: which leg swings, what share of the weight each bears, by the legs' phases.

The network is a clock here: of its state only the phases of the legs are used, those of the
flexors. A leg swings about its flexor's peak.
"""

from cpg_ros.feedback.law import Gain
from cpg_ros.integration.jit import jit

GAINS = {
    'frequency': Gain(1.65, 4.0, 'Hz', 'strides per second of the undisturbed walk'),
    'duty': Gain(0.511, 0.9, '', 'share of the stride that a leg stands, above 0.5', low=0.501),
    'touchdown': Gain(0.09, 1.0, '', "share of the robot's weight on a swinging foot from which "
                      'on, late in the swing, it has landed: the clock leaps to the stance'),
    'early': Gain(0.3, 1.0, '', 'share of the load that a leg takes which has landed early')}
#: Share of the swing before which nothing counts as a touchdown.
LATE = 0.6


@jit
def swing_share(gains):
    """Return the share of the stride that a leg swings."""
    return 1.0 - gains.duty


@jit
def stride_phase(phase, gains):
    """Return a leg's phase from its lift-off on, cycles, by that of its flexor (peak at 0)."""
    return (phase + 0.5 * swing_share(gains)) % 1.0


@jit
def time_in_step(phase, gains):
    """Return how long ago the other foot took over, s, by the phase of the leg that swings."""
    swing = swing_share(gains)
    if phase >= swing and phase > 0.5 + 0.5 * swing:
        phase -= 1.0
    time = (phase + 0.5 * (gains.duty - 0.5)) / gains.frequency
    return min(max(time, 0.0), 0.5 / gains.frequency)


@jit
def load_shares(phases, landed, gains, shares):
    """Fill the share of the weight that each leg is to bear; phases from lift-off, cycles."""
    swing, double = swing_share(gains), max(gains.duty - 0.5, 1e-4)
    total = 0.0
    for leg in range(2):
        if phases[leg] < swing:
            shares[leg] = gains.early if landed[leg] else 0.0
        else:
            ramp = min((phases[leg] - swing) / double, (1.0 - phases[leg]) / double)
            shares[leg] = min(max(ramp, 0.0), 1.0)
        total += shares[leg]
    if total < 1e-3:
        shares[0] = 1.0 if phases[0] >= swing else 0.0
        shares[1] = 1.0 - shares[0]
        total = 1.0
    shares[0] /= total
    shares[1] /= total
