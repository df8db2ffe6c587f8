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

"""Fixed-step RK4 integration over a history of nodes, for real time and simulation.

A history is a ring of nodes: the state x and the slopes that arrive there (``before``) and leave
(``after``), which differ where parameters change. Delayed values come from the cubic Hermite
interpolant, so the method is of fourth order for any delay of at least one step.

Lanes are copies of the network with their own coefficients and delays, which advance together in
vector registers: an array has components times lanes numbers. In real time there is one lane.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
import math
from types import FunctionType
from typing import Any, NamedTuple

from cpg_ros.common.errors import needed
from cpg_ros.networks import equations as generated
from cpg_ros.networks.equations import equations_of
from cpg_ros.networks.network import Network
import numpy as np

# Arguments of the integrator's compiled functions: a network, its history, its samples.

class System(NamedTuple):
    """The network that is integrated, and its symmetry lock.

    Attributes:
        p: coefficients, a row for each parameter of the equations, shape (rows, cells * lanes).
        tau: delay of each lane in model time, shape (lanes,).
        gain: of the symmetry lock, 1/model time.
        basis: of the subspace that the lock leaves alone, shape (r, components).

    """

    p: np.ndarray
    tau: np.ndarray
    gain: float
    basis: np.ndarray


class Ring(NamedTuple):
    """A history, step apart in model time, used as a ring.

    Attributes:
        step: model time between nodes.
        x: states at the nodes, shape (nodes, components * lanes).
        after: slopes that leave the nodes, the same shape.
        before: slopes that arrive at the nodes, the same shape.

    """

    step: float
    x: np.ndarray
    after: np.ndarray
    before: np.ndarray


class Samples(NamedTuple):
    """Buffers for the recorded steps.

    Attributes:
        every: number of steps from one recorded step to the next.
        states: at the steps kept, shape (lanes, rows, components).
        slopes: there, the same shape.

    """

    every: int
    states: np.ndarray
    slopes: np.ndarray


def _field_code():
    # sympy takes a third of a second to load, and is needed once for each set of equations.
    from cpg_ros.dynamics.integration import kernel_source
    return kernel_source


class _Sizes(NamedTuple):
    """Sizes of a network's arrays: components, and rows of m = n / variables, or of lanes."""

    components: int
    variables: int
    driven: int
    work: int
    extra: int


def _field(own, rates, components):
    """Return the right-hand side of a network, compiled by ``own``, from its rates."""
    @own
    def field(n, system, driven, x, weight, k, work, out):
        """Return the right-hand side at z = x + weight k, with the symmetry lock -gain (I - P) z.

        P projects on the rows of the basis; ``work`` is scratch memory for z and the rates.
        """
        lanes, basis, gain = n // components, system.basis, system.gain
        z, along = work[:n], work[n:]
        for i in range(n):
            z[i] = x[i] + weight * k[i]
        rates(n, z, driven, system.p, lanes, along, out)
        if gain != 0.0:
            for i in range(n):
                out[i] -= gain * z[i]
            for r in range(basis.shape[0]):
                if lanes == 1:
                    sum_ = 0.0
                    for cell in range(basis.shape[1]):
                        sum_ += basis[r, cell] * z[cell]
                    for cell in range(basis.shape[1]):
                        out[cell] += gain * sum_ * basis[r, cell]
                else:
                    along[:lanes] = 0.0
                    for cell in range(basis.shape[1]):
                        for lane in range(lanes):
                            along[lane] += basis[r, cell] * z[cell * lanes + lane]
                    for cell in range(basis.shape[1]):
                        for lane in range(lanes):
                            out[cell * lanes + lane] += gain * along[lane] * basis[r, cell]
    return field


def _past(own):
    """Return the interpolation of the delayed states of all lanes, compiled by ``own``."""
    @own
    def past_state(n, ring, head, back, first, stride, out):
        """Fill every stride-th component of the state ``back`` steps before the head node."""
        step, x, after, before = ring
        nodes = max(1, math.ceil(back))
        start = head - nodes
        if start < 0:
            start += x.shape[0]
        end = start + 1 if start + 1 < x.shape[0] else 0
        # The cubic Hermite interpolant.
        s = nodes - back
        h11 = s * s * (s - 1.0) * step
        h10 = s * (s - 1.0) * (s - 1.0) * step
        h01 = s * s * (3.0 - 2.0 * s)
        h00 = 1.0 - h01
        if stride == 1:
            for i in range(n):
                out[i] = (h00 * x[start, i] + h10 * after[start, i]
                          + h01 * x[end, i] + h11 * before[end, i])
        else:
            for i in range(first, n, stride):
                out[i] = (h00 * x[start, i] + h10 * after[start, i]
                          + h01 * x[end, i] + h11 * before[end, i])

    @own
    def past_states(n, tau, ring, head, c, out):
        """Return the state at t_head + c step - tau, tau (lanes,); one pass if all are equal."""
        lanes, step = tau.shape[0], ring.step
        same = True
        for lane in range(1, lanes):
            same = same and tau[lane] == tau[0]
        if same:
            past_state(n, ring, head, tau[0] / step - c, 0, 1, out)
        else:
            for lane in range(lanes):
                past_state(n, ring, head, tau[lane] / step - c, lane, lanes, out)
    return past_states


