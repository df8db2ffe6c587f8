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

"""Parameters and settings of a bridge; the state that it reads and the command that it sends."""

from dataclasses import dataclass
import math
from typing import Any

from cpg_ros.common.errors import InputError, ShortRepr
from cpg_ros.motion.robot import Robot
from cpg_ros.ros.command_topics import FEEDFORWARD, KINDS
from cpg_ros.ros.node.parameters import one_of, Spec
import numpy as np

# The parameters that every bridge has.

def bridge_specs(robot: str, **others: Spec) -> dict[str, Spec]:
    """Return the specs of a bridge's parameters; ``others`` are those of this bridge alone."""
    return {
        'robot': Spec(robot, 'robot file, or the name of a shipped one',
                      constraints='a shipped name, or the path of a YAML file'),
        **others,
        'urdf': Spec('', 'URDF or xacro file of the robot, published on robot_description; empty '
                     'for none'),
        'command': Spec('joint_states', 'kind of command messages to follow',
                        constraints=one_of(KINDS)),
        'torque_factor': Spec(1.0, "fraction of the motors' torque limits that commands may use",
                              0.1, 1.0),
        'feedforward': FEEDFORWARD,
        'rate': Spec(500.0, 'commands per second [Hz]', 100.0, 1000.0),
        'sensor_rate': Spec(500.0, 'measured states published per second, at most [Hz]', 1.0,
                            1000.0),
        'target_timeout': Spec(0.1, 'time without a new target after which the robot sits down '
                               '[s]', 0.02, 1.0),
        'state_timeout': Spec(0.02, 'time without a new state, or without a tick of the bridge, '
                              'after which the robot is damped [s]', 0.005, 0.2),
        'watchdog_timeout': Spec(0.0, 'time without a tick of the bridge after which its watchdog '
                                 'damps the robot, which then stays damped [s]; 0 for '
                                 'state_timeout', 0.0, 5.0),
        'tilt': Spec(50.0, 'tilt of the body at which the robot is damped [deg]', 10.0, 90.0),
        'hottest': Spec(85.0, 'motor temperature at which the robot is damped [deg C]', 30.0,
                        110.0),
        'tracking_error': Spec(0.3, 'mean distance of a joint from its commanded angle at which '
                               'the robot sits down [rad]', 0.05, 3.0),
        'tracking_time': Spec(1.0, 'time over which that mean is taken [s]', 0.1, 10.0),
        'own_publishers': Spec(0, "number of the robot's own publishers on the command topic", 0,
                               4),
        'exclusive': Spec(True, 'make the robot sit down if more than one node publishes the '
                          'commands to follow; if false, follow them all'),
        'autostart': Spec(True, 'start the robot at launch; if false, wait for ~/start'),
        'dry_run': Spec(False, 'compute and log everything, but send nothing')}


# State that a bridge reads from its robot, and command that it sends; subclassed by robot.

class RobotState:
    """The measured state; a subclass reads the robot's messages into it.

    The defaults are those of a robot without an IMU, temperatures or a counter.

    Attributes:
        q: angles, rad, shape (joints,), in the order of the robot's motors.
        dq: speeds, rad/s.
        temperature: of the motors, deg C, shape (joints,); empty if they are not measured.
        echo: numbers that every command must repeat to the robot.

    """

    temperature: np.ndarray = np.zeros(0)
    echo: np.ndarray = np.zeros(0)

    def __init__(self, joints: int) -> None:
        """Start with all angles and speeds at zero."""
        self.q, self.dq = np.zeros(joints), np.zeros(joints)

    def read(self, message: Any) -> bool:
        """Copy a message into the arrays; return whether it could be used."""
        raise NotImplementedError

    @property
    def tick(self) -> int:
        """The robot's own counter of its states, which must advance; 0 for none."""
        return 0

    @property
    def tilt_cosine(self) -> float:
        """Cosine of the angle between the body's and the world's vertical; 1 without an IMU."""
        return 1.0

    def reset_motor_faults(self) -> None:
        """Compare motors with their state as it is now, before the joints are driven."""

    def motor_fault(self) -> str:
        """Return which motor reports a fault, and which, or ''."""
        return ''


class JointCommand:
    """The command for all joints, filled in place; a subclass encodes it for the robot.

    Each motor applies tau + kp (q - angle) + kd (dq - speed).

    Attributes:
        q: target angles, rad, shape (joints,), in the order of the robot's motors.
        dq: target speeds, rad/s.
        tau: torques added, N m.
        kp: N m / rad.
        kd: N m s / rad.
        echo: numbers of the robot's state that it repeats.

    """

    echo: np.ndarray = np.zeros(0)

    def __init__(self, joints: int) -> None:
        """Start with all numbers at zero: no torque."""
        self.q, self.dq, self.tau, self.kp, self.kd = np.zeros((5, joints))

    def damp(self, kd: float | np.ndarray) -> None:
        """Only brake the joints: kp 0, no torque, ``kd`` in N m s / rad."""
        self.q[:] = self.dq[:] = self.tau[:] = self.kp[:] = 0.0
        self.kd[:] = kd

    def encode(self) -> Any:
        """Return the command as a message, or as the bytes of one."""
        raise NotImplementedError


