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

"""The joints and legs that the core reads off one state, for a readout of a gait."""

from cpg_ros.motion.core import CGait, core, CTrack
import numpy as np


def clocks_at(readout, phase):
    """Return the cells' clocks, shape (6, cells), where the gait has them at a phase in cycles."""
    phases = readout.fields()['phase']
    clocks = np.zeros((6, phases.size))
    clocks[0], clocks[3] = (phase + phases) % 1.0, 1.0
    return clocks


def look(readout, now, strides, clocks, angle, d_angle, legs):
    """Read joints and legs off a state so many strides after the last; return how far it is off.

    Clocks are advanced, angle, d_angle and legs filled.
    """
    gait = CGait(**readout.fields(), shift=np.zeros(angle.size), components=now.shape[1])
    track, now = CTrack(gait), np.ascontiguousarray(now, dtype=float)
    track.struct.net.now = now.ctypes.data
    track.clocks[:] = clocks
    core().cpg_track_look(track.address, strides)
    clocks[:], angle[:], legs[:] = track.clocks, track.angle, track.legs
    d_angle[:] = track.d_angle_d_phase
    return float(track.struct.distance)
