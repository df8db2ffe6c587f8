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

"""The pattern's core in C: structs of ``c/host.h`` and functions of ``c/host.c``.

It consists of the parts of an export, compiled once for all robots and networks; each network has
a library of its own (integration.c_kernel). Arrays here own all memory. The functions hold the
interpreter's lock for microseconds, as other threads write what they read.
"""

import ctypes
from functools import cache
from typing import Any

from cpg_ros.common.c_library import load
from cpg_ros.dynamics.integration.c_kernel import lanes_of, library_of, ONE_LANE, version
from cpg_ros.dynamics.integration.c_text import part
from cpg_ros.dynamics.integration.stepper import Stepper
from cpg_ros.dynamics.mesh.collocation import solver
from cpg_ros.networks import equations as generated
from cpg_ros.networks.registry import find_network, NETWORKS
import numpy as np

#: MAX_TRACKS: most gaits that fade into one another at once; a further one waits for a place.
MAX_TRACKS = 4
#: HOLD_TIME: time of an unchanged command after which a joint counts as at rest, s.
HOLD_TIME = 0.1
#: TABLE_SIZE: number of entries of a waveform's tables over one cycle.
TABLE_SIZE = 512

_DOUBLE, _INT, _POINTER = ctypes.c_double, ctypes.c_int32, ctypes.c_void_p


def _struct(name: str, *fields: tuple[Any, str]) -> type[ctypes.Structure]:
    """Return a struct, from pairs of a type and its fields' names."""
    return type(name, (ctypes.Structure,), {'_fields_': [
        (field, kind) for kind, names in fields for field in names.split()]})


Gait = _struct(
    'Gait', (_DOUBLE, 'frequency period start peak least'),
    (_INT, 'components cells joints legs points harmonics by_phase'),
    (_POINTER, 'joint_cell joint_leg leg_cell wave phase shift speed weights in_place maps '
               'waves shapes circles terms crests values phase_offset phase_offset_slope '
               'cycle'))
Net = _struct('Net', (_POINTER, 'lane clock now x slope before'), (ctypes.c_int64, 'size'))
Track = _struct(
    'Track', (_POINTER, 'gait advance'), (Net, 'net home seed'),
    (_DOUBLE, 'transition progress phase phase_carry settling calm still astray distance sum'),
    (_POINTER, 'angle d_angle_d_phase reach legs'), (_POINTER * 6, 'clocks'), (_POINTER, 'stride'))
Smoother = _struct('Smoother', (_POINTER, 'now rate target trim'), (_INT, 'legs at_once'))
Body = _struct('Body', (Smoother, 'pose'), (_DOUBLE, 'pace'), (_POINTER, 'rate joints limbs'),
               (_INT, 'legs moving'))
_RampPart = _struct('RampPart', (_DOUBLE, 'start rate end time'))
Ramp = _struct('Ramp', (_DOUBLE, 'level rate past'), (_RampPart, 'part'), (_DOUBLE, 'end time'),
               (ctypes.c_uint8, 'parts'))
Core = _struct(
    'Core', (_INT, 'joints tracks held ticks_held faults followed recovering jumped'),
    (_POINTER * MAX_TRACKS, 'track'), (_POINTER, 'strides body offset'),
    (_POINTER * 3, 'limits'),
    (_POINTER, 'found position velocity wanted rate last_rate goal correction jump jump_rate '
               'behind'), (Ramp, 'ramp approach'),
    (_DOUBLE, 'slowing slower frequency frequency_scale substep absorbed fraction stall '
              'stall_past stall_low'),
    (_POINTER, 'legs state'), (_DOUBLE, 'go'), (_POINTER, 'waiting'))

_FUNCTIONS: dict[str, tuple[Any, ...]] = {
    'cpg_advance': (_POINTER, _DOUBLE), 'cpg_plan': (_POINTER, _DOUBLE),
    'cpg_move': (_POINTER, _DOUBLE, ctypes.c_int), 'cpg_resume': (_POINTER, _DOUBLE),
    'cpg_ramp_to': (_POINTER, _DOUBLE, _DOUBLE), 'cpg_approach_stand': (_POINTER, _DOUBLE),
    'cpg_reach': (_POINTER, _DOUBLE), 'cpg_let_go': (_POINTER, _DOUBLE),
    'cpg_report': (_POINTER,) * 3,
    'cpg_feet': (_POINTER,) * 3, 'cpg_pose': (_POINTER, _POINTER, _POINTER, ctypes.c_int),
    'cpg_track_look': (_POINTER, _DOUBLE),
    'cpg_track_advance': (_POINTER, _DOUBLE), 'cpg_track_reseed': (_POINTER, _DOUBLE),
    'cpg_steer': (_POINTER, _DOUBLE),
    'cpg_confine': (ctypes.c_int, *[_POINTER] * 3, _DOUBLE, *[_POINTER] * 3)}


