"""The delayed network: eight tanh cells in two rings (Liu & Zhang 2024, eq. 1.1).

``x_i' = a x_i + b tanh(x_i) + d tanh(x_{i-2}) + c tanh(x_{s(i)}(t - tau))``, i = 1..8 with
indices cyclic, s swapping 1-2, 3-4, 5-6, 7-8. Time is in model units. The network is
equivariant under Z4 (i -> i + 2), Z2 (s) and x -> -x.
"""

import math
from dataclasses import astuple, dataclass
from typing import ClassVar

import numpy as np

from cpg_ros.integration.jit import tanh
from cpg_ros.networks.network import Network, Preset, Range, known
from cpg_ros.networks.symmetry import GAITS

CELLS = 8
#: Model time per step in real time: 500 steps a cycle, error of a waveform about 1e-9.
STEP = 0.0025
#: Longest delay that may be set at run time, in model time.
MAX_DELAY = 5.0


@dataclass(frozen=True)
class Mode:
    """The symmetry class (j, k): ``x_{i+2}`` leads ``x_i`` by j/4, ``x_{s(i)}`` by k/2."""

    j: int
    k: int

    @property
    def waves(self) -> np.ndarray:
        """Number of each cell's waveform, shape (8,): all have the same."""
        return np.zeros(CELLS, dtype=int)

    @property
    def phases(self) -> np.ndarray:
        """Phase of each cell in fractions of a period, shape (8,): x_i(t) = x_1(t + phi_i T)."""
        i = np.arange(CELLS)
        return ((i // 2) * self.j / 4 + (i % 2) * self.k / 2) % 1.0

    @property
    def basis(self) -> np.ndarray:
        """Orthonormal rows spanning the class, shape (1, 8) or (2, 8).

        Real and imaginary part of the eigenvector (1, (-1)^k, i^j, ...); for j = 1 and 3 the
        two conjugate modes share this space. It is invariant under the flow, as the fixed
        points of a subgroup of Z4 x Z2 x {x -> -x}.
        """
        vector = np.exp(2j * np.pi * self.phases)
        rows = [vector.real] if self.j % 2 == 0 else [vector.real, vector.imag]
        return np.array([row / np.linalg.norm(row) for row in rows])

    def eigenvalue_terms(self, network: 'Delayed') -> tuple[complex, float]:
        """Return (A, B) of the characteristic equation ``lambda = A + B exp(-lambda tau)``."""
        turn = (1, -1j, -1, 1j)[self.j]
        return (network.a + network.b + network.d * turn, network.c * (-1) ** self.k)


MODES = tuple(Mode(j, k) for j in range(4) for k in range(2))


@dataclass(frozen=True)
class Delayed(Network):
    """Parameters of the delayed network; a, b, c, d in 1/model time, tau in model time."""

    a: float
    b: float
    c: float
    d: float
    tau: float

    name: ClassVar[str] = 'delayed'
    kind: ClassVar[int] = 0
    cells: ClassVar[int] = CELLS
    states: ClassVar[tuple[str, ...]] = ('x',)
    readout: ClassVar = 'waveform'
    delay_parameter: ClassVar[str] = 'tau'
    longest_delay: ClassVar[float] = MAX_DELAY
    needed: ClassVar[dict[str, str]] = {
        'c': 'left and right legs would not be coupled, and no delay would matter'}
    step: ClassVar[float] = STEP
    ranges: ClassVar[dict[str, Range]] = {
        'a': Range(-20.0, 20.0, 'linear rate of each cell [1/model time]'),
        'b': Range(-20.0, 20.0, 'weight of each cell on itself [1/model time]'),
        'c': Range(-20.0, 20.0, "weight of the opposite leg's cell, delayed [1/model time]"),
        'd': Range(-20.0, 20.0, 'weight of the cell before it on the same side [1/model time]'),
        'tau': Range(STEP, MAX_DELAY, 'delay between opposite legs [model time]')}
    legs: ClassVar[dict[str, dict[str, tuple[int, ...]]]] = {
        'implicit': {'lh': (1, 7), 'rh': (2, 8), 'lf': (3, 5), 'rf': (4, 6)}}
    sides: ClassVar[dict[str, str]] = {
        'lh': 'left', 'rh': 'right', 'lf': 'left', 'rf': 'right'}
    girdles: ClassVar[dict[str, str]] = {'lh': 'hind', 'rh': 'hind', 'lf': 'fore', 'rf': 'fore'}
    usual_gait: ClassVar[str] = 'trot'
    usual_robot: ClassVar[str] = 'quadruped'
    free: ClassVar[tuple[str, ...]] = ('c', 'tau')
    line: ClassVar[str] = 'tau'

    @property
    def coefficients(self) -> np.ndarray:
        """The kernel's coefficients a, b, c, d, shape (4, cells)."""
        return np.repeat(np.array(astuple(self)[:4], dtype=float)[:, None], CELLS, axis=1)

    def jacobian(self, x: np.ndarray) -> np.ndarray:
        """Derivative of the rates by the state now, shape (..., 8, 8)."""
        slopes = 1.0 - np.tanh(x)**2
        matrix = np.zeros((*x.shape, CELLS))
        i = np.arange(CELLS)
        matrix[..., i, i] = self.a + self.b * slopes
        matrix[..., i, i - 2] = self.d * slopes[..., i - 2]
        return matrix

    def delayed_jacobian(self, past: np.ndarray) -> np.ndarray:
        """Derivative of the rates by the state a delay ago, shape (..., 8, 8)."""
        matrix = np.zeros((*past.shape, CELLS))
        i = np.arange(CELLS)
        matrix[..., i, i ^ 1] = self.c * (1.0 - np.tanh(past)**2)[..., i ^ 1]
        return matrix

    @classmethod
    def gaits(cls) -> tuple[str, ...]:
        """Names of the six primary gaits."""
        return tuple(GAITS)

    @classmethod
    def presets(cls) -> dict[str, Preset]:
        """Return PRESETS."""
        return PRESETS

    def symmetry(self, gait: str) -> Mode:
        """Return the gait's symmetry class.

        The sign of d turns the ring: the wave of walk and jump runs forward (j = 1, LF leads
        LH) for d < 0 and backward (j = 3, LH leads LF) otherwise.

        Raises:
            ValueError: the gait is not one of the six primary ones.

        """
        j, k = GAITS[known(gait, self.gaits())]
        return Mode(3 if j == 1 and self.d >= 0 else j, k)


# Ours share one time scale: trot, pace, bound and pronk have one waveform (T = 1.2783), walk
# and jump another (T = 1.0905). c > 0 puts the legs of a pair half a cycle apart (k = 1), c < 0
# together (k = 0); the sign of d selects j, and for walk and jump the sense of the wave.
PRESETS = {
    'walk': Preset('walk', Delayed(-4.5, 1.0, 6.5, 2.0, 0.4)),
    'trot': Preset('trot', Delayed(-4.5, 1.0, 6.5, -2.0, 0.4)),
    'pace': Preset('pace', Delayed(-4.5, 1.0, 6.5, 2.0, 0.4)),
    'bound': Preset('bound', Delayed(-4.5, 1.0, -6.5, -2.0, 0.4)),
    'jump': Preset('jump', Delayed(-4.5, 1.0, -6.5, 2.0, 0.4)),
    'pronk': Preset('pronk', Delayed(-4.5, 1.0, -6.5, 2.0, 0.4)),
    'liu2024_walk': Preset('walk', Delayed(-4.5, 1.0, 6.5, -2.0, 0.4)),
    'liu2024_trot': Preset('trot', Delayed(-4.5, 1.0, 6.5, -2.0, 0.4)),
    'liu2024_pace': Preset('pace', Delayed(-3.0, 0.1, 4.0, 1.0, 0.7)),
    'goat_trot': Preset('trot', Delayed(-2.0, 1.0, 6.43, -2.0, 0.25)),
    'goat_slope_walk': Preset('walk', Delayed(-2.0, 1.0, 6.5, -2.0, 0.245)),
}


def default_symmetry_gain(network: Delayed, rate: float = 0.5) -> float:
    """Return a symmetry-lock gain g that makes every gait attract.

    A disturbance z outside the gait's class obeys z' = (a - g) z + (b + d R) D(t) z +
    c S D(t - tau) z(t - tau), with permutations R, S and 0 < D <= 1 (slopes of tanh). So it
    decays at least as exp(-rate t), on the orbit as at rest, once
    ``g >= a + |b| + |d| + |c| exp(rate tau) + rate``. At rest that is the largest transverse
    characteristic root plus a margin.

    Args:
        network: the parameters.
        rate: guaranteed decay in 1/model time.

    """
    bound = (network.a + abs(network.b) + abs(network.d)
             + abs(network.c) * math.exp(rate * network.tau) + rate)
    return max(0.0, bound)


def compiled(decorate):
    """Compile the two halves of the right-hand side, drive and field, with a numba decorator.

    They take ``lanes`` copies of the network at once, cell by cell: component
    ``cell * lanes + lane`` of n. The coefficients p have shape (4, n).
    """
    @decorate
    def drive(n, past, p, lanes, out):
        """out_i = c tanh(x_{s(i)}(t - tau)), the part that depends on delayed states alone."""
        for i in range(n):
            out[i] = p[2, i] * tanh(past[i])
        for i in range(0, n, 2 * lanes):
            here, other = out[i:i + lanes], out[i + lanes:i + 2 * lanes]
            for lane in range(lanes):
                here[lane], other[lane] = other[lane], here[lane]

    @decorate
    def field(n, z, driven, p, lanes, work, out):
        """Right-hand side at z: a z_i + b tanh(z_i) + d tanh(z_{i-2}) + driven_i.

        work is scratch of shape (n + 2 lanes,).
        """
        ring = 2 * lanes
        # The ring laid out straight: `behind` is `squashed` seen from two cells before. (Slices,
        # not index sums, because those would be checked for negative values in every pass.)
        behind, squashed = work, work[ring:]
        for i in range(n):
            squashed[i] = tanh(z[i])
        for i in range(ring):
            behind[i] = squashed[n - ring + i]
        for i in range(n):
            out[i] = p[0, i] * z[i] + p[1, i] * squashed[i] + p[3, i] * behind[i] + driven[i]

    return drive, field
