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

"""A real fly that walks: its rhythm, its six legs, and a generator that moves like it.

The recording (data/NOTICE) lasts a second. What is expected of it is worked out from the angles
over time, not from mean cycles: feet by turning links one after the other, phases by Hilbert's
transform.
"""

from functools import cache
from pathlib import Path

from cpg_ros.fitting.gaits.leg_names import legs_of
from cpg_ros.fitting.gaits.stride import find_stride
from cpg_ros.fitting.inversion.parameter_files import robot_file_of, write_fitted
from cpg_ros.fitting.inversion.recording_fit import fit_recording, network_of
from cpg_ros.fitting.recordings.csv_reader import read_csv
from cpg_ros.motion.pattern import Pattern
from cpg_ros.motion.plan import plan
from cpg_ros.motion.robot_file import read_robot
from cpg_ros.networks.registry import find_network
import numpy as np
import pytest
from scipy.signal import butter, hilbert, sosfiltfilt
from scipy.spatial.transform import Rotation

FILE = Path(__file__).parents[2] / 'data' / 'fly_walking.csv.gz'
JOINTS = ('Coxa_yaw', 'Coxa', 'Coxa_roll', 'Femur', 'Femur_roll', 'Tibia')
#: Coxa, femur, tibia and tarsus of each leg in mm (NeuroMechFly).
LENGTHS = {'F': (0.40, 0.69, 1.17), 'M': (0.18, 0.78, 1.24), 'H': (0.20, 0.83, 1.39)}
LEGS = ('LH', 'RH', 'LM', 'RM', 'LF', 'RF')


@cache
def recording():
    return read_csv(FILE)


def forward(angles, leg):
    """How far ahead of its hip a foot is, mm, at joint -> rad."""
    down = np.array([0.0, 0.0, -1.0])
    row = np.stack([angles[f'joint_{leg}{joint}'] for joint in JOINTS], axis=1)
    coxa, femur, tibia = LENGTHS[leg[1]]
    one = Rotation.from_euler('XYZ', row[:, :3])
    two = one * Rotation.from_euler('YZ', row[:, 3:5])
    three = two * Rotation.from_euler('Y', row[:, 5:])
    return (coxa * one.apply(down) + femur * two.apply(down) + tibia * three.apply(down))[:, 0]


def stepping(times, angles, stretch):
    """Leg -> mean phase ahead of LH, and the stride frequency in Hz, over a stretch of time."""
    band = butter(2, (4.0, 20.0), 'band', fs=1.0 / np.median(np.diff(times)), output='sos')
    inside = (times >= stretch[0]) & (times <= stretch[1])
    phase = {leg: np.unwrap(np.angle(hilbert(sosfiltfilt(band, forward(angles, leg)))))[inside]
             for leg in LEGS}
    frequency = np.mean([np.polyfit(times[inside], one, 1)[0] for one in phase.values()])
    mean = {leg: float(np.angle(np.mean(np.exp(1j * (one - phase['LH']))))) for leg, one
            in phase.items()}
    return {leg.lower(): one / (2.0 * np.pi) for leg, one in mean.items()}, frequency / 2 / np.pi


@cache
def fitted():
    return fit_recording(recording(), free=('tau',))


def apart(first, other):
    return {leg: abs((first[leg] - other[leg] + 0.5) % 1.0 - 0.5) for leg in first}


def test_rhythm_and_coordination_of_six_legs():
    seen = recording()
    legs = legs_of(seen.joints)
    assert network_of(legs) == 'delayed6' and all(len(legs[leg]) == 7 for leg in legs)
    stride = find_stride(seen, legs, find_network('delayed6'))
    phases, frequency = stepping(seen.times, dict(zip(seen.joints, seen.positions.T, strict=True)),
                                 (stride.begin, stride.end - 0.05))
    assert stride.frequency == pytest.approx(frequency, rel=0.03)
    assert max(apart(stride.phases, phases).values()) < 0.05
    # The legs of a side one after the other from behind, those of a pair in turn.
    assert stride.gait == 'ripple'


def test_the_readout_error_falls_with_the_order():
    fractions = fitted().fit.fractions
    assert fractions[1] > fractions[2] > fractions[3] and fractions[3] < 0.06


def test_a_generator_moves_like_the_fly(tmp_path):
    found = fitted()
    write_fitted(tmp_path / 'fly.yaml', found)
    robot = read_robot(robot_file_of(tmp_path / 'fly.yaml'))
    assert len(robot.joints) == 42
    preset = find_network('delayed6').presets()[found.fit.gait]
    pattern = Pattern(plan(robot, found.fit.gait, preset, found.fit.network,
                           found.stride.frequency), ramp=0.1)
    points, strides = 128, 10
    dt = 1.0 / found.stride.frequency / points
    for _ in range(5 * points):
        pattern.advance(dt)
    times, rows = dt * np.arange(strides * points), []
    for _ in times:
        pattern.advance(dt)
        rows.append(pattern.position.copy())
    angles = dict(zip([joint.name for joint in robot.joints], np.array(rows).T, strict=True))
    # One common shift brings it to the phase of the recording.
    mean = {name: np.interp(np.arange(points) / points, np.append(found.stride.theta, 1.0),
                            np.append(row, row[0]))
            for name, row in zip(found.stride.joints, found.stride.mean, strict=True)}
    cycle = {name: angles[name][:points] for name in mean}

    def alike(shift):
        return [np.corrcoef(np.roll(cycle[name], shift), mean[name])[0, 1] for name in mean]

    best = max(range(points), key=lambda shift: np.mean(alike(shift)))
    # Three small joints have more harmonics than a readout of order 3: 0.92, 0.93 and 0.94.
    found_alike = np.array(alike(best))
    assert (found_alike > 0.95).sum() >= 39 and found_alike.min() > 0.9
    own = stepping(times, angles, (times[2 * points], times[-2 * points]))[0]
    assert max(apart(own, found.stride.phases).values()) < 0.05
