"""The feet of insects from the angles of their joints: which leg steps when.

The same joint does another thing in another pair of legs: tibiae of fore legs pull while those of
hind legs push. So legs are compared by where their feet are along the body, worked out with the
joints of NeuroMechFly (Lobato-Rios et al. 2022; Wang-Chen et al. 2024): a leg hangs down with all
angles at 0, and turns in thorax and coxa by yaw about x, pitch about y and roll about z, in the
trochanter by pitch and roll, in femur and tibia by pitch; x forward, z up.
"""

from collections.abc import Mapping, Sequence

import numpy as np

from cpg_ros.gaits.leg_names import HEXAPOD, role_of

#: What joints are called there, or as in DeepFly3D, in the order in which they turn a leg.
JOINTS = (('coxayaw', 'thcyaw'), ('coxa', 'coxapitch', 'thcpitch'), ('coxaroll', 'thcroll'),
          ('femur', 'femurpitch', 'ctrpitch'), ('femurroll', 'ctrroll'),
          ('tibia', 'tibiapitch', 'ftipitch'))
AXES = 'xyzyzy'
#: Coxa, femur, and tibia with tarsus of a fruit fly's fore, middle and hind legs, mm; joint after
#: which each begins.
LENGTHS = {'f': (0.40, 0.69, 1.17), 'm': (0.18, 0.78, 1.24), 'h': (0.20, 0.83, 1.39)}
BEGINS = (2, 4, 5)
#: Points of a cycle.
POINTS = 128


def _roles(joints: Sequence[str]) -> list[str]:
    """Return a leg's joints in the order of JOINTS; nothing if one is missing."""
    known = {role_of(name).replace(' ', '').removeprefix('joint'): name for name in joints}
    found = [next((known[one] for one in names if one in known), '') for names in JOINTS]
    return found if all(found) else []


def _turn(axis: str, angle: np.ndarray) -> np.ndarray:
    """Matrices of turns about an axis, shape (n, 3, 3)."""
    i, j = {'x': (1, 2), 'y': (2, 0), 'z': (0, 1)}[axis]
    found = np.tile(np.eye(3), (angle.size, 1, 1))
    found[:, i, i] = found[:, j, j] = np.cos(angle)
    found[:, j, i], found[:, i, j] = np.sin(angle), -np.sin(angle)
    return found


def foot(angles: Sequence[np.ndarray], pair: str) -> np.ndarray:
    """Return where a foot is, from the thorax, mm, shape (n, 3).

    Args:
        angles: rad, of each joint in the order of JOINTS, shape (n,).
        pair: f, m or h.

    """
    turned, place = np.tile(np.eye(3), (angles[0].size, 1, 1)), np.zeros((angles[0].size, 3))
    for k, (axis, angle) in enumerate(zip(AXES, angles, strict=True)):
        turned = turned @ _turn(axis, angle)
        if k in BEGINS:
            place = place - LENGTHS[pair][BEGINS.index(k)] * turned[:, :, 2]
    return place


def foot_phases(legs: Mapping[str, Sequence[str]], c: Mapping[str, np.ndarray]
                ) -> dict[str, float] | None:
    """Find by how much each foot is ahead of the first one on its way along the body.

    Args:
        legs: leg -> its joints.
        c: joint -> Fourier coefficients of its mean cycle, complex, shape (n + 1,).

    Returns:
        Leg -> phase in cycles, [0, 1), by the first harmonic; None if these are not six legs with
        all the joints.

    """
    roles = {leg: _roles(joints) for leg, joints in legs.items()}
    if set(legs) != set(HEXAPOD) or not all(roles.values()):
        return None
    turns = np.exp(2j * np.pi * np.outer(np.arange(POINTS) / POINTS,
                                         np.arange(next(iter(c.values())).size)))
    turns[:, 1:] *= 2.0
    forward = {leg: np.fft.rfft(foot([(turns @ c[name]).real for name in names], leg[1])[:, 0])[1]
               for leg, names in roles.items()}
    first = next(iter(forward.values()))
    return {leg: round(float(np.angle(one / first)) / (2.0 * np.pi) % 1.0, 9) % 1.0
            for leg, one in forward.items()}
