"""The smooth step by which ramps, cross-fades and approaches go."""

from typing import TypeVar

import numpy as np

Real = TypeVar('Real', float, np.ndarray)


def smoothstep(s: Real) -> tuple[Real, Real]:
    """Smooth step from 0 to 1 and its derivative: 3 s^2 - 2 s^3."""
    return s * s * (3.0 - 2.0 * s), 6.0 * s * (1.0 - s)
