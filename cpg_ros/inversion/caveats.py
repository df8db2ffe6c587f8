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

"""The caveats of a fit, in words."""

from collections.abc import Mapping, Sequence

from cpg_ros.inversion.free_parameters import Free
from cpg_ros.inversion.identifiability import Estimate, SHARE, Spread
from cpg_ros.inversion.trust_region import Minimisation
import numpy as np

#: A 95 % interval wider than this share of the value on either side is named.
WIDE = 0.1
#: So are correlations beyond this, and ends this near a bound, over the bounds' distance.
TOGETHER, AT_BOUND = 0.95, 1e-5


def findings(free: Sequence[Free], estimates: Mapping[str, Estimate], known: Spread,
             best: Minimisation
             ) -> list[str]:
    """List the caveats of a fit.

    Args:
        free: the free numbers.
        estimates: of them.
        known: their covariance, and that of the phase.
        best: the start that led to the fit.

    """
    found = []
    for row in known.blind:
        blind = [one.name for one, share in zip(free, row, strict=False) if abs(share) > SHARE]
        if len(blind) == 1:
            found.append(f'{blind[0]} is not determined: it changes nothing that was recorded')
        elif blind:
            moves = row[:len(free)] * known.scale[:len(free)]
            moves = moves / np.abs(moves).max()
            ways = ', '.join(f'{one.name} by {move:+.3g}' for one, move
                             in zip(free, moves, strict=True) if one.name in blind)
            found.append(f'{_listed(blind)} are not determined one by one: moving {ways} '
                         'changes nothing that was recorded')
    for k, (name, one) in enumerate(estimates.items()):
        room = AT_BOUND * (free[k].high - free[k].low)
        for end, bound in (('lower', free[k].low), ('upper', free[k].high)):
            if abs(one.value - bound) <= room:
                found.append(f'{name} ends at its {end} bound {bound:g}: its interval is '
                             'one-sided')
        if np.isfinite(one.stderr) and (not one.bounded or max(
                one.high - one.value, one.value - one.low) > WIDE * abs(one.value)):
            found.append(
                f'{name} is badly determined: any value from {one.low:.4g} to {one.high:.4g} fits '
                'as well' + ('' if one.bounded else ', and the range ends there only because its '
                             'bound is reached or the gait ceases to exist')
                + '; with a free readout, it affects only the shape of the waveform')
    errors = known.correlation
    for k in range(len(free)):
        for other in range(k):
            if abs(errors[k, other]) > TOGETHER:
                found.append(f'{free[other].name} and {free[k].name} are hard to tell apart: '
                             f'their correlation is {errors[k, other]:.3f}')
    if not best.converged:
        found.append(f'the trust region was stopped after {best.evaluations} evaluations, '
                     'before it had converged')
    return found


def _listed(names: Sequence[str]) -> str:
    return ' and '.join([', '.join(names[:-1]), names[-1]])
