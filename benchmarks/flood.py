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

"""Ask a generator for changes without end, each of which it must plan: until SIGINT.

Requests of 200 frequencies and single ones of the network's parameters, forty of them unanswered
at any time.
"""

import itertools
import signal
import time

from client import ParameterClient
from rcl_interfaces.msg import Parameter, ParameterType, ParameterValue
from rcl_interfaces.srv import SetParameters
import rclpy
from rclpy.qos import qos_profile_parameters
from rclpy.signals import SignalHandlerOptions

WAITING = 40


def double(name: str, value: float) -> Parameter:
    return Parameter(name=name, value=ParameterValue(type=ParameterType.PARAMETER_DOUBLE,
                                                     double_value=value))


def main() -> None:
    ending: list[int] = []
    rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    signal.signal(signal.SIGINT, lambda number, _: ending.append(number))
    client = ParameterClient()
    own = [name for name in client.names() if name in ('quadruped.alpha', 'quadruped.beta')]
    values = client.get(own)
    setter = client.node.create_client(SetParameters, 'cpg_generator/set_parameters',
                                       qos_profile=qos_profile_parameters)
    setter.wait_for_service()
    futures: list = []
    print('flooding', flush=True)
    for k in itertools.count():
        batch = [double('frequency', 1.0 + 0.005 * ((n + k) % 200)) for n in range(200)]
        if k % 4:
            name = own[k % len(own)]
            batch = [double(name, values[name] + 1e-5 * (k % 997))]
        futures.append(setter.call_async(SetParameters.Request(parameters=batch)))
        while len(futures) >= WAITING and not ending:
            client._executor.spin_once(timeout_sec=0.05)
            futures = [one for one in futures if not one.done()]
        if ending:
            break
        time.sleep(0.001)
    print(f'{k} requests', flush=True)
    rclpy.shutdown()


if __name__ == '__main__':
    main()
