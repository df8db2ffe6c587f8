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

"""Plan a gait on a robot: compute and check everything before anything moves."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache

from cpg_ros.common.errors import CpgError, InputError, ShortRepr
from cpg_ros.dynamics.integration.stepper import Stepper
from cpg_ros.dynamics.orbit import Orbit
from cpg_ros.dynamics.solve_orbit import coexisting_orbits, solve_preset
from cpg_ros.dynamics.stability import Stability, stability
from cpg_ros.motion.body_file import GAIT_SPEEDS
from cpg_ros.motion.core import CGait
from cpg_ros.motion.phase_readout import joint_readout, PhaseReadout, standing
from cpg_ros.motion.readout import Duty, extremes, NoPhase, WaveReadout
from cpg_ros.motion.robot import Joint, Motion, Robot, SteeringTable
from cpg_ros.networks.network import Network, Preset
from cpg_ros.networks.registry import NETWORKS
import numpy as np

# Obstacles: reasons why the generator cannot run a gait on any robot.

#: MIN_STEPS: fewest steps of a period with which the integrator stays on the orbit.
MIN_STEPS = 40


@dataclass(frozen=True)
class Rejection:
    """Why the generator cannot run a gait.

    Attributes:
        message: predicate for a gait that is named, such as 'has a period of ...'.
        aside: shorter form for a gait that has been named, such as 'its period of ...'.

    """

    message: str
    aside: str


def rejection(orbit: Orbit, assessed: Stability, harmonics: int) -> Rejection | None:
    """Find why the generator cannot run a gait: its period, its stability, or its waveform.

    Args:
        orbit: of the gait.
        assessed: its stability.
        harmonics: number of harmonics of a Morris-Lecar cell's waveform that joints follow.

    """
    shortest = MIN_STEPS * orbit.network.step
    if orbit.period < shortest:
        period = f'period of {orbit.period:.3g} model time units'
        return Rejection(f'has a {period}, too short for steps of {orbit.network.step}: at least '
                        f'{shortest:g} is needed', f'its {period} is below {shortest:g}')
    if assessed.reason:
        verdict = ('may not attract' if assessed.reason.startswith('cannot tell') else
                   'does not attract')
        return Rejection(f'exists at these parameters but {verdict}: {assessed.reason}',
                        f'it {verdict}: {assessed.reason}')
    try:
        joint_readout(orbit, np.empty(0, int), np.empty((0, 6)), np.zeros(1, int), harmonics)
    except NoPhase as error:
        return Rejection(f'at these parameters cannot drive joints: {error}',
                        f'it cannot drive joints: {error}')
    return None


#: REST_FRACTION: fraction of a cell's range below which its change in a stride counts as rest.
REST_FRACTION = 0.05
#: MIN_FREQUENCY: least stride frequency, Hz; slower strides would look like a stand.
MIN_FREQUENCY = 0.01
#: PERIOD_RTOL: relative difference up to which the periods of two solutions are those of one
#: orbit.
PERIOD_RTOL = 1e-6


class PlanError(CpgError):
    """The gait cannot run; the message gives the reason and the figures."""

    exit_code = 1


class OutOfLimits(PlanError):
    """A joint would exceed its limits.

    Attributes:
        message: joint and figure, such as 'knee at 11.46 rad/s, above its limit 10'.
        excess: how far beyond the limit, rad, or as a fraction of a speed limit.
        key: limit as in robot files: lower, upper or velocity.

    """

    def __init__(self, cause: str, message: str, excess: float, key: str) -> None:
        super().__init__(f'{cause} {message}')
        self.message, self.excess, self.key = message, excess, key


@dataclass(frozen=True, eq=False, repr=False)
class GaitPlan(ShortRepr):
    """One gait on one robot, ready to run.

    Attributes:
        name: of the preset or gait.
        robot: legs, joints and limits.
        gait: one of the network's gaits.
        orbit: of the gait.
        stability: whether the gait attracts, and with which symmetry gain.
        gain: of the symmetry lock, 1/model time.
        frequency: strides per second (Hz).
        motion: the robot's settings in this gait.
        shift: of each joint from the stand to the mean of the gait, rad, (joints,).
        readout: from the network's state to joints and legs.
        in_place: the same for strides of length 0.
        span: smallest and largest deviation of each joint from its offset, rad, (2, joints).
        speed: largest speed of each joint, rad/s, shape (joints,).
        duty: fraction of the stride that each leg stands, shape (legs,).
        step: integration step, model time; None for the network's own.

    """

    name: str
    robot: Robot
    gait: str
    orbit: Orbit
    stability: Stability
    gain: float
    frequency: float
    motion: Motion
    shift: np.ndarray
    readout: WaveReadout | PhaseReadout
    in_place: WaveReadout | PhaseReadout
    span: np.ndarray
    speed: np.ndarray
    duty: np.ndarray
    step: float | None = None

    def _summary(self) -> str:
        return (f'{self.name} on {self.robot.name}: {self.frequency:.6g} Hz, symmetry gain '
                f'{self.gain:.6g}, {self.orbit!r}')

    @cached_property
    def seed(self) -> Stepper:
        """Stepper on the orbit at phase 0; copy it, do not advance it."""
        network = self.orbit.network
        return Stepper(network, self.orbit, self.step, gain=self.gain,
                       symmetry=self.orbit.symmetry)

    @cached_property
    def core(self) -> CGait:
        """The gait as the core in C takes it."""
        orbit = self.orbit
        return CGait(**{
            **self.readout.fields(), 'frequency': self.frequency, 'period': orbit.period,
            'start': self.readout.start, 'components': orbit.network.components,
            'least': REST_FRACTION * float(orbit.levels[0, 0, 1]), 'shift': self.shift,
            'speed': self.speed, 'joint_leg': self.robot.leg_of_joint,
            'in_place': self.in_place.joints.weights})

    @property
    def speeds(self) -> tuple[float, float]:
        """Slowest and fastest forward speed that steering allows, m/s."""
        if self.balanced and self.robot.biped is not None:
            return self.robot.biped.speeds(self.gait)
        speed = self._steering.speed
        return speed[0], speed[-1]

    @property
    def balanced(self) -> bool:
        """Whether it is a biped's gait, whose feedback places the feet and so steers it."""
        return self.robot.biped is not None and self.gait in GAIT_SPEEDS

    @cached_property
    def own_speed(self) -> float:
        """Measured forward speed at full strides, m/s, 0 if unknown."""
        steering = self.motion.steering
        if steering is None:
            return 0.0
        # Measured at the gait's own frequency, beyond which only steering goes.
        own = self.motion.frequency or self.frequency
        speed = max((speed for speed, frequency in zip(steering.speed, steering.frequency,
                                                       strict=True) if frequency <= own),
                    default=0.0)
        return speed * self.frequency / own

    def steer(self, speed: float, turn: float) -> tuple[np.ndarray, float]:
        """Return each leg's stride, shape (legs,), and the pace for a wanted motion.

        Args:
            speed: forward, m/s.
            turn: yaw rate, rad/s, positive to the left.

        Raises:
            PlanError: the robot file does not say how to steer this gait.

        """
        if self.balanced:
            return np.ones(len(self.robot.legs)), 1.0
        left, right, frequency = self._steering.ask(speed, turn)
        strides = np.where(self.robot.left, left, right)
        # The table is for the gait's own frequency; a wanted one scales it, as far as joints go.
        return strides, min(frequency / (self.motion.frequency or frequency), self.most_pace)

    def stiffness(self, speed: float) -> float:
        """Return the factor of the servos' proportional gain at a forward speed, m/s."""
        table = self.motion.steering
        return 1.0 if table is None or not table.stiffness else float(
            np.interp(speed, table.speed, table.stiffness))

    @cached_property
    def most_pace(self) -> float:
        """Largest factor of the frequency within the joints' speed limits."""
        return float((self.robot.column('velocity') / np.maximum(self.speed, 1e-9)).min())

    @property
    def _steering(self) -> SteeringTable:
        if self.motion.steering is None:
            raise PlanError(f"robot file '{self.robot.name}' does not say how to steer the gait "
                            f"'{self.name}' (gaits.{self.gait}.steering)")
        return self.motion.steering

    @property
    def character(self) -> str:
        """Walk-like, run-like or neither, see Network.character."""
        return self.orbit.network.character(self.gait, self.robot.assignment)

    @cached_property
    def wave(self) -> tuple[np.ndarray, np.ndarray]:
        """Mean state of the orbit, and rows that span its first harmonic in state space."""
        states = self.orbit(np.arange(64) / 64 * self.orbit.period)
        harmonic = np.fft.fft(states, axis=0)[1] / 64
        _, sizes, rows = np.linalg.svd(np.array([harmonic.real, harmonic.imag]),
                                       full_matrices=False)
        return states.mean(axis=0), rows[sizes > 1e-6 * sizes[0]]


