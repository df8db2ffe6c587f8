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

"""Whom the simulation is compared with: jitcdde, and the same method written in C."""

import ctypes
from pathlib import Path
import subprocess
import time

from common import ROOT
from jitcdde import jitcdde, t, y
import numpy as np
import symengine

A, B, C, D, TAU = -4.5, 1.0, 6.5, -2.0, 0.4
END, OUTPUT = 20.0, 0.01
START = np.array((0.1, -0.1, 0.1, -0.1, -0.1, 0.1, -0.1, 0.1))
TIMES = OUTPUT * np.arange(1, round(END / OUTPUT) + 1)


class Jitcdde:
    """The delayed network in jitcdde, its C extension compiled here."""

    def __init__(self) -> None:
        squashed = [symengine.Symbol(f'squashed{i}') for i in range(8)]
        self._dde = jitcdde([A * y(i) + B * squashed[i] + D * squashed[i - 2]
                             + C * symengine.tanh(y(i ^ 1, t - TAU)) for i in range(8)],
                            helpers=[(s, symengine.tanh(y(i))) for i, s in enumerate(squashed)],
                            delays=[0.0, TAU], max_delay=TAU, verbose=False)
        began = time.perf_counter()
        self._dde.compile_C(simplify=False, verbose=False)
        self.compile_s = time.perf_counter() - began

    def adaptive(self, start: np.ndarray, rtol: float) -> np.ndarray:
        self._dde.purge_past()
        self._dde.constant_past(start, time=0.0)
        self._dde.set_integration_parameters(rtol=rtol, atol=1e-2 * rtol, first_step=OUTPUT)
        self._dde.step_on_discontinuities(propagations=1)
        # It gives no output on the way through the discontinuities; that is let pass.
        return np.array([self._dde.integrate(T) for T in TIMES if self._dde.t <= T])

    def fixed(self, start: np.ndarray, step: float) -> np.ndarray:
        self._dde.purge_past()
        self._dde.constant_past(start, time=0.0)
        self._dde.integrate_blindly(1e-9, 1e-9)
        return np.array([self._dde.integrate_blindly(T, step) for T in TIMES])


class InC:
    """rk4_peer.c, whichever of two usual sets of options makes it faster."""

    def __init__(self, folder: str, *options: str) -> None:
        library = Path(folder) / f'peer{len(options)}.so'
        subprocess.run(['gcc', '-O3', *options, '-shared', '-fPIC', '-o', library,
                        ROOT / 'benchmarks' / 'rk4_peer.c', '-lm'], check=True)
        pointer, long, real = ctypes.c_void_p, ctypes.c_long, ctypes.c_double
        self._run = ctypes.CDLL(str(library)).simulate
        self._run.argtypes = [pointer, real, real, pointer, long, long, *3 * [pointer]]
        self._run.restype = None

    def __call__(self, step: float) -> np.ndarray:
        steps, nodes = round(END / step), int(np.ceil(TAU / step)) + 2
        x, after, before = (np.empty((nodes + steps, 8)) for _ in range(3))
        p = np.array((A, B, C, D))
        self._run(p.ctypes.data, TAU, step, START.ctypes.data, nodes, steps, x.ctypes.data,
                  after.ctypes.data, before.ctypes.data)
        return x[nodes - 1:]
