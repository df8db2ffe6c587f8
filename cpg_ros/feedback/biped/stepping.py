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

"""Foot placement by the capture point, timed by the network, and the speed-up of the clock.

The capture point xi = c + v / w (c centre of mass, w = sqrt(g / h)) moves away from the foot that
stands as exp(w t). The clock knows how long it is until the other foot lands, so that foot is put
where xi will be, less the offset that the next step needs (Pratt et al. 2006, Humanoids;
Englsberger et al. 2015, IEEE Trans. Robotics 31:355).
"""

import math

from cpg_ros.dynamics.integration.compilation import jit
from cpg_ros.feedback.kinematics import GRAVITY
from cpg_ros.feedback.laws.law import Gain

# Swing of a foot, its sole level: a path of minimum jerk, lifted as a squared sine.

SWING_GAINS = {
    'lift': Gain(0.084, 0.4, 'm', 'height of a swinging foot'),
    'swing_end': Gain(0.9966, 1.0, '', 'fraction of the swing in which the foot goes its way'),
    'swing_kp': Gain(3580.0, 5e4, 'N/m', 'force on a swinging foot by its place'),
    'swing_kd': Gain(176.0, 2e3, 'N s/m', 'the same by its velocity'),
    'swing_mass': Gain(3.37, 30.0, 'kg', 'the same by the acceleration of its path'),
    'sole_kp': Gain(30.2, 500.0, 'N m/rad', 'moment that keeps the sole level and ahead'),
    'sole_kd': Gain(0.716, 50.0, 'N m s/rad', 'derivative gain of the same'),
    'press': Gain(0.012, 0.1, 'm', 'how far below the ground a path ends')}
#: LANDED_FACTOR: factor of the swing's forces on a foot that has landed early; SWING_FACTOR:
#: factor of the stance's damping on the joints of a leg that bears nothing.
LANDED_FACTOR, SWING_FACTOR = 0.2, 0.2


@jit
def path(fraction, duration, lift_off, target, gains, out):
    """Fill position, velocity and acceleration of a foot on its path, in m and s, rows of out.

    Args:
        fraction: of the swing that is over, 0 to 1.
        duration: of the swing, s.
        lift_off: where it began, m, (3,).
        target: where it is to end, m, (3,).
        gains: BipedGains.
        out: filled.

    """
    quick = gains.swing_end * duration
    s = min(max(fraction / gains.swing_end, 0.0), 1.0)
    way = s * s * s * (10.0 - 15.0 * s + 6.0 * s * s)
    speed = 30.0 * s * s * (1.0 - s) * (1.0 - s) / quick
    rise = (60.0 * s - 180.0 * s * s + 120.0 * s * s * s) / (quick * quick)
    for k in range(2):
        total = target[k] - lift_off[k]
        out[0, k], out[1, k], out[2, k] = lift_off[k] + way * total, speed * total, rise * total
    rate = math.pi / duration
    sine = math.sin(math.pi * fraction)
    out[0, 2] = (lift_off[2] + way * (target[2] - lift_off[2]) + gains.lift * sine * sine
                 - gains.press * fraction * fraction)
    out[1, 2] = gains.lift * rate * math.sin(2.0 * math.pi * fraction)
    out[2, 2] = 2.0 * gains.lift * rate * rate * math.cos(2.0 * math.pi * fraction)


@jit
def foot_force(target, position, velocity, gains):
    """Return the force on a foot that follows its path, N; wanted as path fills it."""
    return (gains.swing_kp * (target[0, 0] - position[0]) + gains.swing_kd * (
                target[1, 0] - velocity[0]) + gains.swing_mass * target[2, 0],
            gains.swing_kp * (target[0, 1] - position[1]) + gains.swing_kd * (
                target[1, 1] - velocity[1]) + gains.swing_mass * target[2, 1],
            gains.swing_kp * (target[0, 2] - position[2]) + gains.swing_kd * (
                target[1, 2] - velocity[2]) + gains.swing_mass * target[2, 2])


