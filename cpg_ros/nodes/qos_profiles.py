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

"""Qualities of service that more than one node uses."""

from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.qos_overriding_options import QoSOverridingOptions

#: For topics whose QoS can be overridden by parameters of the node.
OVERRIDABLE = QoSOverridingOptions.with_default_policies()


def latched(depth: int = 1) -> QoSProfile:
    """Return the QoS of a topic whose last messages wait for later subscribers."""
    return QoSProfile(depth=depth, durability=DurabilityPolicy.TRANSIENT_LOCAL)


def command_qos() -> QoSProfile:
    """Return the QoS of commands: only the newest one matters."""
    return QoSProfile(depth=1)


def best_effort(depth: int = 1) -> QoSProfile:
    """Return the QoS of a subscription that matches every publisher and delays none."""
    return QoSProfile(depth=depth, reliability=ReliabilityPolicy.BEST_EFFORT)
