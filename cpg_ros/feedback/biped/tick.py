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

"""One tick of a biped's feedback, compiled: from sensors and the clock to joint torques."""

import math

from cpg_ros.dynamics.integration.compilation import jit, jit_entry
from cpg_ros.feedback.biped import stepping, support
from cpg_ros.feedback.biped.gains import SHIFT, WALK
from cpg_ros.feedback.biped.links import (
    add_torques,
    carry,
    center_velocity,
    gravity_torque,
    place,
    sole_velocity,
)
from cpg_ros.feedback.kinematics import cross, GRAVITY, wrapped

#: MIN_LOAD: least fraction of the load on each foot while standing.
MIN_LOAD = 0.02


@jit
def _sense(links, gains, memory, sensors, dt):
    """Fill pose, velocities and loads from the measurements."""
    laws = memory.laws[0]
    pose, rates, weight = memory.pose, sensors.joint_velocities[0], GRAVITY
    laws.rpy[:] = sensors.rpy[0]
    laws.rpy[0] -= laws.roll_error
    place(links, laws.rpy, sensors.joint_positions[0], pose)
    weight *= pose.carried[0]
    for k in range(3):
        laws.turning[k] = carry(pose.rotations[0], sensors.angular_velocity[0], k)
        laws.center[0, k] = pose.moments[0, k] / pose.carried[0]
    for leg in range(2):
        laws.loads[leg] = max(sensors.foot_forces[0, leg], 0.0) / weight
        sole_velocity(links, pose, leg, laws.turning, rates, laws.soles[leg])
    support.update(pose.rotations[0], sensors.acceleration[0], laws.soles, laws.loads, dt,
                    gains, laws.velocity)
    center_velocity(pose, laws.turning, rates, laws.center[1])
    for k in range(3):
        laws.center[1, k] += laws.velocity[k]


@jit
def _approach(gains, memory, command, dt):
    """Ramp the target velocity and heading; command as of tick."""
    laws = memory.laws[0]
    target, most = laws.wanted, gains.acceleration * dt
    for k in range(2):
        target[k] += min(max(command[k] - target[k], -most), most)
    laws.heading += command[2] * dt


@jit
def _follow_clock(gains, memory, kind):
    """Switch legs between swing and stance by their phases, or earlier by their load."""
    laws = memory.laws[0]
    soles, swing_fraction = memory.pose.soles, stepping.swing_fraction(gains)
    laws.clock[1] = 0.0
    for leg in range(2):
        phase = laws.phases[leg]
        if phase < swing_fraction and not laws.swinging[leg]:
            laws.swinging[leg], laws.landed[leg] = True, False
            for k in range(3):
                laws.lift_off[leg, k] = soles[leg, k] - (
                    soles[1 - leg, k] if kind == stepping.WALKS else 0.0)
        if phase >= swing_fraction and laws.swinging[leg]:
            laws.swinging[leg] = laws.landed[leg] = False
        if (laws.swinging[leg] and not laws.landed[leg]
                and phase > stepping.LATE_SWING * swing_fraction
                and laws.loads[leg] > gains.touchdown):
            laws.landed[leg] = True
            laws.clock[1] = max(laws.clock[1], swing_fraction - phase)
    stepping.load_fractions(laws.phases, laws.landed, gains, laws.fractions)


@jit
def _step(links, gains, memory, xi, axes, rate):
    """Fill the DCM error, the clock's factor and the foothold of a swinging foot."""
    laws = memory.laws[0]
    soles, phases, (c, s) = memory.pose.soles, laws.phases, axes
    stands = 0 if laws.fractions[0] > laws.fractions[1] else 1
    swings = 1 - stands
    x, y = xi[0] - soles[stands, 0], xi[1] - soles[stands, 1]
    target = (laws.wanted[0] + gains.speed_integral * laws.integral, laws.wanted[1])
    dcm_error = stepping.dcm_error(
        (c * x + s * y, c * y - s * x), links.sides[swings],
        stepping.time_in_step(phases[swings], gains), rate, target, gains)
    laws.dcm_error[0], laws.dcm_error[1] = dcm_error
    for leg in range(2):
        if laws.swinging[leg]:
            if leg == stands:
                continue
            laws.clock[0] = stepping.speed_up(dcm_error, gains)
            forward, left = stepping.step(
                dcm_error, links.sides[leg], stepping.time_to_touchdown(phases[leg], gains), rate,
                target, gains)
            laws.target[leg, 0] = c * forward - s * left
            laws.target[leg, 1] = s * forward + c * left
            laws.target[leg, 2] = 0.0


