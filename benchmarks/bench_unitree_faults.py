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

"""Every fault of the bridge's table many times against a stand-in robot: when it damps.

usage: bench_unitree_faults.py [--model go2|g1] [--times 20] [--only NAME] [--frequency 2]
                               [--patient]
"""

import argparse
import sys

from common import emit, log, ROOT
import numpy as np
from processes import enter_workspace

sys.path.append(str(ROOT / 'test' / 'support'))


def killed_together(walk, mend, kill, times: int) -> dict:
    """Kill bridge and watchdog a number of times; return what the robot sees from then on."""
    left, held = [], []
    for _ in range(2 * times):
        if len(left) == times:
            break
        try:
            walk.walking()
        except AssertionError as error:
            # The machine made it damp before.
            log(str(error).splitlines()[-1][-200:])
            continue
        sent, holds = kill(walk)
        left.append(sent)
        held.append(holds)
        mend(walk)
    return {'times': len(left), 'commands after 0.1 s': sum(left),
            'holds its last command': sum(held)}


def main() -> None:
    """Walk, break something, see what happens, mend it; a number of times."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--model', choices=('go2', 'g1'), default='go2',
                        help='a G1 hangs in a rack')
    parser.add_argument('--times', type=int, default=20)
    parser.add_argument('--only', default='', help='faults with this in their names')
    parser.add_argument('--frequency', type=float, default=2.0, help='of the trot, Hz')
    parser.add_argument('--patient', action='store_true', help='time limits for a busy machine')
    given = parser.parse_args()
    enter_workspace()
    from unitree_faults import bridge_and_watchdog_killed, FAULTS_OF, inflict, mend, Walk
    limits = ('state_timeout:=0.2', 'target_timeout:=0.3') if given.patient else ()
    found = {}
    for fault, (within, sitting) in FAULTS_OF[given.model].items():
        if given.only and given.only not in fault.__name__:
            continue
        rows, failures, restarts, walk = [], [], 0, None
        while len(rows) + len(failures) < given.times and restarts < given.times:
            if walk is None:
                walk = Walk(*limits, frequency=given.frequency, model=given.model)
            try:
                walk.walking()
            except AssertionError as error:
                # The machine made it damp before there was a fault.
                log((str(error).splitlines() or ['damped'])[-1][-200:])
                restarts += 1
                walk.end()
                walk = None
                continue
            try:
                damped, sat, torque, step, upright = inflict(walk, fault)
                rows.append((damped, sat[0] if sat else np.nan, torque, step,
                             bool(sat) == (sitting is not None), upright))
            except AssertionError as error:
                failures.append(str(error)[-300:])
            mend(walk)
        if walk is not None:
            walk.end()
        table = np.array(rows, dtype=float).reshape(-1, 6)
        found[fault.__name__] = {
            'times': len(rows), 'failed': len(failures), 'as promised': int(table[:, 4].sum()),
            'upright': int(table[:, 5].sum()), 'within': within,
            'in time': int((table[:, 0] <= within).sum()),
            'damped_s': [*map(float, np.percentile(table[:, 0], (50, 100)))] if rows else [],
            'sat_s': [float(np.nanmedian(table[:, 1])), float(np.nanmax(table[:, 1]))]
            if rows and sitting else [],
            'largest_torque_of_limit': float(table[:, 2].max(initial=0)),
            'largest_step_nm': float(table[:, 3].max(initial=0)), 'restarts': restarts}
        log(f'{fault.__name__}: {found[fault.__name__]}')
    if given.only in bridge_and_watchdog_killed.__name__:
        walk = Walk(*limits, frequency=given.frequency, model=given.model)
        try:
            found['bridge_and_watchdog_killed'] = killed_together(
                walk, mend, bridge_and_watchdog_killed, given.times)
            log(f"bridge_and_watchdog_killed: {found['bridge_and_watchdog_killed']}")
        finally:
            walk.end()
    emit(benchmark='unitree_faults', model=given.model, patient=given.patient,
         frequency=given.frequency, faults=found)


if __name__ == '__main__':
    main()
