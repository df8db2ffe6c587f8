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

"""Ground that is flat at the origin only: heights on a grid, or slabs.

Ramps and stairs are slabs with exact edges: on a grid a riser is a steep slope whose prisms catch
feet and stop robots that climb real steps of that height.
"""

from dataclasses import dataclass
import math
from typing import Any

from cpg_ros.simulation.robot_model import engine, SimulationError
import numpy as np

#: AHEAD, BEHIND, ASIDE: extent of the ground in front of the robot, behind it and to either side,
#: m;
#: GRID_SPACING: spacing of its heights, m.
AHEAD, BEHIND, ASIDE, GRID_SPACING = 8.0, 1.5, 3.0, 0.05
#: START_SIZE: half size of the flat place on which the robot starts, m.
START_SIZE = 0.5
#: MAX_HEIGHT: largest height of a height field, m; more makes prisms so slender that feet catch.
MAX_HEIGHT = 0.2
#: KINDS: kinds of ground that is not flat, see Terrain.
KINDS = ('height_field', 'boxes', 'stairs', 'waves', 'ramp', 'course')
#: Stairs. NUM_STEPS: number of steps up, and again down; TREAD: length of a tread, m;
#: LANDING: length of the landing on top, m.
NUM_STEPS, TREAD, LANDING = 5, 0.35, 1.05
#: STEP_THICKNESS: thickness of a step, m; more than the highest landing.
STEP_THICKNESS = 1.2
#: Depth of a height field's prisms below its lowest ground, m. Collisions of convex shapes are
#: searched along the line between their centres, which is about vertical with tall prisms.
PRISM_DEPTH = 1.0
#: FLOOR_HEIGHT: height of a floor under a height field, m, which catches robots that leave the
#: field, and which feet on the field do not reach.
FLOOR_HEIGHT = -0.01
#: SLAB_SIZE: half sizes of the slabs of a ramp, m; PARKED_HEIGHT: of unused ground, m.
SLAB_SIZE, PARKED_HEIGHT = (6.0, 6.0, 0.5), -50.0


@dataclass(frozen=True)
class Terrain:
    """A kind of ground.

    Attributes:
        kind: one of KINDS; a course has a height field, a ramp up and down, and boxes.
        size: largest height, m, from 0 to MAX_HEIGHT, or height of a step; for a ramp its angle,
            positive up, degrees.
        seed: of random heights.
        across: whether a ramp rises to the left instead of ahead.

    Raises:
        SimulationError: there is no such kind, or it is too high.

    """

    kind: str
    size: float
    seed: int = 0
    across: bool = False

    def __post_init__(self) -> None:
        if self.kind not in KINDS:
            raise SimulationError(f"terrain '{self.kind}' is not one of {', '.join(KINDS)}")
        low, high = (-45.0, 45.0) if self.kind == 'ramp' else (0.0, MAX_HEIGHT)
        if not low <= self.size <= high:
            raise SimulationError(f"the size {self.size:g} of the terrain '{self.kind}' is not "
                                  f'from {low:g} to {high:g}'
                                  + (' degrees' if self.kind == 'ramp' else ' m'))


def grid() -> tuple[np.ndarray, np.ndarray]:
    """Return the coordinates of rows (to the left) and of columns (ahead), m."""
    return (np.linspace(-ASIDE, ASIDE, round(2.0 * ASIDE / GRID_SPACING) + 1),
            np.linspace(-BEHIND, AHEAD, round((AHEAD + BEHIND) / GRID_SPACING) + 1))


def heights(terrain: Terrain) -> np.ndarray:
    """Return the heights of the ground, m, shape (rows, columns) of the grid.

    Raises:
        KeyError: the kind has no heights.

    """
    y, x = grid()
    rng = np.random.default_rng(terrain.seed)
    surface = {'height_field': _rough, 'boxes': _boxes, 'waves': _waves,
             'course': _course}[terrain.kind](terrain, x, y, rng)
    # Keep the ground flat where the robot starts.
    away = np.maximum(np.abs(x)[None, :], np.abs(y)[:, None])
    return surface * np.clip((away - START_SIZE) / (0.2 * START_SIZE), 0.0, 1.0)


def _rough(terrain: Terrain, x: np.ndarray, y: np.ndarray, rng: np.random.Generator
           ) -> np.ndarray:
    """Heights from 0 to the size, independent at the corners of features of 0.1 to 0.3 m."""
    feature = rng.uniform(0.1, 0.3)
    coarse_y, coarse_x = (np.arange(side[0], side[-1] + feature, feature) for side in (y, x))
    coarse = rng.uniform(0.0, terrain.size, (coarse_y.size, coarse_x.size))
    rows = np.stack([np.interp(x, coarse_x, row) for row in coarse])
    return np.stack([np.interp(y, coarse_y, column) for column in rows.T], axis=1)


def _boxes(terrain: Terrain, x: np.ndarray, y: np.ndarray, rng: np.random.Generator
           ) -> np.ndarray:
    """Blocks of 0.4 m with flat tops, each of a height from 0 to the size."""
    tops = rng.uniform(0.0, terrain.size, (64, 64))
    cells = [((side - side[0] + rng.uniform(0.0, 0.4)) / 0.4).astype(int) for side in (y, x)]
    return tops[np.ix_(*cells)]


