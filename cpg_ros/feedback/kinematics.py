"""Legs of a hip that abducts and two joints that pitch: forward, Jacobian, inverse.

Frames are the base's: x forward, y left, z up. A leg of two joints has no way sideways.
"""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Geometry:
    """Lengths and axes of all legs with all joints at 0, and what they carry.

    Attributes:
        columns: index of each leg's hip, thigh and calf among the joints, shape (legs, 3); of a
            leg without a hip joint the first is any, and its turn 0.
        turns: 1 or -1 by the sense of each joint about x, y and y, shape (legs, 3).
        hips: a point on the axis of each hip, m, shape (legs, 3).
        thighs: from there to the thigh joint, m, shape (legs, 3).
        uppers: from thigh to calf joint in their plane as z + i x, m, complex, shape (legs,).
        lowers: from calf joint to the middle of the foot, the same.
        bends: 1 or -1, the side to which each knee is bent, shape (legs,).
        radius: of the feet, which roll, m.
        weight: of the robot, N.

    """

    columns: np.ndarray
    turns: np.ndarray
    hips: np.ndarray
    thighs: np.ndarray
    uppers: np.ndarray
    lowers: np.ndarray
    bends: np.ndarray
    radius: float
    weight: float


def _planar(geometry: Geometry, angles: np.ndarray) -> tuple[np.ndarray, ...]:
    """Return hip angle about x, and upper and lower link in the leg's plane as z + i x."""
    turned = angles[..., geometry.columns] * geometry.turns
    thigh = turned[..., 1]
    return (turned[..., 0], geometry.uppers * np.exp(1j * thigh),
            geometry.lowers * np.exp(1j * (thigh + turned[..., 2])))


def forward(geometry: Geometry, angles: np.ndarray) -> np.ndarray:
    """Return where the feet are, m, shape (..., legs, 3); angles in rad, shape (..., joints)."""
    hip, upper, lower = _planar(geometry, angles)
    leg = upper + lower
    y, z = geometry.thighs[:, 1], geometry.thighs[:, 2] + leg.real
    cosine, sine = np.cos(hip), np.sin(hip)
    return geometry.hips + np.stack([geometry.thighs[:, 0] + leg.imag, y * cosine - z * sine,
                                     y * sine + z * cosine], axis=-1)


def jacobian(geometry: Geometry, angles: np.ndarray) -> np.ndarray:
    """Return the feet's derivatives by hip, thigh and calf, m/rad, shape (..., legs, 3, 3)."""
    hip, upper, lower = _planar(geometry, angles)
    y, z = geometry.thighs[:, 1], geometry.thighs[:, 2] + (upper + lower).real
    cosine, sine = np.cos(hip), np.sin(hip)
    found = np.zeros((*hip.shape, 3, 3))
    found[..., 1, 0] = -y * sine - z * cosine
    found[..., 2, 0] = y * cosine - z * sine
    for joint, link in ((1, upper + lower), (2, lower)):
        # A positive turn about y takes z + i x on by i times itself.
        found[..., 0, joint] = link.real
        found[..., 1, joint] = sine * link.imag
        found[..., 2, joint] = -cosine * link.imag
    found *= geometry.turns[:, None, :]
    return found


def inverse(geometry: Geometry, feet: np.ndarray) -> np.ndarray:
    """Return angles of hip, thigh and calf, rad, shape (..., legs, 3), with the feet there.

    A place out of reach is taken to the nearest on its line to the thigh joint. The feet, in m,
    have shape (..., legs, 3).
    """
    place = feet - geometry.hips
    y, hanging = geometry.thighs[:, 1], geometry.thighs[:, 2]
    abducts = geometry.turns[:, 0] != 0.0
    down = -np.sqrt(np.maximum(place[..., 1]**2 + place[..., 2]**2 - y * y, 1e-6))
    hip = np.where(abducts, np.arctan2(place[..., 2], place[..., 1]) - np.arctan2(down, y), 0.0)
    goal = np.where(abducts, down, place[..., 2]) - hanging + 1j * (
        place[..., 0] - geometry.thighs[:, 0])
    a, b = np.abs(geometry.uppers), np.abs(geometry.lowers)
    cosine = np.clip((np.abs(goal)**2 - a * a - b * b) / (2.0 * a * b), -1.0, 1.0)
    calf = geometry.bends * np.arccos(cosine) - np.angle(geometry.lowers / geometry.uppers)
    thigh = np.angle(goal / (geometry.uppers + geometry.lowers * np.exp(1j * calf)))
    found = np.stack([hip, thigh, calf], axis=-1)
    # Turns are their own inverses; a missing hip stays 0.
    return ((found + np.pi) % (2.0 * np.pi) - np.pi) * geometry.turns


def displace(geometry: Geometry, angles: np.ndarray, feet: np.ndarray, way: np.ndarray
             ) -> np.ndarray:
    """Return angles with the feet moved, rad, shape (..., joints).

    Exactly the angles that came in where the way is 0, and limits are the caller's business.

    Args:
        geometry: of the legs.
        angles: rad, shape (..., joints).
        feet: where these put the feet, m, shape (..., legs, 3).
        way: by which they are to be moved, m, shape (..., legs, 3).

    """
    change = inverse(geometry, feet + way) - inverse(geometry, feet)
    change = (change + np.pi) % (2.0 * np.pi) - np.pi
    change[~np.any(way, axis=-1)] = 0.0
    found = angles.copy()
    for joint in range(3):
        moved = geometry.turns[:, joint] != 0.0
        found[..., geometry.columns[moved, joint]] += change[..., moved, joint]
    return found
