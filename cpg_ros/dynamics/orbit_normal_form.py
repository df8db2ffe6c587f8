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

"""Normal forms where orbits lose stability: is the bifurcation supercritical or subcritical.

Near an orbit u of period T, of which a disturbance v has the multiplier mu on the unit circle, the
states are ``x = u(s) + z v(s) + conj(z v(s)) + ...`` with, at the critical parameters,

    s' = 1 + a |z|^2,  z' = c z |z|^2  (a torus; Kuznetsov, *Elements of Applied Bifurcation
    Theory*, chapter 9.5, and Kuznetsov, Govaerts, Doedel & Dhooge, SIAM J. Numer. Anal. 43, 2005),
    s' = 1 + a z^2,  z' = c z^3  with x = u(s) + z v(s) + ... where mu is real: twice the period
    (mu = -1), or a branch that breaks a symmetry (mu = 1).

Where Re c < 0 (supercritical, soft) the motion that branches off attracts and grows slowly. Where
Re c > 0 (subcritical) no motion nearby attracts, and the gait jumps. With a delay tau the state is
a history, in which s and z a delay ago are s - tau s' and z - tau z' to the same order. The rates
depend on them by B x(t - tau), so ``E y = y + tau B y(t - tau)`` replaces y in the factors of s'
and z' (cf. Lentjes, Spek, Bosschaert & Kuznetsov, Periodic normal forms for bifurcations of limit
cycles in DDEs, 2023).
"""

from dataclasses import dataclass
from functools import partial
from typing import Any

from cpg_ros.common.errors import ShortRepr
from cpg_ros.dynamics.arclength import NoOrbit
from cpg_ros.dynamics.continuation import IMAGINARY_TOLERANCE
from cpg_ros.dynamics.floquet import multipliers
from cpg_ros.dynamics.orbit import Orbit
from cpg_ros.dynamics.orbit_method import orbit_method
from cpg_ros.networks.equations import Field, States
import numpy as np
import scipy

# The variational equation about an orbit where it is singular: null vectors and solutions.

#: Iterations in which the null vectors become the borders of the next system.
NUM_ITERATIONS = 2


class _Bordered:
    """``[[matrix, columns], [conj(rows), 0]]``, factorised; rows and columns of shape (k, n)."""

    def __init__(self, matrix: np.ndarray | scipy.sparse.csc_array, rows: np.ndarray,
                 columns: np.ndarray) -> None:
        self._shape = matrix.shape[0], len(rows)
        if isinstance(matrix, np.ndarray):
            corner = np.zeros((len(rows), len(rows)))
            factors = scipy.linalg.lu_factor(np.block([[matrix, columns.T],
                                                       [rows.conj(), corner]]))
            self._factors: Any = partial(scipy.linalg.lu_solve, factors)
        else:
            whole = scipy.sparse.block_array([[matrix, columns.T], [rows.conj(), None]],
                                             format='csc') if len(rows) else matrix
            lu = scipy.sparse.linalg.splu(whole)
            self._factors = lambda right, trans: lu.solve(right, 'NTH'[trans])

    def solve(self, right: np.ndarray) -> np.ndarray:
        """Return the solution that is normal to the rows, shape (n,) as the right-hand side."""
        n, k = self._shape
        padded = np.append(right, np.zeros(k)).astype(complex)
        return np.asarray(self._factors(padded, trans=0))[:n]

    def null(self, adjoint: bool) -> np.ndarray:
        """Return the matrix's right or left null vectors, of length 1, shape (k, n)."""
        n, k = self._shape
        vectors = self._factors(np.eye(n + k, k, -n, dtype=complex), trans=2 * adjoint)[:n].T
        return vectors / np.linalg.norm(vectors, axis=1)[:, None]


