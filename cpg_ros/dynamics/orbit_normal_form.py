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

"""Normal forms where orbits lose stability: is the change of gait soft or hard.

Near an orbit u of period T, of which a disturbance v has the multiplier mu on the unit circle, the
states are ``x = u(s) + z v(s) + conj(z v(s)) + ...`` with, at the critical parameters,

    s' = 1 + a |z|^2,  z' = c z |z|^2  (a torus; Kuznetsov, *Elements of Applied Bifurcation
    Theory*, chapter 9.5, and Kuznetsov, Govaerts, Doedel & Dhooge, SIAM J. Numer. Anal. 43, 2005),
    s' = 1 + a z^2,  z' = c z^3  with x = u(s) + z v(s) + ... where mu is real: twice the period
    (mu = -1), or a branch that breaks a symmetry (mu = 1).

Where Re c < 0 what leaves the orbit attracts and grows slowly from it: the change of gait is
soft. Where Re c > 0 nothing near is left that attracts, and the gait jumps. With a delay tau the
state is a history, of which s and z of a delay ago are known to the same order, s - tau s' and
z - tau z': as rates B x(t - tau) hear them, ``E y = y + tau B y(t - tau)`` takes y's place in what
s' and z' multiply (cf. Lentjes, Spek, Bosschaert & Kuznetsov, Periodic normal forms for
bifurcations of limit cycles in DDEs, 2023).
"""

from dataclasses import dataclass

from cpg_ros.dynamics.bifurcation import REAL
from cpg_ros.dynamics.critical_disturbances import Linearised
from cpg_ros.dynamics.floquet import multipliers
from cpg_ros.dynamics.orbit import NoOrbit, Orbit
from cpg_ros.networks.field import States
from cpg_ros.short_repr import ShortRepr
import numpy as np

#: Multipliers this near to the circle are on it; powers of one this near to 1 are 1.
CRITICAL, RESONANT = 1e-3, 0.02
#: A coefficient must not change by more than this share when the mesh is halved.
SAME = 0.01
#: What a multiplier is larger than that grows where another one crosses the circle.
GROWS = 1.001
#: A quadratic term of this share of what its parts are is none.
NOTHING = 1e-6


@dataclass(frozen=True, eq=False, repr=False)
class OrbitNormalForm(ShortRepr):
    """The normal form at a point where a multiplier crosses the unit circle.

    Attributes:
        cubic: c, 1/model time, for disturbances v of which the largest component is 1 at most;
            nan where it is not known.
        why: it does not decide, '' if it does.

    """

    cubic: complex
    why: str = ''

    @property
    def soft(self) -> bool | None:
        """Whether what leaves the orbit attracts; None if the normal form cannot tell."""
        return None if self.why else self.cubic.real < 0.0

    @property
    def verdict(self) -> str:
        """In words."""
        return f'cannot tell: {self.why}' if self.why else 'soft' if self.soft else 'hard'

    def _summary(self) -> str:
        return f'{self.verdict}, c = {self.cubic:.6g}'


def orbit_normal_form(orbit: Orbit, multiplier: complex, part: int) -> OrbitNormalForm:
    """Return the normal form at an orbit of which a multiplier crosses the unit circle.

    Args:
        orbit: of the critical parameters.
        multiplier: that crosses: complex at a torus, where it is either of the pair, near -1 at a
            period doubling, near 1 at a branch point.
        part: number of the subspace it belongs to: 0 the gait's class, then those transverse.

    """
    pair = abs(multiplier.imag) > REAL
    if why := _undecided(orbit, multiplier, pair):
        return OrbitNormalForm(complex('nan'), why)
    try:
        found = [_cubic(Linearised(orbit, halvings), multiplier, part, pair)
                 for halvings in (0, 1)]
    except (NoOrbit, np.linalg.LinAlgError, RuntimeError) as error:
        return OrbitNormalForm(complex('nan'), str(error))
    if abs(found[1].real - found[0].real) > SAME * abs(found[1].real):
        return OrbitNormalForm(found[1], f'c is {found[0]:.3g} or {found[1]:.3g}, by the mesh')
    return OrbitNormalForm(found[1])


def loses_stability(orbit: Orbit) -> bool:
    """Whether nothing else grows where a multiplier of an orbit crosses the unit circle."""
    known = multipliers(orbit)
    return bool((np.abs([*known.within, *known.transverse]) < GROWS).all())


def _undecided(orbit: Orbit, multiplier: complex, pair: bool) -> str:
    """Say what makes a normal form with one disturbance the wrong one, '' if nothing does."""
    known = multipliers(orbit)
    there = np.concatenate([known.within, known.transverse])
    if (np.abs(np.abs(there) - 1.0) < CRITICAL).sum() > 1 + pair:
        return 'other multipliers are on the unit circle, too'
    for power in (1, 2, 3, 4):
        if pair and abs(multiplier**power - 1.0) < RESONANT:
            return f'the resonance 1:{power} is near'
    return ''


def _conj(y: States) -> States:
    return y[0].conj(), None if y[1] is None else y[1].conj()


def _cubic(linear: Linearised, multiplier: complex, part: int, pair: bool) -> complex:
    """Return c on the mesh of a linearised network."""
    equation = linear.equation
    turn, guess = equation.critical(part, multiplier)
    turn = complex(turn / abs(turn)) if pair else complex(round(turn.real))
    if not pair and abs(turn) != 1.0:
        raise NoOrbit('two disturbances that symmetry makes alike are critical')
    alike = turn == 1.0
    along, guesses = equation.slope, [equation.along()]
    if alike:
        guesses.append(guess)
    found = linear.find(1.0, np.array(guesses))
    right = found[1] if alike else linear.find(turn, guess[None])[0]
    v = equation.values(right, np.zeros_like(along[0]), turn)
    size = np.abs(v[0]).max()
    v = v[0] / size, None if v[1] is None else v[1] / size

    # Sources have a part along the orbit and one along v; where both return unchanged, the left
    # null vectors tell them apart together.
    weights = np.array([linear.shares(1.0, linear.moved(y)) for y in ((along, v) if alike
                                                                      else (along,))]).T
    own = None if alike else linear.shares(turn, linear.moved(v))[0]

    def share(rates: np.ndarray) -> complex:
        """Return the part along v."""
        if own is None:
            return complex(np.linalg.solve(weights, linear.shares(1.0, rates))[1])
        return complex(linear.shares(turn, rates)[0] / own)

    other = _conj(v) if pair else v
    first = linear.second(v, other)
    if alike and abs(share(first)) > NOTHING * np.abs(first).max():
        raise NoOrbit('a branch crosses this one (transcritical)')
    a = complex(np.linalg.solve(weights, linear.shares(1.0, first))[0])
    mixed = linear.solve(first - a * linear.moved(along), 1.0)
    cubic = linear.third(v, v, other)
    if pair:
        double = linear.solve(linear.second(v, v), turn**2)
        terms = [linear.second(v, mixed), 0.5 * linear.second(other, double), 0.5 * cubic]
    else:
        # The term of second order is that of z^2 / 2, and a that of z^2.
        a *= 0.5
        terms = [0.5 * linear.second(v, mixed), cubic / 6.0]
    slope = equation.derivative(v, turn)
    terms += [-a * linear.moved(slope), -a * linear.second(v, linear.late(along))]
    parts = [share(term) for term in terms]
    if abs(sum(parts).real) <= NOTHING * max(map(abs, parts)):
        raise NoOrbit('its cubic term is 0')
    return complex(sum(parts))
