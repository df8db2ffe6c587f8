"""The generator's parameters: descriptors, presets, and what a batch of changes asks for."""

import functools
import math
from dataclasses import dataclass
from typing import Any

from rcl_interfaces.msg import FloatingPointRange, ParameterDescriptor
from rclpy.parameter import Parameter

from cpg_ros.dynamics.program import MAX_DELAY, Program, Refused, plan
from cpg_ros.dynamics.stepper import STEP
from cpg_ros.networks.delayed import PARAMETERS, PRESETS, Delayed
from cpg_ros.robot import Robot

NETWORKS = ('delayed',)
COMMANDS = ('none', 'joint_trajectory', 'forward_position')
GAIT_NAMES = tuple(PRESETS)


@dataclass(frozen=True)
class Spec:
    """One parameter: default, what it is, its range if it is a number, whether it is fixed."""

    default: Any
    text: str
    low: float | None = None
    high: float | None = None
    read_only: bool = False
    constraints: str = ''

    def descriptor(self) -> ParameterDescriptor:
        """Return it as a ROS descriptor."""
        ranges = []
        if self.low is not None and self.high is not None:
            ranges = [FloatingPointRange(from_value=self.low, to_value=self.high)]
        return ParameterDescriptor(description=self.text, read_only=self.read_only,
                                   floating_point_range=ranges,
                                   additional_constraints=self.constraints)


#: Every parameter of the generator but the network's own; the order is that of declaration.
SPECS: dict[str, Spec] = {
    'network': Spec('delayed', 'network of cells that makes the rhythm', read_only=True,
                    constraints='one of: ' + ', '.join(NETWORKS)),
    'robot': Spec('quadruped', 'robot file, or the name of a shipped one', read_only=True,
                  constraints='quadruped, goat, or the path of a YAML file'),
    'gait': Spec('trot', 'gait; setting it loads its preset of network parameters',
                 constraints='one of: ' + ', '.join(GAIT_NAMES)),
    'rate': Spec(100.0, 'messages per second on every output topic [Hz]', 1.0, 2000.0),
    'frequency': Spec(1.0, "strides per second [Hz]; 0 runs in the model's own time, one unit "
                      'a second', 0.0, 10.0),
    'amplitude': Spec(1.0, "factor on the robot file's joint amplitudes", 0.0, 3.0),
    'transition': Spec(1.0, 'duration of a change of gait or parameters [s]; 0 leaves it to the '
                       "network's own dynamics", 0.0, 30.0),
    'ramp': Spec(1.0, 'duration of the ramp between the stand and the gait [s]', 0.0, 30.0),
    'symmetry_gain': Spec(-1.0, 'gain of the symmetry lock [1/model time]; -1 chooses one that '
                          "makes the gait attract, 0 is the paper's model, in which it does not",
                          -1.0, 200.0),
    'combined_topic': Spec('joint_states', 'topic with all joints in one message; empty for none',
                           read_only=True),
    'command': Spec('none', 'command topic for ros2_control', read_only=True,
                    constraints='one of: ' + ', '.join(COMMANDS)),
    'autostart': Spec(True, 'ramp into the gait at start; false waits for ~/enable',
                      read_only=True),
}

_RANGES = {'a': (-20.0, 20.0, 'linear rate of each cell'),
           'b': (-20.0, 20.0, 'weight of each cell on itself'),
           'c': (-20.0, 20.0, "weight of the opposite leg's cell, delayed"),
           'd': (-20.0, 20.0, 'weight of the cell before it on the same side'),
           'tau': (STEP, MAX_DELAY, 'delay between opposite legs')}


def network_specs(preset: str) -> dict[str, Spec]:
    """Return the network's own parameters, with a preset's values as defaults."""
    values = PRESETS[preset].network.as_dict()
    return {f'delayed.{key}': Spec(values[key], f'{text} [model time]' if key == 'tau'
                                   else f'{text} [1/model time]', low, high)
            for key, (low, high, text) in _RANGES.items()}


@dataclass(frozen=True)
class Settings:
    """What a program is planned from; hashable, so that a plan is made once."""

    gait: str
    network: Delayed
    frequency: float
    amplitude: float
    symmetry_gain: float

    @staticmethod
    def planned_names() -> tuple[str, ...]:
        """Names of the parameters that make up the settings."""
        return ('gait', 'frequency', 'amplitude', 'symmetry_gain',
                *(f'delayed.{key}' for key in PARAMETERS))

    @classmethod
    def merged(cls, values: dict[str, Any]) -> 'Settings':
        """Build from all parameters by name.

        Raises:
            Refused: a value of the wrong kind, not finite, or an unknown gait.

        """
        for name in cls.planned_names():
            value = values[name]
            if name != 'gait' and not (isinstance(value, float) and math.isfinite(value)):
                raise Refused(f'{name} must be a finite number, not {value!r}')
        if values['gait'] not in PRESETS:
            raise Refused(f"gait '{values['gait']}' is not one of {', '.join(GAIT_NAMES)}")
        gain = values['symmetry_gain']
        if -1.0 < gain < 0.0:
            raise Refused(f'symmetry_gain {gain:g} is neither -1 (chosen) nor at least 0')
        network = Delayed(*(values[f'delayed.{key}'] for key in PARAMETERS))
        return cls(values['gait'], network, values['frequency'], values['amplitude'], gain)


class Planner:
    """Plans programs for one robot, remembering the latest ones."""

    def __init__(self, robot: Robot) -> None:
        self._robot = robot
        self.plan = functools.lru_cache(maxsize=16)(self._plan)

    def _plan(self, settings: Settings) -> Program:
        gait = PRESETS[settings.gait].gait
        return plan(self._robot, settings.gait, gait, settings.network, settings.frequency,
                    settings.amplitude, settings.symmetry_gain)


def as_doubles(parameters: list[Parameter], doubles: set[str]) -> list[Parameter]:
    """Turn whole numbers given for floating-point parameters into doubles.

    ``ros2 param set /cpg_generator frequency 2`` sends an integer; refusing it would be pedantry.
    """
    return [Parameter(p.name, Parameter.Type.DOUBLE, float(p.value))
            if p.name in doubles and p.type_ == Parameter.Type.INTEGER else p
            for p in parameters]


def with_preset(parameters: list[Parameter]) -> list[Parameter]:
    """Add the preset's network parameters to a batch that sets the gait.

    Network parameters in the same batch come after it and win. An unknown gait adds nothing;
    it is refused later.
    """
    preset = next((p.value for p in reversed(parameters)
                   if p.name == 'gait' and p.type_ == Parameter.Type.STRING), None)
    if preset not in PRESETS:
        return parameters
    given = {p.name for p in parameters}
    loaded = [Parameter(f'delayed.{key}', Parameter.Type.DOUBLE, value)
              for key, value in PRESETS[preset].network.as_dict().items()
              if f'delayed.{key}' not in given]
    return loaded + parameters

