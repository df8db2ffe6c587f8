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

"""A fit to a recording: its steady stride, the gait fitted to it, and how well that does."""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from cpg_ros.common.errors import InputError, ShortRepr
from cpg_ros.dynamics.arclength import NoOrbit
from cpg_ros.fitting.gaits.leg_names import legs_of
from cpg_ros.fitting.gaits.leg_phases import PhaseScatter
from cpg_ros.fitting.gaits.stride import FEW_CYCLES_FACTOR, find_stride, NoSteadyGait, Stride
from cpg_ros.fitting.inversion.cycle_problem import Orbits
from cpg_ros.fitting.inversion.fit import Estimate, Fit
from cpg_ros.fitting.inversion.fit_data import cells_of
from cpg_ros.fitting.inversion.invert import invert
from cpg_ros.fitting.inversion.leg_duty import GAIT_DUTY, GaitReadout
from cpg_ros.fitting.recordings.recording import (
    recognise_stride,
    Recording,
    repeat_stride,
)
from cpg_ros.motion.plan import validate_orbit
from cpg_ros.motion.robot import Robot
from cpg_ros.networks.network import Network, other_gait, Preset
from cpg_ros.networks.registry import (
    find_network,
    NetworkError,
    NETWORKS,
    numbered,
    SHIPPED,
    with_legs_of,
)
import numpy as np

# A fit to every steady gait: where the requested fit has no orbit, a simpler one.

#: FIXED_BOUND_WIDTH: half width of the bounds that hold a parameter, over its value.
FIXED_BOUND_WIDTH = 1e-9
#: DUTY_THRESHOLD: standard errors by which the cells' own stance must fit worse before duty is
#: fitted. MAX_DUTY_STDERR: fraction of a stride; above it a warning calls the duty unknown.
DUTY_THRESHOLD, MAX_DUTY_STDERR = 3.3, 0.03
#: One attempt at a fit: free parameters, order of the readout, starts, and a text that describes
#: it.
Way = tuple[tuple[str, ...], int, Sequence[Mapping[str, float]], str]


def _ways(names: tuple[str, ...], order: int, starts: Sequence[Mapping[str, float]]
          ) -> Iterator[Way]:
    yield names, order, starts, ''
    if starts:
        yield names, order, (), 'fitted from the start of the preset'
    for lower in range(order - 1, 0, -1):
        yield names, lower, (), f'fitted with readouts of order {lower}'
    for name in names if len(names) > 1 else ():
        yield (name,), order, (), f'fitted with {name} free alone'


def fit_with_fallbacks(cycle: Stride, cells: Mapping[str, int], network: Network, gait: str,
                       free: Sequence[str] = (), order: int = 3,
                       starts: Sequence[Mapping[str, float]] = (),
                       readout: GaitReadout | None = None, loaded: bool = False,
                       done: Callable[[float], None] = lambda fraction: None
                       ) -> tuple[Fit, tuple[str, ...]]:
    """Fit these parameters at this order, or the nearest fit that the generator runs.

    Without names, the network's usual parameters and the gait's duty are fitted. The duty is
    included if the readout has one, or if the recording tells it from that of the cells.

    Args: as of invert.

    Returns:
        The fit, and warnings that say how it differs from the one requested.

    Raises:
        InputError: as in invert.
        NoOrbit: not even the parameters given have an orbit that the generator runs.

    """
    readout = readout or GaitReadout.of(type(network), gait)
    first, free_names = '', tuple(free) or network.free
    orbits: dict[tuple[str, ...], Orbits] = {}

    def fitted(names: tuple[str, ...], lower: int, begins: Sequence[Mapping[str, float]],
               straight: bool = False) -> Fit:
        if not names:
            # Phases are known beforehand, and no other parameter shows.
            return _fit_fixed(cycle, cells, network, gait, lower, readout, done)
        without_duty = tuple(name for name in names if name != GAIT_DUTY)
        return invert(cycle, cells, network, gait, names, lower, begins, readout=readout,
                      orbits=orbits.setdefault(without_duty, Orbits()), straight=straight,
                      loaded=loaded, done=done)

    for names, lower, begins, relaxation in _ways(free_names, order, starts):
        notes: tuple[str, ...] = ()
        try:
            if free or begins or readout.duty is not None:
                duty = () if free or begins else (GAIT_DUTY,)
                fit = fitted((*names, *duty), lower, begins)
            else:
                fit, notes = _fit_duty_if_identifiable(names, lower, fitted)
        except NoOrbit as error:
            first = first or str(error)
            continue
        reason = validate_orbit(fit.orbit, gait, fit.harmonics)
        if not reason:
            return fit, (*notes, *((f'not fitted as asked for: {first}; {relaxation} instead',)
                                   if relaxation else ()))
        first = first or f'the generator would refuse the {gait} that fits best: {reason}'
    fit = _fit_fixed(cycle, cells, network, gait, order, readout, done)
    if reason := validate_orbit(fit.orbit, gait, fit.harmonics):
        raise NoOrbit(f'{first}; nor does the generator run the parameters given: {reason}')
    return fit, (f'not fitted as asked for: {first}; the parameters stay those of the preset, '
                 'only the readouts are fitted',)


