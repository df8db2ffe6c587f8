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

"""Fixed-step RK4 integration in C over a history of nodes, for real time and simulation.

A history is a ring of nodes: the state x and the slopes that arrive there (``before``) and leave
(``after``), which differ where parameters change. Delayed values come from the cubic Hermite
interpolant, so the method is of fourth order for any delay of at least one step.

In real time equations and steps are those of an export (field_source, ``c/network.c``) in float64.
Simulations have lanes (``c/lanes.c``): copies of the network with their own coefficients and
delays, which advance together in vector registers. The system's compiler makes libraries of both,
which are cached on disk.
"""

import ctypes
from functools import cache
import hashlib
from pathlib import Path
import platform

from cpg_ros.common.c_library import load
from cpg_ros.common.errors import InputError
from cpg_ros.dynamics.integration.c_text import FOLDER, part
from cpg_ros.networks import equations as generated
from cpg_ros.networks.equations import equations_of
from cpg_ros.networks.network import Network
import numpy as np

MAX_NODES = 2**15 - 1
#: Numbers of lanes for one trajectory and for several.
ONE_LANE, LANES = 1, 8
#: Options of the compiler for lanes: all vector registers of this machine. Every arm64 has the
#: same ones, which compilers use anyway; not all of those take an option for this machine.
NATIVE = ('-ffp-contract=fast', *['-march=native'] * (platform.machine() == 'x86_64'))


def _defines(**sizes: int) -> str:
    return '\n'.join(f'#define {name} {value}' for name, value in sizes.items())


def _sources(network: type[Network]) -> dict[str, str]:
    """Return the files of a network's kernel for real time, name -> text."""
    # sympy takes a third of a second to load, and is needed once for each set of equations.
    from cpg_ros.dynamics.integration.kernel_source import field_source
    equations = equations_of(network)
    field = field_source(equations, network.cells, each=True)
    defines = _defines(
        CPG_CELLS=network.cells, CPG_COMPONENTS=network.cells * network.variables,
        CPG_DRIVEN=field.driven, CPG_DRIVEN_ROOM=max(1, field.driven * network.cells))
    common, *rest = (part(f'{name}.c') for name in ('common', 'kernel_slopes', 'network',
                                                    'kernel'))
    return {'cpg.h': part('kernel.h', {'DEFINES': defines}),
            'cpg.c': ''.join([common, field.text, *rest])}


def _lane_sources(network: type[Network], lanes: int) -> dict[str, str]:
    """Return the file that steps some lanes, name -> text."""
    from cpg_ros.dynamics.integration.kernel_source import field_source
    field = field_source(equations_of(network), network.cells, lanes=lanes)
    cells = network.cells * lanes
    defines = _defines(
        LANES=lanes, CPG_CELLS=cells, CPG_COMPONENTS=cells * network.variables,
        CPG_DRIVEN=field.driven, CPG_DRIVEN_ROOM=max(1, field.driven * cells))
    return {'lanes.c': part('vector.c') + part('lanes.c', {'DEFINES': defines,
                                                           'FIELD': field.text})}


@cache
def version() -> str:
    """Return a digest of everything from which the C is generated, and of the processor."""
    processor = Path('/proc/cpuinfo')
    model = processor.read_text() if processor.exists() else ''
    flags = next((line for line in model.splitlines() if line.startswith('flags')), '')
    digest = hashlib.sha256((platform.machine() + flags).encode())
    for source in sorted(FOLDER.parent.rglob('*.[chp]*')):
        if source.suffix in ('.c', '.h', '.py'):
            digest.update(source.read_bytes())
    return digest.hexdigest()[:14]


def is_missing(network: type[Network]) -> bool:
    """Return whether a library of a network for one trajectory could be on disk, but is not."""
    folder = generated.folder(equations_of(network).key)
    return folder is not None and not all(
        (folder / f'{name}-{version()}.so').exists() for name in ('kernel', f'lanes{ONE_LANE}'))


@cache
def library_of(network: type[Network]) -> ctypes.CDLL:
    """Return the library that steps a kind of network in real time.

    Raises:
        NoCompiler: it is not in the cache, and there is no compiler, or it fails.

    """
    library = load(generated.folder(equations_of(network).key), f'kernel-{version()}',
                   lambda: _sources(network), f"the kernels of the network '{network.name}'")
    pointer, whole = ctypes.c_void_p, ctypes.c_int
    library.set_slope.argtypes = pointer, whole
    library.advance.argtypes = pointer, pointer, ctypes.c_double, pointer
    return library


class LaneBlock(ctypes.Structure):
    """The struct ``block`` of ``c/lanes.c``: some lanes, and addresses of their arrays."""

    _fields_ = [*((name, ctypes.c_void_p) for name in ('p', 'delay', 'basis', 'x', 'after',
                                                       'before')),
                ('gain', ctypes.c_double), ('step', ctypes.c_double),
                ('basis_rows', ctypes.c_int), ('nodes', ctypes.c_int)]


@cache
def lanes_of(network: type[Network], lanes: int) -> ctypes.CDLL:
    """Return the library that steps some lanes of a kind of network; errors as of library_of."""
    library = load(generated.folder(equations_of(network).key), f'lanes{lanes}-{version()}',
                   lambda: _lane_sources(network, lanes),
                   f"the kernels of the network '{network.name}'", NATIVE)
    block, pointer, whole = ctypes.POINTER(LaneBlock), ctypes.c_void_p, ctypes.c_int
    library.begin.argtypes = block, whole
    library.steps.argtypes = (block, whole, whole, pointer, whole, whole, whole, pointer, pointer)
    return library


@cache
def _track_of(components: int) -> type[ctypes.Structure]:
    """Return the struct cpg_track of ``c/kernel.h``."""
    pointer, real, short = ctypes.c_void_p, ctypes.c_double, ctypes.c_int16
    return type('Track', (ctypes.Structure,), {'_fields_': [
        ('p', pointer), ('gain', real), ('delay', real), ('step', real), ('ahead', real),
        ('x', pointer), ('slope', pointer), ('before', pointer), ('basis_rows', short),
        ('basis', pointer), ('gait', short), ('nodes', short), ('head', short),
        ('carry', real * components)]})


class Lane:
    """A network in real time, its symmetry lock and its history, as C takes them."""

    def __init__(self, network: Network, gain: float, basis: np.ndarray, step: float,
                 history: tuple[np.ndarray, np.ndarray, np.ndarray]) -> None:
        """Take a network.

        Args:
            network: parameters.
            gain: of the symmetry lock, 1/model time.
            basis: of the subspace that the lock leaves alone, shape (r, components).
            step: model time between the nodes of the history.
            history: states, and slopes after and before them, (nodes, components) each.

        Raises:
            InputError: the history has too many nodes.

        """
        nodes = len(history[0])
        if nodes > MAX_NODES:
            raise InputError(f'a history of {nodes} steps is too long for kernels in C: they have '
                             f'at most {MAX_NODES}')
        # The arrays are kept as long as their addresses.
        self._arrays = network.coefficients, basis, *history
        p, basis_address, *past = (array.ctypes.data for array in self._arrays)
        self._track = _track_of(network.components)(
            p, gain, network.delay / step, step, 0.0, *past, len(basis), basis_address, 0, nodes,
            0)
        self.pointer = ctypes.byref(self._track)
        self.address = ctypes.addressof(self._track)
