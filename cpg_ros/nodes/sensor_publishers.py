"""What a simulated robot publishes: built once, filled in place and published every period."""

from collections.abc import Callable
from importlib import import_module, util
from typing import Any

import numpy as np
from geometry_msgs.msg import TransformStamped
from nav_msgs.msg import Odometry
from rclpy.node import Node
from rclpy.qos import QoSProfile
from rclpy.qos_overriding_options import QoSOverridingOptions
from sensor_msgs.msg import Imu, JointState
from std_msgs.msg import Float64MultiArray, MultiArrayDimension

from cpg_ros.nodes.joint_publishers import view_of
from cpg_ros.simulation.body import Body
from cpg_ros.simulation.inertial_unit import InertialUnit
from cpg_ros.simulation.robot_model import legs


class Measurements:
    """``joint_states``, ``odom``, ``foot_contacts``, ``imu`` and, where tf2 is, ``/tf``."""

    def __init__(self, node: Node, body: Body, unit: InertialUnit) -> None:
        """Publish what a body does, and what an inertial unit on it shows."""
        self._body, self._unit = body, unit
        names, feet = list(body.robot.order), legs(body.robot)
        self._joints = JointState(name=names)
        self._views = [view_of(self._joints, field, len(names))
                       for field in ('position', 'velocity', 'effort')]
        self._odometry = Odometry(child_frame_id='base')
        self._odometry.header.frame_id = 'odom'
        self._contacts = Float64MultiArray()
        self._forces = view_of(self._contacts, 'data', len(feet))
        self._contacts.layout.dim = [MultiArrayDimension(label=','.join(feet), stride=1,
                                                         size=len(feet))]

        def publisher(kind: type, topic: str) -> Callable[[Any], None]:
            return node.create_publisher(
                kind, topic, QoSProfile(depth=100),
                qos_overriding_options=QoSOverridingOptions.with_default_policies()).publish

        self._publish = [(publisher(JointState, 'joint_states'), self._joints),
                         (publisher(Odometry, 'odom'), self._odometry),
                         (publisher(Float64MultiArray, 'foot_contacts'), self._contacts)]
        self._imu = Imu()
        self._imu.header.frame_id = 'base'
        self._publish_imu = publisher(Imu, 'imu')
        self._transform = TransformStamped(child_frame_id='base')
        self._transform.header.frame_id = 'odom'
        if util.find_spec('tf2_msgs'):
            kind = import_module('tf2_msgs.msg').TFMessage
            self._publish.append((publisher(kind, '/tf'), kind(transforms=[self._transform])))

    def publish(self, stamp: int) -> None:
        """Publish what the body does now; stamp in ns."""
        body, odometry = self._body, self._odometry
        seconds, nanoseconds = divmod(stamp, 1_000_000_000)
        for header in (self._joints.header, odometry.header, self._transform.header):
            header.stamp.sec, header.stamp.nanosec = seconds, nanoseconds
        for view, values in zip(self._views, (body.position, body.velocity, body.torque),
                                strict=True):
            view[:] = values
        self._forces[:] = body.feet
        pose, twist = odometry.pose.pose, odometry.twist.twist
        _fill(pose.position, 'xyz', body.base)
        _fill(pose.orientation, 'wxyz', body.quaternion)
        _fill(self._transform.transform.translation, 'xyz', body.base)
        _fill(self._transform.transform.rotation, 'wxyz', body.quaternion)
        moving = body.twist
        _fill(twist.linear, 'xyz', moving[:3])
        _fill(twist.angular, 'xyz', moving[3:])
        # First of all what feedback needs.
        arrived = self._unit.measure(stamp)
        if arrived is not None:
            imu, values = self._imu, arrived[1]
            imu.header.stamp.sec, imu.header.stamp.nanosec = divmod(arrived[0], 1_000_000_000)
            _fill(imu.orientation, 'xyzw', values[:4])
            _fill(imu.angular_velocity, 'xyz', values[4:7])
            _fill(imu.linear_acceleration, 'xyz', values[7:])
            self._publish_imu(imu)
        for publish, message in self._publish:
            publish(message)


def _fill(message: object, fields: str, values: np.ndarray) -> None:
    for field, value in zip(fields, values.tolist(), strict=True):
        setattr(message, field, value)
