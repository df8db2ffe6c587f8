"""The readout of a network's joints: of the waveform or of the phase, as the network states."""

import numpy as np

from cpg_ros.dynamics.periodic import Orbit
from cpg_ros.motion.duty import stance
from cpg_ros.motion.phase_readout import PhaseReadout, evaluate, phase_map
from cpg_ros.motion.readout import WaveReadout

#: Phases at which troughs are looked for, cycles.
GRID = np.arange(1024) / 1024


def joint_readout(orbit: Orbit, cells: np.ndarray, weights: np.ndarray, leg_cells: np.ndarray,
                  harmonics: int, maps: np.ndarray | None = None) -> WaveReadout | PhaseReadout:
    """Return what reads joints and legs off the states of a gait.

    Args:
        orbit: the gait.
        cells: the cell behind each joint, from 0, shape (joints,).
        weights: in rad, shape (joints, 6).
        leg_cells: the cell that gives each leg's phase, from 0, shape (legs,).
        harmonics: of a waveform that joints follow by its phase.
        maps: what the duty factor makes of the phase of each joint's cell, shape (joints, 3).

    Raises:
        NoPhase: a waveform does not tell the phase.

    """
    if orbit.network.readout == 'waveform':
        return WaveReadout(orbit, cells, weights, leg_cells, maps)
    return PhaseReadout(orbit, cells, weights, leg_cells, harmonics, maps)


def standing(orbit: Orbit, leg_cells: np.ndarray, harmonics: int
             ) -> tuple[np.ndarray, np.ndarray]:
    """Return when each leg begins to stand by itself, and for which share of the stride.

    A leg stands while the signal of its cell falls. Phases are those of the cell, cycles; two
    arrays of shape (legs,).
    """
    begin, share = np.empty((2, len(leg_cells)))
    for leg, cell in enumerate(leg_cells):
        if orbit.network.readout == 'waveform':
            begin[leg], share[leg] = 0.0, stance(orbit.waveform(GRID), 0.0)
            continue
        known, wave = phase_map(orbit, harmonics), orbit.waves[cell]
        begin[leg] = known.crests[wave]
        share[leg] = stance(evaluate(known.terms[wave], GRID), float(begin[leg]))
    return begin, share
