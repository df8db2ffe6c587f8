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

"""The numerical kernels of a network, made ready before a node starts."""

import time

from cpg_ros.motion.precompile import precompile
from rclpy.impl.rcutils_logger import RcutilsLogger


def compile_kernels(network: str, logger: RcutilsLogger) -> None:
    """Compile or load the kernels of a network, as find_network takes it; say so if compiling."""
    began = time.monotonic()
    announced: list[str] = []

    def compiling() -> None:
        if not announced:
            announced.append('compiling the numerical kernels; only the very first start needs '
                             'this (10 to 20 s)')
            logger.info(announced[0])

    precompile(network, compiling)
    if announced:
        logger.info(f'compiled in {time.monotonic() - began:.1f} s')
