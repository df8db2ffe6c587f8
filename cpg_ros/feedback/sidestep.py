"""Sidestep: feet carry the body sideways while they stand, and step back while they swing."""

from cpg_ros.integration.jit import jit


@jit
def landing(wanted, stance, gains):
    """Return where a foot is to land, m to the left of where the gait has it.

    Half of the way that the body is to go over the foot.

    Args:
        wanted: speed to the left, m/s.
        stance: how long the foot will stand, s.
        gains: of the law.

    """
    far = 0.5 * stance * gains.sidestep_share * wanted
    return min(max(far, -gains.sidestep_most), gains.sidestep_most)


@jit
def carry(way, wanted, gains, dt):
    """Return how far to the left a foot on the ground is of where the gait has it, m, dt later."""
    way -= dt * gains.sidestep_share * wanted
    return min(max(way, -gains.sidestep_most), gains.sidestep_most)