@lru_cache(maxsize=32)
def gait_of(preset: Preset, network: Network) -> tuple[Orbit, Stability]:
    """Solve for a preset's gait at other parameters, and compute its stability.

    Of several orbits, those that attract within the gait's class come first, then the one reached
    by continuation from the preset, then the one with the period nearest to the preset's.

    Raises:
        CpgError: bad parameters, or no such orbit (NoOrbit).

    """
    start = None if preset.start is None else solve_preset(preset)
    orbits = coexisting_orbits(network, preset.gait, start, starts=False, everything=False)
    orbit = orbits.orbits[0]
    assessed = stability(orbit)
    if assessed.reason and orbits.searched:
        count = len(orbits.orbits)
        whole = 'this is the only orbit' if count == 1 else f'none of {count} orbits attracts'
        assessed = replace(assessed, reason=f'{assessed.reason}; {whole}, {orbits.searched}')
    return orbit, assessed


def validate_orbit(orbit: Orbit, gait: str, harmonics: int) -> str:
    """Return why the generator would reject a gait on any robot, or ''.

    Args:
        orbit: of the gait.
        gait: its name.
        harmonics: number of harmonics of a Morris-Lecar cell's waveform that joints follow.

    """
    try:
        reached, assessed = gait_of(orbit.network.presets()[gait], orbit.network)
    except CpgError as error:
        return f'from its preset it is not found: {error}'
    if abs(reached.period / orbit.period - 1.0) > PERIOD_RTOL:
        return (f'its preset leads to another orbit, of period {reached.period:.6g} instead of '
                f'{orbit.period:.6g}')
    reason = rejection(reached, assessed, harmonics)
    return '' if reason is None else reason.aside