class Linearised:
    """Disturbances of an orbit, with those that return as multiples of themselves.

    Attributes:
        equation: the variational equation.

    """

    def __init__(self, orbit: Orbit, halvings: int) -> None:
        """Linearise about an orbit, on its mesh halved a number of times.

        Raises:
            NoOrbit: its rates have no derivatives, or there are too many unknowns.

        """
        self.equation = orbit_method(orbit.network).floquet.Variational(orbit, halvings)
        if self.equation.unusable:
            raise NoOrbit(self.equation.unusable)
        self._field: Field = Field(orbit.network)
        self._systems: dict[complex, tuple[_Bordered, np.ndarray]] = {}

    def find(self, factor: complex, guesses: np.ndarray) -> np.ndarray:
        """Return all disturbances that grow by a factor over a period, shape (k, n).

        Args:
            factor: over a period.
            guesses: of them at the unknowns, shape (k, n).

        """
        matrix = self.equation.matrix(factor)
        rights = lefts = guesses / np.linalg.norm(guesses, axis=1)[:, None]
        for _ in range(NUM_ITERATIONS):
            system = _Bordered(matrix, rights, lefts)
            rights, lefts = system.null(False), system.null(True)
        self._systems[factor] = _Bordered(matrix, rights, lefts), lefts
        return rights

    def fractions(self, factor: complex, rates: np.ndarray) -> np.ndarray:
        """Return the products of sources with the left null vectors, shape (k,)."""
        return self._systems[factor][1].conj() @ self.equation.right(rates, factor)

    def solve(self, rates: np.ndarray, factor: complex) -> States:
        """Return the disturbance that sources cause which grow by a factor over a period."""
        if factor not in self._systems:
            none = np.zeros((0, self.equation.along().size))
            self._systems[factor] = _Bordered(self.equation.matrix(factor), none, none), none
        solution = self._systems[factor][0].solve(self.equation.right(rates, factor))
        return self.equation.values(solution, rates, factor)

    def form(self, *sets: States) -> np.ndarray:
        """Return the rates' second or third derivative, B(a, b) or C(a, b, c), on the orbit."""
        return self._field.multilinear(self.equation.at, *sets)

    def moved(self, y: States) -> np.ndarray:
        """Return ``E y = y + tau B y(t - tau)``."""
        return y[0] + self.equation.delay * self.equation.delayed(y)

    def late(self, y: States) -> States:
        """Return ``tau y(t - tau)`` as a disturbance that is there a delay ago only."""
        past = None if y[1] is None else self.equation.delay * y[1]
        return np.zeros_like(y[0]), past


#: Distance from the unit circle up to which a multiplier is on it, and of a power of it from 1 up
#: to which there is a resonance.
CIRCLE_TOLERANCE, RESONANCE_TOLERANCE = 1e-3, 0.02
#: Relative change of a coefficient when the mesh is halved.
MESH_TOLERANCE = 0.01
#: Modulus above which a multiplier grows at a crossing of another one.
GROWTH_THRESHOLD = 1.001
#: Fraction of its terms below which a coefficient is 0.
ZERO_TOLERANCE = 1e-6


@dataclass(frozen=True, eq=False, repr=False)
class OrbitNormalForm(ShortRepr):
    """The normal form at a point where a multiplier crosses the unit circle.

    Attributes:
        cubic: c, 1/model time, for disturbances v whose largest component is 1; nan if unknown.
        why: reason why the form does not decide, or ''.

    """

    cubic: complex
    why: str = ''

    @property
    def soft(self) -> bool | None:
        """Whether the motion that branches off attracts; None if the form does not decide."""
        return None if self.why else self.cubic.real < 0.0

    @property
    def verdict(self) -> str:
        """The verdict in words."""
        return f'cannot tell: {self.why}' if self.why else (
            'supercritical' if self.soft else 'subcritical')

    def _summary(self) -> str:
        return f'{self.verdict}, c = {self.cubic:.6g}'


def orbit_normal_form(orbit: Orbit, multiplier: complex, part: int) -> OrbitNormalForm:
    """Return the normal form at an orbit of which a multiplier crosses the unit circle.

    Args:
        orbit: of the critical parameters.
        multiplier: that crosses: complex at a torus, where it is either of the pair, near -1 at a
            period doubling, near 1 at a branch point.
        part: index of its subspace: 0 for the gait's class, then the transverse ones.

    """
    pair = abs(multiplier.imag) > IMAGINARY_TOLERANCE
    if why := _undecided(orbit, multiplier, pair):
        return OrbitNormalForm(complex('nan'), why)
    try:
        forms = [_cubic(Linearised(orbit, halvings), multiplier, part, pair)
                 for halvings in (0, 1)]
    except (NoOrbit, np.linalg.LinAlgError, RuntimeError) as error:
        return OrbitNormalForm(complex('nan'), str(error))
    if abs(forms[1].real - forms[0].real) > MESH_TOLERANCE * abs(forms[1].real):
        return OrbitNormalForm(forms[1], f'c is {forms[0]:.3g} or {forms[1]:.3g}, by the mesh')
    return OrbitNormalForm(forms[1])


