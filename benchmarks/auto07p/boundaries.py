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


"""Run by autox: boundaries of the quadruped's gait over alpha=beta and xi in AUTO-07p.

Usage: autox boundaries.py LOW,HIGH LOWEST,HIGHEST VALUE,... A,B,C,D,E,F START REST DATA=XI...,
where the ranges are those of alpha=beta and xi, VALUEs those of xi at which points of the curves
of Hopf points and folds are wanted, A to F alpha, beta, gamma, delta, xi and eta, REST the
equilibrium at the lower end of alpha=beta, and DATA names files of the orbit at START and each XI,
of which the first is where curves begin. Torus points are located on the branches of all of them.
"""

import sys

sys.path.insert(0, '/usr/lib/auto-07p/python')
from auto import run  # noqa: E402

ends, limits, wanted, couplings, start, rest, *data = sys.argv[1:]
(low, high), (lowest, highest) = ([float(one) for one in both.split(',')]
                                  for both in (ends, limits))
PAR = dict(enumerate(map(float, couplings.split(',')), 1)) | {7: float(start), 8: 1}
COMMON = {
    'NDIM': 16, 'IRS': 0, 'IAD': 3, 'IPLT': 0, 'NBC': 0, 'NINT': 0, 'NPR': 1000, 'MXBF': 0,
    'IID': 2, 'ITMX': 9, 'ITNW': 9, 'NWTN': 3, 'JAC': 1, 'EPSL': 1e-9, 'EPSU': 1e-9,
    'EPSS': 1e-9, 'NTST': 100, 'NCOL': 4, 'DSMIN': 1e-7, 'IADS': 1, 'NPAR': 12,
    'THL': {11: 0.0}, 'SP': [], 'RL0': low, 'RL1': high}


def told(kind, found, label, xi=None):
    """Print where the points with a label lie."""
    for point in found(label):
        print('RESULT', kind, repr(float(point['PAR(5)'] if xi is None else xi)),
              repr(float(point['PAR(7)'])), flush=True)


def branch_of(file, xi, ds):
    """Follow the orbits of a file along alpha=beta."""
    return run(e='quad', dat=file, PAR={**PAR, 5: xi}, IPS=2, ILP=1, ISP=2, ISW=1, ICP=[7, 11],
               NMX=60, DS=ds, DSMAX=0.1, **COMMON)


def curve(kind, point):
    """Follow a point both ways in two parameters, and tell of the values wanted."""
    for way in (-1e-3, 1e-3):
        settings = {'ISW': 2, 'ICP': [5, 7] if kind == 'HB' else [5, 7, 11], 'ILP': 0, 'ISP': 0,
                    'DS': way, 'SP': [], 'RL0': lowest, 'RL1': highest}
        # A fold's null vector is made first; a Hopf point brings its own.
        first = point if kind == 'HB' else run(point, NMX=2, **settings)
        told(kind, run(first, NMX=80, DSMAX=0.01, **settings,
                       UZR={5: [float(one) for one in wanted.split(',')]}), 'UZ')


files = [(file, float(xi)) for file, xi in (one.split('=') for one in data)]
points = [branch_of(*files[0], ds) for ds in (-0.01, 0.01)]
told('TR', points[0], 'TR', files[0][1])
for file, xi in files[1:]:
    told('TR', branch_of(file, xi, -0.01), 'TR', xi)
points.append(run(e='quad', PAR={**PAR, 7: low}, U=dict(enumerate(map(float, rest.split(',')), 1)),
                  IPS=1, ILP=0, ISP=2, ISW=1, ICP=[7], NMX=200, DS=0.01, DSMAX=0.02, **COMMON))
for kind in ('HB', 'LP'):
    seen = set()
    for found in points:
        for point in found(kind):
            # A branch that goes through its Hopf point comes back over the same folds.
            value = round(point['PAR(7)'], 6)
            if value not in seen:
                seen.add(value)
                curve(kind, point)
