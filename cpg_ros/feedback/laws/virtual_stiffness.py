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

"""Virtual stiffness: targets beyond the wanted angles stiffen servos that take positions only.

A servo turns its joint by kp (target - angle): a target s times as far from the measured angle as
the wanted one makes the gain s kp and keeps the damping. The measured angle is late, which
destabilises this loop, unlike a servo's own. The law therefore does not act where measurements are
too old, and acts for a limited time, after which it rests.
"""

from cpg_ros.dynamics.integration.compilation import jit, jit_entry
from cpg_ros.feedback.laws.law import Gain, Law, StateVariable

LAW = Law(
    'virtual_stiffness', 'make servos that take no gains stiff, while stiffen would, by targets '
    'that go too far', False,
    gains={
        'stiffen_distance': Gain(5.0 / 3.0, 3.0, '',
                                 "factor of a target's distance from the measured angle while "
                                 'servos are to be stiff', low=1.0),
        'stiffen_longest': Gain(1.0, 10.0, 's', 'longest time for which this lasts'),
        'stiffen_rest': Gain(1.0, 10.0, 's', 'time for which it rests after that'),
        'stiffen_delay': Gain(0.01, 0.05, 's',
                              'age of the measured angles above which it does not act')},
    memory={
        'virtual_spent': StateVariable('time for which it has acted; below 0, what is left of its '
                                       'rest [s]')})


@jit
def acts(spent, stiff, delay, gains):
    """Return whether the law acts: whether targets go beyond the wanted angles.

    Args:
        spent: see spend.
        stiff: whether the law stiffen requests stiff servos.
        delay: age of the measured angles, s.
        gains: of the law.

    """
    return stiff and spent >= 0.0 and delay <= gains.stiffen_delay


@jit
def spend(spent, acting, gains, dt):
    """Return the time for which the law has acted, s; if negative, minus the remaining rest.

    Args:
        spent: the same, dt in s earlier.
        acting: see acts.
        gains: of the law.
        dt: s.

    """
    if spent < 0.0:
        return min(spent + dt, 0.0)
    if not acting:
        return max(spent - dt, 0.0)
    return spent + dt if spent + dt < gains.stiffen_longest else -gains.stiffen_rest


@jit_entry
def stretch(targets, measured, acting, gains, limits):
    """Let targets of joints go further than wanted, in place, where the law acts.

    Speed limits do not apply to these targets, as joints are not meant to reach them.

    Args:
        targets: angles within all limits, rad, shape (runs, joints).
        measured: angles, rad, shape (runs, joints) or more.
        acting: whether the law acts, shape (runs,).
        gains: of the law.
        limits: lowest and highest angles, rad, shape (2, joints) or more.

    """
    for run in range(targets.shape[0]):
        if acting[run]:
            for k in range(targets.shape[1]):
                angle = measured[run, k]
                far = angle + gains.stiffen_distance * (targets[run, k] - angle)
                targets[run, k] = min(max(far, limits[0, k]), limits[1, k])
