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

#: KEPT: least fraction of the load on each foot while standing.
KEPT = 0.02


@jit
def _sense(links, gains, memory, sensors, dt):
    """Fill pose, velocities and loads from the measurements."""
    pose, rates, weight = memory.pose, sensors.joint_velocities[0], GRAVITY
    place(links, sensors.rpy[0], sensors.joint_positions[0], pose)
    weight *= pose.carried[0]
    for k in range(3):
        memory.turning[k] = carry(pose.rotations[0], sensors.angular_velocity[0], k)
        memory.center[0, k] = pose.moments[0, k] / pose.carried[0]
    for leg in range(2):
        memory.loads[leg] = max(sensors.foot_forces[0, leg], 0.0) / weight
        sole_velocity(links, pose, leg, memory.turning, rates, memory.soles[leg])
    support.update(pose.rotations[0], sensors.acceleration[0], memory.soles, memory.loads, dt,
                    gains, memory.base)
    center_velocity(pose, memory.turning, rates, memory.center[1])
    for k in range(3):
        memory.center[1, k] += memory.base[k]


@jit
def _approach(gains, memory, command, dt):
    """Approach the wanted velocity and heading; command as of tick."""
    target, most = memory.wanted, gains.acceleration * dt
    for k in range(2):
        target[k] += min(max(command[k] - target[k], -most), most)
    memory.heading[0] += command[2] * dt


@jit
def _follow_clock(gains, memory, kind):
    """Let legs lift off and land by their phases, and early by the load on them."""
    soles, swing_share = memory.pose.soles, stepping.swing_share(gains)
    memory.clock[1] = 0.0
    for leg in range(2):
        phase = memory.phases[leg]
        if phase < swing_share and not memory.swinging[leg]:
            memory.swinging[leg], memory.landed[leg] = True, False
            for k in range(3):
                memory.lift_off[leg, k] = soles[leg, k] - (
                    soles[1 - leg, k] if kind == stepping.WALKS else 0.0)
        if phase >= swing_share and memory.swinging[leg]:
            memory.swinging[leg] = memory.landed[leg] = False
        if (memory.swinging[leg] and not memory.landed[leg]
                and phase > stepping.LATE * swing_share
                and memory.loads[leg] > gains.touchdown):
            memory.landed[leg] = True
            memory.clock[1] = max(memory.clock[1], swing_share - phase)
    stepping.load_shares(memory.phases, memory.landed, gains, memory.fractions)


@jit
def _step(links, gains, memory, xi, axes, rate):
    """Fill the DCM error, the clock's factor and the target of a swinging foot."""
    soles, phases, (c, s) = memory.pose.soles, memory.phases, axes
    stands = 0 if memory.fractions[0] > memory.fractions[1] else 1
    swings = 1 - stands
    x, y = xi[0] - soles[stands, 0], xi[1] - soles[stands, 1]
    target = (memory.wanted[0] + gains.speed_integral * memory.integral[0], memory.wanted[1])
    dcm_error = stepping.dcm_error(
        (c * x + s * y, c * y - s * x), links.sides[swings],
        stepping.time_in_step(phases[swings], gains), rate, target, gains)
    memory.dcm_error[0], memory.dcm_error[1] = dcm_error
    for leg in range(2):
        if memory.swinging[leg]:
            if leg == stands:
                continue
            memory.clock[0] = stepping.speed_up(dcm_error, gains)
            forward, left = stepping.step(
                dcm_error, links.sides[leg], stepping.time_to_touchdown(phases[leg], gains), rate,
                target, gains)
            memory.target[leg, 0] = c * forward - s * left
            memory.target[leg, 1] = s * forward + c * left
            memory.target[leg, 2] = 0.0


@jit
def _stand(links, gains, memory, xi, axes, rate, shifted):
    """Fill the legs' fractions of the weight, and the DCM error forward."""
    soles, (c, s) = memory.pose.soles, axes
    first = c * soles[0, 1] - s * soles[0, 0]
    second = c * soles[1, 1] - s * soles[1, 0]
    _, inward, _ = stepping.offsets(0.0, 0.0, rate, gains)
    middle, now = 0.5 * (first + second), -s * xi[0] + c * xi[1]
    goal = middle + shifted * (second - links.sides[1] * inward - middle)
    cop = now + (gains.stand - 1.0) * (now - goal)
    memory.fractions[0] = min(max((cop - second) / (first - second), KEPT), 1.0 - KEPT)
    memory.fractions[1] = 1.0 - memory.fractions[0]
    ahead = 0.5 * (c * (soles[0, 0] + soles[1, 0]) + s * (soles[0, 1] + soles[1, 1]))
    memory.dcm_error[0], memory.dcm_error[1] = c * xi[0] + s * xi[1] - ahead, 0.0


@jit
def _fly(links, gains, memory, axes, kind, dt):
    """Fill load fractions, ground and targets of feet that swing, in a gait with flight."""
    soles, base, phases, (c, s) = memory.pose.soles, memory.base, memory.phases, axes
    center, velocity, fractions = memory.center[0], memory.center[1], memory.fractions
    for leg in range(2):
        fractions[leg] = 1.0 if phases[leg] >= stepping.swing_share(gains) else 0.0
    total = fractions[0] + fractions[1]
    if total > 1.5:
        fractions[0] = fractions[1] = 0.5
    if total > 0.5:
        memory.ground[0] = fractions[0] * soles[0, 2] + fractions[1] * soles[1, 2]
    else:
        memory.ground[0] -= dt * base[2]
    memory.dcm_error[:] = 0.0
    memory.clock[0] = 1.0
    speed = c * velocity[0] + s * velocity[1], c * velocity[1] - s * velocity[0]
    target = (memory.wanted[0] + gains.speed_integral * memory.integral[0], memory.wanted[1])
    for leg in range(2):
        if memory.swinging[leg]:
            for k in range(3):
                memory.lift_off[leg, k] -= dt * base[k]
            remaining = (stepping.swing_share(gains) - phases[leg]) / gains.frequency
            ahead, left = stepping.foothold(speed, target, links.sides[leg], remaining,
                                            gains)
            memory.target[leg, 0] = center[0] + c * ahead - s * left
            memory.target[leg, 1] = center[1] + s * ahead + c * left
            memory.target[leg, 2] = memory.lift_off[leg, 2]


