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

"""What `import cpg_ros` gives to a scientist: names documented with units, results that print."""

from dataclasses import fields, is_dataclass
import inspect
import pickle
import re

import cpg_ros
from cpg_ros import (
    continue_orbit,
    CpgError,
    fit_recording,
    hopf_points,
    load_robot,
    multipliers,
    NETWORKS,
    plan,
    PRESETS,
    simulate,
    solve_orbit,
    stability,
)
from cpg_ros.common.errors import ShortRepr
from cpg_ros.dynamics.solve_orbit import solve_preset
from cpg_ros.dynamics.stability import GaitAssessment
from cpg_ros.fitting.recordings.recording import Recording
from cpg_ros.networks.network import ParameterLine
from modules import modules
import numpy as np
import pytest

#: What real numbers are measured in.
UNITS = re.compile(
    r'model time|\brad\b|\bHz\b|\bs\b|cycles?|\bunit\b|share|ratio|factor|arclength')
TROT = PRESETS['delayed']['trot']


@pytest.mark.parametrize('name', cpg_ros.__all__)
def test_a_name_says_what_it_is_and_numbers_have_units(name):
    thing = getattr(cpg_ros, name)
    text = inspect.getdoc(thing) or ''
    assert text[:1].isupper() and '.' in text
    if inspect.isclass(thing) and is_dataclass(thing):
        made = thing
        annotations = {field.name: field.type for field in fields(thing)}
    elif inspect.isroutine(thing) or (inspect.isclass(thing) and '__init__' in vars(thing)):
        made = vars(thing)['__init__'] if inspect.isclass(thing) else thing
        text += inspect.getdoc(made) or ''
        annotations = inspect.get_annotations(made)
    else:
        return
    entries: dict[str, str] = {}
    for names, meaning in re.findall(r'^    (\w+(?:, \w+)*): (.*(?:\n     .*)*)', text, re.M):
        entries |= dict.fromkeys(names.split(', '), meaning)
    for argument, kind in annotations.items():
        if kind in (float, float | None) and argument != 'return':
            # One line may say it without a list.
            assert UNITS.search(entries.get(argument, inspect.getdoc(made) or '')), argument


@pytest.fixture(scope='module')
def orbit():
    return solve_orbit(TROT.network, 'trot')


@pytest.fixture(scope='module')
def results(orbit):
    """Everything that the door returns, and what these results hold."""
    robot, time = load_robot('quadruped'), np.arange(0.0, 8.0, 0.02)
    states = orbit(time * 1.5 * orbit.period)
    recording = Recording(tuple(joint.name for joint in robot.joints), time, np.column_stack(
        [joint.offset + 0.2 * states[:, joint.cell - 1] for joint in robot.joints]), 'made up')
    found = [orbit, solve_preset(PRESETS['quadruped']['trot']), multipliers(orbit),
             stability(orbit), *hopf_points(TROT.network, 'tau', 0.0, 0.5),
             continue_orbit(orbit, 'tau', 0.35, 0.45), simulate(TROT.network, orbit, 1.0),
             load_robot('unitree_go2'), recording, TROT, TROT.network.symmetry('trot'),
             plan(load_robot('unitree_go2'), 'trot', TROT, TROT.network),
             fit_recording(recording, robot, free=['tau'], order=1),
             GaitAssessment('trot', orbit, ''), *(value for one in PRESETS.values()
                                                  for value in one.values())]
    seen = {}

    def visit(one):
        if isinstance(one, (tuple, list)):
            for part in one:
                visit(part)
        elif isinstance(one, dict):
            visit(list(one.values()))
        elif isinstance(one, ShortRepr) and id(one) not in seen:
            seen[id(one)] = one
            visit([getattr(one, field.name) for field in fields(one)])
    visit(found)
    return [*found, *seen.values()]


def test_results_print_in_a_few_lines(results):
    assert {'Branch', 'BranchPoint', 'FourierOrbit', 'MeshOrbit', 'Multipliers', 'GaitPlan',
            'Recording', 'RecordingFit', 'Robot', 'Stride', 'Trajectory'} <= {
                type(one).__name__ for one in results}
    for one in results:
        text = repr(one)
        assert len(text.splitlines()) <= 5 and len(text) <= 400, text[:500]
        assert text.startswith(type(one).__name__ + '(')


