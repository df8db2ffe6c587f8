"""The normal form as Liu & Zhang (2024) print it, section 2; erratum 1."""

import cmath

from cpg_ros.dynamics.hopf import HopfPoint
from cpg_ros.dynamics.normal_form import NormalForm


def published_normal_form(point: HopfPoint) -> NormalForm:
    """Return what the printed formulas give at a Hopf point of the delayed network.

    ``D = 1/(8 (-1 + c e))``, ``k1 = 8 D (-a - b - d + c e)``, ``k2 = -8 tau D (-b + c e - d)``
    with e = exp(i omega tau), whatever the mode.
    """
    a, b, c, d, tau = point.network.as_dict().values()
    past = c * cmath.exp(1j * point.omega * tau)
    eight = 1.0 / (-1.0 + past)
    return NormalForm(eight * (-a - b - d + past), -tau * eight * (-b + past - d))
