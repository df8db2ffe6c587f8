"""The Morris-Lecar cell: membrane potential v and the share w of open potassium channels.

``v' = -gCa m(v)(v - vCa) - gK w (v - vK) - gL (v - vL) + i``, ``w' = phi tau(v) (n(v) - w)``,
``m = (1 + tanh((v - v1)/v2))/2``, ``n = (1 + tanh((v - v3)/v4))/2`` and
``tau = (base + cosh((v - v3)/(2 v4)))/(base + 1)``: base 0 in Buono & Golubitsky 2001, section 6,
base 1 in Rashidi et al. 2016, eq. 2. All quantities are without dimension.
"""

from dataclasses import dataclass

import numpy as np

from cpg_ros.integration.jit import exp


@dataclass(frozen=True)
class Cell:
    """Constants of a cell; i and phi are the network's own, as some vary them by gait."""

    g_ca: float
    v_ca: float
    g_k: float
    v_k: float
    g_l: float
    v_l: float
    v1: float
    v2: float
    v3: float
    v4: float
    base: float

    def rates(self, v: np.ndarray, w: np.ndarray, i: float, phi: float
              ) -> tuple[np.ndarray, np.ndarray]:
        """Return v' and w' of uncoupled cells, shaped like v and w."""
        m = 0.5 * (1.0 + np.tanh((v - self.v1) / self.v2))
        n = 0.5 * (1.0 + np.tanh((v - self.v3) / self.v4))
        tau = (self.base + np.cosh((v - self.v3) / (2.0 * self.v4))) / (self.base + 1.0)
        return (-self.g_ca * m * (v - self.v_ca) - self.g_k * w * (v - self.v_k)
                - self.g_l * (v - self.v_l) + i, phi * tau * (n - w))

    def slopes(self, v: np.ndarray, w: np.ndarray, phi: float
               ) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Return the derivatives of v' by v and w, and of w' by v and w."""
        m_tanh, n_tanh = np.tanh((v - self.v1) / self.v2), np.tanh((v - self.v3) / self.v4)
        m, n = 0.5 * (1.0 + m_tanh), 0.5 * (1.0 + n_tanh)
        dm, dn = 0.5 * (1.0 - m_tanh**2) / self.v2, 0.5 * (1.0 - n_tanh**2) / self.v4
        half = (v - self.v3) / (2.0 * self.v4)
        tau = (self.base + np.cosh(half)) / (self.base + 1.0)
        dtau = np.sinh(half) / (2.0 * self.v4 * (self.base + 1.0))
        return (-self.g_ca * (dm * (v - self.v_ca) + m) - self.g_k * w - self.g_l,
                -self.g_k * (v - self.v_k), phi * (dtau * (n - w) + tau * dn), -phi * tau)

    def jacobian(self, v: np.ndarray, w: np.ndarray, phi: float) -> np.ndarray:
        """Return the slopes as a matrix of all v, then all w, shape (..., 2 cells, 2 cells)."""
        cells = v.shape[-1]
        matrix, i = np.zeros((*v.shape[:-1], 2 * cells, 2 * cells)), np.arange(cells)
        vv, vw, wv, ww = self.slopes(v, w, phi)
        matrix[..., i, i], matrix[..., i, i + cells] = vv, vw
        matrix[..., i + cells, i], matrix[..., i + cells, i + cells] = wv, ww
        return matrix


def compiled(decorate, cell: Cell):
    """Compile an uncoupled cell's rates with a numba decorator; the constants are built in."""
    g_ca, v_ca, g_k, v_k = cell.g_ca, cell.v_ca, cell.g_k, cell.v_k
    g_l, v_l, v1, v2 = cell.g_l, cell.v_l, cell.v1, cell.v2
    v3, v4, base = cell.v3, cell.v4, cell.base

    @decorate
    def rates(count, v, w, i, phi, scratch, dv, dw):
        """Fill v' and w' of many cells; i and phi have a value for each.

        One short loop for each step, because those are vectorised.
        """
        for k in range(count):
            scratch[k] = exp(-2.0 / v2 * (v[k] - v1))
        for k in range(count):
            dv[k] = (i[k] - g_ca / (1.0 + scratch[k]) * (v[k] - v_ca)
                     - g_k * w[k] * (v[k] - v_k) - g_l * (v[k] - v_l))
        for k in range(count):
            scratch[k] = exp((v[k] - v3) / (2.0 * v4))
        for k in range(count):
            inverse = 1.0 / scratch[k]
            square = inverse * inverse
            tau = (base + 0.5 * (scratch[k] + inverse)) / (base + 1.0)
            dw[k] = phi[k] * tau * (1.0 / (1.0 + square * square) - w[k])

    return rates
