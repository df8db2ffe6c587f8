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

"""Walkers whose joint angles are known in closed form, and files of the markers on them."""

import numpy as np

#: Lengths of pelvis, thigh, shank and foot, m.
PELVIS, THIGH, SHANK, FOOT = 0.16, 0.45, 0.42, 0.20
#: Markers of Plug-in Gait on the legs.
LABELS = tuple(f'{side}{name}' for side in 'LR'
               for name in ('ASI', 'PSI', 'KNE', 'ANK', 'HEE', 'TOE'))


def angles(time, frequency=1.1):
    """Return hip flexion, knee flexion and dorsiflexion of the left and the right leg, rad.

    Shape (n, 6), in the order of the shipped file of segments.
    """
    columns = []
    for shift in (0.0, 0.5):
        phase = 2.0 * np.pi * (frequency * time + shift)
        columns += [0.2 + 0.4 * np.cos(phase), 0.5 + 0.4 * np.cos(phase - 1.9),
                    0.05 + 0.2 * np.cos(phase - 2.8)]
    return np.column_stack(columns)


def directions(flexions):
    """Return elevations of thigh, shank and foot of each leg: 0 hangs down, positive forward."""
    found = []
    for hip, knee, ankle in (flexions[:, :3].T, flexions[:, 3:].T):
        found += [hip, hip - knee, hip - knee + 0.5 * np.pi + ankle]
    return found


def places(flexions):
    """Return the markers' places, x forward, y left, z up, m, shape (n, 12, 3)."""
    found, count = {}, len(flexions)
    elevations = directions(flexions)

    def at(x, y, z):
        return np.column_stack(np.broadcast_arrays(x * np.ones(count), y, z))

    def along(elevation, length):
        return at(length * np.sin(elevation), 0.0, -length * np.cos(elevation))

    for side, sign, (thigh, shank, foot) in (('L', 1.0, elevations[:3]),
                                             ('R', -1.0, elevations[3:])):
        found[side + 'ASI'] = at(0.5 * PELVIS, sign * 0.12, 1.0)
        found[side + 'PSI'] = at(-0.5 * PELVIS, sign * 0.05, 1.0)
        hip = at(0.0, sign * 0.085, 1.0)
        # Markers stand off the plane of the leg, which the angles in that plane do not see.
        found[side + 'KNE'] = hip + along(thigh, THIGH) + [0.0, sign * 0.05, 0.0]
        found[side + 'ANK'] = found[side + 'KNE'] + along(shank, SHANK) - [0.0, sign * 0.01, 0.0]
        found[side + 'HEE'] = found[side + 'ANK'] + [-0.05, 0.0, -0.05]
        found[side + 'TOE'] = found[side + 'HEE'] + along(foot, FOOT)
    return np.stack([found[name] for name in LABELS], axis=1)


def rotation(axis, angle):
    """Return the matrix of a turn about an axis (Rodrigues), shape (3, 3)."""
    x, y, z = np.asarray(axis, float) / np.linalg.norm(axis)
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.eye(3) + np.sin(angle) * cross + (1.0 - np.cos(angle)) * cross @ cross


def trc(time, points, names=LABELS, frames=None):
    """Return the text of a TRC file, in mm; cells of nan are empty."""
    head = ['PathFileType\t4\t(X/Y/Z)\twalk.trc',
            'DataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits\tOrigDataRate\t'
            'OrigDataStartFrame\tOrigNumFrames',
            f'100\t100\t{frames or len(time)}\t{len(names)}\tmm\t100\t1\t{len(time)}',
            'Frame#\tTime\t' + '\t\t\t'.join(names) + '\t\t\t',
            '\t\t' + '\t'.join(f'{axis}{k + 1}' for k in range(len(names)) for axis in 'XYZ'), '']
    rows = ['\t'.join([str(k + 1), f'{when:.6f}', *('' if np.isnan(x) else f'{1000 * x:.9f}'
                                                   for x in row.ravel())])
            for k, (when, row) in enumerate(zip(time, points, strict=True))]
    return '\n'.join([*head, *rows, ''])


def deeplabcut(points, likelihoods, names, individual=''):
    """Return the text of a DeepLabCut table of pixels, x right and y down, shape (n, m, 2)."""
    heads = {'scorer': ['net'] * 3 * len(names),
             **({'individuals': [individual] * 3 * len(names)} if individual else {}),
             'bodyparts': [name for name in names for _ in range(3)],
             'coords': ['x', 'y', 'likelihood'] * len(names)}
    rows = np.concatenate([points, likelihoods[:, :, None]], axis=2).reshape(len(points), -1)
    return '\n'.join([*(','.join([key, *cells]) for key, cells in heads.items()),
                      *(f'{k},' + ','.join('' if np.isnan(x) else repr(float(x)) for x in row)
                        for k, row in enumerate(rows)), ''])
