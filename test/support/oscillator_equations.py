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

"""The oscillators' equations, written anew in their papers' own variables.

Phase oscillators in polar coordinates (Ijspeert et al. 2007), Hopf oscillators with logistic
functions (Righetti & Ijspeert 2008), Matsuoka's neurons with max(0, u).
"""

import numpy as np

TURN = 2.0 * np.pi


def polar(network):
    """The equations of Ijspeert et al. 2007 for any number of legs, x = r cos(theta)."""
    offsets = np.array([getattr(network, name) for name in type(network).offsets.values()])

    def rates(t, state):
        x, y, s = state.reshape(3, -1)
        theta, r = np.arctan2(y, x), np.hypot(x, y)
        phi = TURN * (offsets[None] - offsets[:, None])
        pull = np.sin(theta[None] - theta[:, None] - phi) @ np.diag(r)
        turn = TURN * network.nu + network.w * pull.sum(axis=1)
        return np.concatenate([s * np.cos(theta) - turn * y, s * np.sin(theta) + turn * x,
                               network.a * (network.a / 4.0 * (network.r - r) - s)])
    return rates


def matrix(network):
    """k_ij of the legs, row i the leg that hears."""
    names = list(next(iter(network.legs.values())))
    return np.array([[0.0 if one == other else getattr(network, f'k_{other}_{one}')
                      for other in names] for one in names])


def logistic(network):
    """The equations of Righetti & Ijspeert 2008 without feedback."""
    k = matrix(network)
    stance, swing = (np.pi * network.nu / fraction for fraction in (network.duty,
                                                                    1.0 - network.duty))

    def rates(t, state):
        x, y = state.reshape(2, -1)
        omega = stance / (np.exp(-network.b * y) + 1.0) + swing / (np.exp(network.b * y) + 1.0)
        left = network.mu - x * x - y * y
        return np.concatenate([network.alpha * left * x - omega * y,
                               network.beta * left * y + omega * x + k @ y])
    return rates


def neurons(network):
    """Matsuoka's equations; flexors first, then extensors."""
    k = matrix(network)

    def rates(t, state):
        u, v = state.reshape(2, -1)
        y = np.maximum(0.0, u)
        flexor, extensor = y.reshape(2, -1)
        out = flexor - extensor
        rise = (network.c - u - network.beta * v - network.a * np.concatenate([extensor, flexor])
                + np.concatenate([k @ out, -(k @ out)]))
        return np.concatenate([rise / network.tau, (y - v) / network.tau_v])
    return rates