@jit
def _stand(links, gains, memory, xi, axes, rate, shifted):
    """Fill the legs' fractions of the weight, and the DCM error forward."""
    laws = memory.laws[0]
    soles, (c, s) = memory.pose.soles, axes
    first = c * soles[0, 1] - s * soles[0, 0]
    second = c * soles[1, 1] - s * soles[1, 0]
    _, inward, _ = stepping.offsets(0.0, 0.0, rate, gains)
    middle, now = 0.5 * (first + second), -s * xi[0] + c * xi[1]
    goal = middle + shifted * (second - links.sides[1] * inward - middle)
    cop = now + (gains.stand - 1.0) * (now - goal)
    laws.fractions[0] = min(max((cop - second) / (first - second), MIN_LOAD), 1.0 - MIN_LOAD)
    laws.fractions[1] = 1.0 - laws.fractions[0]
    ahead = 0.5 * (c * (soles[0, 0] + soles[1, 0]) + s * (soles[0, 1] + soles[1, 1]))
    laws.dcm_error[0], laws.dcm_error[1] = c * xi[0] + s * xi[1] - ahead, 0.0


@jit
def _fly(links, gains, memory, axes, kind, dt):
    """Fill load fractions, ground and footholds of swinging feet, in a gait with flight."""
    laws = memory.laws[0]
    soles, base, phases, (c, s) = memory.pose.soles, laws.velocity, laws.phases, axes
    center, velocity, fractions = laws.center[0], laws.center[1], laws.fractions
    for leg in range(2):
        fractions[leg] = 1.0 if phases[leg] >= stepping.swing_fraction(gains) else 0.0
    total = fractions[0] + fractions[1]
    if total > 1.5:
        fractions[0] = fractions[1] = 0.5
    if total > 0.5:
        laws.ground = fractions[0] * soles[0, 2] + fractions[1] * soles[1, 2]
    else:
        laws.ground -= dt * base[2]
    laws.dcm_error[:] = 0.0
    laws.clock[0] = 1.0
    speed = c * velocity[0] + s * velocity[1], c * velocity[1] - s * velocity[0]
    target = (laws.wanted[0] + gains.speed_integral * laws.integral, laws.wanted[1])
    for leg in range(2):
        if laws.swinging[leg]:
            for k in range(3):
                laws.lift_off[leg, k] -= dt * base[k]
            remaining = (stepping.swing_fraction(gains) - phases[leg]) / gains.frequency
            ahead, left = stepping.foothold(speed, target, links.sides[leg], remaining,
                                            gains)
            laws.target[leg, 0] = center[0] + c * ahead - s * left
            laws.target[leg, 1] = center[1] + s * ahead + c * left
            laws.target[leg, 2] = laws.lift_off[leg, 2]


@jit
def _level(memory, axes, fractions, aside, step):
    """Update the roll error of the inertial unit.

    Args:
        memory: BipedMemory, changed in place.
        axes: cosine and sine of the heading.
        fractions: of the weight on each foot, shape (2,).
        aside: place of the pressure in the soles, to the left of their middles, m.
        step: time since the last tick, s, and the time constant, s; infinite for no change.

    """
    laws = memory.laws[0]
    center, velocity, soles, (c, s) = laws.center[0], laws.center[1], memory.pose.soles, axes
    left, height = -aside, 0.0
    for leg in range(2):
        x, y = center[0] - soles[leg, 0], center[1] - soles[leg, 1]
        left += fractions[leg] * (c * y - s * x)
        height += fractions[leg] * (center[2] - soles[leg, 2])
    speed = c * velocity[1] - s * velocity[0]
    lean = left / max(height, stepping.MIN_COM_HEIGHT)
    laws.roll_error = support.roll_error(laws.roll_error, lean, speed - laws.left_speed, step)
    laws.left_speed = speed


@jit
def _upward(gains, memory, mass, mode, kind, level):
    """Return the upward force on all legs, N; level of the soles that bear."""
    laws = memory.laws[0]
    center, rise, fractions = laws.center[0, 2], laws.center[1, 2], laws.fractions
    if kind == stepping.WALKS or mode != WALK:
        target = gains.height - laws.crouch
        if mode == SHIFT and kind != stepping.WALKS:
            # The body begins in the middle of a stance.
            target = stepping.course(0.5, kind, gains)[0]
        return support.upward_force(target, center - level, rise, mass, gains)
    if fractions[0] + fractions[1] < 0.5:
        return 0.0
    leads = 0 if fractions[0] >= fractions[1] else 1
    return stepping.upward_force(stepping.stance_fraction(laws.phases[leads], gains), kind,
                               center - laws.ground, rise, mass, gains)