def _waves(terrain: Terrain, x: np.ndarray, y: np.ndarray, rng: np.random.Generator
           ) -> np.ndarray:
    """Return the sum of a wave ahead and one to the left, both 0.8 to 1.6 m long."""
    length, begin = rng.uniform(0.8, 1.6, 2), rng.uniform(0.0, 2.0 * math.pi, 2)
    left, ahead = (np.sin(2.0 * math.pi * side / own + start)
                   for side, own, start in zip((y, x), length, begin, strict=True))
    return terrain.size * (2.0 + left[:, None] + ahead) / 4.0


def _course(terrain: Terrain, x: np.ndarray, y: np.ndarray, rng: np.random.Generator
            ) -> np.ndarray:
    """Return a height field up to 3 m, a ramp of 15 degrees up and down, boxes from 5.5 m on."""
    slope = math.tan(math.radians(15.0))
    ramp = np.clip(slope * np.minimum(x - 3.0, 5.3 - x), 0.0, MAX_HEIGHT)
    return np.where(x < 2.8, _rough(terrain, x, y, rng),
                    np.where(x > 5.5, _boxes(terrain, x, y, rng), np.tile(ramp, (y.size, 1))))


def add_ground(spec: Any) -> None:
    """Add a height field 'ground' and slabs, 'start', 'ramp' and steps, to a model, far below."""
    far: dict[str, Any]
    kinds, far = engine().mjtGeom, {'friction': [1.0, 0.02, 0.01], 'contype': 1,
                                    'conaffinity': 0x7FFFFFFF}
    if any(material.name == 'checks' for material in spec.materials):
        far['material'] = 'checks'
    rows, columns = (side.size for side in grid())
    spec.add_hfield(name='ground', nrow=rows, ncol=columns, userdata=np.zeros(rows * columns),
                    size=[0.5 * (AHEAD + BEHIND), ASIDE, MAX_HEIGHT, PRISM_DEPTH])
    spec.worldbody.add_geom(name='ground', type=kinds.mjGEOM_HFIELD, hfieldname='ground',
                            pos=[0.5 * (AHEAD - BEHIND), 0.0, PARKED_HEIGHT], **far)
    for name in ('start', 'ramp'):
        spec.worldbody.add_geom(name=name, type=kinds.mjGEOM_BOX, size=SLAB_SIZE,
                                pos=[0.0, 0.0, PARKED_HEIGHT], **far)
    for step in range(NUM_STEPS):
        spec.worldbody.add_geom(name=f'step_{step}', type=kinds.mjGEOM_BOX,
                                pos=[0.0, 0.0, PARKED_HEIGHT],
                                size=[0.5 * LANDING + (NUM_STEPS - 1 - step) * TREAD, ASIDE,
                                      0.5 * STEP_THICKNESS], **far)


def lay(model: Any, terrain: Terrain) -> None:
    """Replace the floor by a terrain, in a model that ``add_ground`` has prepared."""
    mujoco = engine()
    # Geoms have moved: the tree of bounding boxes and the flags of fixed geoms no longer hold.
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_MIDPHASE
    model.geom_sameframe[model.geom('ramp').id] = mujoco.mjtSameFrame.mjSAMEFRAME_NONE
    positions, floor = model.geom_pos, model.geom_type == mujoco.mjtGeom.mjGEOM_PLANE
    if terrain.kind == 'stairs':
        for step in range(NUM_STEPS):
            geom = model.geom(f'step_{step}').id
            model.geom_sameframe[geom] = mujoco.mjtSameFrame.mjSAMEFRAME_NONE
            positions[geom] = (START_SIZE + (NUM_STEPS - 1) * TREAD + 0.5 * LANDING, 0.0,
                           (step + 1) * terrain.size - 0.5 * STEP_THICKNESS)
        return
    model.geom_sameframe[floor] = mujoco.mjtSameFrame.mjSAMEFRAME_NONE
    positions[floor, 2] = PARKED_HEIGHT
    if terrain.kind == 'ramp':
        half = 0.5 * math.radians(terrain.size)
        ramp = model.geom('ramp').id
        axis = np.array([1.0, 0.0] if terrain.across else [0.0, -1.0])
        model.geom_quat[ramp] = math.cos(half), *(math.sin(half) * axis), 0.0
        # The upper edge of the slab ends the flat place.
        edge = np.zeros(3)
        corner = np.array([-SLAB_SIZE[0], 0.0, SLAB_SIZE[2]])
        mujoco.mju_rotVecQuat(edge, corner, model.geom_quat[ramp])
        positions[ramp] = np.array([START_SIZE, 0.0, 0.0]) - edge
        positions[model.geom('start').id] = START_SIZE - SLAB_SIZE[0], 0.0, -SLAB_SIZE[2]
        return
    positions[floor, 2] = FLOOR_HEIGHT
    # At edges between prisms, MuJoCo's own collision of convex shapes pushes feet sideways: on a
    # field 1 mm high robots fell that walk on a plane. With libccd's they walk as on the plane.
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_NATIVECCD
    model.hfield_data[:] = heights(terrain).ravel() / MAX_HEIGHT
    positions[model.geom('ground').id, 2] = 0.0


def set_friction(model: Any, friction: float) -> None:
    """Limit the friction of everything to this, and give the ground exactly this."""
    # MuJoCo uses the larger friction of two geoms in contact, so lower both.
    ground, sliding = model.geom_bodyid == 0, model.geom_friction[:, 0]
    sliding[:] = np.where(ground, friction, np.minimum(sliding, friction))
