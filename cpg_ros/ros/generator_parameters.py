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

"""The generator's parameters: descriptors, presets, and the gait of a batch of changes."""

from collections.abc import Mapping
import contextlib
from dataclasses import dataclass, replace
import functools
import math
from pathlib import Path
from typing import Any

from cpg_ros.common.errors import CpgError, InputError
from cpg_ros.feedback.biped.gains import BipedGains
from cpg_ros.motion.body_file import GAIT_SPEEDS
from cpg_ros.motion.plan import gait_of, GaitPlan, plan, PlanError
from cpg_ros.motion.robot import gait_readouts, READOUT_PREFIX, Robot, with_readouts
from cpg_ros.motion.robot_file import load_robot
from cpg_ros.networks.network import Network, Preset
from cpg_ros.networks.presets import read_presets
from cpg_ros.networks.registry import find_network, NETWORKS, with_legs_of
from cpg_ros.ros import posture
from cpg_ros.ros.generator_io import STAMPED
from cpg_ros.ros.node import ticker
from cpg_ros.ros.node.parameters import as_doubles, one_of, PRESETS_LABEL, Spec, UNTUNED_LABEL
from rclpy.parameter import Parameter

COMMANDS = ('none', 'joint_trajectory', 'forward_position')
NETWORK = Spec('delayed', 'network of cells that generates the rhythm', read_only=True,
               constraints=one_of(NETWORKS, ', or the path of a Python file that defines one; '
                                  'append a number of legs, as in delayed6, for a variant; '
                                  "without one, the robot file's number of legs is used where the "
                                  'file asks for that variant'))


FREQUENCY = Spec(1.0, "strides per second [Hz]; 0 runs in the model's own time, one unit per "
                 'second', 0.0, 10.0)


def specs(network: type[Network]) -> dict[str, Spec]:
    """Return the parameters that depend on the network alone, in order of declaration."""
    return {
        'presets': Spec('', 'file with additional presets; empty for none', read_only=True),
        'robot': Spec(network.usual_robot, 'robot file, or the name of a shipped one',
                      read_only=True, constraints='a shipped name, or the path of a YAML file'),
        'gait': gait_spec(network, network.presets(), ', and those of the file given by presets'),
        'rate': Spec(100.0, 'messages per second on every output topic [Hz]', 1.0, 2000.0),
        'amplitude': Spec(1.0, "factor on the robot file's joint amplitudes", 0.0, 3.0),
        'duty': Spec(0.0, 'duty factor: fraction of the stride that a leg is in stance, from 0.3; '
                     "0 for the gait's own", 0.0, 0.9),
        'transition': Spec(1.0, 'duration of a change of gait or parameters [s]; 0 leaves the '
                           "change to the network's own dynamics", 0.0, 30.0),
        'ramp': Spec(1.0, 'duration of the ramp between the stand and the gait [s]; 0 for as fast '
                     "as the joints' velocity limits permit", 0.0, 30.0),
        'symmetry_gain': Spec(-1.0, 'gain of the symmetry lock [1/model time]; -1 chooses a gain '
                              "at which the gait attracts, 0 is the paper's model", -1.0, 200.0),
        'combined_topic': Spec('joint_states', 'topic with all joints in one message; empty for '
                               'none', read_only=True),
        'stamped': STAMPED,
        'command': Spec('none', 'command topic for ros2_control', read_only=True,
                        constraints=one_of(COMMANDS)),
        'measured_topic': Spec('joint_states', "topic of the robot's measured joint states, from "
                               'which the generator moves it to the stand if it commands the '
                               'robot (command) or autostart is false; empty for none',
                               read_only=True),
        'assume_stand': Spec(False, 'start at the stand if no pose is measured, even if '
                             'command is not none: for robots without joint encoders, whose '
                             'joints jump to the stand, and for bridges and simulations, which '
                             'move the robot to the stand themselves', read_only=True),
        'tracking_error': Spec(0.3, 'mean distance of a measured joint from its commanded angle '
                               'at which /diagnostics reports an error and feedback fades out '
                               '[rad]',
                               0.01, 10.0, read_only=True),
        'tracking_time': Spec(1.0, 'time over which that mean is taken [s]', 0.1, 10.0,
                              read_only=True),
        'autostart': Spec(True, 'ramp into the gait at start, with a command as soon as the pose '
                          'is measured; if false, publish nothing until ~/enable is called',
                          read_only=True),
        'managed': Spec(False, 'be a managed node (ros2 lifecycle): silent until it is '
                        'configured, then at the stand, and in the gait while it is active; '
                        'autostart has no effect, and ~/enable only stops: false deactivates it',
                        read_only=True),
        'cmd_vel': Spec(False, 'follow the commands on cmd_vel; the robot file must have steering '
                        'tables', read_only=True),
        'stamped_cmd_vel': Spec(False, 'type of cmd_vel: geometry_msgs/TwistStamped in place of '
                                'geometry_msgs/Twist', read_only=True),
        'cmd_vel_timeout': Spec(0.5, 'the robot stops if no cmd_vel arrives for this time [s]',
                                0.05, 60.0),
        'faster_gait': Spec('', 'gait to which the generator changes while cmd_vel asks for more '
                            "than the gait's fastest speed, and from which it changes back; empty "
                            'for none', read_only=True),
        **posture.SPECS, **ticker.SPECS}


