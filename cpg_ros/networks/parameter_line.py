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

"""A line in a network's parameter space: parameters that move together, each with a sign."""

from dataclasses import dataclass, replace
from typing import TypeVar

from cpg_ros.errors import InputError
from cpg_ros.networks.network import Network
import numpy as np

AnyNetwork = TypeVar('AnyNetwork', bound=Network)


@dataclass(frozen=True)
class ParameterLine:
    """Parameters that are set to plus or minus one value; written ``alpha=-beta``.

    Attributes:
        names: of the parameters.
        signs: 1.0 or -1.0 for each; the first is 1.

    """

    names: tuple[str, ...]
    signs: tuple[float, ...]

    @classmethod
    def parse(cls, text: str, network: type[Network]) -> 'ParameterLine':
        """Read ``tau``, ``alpha=beta``, ``alpha=-beta`` or a group of the network, ``w_a``.

        Raises:
            InputError: a name that is not a parameter of the network, or given twice.

        """
        names: list[str] = []
        signs: list[float] = []
        for part in text.split('='):
            name = part.strip().removeprefix('-')
            members = network.members(name)
            for member in members:
                if member in names:
                    raise InputError(f"'{text}' names {member} twice")
            sign = -1.0 if part.strip().startswith('-') else 1.0
            if not names and sign < 0.0:
                raise InputError(f"'{text}' must not begin with a minus")
            names.extend(members)
            signs.extend([sign] * len(members))
        return cls(tuple(names), tuple(signs))

    @classmethod
    def of(cls, line: 'ParameterLine | str', network: type[Network]) -> 'ParameterLine':
        """Return the line itself, or the one that a text such as ``tau`` names; see parse."""
        return cls.parse(line, network) if isinstance(line, str) else line

    def __str__(self) -> str:
        return '='.join(('' if sign > 0.0 else '-') + name
                        for name, sign in zip(self.names, self.signs, strict=True))

    def value(self, network: Network) -> float:
        """Where a network is on the line: the value of its first parameter."""
        return network.as_dict()[self.names[0]]

    def direction(self, network: Network) -> np.ndarray:
        """Return the parameters' derivative by the value on the line, (parameters,)."""
        signs = dict(zip(self.names, self.signs, strict=True))
        return np.array([signs.get(name, 0.0) for name in network.parameters()])

    def at(self, network: AnyNetwork, value: float) -> AnyNetwork:
        """Return the network with the parameters set."""
        return replace(network, **{  # type: ignore[type-var]
            name: sign * value for name, sign in zip(self.names, self.signs, strict=True)})
