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

"""The closed loop for callers that are not Python: its address, and arguments in memory.

It loads numba, and so is loaded only where feedback is switched on.
"""

import ctypes
from typing import Any

from cpg_ros.dynamics.integration.machine_code import machine_function
from cpg_ros.feedback.biped.balance import balance, read_measurements
from cpg_ros.feedback.biped.balanced_pattern import BalancedPattern
from cpg_ros.feedback.biped.feedback import BipedFeedback
from cpg_ros.feedback.closed_loop import (
    close,
    DT,
    finish,
    FOOT_CONTACTS,
    Instant,
    LoopData,
    Senses,
)
from cpg_ros.feedback.estimate import Odometry, SensorData
from cpg_ros.feedback.feedback import Feedback
from cpg_ros.feedback.kinematics import forward, Geometry, LegArrays
from cpg_ros.motion.robot import Robot
from numba.extending import intrinsic
import numpy as np


def _load(_, pointer):
    """Return the value at a pointer, laid out as by memory_of."""
    def code(target, builder, signature, arguments):
        kind = target.get_value_type(pointer.dtype).as_pointer()
        return builder.load(builder.bitcast(arguments[0], kind))
    return pointer.dtype(pointer), code


_loaded: Any = intrinsic(_load)


def _close(arguments):
    return close(_loaded(arguments))


def _finish(arguments):
    finish(_loaded(arguments))
    return 0


def closing_function(loop: LoopData) -> Any:
    """Compile ``close`` as a function of C, ``int64_t f(const void *)``, at its ``address``."""
    return machine_function(_close, loop)


def finishing_function(loop: LoopData) -> Any:
    """Compile ``finish`` as closing_function does ``close``, of the same data."""
    return machine_function(_finish, loop)


def _balance(arguments):
    (senses, sensors, legs, numbers, rows, watch, biped) = _loaded(arguments)
    read_measurements(senses, sensors, legs, numbers, rows, watch)
    balance(biped, watch, numbers[DT])
    return 0


def balancing_function(arguments: tuple) -> Any:
    """Compile ``read_measurements`` and ``balance`` as closing_function does ``close``.

    Args:
        arguments: of the first, then BipedArrays.

    """
    return machine_function(_balance, arguments)


def memory_of(value: Any) -> Any:
    """Return an array, a number or a tuple of such as that function takes it.

    Arrays are not kept: the memory has their addresses.
    """
    if isinstance(value, np.ndarray):
        words = 0, 0, value.size, value.itemsize, value.ctypes.data, *value.shape, *value.strides
        return (ctypes.c_int64 * len(words))(*words)
    if isinstance(value, tuple):
        parts = [memory_of(part) for part in value]
        kind = type('Memory', (ctypes.Structure,), {'_fields_': [
            (f'part{k}', type(part)) for k, part in enumerate(parts)]})
        return kind(*parts)
    kinds = {bool: ctypes.c_bool, int: ctypes.c_int64, float: ctypes.c_double}
    return kinds[type(value)](value)


def _inputs(legs: int, joints: int) -> tuple[Senses, SensorData]:
    """Return the inputs of a robot that has sent nothing."""
    return (Senses.empty(legs, np.zeros((3, joints)), np.zeros(4), 1.0, FOOT_CONTACTS),
            SensorData.zeros(1, legs, joints))


def warm_up_balance(robot: Robot) -> None:
    """Compile what a generator uses of a robot with soles."""
    feedback = BipedFeedback(robot)
    pattern = BalancedPattern(feedback.plan)
    pattern.prepare(feedback)
    nothing = LegArrays(np.zeros((0, 1)), np.zeros((0, 3), dtype=np.int64), 0.0, 1.0)
    balancing_function((*_inputs(len(robot.legs), len(feedback.order)), nothing, np.zeros(2),
                        feedback.biped.servos.rows, pattern.watch, feedback.biped))


def warm_up(geometry: Geometry, joints: int) -> None:
    """Compile what a generator uses; joints is their number."""
    legs, angles = len(geometry.hips), np.zeros(joints)
    loop = LoopData.of(Feedback(geometry, joints=joints), *_inputs(legs, joints),
                       Instant.empty(legs, np.zeros(1)), angles, angles, Odometry.begin(), angles)
    closing_function(loop)
    finishing_function(loop)
    forward(geometry, angles)
