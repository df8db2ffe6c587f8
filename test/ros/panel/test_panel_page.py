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

"""The panel's page in a real browser: Chromium without a screen."""

from contextlib import ExitStack
import re
import time

from cpg_ros.ros.kernels import StartProgress
from geometry_msgs.msg import Twist
from graph import EXECUTABLE, free_domain, Process, until, Watcher
from panel_client import Client, Delay, press, start_panel
import pytest

pytestmark = pytest.mark.browser


@pytest.fixture(scope='module')
def rig():
    """Yield a steered generator, the address of its page, a watcher, and what cmd_vel says."""
    generator = Process('-p', 'robot:=unitree_go2', '-p', 'cmd_vel:=true', '-p', 'rate:=100.0',
                        '-p', 'transition:=0.2', '-p', 'ramp:=0.2')
    panel, address = start_panel(generator.domain)
    generator.wait_for('publishing')
    watcher = Watcher(generator.domain)
    twists = []
    watcher.node.create_subscription(
        Twist, '/cmd_vel', lambda m: twists.append((m.linear.x, m.angular.z)), 100)
    yield generator, address, watcher, twists
    watcher.end()
    panel.end()
    generator.end()


@pytest.fixture
def open_page(rig, browser):
    """Open pages of which all that went wrong is looked at in the end."""
    opened, wrong = [], []

    def open_one(more='', **options):
        context = browser.new_context(viewport={'width': 900, 'height': 500}, **options)
        page = context.new_page()
        page.on('pageerror', lambda error: wrong.append(str(error)))
        page.on('requestfailed', lambda request: wrong.append(request.url))
        page.on('request', lambda request: request.url.startswith(rig[1]) or wrong.append(
            request.url))
        page.on('console', lambda message: message.type == 'error' and wrong.append(message.text))
        page.goto(rig[1] + more)
        opened.append(context)
        until(lambda: page.evaluate('panel.frames > 0 && !!panel.scene.shape') and
              page.locator('#gaits button').count(), 'a page with a robot')
        return page

    yield open_one
    for context in opened:
        context.close()
    assert not wrong


def holder(page):
    """Return what the page says about who has control."""
    return page.locator('#holder').inner_text()


def take_over(page):
    """Take over with a click, once another page has control."""
    page.locator('#take-over').click()
    until(lambda: holder(page) == 'This page has control.', 'control')


def test_it_shows_the_robot_and_all_that_is_known_of_it(rig, open_page):
    page = open_page()
    assert page.locator('#source').inner_text() == (
        "shape: model 'go2'; drawn coarsely: this browser has no graphics card")
    assert page.locator('#gaits button').all_inner_texts()[:2] == ['walk1', 'trot2']
    assert page.locator('#gaits button.on').get_attribute('data-gait') == 'trot'
    assert page.evaluate('panel.scene.gl.getError()') == 0
    assert not page.locator('#slow').is_visible()
    # Something is drawn: there are more colours than of a sky and a floor.
    colours = page.evaluate("""() => { panel.scene.draw({}); const gl = panel.scene.gl;
        const all = new Uint8Array(4 * gl.drawingBufferWidth * gl.drawingBufferHeight);
        gl.readPixels(0, 0, gl.drawingBufferWidth, gl.drawingBufferHeight, gl.RGBA,
            gl.UNSIGNED_BYTE, all);
        return new Set(new Uint32Array(all.buffer)).size; }""")
    assert colours > 300
    sliders = page.locator('input[type=range][data-parameter]')
    assert {'rate', 'amplitude', 'delayed.tau'} <= set(sliders.evaluate_all(
        'all => all.map(one => one.dataset.parameter)'))
    # Feet of a robot of which nobody says where it is stand on the floor.
    heights = page.evaluate('Object.keys(panel.scene.shape.feet).map(k => panel.scene.foot(k).z)')
    assert min(heights) == pytest.approx(0.02, abs=1e-3)


def test_every_page_follows_clicks_and_keys(rig, open_page):
    one, other = open_page(), open_page()
    gaits = rig[2].gaits
    one.locator('#gaits button[data-gait=walk]').click()
    until(lambda: gaits[-1] == 'walk', 'walk')
    take_over(other)
    other.keyboard.press('2')
    until(lambda: gaits[-1] == 'trot', 'trot')
    for page in (one, other):
        until(lambda: page.locator('#now').inner_text() == 'trot' and page.locator(  # noqa: B023
            '#gaits button.on').get_attribute('data-gait') == 'trot', 'the page shows it')


