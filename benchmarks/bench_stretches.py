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

"""Public recordings of bodies that nothing was tuned for: what their steady stretches are called.

Below the folder that RECORDINGS names are clones of public repositories, which
docs/benchmarks_inversion.md lists; what is not there is left out. Each recording is cut into its
steady stretches, and each of these is named and fitted. What it truly is comes from feet, and not
from the joints' phases: from their heights by forward kinematics and the recorded pose of the
base, or from the recording's name where there is no pose. Nobody is right who names a stretch
wrongly and is 95 % sure.
"""

import argparse
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from itertools import chain, pairwise
import json
import os
from pathlib import Path

from common import emit, log, ROOT
from cpg_ros import read_recording
from cpg_ros.common.errors import CpgError
from cpg_ros.fitting.gaits.stride import NoSteadyGait
from cpg_ros.fitting.inversion.gait_schedule import cut, fit_stretches, StretchFit
from cpg_ros.fitting.inversion.recording_fit import leg_joints, network_of, stride_of
from cpg_ros.fitting.recordings.recording import Recording
from cpg_ros.networks.registry import find_network, with_legs_of
from cpg_ros.simulation.robot_model import find_model
import mujoco
import numpy as np

#: Orders of the readout that are compared.
ORDERS = (1, 2, 3)
#: Joints of a G1 in LAFAN1's order, 30 frames a second.
G1 = tuple(f'{side}_{joint}_joint' for side in ('left', 'right') for joint in (
    'hip_pitch', 'hip_roll', 'hip_yaw', 'knee', 'ankle_pitch', 'ankle_roll'))
#: Feet further above the lowest of all are in the air, m; shares of time in the air of a walk, and
#: of a run.
ABOVE, WALKS, RUNS = 0.03, 0.02, 0.1
#: Links of a retargeted dog's legs, and half of the distances between them, m: for the order of
#: footfalls they need not be exact.
LINK, AHEAD, ASIDE = 0.2, 0.2, 0.1
#: A foot is down in this part of its lift; feet that are lifted by less stand, m.
DOWN, STANDS = 0.3, 0.01
#: Touchdowns that scatter more (length of the mean vector of their phases) tell nothing, nor do
#: those between two gaits, whose distances differ by less, cycles.
AGREE, BETWEEN = 0.8, 0.05
#: By which phase RH, LF and RF touch down before LH.
GAITS = {'walk': (0.5, 0.75, 0.25), 'trot': (0.5, 0.5, 0.0), 'pace': (0.5, 0.0, 0.5),
         'bound': (0.0, 0.5, 0.5), 'pronk': (0.0, 0.0, 0.0)}


#: CLEAR: gaits that are to be named; BINS: bounds of confidence of the diagram.
CLEAR, BINS = ('walk', 'trot', 'run', 'pace', 'bound'), (0.0, 0.25, 0.45, 0.7, 0.9, 1.01)


@dataclass
class Clip:
    """A recording, heights of its feet, m, shape (n, legs), and what its name says it is."""

    body: str
    recording: Recording
    heights: np.ndarray | None = None
    legs: tuple[str, ...] = ()
    named: str = ''

    def truth(self, begin: float, end: float) -> str:
        """Return what it does between two times, s; '' if that is not clear."""
        if self.heights is None:
            return self.named
        times = self.recording.times
        z = self.heights[(times >= begin) & (times <= end)]
        if len(self.legs) == 2:
            air = np.mean(z.min(axis=1) > np.percentile(z, 5) + ABOVE)
            return 'walk' if air <= WALKS else 'run' if air >= RUNS else ''
        low, high = np.percentile(z, [5, 95], axis=0)
        if (high - low).max() < STANDS:
            return 'stands'
        down = z < low + DOWN * (high - low)
        touched = {leg: np.flatnonzero(down[1:, k] & ~down[:-1, k])
                   for k, leg in enumerate(self.legs)}
        found = [_phase(touched[leg], touched['HL']) for leg in ('HR', 'FL', 'FR')]
        if min(map(abs, found)) < AGREE:
            return self.named
        turns = np.angle(found) / (2.0 * np.pi)
        away = {gait: np.abs((turns - phases + 0.5) % 1.0 - 0.5).max()
                for gait, phases in GAITS.items()}
        first, second = sorted(away, key=lambda gait: away[gait])[:2]
        return first if away[second] - away[first] >= BETWEEN else ''


def _phase(touched: np.ndarray, first: np.ndarray) -> complex:
    """Return the mean of exp(2 pi i phase) of touchdowns, by their lead on the first leg's."""
    inside = touched[(touched >= first[0]) & (touched < first[-1])] if len(first) > 1 else []
    if len(inside) < 2:
        return 0.0
    k = np.searchsorted(first, inside, side='right') - 1
    return complex(np.exp(-2j * np.pi * (inside - first[k]) / np.diff(first)[k]).mean())


