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

"""Meshes that MuJoCo cannot read: why, and the convex hulls that take their place.

MuJoCo reads binary STL, OBJ and MSH. Bodies collide as convex hulls, so that of other files the
points are enough for a shape to collide; for pictures they are not.
"""

from pathlib import Path

from cpg_ros.robots.mesh_files import MeshError, read_mesh
import numpy as np

#: What each dimension of a mesh must exceed to have a hull, m.
FLAT = 1e-6


def trouble(path: Path) -> str:
    """Say why MuJoCo cannot read a mesh, '' if it can."""
    if path.suffix.lower() not in ('.stl', '.obj', '.msh'):
        return f'MuJoCo does not read {path.suffix or "files without an ending"}'
    import mujoco
    spec = mujoco.MjSpec()
    spec.add_mesh(name='mesh', file=str(path.resolve()),
                  inertia=mujoco.mjtMeshInertia.mjMESH_INERTIA_CONVEX)
    spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_MESH, meshname='mesh')
    try:
        spec.compile()
    except ValueError as error:
        return str(error).splitlines()[0].removeprefix('Error: ')
    return ''


def hull(path: Path) -> bytes:
    """Return the convex hull of a mesh as OBJ, m.

    Raises:
        MeshError: the file cannot be read, or its points are in a plane.

    """
    from scipy.spatial import ConvexHull, QhullError
    points = read_mesh(path).points
    if len(points) < 4 or np.ptp(points, axis=0).min() < FLAT:
        raise MeshError(f'{path}: {len(points)} points that enclose no volume')
    try:
        found = ConvexHull(points)
    except QhullError as error:
        raise MeshError(f'{path}: its points enclose no volume') from error
    corners = points[found.vertices]
    place = {int(vertex): k + 1 for k, vertex in enumerate(found.vertices)}
    outward = found.equations[:, :3]
    lines = [f'v {x:.9g} {y:.9g} {z:.9g}' for x, y, z in corners]
    for (a, b, c), normal in zip(found.simplices, outward, strict=True):
        if np.cross(points[b] - points[a], points[c] - points[a]) @ normal < 0.0:
            b, c = c, b
        lines.append(f'f {place[int(a)]} {place[int(b)]} {place[int(c)]}')
    return ('\n'.join(lines) + '\n').encode()
