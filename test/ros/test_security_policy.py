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
from panel_client import Client, start_panel
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
    nodes = [(profile.get('node'), profile) for profile in enclave.iterfind('.//profile')]
    return {name if name.startswith('/') else f'/{name.replace("~", f"{node}/")}'
            for node, profile in nodes for rules in profile.findall(f"{kind}s[@{what}='ALLOW']")
            for name in (one.text for one in rules.findall(kind))}


def used(looker, node):
    """Return the names that a node publishes, hears and answers."""
    services = until(lambda: looker.get_service_names_and_types_by_node(node, '/')
                     if node in looker.get_node_names() else None, f'the node {node}')
    return [{name for name, _ in entries} for entries in (
        looker.get_publisher_names_and_types_by_node(node, '/'),
        looker.get_subscriber_names_and_types_by_node(node, '/'), services)]


def test_the_panel_may_record_what_any_node_publishes_or_hears():
    named = {name for enclave in POLICY.iterfind('.//enclave')
             for what in ('publish', 'subscribe')
             for name in allowed(enclave.get('path').removeprefix('/cpg/'), 'topic', what)}
    assert named | {'/tf_static', '/clock'} == allowed('panel', 'topic', 'subscribe')


def test_a_panel_that_records_needs_no_more_than_its_policy(tmp_path):
    generator = Process('-p', 'robot:=unitree_go2', '-p', 'stamped:=true')
    panel, address = start_panel(generator.domain, '-p', f'recordings:={tmp_path}')
    context = rclpy.Context()
    rclpy.init(context=context, domain_id=generator.domain)
    looker = rclpy.create_node('looker', context=context)
    page = None
    try:
        generator.wait_for('publishing')
        page = Client(address).ready()
        until(lambda: page.value('rate'), 'the parameters')
        page.send(do='record', on=True)
        until(lambda: '/cpg_generator/cells_stamped' in used(looker, 'cpg_panel_watch')[1],
              'recording')
        published, heard, services = used(looker, 'cpg_panel_watch')
    finally:
        if page is not None:
            page.end()
        looker.destroy_node()
        rclpy.shutdown(context=context)
        for process in (panel, generator):
            process.end()
    assert published <= allowed('panel', 'topic', 'publish')
    assert heard <= allowed('panel', 'topic', 'subscribe')
    assert services <= allowed('panel', 'service', 'reply')


@pytest.mark.parametrize(('executable', 'node', 'sign', 'words'), [
    ('generator', 'cpg_generator', 'publishing', [
        'cmd_vel:=true', 'robot:=unitree_go2', 'command:=forward_position', "combined_topic:=''",
        'assume_stand:=true', 'stamped:=true']),
    ('generator', 'cpg_generator', 'until it is configured', ['managed:=true']),
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
        published, heard, services = used(looker, node)
    finally:
        looker.destroy_node()
        rclpy.shutdown(context=context)
        process.end()
        chain.end()
    assert published and published <= allowed(executable, 'topic', 'publish')
    assert heard <= allowed(executable, 'topic', 'subscribe')
    assert services and services <= allowed(executable, 'service', 'reply')