def test_a_slider_that_is_dragged_ends_at_its_last_value(rig, open_page):
    page = open_page()
    page.locator('#find').fill('frequency')
    slider = page.locator('input[type=range][data-parameter=frequency]')
    slider.scroll_into_view_if_needed()
    box = slider.bounding_box()
    y = box['y'] + box['height'] / 2
    page.mouse.move(box['x'] + 0.2 * box['width'], y)
    page.mouse.down()
    for k in range(30):
        page.mouse.move(box['x'] + (0.2 + 0.002 * k) * box['width'], y)
    page.mouse.up()
    wanted = float(slider.input_value())
    until(lambda: rig[2].get('frequency') == [pytest.approx(wanted)], 'the last value')
    assert 2.0 < wanted < 3.0


def test_a_refusal_appears_with_its_reason_and_the_control_goes_back(rig, open_page):
    page = open_page()
    page.locator('#find').fill('delayed.tau')
    field = page.locator('input[type=number][data-parameter="delayed.tau"]')
    before = field.input_value()
    field.fill('0.1')
    field.press('Enter')
    shown = page.locator('#notices p.refused')
    shown.wait_for()
    assert "below the trot's critical delay" in shown.inner_text()
    until(lambda: field.input_value() == before, 'the value that is in force')


def steered(rig, page, way='ArrowUp'):
    rig[3].clear()
    until(lambda: not page.evaluate('document.querySelector("#pad").matches(".off")'), 'a pad')

    def twist():
        press(page, way)
        return next((one for one in rig[3][-1:] if one != (0.0, 0.0)), None)

    return until(twist, 'cmd_vel')


@pytest.mark.parametrize('how', ['key', 'hidden', 'space', 'closed', 'frozen'])
def test_the_robot_stops_when_the_page_lets_go(rig, open_page, how):
    page = open_page()
    assert steered(rig, page) == (0.5, 0.0)
    if how == 'key':
        page.keyboard.up('ArrowUp')
    elif how == 'hidden':
        # As a browser does when another tab comes to the front.
        page.evaluate("""() => { Object.defineProperty(document, 'hidden', { get: () => true });
            document.dispatchEvent(new Event('visibilitychange')); }""")
    elif how == 'space':
        page.keyboard.press(' ')
        page.locator('#notices p.info', has_text='ramping down').wait_for()
        page.locator('#enable').click()
    elif how == 'closed':
        page.close()
    else:
        page.evaluate("""() => { window.end = Date.now() + 1500; while (Date.now() < end); }""")
        assert (0.0, 0.0) in rig[3]  # and it goes on only with a new press
        time.sleep(0.2)
        rig[3].clear()
        time.sleep(0.5)
        assert set(rig[3]) <= {(0.0, 0.0)}
        return
    until(lambda: rig[3][-1] == (0.0, 0.0), 'the stop')


def test_drawing_does_not_let_go(rig, open_page):
    page = open_page()  # as on a machine without a graphics card
    page.evaluate("""() => { const { scene } = panel, draw = scene.draw; scene.draw = (forces) => {
        const end = Date.now() + 450; while (Date.now() < end); draw.call(scene, forces); }; }""")
    time.sleep(1.0)
    steered(rig, page)
    rig[3].clear()
    time.sleep(3.0)
    assert len(rig[3]) > 60 and set(rig[3]) == {(0.5, 0.0)}
    assert page.locator('#paused').is_visible()
    page.keyboard.up('ArrowUp')
    until(lambda: rig[3][-1] == (0.0, 0.0), 'the stop')


