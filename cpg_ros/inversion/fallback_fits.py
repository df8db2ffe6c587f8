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
from cpg_ros.inversion.leg_duty import GAIT_DUTY, GaitReadout
from cpg_ros.motion.plan import refusal
from cpg_ros.networks.network import Network
import numpy as np

#: Half the range of a parameter that keeps its value, over that value.
STAYS = 1e-9
#: A duty that no robot file states is one of the recording's where legs that stand as the cells
#: do fit worse by this many standard errors, or where it is known to this standard error.
ASKED, KNOWN = 3.3, 0.03
#: Names, order and starts of a fit, and what they are in words.
Way = tuple[tuple[str, ...], int, Sequence[Mapping[str, float]], str]


def _ways(names: tuple[str, ...], order: int, starts: Sequence[Mapping[str, float]]
          ) -> Iterator[Way]:
    yield names, order, starts, ''
    if starts:
        yield names, order, (), 'fitted from the start of the preset'
    for lower in range(order - 1, 0, -1):
        yield names, lower, (), f'fitted with readouts of order {lower}'
    for name in names if len(names) > 1 else ():
        yield (name,), order, (), f'fitted with {name} free alone'


def fit_with_fallbacks(cycle: MeanCycle, cells: Mapping[str, int], network: Network, gait: str,
                       free: Sequence[str] = (), order: int = 3,
                       starts: Sequence[Mapping[str, float]] = (),
                       readout: GaitReadout | None = None,
                       done: Callable[[float], None] = lambda share: None
                       ) -> tuple[Fit, tuple[str, ...]]:
    """Fit with these names and this order, or as near to them as the generator runs.

    Without names, the usual ones and the duty of the gait are fitted; the duty only if the readout
    has one, or else if the recording tells it from that of the network's cells.

    Args: as of invert.

    Returns:
        The fit, and warnings of what was given up for it.

    Raises:
        InputError: as in invert.
        NoOrbit: not even the parameters given have an orbit that the generator runs.

    """
    readout = readout or GaitReadout.of(type(network), gait)
    first, known = '', tuple(free) or network.free

    def fitted(names: tuple[str, ...], lower: int, begins: Sequence[Mapping[str, float]]
               ) -> tuple[Fit, tuple[str, ...]]:
        if not names:
            # Phases are known beforehand, and no other parameter shows.
            return _as_it_is(cycle, cells, network, gait, lower, readout, done), ()
        return invert(cycle, cells, network, gait, names, lower, begins, readout=readout,
                      done=done), ()

    for names, lower, begins, relaxation in _ways(known, order, starts):
        try:
            if free or begins:
                fit, notes = fitted(names, lower, begins)
            elif readout.duty is not None:
                fit, notes = fitted((*names, GAIT_DUTY), lower, begins)
            else:
                fit, notes = _with_duty_if_told(names, lower, fitted)
        except NoOrbit as error:
            first = first or str(error)
            continue
        flaw = refusal(fit.orbit, gait, fit.harmonics)
        if not flaw:
            return fit, (*notes, *((f'not fitted as asked for: {first}; {relaxation} instead',)
                                   if relaxation else ()))
        first = first or f'the generator would refuse the {gait} that fits best: {flaw}'
    fit = _as_it_is(cycle, cells, network, gait, order, readout, done)
    if flaw := refusal(fit.orbit, gait, fit.harmonics):
        raise NoOrbit(f'{first}; nor does the generator run the parameters given: {flaw}')
    return fit, (f'not fitted as asked for: {first}; the parameters stay those of the preset, '
                 'only the readouts are fitted',)


def _with_duty_if_told(names: tuple[str, ...], order: int,
                       fitted: Callable[..., tuple[Fit, tuple[str, ...]]]
                       ) -> tuple[Fit, tuple[str, ...]]:
    """Fit with legs that stand as the cells do, unless the recording tells another duty."""
    try:
        other, _ = fitted((*names, GAIT_DUTY), order, ())
    except NoOrbit:
        return fitted(names, order, ())
    own, _ = fitted(names, order, [{}, *(dict(zip(names, one.values.tolist(), strict=False))
                                         for one in other.minima)])
    sizes = np.array(list(other.sizes.values()))[:, None]
    rise = 0.5 * float(np.sum((own.errors / sizes)**2)) - other.cost
    if rise > 0.5 * ASKED**2 * other.sharing:
        return other, ()
    error = other.parameters[GAIT_DUTY].stderr
    return own, () if error < KNOWN else (
        'the recording does not tell how long legs stand: they are taken to stand as the cells of '
        'the network do, and the intervals hold for that alone',)


def _as_it_is(cycle: MeanCycle, cells: Mapping[str, int], network: Network, gait: str, order: int,
              readout: GaitReadout, done: Callable[[float], None]) -> Fit:
    """Fit readouts to the gait of a network whose parameters stay."""
    name = next(iter(network.parameters()))
    value, kind = float(network.as_dict()[name]), network.ranges[name]
    room = STAYS * max(abs(value), 1.0)
    bounds = {name: (max(kind.low, value - room), min(kind.high, value + room))}
    fit = invert(cycle, cells, network, gait, (name,), order, ({},), readout=readout,
                 bounds=bounds, profiles=False, done=done)
    # The parameter was never fitted: an interval would claim what is not known.
    return replace(fit, parameters={}, correlation=np.empty((0, 0)), warnings=())
