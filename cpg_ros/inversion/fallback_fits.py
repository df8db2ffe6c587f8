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

"""A fit for every steady gait: where the requested one has no orbit, a simpler one.

In turn: other starts, lower orders of the readouts, one free parameter alone, and last the
parameters of the preset, with readouts fitted to them. A warning names what was given up.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace

from cpg_ros.dynamics.periodic import NoOrbit
from cpg_ros.inversion.fit_data import MeanCycle
from cpg_ros.inversion.gait_fit import Fit
from cpg_ros.inversion.invert import invert
from cpg_ros.motion.plan import refusal
from cpg_ros.networks.network import Network
import numpy as np

#: Half the range of a parameter that keeps its value, over that value.
STAYS = 1e-9
#: Names, order and starts of a fit, and what they are in words.
Way = tuple[tuple[str, ...], int, Sequence[Mapping[str, float]], str]


def _ways(names: tuple[str, ...], order: int, starts: Sequence[Mapping[str, float]]
          ) -> Iterator[Way]:
    yield names, order, starts, ''
    if any(starts):
        yield names, order, ({},), 'fitted from the start of the preset'
    for lower in range(order - 1, 0, -1):
        yield names, lower, ({},), f'fitted with readouts of order {lower}'
    for name in names if len(names) > 1 else ():
        yield (name,), order, ({},), f'fitted with {name} free alone'


def fit_with_fallbacks(cycle: MeanCycle, cells: Mapping[str, int], network: Network, gait: str,
                       free: Sequence[str], order: int, starts: Sequence[Mapping[str, float]],
                       done: Callable[[float], None] = lambda share: None
                       ) -> tuple[Fit, tuple[str, ...]]:
    """Fit with these names and this order, or as near to them as the generator runs.

    Args: as of invert.

    Returns:
        The fit, and warnings of what was given up for it.

    Raises:
        InputError: as in invert.
        NoOrbit: not even the parameters given have an orbit that the generator runs.

    """
    if not (free or network.free):
        # Phases are known beforehand, and no other parameter shows.
        return _as_it_is(cycle, cells, network, gait, order, done), ()
    first = ''
    for names, lower, begins, relaxation in _ways(tuple(free or network.free), order, starts):
        try:
            fit = invert(cycle, cells, network, gait, names, lower, begins, done=done)
        except NoOrbit as error:
            first = first or str(error)
            continue
        flaw = refusal(fit.orbit, gait, fit.harmonics)
        if not flaw:
            return fit, (f'not fitted as asked for: {first}; {relaxation} instead',
                         ) if relaxation else ()
        first = first or f'the generator would refuse the {gait} that fits best: {flaw}'
    fit = _as_it_is(cycle, cells, network, gait, order, done)
    if flaw := refusal(fit.orbit, gait, fit.harmonics):
        raise NoOrbit(f'{first}; nor does the generator run the parameters given: {flaw}')
    return fit, (f'not fitted as asked for: {first}; the parameters stay those of the preset, '
                 'only the readouts are fitted',)


def _as_it_is(cycle: MeanCycle, cells: Mapping[str, int], network: Network, gait: str, order: int,
              done: Callable[[float], None]) -> Fit:
    """Fit readouts to the gait of a network whose parameters stay."""
    name = next(iter(network.parameters()))
    value, kind = float(network.as_dict()[name]), network.ranges[name]
    room = STAYS * max(abs(value), 1.0)
    bounds = {name: (max(kind.low, value - room), min(kind.high, value + room))}
    fit = invert(cycle, cells, network, gait, (name,), order, bounds=bounds, profiles=False,
                 done=done)
    # The parameter was never fitted: an interval would claim what is not known.
    return replace(fit, parameters={}, correlation=np.empty((0, 0)), warnings=())
