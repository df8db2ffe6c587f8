"""The quadruped network: eight Morris-Lecar cells in two rings (Buono & Golubitsky 2001).

Coupling is linear synaptic (their eq. 4.4): to v_i' is added ``alpha v_{i-2} + gamma v_{s(i)} +
xi v_{i+4}``, to w_i' ``beta w_{i-2} + delta w_{s(i)} + eta w_{i+4}``, indices cyclic in 1..8, s
swapping 1-2, 3-4, 5-6, 7-8. The network is equivariant under Z4 (i -> i + 2) x Z2 (s).
"""

from dataclasses import dataclass
from fractions import Fraction
from typing import ClassVar

import numpy as np

from cpg_ros.networks import morris_lecar
from cpg_ros.networks.network import Network, Range, known
from cpg_ros.networks.symmetry import GAITS, Z4_Z2, Symmetry

CELLS = 8
CURRENT, PHI = 1.0, 0.2
#: Constants of section 6.
CELL = morris_lecar.Cell(g_ca=3.0, v_ca=1.0, g_k=1.8, v_k=-0.8, g_l=0.6, v_l=-1.8,
                         v1=0.2, v2=0.4, v3=0.3, v4=0.2, base=0.0)

#: Where v and w of cell i hear: i - 2, s(i) and i + 4.
_HEARD = (np.roll(np.arange(CELLS), 2), np.arange(CELLS) ^ 1, np.roll(np.arange(CELLS), 4))


@dataclass(frozen=True)
class Quadruped(Network):
    """Couplings of the quadruped network, in 1/model time."""

    alpha: float
    beta: float
    gamma: float
    delta: float
    xi: float = 0.0
    eta: float = 0.0

    name: ClassVar[str] = 'quadruped'
    kind: ClassVar[int] = 1
    cells: ClassVar[int] = CELLS
    states: ClassVar[tuple[str, ...]] = ('v', 'w')
    readout: ClassVar = 'phase'
    step: ClassVar[float] = 0.01
    ranges: ClassVar[dict[str, Range]] = {
        key: Range(-5.0, 5.0, f'coupling of {variable} from {source}')
        for key, variable, source in (
            ('alpha', 'v', 'the cell before it on the same side'),
            ('beta', 'w', 'the cell before it on the same side'),
            ('gamma', 'v', 'the opposite cell'), ('delta', 'w', 'the opposite cell'),
            ('xi', 'v', 'the cell across its ring'), ('eta', 'w', 'the cell across its ring'))}
    #: The assignments of Table 3 and of Theorem 3.3 (Table 4).
    legs: ClassVar[dict[str, dict[str, tuple[int, ...]]]] = {
        'implicit': {'lh': (1, 7), 'rh': (2, 8), 'lf': (3, 5), 'rf': (4, 6)},
        'zigzag': {'lh': (1, 5), 'rh': (2, 6), 'lf': (3, 7), 'rf': (4, 8)},
        'crisscross': {'lh': (1, 6), 'rh': (2, 5), 'lf': (3, 8), 'rf': (4, 7)}}
    sides: ClassVar[dict[str, str]] = {
        'lh': 'left', 'rh': 'right', 'lf': 'left', 'rf': 'right'}
    girdles: ClassVar[dict[str, str]] = {'lh': 'hind', 'rh': 'hind', 'lf': 'fore', 'rf': 'fore'}
    usual_gait: ClassVar[str] = 'trot'
    usual_robot: ClassVar[str] = 'quadruped'
    free: ClassVar[tuple[str, ...]] = ('alpha', 'beta')
    line: ClassVar[str] = 'alpha=beta'
    span: ClassVar[tuple[float, float] | None] = (-1.0, 1.0)
    #: About what Table 13 uses for most gaits, where xi and eta are 0.
    searched: ClassVar[dict[str, tuple[float, float]]] = {
        **dict.fromkeys(('alpha', 'beta', 'gamma', 'delta'), (-0.8, 0.8)),
        'xi': (0.0, 0.0), 'eta': (0.0, 0.0)}
    typical_cycle: ClassVar[tuple[tuple[float, float, float], ...]] = (
        (0.2, 0.5, 0.0), (0.45, 0.3, 0.2))

    @property
    def coefficients(self) -> np.ndarray:
        """Rows: from i - 2, s(i), i + 4, and i for v, phi for w; shape (4, components)."""
        pairs = ((self.alpha, self.beta), (self.gamma, self.delta), (self.xi, self.eta),
                 (CURRENT, PHI))
        return np.array([np.repeat(pair, CELLS) for pair in pairs], dtype=float)

    @classmethod
    def gaits(cls) -> tuple[str, ...]:
        """Names of the six primary gaits."""
        return tuple(GAITS)

    def symmetry(self, gait: str) -> Symmetry:
        """Return the gait's symmetry.

        The wave of walk and jump runs so that each cell follows the one it hears for
        alpha >= 0 (LH leads LF), and the other way round for alpha < 0.

        Raises:
            ValueError: the gait is not one of the six primary ones.

        """
        j, k = GAITS[known(gait, self.gaits())]
        j = 3 if j == 1 and self.alpha >= 0.0 else j
        return Symmetry.of(Z4_Z2, {'omega': Fraction(j, 4), 'kappa': Fraction(k, 2)})

    def rates(self, x: np.ndarray) -> np.ndarray:
        """Right-hand side at states x, shape (..., components)."""
        v, w = x[..., :CELLS], x[..., CELLS:]
        dv, dw = CELL.rates(v, w, CURRENT, PHI)
        by_v, by_w = (self.alpha, self.gamma, self.xi), (self.beta, self.delta, self.eta)
        for heard, a, b in zip(_HEARD, by_v, by_w, strict=True):
            dv = dv + a * v[..., heard]
            dw = dw + b * w[..., heard]
        return np.concatenate([dv, dw], axis=-1)

    def jacobian(self, x: np.ndarray) -> np.ndarray:
        """Derivative of the rates by the state, shape (..., components, components)."""
        matrix, i = CELL.jacobian(x[..., :CELLS], x[..., CELLS:], PHI), np.arange(CELLS)
        by_v, by_w = (self.alpha, self.gamma, self.xi), (self.beta, self.delta, self.eta)
        for heard, a, b in zip(_HEARD, by_v, by_w, strict=True):
            matrix[..., i, heard] += a
            matrix[..., i + CELLS, heard + CELLS] += b
        return matrix

    def by_parameter(self, x: np.ndarray) -> np.ndarray:
        """Derivative of the rates by the parameters, shape (..., components, 6)."""
        v, w = x[..., :CELLS], x[..., CELLS:]
        columns = np.zeros((*x.shape, 6))
        for k, heard in enumerate(_HEARD):
            columns[..., :CELLS, 2 * k] = v[..., heard]
            columns[..., CELLS:, 2 * k + 1] = w[..., heard]
        return columns


