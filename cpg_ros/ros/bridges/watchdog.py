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

"""A process that damps the robot while its bridge is silent: see ``TickMonitor``.

The bridge starts it: ``python -m cpg_ros.ros.bridges.watchdog`` INTERFACE DOMAIN NAMESPACE TOPIC
PERIOD TIMEOUT PROCESS. It ends when a bridge reports that the robot is at rest, or when the bridge
ends before it ever drove the robot. It accepts connections only from processes of the same user.
"""

import contextlib
from pathlib import Path
import pkgutil
import select
import signal
import socket
import sys
import time

from cpg_ros.ros.bridges.robot_state import JointCommand
from cpg_ros.ros.bridges.watchdog_link import (
    address,
    listening,
    NAME_TAKEN,
    NameTaken,
    of_this_user,
    TickMonitor,
)
from cpg_ros.ros.node.console import never_wait, STREAM_ARGUMENTS
from cpg_ros.ros.node.polled import command_qos
import rclpy
from rclpy.impl.rcutils_logger import RcutilsLogger
from rclpy.publisher import Publisher
from rclpy.signals import SignalHandlerOptions

#: CHECK_PERIOD: period in which it checks that a bridge that has not driven yet still runs, s.
CHECK_PERIOD = 1.0


def spared() -> bool:
    """Ask the kernel to spare this process when memory is exhausted; return whether it agrees."""
    try:
        # The kernel then spares this process when memory runs out, see proc(5).
        Path('/proc/self/oom_score_adj').write_text('-1000')
    except OSError:
        return False
    return True


def receive(line: socket.socket, monitor: TickMonitor) -> bool:
    """Read all messages of a connection; return whether it is still open."""
    # Only the last waiting message counts: late ticks do not prove that the bridge lives.
    while not monitor.ended:
        try:
            message = line.recv(1024)
        except BlockingIOError:
            return True
        except ConnectionResetError:
            return False
        if not message:
            return False
        monitor.receive(message, time.monotonic())
    return True


def accept(listener: socket.socket) -> list[socket.socket]:
    """Return the waiting connection, if it is from a process of this user."""
    try:
        line, _ = listener.accept()
    # It may have gone again.
    except OSError:
        return []
    line.setblocking(False)
    if of_this_user(line):
        return [line]
    line.close()
    return []


def tell(lines: list[socket.socket]) -> None:
    """Tell the bridge that its robot was damped in its absence."""
    for line in lines:
        # One that is gone, or whose queue is full of the same, needs no other.
        with contextlib.suppress(OSError):
            line.send(TickMonitor.ACTED)


def watch(listener: socket.socket, publisher: Publisher, command: JointCommand,
          monitor: TickMonitor, process: int, logger: RcutilsLogger) -> None:
    """Damp whenever ticks are missing, until the bridge announces its end."""
    lines = [listener]
    while not monitor.ended:
        wait = monitor.timeout(time.monotonic())
        ready, _, _ = select.select(lines, [], [], CHECK_PERIOD if wait is None else wait)
        for line in ready:
            if line is listener:
                lines += accept(listener)
            elif not receive(line, monitor):
                line.close()
                lines.remove(line)
        if not ready and wait is None and not Path(f'/proc/{process}').exists():
            return
        before = monitor.alarms
        if monitor.due(time.monotonic()):
            joints, echo = len(command.kd), command.echo
            command.damp(monitor.kd[:joints])
            echo[:] = monitor.kd[joints:joints + len(echo)]
            publisher.publish(command.encode())
            if before != monitor.alarms:
                tell(lines[1:])
                logger.error('the bridge is silent: damping until it is back')


def main(args: list[str]) -> int:
    """Watch until a bridge announces its end; return the exit code."""
    interface, domain, namespace, topic = (pkgutil.resolve_name(args[0]), int(args[1]),
                                           *args[2:4])
    period, timeout, process = float(args[4]), float(args[5]), int(args[6])
    name = interface.watchdog_name()
    # Ctrl-C in the bridge's terminal is the bridge's to handle.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    never_wait(name, [])
    rclpy.init(args=[*STREAM_ARGUMENTS], domain_id=domain,
               signal_handler_options=SignalHandlerOptions.NO)
    node = rclpy.create_node(name, namespace=namespace, enable_rosout=False,
                             start_parameter_services=False, use_global_arguments=False)
    publisher = node.create_publisher(interface.command_type(), topic, command_qos())
    logger = node.get_logger()
    if not spared():
        logger.info('this process may be ended when memory runs out: it lacks CAP_SYS_RESOURCE')
    try:
        listener = listening(address(interface.maker, 'watchdog', domain, topic))
    except NameTaken:
        rclpy.shutdown()
        return NAME_TAKEN
    with listener:
        watch(listener, publisher, interface.make_command(), TickMonitor(period, timeout),
              process, logger)
    rclpy.shutdown()
    return 0


if __name__ == '__main__':
    sys.exit(main(sys.argv[1:]))