def plan(robot: Robot, name: str, preset: Preset, network: Network, frequency: float = 0.0,
         amplitude: float = 1.0, gain: float = -1.0, duty: float = 0.0) -> GaitPlan:
    """Compute a gait on a robot and check it against the robot's limits.

    Args:
        robot: legs, joints and limits.
        name: of the plan, the preset's or gait's.
        preset: the gait, and parameters near which its orbit is known.
        network: parameters.
        frequency: strides per second (Hz); 0 takes one model time unit as a second.
        amplitude: factor of every joint's readout weights.
        gain: of the symmetry lock, 1/model time; a negative value selects one that makes the gait
            attract.
        duty: fraction of the stride that legs stand; 0 for the robot file's, or else the
            network's.

    Raises:
        PlanError: there is no such orbit, it does not attract, or a joint would exceed its limits.

    """
    gait = preset.gait
    if 0.0 < frequency < MIN_FREQUENCY:
        raise PlanError(f'frequency {frequency:g} is neither 0 nor at least {MIN_FREQUENCY:g} Hz')
    if network.longest_delay and not network.step <= network.delay <= network.longest_delay:
        raise PlanError(f'{network.delay_parameter} {network.delay:g} must be from {network.step} '
                        f'to {network.longest_delay:g}')
    try:
        orbit, assessed = gait_of(preset, network)
    except CpgError as error:
        raise PlanError(str(error)) from error
    if (reason := rejection(orbit, assessed, robot.harmonics)) is not None:
        raise PlanError(f'the {gait} {reason.message}')

    motion = robot.motion(name, gait)
    shift = robot.shift(motion)
    stands = _stands(robot, motion, orbit, duty)
    maps = stands.of_cells(robot.leg_of_joint, robot.cells)
    readout, in_place = (joint_readout(
        orbit, robot.cells, amplitude * robot.weights(motion, at_rest), robot.leg_cells,
        robot.harmonics, maps) for at_rest in (False, True))
    strides = frequency if frequency > 0.0 else 1.0 / orbit.period
    swings = [(readout.angles, readout.rises)]
    if motion.steering is not None:
        # Strides from 1 to -1: at one of the ends a joint goes furthest.
        swings.append((2.0 * in_place.angles - readout.angles,
                       2.0 * in_place.rises - readout.rises))
    lows, highs = zip(*(extremes(angles) for angles, _ in swings), strict=True)
    span = shift + np.stack([np.min(lows, axis=0), np.max(highs, axis=0)])
    speed = strides * np.max([np.abs(extremes(rises)) for _, rises in swings], axis=(0, 1))
    beyond = [excess_of for joint, *reach in zip(robot.joints, *span, speed, strict=True)
              for excess_of in _beyond(joint, *reach)]
    excess, key, message = max(beyond, key=lambda excess_of: round(excess_of[0], 9))
    if excess > 1e-9:
        cause = f'amplitude {amplitude:g} takes'
        if key == 'velocity':
            cause = f'frequency {strides:.3g} Hz at amplitude {amplitude:g} moves'
        raise OutOfLimits(cause, message, excess, key)
    gain = assessed.lock_gain if gain < 0.0 else gain
    return GaitPlan(name, robot, gait, orbit, assessed, gain, strides, motion, shift, readout,
                    in_place, span, speed, stands.fractions)


