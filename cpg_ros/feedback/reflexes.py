"""Reflexes: over what a foot hits, down to what it misses, and no further where it has landed."""

import numpy as np

from cpg_ros.feedback.gains import Gains

#: Shares of the swing in which a foot may stumble, and from which on it may land early; before,
#: it may still be on its way off the ground.
STUMBLE, EARLY = 0.2, 0.65
#: Share of the stance from which on a foot that has no ground reaches for it.
MISSED = 0.1


class Reflexes:
    """Displacements that reflexes have built up.

    Attributes:
        lift: over an obstacle, m, shape (runs, legs).
        reach: for the ground, m, not negative.
        held: above the plan after an early landing, m.

    """

    def __init__(self, runs: int, legs: int) -> None:
        self.lift, self.reach, self.held = np.zeros((3, runs, legs))
        self._landed = np.zeros((runs, legs), dtype=bool)
        self._height = np.zeros((runs, legs))

    def advance(self, contact: np.ndarray, swinging: np.ndarray, progress: np.ndarray,
                height: np.ndarray, gains: Gains, dt: float) -> np.ndarray:
        """Return how far to draw feet in, m, shape (runs, legs).

        Args:
            contact: whether each foot is on the ground, shape (runs, legs).
            swinging: whether it is meant to be in the air.
            progress: share of that swing, or else of its stance, that is over.
            height: of the foot that is planned, base's frame, m.
            gains: of the law.
            dt: s.

        """
        fade = np.exp(-gains.reflex_rate * dt)
        stumbled = swinging & contact & (progress > STUMBLE) & (progress < EARLY)
        self.lift = np.where(stumbled, np.minimum(self.lift + 10.0 * gains.lift * dt / 0.1,
                                                  gains.lift),
                             np.where(swinging & (progress < EARLY), self.lift, fade * self.lift))
        lost = ~swinging & ~contact & (progress > MISSED)
        self.reach = np.where(lost, np.minimum(self.reach + gains.reach_rate * dt,
                                               gains.reach_most),
                              np.where(swinging, fade * self.reach, self.reach))
        early = swinging & contact & (progress >= EARLY)
        self._height = np.where(self._landed | ~early, self._height, height + self.held)
        self._landed = (self._landed | early) & swinging & (progress >= EARLY)
        self.held = np.where(self._landed, np.clip(self._height - height, 0.0, gains.lift),
                             fade * self.held)
        return self.lift + self.held - self.reach