def test_control_is_taken_over_by_a_click_that_both_pages_see(rig, open_page):
    one, other = open_page(), open_page()
    until(lambda: holder(one) == 'No page has control. The first command takes it.', 'nobody')
    assert not one.locator('#take-over').is_visible()
    steered(rig, one)
    until(lambda: holder(one) == 'This page has control.', 'control without a click')
    name = one.locator('#this-page').inner_text().removeprefix('this is ')
    until(lambda: holder(other) == f'P{name[1:]} has control. This page only watches.', 'whose')
    assert 'off' in other.locator('#pad').get_attribute('class')
    assert other.locator('#steered').inner_text() == holder(other)
    take_over(other)  # while the key is down
    name = other.locator('#this-page').inner_text().removeprefix('this is ')
    until(lambda: holder(one) == f'P{name[1:]} took over. This page only watches.', 'the loss')
    until(lambda: rig[3][-1] == (0.0, 0.0), 'the stop')
    rig[3].clear()
    time.sleep(0.5)
    assert set(rig[3]) <= {(0.0, 0.0)}
    assert steered(rig, other, 'ArrowDown') == (-0.5, 0.0)
    # Whoever only watches can stop the robot.
    one.locator('#stop').click()
    one.locator('#notices p.info', has_text='ramping down').wait_for()
    other.keyboard.up('ArrowDown')
    other.locator('#enable').click()
    other.locator('#release').click()
    until(lambda: holder(one) == 'No page has control. The first command takes it.', 'nobody')


def test_another_node_that_steers_is_shown_and_confirmed_by_a_click(rig, open_page):
    page = open_page()
    publisher = rig[2].node.create_publisher(Twist, '/cmd_vel', 10)
    until(lambda: 'published by /watcher. To steer, take over.' in holder(page), 'the other')
    assert 'off' in page.locator('#pad').get_attribute('class')
    page.locator('#take-over').click()
    until(lambda: '/watcher: both steer.' in holder(page), 'both')
    assert steered(rig, page) == (0.5, 0.0)
    page.keyboard.up('ArrowUp')
    rig[2].destroy(publisher)
    until(lambda: holder(page) == 'This page has control.', 'the end of it')


def test_a_slow_link_is_shown(rig, browser):
    link = Delay(rig[1], 0.4)
    page = browser.new_page()
    try:
        page.goto(link.address)
        slow = r'Link too slow to steer: 0\.[89] s \(limit 0\.3 s\)\.'
        until(lambda: re.search(slow, holder(page)), 'the delay')
        rig[3].clear()
        page.keyboard.down('ArrowUp')
        time.sleep(2.0)
        assert not rig[3]
    finally:
        page.close()
        link.end()


def test_the_17th_page_can_only_stop(rig, open_page, browser):
    others = [Client(rig[1]) for _ in range(16)]
    page = browser.new_page()
    try:
        page.goto(rig[1])
        until(lambda: '16 pages are already open: this one can only stop' in holder(page), 'why')
        page.locator('#stop').click()
        page.locator('#notices p.info', has_text='ramping down').wait_for()
        others.pop().end()
        until(lambda: holder(page).startswith('No page has control'), 'full access')
        until(lambda: page.evaluate('panel.frames > 0'), 'frames')
        page.locator('#enable').click()
        page.locator('#notices p.info', has_text='enabled').wait_for()
    finally:
        page.close()
        for one in others:
            one.end()


def test_the_pad_steers_with_a_finger(rig, open_page):
    page = open_page()
    pad = page.locator('#pad')
    until(lambda: 'off' not in (pad.get_attribute('class') or ''), 'a pad')
    pad.scroll_into_view_if_needed()
    box = pad.bounding_box()
    x, y = box['x'] + box['width'] / 2, box['y'] + box['height'] / 2
    rig[3].clear()

    def steered_half():
        if not page.evaluate('panel.steering.held'):  # again, where the page stood still
            page.mouse.up()
            page.mouse.move(x, y)
            page.mouse.down()
            page.mouse.move(x - 0.2 * box['width'], y - 0.2 * box['height'])
        return rig[3] and rig[3][-1] == pytest.approx((0.25, 0.3), abs=0.02)

    until(steered_half, 'half ahead, half to the left')
    page.mouse.up()
    until(lambda: rig[3][-1] == (0.0, 0.0), 'the stop')


def test_the_address_carries_the_view(open_page):
    page = open_page()
    page.evaluate('panel.scene.look(120, 20, 2.5)')
    page.locator('#theme').click()
    page.locator('#portrait').select_option('cell 3')
    address = page.evaluate('location.hash')
    other = open_page(address)
    until(lambda: other.locator('#portrait').input_value() == 'cell 3', 'the portrait')
    assert other.evaluate('panel.scene.view') == pytest.approx([120, 20, 2.5], abs=0.1)
    assert other.evaluate('document.documentElement.dataset.theme') == 'dark'