def loses_stability(orbit: Orbit) -> bool:
    """Whether all multipliers but the crossing one are inside the unit circle."""
    spectrum = multipliers(orbit)
    return bool((np.abs([*spectrum.within, *spectrum.transverse]) < GROWTH_THRESHOLD).all())


def _undecided(orbit: Orbit, multiplier: complex, pair: bool) -> str:
    """Return why a normal form with one disturbance does not apply, or ''."""
    spectrum = multipliers(orbit)
    moduli = np.abs(np.concatenate([spectrum.within, spectrum.transverse]))
    if (np.abs(moduli - 1.0) < CIRCLE_TOLERANCE).sum() > 1 + pair:
        return 'other multipliers are on the unit circle, too'
    for power in (1, 2, 3, 4):
        if pair and abs(multiplier**power - 1.0) < RESONANCE_TOLERANCE:
            return f'the resonance 1:{power} is near'
    return ''


def _conj(y: States) -> States:
    return y[0].conj(), None if y[1] is None else y[1].conj()


def _cubic(linear: Linearised, multiplier: complex, part: int, pair: bool) -> complex:
    """Return c on the mesh of a linearised network."""
    equation = linear.equation
    factor, guess = equation.critical(part, multiplier)
    factor = complex(factor / abs(factor)) if pair else complex(round(factor.real))
    if not pair and abs(factor) != 1.0:
        raise NoOrbit('two disturbances that symmetry makes alike are critical')
    same = factor == 1.0
    along, guesses = equation.slope, [equation.along()]
    if same:
        guesses.append(guess)
    critical = linear.find(1.0, np.array(guesses))
    right = critical[1] if same else linear.find(factor, guess[None])[0]
    v = equation.values(right, np.zeros_like(along[0]), factor)
    size = np.abs(v[0]).max()
    v = v[0] / size, None if v[1] is None else v[1] / size

    # Sources have a component along the orbit and one along v; if both factors are 1, the left
    # null vectors separate them together.
    weights = np.array([linear.fractions(1.0, linear.moved(y)) for y in ((along, v) if same
                                                                      else (along,))]).T
    scale = None if same else linear.fractions(factor, linear.moved(v))[0]

    def fraction(rates: np.ndarray) -> complex:
        """Return the component along v."""
        if scale is None:
            return complex(np.linalg.solve(weights, linear.fractions(1.0, rates))[1])
        return complex(linear.fractions(factor, rates)[0] / scale)

    other = _conj(v) if pair else v
    first = linear.form(v, other)
    if same and abs(fraction(first)) > ZERO_TOLERANCE * np.abs(first).max():
        raise NoOrbit('a branch crosses this one (transcritical)')
    a = complex(np.linalg.solve(weights, linear.fractions(1.0, first))[0])
    mixed = linear.solve(first - a * linear.moved(along), 1.0)
    cubic = linear.form(v, v, other)
    if pair:
        double = linear.solve(linear.form(v, v), factor**2)
        terms = [linear.form(v, mixed), 0.5 * linear.form(other, double), 0.5 * cubic]
    else:
        # The term of second order is that of z^2 / 2, and a that of z^2.
        a *= 0.5
        terms = [0.5 * linear.form(v, mixed), cubic / 6.0]
    slope = equation.derivative(v, factor)
    terms += [-a * linear.moved(slope), -a * linear.form(v, linear.late(along))]
    components = [fraction(term) for term in terms]
    if abs(sum(components).real) <= ZERO_TOLERANCE * max(map(abs, components)):
        raise NoOrbit('its cubic term is 0')
    return complex(sum(components))
