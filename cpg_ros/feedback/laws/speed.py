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

"""Speed: lengthen the strides of a robot that is too slow."""

from cpg_ros.dynamics.integration.compilation import jit
from cpg_ros.feedback.laws.law import Gain, Law, limited, StateVariable

LAW = Law(
    'speed', 'hold the speed, through the length of the strides', True,
    gains={
        'speed_share': Gain(0.5, 5.0, 's/m',
                            'how much longer strides become per m/s of missing speed'),
        'speed_rate': Gain(0.3, 3.0, '1/m',
                           'how much longer strides become per metre of missing distance'),
        'speed_most': Gain(0.3, 3.0, '',
                           'the most by which speed changes the length of strides'),
        'speed_faster': Gain(0.3, 3.0, '',
                             'the most by which speed makes them faster, relative to their '
                             'frequency, where they cannot be as long as it takes')},
    memory={
        'speed_integral': StateVariable('of the missing forward speed [m]')})


@jit
def stride_change(missing, integral, gains):
    """Return the change of the strides; missing speed in m/s, its integral in m."""
    return limited(gains.speed_share * missing + gains.speed_rate * integral, gains.speed_most)


@jit
def integrate(integral, missing, gains, dt):
    """Return the integral of the missing speed, m, limited to what the law can use."""
    return limited(integral + dt * missing, gains.speed_most / max(gains.speed_rate, 1e-9))
