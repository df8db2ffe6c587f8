"""From cells to joints by the cells' phase: for relaxation oscillators.

A Morris-Lecar cell jumps: its potential crosses most of its range within a few per cent of a
stride, which no joint can follow. But the cell's two variables tell its phase at any instant, and
a joint can be a smooth function of that: x is the cell's waveform up to a few harmonics, y the
derivative of x by phase in radians. Phase is read as the angle in the plane of the two variables
about a centre that the orbit turns round steadily. A cell far inside its orbit, coming to rest or
changing gait, moves its joints less: both are scaled by ``1 - (1 - q)^3``, q the square of its
radius over the orbit's, at most 1; so joints depend smoothly on the state, and on the orbit not
on the radius at all.
"""

import math
from functools import lru_cache

import numpy as np
from numba import njit
from scipy.optimize import minimize

from cpg_ros.dynamics.periodic import Orbit
from cpg_ros.integration.jit import OPTIONS, sources_digest
from cpg_ros.motion.readout import TURN, NoPhase, monomials

#: Entries of the tables over the angle, and points of a cycle they are made from. On the plateaus
#: of the quadruped's trot and walk a cell hardly turns: there the phase hangs on the last digits.
TABLE, POINTS = 65536, 8192
#: A phase off by a quarter of this (cycles) counts as far off as a radius off by this share.
PHASE_SHARE = 4.0


def _cached(digest):
    """Build the cached entry point; see sources_digest for why it is a closure."""

    @njit(cache=True, **OPTIONS)
    def observe_phases(now, period, size, waves, phases, shape, tables, harmonics, crests, cells,
                       weights, leg_cells, turned, angle, rise, legs):
        """Read joints and legs off a network's state.

        Args:
            now: x, x', x'' of the components, shape (3, 2 size); x'' is not used.
            period: of the orbit, model time.
            size: cells of the network.
            waves: number of each cell's waveform, shape (size,).
            phases: phase of each cell in the gait, cycles, shape (size,).
            shape: centre and half range of both variables of each wave, shape (waves, 4).
            tables: phase minus angle (cycles), angular speed (cycles a cycle) and radius over
                the angle, shape (waves, TABLE, 3): a row is one place in memory.
            harmonics: cosine and sine terms of x, shape (waves, 1 + H, 2).
            crests: phase at which x peaks, shape (waves,).
            cells: the cell behind each joint, shape (joints,).
            weights: readout weights of each joint in rad, shape (joints, 6).
            leg_cells: the cell that gives each leg's phase.
            turned: scratch, phase, speed (cycles a cycle), scale of each cell and the scale's
                rate (per cycle), shape (4, size).
            angle: filled with the joints' deviation from their offset, rad.
            rise: filled with its derivative by phase, rad per cycle.
            legs: filled with the legs' phases in cycles, [0, 1), 0 where x peaks.

        Returns:
            The largest distance of a cell from where the gait has it, as a share of its radius.

        """
        digest  # noqa: B018
        distance, sum_ = 0.0, 0.0
        for cell in range(size):
            s, table = shape[waves[cell]], tables[waves[cell]]
            count = table.shape[0]
            x, y = (now[0, cell] - s[0]) / s[2], (now[0, size + cell] - s[1]) / s[3]
            dx, dy = now[1, cell] / s[2], now[1, size + cell] / s[3]
            square = x * x + y * y
            turn = math.atan2(y, x) / TURN
            # Linear between two rows; the comparison keeps NaN from becoming an index.
            place = (turn - math.floor(turn)) * count
            low = int(place) if place >= 0.0 else 0
            rest = place - low
            low = low if low < count else 0
            here, there = table[low], table[low + 1 if low + 1 < count else 0]
            turned[0, cell] = turn + here[0] + rest * (there[0] - here[0])
            turned[1, cell] = turned[2, cell] = turned[3, cell] = 0.0
            radius = here[2] + rest * (there[2] - here[2])
            if square > 1e-6:
                speed = (x * dy - y * dx) / square * period / TURN
                turned[1, cell] = speed / (here[1] + rest * (there[1] - here[1]))
                q = square / (radius * radius)
                if q < 1.0:
                    grows = (there[2] - here[2]) * count * speed
                    rate = 2.0 * q * ((x * dx + y * dy) * period / square - grows / radius)
                    turned[2, cell] = 1.0 - (1.0 - q)**3
                    turned[3, cell] = 3.0 * (1.0 - q) * (1.0 - q) * rate
                else:
                    turned[2, cell] = 1.0
            off = abs(math.sqrt(square) / radius - 1.0)
            distance = max(distance, off)
            sum_ += off
        base = turned[0, leg_cells[0]] - phases[leg_cells[0]]
        for cell in range(size):
            late = turned[0, cell] - base - phases[cell]
            distance = max(distance, PHASE_SHARE * abs(late - math.floor(late + 0.5)))
        for joint in range(cells.shape[0]):
            cell = cells[joint]
            terms = harmonics[waves[cell]]
            x, y, z = terms[0, 0], 0.0, 0.0
            c1, s1 = math.cos(TURN * turned[0, cell]), math.sin(TURN * turned[0, cell])
            c, s_ = 1.0, 0.0
            for k in range(1, terms.shape[0]):
                c, s_ = c * c1 - s_ * s1, s_ * c1 + c * s1
                along = terms[k, 0] * c + terms[k, 1] * s_
                across = terms[k, 1] * c - terms[k, 0] * s_
                x += along
                y += k * across
                z -= k * k * along
            speed, scale, rate = TURN * turned[1, cell], turned[2, cell], turned[3, cell]
            dx, dy = scale * y * speed + rate * x, scale * z * speed + rate * y
            x, y = scale * x, scale * y
            w = weights[joint]
            angle[joint] = (w[0] * x + w[1] * y + w[2] * x * x + w[3] * x * y
                            + (w[4] * x + w[5] * y) * x * x)
            rise[joint] = ((w[0] + 2.0 * w[2] * x + w[3] * y + 3.0 * w[4] * x * x
                            + 2.0 * w[5] * x * y) * dx
                           + (w[1] + w[3] * x + w[5] * x * x) * dy)
        for leg in range(leg_cells.shape[0]):
            phase = turned[0, leg_cells[leg]] - crests[waves[leg_cells[leg]]]
            phase -= math.floor(phase)
            legs[leg] = phase if phase < 1.0 else 0.0
        # Whatever max makes of a NaN: it comes through the sum.
        return distance + 0.0 * sum_

    return observe_phases