@jit
def _upward(gains, memory, mass, mode, kind, level):
    """Return the upward force on all legs, N; level of the soles that bear."""
    center, rise, fractions = memory.center[0, 2], memory.center[1, 2], memory.fractions
    if kind == stepping.WALKS or mode != WALK:
        target = gains.height - memory.crouch[0]
        if mode == SHIFT and kind != stepping.WALKS:
            # The body begins in the middle of a stance.
            target = stepping.course(0.5, kind, gains)[0]
        return support.upward_force(target, center - level, rise, mass, gains)
    if fractions[0] + fractions[1] < 0.5:
        return 0.0
    leads = 0 if fractions[0] >= fractions[1] else 1
    return stepping.upward_force(stepping.stance_share(memory.phases[leads], gains), kind,
                               center - memory.ground[0], rise, mass, gains)


@jit
def _bear(links, gains, memory, sensors, shift, mode, kind):
    """Fill the torques of the legs that stand; shift is the centre of pressure's, m."""
    pose, fractions = memory.pose, memory.fractions
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
    x, y, z = support.attitude_moment(sensors.rpy[0], memory.turning,
                                     wrapped(memory.heading[0] - sensors.rpy[0, 2]),
                                     memory.reaction, gains)
    # Feet that bear little cannot turn the body.
    firm = 1.0 if kind == stepping.WALKS else min(up / (pose.carried[0] * GRAVITY), 1.0)
    moment = (firm * x, firm * y, firm * z)
    force = support.ground_force(memory.center[0], cop, up, moment, gains)
    memory.force[0], memory.force[1], memory.force[2] = force
    for leg in range(2):
        torque, bears = memory.torque[leg], fractions[leg] > 0.0
        damping = gains.stance_damping * (1.0 if bears else stepping.SWUNG)
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
    """Add the torques of a leg that swings, and its reaction moment on the body, N m."""
    pose, other, way = memory.pose, 1 - leg, memory.path
    duration = stepping.swing_share(gains) / gains.frequency
    fraction = min(max(memory.phases[leg] / stepping.swing_share(gains), 0.0), 1.0)
    stepping.path(fraction, duration, memory.lift_off[leg], memory.target[leg], gains, way)
    foot, still, moving = pose.soles[leg], pose.soles[other], memory.soles[leg]
    if kind == stepping.WALKS:
        for k in range(3):
            way[0, k] += still[k]
    now = (moving[0] + memory.base[0], moving[1] + memory.base[1], moving[2] + memory.base[2])
    strength = stepping.LANDED if memory.landed[leg] else 1.0
    x, y, z = stepping.foot_force(way, foot, now, gains)
    force = (strength * x, strength * y, strength * z)
    x, y, z = stepping.level_moment(pose.rotations[links.chains[leg, -1]], memory.heading[0],
                                 moving[3:], gains)
    moment = (strength * x, strength * y, strength * z)
    add_torques(links, pose, leg, foot, force, moment, memory.torque[leg])
    center = memory.center[0]
    taken = cross((foot[0] - center[0], foot[1] - center[1], foot[2] - center[2]), force)
    for k in range(3):
        memory.reaction[k] += taken[k] + moment[k]


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
    dt, shifted, kind = step
    _sense(links, gains, memory, sensors, dt)
    soles, center = memory.pose.soles, memory.center
    rate = stepping.growth_rate(center[0, 2] - min(soles[0, 2], soles[1, 2]))
    xi = (center[0, 0] + center[1, 0] / rate, center[0, 1] + center[1, 1] / rate)
    axes = (math.cos(memory.heading[0]), math.sin(memory.heading[0]))
    if mode == WALK:
        _approach(gains, memory, command, dt)
        _follow_clock(gains, memory, kind)
        if kind == stepping.WALKS:
            _step(links, gains, memory, xi, axes, rate)
        else:
            _fly(links, gains, memory, axes, kind, dt)
        ahead = axes[0] * center[1, 0] + axes[1] * center[1, 1]
        memory.integral[0] = stepping.integrate(memory.integral[0], memory.wanted[0] - ahead, dt)
        shift = (support.cop_shift(memory.dcm_error, links.half, gains) if kind == stepping.WALKS
                 else (0.0, 0.0))
    else:
        _stand(links, gains, memory, xi, axes, rate,
               shifted if mode == SHIFT and kind != stepping.HOPS else 0.0)
        reach = links.half[0]
        shift = (min(max(gains.stand * memory.dcm_error[0], -reach), reach), 0.0)
        memory.swinging[:] = False
    _bear(links, gains, memory, sensors, (shift[0], shift[1], 0.0), mode, kind)
    memory.reaction[:] = 0.0
    for leg in range(2):
        if memory.swinging[leg]:
            _swing(links, gains, memory, leg, kind)
