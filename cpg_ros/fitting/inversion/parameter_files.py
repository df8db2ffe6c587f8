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

"""A fit as files that the generator loads: its parameters, and a robot file."""

from collections.abc import Mapping
from dataclasses import astuple, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from cpg_ros.common.errors import InputError
from cpg_ros.common.files import write_atomically
from cpg_ros.fitting.inversion.recording_fit import RecordingFit
from cpg_ros.motion.phase_readout import standing
from cpg_ros.motion.plan import OutOfLimits, plan, PlanError
from cpg_ros.motion.robot import Joint, JointMotion, Motion, READOUT_PREFIX, Robot, SteeringTable
from cpg_ros.motion.robot_file import MAX_FREQUENCY_RATIO, read_robot, write_robot
from cpg_ros.networks.registry import find_network, NETWORKS, reference
import numpy as np
import yaml

#: Limits of joints without a robot file. LIMIT_MARGIN: on either side, over the recorded range;
#: VELOCITY_RATIO: to the fastest fitted speed.
LIMIT_MARGIN, VELOCITY_RATIO = 0.25, 3.0
#: IN_PLACE_FACTORS: factors of a robot file's weights at a stride of 0; the largest one that keeps
#: the joints within their limits, with the fitted offsets, is used.
IN_PLACE_FACTORS = (1.0, 0.9, 0.75, 0.5, 0.25, 0.0)


def robot_file_of(path: Path) -> Path:
    """Return the path of the robot file of a parameter file."""
    return path.with_name(f'{path.stem}_robot.yaml')


def fitted_robot(result: RecordingFit, robot: Robot | None) -> Robot:
    """Return a robot that moves in the fitted gait as the recorded one.

    Args:
        result: the fit, as fit_recording returns it.
        robot: unchanged except for the motion of this gait; joints that were not recorded move as
            before. Without one, the joints are those recorded, with their ranges as limits.

    Raises:
        InputError: a leg of the network has no recorded joint, or a joint would swing about an
            angle outside its limits.

    """
    fit = result.fit
    if robot is not None:
        networks = _networks(robot, fit.network.name)
        presets = {name for network in networks for name in NETWORKS[network].presets()}
        remaining = {gait: motion for gait, motion in robot.motions.items() if gait in presets}
        robot = replace(robot, networks=networks, harmonics=fit.harmonics, motions=remaining)
        motion = fitted_motion(result, robot)
        for fraction in IN_PLACE_FACTORS:
            trial = replace(robot, motions={**remaining, fit.gait: _scale(motion, fraction)})
            if _within_limits(trial, result):
                break
        return trial
    network = type(fit.network)
    assignment = next(iter(network.legs))
    for leg in network.legs[assignment]:
        if leg not in result.legs:
            raise InputError(f'{result.recording.source}: no joint of {leg} was recorded, and the '
                             f'network {network.name} drives '
                             f'{", ".join(network.legs[assignment])}: a robot file is needed')
    legs = {leg: tuple(_default_joint(name, leg, result) for name in names)
            for leg, names in result.legs.items()}
    order = tuple(name for name in result.recording.joints if name in fit.readouts)
    # Without its frequency the gait would run at the generator's usual one.
    return Robot('fitted', (network.name,), assignment, fit.harmonics, legs, order,
                 {fit.gait: Motion(float(result.stride.frequency), duty=fit.duty,
                                   stance=fit.stance)})


def _scale(motion: Motion, fraction: float) -> Motion:
    """Return a motion with the weights at a stride of 0 multiplied by a number."""
    return replace(motion, joints={
        name: replace(joint, in_place=tuple(fraction * weight for weight in joint.in_place))
        for name, joint in motion.joints.items()})


def _within_limits(robot: Robot, result: RecordingFit) -> bool:
    """Return whether the fitted gait is within the limits; check_plan checks everything else."""
    fit = result.fit
    try:
        plan(robot, fit.gait, type(fit.network).presets()[fit.gait], fit.network,
             float(result.stride.frequency))
    except OutOfLimits:
        return False
    except PlanError:
        pass
    return True


def _networks(robot: Robot, fitted: str) -> tuple[str, ...]:
    """Return the fitted network and the robot's networks with the same legs and cells."""
    if fitted in robot.networks:
        return robot.networks
    cells = NETWORKS[fitted].legs[robot.assignment]
    return (fitted, *(name for name in robot.networks
                      if NETWORKS[name].legs.get(robot.assignment) == cells))


def fitted_motion(result: RecordingFit, robot: Robot | None) -> Motion:
    """Return the fitted gait's motion; parts that were not fitted are the robot's.

    Args:
        result: the fit, as fit_recording returns it.
        robot: with the joints' limits, None for no limits.

    Raises:
        InputError: a joint would swing about an angle outside its limits.

    """
    fit, frequency = result.fit, float(result.stride.frequency)
    motion = Motion() if robot is None else robot.motion(fit.gait, fit.gait)
    limits = {} if robot is None else {joint.name: joint for joint in robot.joints}
    joints = dict(motion.joints)
    for name, (offset, weights) in fit.readouts.items():
        joint = limits.get(name)
        if joint is not None and not joint.lower <= offset <= joint.upper:
            raise InputError(f'{result.recording.source}: joint {name!r} swings about '
                             f"{offset:.4g} rad, outside the robot file's limits {joint.lower:g} "
                             f'to {joint.upper:g}')
        in_place = joints[name].in_place if name in joints else ()
        joints[name] = JointMotion(float(offset), tuple(map(float, weights)), in_place)
    # A fit without a duty is not retimed: its legs stand for as long as they do by themselves.
    return replace(motion, frequency=frequency, joints=joints, duty=fit.duty,
                   stance=motion.stance if fit.duty is None else fit.stance,
                   steering=_slower(motion.steering, frequency))