def humanoids(folder: Path) -> Iterator[Clip]:
    """Yield people's walks and runs, retargeted to a Unitree G1."""
    if not folder.is_dir():
        return
    model = mujoco.MjModel.from_xml_path(str(find_model('unitree_g1')))
    data = mujoco.MjData(model)
    bodies = [model.body(f'{side}_ankle_roll_link').id for side in ('left', 'right')]
    soles = [[geom for geom in range(model.ngeom) if model.geom_bodyid[geom] == body
              and model.geom_contype[geom]] for body in bodies]
    for path in sorted(folder.glob('[wrs]*_subject*.csv')):
        rows = np.loadtxt(path, delimiter=',')
        heights = np.empty((len(rows), 2))
        for row, height in zip(rows, heights, strict=True):
            data.qpos[:19] = *row[:3], row[6], *row[3:6], *row[7:19]
            mujoco.mj_kinematics(model, data)
            # Soles are capsules.
            half = np.abs(data.geom_xmat[:, 8]) * model.geom_size[:, 1] + model.geom_size[:, 0]
            height[:] = [(data.geom_xpos[geoms, 2] - half[geoms]).min() for geoms in soles]
        yield Clip('G1', Recording(G1, np.arange(len(rows)) / 30.0, rows[:, 7:19], path.stem,
                                   body=rows[:, :3]), heights, ('left', 'right'))


def dogs(paths: Iterable[Path], body: str) -> Iterator[Clip]:
    """Yield dogs' motion capture, retargeted to robots: pose of the base, angles of the legs."""
    for path in sorted(paths):
        made = json.loads(path.read_text())
        rows, legs = np.array(made['Frames']), made.get('LegOrder', ['FR', 'FL', 'HR', 'HL'])
        if made.get('LoopMode') == 'Wrap':
            # The way of one round is no matter here: six rounds of the joints.
            rows = np.tile(rows[:-1], (6, 1))
        x, y, z, w = rows[:, 3:7].T
        heights = np.empty((len(rows), 4))
        for k, leg in enumerate(legs):
            hip, thigh, calf = rows[:, 7 + 3 * k:10 + 3 * k].T
            ahead = (AHEAD if leg[0] == 'F' else -AHEAD) - LINK * (np.sin(thigh)
                                                                   + np.sin(thigh + calf))
            below = -LINK * (np.cos(thigh) + np.cos(thigh + calf))
            aside = (ASIDE if leg[1] == 'L' else -ASIDE) - below * np.sin(hip)
            heights[:, k] = rows[:, 2] + 2.0 * (x * z - w * y) * ahead + 2.0 * (
                y * z + w * x) * aside + (1.0 - 2.0 * (x * x + y * y)) * below * np.cos(hip)
        names = tuple(f'{leg}_{joint}' for leg in legs for joint in ('hip', 'thigh', 'calf'))
        yield Clip(body, Recording(names, np.arange(len(rows)) * made['FrameDuration'],
                                   rows[:, 7:19], path.stem), heights, tuple(legs),
                   next((gait for gait in ('trot', 'pace') if gait in path.stem), ''))


def others(folder: Path) -> Iterator[Clip]:
    """Yield what is named, and has no pose of feet."""
    for body, named, pattern in (
            ('person', 'run', 'opensim-models/Pipelines/Hamner/**/*running_ik.mot'),
            ('person', 'walk', 'opensim-models/Pipelines/Gait*/Output*/**/*walk*_[iI][kK].mot'),
            ('person', 'run', 'opensim-models/Pipelines/Hamner/*running.trc'),
            ('person', 'walk', 'opensim-models/Pipelines/Gait2392_Simbody/*walk1.trc'),
            ('person', 'walk', 'opensim-models/Pipelines/Rajagopal/ExpData/*walk.trc'),
            ('person', 'walk', 'ezc3d-testFiles/Qualisys.c3d'),
            ('person', 'walk', 'ezc3d-testFiles/BTS.c3d'),
            ('Go1', 'trot', 'serow/evaluation/unit_tests/data/go1.csv')):
        for path in sorted(folder.glob(pattern)):
            markers = {'segments': 'human_plug_in_gait'} if path.suffix in ('.trc', '.c3d') else {}
            yield Clip(body, read_recording(path, progress=False, **markers), named=named)
    for body, named, name in (('person', 'walk', 'human_walking.csv'),
                              ('person', 'run', 'human_running.mot'),
                              ('fly', '', 'fly_walking.csv.gz')):
        yield Clip(body, read_recording(ROOT / 'test' / 'data' / name, progress=False),
                   named=named)


