"""A gait's efference copy, measured: what its body does on flat ground with nothing fed back."""

from collections.abc import Sequence

import numpy as np

from cpg_ros.feedback.efference_copy import EfferenceCopy, fold
from cpg_ros.simulation.closed_loop import ClosedLoop
from cpg_ros.simulation.scenario import Scenario

#: Length of a run, and what of it says nothing about the gait itself, s.
DURATION, BEGINNING = 10.0, 3.0


def measure_efference(loop: ClosedLoop, speeds: Sequence[float] = (0.1, 0.2, 0.3, 0.4)
                      ) -> EfferenceCopy:
    """Measure what a gait makes the body do at several wanted speeds.

    Args:
        loop: bodies, whose first gait it is.
        speeds: to be asked for, m/s; a gait that cannot be steered has but its own.

    """
    asked = speeds if loop.program.motion.steering is not None else speeds[:1]
    ran = loop.run([Scenario(speed=speed) for speed in asked], DURATION)
    first = round(BEGINNING / loop.timestep)
    tables = []
    for velocity, turning, lean, phase in zip(ran.velocity, ran.turning, ran.lean, ran.phase,
                                              strict=True):
        signals = np.concatenate([velocity[:, :2], turning[:, :2], lean[:, :2]], axis=1)
        tables.append(fold(phase[first:], signals[first:]))
    found = np.array([table[:, 0].mean() for table in tables])
    rising = np.argsort(found)
    return EfferenceCopy(found[rising], np.array(tables)[rising])
