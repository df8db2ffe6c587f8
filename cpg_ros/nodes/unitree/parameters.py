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

"""The parameters of ``unitree_bridge``."""

from cpg_ros.nodes.bridge_parameters import bridge_specs
from cpg_ros.nodes.parameter_spec import fixed, one_of, Spec
from cpg_ros.unitree.low_state import BUTTONS
from cpg_ros.unitree.models import MODELS

SPECS = fixed(bridge_specs(
    'unitree_go2',
    model=Spec('go2', 'robot model, which determines the torque limits',
               constraints=one_of(MODELS)),
    kp=Spec([60.0], 'proportional gains [N m / rad]',
            constraints='one number, three for hip, thigh and calf, or twelve in motor order'),
    kd=Spec([2.0], 'damping gains [N m s / rad]', constraints='as kp'),
    foot_scale=Spec(1.0, 'force per unit of a foot sensor [N]', 0.001, 1000.0),
    foot_offset=Spec([0.0], "what a foot sensor reads in the air, in the robot's units",
                     constraints="one number, or one for each leg in the robot file's order"),
    foot_threshold=Spec([0.0], 'force below which a foot is taken to be in the air [N]',
                        constraints='as foot_offset'),
    stop_button=Spec('B', 'button of the wireless remote that stops the robot, pressed alone or '
                     'with others', constraints=one_of(BUTTONS)),
    motion_switcher=Spec(True, "ask the robot's own service to release its motion modes; set to "
                         'false for simulators, which have none')))
