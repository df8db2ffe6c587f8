"""Ground that is not flat, as heights on a grid that begins flat at the origin."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from cpg_ros.simulation.robot_model import engine

#: Extent of the ground in front of the robot, behind it and to either side, and grid, m.
AHEAD, BEHIND, ASIDE, GRID = 8.0, 1.5, 3.0, 0.05
#: The robot starts on a flat place of this half size, m; the ground rises over as much again.
PLACE = 0.5
#: Deepest ground below the origin, m.
DEPTH = 3.0


@dataclass(frozen=True)
class Terrain:
    """A kind of ground.

    Attributes:
        kind: 'height_field', 'boxes' or 'ramp'.
        size: largest height, m; of a ramp its angle up, degrees.
        seed: of what is random.
        across: of a ramp: whether it rises to the left instead of ahead.

    """

    kind: str
    size: float
    seed: int = 0
    across: bool = False


def grid() -> tuple[np.ndarray, np.ndarray]:
    """Return the places of rows (to the left) and of columns (ahead), m."""
    return (np.linspace(-ASIDE, ASIDE, round(2.0 * ASIDE / GRID) + 1),
            np.linspace(-BEHIND, AHEAD, round((AHEAD + BEHIND) / GRID) + 1))


def heights(terrain: Terrain) -> np.ndarray:
    """Work out the ground, m, shape (rows, columns) of the grid.

    Raises:
        KeyError: there is no such kind.

    """
    y, x = grid()
    rng = np.random.default_rng(terrain.seed)
    found = {'height_field': _rough, 'boxes': _boxes, 'ramp': _ramp}[terrain.kind](
        terrain, x, y, rng)
    if terrain.kind == 'ramp':
        return found
    # None of it where the robot stands at the start.
    away = np.maximum(np.abs(x)[None, :], np.abs(y)[:, None])
    return found * np.clip((away - PLACE) / (0.2 * PLACE), 0.0, 1.0)


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


def _ramp(terrain: Terrain, x: np.ndarray, y: np.ndarray, rng: np.random.Generator
          ) -> np.ndarray:
    """A plane from the edge of the flat place on; across, it is reached through a twist."""
    rise = np.tan(np.radians(terrain.size))
    if terrain.across:
        return rise * np.clip((x[None, :] - PLACE) / 1.0, 0.0, 1.0) * y[:, None]
    return np.tile(rise * np.maximum(x - PLACE, 0.0), (y.size, 1))


def add_ground(spec: Any) -> None:
    """Add an empty height field named 'ground' to a model that is being built."""
    rows, columns = (side.size for side in grid())
    spec.add_hfield(name='ground', nrow=rows, ncol=columns, userdata=np.zeros(rows * columns),
                    size=[0.5 * (AHEAD + BEHIND), ASIDE, 2.0 * DEPTH, 1.0])
    spec.worldbody.add_geom(name='ground', type=engine().mjtGeom.mjGEOM_HFIELD,
                            hfieldname='ground', pos=[0.5 * (AHEAD - BEHIND), 0.0, -50.0],
                            friction=[1.0, 0.02, 0.01], contype=1, conaffinity=0x7FFFFFFF)


def lay(model: Any, terrain: Terrain) -> None:
    """Put ground in place of the floor of a model with a height field."""
    mujoco = engine()
    model.hfield_data[:] = (heights(terrain).ravel() + DEPTH) / (2.0 * DEPTH)
    model.geom_pos[model.geom('ground').id, 2] = -DEPTH
    floor = model.geom_type == mujoco.mjtGeom.mjGEOM_PLANE
    model.geom_pos[floor, 2] = -50.0
