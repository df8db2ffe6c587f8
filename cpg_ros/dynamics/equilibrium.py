"""Stands of the Morris-Lecar networks: equilibria at which all cells are equal.

Every symmetry of the network fixes them (Buono & Golubitsky 2001, section 5.1). A cell's rates are
linear in its second variable w, ``v' = f0(v) + f1(v) w`` and ``w' = g0(v) + g1(v) w``, couplings
included, so stands are the roots of ``f0 g1 - f1 g0`` in v, which has no poles.
"""

from dataclasses import replace
from functools import lru_cache
from typing import TypeVar

import numpy as np

from cpg_ros.dynamics.sign_changes import crossings
from cpg_ros.errors import CpgError, InputError
from cpg_ros.networks.biped import Biped
from cpg_ros.networks.quadruped import Quadruped

CellNetwork = TypeVar('CellNetwork', bound=Quadruped | Biped)

#: Parameters that are not couplings.
OWN = ('current', 'phi')
#: Where stands are looked for: close to where the cell's functions bend, and far out.
_FAR = np.geomspace(3.0, 100.0, 400)[1:]
GRID = np.concatenate([-_FAR[::-1], np.linspace(-3.0, 3.0, 2001), _FAR])
#: Longest way of v and w in a step along a branch, and how far it may miss, against their size.
LONGEST, MISS = 0.1, 0.01
#: A stand that has gone further does not come back.
FURTHEST = 1e3
#: Shortest step, in the share of the coupling: at a fold nothing lies beyond it.
SHORTEST = 1e-5


class NoStand(CpgError):
    """The stand cannot be followed from the uncoupled cells to these couplings."""


def cell_terms(network: Quadruped | Biped, v: np.ndarray) -> np.ndarray:
    """Terms of a cell's rates where all cells are equal, ``v' = f0 + f1 w``, ``w' = g0 + g1 w``.

    Args:
        network: parameters.
        v: first variable, shape (...), real or complex.

    Returns:
        f0, f1, g0, g1, shape (4, ...).

    """
    v = np.asarray(v)
    nothing, one = (cell_rates(network, np.stack([v, w + 0.0 * v], axis=-1)) for w in (0.0, 1.0))
    slope = one - nothing
    return np.stack([nothing[..., 0], slope[..., 0], nothing[..., 1], slope[..., 1]])


def cell_rates(network: Quadruped | Biped, cell: np.ndarray) -> np.ndarray:
    """Rates of v and w where all cells are in one state, shape (..., 2) like the state."""
    return network.rates(everywhere(network, cell))[..., ::network.cells]


def cell_jacobian(network: Quadruped | Biped, cell: np.ndarray) -> np.ndarray:
    """Derivative of those rates if all cells move together, shape (2, 2)."""
    whole = network.jacobian(everywhere(network, cell))
    return whole.reshape(2, network.cells, 2, network.cells)[:, 0].sum(axis=-1)


def everywhere(network: Quadruped | Biped, cell: np.ndarray) -> np.ndarray:
    """State of the network with all cells in one state (v, w), shape (..., components)."""
    return np.repeat(cell, network.cells, axis=-1)


def stands(network: Quadruped | Biped) -> np.ndarray:
    """Find all stands with v from -100 to 100, states (v, w) by rising v, shape (n, 2).

    Raises:
        ValueError: a parameter is not finite.

    """
    _check(network)

    def balance(v: np.ndarray) -> np.ndarray:
        f0, f1, g0, g1 = cell_terms(network, v)
        return f0 * g1 - f1 * g0

    found = []
    for v in crossings(lambda x: float(balance(np.array(x))), GRID, balance(GRID)):
        _, _, g0, g1 = cell_terms(network, np.array(v))
        # Where w' does not feel w, a root is none of both equations.
        if g1 != 0.0 and np.isfinite(g0 / g1):
            found.append(_newton(network, np.array([v, -g0 / g1])))
    return np.array([state for state in found if state is not None]).reshape(-1, 2)


def stand(network: CellNetwork) -> np.ndarray:
    """Find the stand that the uncoupled cells' equilibrium becomes, (v, w) of a cell, shape (2,).

    It is followed while all couplings grow from 0 to their values (Buono & Golubitsky 2001,
    proposition 5.1). Where coupling is diffusive it stays where it is.

    Raises:
        NoStand: it is lost in a fold on the way, or the uncoupled cell has several equilibria.
        ValueError: a parameter is not finite.

    """
    _check(network)
    alone = _coupled(network, 0.0)
    state, share, step, grow = _uncoupled(alone), 0.0, 0.25, 2.0
    slope = cell_jacobian(alone, state)
    while share < 1.0:
        step = min(step, 1.0 - share)
        # The rates are linear in the couplings: this difference is their derivative.
        push = cell_rates(network, state) - cell_rates(alone, state)
        way = -step * np.linalg.solve(slope, push)
        size, there, new = 1.0 + np.abs(state).max(), _coupled(network, share + step), None
        if np.abs(way).max() <= LONGEST * size:
            new = _newton(there, state + way)
        # Beyond a fold the determinant has the other sign.
        if (new is not None and np.abs(new - state - way).max() <= MISS * size
                and np.linalg.det(cell_jacobian(there, new)) * np.linalg.det(slope) > 0.0):
            state, slope = new, cell_jacobian(there, new)
            share, step, grow = share + step, grow * step, 2.0
        else:
            step, grow = 0.5 * step, 1.0
        if step < SHORTEST < 1.0 - share or size > FURTHEST:
            how = 'in a fold' if size <= FURTHEST else 'to infinity'
            raise NoStand(f'the stand is lost {how} at {share:.4f} of the couplings, '
                          f'v {state[0]:.4f}, w {state[1]:.4f}')
    return state


def _coupled(network: CellNetwork, share: float) -> CellNetwork:
    """Return the network with a share of its couplings."""
    if share == 1.0:
        return network
    return replace(network, **{  # type: ignore[arg-type]
        name: share * value for name, value in network.as_dict().items() if name not in OWN})


@lru_cache(maxsize=64)
def _uncoupled(alone: Quadruped | Biped) -> np.ndarray:
    found = stands(alone)
    if len(found) != 1:
        raise NoStand(f'an uncoupled cell has {len(found)} equilibria: none is the stand')
    return found[0]


def _newton(network: Quadruped | Biped, cell: np.ndarray) -> np.ndarray | None:
    """Solve for a stand near a state; None where there is none."""
    with np.errstate(all='ignore'):
        for _ in range(8):
            try:
                move = np.linalg.solve(cell_jacobian(network, cell), cell_rates(network, cell))
            except np.linalg.LinAlgError:
                return None
            cell = cell - move
            size = np.abs(move).max() / (1.0 + np.abs(cell).max())
            if not size < 1e3:
                return None
            if size < 1e-14:
                break
    return cell if size < 1e-11 else None


def _check(network: Quadruped | Biped) -> None:
    for name, value in network.as_dict().items():
        if not np.isfinite(value):
            raise InputError(f'{name} is {value}')
