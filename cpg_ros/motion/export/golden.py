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

"""Golden vectors: output of the Python generator, and a test in C that compares with it."""

from collections.abc import Sequence
from dataclasses import dataclass

from cpg_ros.common.errors import ShortRepr
from cpg_ros.dynamics.integration.c_text import braces
from cpg_ros.dynamics.integration.stepper import Stepper
from cpg_ros.motion.export.gait_data import GaitData
from cpg_ros.motion.pattern import Pattern, SUBSTEP
from cpg_ros.motion.plan import GaitPlan
from cpg_ros.motion.strides import StrideCommand
import numpy as np

#: STEPS: steps of the network alone; EVERY_STEP: steps from one compared state to the next.
STEPS, EVERY_STEP = 400, 40
#: RAMP: duration of the ramp, s; BETWEEN: time between switches, s; TRANSITION: cross-fade, s.
RAMP, BETWEEN, TRANSITION = 1.0, 2.5, 1.0
SWITCHES = 10
SEED = 20


@dataclass(frozen=True, eq=False, repr=False)
class Golden(ShortRepr):
    """Output of the Python generator, with which the C is compared.

    Attributes:
        start: constant past of the first gait's network, shape (components,).
        states: of the network every EVERY_STEP steps from there, shape (n, components).
        dt: tick, s.
        events: tick -> gait to switch to; -1 ramps to the stand.
        strides: strides of the legs and the pace at each event, shape (events, legs + 1); None
            without steering.
        every: ticks between samples.
        positions: of the joints, rad, shape (n, joints).
        network_tolerance: of the states.
        tolerance: of the positions, rad.

    """

    start: np.ndarray
    states: np.ndarray
    dt: float
    events: dict[int, int]
    strides: np.ndarray | None
    every: int
    positions: np.ndarray
    network_tolerance: float
    tolerance: float

    def _summary(self) -> str:
        return f'{self.switches} switches, {len(self.positions)} samples every {self.dt:g} s'

    @property
    def switches(self) -> int:
        """Number of changes of the gait."""
        return len(self.events) - 1


def network_states(plan: GaitPlan) -> tuple[np.ndarray, np.ndarray]:
    """Return a state, and the states every EVERY_STEP steps after a constant past there."""
    network = plan.orbit.network
    states = plan.orbit(np.array(0.0))
    start = states + 0.1 * np.random.default_rng(SEED).uniform(-1.0, 1.0, states.size)
    stepper = Stepper(network, start, plan.step, gain=plan.gain, symmetry=plan.orbit.symmetry)
    rows = []
    for step in range(1, STEPS + 1):
        stepper.advance(stepper.step)
        if step % EVERY_STEP == 0:
            rows.append(stepper.newest())
    return start, np.array(rows)


def schedule(gaits: int, dt: float) -> dict[int, int]:
    """Return times and gaits of SWITCHES switches, and of the final stand."""
    times = [RAMP + BETWEEN * n for n in range(SWITCHES + 1)]
    ticks = [round(time / dt) for time in times]
    gait_at = {tick: (n + 1) % gaits for n, tick in enumerate(ticks[:-1])} if gaits > 1 else {}
    return {**gait_at, ticks[-1] if gaits > 1 else round(5.0 / dt): -1}


def run_pattern(plans: Sequence[GaitPlan], dt: float, events: dict[int, int],
                strides: np.ndarray | None, substep: float = SUBSTEP) -> np.ndarray:
    """Return the joints' positions after each tick, rad, shape (ticks, joints)."""
    command = None if strides is None else StrideCommand(len(plans[0].robot.legs))
    pattern, samples = Pattern(plans[0], RAMP, strides=command), []
    pattern.substep, steered = substep, iter(() if strides is None else strides)
    for tick in range(max(events) + round(1.5 * RAMP / dt)):
        event = events.get(tick)
        if event is not None and command is not None:
            *stride, pace = next(steered)
            pattern.steer(np.array(stride), pace)
        if event == -1:
            pattern.enable(False, RAMP)
        elif event is not None:
            pattern.apply(plans[event], TRANSITION)
        pattern.advance(dt)
        samples.append(pattern.position.copy())
    return np.array(samples)


def golden_of(data: GaitData, dt: float, substep: float = SUBSTEP) -> Golden:
    """Run the Python generator through SWITCHES switches between gaits.

    Args:
        data: the gaits.
        dt: tick, s.
        substep: longest part of a tick while gaits fade, s; longer ones than the generator's
            change the transitions.

    """
    plans = data.plans
    start, states = network_states(plans[0])
    events = schedule(len(plans), dt)
    every = max(1, round(0.1 / dt))
    strides = None
    if data.format.steering:
        draws, legs = np.random.default_rng(SEED), len(data.robot.legs)
        # Numbers that both types have.
        strides = np.round(draws.uniform([-1.0] * legs + [0.5], [1.0] * (legs + 1),
                                         (len(events), legs + 1)) * 64.0) / 64.0
    positions = run_pattern(plans, dt, events, strides, substep)[every - 1::every]
    exact = data.format.real == 'float64' and data.format.form == 'network'
    # Of float32 what a coarser table leaves, too. Where the pattern slows, each part of a tick
    # follows from the last one: the longer they are, the more of a rounding is left in the phase.
    tolerance = (1e-5 if exact else 1e-3) + 10.0 * data.format.tolerance
    if not exact and substep > SUBSTEP:
        tolerance += 0.75 * substep
    return Golden(start, states, dt, events, strides, every, positions,
                  0.0 if data.format.form == 'table' else 1e-11 if exact else 1e-4,
                  tolerance)


