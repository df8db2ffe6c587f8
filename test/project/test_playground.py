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

"""The playground in Chromium, opened as a file: its numbers beside those of the package."""

import json
from pathlib import Path
import sys

from cpg_ros.dynamics.hopf import hopf_points
from cpg_ros.dynamics.integration.stepper import Stepper
from cpg_ros.motion.plan import plan
from cpg_ros.motion.robot_file import load_robot
from cpg_ros.networks.registry import find_network
import numpy as np
import pytest
from scipy.interpolate import CubicHermiteSpline

pytestmark = pytest.mark.browser
EXTENSIONS = Path(__file__).parents[2] / 'docs' / 'extensions'
STRIDES = 30


@pytest.fixture(scope='module')
def folder(tmp_path_factory):
    """Return the page, as `make docs` writes it."""
    sys.path.insert(0, str(EXTENSIONS))
    try:
        import playground
    finally:
        sys.path.remove(str(EXTENSIONS))
    found = tmp_path_factory.mktemp('playground')
    playground.build(found)
    return found


@pytest.fixture
def open_page(folder, browser):
    """Open the page; in the end nothing may have gone wrong in it, nor been asked of a network."""
    opened, wrong = [], []

    def open_one(state='', **options):
        page = browser.new_page(**options)
        page.on('pageerror', lambda error: wrong.append(str(error)))
        page.on('request', lambda request: request.url.startswith('file:') or wrong.append(
            request.url))
        page.goto(f'file://{folder}/index.html#{state}')
        page.wait_for_function('document.documentElement.dataset.ready')
        opened.append(page)
        return page

    yield open_one
    for page in opened:
        page.close()
    assert not wrong


def period_of(one):
    """Return the mean period of a plan's network after as many strides as are measured."""
    orbit = one.orbit
    stepper = Stepper(orbit.network, orbit(np.array(0.0)), gain=one.gain, symmetry=orbit.symmetry)
    x = orbit.waveform(np.arange(2048) / 2048, 0, int(orbit.waves[0]), 0)
    level, times = 0.5 * (x.max() + x.min()), []
    before = stepper.advance(0.0)[:2, 0].copy()
    for step in range(1, round(3 * STRIDES * orbit.period / stepper.step)):
        now = stepper.advance(stepper.step)[:2, 0].copy()
        if before[0] < level <= now[0]:
            cubic = CubicHermiteSpline([0.0, stepper.step], [before[0] - level, now[0] - level],
                                       [before[1], now[1]])
            times.append((step - 1) * stepper.step + cubic.roots(extrapolate=False)[0])
        before = now
    return (times[2 * STRIDES] - times[STRIDES]) / STRIDES


@pytest.mark.parametrize('network', ['delayed', 'quadruped', 'biped', 'hopf', 'matsuoka', 'phase'])
def test_the_period_is_that_of_the_stepper(open_page, network):
    page = open_page(f'network={network}')
    gait, found = page.evaluate(
        f'[state.gait, measurePeriod(new Simulation(simulation.network, simulation.gait), '
        f'{STRIDES})]')
    preset = find_network(network).presets()[gait]
    one = plan(load_robot('biped' if network == 'biped' else 'quadruped'), gait, preset,
               preset.network, 1.0)
    assert found == pytest.approx(period_of(one), rel=1e-9)
    if network == 'delayed':
        assert found == pytest.approx(one.orbit.period, rel=1e-9)


def test_it_walks_and_says_where_there_is_no_gait(open_page):
    page = open_page('network=delayed&gait=trot&speed=3')
    page.wait_for_function("document.getElementById('verdict').className === 'good'")
    assert 'lh 0.00, rh 0.50, lf 0.50, rf 0.00' in page.inner_text('#verdict')
    page.wait_for_function('walker.distance > 0.5')
    assert float(page.evaluate('document.documentElement.dataset.work')) > 0.0
    page.fill('.parameter:first-child input[type=number]', '-9')
    page.keyboard.press('Tab')
    page.wait_for_function(
        "document.getElementById('verdict').textContent.startsWith('no gait here')")
    assert 'p.a=-9' in page.url


def test_a_threshold_is_where_the_hopf_point_is(open_page):
    page = open_page('network=delayed&gait=trot')
    page.evaluate("state.moved = 'c'")
    page.click('#threshold')
    page.wait_for_function("document.getElementById('threshold-result').dataset.done",
                           timeout=120_000)
    low, high = json.loads(page.get_attribute('#threshold-result', 'data-ends'))
    network = find_network('delayed').presets()['trot'].network
    wanted = [one.value for one in hopf_points(network, 'c', 4.0, 6.0) if 'trot' in repr(one)]
    assert [low['present'], low['absent']] == pytest.approx(wanted * 2, rel=0.02)
    assert low['absent'] < low['present'] and high['absent'] is None
    assert '40 strides a run' in page.inner_text('#threshold-result')


def test_a_link_holds_the_state(open_page):
    page = open_page('network=hopf&gait=walk&speed=0.5&p.mu=1.5')
    assert page.evaluate("[state.network, state.gait, state.speed, simulation.values.mu, "
                         "$('gait').value]") == ['hopf', 'walk', 0.5, 1.5, 'walk']
    page.select_option('#gait', 'trot')
    assert 'network=hopf' in page.url and 'gait=trot' in page.url
    other = open_page('network=nothing&gait=canter&speed=-1&p.a=1e9&p.b=x')
    assert other.evaluate('[state.network, state.gait, state.changed]') == ['delayed', 'trot', {}]


@pytest.mark.parametrize('scheme', ['light', 'dark'])
def test_it_fits_a_phone(open_page, scheme):
    page = open_page(viewport={'width': 390, 'height': 844}, color_scheme=scheme)
    page.wait_for_function("document.getElementById('verdict').className === 'good'")
    assert page.evaluate('document.documentElement.scrollWidth') <= 390
    back, ink = page.evaluate("['backgroundColor', 'color'].map("
                              'name => getComputedStyle(document.body)[name])')
    dark = [sum(map(int, text[4:-1].split(','))) < 300 for text in (back, ink)]
    assert dark == [scheme == 'dark', scheme == 'light']
