"""The way to angles that joints are not at yet, or that are in motion already."""

import numpy as np

#: Angles this close are followed at once, rad.
NEAR = 0.05


class Approach:
    """Leads the joints from where they stand to what is commanded, in a smooth step.

    So a driver does that is switched on under a running controller: nothing jerks, and a gait
    that is in full swing grows out of the stand. What begins where the joints are, as a
    generator that ramps in from the stand, is followed from the first instant on.
    """

    def __init__(self, periods: int, angles: np.ndarray) -> None:
        """Be ready at the angles where the joints are.

        Args:
            periods: calls of ``towards`` that the approach takes, at least one.
            angles: rad, shape (joints,).

        """
        self._periods = periods
        self._target = np.empty(len(angles))
        self.begin(angles)

    def begin(self, angles: np.ndarray) -> None:
        """Be at these angles, rad; the next ones that differ are approached."""
        self._start = np.array(angles, dtype=float)
        self._done = 0

    def towards(self, commanded: np.ndarray) -> np.ndarray:
        """Return what the joints should be driven to in this period, rad, shape (joints,)."""
        if self._done == self._periods:
            return commanded
        way = np.subtract(commanded, self._start, out=self._target)
        if not self._done:
            if not way.any():
                return commanded
            if np.abs(way).max() <= NEAR:
                self._done = self._periods
                return commanded
        self._done += 1
        s = self._done / self._periods
        way *= s * s * (3.0 - 2.0 * s)
        way += self._start
        return way