def stretches(clip: Clip, fits: bool) -> list[StretchFit]:
    """Return the stretches of a clip; one of fewer strides than these need is one of its own."""
    try:
        return fit_stretches(clip.recording) if fits else [
            StretchFit(*one, None) for one in cut(clip.recording)]
    except NoSteadyGait:
        legs, _ = leg_joints(clip.recording, None)
        kind = with_legs_of(find_network(network_of(legs)), legs)
        _, stride = stride_of(clip.recording, legs, kind, None)
        return [StretchFit(stride.begin, stride.end, stride, None)]


def picture(path: Path, known: list[dict]) -> None:
    """Draw how often a confidence is right: a reliability diagram."""
    import matplotlib
    matplotlib.use('Agg')
    from matplotlib import pyplot as plt
    _, axes = plt.subplots(figsize=(5.0, 4.0), layout='constrained')
    axes.plot([0, 1], [0, 1], '--', color='gray', linewidth=1)
    for low, high in pairwise(BINS):
        own = [one for one in known if low <= one['confidence'] < high]
        if own:
            right = sum(one['named'] == one['truth'] for one in own)
            x, y = np.mean([one['confidence'] for one in own]), right / len(own)
            half = 1.96 * np.sqrt((y * (1.0 - y) + 1.0 / len(own)) / (len(own) + 4.0))
            axes.errorbar(x, y, [[min(half, y)], [min(half, 1.0 - y)]], fmt='o', color='C0')
            axes.annotate(f'{right} of {len(own)}', (x, y), (6, -12), textcoords='offset points')
    axes.set(xlabel='confidence', ylabel='share that is named right', xlim=(0, 1.05),
             ylim=(-0.05, 1.05))
    plt.savefig(path, dpi=130)


def row(clip: Clip, one: StretchFit) -> dict[str, object]:
    """Return a stretch as a row of the result."""
    errors = [] if one.fit is None else [round(100.0 * one.fit.fit.fractions[order], 1)
                                         for order in ORDERS]
    return {'body': clip.body, 'recording': clip.recording.source.rpartition('/')[2],
            'begin': round(one.begin, 1), 'end': round(one.end, 1),
            'Hz': round(one.stride.frequency, 2), 'truth': clip.truth(one.begin, one.end),
            'named': one.stride.verdict, 'confidence': round(one.confidence, 3),
            'errors_percent': errors}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--names', action='store_true', help='name the stretches, fit none')
    parser.add_argument('--picture', type=Path, metavar='FILE', help='reliability diagram to draw')
    args = parser.parse_args()
    folder = Path(os.environ.get('RECORDINGS', '.'))
    rows: list[dict[str, object]] = []
    clips = chain(
        others(folder), dogs(folder.glob('motion_imitation/motion_imitation/data/motions/*.txt'),
                             'dog as Laikago'),
        dogs(folder.glob('lifelike-agility-and-play/data/mocap_data/*_ret.txt'), 'dog'),
        humanoids(folder / 'LAFAN1_Retargeting_Dataset' / 'g1'))
    for clip in clips:
        try:
            found = stretches(clip, not args.names)
        except CpgError as error:
            log(str(error))
            continue
        for one in found:
            rows.append(row(clip, one))
            log(json.dumps(rows[-1]))
    known = [one for one in rows if one['truth']]
    if args.picture:
        picture(args.picture, known)
    clear = [one for one in known if one['truth'] in CLEAR]
    sure = [one for one in known if one['confidence'] >= 0.95]
    wrong = [one for one in sure if one['named'] != one['truth']]
    by_body = {body: {
        'stretches': len(own), 'truth_known': sum(one in known for one in own),
        'sure': sum(one in sure for one in own),
        'sure_and_wrong': sum(one in wrong for one in own),
        'clear': sum(one in clear for one in own),
        'clear_and_named': sum(one in clear and one['confidence'] >= 0.9
                               and one['named'] == one['truth'] for one in own),
        'median_errors_percent': np.round(np.nanmedian(
            [one['errors_percent'] or [np.nan] * 3 for one in own], axis=0), 1).tolist()}
        for body in dict.fromkeys(one['body'] for one in rows)
        for own in [[one for one in rows if one['body'] == body]]}
    emit(benchmark='stretches', stretches=len(rows), bodies=by_body, sure=len(sure), wrong=wrong,
         target='of 60 stretches of five bodies, none named wrongly and 95 % sure',
         passed=len(rows) >= 60 and len(by_body) >= 5 and not wrong)


if __name__ == '__main__':
    main()