@jit
def level_moment(rotation, heading, turning, gains):
    """Return the moment that levels a sole and turns it to the heading, N m.

    Args:
        rotation: of the sole, shape (3, 3).
        heading: rad.
        turning: its angular velocity, rad/s, (3,).
        gains: BipedGains.

    """
    c, s = math.cos(heading), math.sin(heading)
    # Half the sum of the cross products of the present axes and the wanted ones.
    x = 0.5 * (-rotation[2, 0] * s - rotation[2, 1] * c + rotation[1, 2])
    y = 0.5 * (rotation[2, 0] * c - rotation[2, 1] * s - rotation[0, 2])
    z = 0.5 * (rotation[0, 0] * s - rotation[1, 0] * c + rotation[0, 1] * c + rotation[1, 1] * s)
    return (gains.sole_kp * x - gains.sole_kd * turning[0],
            gains.sole_kp * y - gains.sole_kd * turning[1],
            gains.sole_kp * z - gains.sole_kd * turning[2])


# Clock of a biped: from the legs' phases, which leg swings and what fraction of the weight each
# bears.

CLOCK_GAINS = {
    'frequency': Gain(1.65, 4.0, 'Hz', 'strides per second of the undisturbed walk'),
    'duty': Gain(0.511, 0.9, '', 'fraction of the stride that a leg stands, above 0.5', low=0.501),
    'touchdown': Gain(0.09, 1.0, '', "fraction of the robot's weight on a foot above which, late "
                      'in the swing, it has landed: the clock leaps to the stance'),
    'early': Gain(0.3, 1.0, '', 'fraction of the load that a leg takes which has landed early')}
#: LATE_SWING: fraction of the swing before which a load on the foot does not count as a touchdown.
LATE_SWING = 0.6


@jit
def swing_fraction(gains):
    """Return the fraction of the stride that a leg swings."""
    return 1.0 - gains.duty


@jit
def time_in_step(phase, gains):
    """Return the time since the stance foot took over, s, by the phase of the swinging leg."""
    swing = swing_fraction(gains)
    if phase >= swing and phase > 0.5 + 0.5 * swing:
        phase -= 1.0
    time = (phase + 0.5 * (gains.duty - 0.5)) / gains.frequency
    return min(max(time, 0.0), 0.5 / gains.frequency)


@jit
def load_fractions(phases, landed, gains, fractions):
    """Fill the fraction of the weight that each leg is to bear; phases from lift-off, cycles."""
    swing, double = swing_fraction(gains), max(gains.duty - 0.5, 1e-4)
    total = 0.0
    for leg in range(2):
        if phases[leg] < swing:
            fractions[leg] = gains.early if landed[leg] else 0.0
        else:
            ramp = min((phases[leg] - swing) / double, (1.0 - phases[leg]) / double)
            fractions[leg] = min(max(ramp, 0.0), 1.0)
        total += fractions[leg]
    if total < 1e-3:
        fractions[0] = 1.0 if phases[0] >= swing else 0.0
        fractions[1] = 1.0 - fractions[0]
        total = 1.0
    fractions[0] /= total
    fractions[1] /= total


# Gaits with flight, run and hop: the upward force of a stance is half a sine on the clock.

FLIGHT_GAINS = {
    'flight_height': Gain(0.97, 1.2, '', 'height of the centre of mass as feet leave and touch '
                          'the ground in gaits with flight, by height', low=0.5),
    'flight_kp': Gain(7410.0, 5e4, 'N/m', 'proportional gain of the upward force on that height'),
    'flight_kd': Gain(20.0, 5e3, 'N s/m', 'derivative gain of the same'),
    'flight_width': Gain(0.48, 2.0, '', 'width of the steps in gaits with flight, by step_width'),
    'flight_ahead': Gain(0.444, 1.5, '', 'foot offset at touchdown, as a fraction of the '
                         'distance travelled in stance'),
    'flight_x': Gain(0.159, 1.0, 's', 'foot further ahead by what the speed is too high'),
    'flight_y': Gain(0.0512, 1.0, 's', 'the same sideways')}
