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

"""The tick of the pattern in plain Python and numpy, to compare the core in C with.

A network is a Stepper, whose steps are compared with numba's elsewhere; nothing else of the core
is used. Without `strides`, `correct` and stalls where they are not given, a tick is that of
Pattern.advance.
"""

import math

import numpy as np

TURN = 2.0 * math.pi


def smoothstep(s):
    return s * s * (3.0 - 2.0 * s), 6.0 * s * (1.0 - s)


def come_to_rest(start, rate, end, time, s):
    fraction, slope = smoothstep(s)
    return (start + fraction * (end - start) + s * (1.0 - s)**2 * time * rate,
            slope * (end - start) / time + (1.0 - s) * (1.0 - 3.0 * s) * rate)


def linear(table, cycles):
    if not math.isfinite(cycles):
        return math.nan
    place = cycles % 1.0 * len(table)
    low = int(place) % len(table)
    return table[low] + (place - int(place)) * (table[(low + 1) % len(table)] - table[low])


def cubic(table, column, cycles):
    """Value and slope per cycle of a periodic table of values and slopes per entry."""
    if not math.isfinite(cycles):
        return math.nan, math.nan
    place = cycles % 1.0 * len(table)
    low, t = int(place) % len(table), place - int(place)
    (a, da), (b, db) = (table[row, column:column + 2] for row in (low, (low + 1) % len(table)))
    c2, c3 = 3.0 * (b - a) - 2.0 * da - db, da + db - 2.0 * (b - a)
    return a + t * (da + t * (c2 + t * c3)), (da + t * (2.0 * c2 + 3.0 * t * c3)) * len(table)


def moved(phase, k, centre, own):
    """The phase at which joints are read for another duty factor, and its derivative."""
    s, c = math.sin(math.pi * (phase - centre)), math.cos(math.pi * (phase - centre))
    return own + math.atan2(k * s, c) / math.pi, k / (c * c + k * k * s * s)


def joint(w, x, y, dx, dy):
    return (w @ [x, y, x * x, x * y, x**3, x * x * y],
            (w[0] + 2.0 * w[2] * x + w[3] * y + 3.0 * w[4] * x * x + 2.0 * w[5] * x * y) * dx
            + (w[1] + w[3] * x + w[5] * x * x) * dy)


class WaveTrackReadout:
    """Joints by the waveform of cells: x over the peak, y its derivative by phase."""

    def __init__(self, readout):
        self.of, self.wave = readout, readout.wave

    def begin(self, phase):
        """Nothing is remembered."""

    def read(self, now, strides):
        """Return x, y and their derivatives by the strides of each joint, legs, distance."""
        wave, by_phase = self.wave, self.wave.period / TURN
        cells = wave.phases.size
        x, y, z = (now[n][:cells] * by_phase**n / wave.peak for n in range(3))
        turns = np.arctan2(-y, x) / TURN
        legs = np.array([(turns[cell] + linear(wave.phase_offset, turns[cell])) % 1.0
                         for cell in self.of.joints.leg_cells])
        base = legs[0] - wave.phases[self.of.joints.leg_cells[0]]
        off = [abs(x[cell] - linear(wave.values, base + wave.phases[cell]))
               if math.isfinite(base) else math.nan for cell in range(cells)]
        signals = []
        for number, cell in enumerate(self.of.joints.cells):
            one = x[cell], y[cell], y[cell], z[cell]
            if self.of.retiming is not None:
                one = self.retimed(*one[:2], one[3], number)
            signals.append((one[0], one[1], TURN * one[2], TURN * one[3]))
        return signals, legs, np.max(off)

    def retimed(self, x, y, z, number):
        offset, cycle, maps = self.of.retiming
        square = x * x + y * y
        turning = (y * y - x * z) / square if square > 1e-12 else 1.0
        growing = y * (x + z) / square if square > 1e-12 else 0.0
        turn = math.atan2(-y, x) / TURN
        ahead, slope = cubic(offset, 0, turn)
        theta, going = turn + ahead, (1.0 + slope) * turning
        own_x, (own_y, own_z) = cubic(cycle, 0, theta)[0], cubic(cycle, 2, theta)
        whole = own_x**2 + own_y**2
        size = math.sqrt(square / whole)
        growing = size * (growing - going * own_y * (own_x + own_z / TURN) / whole)
        phase, steep = moved(theta, *maps[number])
        unit_x, (unit_y, unit_z) = cubic(cycle, 0, phase)[0], cubic(cycle, 2, phase)
        speed = size * steep * going
        return (size * unit_x, size * unit_y, speed * unit_y + growing * unit_x,
                speed * unit_z / TURN + growing * unit_y)