def network_for(network: Any, robot: Any) -> Any:
    """Return the variant of a network for a robot's legs, if the robot file asks for one.

    A network or robot that does not exist is reported when it is loaded.
    """
    if not (isinstance(network, str) and isinstance(robot, str)):
        return network
    with contextlib.suppress(CpgError):
        kind, robot_of_file = find_network(network), load_robot(robot)
        like = with_legs_of(kind, robot_of_file.legs).name
        if kind.name not in robot_of_file.networks and like in robot_of_file.networks:
            return like
    return network


def presets_of(network: type[Network], path: str) -> dict[str, Preset]:
    """Return a network's presets and those of a file, '' for none.

    Raises:
        PresetError: the file cannot be used.

    """
    return network.presets() | (read_presets(Path(path).expanduser(), network) if path else {})


def gait_spec(network: type[Network], presets: Mapping[str, Preset], further: str = '',
              robot: Robot | None = None) -> Spec:
    """Return the parameter that names one of these presets, or one of ``further``.

    Of a robot that ``tune`` has tried, it says which presets have no motion, or a poor one.
    """
    gaits = [name for name, preset in presets.items() if name == preset.gait]
    others = [name for name in presets if name not in gaits]
    more = f'{PRESETS_LABEL}{", ".join(others)}' if others else ''
    motions = robot.motions if robot else {}
    untuned = [name for name, preset in presets.items()
               if not (motion := motions.get(name) or motions.get(preset.gait))
               or motion.verdict.startswith('poor')]
    if untuned and any(motion.verdict for motion in motions.values()):
        further += f'{UNTUNED_LABEL}{", ".join(untuned)}'
    return Spec(network.usual_gait, 'gait; setting it loads its preset of network parameters',
                constraints=one_of(gaits, more + further))


def exclusive(command: str) -> Spec:
    """Return the parameter whose default depends on whether the node commands a robot."""
    return Spec(command != 'none', 'refuse to start if another node publishes on the command or '
                'joint topics', read_only=True)


@dataclass(frozen=True)
class GaitSettings:
    """Settings that determine a plan; hashable, so that plans are cached."""

    gait: str
    network: Network
    frequency: float
    amplitude: float
    symmetry_gain: float
    duty: float
    readouts: tuple[tuple[float, ...], ...]


