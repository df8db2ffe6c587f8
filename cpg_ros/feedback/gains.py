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

    The first ten are switches, and their texts say what each law does.

    Attributes:
        posture: keep the body level, through the legs in stance and the height of feet in swing.
        placement: put feet down further in the direction in which the body is too fast.
        pace: take faster strides for a while when the body is pushed sideways.
        reflexes: lift feet over obstacles, and reach for ground that is missing.
        slope: move the feet under the centre of mass on slopes.
        heading: hold the heading, by strides that differ between left and right.
        speed: hold the speed, through the length of the strides.
        sidestep: follow the sideways speed of cmd_vel.
        touchdown: begin a leg's stance when its foot lands.
        tegotae: keep a leg that bears load in its stance.
        roll: how far posture draws a foot in, per metre to the left and rad of roll [1/rad].
        roll_rate: how far posture draws a foot in, per metre to the left and rad/s of roll rate
            [s/rad].
        pitch: how far posture lets a foot out, per metre to the front and rad of pitch [1/rad].
        pitch_rate: how far posture lets a foot out, per metre to the front and rad/s of pitch
            rate [s/rad].
        posture_most: the most that posture moves a foot in stance [m].
        step: how much further a foot is put forward per m/s of forward velocity error [s].
        step_left: how much further a foot is put sideways per m/s of sideways velocity error [s].
        step_pitch_rate: how much further a foot is put forward per rad/s of pitch rate error
            [m s/rad].
        step_roll_rate: how much further a foot is put sideways per rad/s of roll rate error
            [m s/rad].
        step_filter: time constant with which a foot in swing is moved [s].
        step_most: the most that placement moves a foot [m].
        step_decay: rate at which placement's displacement decays in stance [1/s].
        give: share of the forward velocity error to which feet in stance yield.
        give_left: share of the sideways velocity error to which feet in stance yield.
        pace_from: sideways velocity error above which strides become faster [m/s].
        pace_gain: relative increase of the stride frequency per m/s above pace_from [s/m].
        pace_most: largest relative increase of the stride frequency.
        pace_fatigue: how many times the mean of recent increases is subtracted from a new one.
        pace_memory: time constant of the mean of recent increases [s].
        lift: how far a foot is lifted when it hits something in swing [m].
        reach_rate: speed at which a foot that finds no ground in stance reaches for it [m/s].
        reach_most: the most that a foot without ground reaches for it [m].
        reflex_rate: rate at which the lift, the reach and the height held after an early landing
            decay [1/s].
        slope_share: share of the way to the vertical through the body by which feet are moved.
        slope_height: height of the body above its feet [m].
        slope_filter: time constant of the filter on the angles of the ground [s].
        slope_most: the most that slope moves the feet [m].
        turn: yaw rate asked for per rad of heading error [1/s].
        turn_most: the largest yaw rate asked for [rad/s].
        speed_share: how much longer strides become per m/s of missing speed [s/m].
        speed_rate: how much longer strides become per metre of missing distance [1/m].
        speed_most: the most by which speed changes the length of strides.
        sidestep_share: share of the commanded sideways motion that feet carry out.
        sidestep_most: the most that a foot is carried sideways [m].
        sidestep_rate: how fast the sideways speed that feet are asked for is corrected by what is
            missing of it [1/s].
        sidestep_more: largest such correction, as a share of the commanded sideways speed.
        touchdown_gain: share of a landing's phase error that is corrected.
        tegotae_gain: largest change of the phase's rate when a leg bears the whole weight [rad/s].
        smooth: time constant with which every displacement is smoothed [s].

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
    sidestep_rate: float = 0.5
    sidestep_more: float = 1.0

    touchdown_gain: float = 0.5
    tegotae_gain: float = 4.0

    smooth: float = 0.008
