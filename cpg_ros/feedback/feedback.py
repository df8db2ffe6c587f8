"""All laws together: from what is felt to corrected joint angles, strides and pace."""

import math
from collections.abc import Callable

import numpy as np

from cpg_ros.feedback import heading, pace, placement, posture, slope, speed
from cpg_ros.feedback.efference_copy import EfferenceCopy
from cpg_ros.feedback.estimate import BodyState, Senses
from cpg_ros.feedback.gains import Gains
from cpg_ros.feedback.kinematics import Geometry, displace, forward
from cpg_ros.feedback.reflexes import Reflexes
from cpg_ros.feedback.timetable import Timetable
from cpg_ros.motion.pattern import Pattern
from cpg_ros.motion.plan import Program

#: Joints are where they are told to be a little later: corrections come ahead by this, cycles.
LEAD = 0.04


class Feedback:
    """The feedback of one gait, of as many robots as there are runs.

    Attributes:
        estimate: of the base and its contacts.
        timetable: of the gait's steps.
        way: by which each foot is moved now, m, shape (runs, legs, 3).
        stride: to be added to each leg's stride, shape (runs, legs).
        hurry: factor of the stride frequency, shape (runs,).

    """

    def __init__(self, program: Program, geometry: Geometry,
                 expected: EfferenceCopy | None = None, gains: Gains | None = None,
                 runs: int = 1) -> None:
        """Prepare for a gait; without an efference copy nothing but its speed is expected."""
        self.geometry, self.gains = geometry, gains or Gains()
        self.expected = expected or EfferenceCopy.blank()
        self.estimate = BodyState(geometry, runs)
        self.timetable = Timetable(program, geometry)
        self._steering = program.motion.steering
        legs = len(geometry.hips)
        self._sides = (np.where(program.robot.left, -0.5, 0.5)
                       if self._steering is not None else np.zeros(legs))
        self.way = np.zeros((runs, legs, 3))
        self.stride, self.hurry = np.zeros((runs, legs)), np.ones(runs)
        self._stepped = np.zeros((runs, legs, 2))
        self._reflexes = Reflexes(runs, legs)
        self._ground, self._missed = np.zeros((runs, 2)), np.zeros(runs)

    def advance(self, senses: Senses, planned: np.ndarray, phase: np.ndarray, wanted: np.ndarray,
                course: np.ndarray, dt: float, share: float = 1.0) -> np.ndarray:
        """Return the corrected angles, rad, shape (runs, joints), not yet held to any limit.

        Args:
            senses: what is felt.
            planned: the pattern's angles, rad, shape (runs, joints).
            phase: of the first leg, cycles, shape (runs,).
            wanted: speed forward, m/s, shape (runs,).
            course: wanted heading, rad, shape (runs,).
            dt: since the last time, s.
            share: of all corrections, 0 to 1.

        """
        gains, estimate = self.gains, self.estimate
        estimate.update(senses, dt)
        swinging, _ = self.timetable(phase + LEAD)
        feet = forward(self.geometry, planned)
        own = self.expected(phase, wanted)
        velocity = estimate.velocity[:, :2] - own[:, :2]
        turning = estimate.turning[:, :2] - own[:, 2:4]
        lean = estimate.lean[:, :2] - own[:, 4:]

        way = np.zeros_like(self.way)
        self._ground = slope.follow(self._ground, lean, gains, dt)
        if gains.posture:
            way[..., 2] = np.where(swinging,
                                   posture.in_swing(feet, lean - self._ground, gains),
                                   posture.in_stance(feet, lean, turning, gains))
        if gains.placement:
            self._stepped = placement.advance(
                self._stepped, swinging, placement.step(velocity, turning, gains),
                velocity[:, 1], gains, dt)
            way[..., :2] += self._stepped
        if gains.reflexes:
            way[..., 2] += self._reflexes.advance(estimate.contact, *self.timetable(phase),
                                                  feet[..., 2], gains, dt)
        if gains.slope:
            way[..., :2] += slope.shift(self._ground, gains)[:, None]
        self.way += (1.0 - math.exp(-dt / gains.smooth)) * (share * way - self.way)
        self.hurry = 1.0 + share * (pace.hurry(velocity, gains) - 1.0) * gains.pace
        self._steer(-velocity[:, 0], wanted, course, dt, share)
        return displace(self.geometry, planned, feet, self.way)

    def _steer(self, missing: np.ndarray, wanted: np.ndarray, course: np.ndarray, dt: float,
               share: float) -> None:
        steering, gains = self._steering, self.gains
        if steering is None:
            return
        self.stride = np.zeros_like(self.stride)
        if gains.speed:
            self._missed = speed.gather(self._missed, missing, gains, share * dt)
            self.stride += share * speed.longer(missing, self._missed, gains)[:, None]
        if gains.heading:
            rate = np.interp(wanted, steering.speed, steering.turn)
            asked = heading.turn(course, self.estimate.lean[:, 2], gains) / rate
            self.stride += share * asked[:, None] * self._sides


def close(pattern: Pattern, feedback: Feedback, feel: Callable[[], Senses], wanted: float = 0.0,
          course: float = 0.0, dt: float = 0.002) -> None:
    """Let a feedback of one run correct a pattern from now on, at ticks of dt.

    Strides need a pattern with a drive; without one, speed and heading are not closed.

    Args:
        pattern: whose angles are corrected before its limits hold them.
        feedback: of the gait in force.
        feel: asked for the senses at each tick.
        wanted: speed forward, m/s.
        course: wanted heading, rad.
        dt: s.

    """
    speeds, courses = np.array([wanted]), np.array([course])
    steering = pattern.program.motion.steering
    asked = (pattern.program.steer(wanted, 0.0)
             if pattern.drive is not None and steering is not None else None)

    def correct(planned: np.ndarray) -> np.ndarray:
        found = feedback.advance(feel(), planned[None], pattern.phases[:1], speeds, courses, dt,
                                 pattern.level)
        pattern.hurry = float(feedback.hurry[0])
        if asked is not None:
            pattern.steer(np.clip(asked[0] + feedback.stride[0], -1.0, 1.0), asked[1])
        return found[0]

    pattern.correct = correct