class Planner:
    """From parameters to plans, for one network and one robot.

    Attributes:
        network: class of the network.
        presets: name -> preset, all values of ``gait``.
        robot: of the plans.
        steered: whether only gaits with steering in the robot file can run.
        names: parameters that make up the settings.

    """

    def __init__(self, network: type[Network], presets: dict[str, Preset], robot: Robot,
                 steered: bool = False) -> None:
        self.network, self.presets, self.robot = network, presets, robot
        self.steered = steered
        self.names = ('gait', 'frequency', 'amplitude', 'symmetry_gain', 'duty',
                      *(f'{network.name}.{key}' for key in network.parameters()),
                      *(READOUT_PREFIX + joint.name for joint in robot.joints))
        self._solve = functools.lru_cache(maxsize=32)(self._plan)

    @property
    def offered(self) -> dict[str, Preset]:
        """Presets that can run: with ``steered``, those with steering in the robot file."""
        return {name: preset for name, preset in self.presets.items() if not self.steered
                or self.robot.motion(name, preset.gait).steering is not None
                or (self.robot.biped is not None and preset.gait in GAIT_SPEEDS)}

    def prepare(self) -> None:
        """Solve every preset's gait in advance, so that a change is immediate."""
        for preset in self.presets.values():
            # A gait that cannot run is rejected, with the reason, when it is set.
            with contextlib.suppress(CpgError):
                gait_of(preset, preset.network)

    def specs(self, preset: str) -> dict[str, Spec]:
        """Return ``frequency`` and parameters of network and joints, with a preset's defaults."""
        network, values = self.network, self._values(self.presets[preset].network)
        frequency = self._frequency(preset)
        specs = {'frequency': FREQUENCY if frequency is None else
                 replace(FREQUENCY, default=frequency)}
        specs |= {f'{network.name}.{key}': Spec(values[key], allowed.text, allowed.low,
                                                allowed.high)
                  for key, allowed in network.ranges.items()}
        for group, members in network.groups.items():
            allowed = network.ranges[members[0]]
            specs[f'{network.name}.{group}'] = Spec(
                values[group], f'mean of {", ".join(members)}; setting it sets all of them',
                allowed.low, allowed.high)
        for name, readout in self._readouts(preset).items():
            specs[name] = Spec(readout, "offset of the joint in this gait, and 1, 2, 4 or 6 "
                               "weights of its cell's signals [rad]; setting the gait loads "
                               'those of the robot file')
        return specs

    def given(self, gait: str, overrides: Mapping[str, Parameter]) -> list[Parameter]:
        """Return the overrides of a gait's parameters, completed as by ``complete``."""
        names, network = set(self.specs(gait)), self.presets[gait].network
        current = {f'{network.name}.{key}': value for key, value in network.as_dict().items()}
        return self.complete(as_doubles([override for override in overrides.values()
                                         if override.name in names],
                                        names), current)

    def _frequency(self, preset: str) -> float | None:
        """Return the gait's frequency in the robot file, Hz."""
        gait = self.presets[preset].gait
        frequency = self.robot.motion(preset, gait).frequency
        if frequency is None and self.robot.biped is not None and gait in GAIT_SPEEDS:
            frequency = BipedGains.of_body(self.robot.biped, gait).frequency
        return frequency

    def _readouts(self, preset: str) -> dict[str, list[float]]:
        """Return the gait's readouts in the robot file, by parameter."""
        motion = self.robot.motion(preset, self.presets[preset].gait)
        return {READOUT_PREFIX + name: list(readout)
                for name, readout in gait_readouts(self.robot, motion).items()}

    def _values(self, network: Network) -> dict[str, float]:
        """Return parameters and groups by their bare names."""
        values = network.as_dict()
        return {**values, **{group: math.fsum(values[key] for key in members) / len(members)
                             for group, members in network.groups.items()}}

    def settings(self, values: dict[str, Any]) -> GaitSettings:
        """Build settings from all parameters by name.

        Raises:
            PlanError: a value of the wrong type or not finite, or an unknown gait.

        """
        for name in self.names:
            value = values[name]
            if name != 'gait' and not name.startswith(READOUT_PREFIX) and not (
                    isinstance(value, float) and math.isfinite(value)):
                raise PlanError(f'{name} must be a finite number, not {value!r}')
        if values['gait'] not in self.presets:
            raise PlanError(f"gait '{values['gait']}' is not one of {', '.join(self.presets)}")
        gain = values['symmetry_gain']
        if -1.0 < gain < 0.0:
            raise PlanError(f'symmetry_gain {gain:g} is neither -1 (chosen) nor at least 0')
        network = self.network(*(values[f'{self.network.name}.{key}']
                                 for key in self.network.parameters()))
        return GaitSettings(values['gait'], network, values['frequency'], values['amplitude'],
                            gain, values['duty'], tuple(
                                tuple(values[READOUT_PREFIX + joint.name])
                                for joint in self.robot.joints))

    def plan(self, values: dict[str, Any]) -> GaitPlan:
        """Return the plan for all parameters, by name.

        Raises:
            PlanError: the gait cannot run.

        """
        plan = self._solve(self.settings(values))
        if self.steered:
            try:
                plan.steer(0.0, 0.0)
            except PlanError as error:
                raise PlanError(f'{error}, which cmd_vel needs') from error
        return plan

    def _plan(self, settings: GaitSettings) -> GaitPlan:
        preset = self.presets[settings.gait]
        readouts = {joint.name: readout for joint, readout
                    in zip(self.robot.joints, settings.readouts, strict=True)}
        try:
            robot = with_readouts(self.robot, settings.gait, preset.gait, readouts)
        except InputError as error:
            raise PlanError(str(error)) from error
        return plan(robot, settings.gait, preset, settings.network, settings.frequency,
                    settings.amplitude, settings.symmetry_gain, settings.duty)

    def complete(self, parameters: list[Parameter], current: dict[str, Any]) -> list[Parameter]:
        """Add to a batch the changes that it implies.

        These are, in order: the gait's preset, its frequency, readouts and duty in the robot file,
        the members of a group, and the means of groups. Single parameters in the batch take
        precedence. An unknown gait adds nothing and is rejected later.
        """
        prefix = f'{self.network.name}.'
        changes = {p.name: p.value for p in parameters}
        gait = changes.get('gait')
        implied: dict[str, Any] = {}
        if isinstance(gait, str) and gait in self.presets:
            loaded = self.presets[gait].network.as_dict()
            implied = {prefix + key: value for key, value in loaded.items()}
            implied |= self._readouts(gait)
            if (frequency := self._frequency(gait)) is not None:
                implied['frequency'] = frequency
            implied['duty'] = 0.0
        for group, members in self.network.groups.items():
            if isinstance(changes.get(prefix + group), float):
                implied.update({prefix + key: changes[prefix + group] for key in members})
        implied = {name: value for name, value in implied.items() if name not in changes}
        values = {**current, **implied, **changes}
        for group, members in self.network.groups.items():
            parts = [values[prefix + key] for key in members]
            if (any(prefix + key in implied or prefix + key in changes for key in members)
                    and all(isinstance(part, float) for part in parts)):
                parameters = [p for p in parameters if p.name != prefix + group]
                implied[prefix + group] = math.fsum(parts) / len(parts)
        return [Parameter(name, value=value) for name, value in implied.items()] + parameters