class PhaseTrackReadout:
    """Joints by the phase of cells, which clocks follow as a lock-in amplifier does."""

    def __init__(self, readout):
        self.of = readout

    def begin(self, phase):
        cells = self.of.gait.phases.size
        self.phase, self.amount = (phase + self.of.gait.phases) % 1.0, np.ones(cells)
        # What the speed is above 1, and the amplitude's rate: now, and at the next look.
        self.speed, self.growth = np.zeros((2, cells)), np.zeros((2, cells))

    def read(self, now, strides):
        waves, phases, maps, known = self.of.gait
        distance = 0.0
        if strides > 0.0:
            self.phase = (self.phase + strides * (1.0 + 0.5 * self.speed.sum(axis=0))) % 1.0
            self.amount = self.amount + 0.5 * strides * self.growth.sum(axis=0)
            self.speed[0], self.growth[0] = self.speed[1], self.growth[1]
            off = [self.pulled(cell, now[0], strides) for cell in range(waves.size)]
            first = self.of.joints.leg_cells[0]
            late = self.phase - self.phase[first] + phases[first] - phases
            distance = np.max([*off, *(4.0 * np.abs(late - np.floor(late + 0.5)))])
        signals = [self.signal(cell, maps[cell]) for cell in range(waves.size)]
        legs = [(self.phase[cell] - known.crests[waves[cell]]) % 1.0
                for cell in self.of.joints.leg_cells]
        return [signals[cell] for cell in self.of.joints.cells], np.array(legs), distance

    def pulled(self, cell, state, strides):
        waves, _, _, known = self.of.gait
        shape, circle = known.shape[waves[cell]], known.circles[waves[cell]]
        table, phase = known.tables[waves[cell]], self.phase[cell]
        there = [cubic(table[:, [v, v + 2]], 0, phase)[0] if math.isfinite(phase) else math.nan
                 for v in (0, 1)]
        here = (state[[cell, waves.size + cell]] - shape[:2]) / shape[2:]
        gap = np.clip(here, -2.0, 2.0) - self.amount[cell] * np.array(there)
        c, s = math.cos(TURN * phase), math.sin(TURN * phase)
        along = (circle[::2] * c + circle[1::2] * s) @ gap
        across = (circle[1::2] * c - circle[::2] * s) @ gap
        pull, fraction = 1.0 / (1.0 + 2.0 * strides), strides / (0.25 + strides)
        self.speed[1, cell] += fraction * (np.clip(pull * across / TURN, -0.5, 0.5)
                                        - self.speed[1, cell])
        self.growth[1, cell] += fraction * (pull * along - self.growth[1, cell])
        return np.max([*np.abs(here - there), abs(self.amount[cell] - 1.0)])

    def signal(self, cell, its_map):
        terms = self.of.gait.known.terms[self.of.gait.waves[cell]]
        phase, steep = self.phase[cell], 1.0
        if its_map[0] != 1.0:
            phase, steep = moved(phase, *its_map)
        k = np.arange(len(terms))
        x, y, z = ((terms[:, 0] - 1j * terms[:, 1]) * (1j * k)**n @ np.exp(1j * TURN * k * phase)
                   for n in range(3))
        amount, scale, rate = self.amount[cell], 1.0, 0.0
        if amount < 1.0:
            rest = 1.0 - amount**2 if amount > 0.0 else 1.0
            scale = 1.0 - rest**3
            rate = 6.0 * max(amount, 0.0) * rest**2 * self.growth[0, cell]
        speed = steep * TURN * (1.0 + self.speed[0, cell])
        return (scale * x.real, scale * y.real, scale * y.real * speed + rate * x.real,
                scale * z.real * speed + rate * y.real)