@dataclass(frozen=True, eq=False, repr=False)
class BridgeSettings(ShortRepr):
    """Joints, gains, poses, limits and times; arrays have shape (joints,), in motor order.

    Attributes:
        names: of the joints.
        kp: N m / rad.
        kd: N m s / rad.
        torque: largest one of a command, N m.
        lower: smallest angles, rad.
        upper: largest angles, rad.
        velocity: largest speeds of commanded angles, rad/s.
        stand: pose to rise to, rad.
        lying: pose to sit down to, rad.
        most_kp: limit to which a generator's feedback may scale kp, N m / rad.
        period: of commands, s.
        damping: kd of joints that are only damped, N m s / rad, of all or shape (joints,).
        rack: whether the robot hangs in a rack until it is released, see ``BridgeState.HANGING``.
        rise: time from the measured pose to the stand, s.
        approach: time from the stand to the first targets, s.
        late: time at the last target after which the legs gather at the stand, s.
        fade: time in which a gait fades to the stand before the robot sits, s; less than ``sit``.
        sit: time from the stand to lying, s.
        fold: time in which legs in mid-stride join that motion, or gather at the stand, s.
        target_timeout: longest time without a fresh target, s.
        state_timeout: longest time without a fresh state, s.
        tilt: largest tilt of the body, rad.
        hottest: motor temperature at which the robot is damped, deg C.
        margin: tolerance of measured angles beyond the joint limits, rad: a swinging leg runs into
            its stop.
        astray: largest distance from the stand after rising, rad.
        tracking_error: largest mean distance of a joint from its commanded angle while it follows
            targets, rad.
        tracking_time: time constant of that mean, s.

    """

    names: tuple[str, ...]
    kp: np.ndarray
    kd: np.ndarray
    torque: np.ndarray
    lower: np.ndarray
    upper: np.ndarray
    velocity: np.ndarray
    stand: np.ndarray
    lying: np.ndarray
    most_kp: float = math.inf
    period: float = 0.002
    damping: float | np.ndarray = 5.0
    rack: bool = False
    rise: float = 2.0
    approach: float = 1.0
    late: float = 0.03
    fade: float = 0.5
    sit: float = 1.5
    fold: float = 0.06
    target_timeout: float = 0.1
    state_timeout: float = 0.02
    tilt: float = math.radians(50.0)
    hottest: float = 85.0
    margin: float = 0.2
    astray: float = 0.4
    tracking_error: float = math.inf
    tracking_time: float = 1.0


#: MAX_HELD_SPEED: largest speed of the commanded angle of a joint that is held, rad/s.
MAX_HELD_SPEED = 5.0


def check_joints(robot: Robot, joints: tuple[str, ...], whose: str) -> None:
    """Check that a robot file has the joints of the motors; ``whose`` names the motors' owner.

    Raises:
        InputError: it lacks one, or drives a joint that has no motor.

    """
    missing = [name for name in joints if name not in (*robot.order, *robot.held)]
    extra = [name for name in robot.order if name not in joints]
    if missing or extra:
        name = (missing or extra)[0]
        raise InputError(f"the robot file '{robot.name}' has {'no ' if missing else ''}joint "
                         f"'{name}'; {whose} have {', '.join(joints)}")


def settings_for(robot: Robot, joints: tuple[str, ...], *, kp: np.ndarray, kd: np.ndarray,
                 torque: np.ndarray, lying: np.ndarray, **others: Any) -> BridgeSettings:
    """Return the settings of a robot file, which gives limits, speeds and the stand.

    Arrays have shape (joints,), as ``joints``, in motor order: gains ``kp`` (N m / rad) and ``kd``
    (N m s / rad), the largest ``torque`` (N m) and the pose ``lying`` (rad), clipped to the
    limits. Joints that the file holds have no limits. ``others`` are further attributes of
    ``BridgeSettings``.
    """
    driven = {joint.name: joint for joint in robot.joints}
    rows = [(-math.inf, math.inf, MAX_HELD_SPEED, robot.held[name]) if name in robot.held else
            (driven[name].lower, driven[name].upper, driven[name].velocity, driven[name].offset)
            for name in joints]
    lower, upper, velocity, stand = np.array(rows, dtype=float).T
    return BridgeSettings(joints, kp, kd, torque, lower, upper, velocity, stand,
                          np.clip(lying, lower, upper), **others)