def _sources() -> dict[str, str]:
    """Return the core's files, name -> text."""
    defines = (f'#define CPG_TRACKS {MAX_TRACKS}\n#define CPG_ANGLES {TABLE_SIZE}\n'
               f'#define HOLD {HOLD_TIME!r}')
    names = ('host_watch', 'joints', 'waveform', 'host_phases', 'phase', 'steering', 'body',
             'host_track', 'pattern', 'host')
    # Both readouts stand in it.
    own = {'waveform': '#define look look_waveform\n', 'host_phases': '#undef look\n',
           'phase': '#define look look_phases\n'}
    return {'cpg.h': part('host.h', {'DEFINES': defines, 'RAMP': part('ramp.h')}),
            'cpg.c': part('common.c') + ''.join(own.get(name, '') + part(f'{name}.c')
                                                for name in names)}


@cache
def core() -> ctypes.CDLL:
    """Return the core's library, compiled if it is not in the cache.

    Raises:
        NoCompiler: compilation is needed, and there is no C compiler, or it fails.

    """
    loaded = load(generated.folder(), f'pattern-{version()}', _sources, 'the pattern')
    library = ctypes.PyDLL(loaded._name, handle=loaded._handle)
    for name, types in _FUNCTIONS.items():
        function = getattr(library, name)
        function.argtypes = types
        if name not in ('cpg_track_advance', 'cpg_confine'):
            function.restype = _DOUBLE if name == 'cpg_pose' else None
    return library


def precompile(name: str) -> None:
    """Compile or load the machine code of a network's generator; errors as of find_network.

    Args:
        name: as find_network takes it.

    """
    network = find_network(name)
    core()
    # A gait without a stored orbit is sought from an equilibrium, by higher derivatives.
    generated.equations_of(network).derive(higher=network in NETWORKS.files)
    library_of(network)
    lanes_of(network, ONE_LANE)
    if not network.delay_parameter:
        solver()


def confine(target: np.ndarray, wanted_rate: np.ndarray, limits: np.ndarray, dt: float,
            position: np.ndarray, velocity: np.ndarray, behind: np.ndarray) -> int:
    """Move joints to the wanted positions within their limits; return how many are held back.

    Where a limit acts, and where a joint catches up, velocity is the difference quotient.

    Args:
        target: positions, rad, shape (joints,).
        wanted_rate: their velocities, rad/s.
        limits: lowest and highest angle, rad, and largest speed, rad/s, shape (3, joints).
        dt: time since the last tick, s.
        position: of the last tick, rad; overwritten.
        velocity: overwritten, rad/s.
        behind: whether a limit held each joint back in the last tick; overwritten.

    """
    given = [np.ascontiguousarray(array, dtype=float) for array in (target, wanted_rate, limits)]
    held: int = core().cpg_confine(position.size, *(array.ctypes.data for array in given), dt,
                                   position.ctypes.data, velocity.ctypes.data, behind.ctypes.data)
    return held


class CGait:
    """A gait as the core takes it.

    Attributes:
        struct: numbers of the gait, and addresses of arrays that live as long as this object.

    """

    def __init__(self, **fields: Any) -> None:
        """Set fields of the struct: numbers, arrays of integers or floats, None for no array."""
        self.struct = Gait()
        self._arrays = []
        for name, value in fields.items():
            if isinstance(value, np.ndarray):
                kind = np.int16 if value.dtype.kind in 'iu' else float
                self._arrays.append(np.ascontiguousarray(value, dtype=kind))
                value = self._arrays[-1].ctypes.data
            setattr(self.struct, name, value)


class CTrack:
    """A running gait as the core takes it.

    Attributes:
        struct: numbers of the gait, and addresses of arrays that live as long as this object.
        angle, d_angle_d_phase, reach: of each joint: angle from the stand, rad; derivative by
            phase, rad per cycle; derivative by its leg's stride, rad.
        legs: phase of each leg, cycles.
        clocks: of each cell, shape (6, cells): phase (cycles), speed less 1 (cycles a stride) now
            and at the next look, amplitude, its rate (per stride) now and then.

    """

    def __init__(self, gait: CGait) -> None:
        """Allocate the arrays of a gait."""
        joints, legs, cells = gait.struct.joints, gait.struct.legs, gait.struct.cells
        self.struct = Track()
        self.angle, self.d_angle_d_phase, self.reach = motion = np.zeros((3, joints))
        self.legs, self.clocks = np.zeros(legs), np.zeros((6, cells))
        for name, array in (*zip(('angle', 'd_angle_d_phase', 'reach'), motion, strict=True),
                            ('legs', self.legs)):
            setattr(self.struct, name, array.ctypes.data)
        for k, row in enumerate(self.clocks):
            self.struct.clocks[k] = row.ctypes.data
        self.address = ctypes.addressof(self.struct)
        self._kept: dict[str, Any] = {}
        self.set_gait(gait)

    def set_gait(self, gait: CGait) -> None:
        """Read joints and legs by this gait."""
        self._kept['gait'] = gait
        self.struct.gait = ctypes.addressof(gait.struct)

    def run(self, which: str, stepper: Stepper) -> None:
        """Use a stepper's arrays as one of the struct's networks: net, home or seed."""
        lane = stepper.lane
        self._kept[which] = stepper, lane
        arrays = stepper.clock, stepper.now, *stepper.history
        setattr(self.struct, which, Net(lane.address, *(array.ctypes.data for array in arrays),
                                        stepper.history[0].size))
        self.struct.advance = ctypes.cast(
            library_of(type(stepper.network)).advance, _POINTER).value