class PlainTrack:
    """A network that runs a plan, and its watchdog."""

    def __init__(self, plan, transition, strides):
        self.plan, self.transition, self.progress, self.strides = plan, transition, 0.0, strides
        kind = WaveTrackReadout if hasattr(plan.readout, 'wave') else PhaseTrackReadout
        self.readout = kind(plan.readout)
        self.reseed(plan.readout.start)

    def reseed(self, phase):
        ahead = (phase - self.plan.readout.start) % 1.0
        self.stepper = self.plan.seed.copy()
        self.stepper.advance(ahead * self.plan.orbit.period)
        self.readout.begin(ahead)
        self.look(0.0)
        self.phase, self.astray = float(self.legs[0]), 0.0

    def look(self, strides):
        signals, self.legs, distance = self.readout.read(self.stepper.now, strides)
        plan, weights = self.plan, self.plan.readout.joints.weights
        self.angle, self.d_angle = np.array([joint(w, *s) for w, s in zip(
            weights, signals, strict=True)]).T
        if self.strides is not None:
            still, lift = np.array([joint(w, *s) for w, s in zip(
                plan.in_place.joints.weights, signals, strict=True)]).T
            longer = self.strides.stride[plan.robot.leg_of_joint] - 1.0
            self.reach = self.angle - still
            self.d_angle = self.d_angle + longer * (self.d_angle - lift)
            self.angle = self.angle + longer * self.reach
        self.angle = self.angle + plan.shift
        return distance

    def advance(self, strides):
        self.stepper.advance(strides * self.plan.orbit.period)
        distance, expected = self.look(strides), self.phase + strides
        if not math.isfinite(distance):
            self.phase = expected % 1.0
            return False
        error = (self.legs[0] - expected + 0.5) % 1.0 - 0.5
        self.phase = (expected + min(1.0, 0.5 * strides) * error) % 1.0
        self.astray = self.astray + strides if distance > 0.3 or abs(error) > 0.15 else 0.0
        return self.astray <= 0.5

    def rate(self, frequency):
        if self.strides is None:
            return self.d_angle * frequency
        rate = self.strides.rate[self.plan.robot.leg_of_joint]
        return self.d_angle * frequency + rate * self.reach


class PlainStrides:
    """Strides and pace approach their targets as critically damped oscillators do."""

    def __init__(self, legs):
        self.now, self.v = np.ones(legs + 1), np.zeros(legs + 1)
        self.target, self.trim = np.ones(legs + 1), np.zeros(legs)

    stride, rate = property(lambda self: self.now[:-1]), property(lambda self: self.v[:-1])

    def advance(self, dt):
        target = self.target.copy()
        target[:-1] = np.clip(target[:-1] + self.trim, -1.0, 1.0) if self.trim.any() \
            else target[:-1]
        gap, decay = self.now - target, math.exp(-dt / 0.2)
        pull = self.v + gap / 0.2
        self.now, self.v = target + (gap + pull * dt) * decay, (self.v - pull * dt / 0.2) * decay


