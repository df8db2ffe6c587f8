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

"""The policies for DDS security: of sros2's schema, and enough for what running nodes do."""

from pathlib import Path

from graph import EXECUTABLE, Process, until
from lxml import etree
import pytest
import rclpy
from servo_chain import calibrated, ServoChain

ROOT = Path(__file__).resolve().parents[2]
POLICY = etree.parse(ROOT / 'resource' / 'security' / 'policy.xml')


def test_the_policies_are_of_the_schema():
    schema = etree.XMLSchema(etree.parse(ROOT / 'test' / 'data' / 'sros2_policy.xsd'))
    schema.assertValid(POLICY)
    POLICY.find('.//topics').set('publish', 'PERHAPS')
    assert not schema.validate(POLICY)
    POLICY.find('.//topics').set('publish', 'ALLOW')


def allowed(executable, kind, what):
    """Return the full names that an enclave may use."""
    (enclave,) = POLICY.findall(f".//enclave[@path='/cpg/{executable}']")
    node = enclave.find('.//profile').get('node')
    return {name if name.startswith('/') else f'/{name.replace("~", f"{node}/")}'
            for rules in enclave.findall(f".//{kind}s[@{what}='ALLOW']")
            for name in (one.text for one in rules.findall(kind))}


@pytest.mark.parametrize(('executable', 'node', 'sign', 'words'), [
    ('generator', 'cpg_generator', 'publishing', [
        'cmd_vel:=true', 'robot:=unitree_go2', 'command:=forward_position', "combined_topic:=''",
        'assume_stand:=true']),
    ('robot_sim', 'robot_sim', 'Go2|go2', []),
    ('inversion', 'cpg_inversion', 'listening', []),
    ('panel', 'cpg_panel', 'http://', ['port:=0']),
    ('unitree_bridge', 'unitree_bridge', 'heard|hears|wait|state', ['dry_run:=true']),
    ('servo_bridge', 'servo_bridge', 'dry run', [
        'dry_run:=true', 'robot:=biped', 'command:=forward_position', 'calibration:={servos}']),
    ('servo_bus', 'servo_bus', '4 servos', ['calibration:={servos}'])])
def test_a_running_node_needs_no_more_than_its_policy(executable, node, sign, words, tmp_path):
    chain = ServoChain(dict.fromkeys((1, 2, 3, 4), 2048))
    servos = calibrated(tmp_path, chain.path)
    given = [part for word in words for part in ('-p', word.format(servos=servos))]
    process = Process(*given, executable=EXECUTABLE.with_name(executable))
    context = rclpy.Context()
    rclpy.init(context=context, domain_id=process.domain)
    looker = rclpy.create_node('looker', context=context)
    try:
        process.wait_for(sign)
        services = {name for name, _ in until(
            lambda: looker.get_service_names_and_types_by_node(node, '/')
            if node in looker.get_node_names() else None, f'the node {node}')}
        published = {name for name, _ in looker.get_publisher_names_and_types_by_node(node, '/')}
        heard = {name for name, _ in looker.get_subscriber_names_and_types_by_node(node, '/')}
    finally:
        looker.destroy_node()
        rclpy.shutdown(context=context)
        process.end()
        chain.end()
    assert published and published <= allowed(executable, 'topic', 'publish')
    assert heard <= allowed(executable, 'topic', 'subscribe')
    assert services and services <= allowed(executable, 'service', 'reply')