def _stepping(own, field, past_states, drive, sizes):
    """Return restart and steps_of, compiled by ``own``; drive is None without a delay."""
    delays = drive is not None
    components, variables, driven_rows, work_rows, extra = sizes

    @own
    def steps_of(system, ring, head, steps, noise, record, row):
        """Take RK4 steps from the head node; return the new head.

        ``noise`` is the standard deviation of white noise per square root of model time, added
        once a step (Euler-Maruyama); the caller seeds it. ``row`` is the number of the first step.
        """
        step, x, after, before = ring
        every, states, slopes = record
        n = x.shape[1]
        lanes = n // components
        past = np.empty(n)
        middle = np.zeros(driven_rows * n // variables)
        end = np.zeros(driven_rows * n // variables)
        work = np.zeros(n + work_rows * n // variables + extra * lanes)
        k2, k3, k4 = np.empty(n), np.empty(n), np.empty(n)
        kick = noise * math.sqrt(step)
        for _ in range(steps):
            new = head + 1 if head + 1 < x.shape[0] else 0
            now, k1 = x[head], after[head]
            # Stages 2 and 3 share one delayed state, stage 4 and the next step's first another.
            if delays:
                past_states(n, system.tau, ring, head, 0.5, past)
                drive(n, past, system.p, lanes, work, middle)
                past_states(n, system.tau, ring, head, 1.0, past)
                drive(n, past, system.p, lanes, work, end)
            field(n, system, middle, now, 0.5 * step, k1, work, k2)
            field(n, system, middle, now, 0.5 * step, k2, work, k3)
            field(n, system, end, now, step, k3, work, k4)
            for i in range(n):
                x[new, i] = now[i] + step / 6.0 * (k1[i] + 2.0 * (k2[i] + k3[i]) + k4[i])
            if noise > 0.0:
                for i in range(n):
                    x[new, i] += kick * np.random.normal()
            field(n, system, end, x[new], 0.0, k4, work, after[new])
            for i in range(n):
                before[new, i] = after[new, i]
            if row % every == 0:
                for lane in range(states.shape[0]):
                    for i in range(states.shape[2]):
                        states[lane, row // every, i] = x[new, i * lanes + lane]
                        slopes[lane, row // every, i] = after[new, i * lanes + lane]
            row += 1
            head = new
        return head

    @own
    def restart(system, ring, head):
        """Recompute the slope that leaves the head node, after parameters have changed."""
        n = ring.x.shape[1]
        lanes = n // components
        past, driven = np.empty(n), np.zeros(driven_rows * n // variables)
        work = np.zeros(n + work_rows * n // variables + extra * lanes)
        if delays:
            past_states(n, system.tau, ring, head, 0.0, past)
            drive(n, past, system.p, lanes, work, driven)
        field(n, system, driven, ring.x[head], 0.0, ring.x[head], work, ring.after[head])
    return restart, steps_of


def _compiled(numba, network):
    """Return restart and steps_of of a network, compiled by the module machine_code."""
    equations = equations_of(network)

    def own(function):
        return numba.jit(numba.renamed(function, equations.key))

    code = generated.load(equations.key, 'kernel',
                          lambda: _field_code().kernel_source(equations))
    drive, rates = code.compiled(own)
    components = network.cells * network.variables
    sizes = _Sizes(components, network.variables, max(code.DRIVEN, 1), max(code.WORK, 1),
                   code.EXTRA + 1)
    return _stepping(own, _field(own, rates, components), _past(own), drive, sizes)


# Names that the entry points below use; ``numba_kernels`` replaces them.
prange: Any = range
_restart: Any = None
_steps: Any = None


def set_slope(system, ring, head):
    """Recompute the slope that leaves the head node, after parameters have changed."""
    _restart(system, ring, head)


def integrate(system, ring, head, steps, noise, seed, record, row):
    """Take steps of one block of lanes, the first with number ``row``; return the new head."""
    np.random.seed(seed)
    return _steps(system, ring, head, steps, noise, record, row)


def integrate_many(system, ring, head, steps, noise, seeds, record, row):
    """Take and record steps of many blocks on all cores; return the new head.

    Arrays of coefficients, delays, states and slopes have a leading axis, the block; the record
    has one for all lanes.
    """
    p, tau, gain, basis = system
    step, x, after, before = ring
    every, states, slopes = record
    lanes = tau.shape[1]
    for m in prange(x.shape[0]):
        np.random.seed(seeds[m])
        mine = slice(m * lanes, min((m + 1) * lanes, states.shape[0]))
        _steps(System(p[m], tau[m], gain, basis), Ring(step, x[m], after[m], before[m]), head,
               steps, noise, Samples(every, states[mine], slopes[mine]), row)
    return (head + steps) % x.shape[1]


@dataclass(frozen=True)
class Kernels:
    """The entry points above, compiled for one kind of network.

    They do not check types: arrays must be C-contiguous floats, and times, gains and noise floats.
    """

    set_slope: Callable[..., None]
    integrate: Callable[..., int]
    integrate_many: Callable[..., int]


@cache
def numba_kernels(network: type[Network]) -> Kernels:
    """Return the entry points of a kind of network, compiled on first use.

    Raises:
        MissingLibraryError: numba is not installed.

    """
    needed('numba')
    # What steps in C alone does not load numba.
    from cpg_ros.dynamics.integration import machine_code as numba
    restart, steps = _compiled(numba, network)
    names = {'prange': numba.prange, '_restart': restart, '_steps': steps}
    key = equations_of(network).key

    def of_network(function, **options):
        """Compile a copy of an entry point with the network's functions as its globals.

        numba keys its cache on closed-over values, and a compiled function differs in every
        process.
        """
        copy = FunctionType(function.__code__, {**globals(), **names}, function.__name__)
        copy.__doc__ = function.__doc__
        return numba.bound_by_first_call(numba.cached_on_disk(
            numba.renamed(copy, key), generated.folder(key), **options))

    return Kernels(of_network(set_slope), of_network(integrate),
                   of_network(integrate_many, parallel=True))