def _fit_duty_if_identifiable(names: tuple[str, ...], order: int,
                       fitted: Callable[..., Fit]
                       ) -> tuple[Fit, tuple[str, ...]]:
    """Fit without a duty, unless the recording shows that it differs from the cells'."""
    try:
        with_duty = fitted((*names, GAIT_DUTY), order, (), True)
    except NoOrbit:
        return fitted(names, order, ()), ()
    minima = [dict(zip(with_duty.free, minimum.values.tolist(), strict=False))
              for minimum in with_duty.minima]
    without_duty = fitted(names, order, [{}, *({name: minimum[name] for name in names}
                                               for minimum in minima[:2])])
    sizes = np.array(list(with_duty.sizes.values()))[:, None]
    rise = 0.5 * float(np.sum((without_duty.errors / sizes)**2)) - with_duty.cost
    if rise > 0.5 * DUTY_THRESHOLD**2 * with_duty.sharing:
        return fitted((*names, GAIT_DUTY), order, minima), ()
    duty = with_duty.parameters[GAIT_DUTY]
    clear = duty.stderr < MAX_DUTY_STDERR or np.isinf(with_duty.model_error)
    return without_duty, () if clear else (
        'the recording does not determine how long the legs stand: the fit and its intervals '
        "assume the duty factor of the network's cells",)


def _fit_fixed(cycle: Stride, cells: Mapping[str, int], network: Network, gait: str, order: int,
              readout: GaitReadout, done: Callable[[float], None]) -> Fit:
    """Fit the readouts alone; all parameters of the network keep their values."""
    name = next(iter(network.parameters()))
    value, kind = float(network.as_dict()[name]), network.ranges[name]
    room = FIXED_BOUND_WIDTH * max(abs(value), 1.0)
    bounds = {name: (max(kind.low, value - room), min(kind.high, value + room))}
    fit = invert(cycle, cells, network, gait, (name,), order, ({},), readout=readout,
                 bounds=bounds, straight=True, done=done)
    # The parameter was never fitted: an interval would claim what is not known.
    return replace(fit, parameters={}, correlation=np.empty((0, 0)), warnings=())


#: POOR_THRESHOLDS: order of the readout -> mean RMS error, as a fraction of the range, above which
#: a fit is poor; fits of real trots and walks have 0.14 to 0.19, 0.05 to 0.09 and 0.03 to 0.04.
#: POOR_FACTOR: of the confidence of a poor fit.
POOR_THRESHOLDS, POOR_FACTOR = {1: 0.25, 2: 0.15, 3: 0.1}, 0.5


