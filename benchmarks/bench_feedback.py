"""The simulated Go2 with feedback and, in the same run, without it: pushes, rough ground, slopes.

At 0.4 m/s, with what its sensors show without noise or delay. Pushes of 0.1 s come from 12
directions at 8 phases of the stride; the impulse that half survive is read off the line through
the shares that survived. Ground counts as crossed at 5 m. The seeds are fresh, and printed.
"""

import argparse
import math
import secrets
import sys

import numpy as np
from common import ROOT, emit, log

from cpg_ros.feedback.gains import Gains
from cpg_ros.motion.plan import plan
from cpg_ros.networks.registry import PRESETS
from cpg_ros.robots.robot_file import load_robot
from cpg_ros.simulation.closed_loop import ClosedLoop, Scenario
from cpg_ros.simulation.efference_measurement import measure_efference
from cpg_ros.simulation.terrain import Terrain

ROBOT = load_robot(ROOT / 'config' / 'unitree_go2.yaml')
IMPULSES = {'open': (8.0, 12.0, 16.0, 20.0, 24.0, 28.0),
            'closed': (20.0, 24.0, 28.0, 32.0, 36.0, 40.0, 44.0)}
#: What the feedback is to reach: impulse that half survive, and shares of ground crossed.
TARGETS = {'half_survive_N_s': 34.0, 'height_field_6_cm': 0.98, 'height_field_8_cm': 0.90,
           'boxes_5_cm': 0.80}
SLOPES = {'up': Terrain('ramp', 15.0), 'down': Terrain('ramp', -15.0),
          'across': Terrain('ramp', 15.0, across=True)}


def pushes(impulse: float, directions: int, phases: int, rng: np.random.Generator
           ) -> list[Scenario]:
    """All directions at all phases, turned by the same random angle."""
    first = rng.uniform(0.0, 2.0 * math.pi)
    ways = first + np.arange(directions) * 2.0 * math.pi / directions
    return [Scenario(push=(impulse * math.cos(way), impulse * math.sin(way)), when=2.5,
                  phase=k / phases) for way in ways for k in range(phases)]


def half(impulses: tuple[float, ...], shares: list[float]) -> float:
    """Impulse at which the share falls through a half, the nearest tried if it does not."""
    for k in range(len(shares) - 1):
        if shares[k] >= 0.5 > shares[k + 1]:
            return float(np.interp(0.5, shares[k + 1::-1][:2], impulses[k + 1::-1][:2]))
    return impulses[0] if shares[0] < 0.5 else impulses[-1]


def figures(gait: str, quick: bool, rng: np.random.Generator) -> dict[str, object]:
    """Measure one gait, open and closed."""
    preset = PRESETS['delayed'][gait]
    loop = ClosedLoop('go2', plan(ROBOT, gait, preset, preset.network,
                                  ROBOT.motion(gait, gait).frequency or 0.0))
    expected = measure_efference(loop)
    directions, phases, grounds = (6, 2, 6) if quick else (12, 8, 50)
    found: dict[str, object] = {}
    seeds = [int(seed) for seed in rng.integers(0, 2**31, grounds)]
    for name, gains in (('open', None), ('closed', Gains())):
        log(f'{gait}, {name}: pushes')
        impulses = IMPULSES[name][::2] if quick else IMPULSES[name]
        shares = [float(loop.run(pushes(impulse, directions, phases, rng), 5.5, gains=gains,
                                 expected=expected).upright.mean()) for impulse in impulses]
        log(f'{gait}, {name}: ground')
        crossed = {}
        for kind, size in (('height_field', 0.06), ('height_field', 0.08), ('boxes', 0.05)):
            ran = loop.run([Scenario(terrain=Terrain(kind, size, seed)) for seed in seeds], 18.0,
                           gains=gains, expected=expected)
            in_time = np.arange(ran.place.shape[1]) * loop.timestep < ran.fell[:, None]
            crossed[f'{kind}_{100 * size:.0f}_cm'] = float(
                ((ran.place[:, :, 0] > 5.0) & in_time).any(axis=1).mean())
        slopes = loop.run([Scenario(terrain=one) for one in SLOPES.values()], 10.0, gains=gains,
                          expected=expected)
        flat, slippery = (loop.run([Scenario(friction)], 20.0 if friction == 1.0 else 10.0,
                                   gains=gains, expected=expected) for friction in (1.0, 0.3))
        found[name] = {
            'survived': dict(zip(map(str, impulses), shares, strict=True)),
            'half_survive_N_s': half(impulses, shares), 'crossed': crossed,
            'slope_upright': dict(zip(SLOPES, slopes.upright.tolist(), strict=True)),
            'uphill_m': float(slopes.place[0, -1, 0]), 'cost_of_transport': float(flat.cost[0]),
            'speed_m_s': float(flat.velocity[0, 1500:, 0].mean()),
            'drift_m': float(np.abs(flat.place[0, :, 1]).max()),
            'friction_0.3_m': float(slippery.place[0, -1, 0])}
    return found


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--quick', action='store_true', help='few runs: a look, no verdict')
    parser.add_argument('--gaits', nargs='+', default=['trot', 'walk'])
    parser.add_argument('--seed', type=int, default=None, help='a fresh one if not given')
    arguments = parser.parse_args()
    seed = secrets.randbelow(2**31) if arguments.seed is None else arguments.seed
    log(f'seed {seed}')
    rng = np.random.default_rng(seed)
    gaits = {gait: figures(gait, arguments.quick, rng) for gait in arguments.gaits}
    closed: list[dict] = [gait['closed'] for gait in gaits.values()]  # type: ignore[misc]
    met = all(one['half_survive_N_s'] >= TARGETS['half_survive_N_s']
              and all(share >= TARGETS[ground] for ground, share in one['crossed'].items())
              and all(one['slope_upright'].values()) for one in closed)
    emit(benchmark='feedback', seed=seed, quick=arguments.quick, gaits=gaits, targets=TARGETS,
         met=met)
    return 0 if met or arguments.quick else 1


if __name__ == '__main__':
    sys.exit(main())