class PlainRamp:
    """A level on its way in cubics that end at rest, each (start, rate, end, time)."""

    def __init__(self, level):
        self.level, self.rate, self.parts, self.past = level, 0.0, [], 0.0

    def go(self, end, time):
        level, rate, self.parts, self.past = self.level, self.rate, [], 0.0
        if rate * (end - level) < 0.0:
            turn = level + 0.5 * (float(rate > 0.0) - level)
            self.parts, level, rate = [(level, rate, turn, 2.0 * (turn - level) / rate)], turn, 0.0
        self.parts.append((level, rate, end, min(time, 3.0 * (end - level) / rate) if rate
                           else time))

    def advance(self, clock):
        (start, rate, end, time), self.past = self.parts[0], self.past + clock
        if time <= 0.0 or self.past >= time:
            self.level, self.rate, self.past = end, 0.0, 0.0
            del self.parts[0]
        else:
            self.level, self.rate = come_to_rest(start, rate, end, time, self.past / time)


class PlainPattern:
    """Joint positions and velocities, as Pattern has them."""

    def __init__(self, plan, ramp, strides=None):
        robot = plan.robot
        self.offset, self.strides, self.correct = robot.column('offset'), strides, None
        self.limits = [robot.column(name) for name in ('lower', 'upper', 'velocity')]
        self.tracks, self.waiting = [PlainTrack(plan, 0, strides)], []
        self.faults, self.scale = 0, 1.0
        self.tracks[0].reseed(0.0)
        self.frequency, self.slowing, self.slower, self.last = plan.frequency, 1.0, 1.0, None
        self.position = self.wanted = self.offset.copy()
        self.velocity = self.rate = self.correction = np.zeros_like(self.offset)
        self.behind = np.zeros(self.offset.size, bool)
        self.jump, self.absorbed = None, math.inf
        self.ramp, self.approach, self.found = PlainRamp(0.0), PlainRamp(1.0), 0.0 * self.offset
        self.stall = self.past = self.low = 0.0
        self.ramp.go(1.0, max(ramp, 0.05))

    def start_from(self, angles, time):
        self.found, self.position = angles - self.offset, np.clip(angles, *self.limits[:2])
        self.approach.go(0.0, max(time, 0.05, np.max(3.0 * np.abs(self.found) / self.limits[2])))

    def resume(self, stall):
        pace = self.pace(self.past / self.stall) if self.stall else 1.0
        self.low = pace * max(0.0, 1.0 - stall / 0.1)
        self.stall, self.past = min(0.5, stall + self.stall - self.past), 0.0

    def pace(self, s):
        return self.low + (1.0 - self.low) * smoothstep(s)[0]

    def slowed_in(self, dt):
        if not self.stall:
            return dt, 1.0
        before, after = self.past / self.stall, min(1.0, (self.past + dt) / self.stall)
        risen = after**3 * (1.0 - 0.5 * after) - before**3 * (1.0 - 0.5 * before)
        way = (self.stall * (self.low * (after - before) + (1.0 - self.low) * risen)
               + max(0.0, self.past + dt - self.stall))
        self.past, pace = self.past + dt, self.pace(after)
        if after == 1.0:
            self.stall = self.past = 0.0
        return way, pace

    def recover(self, track):
        self.faults, self.jump, self.absorbed = self.faults + 1, None, 0.0
        track.reseed(track.phase)

    def advance(self, dt):
        if self.waiting and len(self.tracks) < 4:
            plan, transition = self.waiting.pop()
            self.tracks.append(PlainTrack(plan, max(transition, 0.05), self.strides))
            self.tracks[-1].reseed(self.tracks[-2].phase)
        clock, pace = (self.scale * one for one in self.slowed_in(dt))
        calm = (len(self.tracks) == 1 and not (self.ramp.parts or self.approach.parts)
                and self.absorbed >= 0.3)
        if not (calm and self.cruise(clock)):
            parts = max(1, math.ceil(clock / 1e-3 - 1e-9))
            for _ in range(parts):
                self.step(clock / parts)
        wanted, rate = self.wanted, pace * self.rate
        if self.correct is not None:
            before, self.correction = self.correction, self.correct(wanted) - wanted
            wanted, rate = wanted + self.correction, rate + (self.correction - before) / dt
        self.confine(wanted, rate, dt)

    def confine(self, wanted, rate, dt):
        (lower, upper, fastest), last = self.limits, self.position
        reach = fastest * dt * (1.0 + 1e-9)
        new = np.clip(np.clip(wanted, last - reach, last + reach), lower, upper)
        held = new != wanted
        step = (new - last) / dt
        beside = step - np.clip(step, np.minimum(rate, self.velocity),
                                np.maximum(rate, self.velocity))
        free = ~(held | (np.abs(rate) > fastest * (1.0 + 1e-9)) | self.behind
                 | (np.abs(beside) > 0.05 * fastest))
        self.velocity = np.clip(np.where(free, rate, step), -fastest, fastest)
        self.position, self.behind = new, held

    def cruise(self, dt):
        self.slowing, self.slower, self.last, track = 1.0, 1.0, None, self.tracks[0]
        strides, frequency = self.steered(track.plan.frequency, dt, dt)
        if not track.advance(strides):
            track.phase -= strides
            self.recover(track)
            self.step(0.0)
            return False
        self.wanted = self.ramp.level * track.angle + self.offset
        self.rate = self.ramp.level * track.rate(frequency)
        return True

    def steered(self, frequency, dt, clock):
        if self.strides is not None:
            self.strides.advance(clock)
            frequency = frequency * self.strides.now[-1]
        before, self.frequency = self.frequency, frequency
        return 0.5 * (before + frequency) * clock, frequency

    def step(self, dt):
        clock, self.slowing = 0.5 * dt * (self.slowing + self.slower), self.slower
        tracks, moving, leading = self.tracks, len(self.tracks) > 1, bool(self.approach.parts)
        frequency, fades = tracks[0].plan.frequency, []
        for track in tracks[1:]:
            track.progress = min(1.0, track.progress + clock / track.transition)
            fraction, slope = smoothstep(track.progress)
            fades.append((fraction, slope / track.transition))
            frequency += fraction * (track.plan.frequency - frequency)
        strides, frequency = self.steered(frequency, dt, clock)
        for track in tracks:
            if not track.advance(strides):
                self.recover(track)
        wanted, rate = tracks[0].angle, tracks[0].rate(frequency)
        for track, (fraction, slope) in zip(tracks[1:], fades, strict=True):
            gap = track.angle - wanted
            rate = rate + fraction * (track.rate(frequency) - rate) + slope * gap
            wanted = wanted + fraction * gap
        while len(tracks) > 1 and tracks[1].progress >= 1.0:
            del tracks[0]
        if self.ramp.parts:
            moving = True
            if not leading:
                self.ramp.advance(clock)
        rate = self.ramp.level * rate + self.ramp.rate * wanted
        wanted = self.ramp.level * wanted
        if leading:
            self.approach.advance(clock)
            wanted = wanted + self.approach.level * self.found
            rate = rate + self.approach.rate * self.found
        if moving or leading:
            shifts = [track.plan.speed + 2.0 * (np.abs(track.plan.shift) + leading * np.abs(
                self.found)) for track in tracks]
            bound = 0.997 * np.minimum(np.max(shifts, axis=0), self.limits[2])
            ahead = rate if self.last is None else 2.0 * rate - self.last
            self.last = rate
            self.slower = 1.0 / max(1.0, np.max(np.abs(ahead) / np.maximum(bound, 1e-9)))
            rate = self.slowing * rate
        else:
            self.slowing, self.slower, self.last = 1.0, 1.0, None
        self.absorb(wanted + self.offset, rate, dt)

    def absorb(self, wanted, rate, dt):
        if self.absorbed < 0.3:
            if self.jump is None:
                self.jump = self.wanted + dt * self.rate - wanted, self.rate - rate
            else:
                self.absorbed += dt
            gap, gap_rate = come_to_rest(*self.jump, 0.0, 0.3, min(1.0, self.absorbed / 0.3))
            wanted, rate = wanted + gap, rate + gap_rate
        self.wanted, self.rate = wanted, rate