def compiled(decorate):
    """Compile (no drive, right-hand side); coefficients have shape (4, n), driven is unused."""
    cell_rates = morris_lecar.compiled(decorate, CELL)

    @decorate
    def field(n, z, driven, p, lanes, work, out):
        """Right-hand side at z; work is scratch."""
        half = n // 2
        v, w, dv, dw = z[:half], z[half:n], out[:half], out[half:n]
        cell_rates(half, v, w, p[3, :half], p[3, half:n], work, dv, dw)
        # Slices, not index sums: those would be checked for negative values in every pass.
        pair, ring = 2 * lanes, 8 * lanes
        for block in range(2):
            y, dy = z[block * half:(block + 1) * half], out[block * half:(block + 1) * half]
            a, c, e = (p[0, block * half:(block + 1) * half],
                       p[1, block * half:(block + 1) * half],
                       p[2, block * half:(block + 1) * half])
            last = y[ring - pair:]
            for i in range(pair):
                dy[i] += a[i] * last[i]
            later, weight_later = dy[pair:], a[pair:]
            for i in range(ring - pair):
                later[i] += weight_later[i] * y[i]
            upper, upper_rate, upper_weight = y[2 * pair:], dy[2 * pair:], e[2 * pair:]
            for i in range(2 * pair):
                dy[i] += e[i] * upper[i]
                upper_rate[i] += upper_weight[i] * y[i]
            for start in range(0, ring, pair):
                here, there = y[start:start + lanes], y[start + lanes:start + pair]
                rate, other = dy[start:start + lanes], dy[start + lanes:start + pair]
                mine, its = c[start:start + lanes], c[start + lanes:start + pair]
                for lane in range(lanes):
                    rate[lane] += mine[lane] * there[lane]
                    other[lane] += its[lane] * here[lane]

    return None, field