NETWORK_TEST = """
static int network(void)
{
    static cpg_track track;
    static const cpg_real start[CPG_COMPONENTS] = @START@;
    static const cpg_real states[@STATES@][CPG_COMPONENTS] = @STATE_ROWS@;
    double worst = 0.0;
    cpg_network_hold(&track, 0, start);
    for (int n = 0; n < @STATES@; n++) {
        for (int step = 0; step < @EVERY_STEP@; step++) {
            cpg_network_step(&track);
        }
        for (int i = 0; i < CPG_COMPONENTS; i++) {
            worst = fmax(worst, fabs((double)track.x[track.head][i] - (double)states[n][i]));
        }
    }
    printf("network: %d steps, largest difference %.3g (tolerance @NETWORK_TOLERANCE@)\\n",
           @STATES@ * @EVERY_STEP@, worst);
    return !(worst <= @NETWORK_TOLERANCE@);
}
"""
TEST = """
static int pattern(void)
{
    static cpg c;
    static const int ticks[@EVENTS@] = @TICKS@;
    static const int gaits[@EVENTS@] = @GAITS@;
@STRIDES@    static const cpg_real positions[@SAMPLES@][CPG_JOINTS] = @POSITIONS@;
    double worst = 0.0;
    int event = 0;
    cpg_start(&c, 0, (cpg_real)@RAMP@);
    for (int tick = 0; tick < @SAMPLES@ * @EVERY@; tick++) {
        if (event < @EVENTS@ && ticks[event] == tick) {
@STEER@            if (gaits[event] < 0) {
                cpg_enable(&c, 0, (cpg_real)@RAMP@);
            } else {
                cpg_switch(&c, (uint8_t)gaits[event], (cpg_real)@TRANSITION@);
            }
            event++;
        }
        cpg_advance(&c, (cpg_real)@DT@);
        for (int joint = 0; (tick + 1) % @EVERY@ == 0 && joint < CPG_JOINTS; joint++) {
            const double off = (double)c.position[joint]
                             - (double)positions[tick / @EVERY@][joint];
            worst = fmax(worst, fabs(off));
        }
    }
    printf("pattern: %d switches, largest difference %.3g rad, %.3g degrees "
           "(tolerance @TOLERANCE@ rad)\\n", @EVENTS@ - 1, worst, worst * 57.29577951308232);
    return !(worst <= @TOLERANCE@);
}

int main(void)
{
    int failed = 0;
@CALLS@
    return failed ? EXIT_FAILURE : EXIT_SUCCESS;
}
"""


def golden_test(golden: Golden, real: str, title: str) -> str:
    """Write a test in C that exits with 1 if the C of gaits differs from the Python generator."""
    both = golden.network_tolerance > 0.0
    text = ('#include "cpg.h"\n\n#include <math.h>\n#include <stdio.h>\n#include <stdlib.h>\n'
            + (NETWORK_TEST if both else '') + TEST)
    events = golden.events
    for key, value in (
            ('STRIDES', '' if golden.strides is None else
             '    static const cpg_real strides[@EVENTS@][CPG_LEGS + 1] = '
             f'{braces(golden.strides, real)};\n'),
            ('STEER', '' if golden.strides is None else
             '            cpg_steer(&c, strides[event], strides[event][CPG_LEGS]);\n'),
            ('START', braces(golden.start, real)), ('STATES', len(golden.states)),
            ('STATE_ROWS', braces(golden.states, real)), ('EVERY_STEP', EVERY_STEP),
            ('NETWORK_TOLERANCE', f'{golden.network_tolerance:g}'), ('EVENTS', len(events)),
            ('TICKS', braces(list(events), real)), ('GAITS', braces(list(events.values()), real)),
            ('SAMPLES', len(golden.positions)), ('POSITIONS', braces(golden.positions, real)),
            ('RAMP', RAMP), ('EVERY', golden.every), ('TRANSITION', TRANSITION),
            ('DT', repr(golden.dt)),
            ('TOLERANCE', f'{golden.tolerance:g}'),
            ('CALLS', '\n'.join(f'    failed += {name}();' for name in
                                (*(['network'] if both else []), 'pattern')))):
        text = text.replace(f'@{key}@', str(value))
    return f'/* {title}: golden vectors of the Python generator. */\n{text}'
