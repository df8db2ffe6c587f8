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

"""Faults of a robot's sensors: true measurements go in, messages with the fault come out.

The messages are bytes, as a subscription delivers them. Each fault is a row of the table that
``benchmarks/bench_faults.py`` runs.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
import math

from geometry_msgs.msg import Quaternion, Vector3
import numpy as np
from rclpy.serialization import serialize_message
from sensor_msgs.msg import Imu, JointState
from std_msgs.msg import Float64MultiArray

#: Topics of the inputs.
IMU, JOINTS, FEET = INPUTS = 'imu', 'measured', 'foot_contacts'
#: A fault that does not last begins then and takes so long, s.
BEGINS, TAKES = 1.5, 1.2


@dataclass(frozen=True)
class Measured:
    """What a robot measures at an instant.

    Attributes:
        imu: orientation (x y z w), angular velocity in rad/s, acceleration in m/s^2, (10,).
        names: of the joints.
        positions, velocities, efforts: of the joints, rad, rad/s, N m.
        loads: on the feet, N.

    """

    imu: np.ndarray
    names: tuple[str, ...]
    positions: np.ndarray
    velocities: np.ndarray
    efforts: np.ndarray
    loads: np.ndarray


#: Takes what is measured, the first measurement under the fault, and random numbers.
Change = Callable[[Measured, Measured, np.random.Generator], Measured]


@dataclass(frozen=True)
class Fault:
    """One fault.

    Attributes:
        change: of what is measured.
        lasting: whether it is there from before the first step to the end.
        seconds: else how long it lasts.
        inputs: topics that it affects.
        drop: fraction of the messages that do not arrive.
        every: interval of the messages, s; 0 for every tick.
        delay: from the measurement to its message, s.
        stamp: offset of the stamps, s; NaN for stamps of 0.
        swap: fraction of the messages that arrive after their successor.
        twice: whether each message arrives again at the next tick, too.
        stall: the generator's process stands still for so long instead, s.

    """

    change: Change | None = None
    lasting: bool = False
    seconds: float = TAKES
    inputs: tuple[str, ...] = INPUTS
    drop: float = 0.0
    every: float = 0.0
    delay: float = 0.0
    stamp: float = 0.0
    swap: float = 0.0
    twice: bool = False
    stall: float = 0.0


def _all(value: float, fraction: float = 1.0) -> Change:
    def change(now: Measured, _: Measured, rng: np.random.Generator) -> Measured:
        if rng.random() >= fraction:
            return now
        return Measured(np.full(10, value), now.names, *(
            np.full(one.size, value) for one in (now.positions, now.velocities, now.efforts,
                                                 now.loads)))
    return change


def _frozen(_: Measured, first: Measured, __: np.random.Generator) -> Measured:
    return first


def _imu(made: Callable[[np.ndarray], np.ndarray]) -> Fault:
    return Fault(lambda now, *_: replace(now, imu=made(now.imu)), True, inputs=(IMU,))


def _signs(*signs: float) -> Fault:
    return _imu(lambda imu: imu * np.array(signs))


def _quaternion_product(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    (ax, ay, az, aw), (bx, by, bz, bw) = a, b
    return np.array([aw * bx + ax * bw + ay * bz - az * by, aw * by - ax * bz + ay * bw + az * bx,
                     aw * bz + ax * by - ay * bx + az * bw, aw * bw - ax * bx - ay * by - az * bz])


def mounted(axis: int, degrees: float) -> Callable[[np.ndarray], np.ndarray]:
    """Return what an IMU shows that is turned about an axis of the base."""
    angle = math.radians(degrees)
    turn = np.zeros(4)
    turn[axis], turn[3] = math.sin(0.5 * angle), math.cos(0.5 * angle)
    one, two = (axis + 1) % 3, (axis + 2) % 3
    to_imu = np.eye(3)
    to_imu[one, one] = to_imu[two, two] = math.cos(angle)
    to_imu[one, two], to_imu[two, one] = math.sin(angle), -math.sin(angle)
    return lambda imu: np.concatenate([_quaternion_product(imu[:4], turn), to_imu @ imu[4:7],
                                       to_imu @ imu[7:]])


def _leaning(degrees: float) -> Fault:
    turn = np.array([0.0, 0.5 * math.radians(degrees), 0.0, 1.0])
    turn /= np.linalg.norm(turn)
    return _imu(lambda imu: np.concatenate([_quaternion_product(imu[:4], turn), imu[4:]]))


def _without_gravity(imu: np.ndarray) -> np.ndarray:
    x, y, z, w = imu[:4]
    up = np.array([2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)])
    return np.concatenate([imu[:7], imu[7:] - 9.81 * up])


def _missing(now: Measured, *_) -> Measured:
    return replace(now, names=now.names[1:], positions=now.positions[1:],
                   velocities=now.velocities[1:], efforts=now.efforts[1:])


def _extra(now: Measured, *_) -> Measured:
    return replace(now, names=(*now.names, 'gripper'), **{
        key: np.append(getattr(now, key), math.nan)
        for key in ('positions', 'velocities', 'efforts')})


def _reordered(now: Measured, *_) -> Measured:
    return replace(now, names=now.names[::-1], positions=now.positions[::-1],
                   velocities=now.velocities[::-1], efforts=now.efforts[::-1])


def _swapped_names(now: Measured, *_) -> Measured:
    return replace(now, names=(now.names[1], now.names[0], *now.names[2:]))


def _noise(now: Measured, _: Measured, rng: np.random.Generator) -> Measured:
    imu = now.imu.copy()
    imu[:4] += 0.002 * rng.standard_normal(4)
    imu[4:7] += 0.05 * rng.standard_normal(3)
    imu[7:] += 0.5 * rng.standard_normal(3)
    return replace(now, imu=imu,
                   positions=now.positions + 0.002 * rng.standard_normal(now.positions.size),
                   velocities=now.velocities + 0.2 * rng.standard_normal(now.velocities.size),
                   loads=now.loads * (1.0 + 0.2 * rng.standard_normal(now.loads.size)))


def _spikes(now: Measured, _: Measured, rng: np.random.Generator) -> Measured:
    if rng.random() >= 0.02:
        return now
    imu = now.imu.copy()
    imu[4 + rng.integers(6)] += rng.choice([-1.0, 1.0]) * 30.0
    velocities = now.velocities.copy()
    velocities[rng.integers(velocities.size)] += rng.choice([-1.0, 1.0]) * 15.0
    return replace(now, imu=imu, velocities=velocities)


def _first_joint(made: Callable[[Measured, Measured], tuple[float, float]]) -> Change:
    def change(now: Measured, first: Measured, _: np.random.Generator) -> Measured:
        positions, velocities = now.positions.copy(), now.velocities.copy()
        positions[1], velocities[1] = made(now, first)
        return replace(now, positions=positions, velocities=velocities)
    return change


def _foot(made: Callable[[Measured, Measured], np.ndarray]) -> Fault:
    return Fault(lambda now, first, _: replace(now, loads=made(now, first)), True, inputs=(FEET,))


#: The table.
FAULTS: dict[str, Fault] = {
    'none': Fault(),
    **{f'{what} {name}': Fault(change, inputs=(topic,), drop=drop)
       for what, change, drop in (('NaN', _all(math.nan), 0.0), ('inf', _all(math.inf), 0.0),
                                  ('frozen', _frozen, 0.0), ('dropped', None, 1.0))
       for topic, name in ((IMU, 'imu'), (JOINTS, 'joints'), (FEET, 'feet'))},
    '10 Hz': Fault(every=0.1),
    'publisher dies 3 s': Fault(drop=1.0, seconds=3.0),
    **{f'delay {ms} ms': Fault(lasting=True, delay=1e-3 * ms) for ms in (20, 50, 60, 90, 200)},
    **{f'delay {ms} ms from a walk on': Fault(seconds=math.inf, delay=1e-3 * ms)
       for ms in (20, 50)},
    'imu delay 28 ms': Fault(lasting=True, delay=0.028, inputs=(IMU,)),
    '0.2 s without imu': Fault(seconds=0.2, inputs=(IMU,), drop=1.0),
    'stamps 1 s ahead': Fault(stamp=1.0),
    'stamps 1 s old': Fault(stamp=-1.0),
    'stamps 0': Fault(stamp=math.nan),
    'a joint missing': Fault(_missing, inputs=(JOINTS,)),
    'no velocities': Fault(lambda now, *_: replace(now, velocities=np.zeros(0)),
                           inputs=(JOINTS,)),
    'short positions': Fault(lambda now, *_: replace(now, positions=now.positions[:-2]),
                             inputs=(JOINTS,)),
    '10 % NaN': Fault(_all(math.nan, 0.1)),
    'duplicated': Fault(twice=True),
    'reordered names': Fault(_reordered, inputs=(JOINTS,)),
    'extra NaN joint': Fault(_extra, inputs=(JOINTS,)),
    'reordered messages': Fault(swap=0.2),
    'gyroscope bias .5': _imu(lambda imu: imu + np.repeat([0.0, 0.5, 0.0], [4, 3, 3])),
    'tilt 9 degrees': _leaning(9.0),
    'tilt 17 degrees': _leaning(17.0),
    'noise': Fault(_noise, True),
    'spikes': Fault(_spikes, True),
    'all at 50 Hz': Fault(lasting=True, every=0.02),
    'feet stuck at load': _foot(lambda now, first: np.full(
        now.loads.size, max(first.loads.sum(), 50.0) / now.loads.size)),
    'feet swapped': _foot(lambda now, _: now.loads[::-1]),
    'a foot dead': _foot(lambda now, _: np.append(0.0, now.loads[1:])),
    'encoder off .25': Fault(_first_joint(
        lambda now, _: (now.positions[1] + 0.25, now.velocities[1])), inputs=(JOINTS,)),
    'encoder stuck': Fault(_first_joint(lambda _, first: (first.positions[1], 0.0)),
                           inputs=(JOINTS,)),
    'two names swapped': Fault(_swapped_names, True, inputs=(JOINTS,)),
    'IMU orientation negated': _signs(-1, -1, -1, 1, 1, 1, 1, 1, 1, 1),
    'IMU rates negated': _signs(1, 1, 1, 1, -1, -1, -1, 1, 1, 1),
    'IMU acceleration negated': _signs(1, 1, 1, 1, 1, 1, 1, -1, -1, -1),
    'IMU NED': _signs(1, -1, -1, 1, 1, -1, -1, 1, -1, -1),
    'IMU pitch negated': _signs(1, -1, 1, 1, 1, -1, 1, -1, 1, 1),
    'IMU turned 90 about z': _imu(mounted(2, 90.0)),
    'IMU turned -90 about z': _imu(mounted(2, -90.0)),
    'IMU turned 180 about z': _imu(mounted(2, 180.0)),
    'IMU in units of g': _imu(lambda imu: np.concatenate([imu[:7], imu[7:] / 9.81])),
    'IMU without gravity': _imu(_without_gravity),
    **{f'stalled {seconds:g} s': Fault(stall=seconds) for seconds in (0.2, 1.0, 5.0)},
}


class Wire:
    """Stands for a subscription: what was put on the wire is taken once."""

    wires: dict[str, 'Wire'] = {}

    def __init__(self, _node: object, _kind: type, topic: str, raw: bool) -> None:
        assert raw
        self.topic = topic
        self.data: bytes | None = None
        self.wires[topic] = self

    def newest(self) -> bytes | None:
        """Return the newest message since the last call."""
        data, self.data = self.data, None
        return data


def messages(measured: Measured, stamp: float) -> dict[str, bytes]:
    """Return the messages of an instant, stamped in s, by topic."""
    q = measured.imu
    imu = Imu(orientation=Quaternion(**dict(zip('xyzw', q[:4].tolist(), strict=True))),
              angular_velocity=Vector3(**dict(zip('xyz', q[4:7].tolist(), strict=True))),
              linear_acceleration=Vector3(**dict(zip('xyz', q[7:].tolist(), strict=True))))
    joints = JointState(name=list(measured.names), position=measured.positions.tolist(),
                        velocity=measured.velocities.tolist(), effort=measured.efforts.tolist())
    seconds, nanoseconds = divmod(0 if math.isnan(stamp) else max(round(1e9 * stamp), 0), 10**9)
    for one in (imu, joints):
        one.header.stamp.sec, one.header.stamp.nanosec = seconds, nanoseconds
    return {IMU: serialize_message(imu), JOINTS: serialize_message(joints),
            FEET: serialize_message(Float64MultiArray(data=measured.loads.tolist()))}


class FaultySensors:
    """Sensors with a fault of FAULTS.

    Attributes:
        begins, ends: of the fault, s.

    """

    def __init__(self, fault: str, seed: int = 0, begins: float = BEGINS) -> None:
        self._fault, self._rng = FAULTS[fault], np.random.default_rng(seed)
        lasting = self._fault.lasting
        self.begins = 0.0 if lasting else begins
        self.ends = math.inf if lasting else begins + (self._fault.stall or self._fault.seconds)
        self._first: Measured | None = None
        self._coming: list[tuple[float, str, bytes]] = []
        self._before: dict[str, bytes] = {}
        self._sent = -math.inf

    def stalled(self, now: float) -> bool:
        """Tell whether the generator's process stands still."""
        return self._fault.stall > 0.0 and self.begins <= now < self.ends

    def put(self, now: float, measured: Measured) -> None:
        """Put on the wires what arrives now, in s, when this is measured."""
        fault, wires = self._fault, Wire.wires
        good = messages(measured, now)
        if not self.begins <= now < self.ends:
            for topic, data in good.items():
                wires[topic].data = data
            return
        if self._first is None:
            self._first = measured
        bad = good
        if fault.change is not None or fault.stamp:
            changed = (measured if fault.change is None else
                       fault.change(measured, self._first, self._rng))
            bad = messages(changed, now + fault.stamp)
        due = now - self._sent > fault.every - 1e-6
        if due:
            self._sent = now
        for topic, data in good.items():
            if topic not in fault.inputs:
                wires[topic].data = data
            elif due and self._rng.random() >= fault.drop:
                self._send(now, topic, bad[topic])
        for one in [one for one in self._coming if one[0] <= now + 1e-6]:
            wires[one[1]].data = one[2]
            self._coming.remove(one)

    def _send(self, now: float, topic: str, data: bytes) -> None:
        fault = self._fault
        if fault.twice and topic in self._before:
            self._coming.append((now, topic, self._before.pop(topic)))
            return
        if fault.twice:
            self._before[topic] = data
        if fault.swap and topic not in self._before and self._rng.random() < fault.swap:
            # Held back until its successor has arrived.
            self._before[topic] = data
            return
        self._coming.append((now + fault.delay, topic, data))
        if fault.swap and topic in self._before:
            self._coming.append((now, topic, self._before.pop(topic)))
