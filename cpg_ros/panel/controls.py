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

"""The parameters of a node as controls of a page, made from its own descriptors."""

import asyncio
from collections.abc import Callable
import re
from typing import Any

from cpg_ros.nodes.node_client import CallError, NodeClient, RequestRefused
from cpg_ros.nodes.parameter_spec import choices, presets_among
from cpg_ros.panel.requests import RequestError
from rcl_interfaces.msg import ParameterEvent, ParameterType
from rclpy.parameter import parameter_value_to_python

#: Types that a page has a control for.
KINDS = {ParameterType.PARAMETER_BOOL: 'bool', ParameterType.PARAMETER_INTEGER: 'integer',
         ParameterType.PARAMETER_DOUBLE: 'double', ParameterType.PARAMETER_STRING: 'text'}
#: How long a node may take to judge a value, s: it may have to solve for a gait.
PATIENCE = 30.0
#: Parameters that every node of ROS has.
COMMON = ('qos_overrides.', 'start_type_description_service', 'use_sim_time')


def unit(text: str) -> str:
    """Return the unit in a description, as in ``rate [Hz]``; '' if it has none."""
    found = re.search(r'\[([^\]]+)\]', text)
    return found[1] if found else ''


class Controls:
    """One node's parameters.

    Attributes:
        known: name -> what a page needs to draw its control, with the value.

    """

    def __init__(self, node: NodeClient, report: Callable[[str], None]) -> None:
        """Control a node; ``report`` takes a line for each value that the node rejects."""
        self._node, self._report = node, report
        self.known: dict[str, dict[str, Any]] = {}
        self._waiting: dict[str, Any] = {}
        self._work: asyncio.Task | None = None

    async def read(self) -> None:
        """Read descriptors and values from the node.

        Raises:
            CallError: it does not answer.

        """
        names = [name for name in await self._node.parameters() if not name.startswith(COMMON)]
        described, values = await self._node.descriptors(names), await self._node.values(names)
        known = {}
        for name, about, value in zip(names, described, values, strict=True):
            if about.type not in KINDS:
                continue
            (span,) = (*about.floating_point_range, *about.integer_range)[:1] or (None,)
            known[name] = {
                'name': name, 'kind': KINDS[about.type], 'text': about.description,
                'unit': unit(about.description), 'fixed': about.read_only,
                'choices': choices(about.additional_constraints),
                'presets': presets_among(about.additional_constraints),
                'value': value,
                'low': span.from_value if span else None, 'high': span.to_value if span else None}
        self.known = known

    def hear(self, event: ParameterEvent) -> dict[str, Any]:
        """Store the changes of an event; return name -> value if they are this node's."""
        if event.node != self._node.name:
            return {}
        values = {one.name: parameter_value_to_python(one.value)
                  for one in event.changed_parameters if one.name in self.known}
        for name, value in values.items():
            self.known[name]['value'] = value
        return values

    def value(self, name: str) -> Any:
        """Return a parameter's value, None if there is none."""
        return self.known.get(name, {}).get('value')

    def set(self, name: str, value: Any) -> None:  # noqa: A003
        """Set a parameter soon; of several waiting values only the last one is sent.

        Raises:
            RequestError: the node has no such parameter, or the value is invalid.

        """
        about = self.known.get(name)
        if about is None:
            raise RequestError(f"{self._node.name} has no parameter '{name}'")
        if about['fixed']:
            raise RequestError(f'{name} cannot be changed while the node runs')
        self._waiting[name] = _fitting(about, value)
        if self._work is None or self._work.done():
            self._work = asyncio.get_running_loop().create_task(self._send())

    async def _send(self) -> None:
        while self._waiting:
            name = next(iter(self._waiting))
            value = self._waiting.pop(name)
            try:
                await self._node.set_parameters({name: value}, PATIENCE)
            except RequestRefused as error:
                self._report(f'{name} {value}: {error}')
            except CallError as error:
                self._report(str(error))


def _fitting(about: dict[str, Any], value: Any) -> Any:
    """Return a value converted to the kind of its parameter."""
    kind, name = about['kind'], about['name']
    right: Any = {'bool': bool, 'integer': int, 'double': (int, float), 'text': str}[kind]
    if not isinstance(value, right) or (kind != 'bool' and isinstance(value, bool)):
        raise RequestError(f'{name} must be a {kind}, not {value!r}')
    low, high = about['low'], about['high']
    if low is not None and not low <= value <= high:
        raise RequestError(f'{name} {value:g} is not from {low:g} to {high:g}')
    return float(value) if kind == 'double' else value