@jit
def _bear(links, gains, memory, sensors, shift, mode, kind):
    """Fill the torques of the stance legs; shift is that of the centre of pressure, m."""
    laws = memory.laws[0]
    pose, fractions = memory.pose, laws.fractions
    first, second = pose.soles[0], pose.soles[1]
    one, other = pose.rotations[links.chains[0, -1]], pose.rotations[links.chains[1, -1]]
    points = ((first[0] + carry(one, shift, 0), first[1] + carry(one, shift, 1),
               first[2] + carry(one, shift, 2)),
              (second[0] + carry(other, shift, 0), second[1] + carry(other, shift, 1),
               second[2] + carry(other, shift, 2)))
    a, b = fractions[0], fractions[1]
    cop = (a * points[0][0] + b * points[1][0], a * points[0][1] + b * points[1][1],
           a * points[0][2] + b * points[1][2])
    up = _upward(gains, memory, pose.carried[0], mode, kind, a * first[2] + b * second[2])
    x, y, z = support.attitude_moment(laws.rpy, laws.turning,
                                     wrapped(laws.heading - laws.rpy[2]),
                                     laws.reaction, gains)
    # Feet that bear little cannot turn the body.
    firm = 1.0 if kind == stepping.WALKS else min(up / (pose.carried[0] * GRAVITY), 1.0)
    moment = (firm * x, firm * y, firm * z)
    force = support.ground_force(laws.center[0], cop, up, moment, gains)
    laws.force[0], laws.force[1], laws.force[2] = force
    for leg in range(2):
        torque, bears = memory.torque[leg], fractions[leg] > 0.0
        damping = gains.stance_damping * (1.0 if bears else stepping.SWING_FACTOR)
        for k in range(torque.size):
            row = links.chains[leg, k]
            torque[k] = (gravity_torque(pose, row)
                         - damping * sensors.joint_velocities[0, row - 1])
        if bears:
            fraction = -fractions[leg]
            add_torques(links, pose, leg, points[leg],
                        (fraction * force[0], fraction * force[1], fraction * force[2]),
                        (0.0, 0.0, fraction * moment[2]), torque)


@jit
def _swing(links, gains, memory, leg, kind):
    """Add the torques of a swinging leg, and its reaction moment on the body, N m."""
    laws = memory.laws[0]
    pose, other, way = memory.pose, 1 - leg, laws.path
    duration = stepping.swing_fraction(gains) / gains.frequency
    fraction = min(max(laws.phases[leg] / stepping.swing_fraction(gains), 0.0), 1.0)
    stepping.path(fraction, duration, laws.lift_off[leg], laws.target[leg], gains, way)
    foot, still, moving = pose.soles[leg], pose.soles[other], laws.soles[leg]
    if kind == stepping.WALKS:
        for k in range(3):
            way[0, k] += still[k]
    base = laws.velocity
    now = (moving[0] + base[0], moving[1] + base[1], moving[2] + base[2])
    strength = stepping.LANDED_FACTOR if laws.landed[leg] else 1.0
    x, y, z = stepping.foot_force(way, foot, now, gains)
    force = (strength * x, strength * y, strength * z)
    x, y, z = stepping.level_moment(pose.rotations[links.chains[leg, -1]], laws.heading,
                                 moving[3:], gains)
    moment = (strength * x, strength * y, strength * z)
    add_torques(links, pose, leg, foot, force, moment, memory.torque[leg])
    center = laws.center[0]
    taken = cross((foot[0] - center[0], foot[1] - center[1], foot[2] - center[2]), force)
    for k in range(3):
        laws.reaction[k] += taken[k] + moment[k]


@jit_entry
def tick(links, gains, memory, sensors, command, mode, step):
    """Fill the memory's torques, and the speed and phase shift of the clock.

    Args:
        links: Links of the robot.
        gains: BipedGains.
        memory: BipedMemory, changed in place; its phases are those of the legs now.
        sensors: SensorData of one run, joints in the order of the links.
        command: velocity forward and left, m/s, and rate of turning, rad/s, shape (3,).
        mode: STAND, SHIFT or WALK.
        step: time since the last tick, s, the fraction of the weight's shift that is done, and
            the kind of gait: WALKS, RUNS or HOPS.

    """
    laws = memory.laws[0]
    dt, shifted, kind = step
    _sense(links, gains, memory, sensors, dt)
    soles, center = memory.pose.soles, laws.center
    rate = stepping.growth_rate(center[0, 2] - min(soles[0, 2], soles[1, 2]))
    xi = (center[0, 0] + center[1, 0] / rate, center[0, 1] + center[1, 1] / rate)
    axes = (math.cos(laws.heading), math.sin(laws.heading))
    if mode == WALK:
        _approach(gains, memory, command, dt)
        _follow_clock(gains, memory, kind)
        if kind == stepping.WALKS:
            _step(links, gains, memory, xi, axes, rate)
        else:
            _fly(links, gains, memory, axes, kind, dt)
        ahead = axes[0] * center[1, 0] + axes[1] * center[1, 1]
        laws.integral = stepping.integrate(laws.integral, laws.wanted[0] - ahead, dt)
        shift = (support.cop_shift(laws.dcm_error, links.half, gains) if kind == stepping.WALKS
                 else (0.0, 0.0))
        _level(memory, axes, laws.fractions, shift[1],
               (dt, support.ROLL_TIME_WALK if kind == stepping.WALKS else math.inf))
    else:
        _level(memory, axes, laws.loads, 0.0,
               (dt, support.ROLL_TIME_STAND if support.show_balance(laws.loads) else math.inf))
        _stand(links, gains, memory, xi, axes, rate,
               shifted if mode == SHIFT and kind != stepping.HOPS else 0.0)
        reach = links.half[0]
        shift = (min(max(gains.stand * laws.dcm_error[0], -reach), reach), 0.0)
        laws.swinging[:] = False
    _bear(links, gains, memory, sensors, (shift[0], shift[1], 0.0), mode, kind)
    laws.reaction[:] = 0.0
    for leg in range(2):
        if laws.swinging[leg]:
            _swing(links, gains, memory, leg, kind)
