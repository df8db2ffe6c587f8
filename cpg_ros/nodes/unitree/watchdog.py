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

"""A process that damps the robot while its bridge says nothing: see ``unitree.vigil``.

The bridge starts it: python -m cpg_ros.nodes.unitree.watchdog DOMAIN TOPIC PERIOD PROCESS. It ends
when a bridge says that the robot rests, or when the bridge is gone before it ever drove the robot.
It hears processes of its own user only.
"""

import os
from pathlib import Path
import select
import signal
import socket
import sys
import time

from cpg_ros.nodes.log_queue import NO_FILE, QUEUE, QueuedLogger
from cpg_ros.nodes.unitree.interfaces import message
from cpg_ros.nodes.unitree.local_socket import address, listening, NameTaken, of_this_user
from cpg_ros.nodes.unitree.robot_graph import quality, WATCHDOG
from cpg_ros.nodes.unitree.watchdog_link import NAME_TAKEN
from cpg_ros.unitree.low_cmd import LowCmd
from cpg_ros.unitree.vigil import Vigil
import rclpy
from rclpy.impl.rcutils_logger import RcutilsLogger
from rclpy.publisher import Publisher
from rclpy.signals import SignalHandlerOptions

#: How often it looks whether a bridge that has not driven yet is there, s.
LOOK = 1.0
#: With this score the kernel ends it last, or not at all, when memory runs out: see proc(5).
SPARED = '-1000'


def alive(process: int) -> bool:
    """Tell whether there is a process of this number."""
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    return True


def spared() -> bool:
    """Ask the kernel to spare this process when memory runs out; tell whether it will."""
    try:
        Path('/proc/self/oom_score_adj').write_text(SPARED)
    except OSError:
        return False
    return True


def hear(line: socket.socket, vigil: Vigil) -> bool:
    """Take what has come over a connection; tell whether it is still open."""
    # Of what waits, the last word counts: ticks that were late are no sign of life.
    while not vigil.over:
        try:
            word = line.recv(1024)
        except BlockingIOError:
            return True
        except ConnectionResetError:
            return False
        if not word:
            return False
        vigil.hear(word, time.monotonic())
    return True


def accept(listener: socket.socket) -> list[socket.socket]:
    """Return the connection that waits, if it is one of this user."""
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


def watch(listener: socket.socket, publisher: Publisher, period: float, process: int,
          told: RcutilsLogger) -> None:
    """Damp whenever ticks are missing, until the end is told."""
    vigil, command, lines = Vigil(period), LowCmd(), [listener]
    while not vigil.over:
        wait = vigil.wait(time.monotonic())
        ready, _, _ = select.select(lines, [], [], LOOK if wait is None else wait)
        for line in ready:
            if line is listener:
                lines += accept(listener)
            elif not hear(line, vigil):
                line.close()
                lines.remove(line)
        if not ready and wait is None and not alive(process):
            return
        if vigil.due(time.monotonic()):
            before = vigil.alarms
            command.damp(vigil.kd[:len(command.kd)])
            publisher.publish(command.sealed())
            if before != vigil.alarms:
                told.error('the bridge is silent: damping until it is back')


def main(args: list[str]) -> int:
    """Watch until told to end; return the exit code."""
    domain, topic, period, process = int(args[0]), args[1], float(args[2]), int(args[3])
    # Ctrl-C in the bridge's terminal is the bridge's to handle.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    QUEUE.start(WATCHDOG, [])
    rclpy.init(args=['--ros-args', NO_FILE], domain_id=domain,
               signal_handler_options=SignalHandlerOptions.NO)
    node = rclpy.create_node(WATCHDOG, enable_rosout=False, start_parameter_services=False,
                             use_global_arguments=False)
    publisher = node.create_publisher(message('unitree_go/LowCmd'), topic, quality())
    logger = QueuedLogger(node.get_logger().name)
    if not spared():
        logger.info('this process may be ended when memory runs out: it lacks CAP_SYS_RESOURCE')
    try:
        listener = listening(address('watchdog', domain, topic))
    except NameTaken:
        rclpy.shutdown()
        return NAME_TAKEN
    with listener:
        watch(listener, publisher, period, process, logger)
    rclpy.shutdown()
    return 0


if __name__ == '__main__':
    sys.exit(main(sys.argv[1:]))
