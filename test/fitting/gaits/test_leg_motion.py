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

"""What legs do besides their phases: on the spot, in a turn; and what their angles cannot say."""

from cpg_ros.fitting.gaits.stride import find_stride
from cpg_ros.fitting.recordings.recording import Recording
from cpg_ros.networks.library.biped import Biped
from cpg_ros.networks.library.delayed import Delayed
import numpy as np
import pytest

PHASES = {'lh': 0.0, 'rh': 0.5, 'lf': 0.5, 'rf': 0.0}


def stride_of(hip, knee, phases=PHASES, network=Delayed):
    """Return the stride of legs whose hip and knee are functions of phase (rad) and leg."""
    t, rng = np.arange(2000) / 200.0, np.random.default_rng(3)
    legs = {leg: (f'{leg}_hip', f'{leg}_knee') for leg in phases}
    angles = np.array([joint(2.0 * np.pi * (1.5 * t + phase), leg)
                       for leg, phase in phases.items() for joint in (hip, knee)]).T
    names = tuple(name for listed in legs.values() for name in listed)
    return find_stride(Recording(names, t, angles + 0.005 * rng.normal(size=angles.shape),
                                 'made up'), legs, network)


def hip(turn, leg):
    return 0.7 + 0.3 * np.cos(turn)


def knee(turn, leg):
    return -1.4 + 0.3 * np.sin(turn)


def lifted(turn):
    return np.maximum(np.cos(turn), 0.0)


def test_legs_that_travel_are_not_doubted():
    found = stride_of(hip, knee)
    assert found.gait == 'trot' and found.confidence > 0.95 and not found.issues
    # Knees that bend the other way behind than in front do not turn a robot.
    found = stride_of(lambda turn, leg: hip(turn, leg) * (1.0 if leg[1] == 'f' else -1.0),
                      lambda turn, leg: knee(turn, leg) * (1.0 if leg[1] == 'f' else -1.0))
    assert found.gait == 'trot' and not any('turns' in doubt for doubt in found.issues)


@pytest.mark.parametrize('phases', [PHASES, dict.fromkeys(PHASES, 0.0)])
def test_on_the_spot(phases):
    found = stride_of(lambda turn, leg: 0.7 + 0.15 * lifted(turn),
                      lambda turn, leg: -1.4 - 0.3 * lifted(turn), phases)
    assert found.nearest == ('trot' if any(phases.values()) else 'pronk')
    assert found.confidence <= 0.5 and 'step, or hop, on the spot' in found.issues[0]


@pytest.mark.parametrize(('size', 'doubted'), [(0.35, True), (1.2, False)])
def test_a_body_that_sways_on_its_feet_may_not_hop(size, doubted):
    # A dog that stands and pants was named a pronk, without a doubt.
    together, rest = dict.fromkeys(PHASES, 0.0), 0.7
    found = stride_of(lambda turn, leg: rest + size * (hip(turn, leg) - rest),
                      lambda turn, leg: -1.4 + size * (knee(turn, leg) + 1.4), together)
    assert found.nearest == 'pronk' and (found.confidence > 0.95) != doubted
    assert any('standing body sways' in one for one in found.issues) == doubted
    # Legs that alternate do not sway.
    walks = stride_of(lambda turn, leg: rest + size * (hip(turn, leg) - rest),
                      lambda turn, leg: -1.4 + size * (knee(turn, leg) + 1.4))
    assert walks.gait == 'trot' and walks.confidence > 0.95


def test_a_turn_on_the_spot():
    found = stride_of(lambda turn, leg: 0.7 + 0.3 * np.cos(turn) * (-1.0) ** (leg[0] == 'l'), knee)
    assert found.confidence <= 0.3 and 'it turns on the spot' in ' '.join(found.issues)


def bumps(turn, *places):
    """Bends of the knee about fractions of the stride from touchdown."""
    theta = turn / (2.0 * np.pi) % 1.0
    return sum(size * np.exp(-0.5 * (((theta - at + 0.5) % 1.0 - 0.5) / width) ** 2)
               for size, at, width in places)


@pytest.mark.parametrize(('swing', 'places'), [
    # After Winter (1991) and Novacheck (1998): load, and swing; rad and fractions of the stride.
    (0.35, ((0.25, 0.14, 0.06), (1.05, 0.72, 0.09))),
    (0.5, ((0.75, 0.16, 0.09), (1.7, 0.66, 0.12)))], ids=['walk', 'run'])
@pytest.mark.parametrize('sense', [1.0, -1.0])
@pytest.mark.parametrize('offset', [-0.5, 0.0, 0.5])
@pytest.mark.parametrize('scale', [0.6, 1.4])
def test_no_posture_tells_walk_from_run(swing, places, sense, offset, scale):
    found = stride_of(lambda turn, leg: 0.2 + offset + scale * swing * np.cos(turn + 0.3),
                      lambda turn, leg: sense * (0.08 + offset + scale * bumps(turn, *places)),
                      {'left': 0.0, 'right': 0.5}, Biped)
    assert set(found.candidates) == {'walk', 'run'} and found.confidence <= 0.5
    assert found.verdict == 'walk or run: cannot tell'
    assert any('walk or run: cannot tell' in issue and '--gait' in issue for issue in found.issues)
