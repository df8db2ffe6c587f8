"""What the generator is asked to do, worked out and checked before anything moves."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from cpg_ros.dynamics.orbit import Orbit, solve_orbit
from cpg_ros.dynamics.readout import TABLE, TURN, lead_table
from cpg_ros.dynamics.stepper import STEP, Stepper
from cpg_ros.networks.delayed import Delayed, default_symmetry_gain
from cpg_ros.robot import Robot

#: Longest delay the generator's history holds, in model time.
MAX_DELAY = 5.0
#: Strides per second below which a robot would seem to stand (Hz).
SLOWEST = 0.01
#: A period needs this many steps for the integrator to stay on the orbit.
STEPS_A_PERIOD = 40


class Refused(ValueError):
    """The request cannot be run; the message says why, with the figures."""


@dataclass(frozen=True)
class Program:
    """One gait on one robot, ready to run.

    Attributes:
        name: the preset's or gait's name.
        orbit: the gait's orbit.
        gain: symmetry lock in 1/model time.
        frequency: strides per second (Hz).
        weights: readout weights in rad, scaled by the amplitude, shape (joints, 6).
        wave, lead: tables for the readout, shape (TABLE,).
        span: smallest and largest deviation of each joint from its offset, rad, (2, joints).
        speed: largest speed of each joint, rad/s, shape (joints,).

    """

    name: str
    robot: Robot
    orbit: Orbit
    gain: float
    frequency: float
    weights: np.ndarray
    wave: np.ndarray
    lead: np.ndarray
    span: np.ndarray
    speed: np.ndarray

    @cached_property
    def seed(self) -> Stepper:
        """A stepper on the orbit at phase 0; copy it, do not advance it."""
        return Stepper(self.orbit.network, self.orbit, STEP, MAX_DELAY, self.gain,
                       self.orbit.mode)


def attracts(orbit: Orbit, gain: float) -> bool:
    """Tell whether the orbit attracts within its symmetry class: 1 % off it, 12 periods long.

    The symmetry lock sees to every other direction (default_symmetry_gain); against this one
    no gain helps.
    """
    part = orbit.period / 128
    stepper = Stepper(orbit.network, _Scaled(orbit, 1.01), min(part, orbit.network.tau),
                      orbit.network.tau, max(gain, default_symmetry_gain(orbit.network)),
                      orbit.mode)
    stepper.advance(10 * orbit.period)
    # numpy's maximum, because a NaN comes through it.
    highest = np.max([stepper.advance(part)[0, 0] for _ in range(256)])
    return bool(abs(highest / orbit.peak - 1.0) < 0.012)


@dataclass(frozen=True)
class _Scaled:
    """A history in the orbit's class but off it."""

    orbit: Orbit
    factor: float

    def __call__(self, times: np.ndarray) -> np.ndarray:
        return self.factor * self.orbit(times)

    def derivative(self, times: np.ndarray) -> np.ndarray:
        return self.factor * self.orbit.derivative(times)


def _highest(values: np.ndarray) -> np.ndarray:
    """Maximum of each row, a periodic function on TABLE points: the parabola through the top."""
    top = values.argmax(axis=1)
    rows = np.arange(len(values))
    before, here, after = (values[rows, (top + k) % values.shape[1]] for k in (-1, 0, 1))
    bend = 2.0 * here - before - after
    return here + np.divide((after - before)**2, 8.0 * bend, out=np.zeros_like(here),
                            where=bend > 0.0)


def plan(robot: Robot, name: str, gait: str, network: Delayed, frequency: float = 0.0,
         amplitude: float = 1.0, gain: float = -1.0) -> Program:
    """Work out a gait on a robot and check it against the robot's limits.

    Args:
        robot: legs, joints and limits.
        name: what to call it, the preset's name or the gait's.
        gait: one of the six primary gaits.
        network: parameters.
        frequency: strides per second (Hz); 0 takes one model time unit as a second.
        amplitude: factor on every joint's readout weights.
        gain: symmetry lock in 1/model time; negative chooses default_symmetry_gain.

    Raises:
        Refused: there is no such orbit, it does not attract, or a joint would leave its limits.

    """
    if 0.0 < frequency < SLOWEST:
        raise Refused(f'frequency {frequency:g} is neither 0 nor at least {SLOWEST:g} Hz')
    if not STEP <= network.tau <= MAX_DELAY:
        raise Refused(f'tau {network.tau:g} must be from {STEP} to {MAX_DELAY:g}')
    try:
        orbit = solve_orbit(network, gait)
    except ValueError as error:
        raise Refused(str(error)) from error
    if orbit.period < STEPS_A_PERIOD * STEP:
        raise Refused(f'the {gait} has a period of {orbit.period:.3g} model time units, too short '
                      f'for steps of {STEP}: at least {STEPS_A_PERIOD * STEP:g} is needed')
    gain = default_symmetry_gain(network) if gain < 0.0 else gain
    if not attracts(orbit, gain):
        raise Refused(f'the {gait} exists at tau {network.tau:g} but does not attract: the '
                      'network leaves it within its own symmetry class')

    theta = np.arange(TABLE) / TABLE
    x = orbit.waveform(theta) / orbit.peak
    y = orbit.waveform(theta, 1) / (TURN * orbit.peak)
    z = orbit.waveform(theta, 2) / (TURN**2 * orbit.peak)
    try:
        lead = lead_table(x, y)
    except ValueError as error:
        raise Refused(f'the {gait} at tau {network.tau:g} cannot drive joints: {error}') from error
    weights = amplitude * robot.weights
    monomials = np.stack([x, y, x * x, x * y, x**3, x * x * y])
    slopes = TURN * np.stack([y, z, 2 * x * y, y * y + x * z, 3 * x * x * y,
                              2 * x * y * y + x * x * z])
    angle = weights @ monomials
    strides = frequency if frequency > 0.0 else 1.0 / orbit.period
    rise = weights @ slopes
    span = np.stack([-_highest(-angle), _highest(angle)])
    speed = strides * np.maximum(_highest(rise), _highest(-rise))
    for joint, low, high, fastest in zip(robot.joints, *span, speed, strict=True):
        if joint.offset + low < joint.lower - 1e-9:
            raise Refused(f'amplitude {amplitude:g} takes {joint.name} to '
                          f'{joint.offset + low:.3f} rad, below its limit {joint.lower:g}')
        if joint.offset + high > joint.upper + 1e-9:
            raise Refused(f'amplitude {amplitude:g} takes {joint.name} to '
                          f'{joint.offset + high:.3f} rad, above its limit {joint.upper:g}')
        if fastest > joint.velocity:
            raise Refused(f'frequency {strides:.3g} Hz at amplitude {amplitude:g} moves '
                          f'{joint.name} at {fastest:.2f} rad/s, above its limit '
                          f'{joint.velocity:g}')
    return Program(name, robot, orbit, gain, strides, weights, x, lead, span, speed)