@pytest.mark.parametrize('scheme', ['light', 'dark'])
def test_light_and_dark_are_as_the_system_has_them(open_page, scheme):
    page = open_page(color_scheme=scheme)
    back = page.evaluate('getComputedStyle(document.body).backgroundColor')
    red = int(re.search(r'\d+', back)[0])
    assert (red > 200) == (scheme == 'light')


def test_it_fits_a_phone(open_page):
    page = open_page(device_scale_factor=2)
    page.set_viewport_size({'width': 375, 'height': 700})
    assert page.evaluate('document.documentElement.scrollWidth') <= 375
    widths = page.locator('section, figure, canvas').evaluate_all(
        'all => all.map(one => one.getBoundingClientRect().right)')
    assert max(widths) <= 375


def test_gaits_and_presets_of_other_names_are_groups_of_their_own(open_page):
    page = open_page()
    names = [page.locator(f'{group} button').evaluate_all('all => all.map(b => b.dataset.gait)')
             for group in ('#gaits', '#presets')]
    # Of those that the Go2 can be steered in.
    assert names == [['walk', 'trot'],
                     ['run', 'liu2024_walk', 'liu2024_trot', 'goat_trot',
                      'goat_slope_walk']]
    page.locator('#preset-group summary').click()
    assert page.locator('#presets button').all_inner_texts() == [
        'run', 'walk (Liu 2024)', 'trot (Liu 2024)', 'goat trot', 'goat slope walk']


def test_a_bar_shows_how_far_the_tuning_of_a_robot_is(browser):
    """Published by the demonstration while it tunes, before there is a generator."""
    domain = free_domain()
    with ExitStack() as ending:
        panel, address = start_panel(domain)
        ending.callback(panel.end)
        watcher = Watcher(domain)
        ending.callback(watcher.end)
        page = browser.new_page()
        ending.callback(page.close)
        page.goto(address)
        starting, bar = page.locator('#starting'), page.locator('#starting progress')
        until(lambda: starting.inner_text() == 'waiting for a generator', 'an empty graph')
        assert not bar.is_visible()
        progress = StartProgress(watcher.node, 'tuning the trot in simulation', 60.0)
        until(bar.is_visible, 'the bar')
        text = r'/watcher is starting: tuning the trot in simulation, \d+ of about 60 s'
        assert re.fullmatch(text, starting.inner_text().strip())
        assert bar.evaluate('bar => bar.max') == 60
        until(lambda: bar.evaluate('bar => bar.value') >= 2, 'progress')
        progress.end()
        until(lambda: starting.inner_text() == 'waiting for a generator', 'the end of it')


def test_parameters_are_closed_groups_that_a_search_opens(open_page):
    page = open_page()
    shown = page.locator('.parameter:visible [data-parameter]')
    assert shown.count() == 0
    assert page.locator('#parameters summary').count() > 3
    assert page.locator('[data-parameter=use_sim_time]').count() == 0
    page.locator('#find').fill('delayed.tau which is not')
    assert shown.count() == 0
    page.locator('#find').fill('LEGS delayed.tau')
    assert set(shown.evaluate_all('all => all.map(one => one.dataset.parameter)')) == {
        'delayed.tau'}
    page.locator('#find').fill('')
    assert shown.count() == 0


@pytest.mark.parametrize('width', [390, 1366, 1920])
def test_stop_and_robot_stay_in_sight(open_page, width):
    """And a wide page does not scroll: footfalls and a plot are in its first view."""
    page = open_page()
    page.set_viewport_size({'width': width, 'height': 800})
    page.evaluate('scrollTo(0, 1e5); document.querySelector("aside").scrollTo(0, 1e5)')
    for name in ('#stop', '#stage', *(['#footfalls', '#selected-plot'] if width > 860 else [])):
        box = page.locator(name).bounding_box()
        assert box['y'] >= 0 and box['y'] + box['height'] <= 800, name
        assert box['x'] >= 0 and box['x'] + box['width'] <= width, name