observe_phases = _cached(sources_digest())


def smooth_terms(values: np.ndarray, harmonics: int) -> np.ndarray:
    """Cosine and sine terms of a waveform's first harmonics, running from -1 to 1.

    Lanczos' factors sinc(k / (H + 1)) keep the sum from ringing.

    Args:
        values: on even points of a cycle, shape (m,).
        harmonics: H.

    Returns:
        An array of shape (1 + H, 2); row 0 is the constant.

    """
    terms = np.fft.rfft(values)[:harmonics + 1] * np.sinc(np.arange(harmonics + 1)
                                                          / (harmonics + 1))
    smooth = np.fft.irfft(terms, values.size)
    middle, half = 0.5 * (smooth.max() + smooth.min()), 0.5 * np.ptp(smooth)
    found = np.stack([terms.real, -terms.imag], axis=1) * (2.0 / values.size / half)
    found[0] = found[0, 0] / 2.0 - middle / half, 0.0
    return found


def evaluate(terms: np.ndarray, theta: np.ndarray, order: int = 0) -> np.ndarray:
    """x, or its derivative by phase in radians of order 1 or 2, at phases in cycles."""
    k = np.arange(terms.shape[0])
    complex_terms = (terms[:, 0] - 1j * terms[:, 1]) * (1j * k)**order
    return (np.exp(TURN * 1j * np.multiply.outer(theta, k)) @ complex_terms).real


def _centre(v: np.ndarray, w: np.ndarray, dv: np.ndarray, dw: np.ndarray) -> np.ndarray:
    """Find the centre about which a closed curve turns most steadily, shape (2,).

    Args:
        v: first coordinate of the curve on even points of a cycle, shape (m,).
        w: second one.
        dv: derivative of the first by phase.
        dw: derivative of the second.

    Raises:
        NoPhase: it turns back somewhere, whatever the centre.

    """
    def slowest(centre: np.ndarray) -> float:
        x, y = v - centre[0], w - centre[1]
        return -float(((x * dw - y * dv) / (x * x + y * y)).min())

    starts = [np.array([a, b]) for a in np.linspace(-0.8, 0.8, 9)
              for b in np.linspace(-0.8, 0.8, 9)]
    found = minimize(slowest, min(starts, key=slowest), method='Nelder-Mead',
                     options={'maxfev': 120, 'xatol': 1e-3})
    turns = np.unwrap(np.arctan2(w - found.x[1], v - found.x[0]))
    if found.fun >= 0.0 or not 0.9 * TURN < turns[-1] - turns[0] < TURN:
        raise NoPhase("its waveform does not turn steadily about any centre in the plane of "
                      "the cell's two variables, so that they do not tell its phase")
    return found.x


