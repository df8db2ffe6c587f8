"""A gait's efference copy, measured: what its body does on flat ground with nothing fed back."""

from collections.abc import Sequence

import numpy as np

from cpg_ros.feedback.efference_copy import EfferenceCopy, fold
from cpg_ros.simulation.closed_loop import ClosedLoop, Scenario

#: Length of a run, and what of it says nothing about the gait itself, s.
DURATION, BEGINNING = 10.0, 3.0


def measure_efference(loop: ClosedLoop, speeds: Sequence[float] = (0.1, 0.2, 0.3, 0.4)
                      ) -> EfferenceCopy:
    """Measure what a gait makes the body do at several wanted speeds.

    Args:
        loop: bodies.
        speeds: to be asked for, m/s; a gait that cannot be steered has but its own.

    """
    asked = speeds if loop.program.motion.steering is not None else speeds[:1]
    first = round(BEGINNING / loop.timestep)
    found, tables = [], []
    for speed in asked:
        ran = loop.run([Scenario()], DURATION, speed)
        signals = np.concatenate([ran.velocity[0, first:, :2], ran.turning[0, first:, :2],
                                  ran.lean[0, first:, :2]], axis=1)
        table = fold(ran.phase[0, first:], signals)
        tables.append(table)
        found.append(float(table[:, 0].mean()))
    rising = np.argsort(found)
    return EfferenceCopy(np.array(found)[rising], np.array(tables)[rising])