def test_a_held_key_drives_again_after_the_page_stood_still(rig, open_page):
    page = open_page()
    steered(rig, page)
    page.evaluate('() => { window.end = Date.now() + 1500; while (Date.now() < end); }')
    until(lambda: rig[3][-1] == (0.0, 0.0), 'the stop')

    def repeated():
        page.keyboard.down('ArrowUp')  # without a release, as a keyboard repeats a key
        return rig[3][-1] == (0.5, 0.0)

    until(repeated, 'steering again')
    page.keyboard.up('ArrowUp')
    until(lambda: rig[3][-1] == (0.0, 0.0), 'the stop')


def test_control_is_shown_to_those_who_share_it(open_page):
    page = open_page()
    until(lambda: page.evaluate('panel.lease?.pages') == 1, 'a page alone')
    assert not page.locator('#control').is_visible()
    other = open_page()
    for one in (page, other):
        until(one.locator('#control').is_visible, 'who has control')


def test_views_of_the_camera(open_page):
    page = open_page()
    for name, azimuth, elevation in (('side', 90, 8), ('front', 0, 10)):
        page.locator(f'#views button[data-view={name}]').click()
        assert page.evaluate('panel.scene.view')[:2] == pytest.approx([azimuth, elevation], abs=1)


@pytest.mark.parametrize('width', [390, 1280])
def test_whatever_is_touched_has_44_pixels(open_page, width):
    page = open_page()
    page.set_viewport_size({'width': width, 'height': 800})
    page.locator('#find').fill('e')
    sizes = page.locator('button, select, summary, input:not([type=checkbox]), label:has([type='
                         'checkbox])').evaluate_all(
        """all => all.filter(one => one.offsetParent).map(one =>
           [one.id || one.textContent, one.getBoundingClientRect().height])""")
    assert len(sizes) > 20 and [one for one in sizes if one[1] < 43.9] == []


def test_the_knob_stays_in_its_circle(open_page):
    page = open_page()
    until(lambda: page.evaluate('panel.steering.able'), 'a pad')
    for keys in (['ArrowUp'], ['ArrowUp', 'ArrowLeft'], ['ArrowDown', 'ArrowRight']):
        for key in keys:
            page.keyboard.down(key)
        out = page.evaluate("""() => { const [pad, knob] = ['#pad', '#pad i'].map(
            (one) => document.querySelector(one).getBoundingClientRect());
            return Math.hypot(pad.x + pad.width / 2 - knob.x - knob.width / 2,
                pad.y + pad.height / 2 - knob.y - knob.height / 2)
                + knob.width / 2 - pad.width / 2; }""")
        assert -20.0 < out < 0.0
        for key in keys:
            page.keyboard.up(key)


def test_a_tour_walks_through_the_gaits_until_another_command(rig, open_page):
    page, gaits = open_page(), rig[2].gaits
    until(lambda: page.evaluate('panel.steering.able'), 'a pad')
    rig[3].clear()
    seen = len(gaits)

    def toured():
        # A page that stands still for a moment lets go of the robot, which ends the tour.
        page.evaluate("""() => { const { tour } = panel;
            if (!tour.remaining) document.querySelector('#tour').click();
            else tour.nextChange = Math.min(tour.nextChange, panel.latest.time + 0.5); }""")
        return {'walk', 'trot'} <= set(gaits[seen:]) and (0.4, 0.0) in rig[3]
    until(toured, 'two gaits, ahead')
    page.locator('#gaits button[data-gait=trot]').click()
    until(lambda: rig[3][-1] == (0.0, 0.0), 'the stop')
    assert page.locator('#tour').inner_text() == 'Tour of the gaits'


def test_missed_frames_leave_a_gap_and_speeds_are_averaged_over_a_stride(open_page):
    page = open_page()
    lines, mean = page.evaluate("""() => { const { plots } = panel;
        plots.frames = []; plots.setFrequency(2);  // a stride takes 0.5 s
        plots.cellCount = 1;
        for (let k = 0; k < 60; k++) if (k < 20 || k > 40)
          plots.add({ time: 1000 + 0.025 * k, cells: [k, k],
            speed: [0.3 + Math.cos(2 * Math.PI * k / 20), 0, 1] });
        return [plots.path(plots.frames, 0), plots.speed()]; }""")
    assert lines.index(None) == 20 and lines.count(None) == 1 and lines[21] == [41, 41]
    assert mean == [pytest.approx(0.3, abs=0.1), 0, 1]