def plan_gait(robot: Robot, name: str, frequency: float | None = None, amplitude: float = 1.0,
              network: str = '') -> GaitPlan:
    """Plan a gait with a preset's parameters, by default on the robot's first network.

    The default frequency is the robot file's. Other arguments and errors as of plan.
    """
    preset = NETWORKS[network or robot.networks[0]].presets()[name]
    if frequency is None:
        frequency = robot.motion(name, preset.gait).frequency or 0.0
    return plan(robot, name, preset, preset.network, frequency, amplitude)


def _stands(robot: Robot, motion: Motion, orbit: Orbit, duty: float) -> Duty:
    """Return the duty factors: the gait's own, and the wanted ones."""
    begin, own = standing(orbit, robot.leg_cells, robot.harmonics)
    if motion.stance is not None:
        begin, own = begin + motion.stance[0], np.full(own.size, motion.stance[1])
    target = duty or motion.duty
    try:
        return Duty(orbit, robot.leg_cells, begin, own,
                    np.full(own.size, target) if target else own)
    except InputError as error:
        raise PlanError(str(error)) from error


def beyond_limits(joint: Joint, low: float, high: float, fastest: float = 0.0) -> list[str]:
    """Return how a joint that moves from low to high, rad, and at up to rad/s exceeds limits."""
    return [message for excess, _, message in _beyond(
        joint, low - joint.offset, high - joint.offset, fastest) if excess > 1e-9]


def _beyond(joint: Joint, low: float, high: float, fastest: float
            ) -> Iterator[tuple[float, str, str]]:
    """Yield the excess, the name and the figure for each limit.

    Args:
        joint: the joint.
        low: smallest deviation from its offset, rad.
        high: largest deviation, rad.
        fastest: largest speed, rad/s.

    """
    low, high = joint.offset + low, joint.offset + high
    for excess, key, figure in (
            (joint.lower - low, 'lower', f'to {low:.3f} rad, below'),
            (high - joint.upper, 'upper', f'to {high:.3f} rad, above'),
            (fastest / joint.velocity - 1.0, 'velocity', f'at {fastest:.2f} rad/s, above')):
        note = ', which is invented' if key in joint.invented else ''
        yield excess, key, f'{joint.name} {figure} its limit {getattr(joint, key):g}{note}'
