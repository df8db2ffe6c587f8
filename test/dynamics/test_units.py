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

"""Nothing that is said of a network depends on the units of its variables and of its time."""

from dataclasses import dataclass

from cpg_ros.dynamics.continuation import bifurcations, continue_from_hopf, continue_orbit
from cpg_ros.dynamics.floquet import multipliers
from cpg_ros.dynamics.hopf import hopf_points
from cpg_ros.dynamics.phase_response import phase_response
from cpg_ros.dynamics.solve_orbit import coexisting_orbits
from cpg_ros.dynamics.stability import stability
from cpg_ros.networks.definition import Range, tanh
from cpg_ros.networks.network import ParameterLine
from cpg_ros.networks.presets import Preset
import numpy as np
import pytest
from two_sided import OTHER, TwoSided
from van_der_pol import van_der_pol

#: Units of the variables and of time.
UNITS = [(1e-3, 1.0), (30.0, 1.0), (1e3, 1.0), (1.0, 1e-2), (30.0, 1e3)]


def said(size, time):
    """Return what is said of the pair, without units: numbers, then words."""
    network = van_der_pol(size, time)(1.5, -0.1)
    line = ParameterLine.parse('mu', type(network))
    points = hopf_points(network, line, -1.0, 1.0)
    numbers = [[point.value, point.omega * time, point.leading_other.real * time]
               for point in points]
    words = [[point.gait, point.simple, point.stable, point.supercritical] for point in points]
    for gait in network.gaits():
        found = coexisting_orbits(network, gait, everything=False)
        spectra = [multipliers(orbit) for orbit in found.orbits]
        numbers += [[orbit.period / time, orbit.levels[0, 0, 1] / size, spectrum.leading]
                    for orbit, spectrum in zip(found.orbits, spectra, strict=True)]
        words.append([gait, found.searched, *(spectrum.attracts for spectrum in spectra)])
        for orbit in found.orbits:
            judged, response = stability(orbit), phase_response(orbit)
            words.append(judged.reason)
            numbers += [[judged.enough * time, *response(0.3 * orbit.period)[0] * size]]
        branch = continue_orbit(found.orbits[0], line, -0.5, 2.0, longest_step=0.5)
        born = continue_from_hopf(next(point for point in points if point.gait == gait), line,
                                  -0.5, 1.0, longest_step=0.5)
        for each in (branch, born):
            words.append([len(each.folds), [end.why for end in each.ends], len(each.points)])
            crossings = bifurcations(each)
            words.append([crossing.kind for crossing in crossings])
            numbers += [[crossing.value, crossing.point.orbit.period / time, 0.0]
                        for crossing in crossings]
            numbers += [[end.value, end.period / time, 0.0] for end in each.ends]
    return np.array(numbers), words


def late(size, time):
    """Return the class of a pair x' = -x - c tanh(x_other(t - tau))."""
    @dataclass(frozen=True)
    class Late(TwoSided):
        c: float
        tau: float

        name = f'late_{size:g}_{time:g}'.translate(str.maketrans('-.+', '___'))
        states = ('x',)
        readout = 'waveform'
        step = 0.01 * time
        delay_parameter = 'tau'
        longest_delay = 10.0 * time
        ranges = {'c': Range(-10.0, 10.0, 'weight'), 'tau': Range(step, 10.0 * time, 'delay')}
        couplings = ('c',)
        usual_gait = 'hop'
        free = ('c',)
        line = 'tau'

        @staticmethod
        def equations(cell, p):
            (x,), (other,) = cell.now(), cell.past(OTHER)
            return (-(x + size * p.c * tanh(other / size)) / time,)

        @classmethod
        def presets(cls):
            return {gait: Preset(gait, cls(2.0, 4.0 * time)) for gait in ('hop', 'walk')}

    return Late


def said_with_delay(size, time):
    """Return what is said of the pair with a delay, likewise."""
    network = late(size, time)(2.0, 4.0 * time)
    points = hopf_points(network, 'tau', 0.01 * time, 6.0 * time)
    numbers = [[point.value / time, point.omega * time, 0.0] for point in points]
    words = [[point.gait, point.simple, point.stable, point.supercritical] for point in points]
    for gait in network.gaits():
        found = coexisting_orbits(network, gait, everything=False)
        words.append([gait, found.searched, len(found.orbits)])
        for orbit in found.orbits:
            spectrum, judged = multipliers(orbit), stability(orbit)
            numbers += [[orbit.period / time, orbit.levels[0, 0, 1] / size, spectrum.leading],
                        [judged.enough * time, phase_response(orbit)(0.3 * orbit.period)[0, 0]
                         * size, 0.0]]
            words.append([spectrum.attracts, judged.reason])
        branch = continue_orbit(found.orbits[0], 'tau', 3.5 * time, 5.0 * time,
                                longest_step=0.5 * time)
        words.append([len(branch.folds), [end.why for end in branch.ends]])
    return np.array(numbers), words


@pytest.fixture(scope='module')
def in_units_of_one():
    return said(1.0, 1.0)


@pytest.fixture(scope='module')
def late_in_units_of_one():
    return said_with_delay(1.0, 1.0)


@pytest.mark.parametrize(('size', 'time'), UNITS)
def test_units_change_nothing_with_a_delay(size, time, late_in_units_of_one):
    numbers, words = said_with_delay(size, time)
    assert words == late_in_units_of_one[1]
    assert numbers == pytest.approx(late_in_units_of_one[0], rel=1e-6, abs=1e-6)


@pytest.mark.parametrize(('size', 'time'), UNITS)
def test_units_change_nothing_but_themselves(size, time, in_units_of_one):
    numbers, words = said(size, time)
    assert words == in_units_of_one[1]
    assert numbers == pytest.approx(in_units_of_one[0], rel=1e-6, abs=1e-6)
