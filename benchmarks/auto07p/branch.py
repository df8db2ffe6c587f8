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

"""Run by autox: a branch of the quadruped in AUTO-07p, both ways, and what it cost.

Usage: autox branch.py DATA END,END VALUE,VALUE A,B,C,D,E,F START, where DATA names a file of the
orbit at START, and A to F are alpha, beta, gamma, delta, xi and eta.
"""

import resource
import sys

sys.path.insert(0, '/usr/lib/auto-07p/python')
from auto import run  # noqa: E402

data, ends, values, couplings, start = sys.argv[1:6]
low, high = map(float, ends.split(','))
par = dict(enumerate(map(float, couplings.split(',')), 1))
par.update({7: float(start), 8: 1})
for ds in (-0.01, 0.01):
    before = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime
    found = run(e='quad', dat=data, PAR=par, NDIM=16, IPS=2, IRS=0, ILP=1, ICP=[7, 11], NTST=60,
                NCOL=4, IAD=3, ISP=2, ISW=1, IPLT=0, NBC=0, NINT=0, NMX=60, NPR=60, MXBF=0, IID=2,
                ITMX=9, ITNW=7, NWTN=3, JAC=1, EPSL=1e-9, EPSU=1e-9, EPSS=1e-7, DS=ds, DSMIN=1e-6,
                DSMAX=0.1, IADS=1, RL0=low, RL1=high, NPAR=12, THL={11: 0.0}, SP=[],
                UZR={7: [float(value) for value in values.split(',')]}, UZSTOP={})
    spent = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime - before
    branch = found[0]
    print('RESULT points', len(branch), spent)
    for number in branch.labels.getIndices():
        kind = next(iter(branch.labels.by_index[number]))
        print('RESULT', kind, repr(float(branch[number]['PAR(7)'])),
              repr(float(branch[number]['PERIOD'])))