def test_results_compare_without_an_error(results):
    for one in results:
        assert one == one
        copy = pickle.loads(pickle.dumps(one))
        assert (one == copy) in (True, False) and (one != copy) in (True, False)
        assert one != 'another thing'


def test_every_dataclass_with_arrays_prints_shortly_and_compares():
    """Outside the real-time rooms, whose arrays are memory, not results."""
    classes = {thing for module in modules() for thing in vars(module).values()
               if inspect.isclass(thing) and is_dataclass(thing)
               and thing.__module__.startswith('cpg_ros.')
               and thing.__module__.split('.')[1] not in ('feedback', 'ros')
               and thing.__name__[0] != '_'}
    holding = {one for one in classes if any(
        str(field.type).removesuffix(' | None') in ('np.ndarray', "<class 'numpy.ndarray'>")
        for field in fields(one))}
    assert len(holding) > 25
    for one in holding:
        assert issubclass(one, ShortRepr) and '__repr__' not in vars(one), one
        assert one.__eq__ is object.__eq__, one


def test_an_orbit_says_what_it_is(orbit):
    assert repr(orbit).startswith('FourierOrbit(trot of delayed: period 1.278271, residual ')
    assert repr(orbit).endswith(', 63 nodes)')


def test_networks_and_presets_print_their_names():
    assert repr(NETWORKS) == f'NETWORKS({", ".join(NETWORKS)})'
    assert all(name in repr(PRESETS) for name in NETWORKS)


def test_a_parameter_is_named_by_its_text(orbit):
    by_text = continue_orbit(orbit, 'tau', 0.35, 0.45)
    by_line = continue_orbit(orbit, ParameterLine.parse('tau', type(TROT.network)), 0.35, 0.45)
    assert by_text.along == by_line.along
    assert np.array_equal(by_text.values, by_line.values)
    assert [point.value for point in hopf_points(TROT.network, 'tau', 0.0, 0.5)] == [
        point.value for point in hopf_points(TROT.network, by_line.along, 0.0, 0.5)]
    for call in (lambda: continue_orbit(orbit, 'taw', 0.2, 0.6),
                 lambda: hopf_points(TROT.network, 'taw', 0.0, 0.5)):
        with pytest.raises(CpgError, match="'taw' is not one of a, b, c, d, tau"):
            call()


def test_a_network_with_other_values():
    network = TROT.network.replace(tau=0.3)
    assert network.as_dict() == {**TROT.network.as_dict(), 'tau': 0.3}
    walk = PRESETS['biped']['walk'].network
    assert set(walk.replace(w_a=0.5).as_dict().items()) - set(walk.as_dict().items()) == {
        (name, 0.5) for name in walk.groups['w_a']}
    with pytest.raises(CpgError, match="'taw' is not one of a, b, c, d, tau"):
        TROT.network.replace(taw=0.3)


@pytest.mark.parametrize('gait, ahead', [
    ('trot', (0.0, 0.5, 0.5, 0.0)), ('pace', (0.0, 0.5, 0.0, 0.5)),
    ('bound', (0.0, 0.0, 0.5, 0.5)), ('pronk', (0.0, 0.0, 0.0, 0.0))])
def test_leg_phases_are_those_of_the_gait(gait, ahead):
    """Legs that move together are the diagonal, lateral, hind and fore pairs, or all."""
    found = solve_preset(PRESETS['delayed'][gait]).leg_phases
    assert found == dict(zip(('lh', 'rh', 'lf', 'rf'), ahead, strict=True))


@pytest.mark.parametrize('network, gait', [
    ('delayed', 'walk'), ('quadruped', 'walk'), ('biped', 'hesitation_walk'), ('hopf', 'trot'),
    ('matsuoka', 'trot'), ('phase', 'canter_left')])
def test_the_default_step_keeps_to_the_orbit_within_a_millionth(network, gait):
    preset = PRESETS[network][gait]
    orbit = solve_preset(preset)
    run = simulate(preset.network, orbit, orbit.period, progress=False)
    exact = orbit(run.t)
    assert np.abs(run.x - exact).max() <= 1e-6 * np.ptp(exact[:, :preset.network.cells])


def test_the_default_step_is_no_longer_than_a_delay():
    network = TROT.network.replace(tau=0.001)
    assert simulate(network, np.full(8, 0.1), 0.1).t[1] == pytest.approx(0.001)
