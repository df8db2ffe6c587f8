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

"""Masses and inertias of URDF files that no body has, made such as one could have.

The inertia I of a body is a sum over its mass: with the second moments S = 1/2 tr(I) 1 - I, which
cannot be negative in any direction, I = tr(S) 1 - S. Its three moments then keep to the triangle
inequality, which MuJoCo demands. What a file gives is taken to the nearest S that can be.
"""

import numpy as np

#: Least second moment in any direction, as a share of their sum.
THINNEST = 1e-3
#: Violations of less than this share of the sum are rounding, which passes without a word.
ROUNDING = 1e-4
#: A body whose radius of gyration is smaller has none, m.
POINT = 1e-4
#: Of a body that has a mass but no extent, and of one without mass, kg/m^3.
DENSITY = 1000.0
#: Mass of a link that is moved by a joint and has none: a share of the robot's, and least, kg.
LEAST, LIGHTEST = 1e-3, 1e-2


def moments(matrix: np.ndarray) -> np.ndarray:
    """Return the second moments of a body with this inertia, kg m^2, shape (3, 3)."""
    return 0.5 * np.trace(matrix) * np.eye(3) - matrix


def possible(matrix: np.ndarray, mass: float) -> tuple[np.ndarray, str]:
    """Return the nearest inertia that a body can have, and what was wrong with this one.

    Args:
        matrix: about the centre of mass, kg m^2, shape (3, 3), symmetric.
        mass: kg, above 0.

    Returns:
        The inertia, and '' where nothing was wrong but rounding.

    """
    sizes, axes = np.linalg.eigh(moments(matrix))
    if not sizes.sum() > mass * POINT**2:
        return ball(mass) * np.eye(3), 'is that of a point'
    held = np.maximum(sizes, THINNEST * sizes.sum())
    if np.array_equal(held, sizes):
        return matrix, ''
    made = np.trace(np.diag(held)) * np.eye(3) - (axes * held) @ axes.T
    broken = sizes[0] < -ROUNDING * sizes.sum()
    return made, 'breaks the triangle inequality (a + b >= c)' if broken else ''


def ball(mass: float) -> float:
    """Return the moment of inertia of a ball of DENSITY, kg m^2."""
    radius = (3.0 * mass / (4.0 * np.pi * DENSITY))**(1.0 / 3.0)
    return 0.4 * mass * radius**2