def test_shift_and_a_drag_on_the_robot_push_it(open_page):
    page = open_page()
    page.evaluate("panel.scene.preset('top')")
    until(lambda: page.evaluate(
        'Math.abs(panel.scene.camera.matrixWorld.elements[14] - panel.scene.camera.position.z)'
        ) < 1e-3, 'a picture from above')
    x, y = page.evaluate("""() => {
        const { scene } = panel, box = scene.canvas.getBoundingClientRect();
        window.pushed = [];
        scene.push = (...push) => window.pushed.push(push);
        // As beside a simulation.
        Object.defineProperty(scene, 'pushable', { get: () => true, set() {} });
        const at = scene.robot.position.clone().project(scene.camera);
        return [box.left + (1 + at.x) * box.width / 2, box.top + (1 - at.y) * box.height / 2];
        }""")
    page.keyboard.down('Shift')
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(x + 50, y)  # seen from above with x down, to the left of the robot
    assert page.evaluate('panel.scene.pushArrow.visible')
    page.mouse.up()
    page.keyboard.up('Shift')
    ((force, direction),) = page.evaluate('window.pushed')
    assert 20.0 < force <= 300.0 and direction == pytest.approx(90.0, abs=10.0)
    assert not page.evaluate('panel.scene.pushArrow.visible')
    before = page.evaluate('panel.scene.view')
    page.mouse.down()
    page.mouse.move(x, y)
    page.mouse.up()
    assert page.evaluate('panel.scene.view') != before  # without Shift it turns the camera


def test_it_comes_back_after_the_panel_was_gone(rig, browser):
    domain = rig[0].domain
    panel, address = start_panel(domain, '-r', '__node:=second_panel')
    port = re.search(r':(\d+)/', address)[1]
    second = browser.new_page()
    second.goto(address)
    until(lambda: second.evaluate('panel.frames > 0'), 'frames')
    panel.end()
    until(lambda: 'gone' in second.locator('#link-state').inner_text(), 'the page says so')
    panel, _ = start_panel(domain, '-r', '__node:=second_panel', port=port)
    try:
        seen = second.evaluate('panel.frames')
        until(lambda: second.evaluate('panel.frames') > seen + 5, 'frames again')
    finally:
        second.close()
        panel.end()


def test_a_push_makes_a_simulated_robot_fall_and_a_reset_puts_it_up(browser):
    with ExitStack() as ending:
        # In turns, so that a slow machine makes a slow robot.
        body = Process('-p', 'lockstep:=true', '-p', 'real_time_factor:=0.8',
                       executable=EXECUTABLE.with_name('robot_sim'))
        ending.callback(body.end)
        generator = Process('-p', 'use_sim_time:=true', '-p', 'rate:=500.0', '-p', 'robot:='
                            'unitree_go2', '-p', "combined_topic:=''", domain=body.domain)
        ending.callback(generator.end)
        panel, address = start_panel(body.domain)
        ending.callback(panel.end)
        page = browser.new_page()
        ending.callback(page.close)
        page.goto(address)
        until(lambda: page.locator('#push').is_visible(), 'what pushes')
        health = page.locator('#health')
        until(lambda: '/robot_sim' in health.text_content(), 'the health of the simulation')
        assert 'the robot has fallen' not in health.text_content()
        slow = page.locator('#slow')
        until(slow.is_visible, 'a warning of slow motion')
        assert re.fullmatch(r'0\.[0-8]\d of real time', slow.inner_text())
        banner = page.locator('#fallen')
        assert not banner.is_visible()
        page.locator('#force').fill('300')
        assert page.locator('#force-is').inner_text().startswith('300')

        def pushed():
            page.locator('#push').click()
            return 'the robot has fallen' in health.text_content()

        until(pushed, 'a fall that the page shows')
        until(banner.is_visible, 'the banner')
        assert page.locator('#worst').get_attribute('class') == 'chip error'
        banner.locator('button').click()
        until(lambda: not banner.is_visible(), 'a robot that is up')
        assert 'the robot has fallen' not in health.text_content()
