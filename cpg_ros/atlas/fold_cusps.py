# Copyright 2026 cpg_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""Cusps of fold curves: where two folds of a branch meet and none is left.

Along a branch at a fixed first parameter the rate of the second one, its component of the tangent,
is zero at both folds and has an extremum between them. At the cusp that extremum is zero, too. It
is a smooth function of the first parameter, unlike the place of a fold, and is bracketed in it.
"""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

from cpg_ros.atlas.chart import Chart
from cpg_ros.atlas.codimension_two import CodimensionTwo
from cpg_ros.dynamics.arclength import CurvePoint, predict_and_correct, resolve_point
from cpg_ros.dynamics.orbit import NoOrbit
import numpy as np
from scipy.optimize import brentq, minimize_scalar

#: How far along a branch the second fold is looked for, and how far beyond the last fold of a
#: curve its cusp is, in shares of the first parameter's range.
REACHES = tuple(np.geomspace(0.01, 0.5, 16))
BEYOND = (0.00125, 0.005, 0.02)
#: To what the extremum is located along a branch, and the cusp, in shares.
ALONG, EXACT = 1e-7, 1e-13
#: Smaller orbits end in rest, not in a cusp.
SMALLEST = 0.02


def cusp_beyond(chart: Chart, gait: str, fold: CurvePoint, one: float, way: float
                ) -> CodimensionTwo | None:
    """Locate the cusp in which a fold curve ends; None if it ends otherwise.

    Args:
        chart: the plane.
        gait: whose.
        fold: the curve's last fold, along the second axis.
        one: value on the first axis there.
        way: 1 or -1, the direction in which the curve was followed.

    """
    if fold.amplitude < SMALLEST:
        return None
    try:
        reach, sign = _pair(fold)
        middle, _ = _extremum(_rates(fold), reach, sign)
        base = predict_and_correct(fold, middle)
        if base is None or base.amplitude < SMALLEST:
            return None

        def place(value: float) -> CurvePoint:
            curve: Any = base.curve
            moved = replace(curve, network=chart.at(value, base.value))
            found = resolve_point(moved, base.z, base.tangent)
            if found is None:
                raise NoOrbit('the branch is lost')
            return found

        def dip(value: float) -> float:
            return _extremum(_rates(place(value)), reach, sign)[1]

        for share in BEYOND:
            far = one + way * share * chart.size[0]
            if not chart.first.low <= far <= chart.first.high:
                return None
            if dip(far) > 0.0 > dip(one):
                cusp = brentq(dip, *sorted((one, far)), xtol=EXACT * chart.size[0], rtol=1e-15)
                there = place(cusp)
                middle, left = _extremum(_rates(there), reach, sign)
                found = predict_and_correct(there, middle)
                if found is None or abs(left) > 1e-6 or abs(middle) > 0.9 * reach:
                    return None
                return CodimensionTwo('cusp', gait, (float(cusp), found.value), abs(left))
    except (NoOrbit, np.linalg.LinAlgError, ValueError):
        return None
    return None


def _rates(at: CurvePoint) -> Callable[[float], float]:
    def rate(step: float) -> float:
        found = predict_and_correct(at, step)
        if found is None:
            raise NoOrbit('no point')
        return found.rate
    return rate


def _pair(fold: CurvePoint) -> tuple[float, float]:
    """Return how far along the branch another fold is passed, and the sign of the rates beyond.

    Raises:
        NoOrbit: there is none so close.

    """
    rate = _rates(fold)
    for reach in REACHES:
        left, right = rate(-reach), rate(reach)
        if left * right > 0.0:
            return 1.5 * reach, float(np.sign(left))
    raise NoOrbit('no other fold')


def _extremum(rate: Callable[[float], float], reach: float, sign: float) -> tuple[float, float]:
    """Return where the rate, with a sign, is least, and what it is there."""
    found = minimize_scalar(lambda step: sign * rate(step), method='bounded',
                            bounds=(-reach, reach), options={'xatol': ALONG})
    return float(found.x), float(found.fun)