@dataclass(frozen=True, eq=False, repr=False)
class RecordingFit(ShortRepr):
    """A network's gait fitted to a recording.

    Attributes:
        recording: joint angles, rad, over times in s.
        read: how its joints were given to legs.
        legs: leg -> its joints.
        stride: its steady gait.
        fit: the network's gait fitted to that.
        warnings: one line each.

    """

    recording: Recording
    read: str
    legs: Mapping[str, Sequence[str]]
    stride: Stride
    fit: Fit
    warnings: tuple[str, ...]

    def _summary(self) -> str:
        fit = self.fit
        return (f'{fit.gait} of {fit.network.name} to {self.recording.source}: '
                f'{self.stride.frequency:.6g} Hz, confidence {self.confidence:.3g}, RMS error '
                f'{100.0 * fit.mean_rms_share:.3g} % of range, warnings: {len(self.warnings)}')

    @property
    def confidence(self) -> float:
        """Probability that gait and frequency are those named; less where the fit is poor."""
        return self.stride.confidence * (POOR_FACTOR if self.poor else 1.0)

    @property
    def poor(self) -> bool:
        """Whether the mean RMS error is above the threshold for the order of the readouts."""
        return self.fit.mean_rms_share > POOR_THRESHOLDS[self.fit.order]

    def as_dict(self) -> dict[str, Any]:
        """Everything in plain types, for JSON."""
        fit, stride = self.fit, self.stride
        rms, fraction = fit.rms, fit.rms_share
        verdict = fit.verdict
        return {
            'gait': fit.gait, 'recognised': stride.gait if len(stride.candidates) < 2 else None,
            'nearest': stride.nearest, 'alike': list(stride.candidates),
            'distance': stride.distance, 'margin': stride.margin, 'confidence': self.confidence,
            'frequency': stride.frequency, 'frequency_error': stride.frequency_error,
            'cycles': stride.cycles, 'begin': stride.begin, 'end': stride.end,
            'phases': {leg: float(phase) for leg, phase in stride.phases.items()},
            'network': fit.network.name, 'params': fit.network.as_dict(),
            'parameters': {name: {'value': estimate.value, 'stderr': estimate.stderr,
                                  'low': estimate.low, 'high': estimate.high}
                           for name, estimate in fit.parameters.items()},
            'order': fit.order, 'rms_share': fit.mean_rms_share,
            'rms_share_by_order': {str(order): value for order, value in fit.fractions.items()},
            'joints': {name: {'rms': rms[name], 'rms_share': fraction[name],
                              'cell': fit.cells[name]}
                       for name in fit.joints},
            'starts': [{'start': dict(zip(fit.free, trial.start.tolist(), strict=False)),
                        'end': dict(zip(fit.free, trial.values.tolist(), strict=False)),
                        'iterations': trial.iterations, 'cost': trial.cost, 'why': trial.reason}
                       for trial in fit.starts],
            'minima': [{**dict(zip(fit.free, trial.values.tolist(), strict=False)),
                        'cost': trial.cost} for trial in fit.minima],
            'duty': fit.duty,
            'period': fit.orbit.period,
            'critical_delay': None if fit.hopf is None else fit.hopf.value,
            'stable': verdict.stable, 'stable_with_default_gain': verdict.stable_with_default_gain,
            'source': self.recording.source, 'legs': {leg: list(names) for leg, names
                                                      in self.legs.items()},
            'read': self.read, 'notes': [*self.recording.notes, *stride.notes],
            'warnings': list(self.warnings)}


def preset_of(network: str, gait: str) -> Preset:
    """Return the shipped parameters that a gait is fitted from.

    Raises:
        InputError: the network has no such gait or preset.

    """
    presets = find_network(network).presets()
    if gait not in presets:
        raise InputError(f"'{gait}' is not one of the presets of the network {network}: "
                         f'{", ".join(presets)}')
    return presets[gait]


def network_of(legs: Iterable[str]) -> str:
    """Name the first shipped network that has these legs."""
    names = set(legs)
    return next(kind.name for kind in (*SHIPPED.values(), *numbered(len(names)))
                if names <= set(next(iter(kind.legs.values()))))


def leg_joints(recording: Recording, robot: Robot | None
               ) -> tuple[dict[str, tuple[str, ...]], str]:
    """Return which joints each leg has, and how that was read."""
    if robot is None:
        by_leg = legs_of(recording.joints)
        return dict(by_leg.joints), by_leg.explanation
    legs = {leg: tuple(joint.name for joint in joints if joint.name in recording.joints)
            for leg, joints in robot.legs.items()}
    missing = [joint.name for joint in robot.joints if joint.name not in recording.joints]
    if len(missing) == len(robot.joints):
        raise InputError(f'{recording.source}: none of the joints of robot {robot.name} is '
                         f'there: it has {", ".join(recording.joints)}; the robot has '
                         f'{", ".join(missing)}: rename either, or leave out --robot')
    note = f'legs and cells are those of robot {robot.name}'
    return ({leg: names for leg, names in legs.items() if names},
            note + (f'; not recorded: {", ".join(missing)}' if missing else ''))