def _slower(table: SteeringTable | None, frequency: float) -> SteeringTable | None:
    """Return those rows of a table whose frequencies this gait allows."""
    if table is None:
        return None
    rows = [row for row in zip(*filter(None, astuple(table)), strict=True)
            if row[2] <= MAX_FREQUENCY_RATIO * frequency]
    return SteeringTable(*zip(*rows, strict=True)) if rows else None


def _default_joint(name: str, leg: str, result: RecordingFit) -> Joint:
    fit = result.fit
    offset, weights = fit.readouts[name]
    row = fit.joints.index(name)
    angles = np.concatenate([fit.recorded[row], fit.fitted[row], [offset]])
    room = max(LIMIT_MARGIN * float(np.ptp(angles)), 0.05)
    step = 1.0 / (fit.theta.size * result.stride.frequency)
    fastest = float(np.abs(np.diff(fit.fitted[row], append=fit.fitted[row, 0])).max()) / step
    return Joint(name, leg, fit.cells[name], offset, weights, float(angles.min()) - room,
                 float(angles.max()) + room, max(VELOCITY_RATIO * fastest, 1.0))


def running_parameters(result: RecordingFit, robot: Robot | None = None) -> dict[str, Any]:
    """Return the values of a running generator's parameters, by name.

    Args:
        result: the fit.
        robot: of the generator, whose cells were fitted; without one, the readouts are left out.

    """
    fit, network = result.fit, result.fit.network
    settings = {'gait': fit.gait, 'frequency': float(result.stride.frequency),
              **{f'{network.name}.{name}': float(value)
                 for name, value in network.as_dict().items()}}
    if robot is None:
        return settings
    motion = robot.motion(fit.gait, fit.gait)
    # In a fit without a duty, legs stand for as long as their cells make them.
    stance = (standing(fit.orbit, robot.leg_cells, fit.harmonics)[1].mean()
              if motion.stance is None else motion.stance[1])
    duty = fit.duty or (0.0 if motion.duty is None else float(stance))
    return {**settings, 'amplitude': 1.0, 'duty': duty,
            **{READOUT_PREFIX + name: [float(offset), *map(float, weights)]
               for name, (offset, weights) in fit.readouts.items()}}


def parameter_tree(result: RecordingFit, robot: Path) -> dict[str, Any]:
    """Return the generator's parameters as ``--params-file`` takes them, for any node name."""
    fit = result.fit
    return {'/**': {'ros__parameters': {
        'network': reference(fit.network.name), 'robot': str(robot), 'gait': fit.gait,
        'frequency': float(result.stride.frequency), 'amplitude': 1.0,
        fit.network.name: {name: float(value)
                           for name, value in fit.network.as_dict().items()}}}}


def check_plan(tree: Mapping[str, Any], robot: Path, name: str) -> None:
    """Plan the gait as the generator does, from the written files.

    Args:
        tree: as of parameter_tree.
        robot: the robot file.
        name: owner of the plan, for the error.

    Raises:
        InputError: the generator would refuse it.

    """
    tree = tree['/**']['ros__parameters']
    kind = find_network(tree['network'])
    network = kind(**tree[kind.name])
    try:
        plan(read_robot(robot), tree['gait'], kind.presets()[tree['gait']], network,
             tree['frequency'], tree['amplitude'])
    except PlanError as error:
        raise InputError(f'{name} cannot do this: {error}') from error


def write_fitted(path: str | Path, result: RecordingFit, robot: Robot | None = None,
                 named: Path | None = None) -> list[Path]:
    """Write the parameter file, and beside it the robot file that it names.

    Files that the generator would reject are removed.

    Args:
        path: of the parameter file; frequencies in it are in Hz, angles in rad.
        result: the fit, as fit_recording returns it.
        robot: as of fitted_robot.
        named: later path of the robot file; by default it stays.

    Returns:
        The files written.

    Raises:
        InputError: a joint would exceed the robot's limits.
        CpgError: as of fitted_robot.
        OSError: a file cannot be written.

    """
    path = Path(path)
    beside = robot_file_of(path)
    summary = (f'{result.fit.gait} at {result.stride.frequency:.4f} Hz, fitted to '
               f'{result.recording.source}\nmean RMS error '
               f'{100 * result.fit.mean_rms_share:.1f} % of '
               f"the joints' range, readout of order {result.fit.order}")
    new_robot, tree = fitted_robot(result, robot), parameter_tree(
        result, (named or beside).resolve())
    comment = ''.join(f'# {line}\n' for line in summary.splitlines())
    with TemporaryDirectory(prefix='.', dir=path.absolute().parent) as folder:
        parameters, joints = Path(folder, path.name), Path(folder, beside.name)
        write_robot(joints, new_robot, summary)
        write_atomically(parameters, comment + yaml.safe_dump(tree, sort_keys=False))
        check_plan(yaml.safe_load(parameters.read_text()), joints,
                   f'{result.recording.source}: robot {new_robot.name}')
        joints.replace(beside)
        parameters.replace(path)
    return [path, beside]
