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

"""The numbers of all feedback laws, each law on or off by itself."""

from typing import NamedTuple


class Gains(NamedTuple):
    """Which laws are on, and their gains; SI units, found on a simulated Go2.

    Attributes:
        posture, placement, pace, reflexes, slope, heading, speed, sidestep: whether the law is on.
        touchdown, tegotae: the same of two laws of the phase, see their files.
        roll, roll_rate: metres a foot is drawn in per metre to the left and rad, or rad/s.
        pitch, pitch_rate: the same of pitch, by metres to the front.
        posture_most: most that posture moves a foot in stance, m.
        step, step_left: s, by which a velocity error forward or sideways makes a longer step.
        step_pitch_rate, step_roll_rate: m per rad/s, forward and sideways.
        step_filter: time constant, s.
        step_most: most that a foot is placed elsewhere, m.
        step_decay: rate at which that is given up in stance, 1/s.
        give, give_left: shares of the velocity error that feet in stance yield to.
        pace_from: velocity error sideways at which strides get faster, m/s.
        pace_gain: share of the frequency per m/s above that.
        pace_most: largest share.
        pace_fatigue: by how many times its mean of late strides get slower again.
        pace_memory: time constant of that mean, s.
        lift: of a foot that meets something while it swings forward, m.
        reach_rate, reach_most: of a foot that finds no ground in stance, m/s and m.
        reflex_rate: at which both, and an early landing, are given up, 1/s.
        slope_share: of the way by which gravity's line through the body misses its feet.
        slope_height: of the body above its feet, m.
        slope_filter: time constant of the angles of the ground, s.
        slope_most: most that feet are moved for it, m.
        turn: yaw rate wanted per heading error, 1/s.
        turn_most: largest one, rad/s.
        speed_share, speed_rate: stride per m/s of missing speed, and per m of missing way.
        speed_most: most that strides are changed for it.
        sidestep_share: of the wanted way.
        sidestep_most: most that a foot is carried sideways, m.
        touchdown_gain: share of a landing's error that phases are changed by.
        tegotae_gain: rad/s for the whole weight on a leg.
        smooth: time constant of every displacement, s.

    """

    posture: bool = True
    placement: bool = True
    pace: bool = True
    reflexes: bool = True
    slope: bool = True
    heading: bool = True
    speed: bool = True
    sidestep: bool = True
    touchdown: bool = False
    tegotae: bool = False

    roll: float = 1.6
    roll_rate: float = 0.14
    pitch: float = 1.10
    pitch_rate: float = 0.062
    posture_most: float = 0.08

    step: float = 0.16
    step_left: float = 0.16
    step_pitch_rate: float = 0.02
    step_roll_rate: float = 0.0
    step_filter: float = 0.032
    step_most: float = 0.17
    step_decay: float = 3.1
    give: float = 0.0
    give_left: float = 0.8

    pace_from: float = 0.12
    pace_gain: float = 4.0
    pace_most: float = 0.8
    pace_fatigue: float = 2.0
    pace_memory: float = 2.0

    lift: float = 0.06
    reach_rate: float = 0.3
    reach_most: float = 0.05
    reflex_rate: float = 8.0

    slope_share: float = 0.7
    slope_height: float = 0.3
    slope_filter: float = 0.5
    slope_most: float = 0.1

    turn: float = 1.0
    turn_most: float = 0.6

    speed_share: float = 0.5
    speed_rate: float = 0.3
    speed_most: float = 0.3

    sidestep_share: float = 1.1
    sidestep_most: float = 0.08

    touchdown_gain: float = 0.5
    tegotae_gain: float = 4.0

    smooth: float = 0.008
