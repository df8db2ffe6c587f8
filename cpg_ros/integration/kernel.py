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

"""The one integrator: fixed-step RK4 over a history of nodes, for real time and simulation.

A history is three arrays of shape (nodes, components), used as a ring: the state x at each
node and its slope on either side (``after`` for the interval that starts there, ``before`` for
the one that ends there). The two differ only where the right-hand side jumps: at the start of
a simulation and where parameters are changed. Delayed values come from the cubic Hermite
interpolant of their interval, so the method is of fourth order in the step for any delay of at
least one step.

Components are those of the network (cells, or cells times their variables) times lanes: several
copies of the network (lanes) with their own coefficients and delays advance together in vector
registers. In real time there is one lane. For networks without delay the ring only serves the
interpolation between nodes.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
import math
from types import FunctionType
from typing import Any

from cpg_ros.integration.jit import entry, jit, part, renamed
from cpg_ros.networks import generated
from cpg_ros.networks.equations import equations_of
from cpg_ros.networks.network import Network
from numba import prange
import numpy as np


def _field_code():
    # sympy takes a third of a second to load, and is needed once for each set of equations.
    from cpg_ros.integration import field_code
    return field_code


def _compiled(decorate, equations):
    """Compile the stepping of a network with a numba decorator.

    Args:
        decorate: numba's decorator.
        equations: of the network.

    Returns:
        The functions past_state, restart and steps_of.

    """
    def own(function):
        return decorate(renamed(function, equations.key))

    code = generated.load(f'{equations.key}_kernel',
                          lambda: _field_code().kernel_source(equations))
    drive, rates = code.compiled(own)
    delays = drive is not None
    driven_rows, work_rows, extra = max(code.DRIVEN, 1), max(code.WORK, 1), code.EXTRA + 1
    variables = len(equations.texts)

    @own
    def field(n, x, k, weight, driven, p, gain, basis, lanes, work, out):
        """Right-hand side at z = x + weight k, with the symmetry lock -gain (I - P) z.

        P projects on the rows of basis, shape (r, components); work is scratch, room for z and
        for what the rates need.
        """
        z, along = work[:n], work[n:]
        for i in range(n):
            z[i] = x[i] + weight * k[i]
        rates(n, z, driven, p, lanes, along, out)
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

    @own
    def past_state(n, x, after, before, head, c, tau, step, first, stride, out):
        """State at t_head + c step - tau, for tau >= c step, by the cubic Hermite interpolant.

        Only every stride-th component from first on is filled in.
        """
        back = tau / step - c
        nodes = max(1, math.ceil(back))
        start = head - nodes
        if start < 0:
            start += x.shape[0]
        end = start + 1 if start + 1 < x.shape[0] else 0
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
    def past_states(n, x, after, before, head, c, tau, step, out):
        """Return the same with a delay a lane, tau of shape (lanes,); one pass if all agree."""
        lanes = tau.shape[0]
        same = True
        for lane in range(1, lanes):
            same = same and tau[lane] == tau[0]
        if same:
            past_state(n, x, after, before, head, c, tau[0], step, 0, 1, out)
        else:
            for lane in range(lanes):
                past_state(n, x, after, before, head, c, tau[lane], step, lane, lanes, out)

    @own
    def steps_of(n, lanes, p, tau, gain, basis, step, x, after, before, head, steps, noise,
                 states, slopes, row, every):
        """Take RK4 steps from the head node; return the new head.

        ``noise`` is the standard deviation of white noise per square root of model time, added
        once a step (Euler-Maruyama); the caller seeds.
        """
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
                past_states(n, x, after, before, head, 0.5, tau, step, past)
                drive(n, past, p, lanes, work, middle)
                past_states(n, x, after, before, head, 1.0, tau, step, past)
                drive(n, past, p, lanes, work, end)
            field(n, now, k1, 0.5 * step, middle, p, gain, basis, lanes, work, k2)
            field(n, now, k2, 0.5 * step, middle, p, gain, basis, lanes, work, k3)
            field(n, now, k3, step, end, p, gain, basis, lanes, work, k4)
            for i in range(n):
                x[new, i] = now[i] + step / 6.0 * (k1[i] + 2.0 * (k2[i] + k3[i]) + k4[i])
            if noise > 0.0:
                for i in range(n):
                    x[new, i] += kick * np.random.normal()
            field(n, x[new], k4, 0.0, end, p, gain, basis, lanes, work, after[new])
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
    def restart(n, lanes, p, tau, gain, basis, step, x, after, before, head):
        """Recompute the slope that leaves the head node, after parameters have changed."""
        past, driven = np.empty(n), np.zeros(driven_rows * n // variables)
        work = np.zeros(n + work_rows * n // variables + extra * lanes)
        if delays:
            past_states(n, x, after, before, head, 0.0, tau, step, past)
            drive(n, past, p, lanes, work, driven)
        field(n, x[head], x[head], 0.0, driven, p, gain, basis, lanes, work, after[head])

    return past_state, restart, steps_of


# Stand-ins for the functions of a network, which ``_with`` puts in their place.
_past_state: Any = None
_restart: Any = None
_steps: Any = None
_steps_of_one: Any = None


def _with(function, names):
    """Copy a function that is to use other functions instead of its module's of these names.

    numba keys its disk cache on closed-over values, and a compiled function is another value in
    every process; what a function finds among its globals does not count.
    """
    copy = FunctionType(function.__code__, {**globals(), **names}, function.__name__,
                        function.__defaults__, function.__closure__)
    copy.__qualname__, copy.__doc__ = function.__qualname__, function.__doc__
    return copy


def _cached(digest, network, components, **functions):
    """Build a network's cached entry points; see sources_digest for why they are closures.

    Args:
        digest: of the sources, for the cache.
        network: its name.
        components: length of its state.
        functions: its _past_state, _restart, _steps and _steps_of_one.

    """

    def set_slope(p, tau, gain, basis, step, x, after, before, head):
        """Recompute the slope that leaves the head node, after parameters have changed."""
        digest  # noqa: B018
        _restart(x.shape[1], tau.shape[0], p, tau, gain, basis, step, x, after, before, head)

    def advance(p, tau, gain, basis, step, x, after, before, clock, duration, out):
        """Advance the output instant of one lane by duration and evaluate there.

        clock is (head, ahead): the newest node and its distance beyond the output instant, in
        [0, step). out receives x, x', x'' at that instant, shape (3, components).
        """
        digest  # noqa: B018
        head = int(clock[0])
        ahead = clock[1] - duration
        if ahead < 0.0:
            steps = math.ceil(-ahead / step)
            nothing = np.empty((0, 0, 0))
            # Not the unrolled code: it gains nothing here and takes 15 s more to compile.
            head = _steps(x.shape[1], tau.shape[0], p, tau, gain, basis, step, x,
                          after, before, head, steps, 0.0, nothing, nothing,
                          np.int64(0), np.int64(1))
            ahead = max(0.0, ahead + steps * step)
        clock[0] = head
        clock[1] = ahead
        start = head - 1 if head > 0 else x.shape[0] - 1
        s = 1.0 - ahead / step
        _past_state(x.shape[1], x, after, before, head, 0.0, ahead, step, 0, 1, out[0])
        for i in range(x.shape[1]):
            rise = (x[head, i] - x[start, i]) / step
            out[1, i] = ((1.0 - s) * (1.0 - 3.0 * s) * after[start, i]
                         + 6.0 * s * (1.0 - s) * rise + s * (3.0 * s - 2.0) * before[head, i])
            out[2, i] = ((6.0 * s - 4.0) * after[start, i] + 6.0 * (1.0 - 2.0 * s) * rise
                         + (6.0 * s - 2.0) * before[head, i]) / step

    def integrate_one(p, tau, gain, basis, step, x, after, before, head, steps, noise,
                      seed, states, slopes, row, every):
        """Return what integrate does for a single trajectory, in one piece, loops unrolled."""
        digest  # noqa: B018
        np.random.seed(seed)
        return _steps_of_one(components, 1, p, tau, gain, basis, step, x, after, before, head,
                             steps, noise, states, slopes, row, every)

    def integrate(p, tau, gain, basis, step, x, after, before, head, steps, noise, seed,
                  states, slopes, row, every):
        """Take steps of one block of lanes; return the new head.

        What is reached is recorded in states and slopes, shape (lanes, rows, components): every
        ``every``-th step, the first one here being number ``row``.
        """
        digest  # noqa: B018
        np.random.seed(seed)
        return _steps(x.shape[1], tau.shape[0], p, tau, gain, basis, step, x, after,
                      before, head, steps, noise, states, slopes, row, every)

    def integrate_many(p, tau, gain, basis, step, x, after, before, head, steps, noise,
                       seeds, states, slopes, row, every):
        """Take and record steps of many blocks on all cores; return the new head.

        Arrays have a leading axis, the block; states and slopes stay as they are.
        """
        digest  # noqa: B018
        lanes = tau.shape[1]
        for m in prange(x.shape[0]):
            np.random.seed(seeds[m])
            mine = slice(m * lanes, min((m + 1) * lanes, states.shape[0]))
            _steps(x.shape[2], lanes, p[m], tau[m], gain, basis, step, x[m],
                   after[m], before[m], head, steps, noise, states[mine], slopes[mine],
                   row, every)
        return (head + steps) % x.shape[1]

    def ready(function, parallel=False):
        mine = renamed(_with(function, functions), network)
        return entry(mine, parallel)

    return Kernels(ready(set_slope), ready(advance), ready(integrate_one), ready(integrate),
                   ready(integrate_many, parallel=True))


@dataclass(frozen=True)
class Kernels:
    """The compiled entry points of one kind of network; see _cached for what they do."""

    set_slope: Callable[..., None]
    advance: Callable[..., None]
    integrate_one: Callable[..., int]
    integrate: Callable[..., int]
    integrate_many: Callable[..., int]


@cache
def kernels(network: type[Network]) -> Kernels:
    """Return the compiled entry points of a kind of network, compiled when they are first used.

    A trajectory by itself has code of its own, built in one piece, its loops unrolled; lanes run
    through loops of any length in vector registers, which need functions of their own.
    """
    equations = equations_of(network)
    _, _, steps_of_one = _compiled(part, equations)
    past_state, restart, steps = _compiled(jit, equations)
    return _cached(generated.sources_digest(equations.key), equations.key,
                   network.cells * network.variables, _past_state=past_state, _restart=restart,
                   _steps=steps, _steps_of_one=steps_of_one)