#: MAX_FORCE: largest upward force, as a multiple of the weight; MAX_REACH: largest distance of a
#: foothold from the centre of mass, forward and sideways, m; MIN_SIDE_DISTANCE: least distance to
#: the leg's side, m.
MAX_FORCE, MAX_REACH, MIN_SIDE_DISTANCE = 3.5, 0.35, 0.045
#: Kinds of gaits. WALKS: legs in turn without flight; RUNS: in turn with flight; HOPS: together.
WALKS, RUNS, HOPS = 0, 1, 2


@jit
def spans(kind, gains):
    """Return the duration of a stance and the time from one stance to the next, s."""
    return gains.duty / gains.frequency, (1.0 if kind == HOPS else 0.5) / gains.frequency


@jit
def course(fraction, kind, gains):
    """Return height over the ground, m, upward speed, m/s, and force by weight in a stance.

    Args:
        fraction: of the stance that is over, 0 to 1.
        kind: RUNS or HOPS.
        gains: BipedGains.

    """
    stance, cycle = spans(kind, gains)
    flight, angle = cycle - stance, math.pi * fraction
    rise = GRAVITY * (0.5 * cycle * (1.0 - math.cos(angle)) - 0.5 * flight - fraction * stance)
    height = gains.height * gains.flight_height + GRAVITY * stance * (
        -0.5 * flight * fraction - 0.5 * fraction * fraction * stance
        + 0.5 * cycle * (fraction - math.sin(angle) / math.pi))
    return height, rise, 0.5 * math.pi * math.sin(angle) * cycle / stance


@jit
def upward_force(fraction, kind, height, rise, mass, gains):
    """Return the upward force of a stance, N; height and upward speed as of course."""
    weight = mass * GRAVITY
    at, speed, force = course(fraction, kind, gains)
    push = math.sin(math.pi * fraction) * (gains.flight_kp * (at - height)
                                        + gains.flight_kd * (speed - rise))
    return min(max(weight * force + push, 0.0), MAX_FORCE * weight)


@jit
def foothold(speed, target, side, remaining, gains):
    """Return the foothold relative to the centre of mass, forward and left, m.

    Args:
        speed: forward and left, m/s.
        target: the same.
        side: of the foot, 1 left and -1 right.
        remaining: time to its touchdown, s.
        gains: BipedGains.

    """
    stance = gains.duty / gains.frequency
    ahead = (speed[0] * (remaining + gains.flight_ahead * stance)
             + gains.flight_x * (speed[0] - target[0]) + gains.place_offset)
    left = (0.5 * side * gains.flight_width * gains.step_width
            + speed[1] * (remaining + 0.5 * stance) + gains.flight_y * (speed[1] - target[1]))
    return (min(max(ahead, -MAX_REACH), MAX_REACH),
            side * min(max(side * left, MIN_SIDE_DISTANCE), MAX_REACH))


@jit
def stance_fraction(phase, gains):
    """Return the fraction of a leg's stance that is over, by its phase from lift-off."""
    return min(max((phase - swing_fraction(gains)) / gains.duty, 0.0), 1.0)


PLACEMENT_GAINS = {
    'step_width': Gain(0.235, 0.6, 'm', 'between the middles of the soles'),
    'place_x': Gain(0.893, 3.0, '', 'step forward by the DCM error at touchdown'),
    'place_y': Gain(0.626, 3.0, '', 'the same sideways'),
    'place_offset': Gain(0.0028, 0.2, 'm', 'added to every step forward'),
    'reach_x': Gain(0.45, 1.0, 'm', 'longest step forward and backward'),
    'reach_y': Gain(0.45, 1.0, 'm', 'widest step'),
    'narrowest': Gain(0.13, 0.5, 'm', 'narrowest step'),
    'speed_integral': Gain(0.92, 3.0, '1/s', 'speed added by the integral of what is missing'),
    'acceleration': Gain(0.5, 3.0, 'm/s^2', 'with which a wanted speed is approached'),
    'speed_up': Gain(4.90, 20.0, '1/m', 'speed-up of the clock by the DCM error'),
    'speed_up_from': Gain(0.047, 0.5, 'm', 'DCM error that does not speed the clock up'),
    'speed_up_most': Gain(0.6, 2.0, '', 'largest speed-up')}