def networks_of(robot: Robot | None, legs: Iterable[str]) -> Iterator[type[Network]]:
    """Yield the networks that drive a robot, or else those shipped that have these legs."""
    names = set(legs)
    yield from ((NETWORKS[name] for name in robot.networks) if robot is not None else
                (kind for kind in numbered(len(names))
                 if names <= set(next(iter(kind.legs.values())))))


def stride_of(recording: Recording, legs: Mapping[str, Sequence[str]], kind: type[Network],
              robot: Robot | None, gait: str = '') -> tuple[dict[str, int], Stride]:
    """Return joint -> its cell in a network, and the steady stride, of a known gait or any."""
    cells = cells_of(robot if robot is not None else legs, kind)
    cells = {name: cell for name, cell in cells.items() if name in recording.joints}
    gains = None if robot is None else {
        joint.name: complex(*joint.weights[:2]) for joint in robot.joints}
    try:
        stride = find_stride(recording.select(tuple(cells)), legs, kind,
                             None if robot is None else cells, gains, recording.loads,
                             recording.body, gait)
    except NoSteadyGait as error:
        # What was repaired or left out may be why.
        raise NoSteadyGait('; '.join((str(error), *recording.notes))) from error
    if not recording.cycle:
        return cells, stride
    # Copies of one stride do not tell how strides scatter.
    unknown = PhaseScatter(np.nan, np.nan, np.nan, 1)
    return cells, replace(
        stride, cycles=1, frequency=1.0 / recording.cycle,
        # A cut is right to half a sample on either side.
        frequency_error=float(np.median(np.diff(recording.times))) / (6**0.5 * recording.cycle**2),
        confidence=FEW_CYCLES_FACTOR * stride.confidence,
        scatter={leg: unknown if k else one
                 for k, (leg, one) in enumerate(stride.scatter.items())})


def _steady(recording: Recording, legs: Mapping[str, Sequence[str]], kind: type[Network],
            robot: Robot | None, gait: str
            ) -> tuple[Recording, dict[str, int], Stride, list[str]]:
    """Return the recording, cells, stride and warnings; a single stride is enough.

    A recording without a steady gait may be exactly one stride; copies of it then take its place.
    """
    try:
        return recording, *stride_of(recording, legs, kind, robot, gait), []
    except NoSteadyGait:
        copies = recognise_stride(recording)
        if copies is None:
            raise
    cells, stride = stride_of(copies, legs, kind, robot, gait)
    return copies, cells, replace(stride, confidence=0.5 * stride.confidence), [
        f'taken for exactly one stride of {copies.cycle:.4g} s, as it ends where it begins: '
        'confirm this (--cycle), or record several strides']


def _none_of(kind: type[Network], stride: Stride) -> str:
    """Return a line on phases that are those of no gait: their values and their scatter."""
    phases = ', '.join(f'{leg} {phase:.3f}' + (
        f' +- {stride.scatter[leg].spread:.3f}' if stride.scatter[leg].spread > 0.0 else '')
        for leg, phase in stride.phases.items())
    return (f'the recorded phases match no gait of the network {kind.name}: the nearest '
            f'is {stride.nearest}, {stride.distance:.3f} of a cycle off; phases at '
            f'{stride.frequency:.4g} Hz, and their deviations in single strides: {phases}')


def _phases_as_estimates(fit: Fit, stride: Stride) -> dict[str, Estimate]:
    """Return the estimates of the phases that are parameters of the network."""
    values, estimates = fit.network.as_dict(), {}
    for leg, scatter in list(stride.scatter.items())[1:]:
        name = fit.network.offsets.get(leg)
        if name is not None and name not in fit.parameters:
            known_error = scatter.error == scatter.error
            half = scatter.half_width if known_error else np.inf
            estimates[name] = Estimate(values[name], scatter.error if known_error else np.inf,
                                   values[name] - half, values[name] + half, known_error)
    return estimates


def network_name(network: str, legs: Iterable[str], robot: Robot | None) -> str:
    """Return the name given, or by default that of the robot's first, or of one for the legs."""
    return network or (robot.networks[0] if robot is not None else network_of(legs))


