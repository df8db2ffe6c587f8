"""What joints were told, from what they did and how hard they pulled."""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Servo:
    """The controller of a robot's joints: effort = kp (command - position) - kd velocity.

    Attributes:
        kp: N m / rad.
        kd: N m s / rad.

    Raises:
        ValueError: kp is not positive, or kd is negative.

    """

    kp: float
    kd: float = 0.0

    def __post_init__(self) -> None:
        if not 0.0 < self.kp < np.inf:
            raise ValueError(f'kp {self.kp:g} must be positive')
        if not 0.0 <= self.kd < np.inf:
            raise ValueError(f'kd {self.kd:g} must not be negative')

    def command(self, position: np.ndarray, velocity: np.ndarray, effort: np.ndarray
                ) -> np.ndarray:
        """Return the angles that joints were driven to, rad; arguments in rad, rad/s, N m."""
        return position + (effort + self.kd * velocity) / self.kp