#: MIN_TIME_LEFT: least time to the touchdown, s, for which footholds are computed; MIN_COM_HEIGHT:
#: least height of the centre of mass over the feet, m, for the growth rate of the capture point.
MIN_TIME_LEFT, MIN_COM_HEIGHT = 0.02, 0.3
#: MAX_INTEGRAL: limit of the integral of the missing speed, m; MAX_SPEED_ERROR: limit of the
#: missing speed that it integrates, m/s.
MAX_INTEGRAL, MAX_SPEED_ERROR = 0.4, 1.0


@jit
def growth_rate(height):
    """Return w = sqrt(g / h), 1/s, of a centre of mass at a height in m over the feet."""
    return math.sqrt(GRAVITY / max(height, MIN_COM_HEIGHT))


@jit
def offsets(speed, sideways, rate, gains):
    """Return the capture point relative to a foot that has just landed, forward and outward.

    Args:
        speed: forward, m/s.
        sideways: to the left, m/s.
        rate: see growth_rate.
        gains: BipedGains.

    Returns:
        Forward, m; inward from the foot, m; to the left in addition, m.

    """
    time = 0.5 / gains.frequency
    grown = math.exp(rate * time)
    return (speed * time / (grown - 1.0), gains.step_width / (1.0 + grown),
            sideways * time / (grown - 1.0))


@jit
def dcm_error(xi, side, time, rate, target, gains):
    """Return the DCM error, the offset of the capture point from its target, forward and left, m.

    Args:
        xi: capture point from the foot that stands, heading's axes, m, a pair.
        side: of the foot that swings, 1 left and -1 right.
        time: since the foot that stands took over, s.
        rate: see growth_rate.
        target: speed forward and to the left, m/s.
        gains: BipedGains.

    """
    forward, inward, left = offsets(target[0], target[1], rate, gains)
    grown = math.exp(rate * time)
    return xi[0] - forward * grown, xi[1] - (side * inward + left) * grown


@jit
def step(dcm_error, side, remaining, rate, target, gains):
    """Return the foothold relative to the stance foot, forward and left, m.

    Args:
        dcm_error: forward and left, m.
        side: of the foot that swings, 1 left and -1 right.
        remaining: time to its touchdown, s.
        rate: see growth_rate.
        target: speed forward and to the left, m/s.
        gains: BipedGains.

    """
    time, grown = 0.5 / gains.frequency, math.exp(rate * max(remaining, MIN_TIME_LEFT))
    forward = target[0] * time + gains.place_x * grown * dcm_error[0] + gains.place_offset
    outward = gains.step_width + side * (target[1] * time + gains.place_y * grown * dcm_error[1])
    return (min(max(forward, -gains.reach_x), gains.reach_x),
            side * min(max(outward, gains.narrowest), gains.reach_y))


@jit
def speed_up(dcm_error, gains):
    """Return the factor of the clock by the DCM error, m, a pair."""
    size = math.sqrt(dcm_error[0] * dcm_error[0] + dcm_error[1] * dcm_error[1])
    return 1.0 + min(max(gains.speed_up * (size - gains.speed_up_from), 0.0),
                     gains.speed_up_most)


@jit
def integrate(integral, missing, dt):
    """Return the integral of the missing speed, m, dt in s later."""
    integral += dt * min(max(missing, -MAX_SPEED_ERROR), MAX_SPEED_ERROR)
    return min(max(integral, -MAX_INTEGRAL), MAX_INTEGRAL)


@jit
def time_to_touchdown(phase, gains):
    """Return the time until a swinging leg bears half of the weight, s; phase from lift-off."""
    return ((swing_fraction(gains) - phase) + 0.5 * (gains.duty - 0.5)) / gains.frequency