def network_for(network: str, legs: Mapping[str, Sequence[str]], robot: Robot | None
                ) -> type[Network]:
    """Return the network of a name, or by default the robot's first, or the first for the legs.

    Raises:
        InputError: there is none of this name, or for these legs.

    """
    try:
        return with_legs_of(find_network(network_name(network, legs, robot)), legs)
    except NetworkError as error:
        raise InputError(f'network {error}') from error


def _parameters(kind: type[Network], gait: str, preset: str, stride: Stride) -> Network:
    """Return the parameters of a preset, with the phases recorded if they leave it its gait."""
    parameters = preset_of(kind.name, preset or gait).network
    with_phases = parameters.with_phases(stride.phases)
    return parameters if other_gait(with_phases, gait) else with_phases


def fit_recording(recording: Recording, robot: Robot | None = None, network: str = '',
                  gait: str = '', *, free: Sequence[str] = (), order: int = 3, preset: str = '',
                  starts: Sequence[Mapping[str, float]] = (),
                  done: Callable[[float], None] = lambda fraction: None) -> RecordingFit:
    """Find the steady gait of a recording and fit a network's gait and readouts to it.

    Args:
        recording: joints over time.
        robot: which joints belong to which legs and cells; by default their names decide.
        network: name or file; by default the robot's first, or the first that has such legs.
        gait: of the network; by default the recorded one, as it is recognised.
        free: parameters to fit, among them GAIT_DUTY, the fraction of the stride that legs stand;
            by default the network's usual ones and that, if the robot's gait has a duty or the
            recording tells it.
        order: of the readouts, 1 to 3.
        preset: whose parameters are taken that are not free; the gait's by default.
        starts: free number -> value to start from; by default several that cover the ranges.
        done: called with the fraction of the fit that is done, 0 to 1.

    Raises:
        CpgError: one line that says what is wrong: no legs, no steady gait (NoSteadyGait), no
            gait of the network's, or no orbit (NoOrbit).

    """
    if np.isnan(recording.cycle):
        recording = repeat_stride(recording)
    legs, note = leg_joints(recording, robot)
    kind = network_for(network, legs, robot)
    recording, cells, stride, warnings = _steady(recording, legs, kind, robot, gait)
    if not (gait or stride.gait or network or kind.offsets):
        warnings.append(_none_of(kind, stride))
        as_they_are = next((candidate for candidate in networks_of(robot, legs)
                            if candidate.offsets), None)
        if as_they_are is not None:
            kind = as_they_are
            cells, stride = stride_of(recording, legs, kind, robot, gait)
            warnings[-1] += f'; they are fitted as they are, by the network {kind.name}'
    elif not (gait or stride.gait or not kind.unnamed):
        warnings.append(_none_of(kind, stride))
    warnings += stride.issues
    gait = gait or stride.gait or kind.unnamed
    if not gait:
        raise InputError('; '.join((
            f'{recording.source}: {_none_of(kind, stride)}; name the gait to fit it all the '
            'same', *recording.notes, *stride.notes, *stride.issues)))
    if (stride.gait or kind.unnamed) != gait:
        warnings.append(f'the recorded phases are those of {stride.gait or "none of the gaits"}, '
                        f'not of {gait}')
    fit, fallbacks = fit_with_fallbacks(
        stride, cells, _parameters(kind, gait, preset, stride), gait, free, order, starts,
        GaitReadout.of(kind, gait, preset, robot),
        stride.contacts is not None and not recording.commanded, done)
    fit = replace(fit, parameters={**fit.parameters, **_phases_as_estimates(fit, stride)})
    if robot is None and any(len(ids) > 1 for ids in next(iter(kind.legs.values())).values()):
        note += ("; joints are assigned to their leg's first cell, as there is no robot file: "
                 'parameters and intervals hold for this assignment only')
    result = RecordingFit(recording, note, legs, stride, fit,
                          (*warnings, *fallbacks, *fit.warnings))
    return result if not result.poor else replace(result, warnings=(
        f"a poor fit: {100.0 * fit.mean_rms_share:.0f} % of the joints' range are left on "
        f'average; what was recorded may be no {fit.gait}, but turning, hopping or several gaits',
        *result.warnings))