class PhaseMap:
    """How an orbit's cells tell their phase, and the smooth waveform that joints follow.

    Attributes:
        shape, tables, terms, crests: as observe_phases takes them (terms: harmonics).

    """

    def __init__(self, orbit: Orbit, harmonics: int) -> None:
        count = int(orbit.waves.max()) + 1
        theta, grid = np.arange(POINTS) / POINTS, np.arange(TABLE) / TABLE
        self.shape, self.tables = np.empty((count, 4)), np.empty((count, TABLE, 3))
        self.terms, self.crests = np.empty((count, 1 + harmonics, 2)), np.empty(count)
        for wave, ((v_mid, v_half), (w_mid, w_half)) in enumerate(orbit.levels):
            v, dv = ((orbit.waveform(theta, order, wave, 0) - (v_mid if order == 0 else 0.0))
                     / v_half for order in (0, 1))
            w, dw = ((orbit.waveform(theta, order, wave, 1) - (w_mid if order == 0 else 0.0))
                     / w_half for order in (0, 1))
            few = slice(None, None, POINTS // 1024)
            a, b = _centre(v[few], w[few], dv[few], dw[few])
            self.shape[wave] = v_mid + a * v_half, w_mid + b * w_half, v_half, w_half
            x, y = v - a, w - b
            angle = np.unwrap(np.arctan2(y, x)) / TURN
            # A cycle more on either side, so that the whole grid lies inside.
            first = math.floor(angle[0])
            angles = np.concatenate([angle - 1.0, angle, angle + 1.0]) - first
            late = np.concatenate([theta - 1.0, theta, theta + 1.0]) - angles
            speed = (x * dw - y * dv) / (x * x + y * y) / TURN
            for row, values in enumerate((late, np.tile(speed, 3), np.tile(np.hypot(x, y), 3))):
                self.tables[wave, :, row] = np.interp(grid, angles, values)
            self.terms[wave] = smooth_terms(v, harmonics)
            self.crests[wave] = _crest(self.terms[wave])


@lru_cache(maxsize=64)
def phase_map(orbit: Orbit, harmonics: int) -> PhaseMap:
    """Return an orbit's phase map, made once.

    Raises:
        NoPhase: a waveform does not tell the phase.

    """
    return PhaseMap(orbit, harmonics)


class PhaseReadout:
    """Joints driven by the phase of cells with two variables.

    Attributes:
        start: phase of the first leg at the orbit's phase 0, cycles.
        angles, rises: of the joints over a cycle, rad and rad per cycle, shape (joints, m).

    """

    def __init__(self, orbit: Orbit, cells: np.ndarray, weights: np.ndarray,
                 leg_cells: np.ndarray, harmonics: int) -> None:
        """Prepare for an orbit; arguments as in WaveReadout, and how many harmonics x has.

        Raises:
            NoPhase: a waveform does not tell the phase.

        """
        known = phase_map(orbit, harmonics)
        self._view = (orbit.period, orbit.network.cells, orbit.waves, orbit.phases, known.shape,
                      known.tables, known.terms, known.crests, cells, weights, leg_cells,
                      np.zeros((4, orbit.network.cells)))
        self.start = float((orbit.phases[leg_cells[0]]
                            - known.crests[orbit.waves[leg_cells[0]]]) % 1.0)
        theta = np.arange(512) / 512
        self.angles, self.rises = np.empty((2, len(cells), theta.size))
        for joint, cell in enumerate(cells):
            x, y, z = (evaluate(known.terms[orbit.waves[cell]], theta, order)
                       for order in range(3))
            values, slopes = monomials(x, y, z)
            self.angles[joint] = weights[joint] @ values
            self.rises[joint] = weights[joint] @ slopes

    def look(self, now: np.ndarray, angle: np.ndarray, rise: np.ndarray, legs: np.ndarray
             ) -> float:
        """Read joints and legs off a state; see observe_phases."""
        return observe_phases(now, *self._view, angle, rise, legs)


def _crest(terms: np.ndarray) -> float:
    """Phase at which x is largest, cycles, [0, 1)."""
    grid = np.arange(512) / 512
    place = float(grid[evaluate(terms, grid).argmax()])
    for _ in range(4):
        slope, bend = (float(evaluate(terms, np.array(place), order)) for order in (1, 2))
        place -= float(np.clip(slope / bend / TURN, -1 / 512, 1 / 512)) if bend else 0.0
    return place % 1.0
