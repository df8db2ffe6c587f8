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

"""The exported C as the kernels of a process, in place of numba's.

Equations and steps are those of an export (field_source, ``c/network.c``) in float64. The system's
compiler makes a library of them, which is cached on disk. Lanes are stepped one by one.
"""

from collections.abc import Iterator, Sequence
import ctypes
from functools import cache
import hashlib
import platform

from cpg_ros.common.c_library import load
from cpg_ros.common.errors import InputError
from cpg_ros.dynamics.integration.c_text import FOLDER, part
from cpg_ros.dynamics.integration.kernel import Kernels, Ring, Samples, System
from cpg_ros.networks import equations as generated
from cpg_ros.networks.equations import equations_of
from cpg_ros.networks.network import Network
import numpy as np

MOST_NODES = 2**15 - 1


def _sources(network: type[Network]) -> dict[str, str]:
    """Return the files of a network's kernel, name -> text."""
    # sympy takes a third of a second to load, and is needed once for each set of equations.
    from cpg_ros.dynamics.integration.kernel_source import field_source
    equations = equations_of(network)
    field = field_source(equations, network.cells, each=True)
    sizes = {'CPG_CELLS': network.cells, 'CPG_COMPONENTS': network.cells * network.variables,
             'CPG_DRIVEN': field.driven, 'CPG_DRIVEN_ROOM': max(1, field.driven * network.cells)}
    defines = '\n'.join(f'#define {name} {value}' for name, value in sizes.items())
    common, *rest = (part(f'{name}.c') for name in ('common', 'kernel_slopes', 'network',
                                                    'kernel'))
    return {'cpg.h': part('kernel.h', {'DEFINES': defines}),
            'cpg.c': ''.join([common, field.text, *rest])}


@cache
def version() -> str:
    """Return a digest of everything from which the C is generated."""
    digest = hashlib.sha256(platform.machine().encode())
    for source in sorted(FOLDER.parent.rglob('*.[chp]*')):
        if source.suffix in ('.c', '.h', '.py'):
            digest.update(source.read_bytes())
    return digest.hexdigest()[:14]


def is_missing(network: type[Network]) -> bool:
    """Return whether a network's library could be on disk, but is not."""
    folder = generated.folder(equations_of(network).key)
    return folder is not None and not (folder / f'kernel-{version()}.so').exists()


@cache
def library_of(network: type[Network]) -> ctypes.CDLL:
    """Return the library that steps a kind of network.

    Raises:
        NoCompiler: it is not in the cache, and there is no compiler, or it fails.

    """
    library = load(generated.folder(equations_of(network).key), f'kernel-{version()}',
                   lambda: _sources(network), f"the kernels of the network '{network.name}'")
    pointer, whole = ctypes.c_void_p, ctypes.c_int
    library.set_slope.argtypes = pointer, whole
    library.advance.argtypes = pointer, pointer, ctypes.c_double, pointer
    library.steps.argtypes = pointer, whole, whole, whole, whole, pointer, pointer
    return library


def _track_of(components: int) -> type[ctypes.Structure]:
    """Return the struct cpg_track of ``c/kernel.h``."""
    pointer, real, short = ctypes.c_void_p, ctypes.c_double, ctypes.c_int16
    return type('Track', (ctypes.Structure,), {'_fields_': [
        ('p', pointer), ('gain', real), ('delay', real), ('step', real), ('ahead', real),
        ('x', pointer), ('slope', pointer), ('before', pointer), ('basis_rows', short),
        ('basis', pointer), ('gait', short), ('nodes', short), ('head', short),
        ('carry', real * components)]})


class Lane:
    """A system with one lane and its history, as C takes them."""

    def __init__(self, kind: type[ctypes.Structure], system: System, ring: Ring) -> None:
        if len(ring.x) > MOST_NODES:
            raise InputError(f'a history of {len(ring.x)} steps is too long for kernels in C: '
                             f'they have at most {MOST_NODES}')
        # The arrays are kept as long as their addresses.
        self.system, self.ring = system, ring
        p, basis, x, after, before = (array.ctypes.data for array in (
            system.p, system.basis, ring.x, ring.after, ring.before))
        self._track = kind(p, system.gain, system.tau[0] / ring.step, ring.step, 0.0, x, after,
                           before, len(system.basis), basis, 0, len(ring.x), 0)
        self.pointer = ctypes.byref(self._track)
        self.address = ctypes.addressof(self._track)


def lane_of(network: type[Network], system: System, ring: Ring) -> Lane:
    """Return a system with one lane and its history for the functions of library_of."""
    return Lane(_track_of(network.cells * network.variables), system, ring)


def _split(system: System, ring: Ring, lanes: int) -> Iterator[tuple[System, Ring]]:
    """Yield each lane by itself, and copy changes of its history back."""
    for lane in range(lanes):
        arrays = [array[:, lane::lanes] for array in (ring.x, ring.after, ring.before)]
        own = [array.copy() for array in arrays]
        yield (System(system.p[:, lane::lanes].copy(), system.tau[lane:], system.gain,
                      system.basis), Ring(ring.step, *own))
        for array, changed in zip(arrays, own, strict=True):
            array[:] = changed


@cache
def c_kernels(network: type[Network]) -> Kernels:
    """Return a network's kernels in C, in place of numba's.

    Raises:
        NoCompiler: they are not in the cache, and there is no compiler, or it fails.

    """
    library, components = library_of(network), network.cells * network.variables
    kind = _track_of(components)

    def set_slope(system: System, ring: Ring, head: int) -> None:
        for lane_arrays in _split(system, ring, ring.x.shape[1] // components):
            library.set_slope(Lane(kind, *lane_arrays).pointer, head)

    def integrate(system: System, ring: Ring, head: int, steps: int, noise: float, seed: int,
                  record: Samples, row: int) -> int:
        if noise:
            raise InputError('noise needs numba: kernels in C have none')
        every, states, slopes = record
        spare, end = np.empty((2, *states.shape[1:])), head
        for lane, lane_arrays in enumerate(_split(system, ring, ring.x.shape[1] // components)):
            kept = (states[lane], slopes[lane]) if lane < len(states) else spare
            end = library.steps(Lane(kind, *lane_arrays).pointer, head, steps, every, row,
                                *(array.ctypes.data for array in kept))
        return end

    def integrate_many(system: System, ring: Ring, head: int, steps: int, noise: float,
                       seeds: Sequence[int], record: Samples, row: int) -> int:
        lanes, end = system.tau.shape[1], head
        for block, seed in enumerate(seeds):
            mine = slice(block * lanes, (block + 1) * lanes)
            end = integrate(
                System(system.p[block], system.tau[block], system.gain, system.basis),
                Ring(ring.step, ring.x[block], ring.after[block], ring.before[block]), head,
                steps, noise, seed, Samples(record.every, record.states[mine],
                                            record.slopes[mine]), row)
        return end

    return Kernels(set_slope, integrate, integrate_many)
