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

"""Hostile recordings: whether reading and recognising them ever ends in a traceback, or wrongly.

Of 192 seeded tables each is either refused in one line, or the gait and frequency found are those
that walked, or a warning says what speaks against them. And whether `confidence` is what it says:
how much of what is named with a confidence of 95 % is right.
"""

import argparse
from pathlib import Path
import tempfile
import traceback

from common import emit, log
from cpg_ros import read_recording
from cpg_ros.common.errors import CpgError
from cpg_ros.fitting.gaits.leg_names import legs_of
from cpg_ros.fitting.gaits.stride import find_stride, Stride
from cpg_ros.fitting.inversion.recording_fit import fit_recording
from cpg_ros.fitting.recordings.csv_reader import read_csv
from cpg_ros.fitting.recordings.joint_streams import Servo
from cpg_ros.motion.robot_file import load_robot
from cpg_ros.networks.library.delayed import Delayed
from hostile_recordings import SEED, spoiled, WAYS
import numpy as np
import yaml

FILES, GOAL = 8 * len(WAYS), 0.9


def outcome(number: int, folder: Path, seed: int = SEED) -> tuple[str, Stride | None, str]:
    """Return 'refused', 'right', 'warned', 'wrong' or 'traceback'; what was found; and words."""
    way, data, made = spoiled(number, seed)
    path = folder / f'{number}.csv'
    path.write_bytes(data)
    try:
        recording = read_csv(path, progress=False)
        found = find_stride(recording, legs_of(recording.joints), Delayed)
    except CpgError as error:
        return ('refused' if '\n' not in str(error) else 'wrong'), None, f'{way}: {error}'
    except Exception:
        return 'traceback', None, f'{way}: {traceback.format_exc()}'
    right = found.nearest == made.gait and abs(found.frequency / made.frequency - 1.0) < 0.03
    line = (f'{way}: {found.nearest} at {found.frequency:.4g} Hz, {found.confidence:.2f} sure, '
            f'where it was a {made.gait} at {made.frequency:.4g} Hz')
    # Hopping, turning and other units are no mistake of the gait's name, but must be reported.
    must_say = way in ('milliseconds', 'microseconds', 'degrees', 'on the spot', 'turn',
                       'slow change', 'another between')
    warned = bool(found.issues) and found.confidence < 0.95
    if right and not must_say:
        return 'right', found, line
    return ('warned' if warned else 'wrong'), found, line


def of_dataset(folder: Path) -> dict[str, object]:
    """Name the gaits of a set that record_dataset made, and compare with its truth."""
    tally = dict.fromkeys(('right', 'doubted', 'wrong', 'none'), 0)
    off, duties, wrong = [], [], []
    inside: dict[str, list[bool]] = {'angles': [], 'commands': []}
    for path in sorted(folder.glob('*/truth.yaml')):
        truth = yaml.safe_load(path.read_text())
        robot = load_robot(truth['robot'])
        try:
            recording = read_recording(path.with_name('bag'), progress=False)
            fit = fit_recording(recording, robot, truth['network'])
        except CpgError as error:
            tally['none'] += 1
            log(f'{path.parent.name}: {error}')
            continue
        right, sure = fit.stride.nearest == truth['gait'], fit.confidence >= 0.95
        tally['right' if right else 'wrong' if sure else 'doubted'] += 1
        if right:
            sent = read_recording(path.with_name('bag'), progress=False,
                                  servo=Servo(**truth['servo']))
            for kind, one in ('angles', fit), ('commands', fit_recording(
                    sent, robot, truth['network'], truth['gait'])):
                bounded = {name: number for name, number in one.fit.parameters.items()
                           if name in truth['parameters'] and number.bounded}
                inside[kind] += [number.low <= truth['parameters'][name] <= number.high
                                 for name, number in bounded.items()]
            off.append(abs(fit.stride.frequency / truth['frequency'] - 1.0))
            if fit.stride.contacts is not None:
                duties += [abs(fit.stride.contacts.duty[leg] - fraction)
                           for leg, fraction in truth['duty'].items()]
        elif sure:
            wrong.append(path.parent.name)
    return {**tally, 'sure_and_wrong': wrong, 'median_frequency_error': float(np.median(off)),
            'most_frequency_error': float(np.max(off)),
            'median_duty_error': float(np.median(duties)),
            'bounded_intervals': {kind: len(one) for kind, one in inside.items()},
            'with_the_truth': {kind: sum(one) for kind, one in inside.items()}}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--dataset', type=Path, help='of record_dataset: only this')
    parser.add_argument('--files', type=int, default=FILES)
    parser.add_argument('--seed', type=int, default=SEED)
    given = parser.parse_args()
    if given.dataset:
        found = of_dataset(given.dataset)
        emit(benchmark='recordings', dataset=given.dataset.name, **found,
             target='none sure and wrong', passed=not found['sure_and_wrong'])
        return
    tally = dict.fromkeys(('refused', 'right', 'warned', 'wrong', 'traceback'), 0)
    sure, bad = [], []
    with tempfile.TemporaryDirectory() as folder:
        for number in range(given.files):
            kind, found, line = outcome(number, Path(folder), given.seed)
            tally[kind] += 1
            if kind in ('wrong', 'traceback'):
                bad.append(line)
                log(line)
            if found is not None and found.confidence >= 0.95:
                sure.append(kind == 'right')
    fraction = sum(sure) / max(len(sure), 1)
    emit(benchmark='recordings', seed=given.seed, files=sum(tally.values()), **tally, bad=bad[:5],
         said_with_95_percent=len(sure), of_these_right=fraction, target=GOAL,
         passed=not tally['traceback'] and not tally['wrong'] and fraction >= GOAL)


if __name__ == '__main__':
    main()
