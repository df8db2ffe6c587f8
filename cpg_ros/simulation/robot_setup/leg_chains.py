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

"""Legs of a robot's description: mirrored pairs of chains of joints that reach lowest.

Anchors of joints and lengths between them do not depend on the joints' zeros, so they suffice to
find the legs. Names only decide which way a robot faces, and which limbs are arms.
"""

from collections.abc import Iterable, Mapping, Sequence

from cpg_ros.fitting.gaits.leg_names import Legs, LegsError, limb_of, place_of
from cpg_ros.motion.description import (
    DescriptionError,
    JointDescription,
    LegChain,
    REVOLUTE_TYPES,
    RobotDescription,
    sprawls,
)
from cpg_ros.networks.leg_numbers import leg_names
import numpy as np

#: DIRECTIONS: directions in which a robot may face, by quarter turns to the left of x.
DIRECTIONS = ('x', 'y', '-x', '-y')
#: MID_TOLERANCE: distance from the middle of the body, as a fraction of the largest, up to
#: which a joint is on it.
MID_TOLERANCE = 0.05
#: MIRROR_TOLERANCE: largest difference in place or length between opposite legs, as a fraction of
#: their length.
MIRROR_TOLERANCE = 0.2
#: Largest differences from the lowest leg, as fractions of its length. END_TOLERANCE: height of a
#: leg's end; HIP_TOLERANCE: height of its first joint.
END_TOLERANCE, HIP_TOLERANCE = 0.35, 0.4
#: MIN_AXIS_RATIO: ratio of axes along x to axes along y above which legs move along y;
#: MAX_VERTICAL: largest vertical component of an axis that is level.
MIN_AXIS_RATIO, MAX_VERTICAL = 1.3, 0.5
#: PLANE_TOLERANCE: fraction of the axes' directions up to which they lie in a plane.
PLANE_TOLERANCE = 0.05
#: UNLIMITED_RANGE: range of a joint from which on it counts as unlimited, rad.
UNLIMITED_RANGE = 100.0
#: MAX_LEG_JOINTS: largest number of driven joints of a leg.
MAX_LEG_JOINTS = 6


def legs_in(description: RobotDescription, faces_x: bool = False,
            texts: Mapping[str, str] | None = None) -> Legs:
    """Find the legs of a robot; the explanation has a line for each part that is held.

    Args:
        description: the description.
        faces_x: whether x is forward, whatever names and axes suggest.
        texts: leg -> text in the names of its joints, for all legs; empty to find them.

    Raises:
        LegsError: there are no pairs of legs, or names and positions contradict each other.
        DescriptionError: a leg is of a kind that robot files do not have.

    """
    if texts:
        return _cleaned(description, _named(description, texts))
    paths = _paths(description)
    facing_x = _assigned(description, paths, 0)
    agrees = facing_x and not _misnamed(facing_x) and all(
        place_of(joints)[0] for joints in facing_x.values())
    crosswise = not agrees and _crosswise(
        description, (facing_x or _assigned(description, paths, 1)).values())
    quarters = (0,) if faces_x else (1, 3) if crosswise else (0, 2)
    by_quarter = {quarter: legs for quarter in quarters
                  if (legs := _assigned(description, paths, quarter))}
    if not by_quarter:
        raise LegsError(_question(description, paths))
    fitting = [quarter for quarter in by_quarter if faces_x or not _misnamed(by_quarter[quarter])]
    if not fitting:
        raise LegsError(_contradiction(description, next(iter(by_quarter.values()))))
    if fitting[0]:
        ways = ' or '.join(DIRECTIONS[quarter] for quarter in fitting)
        raise LegsError(
            f'the robot faces {ways} in the {description.format}, by '
            f"{'the axes of its legs' if crosswise else 'the names of its legs'}, but x must be "
            f'forward (REP 103): --forward={DIRECTIONS[fitting[0]]} writes a turned URDF, '
            '--forward x keeps x as forward')
    return _cleaned(description, by_quarter[fitting[0]])


def _paths(description: RobotDescription) -> list[tuple[str, ...]]:
    """Return the moving joints from the root to each end."""
    chains = {name: tuple(joint.name for joint in description.chain(name) if joint.kind != 'fixed')
              for name, joint in description.joints.items() if joint.kind != 'fixed'}
    inner = {name for chain in chains.values() for name in chain[:-1]}
    return [chain for name, chain in chains.items() if name not in inner]


def _crosswise(description: RobotDescription, legs: Iterable[Sequence[str]]) -> bool:
    """Return whether legs pitch about x rather than about y, as in a robot that faces y.

    Two joints in a row with parallel axes pitch. Below a level axis, such as that of abduction,
    they are across it when the leg hangs, whatever the zero of that joint.
    """
    across = np.zeros(3)
    for leg in legs:
        axes = np.array([description.direction(name) for name in leg
                         if description.joints[name].kind in REVOLUTE_TYPES])
        first = next((k for k in range(len(axes) - 1) if abs(axes[k] @ axes[k + 1]) > 0.99), None)
        if first is None:
            across += np.abs(axes).sum(axis=0)
        elif first and abs(axes[first - 1, 2]) < MAX_VERTICAL:
            across += np.abs(np.cross((0.0, 0.0, 1.0), axes[first - 1]))
        elif not sprawls(axes[max(first - 1, 0):first + 2]):
            across += np.abs(axes[first])
    return bool(across[0] > MIN_AXIS_RATIO * across[1])


def _assigned(description: RobotDescription, paths: Sequence[Sequence[str]], quarter: int
              ) -> dict[str, tuple[str, ...]]:
    """Return the legs of a robot that faces a direction, from behind; nothing without pairs."""
    ahead = np.round([np.cos(quarter * np.pi / 2), np.sin(quarter * np.pi / 2), 0.0])
    left = np.array([-ahead[1], ahead[0], 0.0])
    pairs = [pair for pair in _pairs(_limbs(description, paths, left), left) if all(
        limb_of(limb.joints) != 'other' and 1 < sum(
            not description.joints[name].undrivable for name in limb.joints) <= MAX_LEG_JOINTS
        for limb in pair)]
    legs = [pair for pair in pairs if not any(limb_of(limb.joints) == 'arm' for limb in pair)]
    if not legs and len(pairs) > 1:
        # Some call the links of a fore leg arm and hand.
        legs = pairs
    if not legs:
        return {}
    lowest = min((pair[0] for pair in legs), key=_bottom)
    length = sum(lowest.lengths)
    legs = [pair for pair in legs if _bottom(pair[0]) <= _bottom(lowest) + END_TOLERANCE * length
            and pair[0].anchors[0, 2] <= lowest.anchors[0, 2] + HIP_TOLERANCE * length]
    legs.sort(key=lambda pair: float(pair[0].anchors[0] @ ahead))
    if len(legs) > 3 or (len(legs) == 1 and limb_of(legs[0][0].joints) == 'upper'):
        return {}
    return dict(zip(leg_names(2 * len(legs)), (limb.joints for pair in legs for limb in pair),
                    strict=True))


def _bottom(limb: LegChain) -> float:
    """Return the lowest height that a limb could reach, m."""
    return float(limb.anchors[0, 2] - sum(limb.lengths))


def _limbs(description: RobotDescription, paths: Sequence[Sequence[str]], left: np.ndarray
           ) -> list[LegChain]:
    """Return the longest chain of each part of the body that begins off the middle plane."""
    aside = {name: abs(float(description.frame(name)[0] @ left)) for path in paths
             for name in path}
    middle = max(MID_TOLERANCE * max(aside.values(), default=0.0), 1e-6)
    limbs: dict[str, LegChain] = {}
    for path in paths:
        joints = path[next((k for k, name in enumerate(path) if aside[name] > middle), len(path)):]
        if joints:
            limb = description.leg(joints)
            limbs[joints[0]] = max(limb, limbs.get(joints[0], limb),
                                   key=lambda one: float(sum(one.lengths)))
    return [limb for limb in limbs.values() if sum(limb.lengths) > 0.0]


def _pairs(limbs: Sequence[LegChain], left: np.ndarray) -> list[tuple[LegChain, LegChain]]:
    """Return limbs with their mirror images, the left ones first."""
    free = [limb for limb in limbs if limb.anchors[0] @ left < 0.0]
    pairs = []
    for limb in limbs:
        if limb.anchors[0] @ left < 0.0 or not free:
            continue
        mirrored = limb.anchors[0] - 2.0 * (limb.anchors[0] @ left) * left
        nearest = min(free, key=lambda other: float(np.linalg.norm(other.anchors[0] - mirrored)))
        # Between joints: the meshes of feet may be missing on one side.
        unlike = abs(float(sum(limb.lengths[:-1]) - sum(nearest.lengths[:-1])))
        if max(float(np.linalg.norm(nearest.anchors[0] - mirrored)), unlike
               ) <= MIRROR_TOLERANCE * max(float(sum(one.lengths)) for one in (limb, nearest)):
            pairs.append((limb, nearest))
            free.remove(nearest)
    return pairs


def _question(description: RobotDescription, paths: Sequence[Sequence[str]]) -> str:
    """Return a question about which limbs are legs, with the option that answers it."""
    axes = np.array([description.direction(name) for path in paths for name in path
                     if description.joints[name].kind in REVOLUTE_TYPES]).reshape(-1, 3)
    spread, ways = np.linalg.eigh(axes.T @ axes / max(len(axes), 1))
    if len(paths) > 3 and max(spread[0], abs(ways[2, 0])) < PLANE_TOLERANCE < spread[1]:
        # Legs roll and pitch about level axes, and what is across both is up.
        return ('no legs are found: by the axes of the joints, '
                f'{"xyz"[int(np.abs(ways[:, 0]).argmax())]} is up, but z must be (REP 103): turn '
                'the description')
    limbs = _limbs(description, paths, np.array([0.0, 1.0, 0.0]))
    why = ('no legs are found: no two limbs of two to six joints that reach down are mirror '
           'images of each other')
    lowest = min(limbs, key=_bottom, default=None)
    if lowest is not None and len(lowest.joints) > MAX_LEG_JOINTS:
        why += f' (the lowest limb, from {lowest.joints[0]} on, has {len(lowest.joints)})'
    limbs = sorted((limb for limb in limbs if 1 < len(limb.joints) <= MAX_LEG_JOINTS),
                   key=lambda limb: float(limb.anchors[0, 0]))
    left, right = ([limb for limb in limbs if sign * limb.anchors[0, 1] > 0.0]
                   for sign in (1.0, -1.0))
    if not 1 <= len(left) == len(right) <= 3:
        return f'{why}; --legs LEG=TEXT ... names each leg by a part of the names of its joints'
    limbs = [limb for pair in zip(left, right, strict=True) for limb in pair]
    options = [f'{leg}={_in_all(limb.joints)}'
               for leg, limb in zip(leg_names(len(limbs)), limbs, strict=True)]
    return (f'{why}: are the limbs at '
            + ', '.join(f'({x:.2g}, {y:.2g}) m' for x, y, _ in (one.anchors[0] for one in limbs))
            + f' the legs? Then say --legs {" ".join(options)}')


def _in_all(names: Sequence[str]) -> str:
    """Return the common beginning of names, else the first of them."""
    count = next((k for k, letters in enumerate(zip(*names, strict=False))
                  if len(set(letters)) > 1), 0)
    return names[0][:count] or names[0]


def _misnamed(legs: Mapping[str, Sequence[str]]) -> list[str]:
    """Return the legs whose joints' names contradict their positions."""
    wrong = []
    for leg, joints in legs.items():
        side, end = place_of(joints)
        if (side and side != leg[0]) or (end and len(legs) > 2 and end != leg[1:]):
            wrong.append(leg)
    return wrong


def _contradiction(description: RobotDescription, legs: Mapping[str, Sequence[str]]) -> str:
    leg = _misnamed(legs)[0]
    x, y, _ = description.frame(legs[leg][0])[0]
    return (f"'{legs[leg][0]}' is at x {x:.3g} m, y {y:.3g} m, where the leg {leg} is, but has "
            'the name of another; no way of turning the robot makes all names fit: correct the '
            'description; or give --forward x if the positions are right and the names are not; '
            'or correct and give --legs '
            + ' '.join(f'{leg}={_in_all(joints)}' for leg, joints in legs.items()))


def _named(description: RobotDescription, texts: Mapping[str, str]) -> dict[str, tuple[str, ...]]:
    """Return the joints whose names contain the given texts."""
    if len(texts) % 2 or set(texts) != set(leg_names(len(texts))):
        raise LegsError(f'--legs: {", ".join(texts)} are not the names of two, four or six legs, '
                        f'which are {", ".join(leg_names(2))}; {", ".join(leg_names(4))}; '
                        f'{", ".join(leg_names(6))}')
    legs = {leg: tuple(sorted((name for name, joint in description.joints.items()
                               if joint.kind != 'fixed' and texts[leg] in name),
                              key=lambda name: len(description.chain(name))))
            for leg in leg_names(len(texts))}
    for leg, names in legs.items():
        if not names:
            raise LegsError(f"--legs: no joint that moves has '{texts[leg]}' in its name ({leg})")
        others = [other for other in legs if other != leg and set(names) & set(legs[other])]
        if others:
            raise LegsError(f"--legs: '{texts[leg]}' is in names of {leg} and of {others[0]}")
    return legs


def _cleaned(description: RobotDescription, legs: Mapping[str, Sequence[str]]) -> Legs:
    """Remove joints that no cell can drive, on both sides, and add notes on them."""
    notes, names = [], list(legs)
    keep: dict[str, tuple[str, ...]] = {}
    for pair in zip(names[::2], names[1::2], strict=True):
        why = {(leg, k): reason for leg in pair for k, joint in enumerate(legs[leg])
               if (reason := _held(description, legs[leg], joint))}
        same_size = len(legs[pair[0]]) == len(legs[pair[1]])
        for leg in pair:
            out = {k for other, k in why if same_size or other == leg}
            for k in sorted(out):
                reason = why.get((leg, k)) or f'is the pair of {legs[pair[leg == pair[0]]][k]}'
                notes.append(f'{leg}: {legs[leg][k]} {reason}, and is held')
            keep[leg] = tuple(name for k, name in enumerate(legs[leg]) if k not in out)
            if not keep[leg]:
                raise LegsError(f'leg {leg}: none of its joints can be driven')
    driven = {name for joints in keep.values() for name in joints}
    rest = tuple(name for name, joint in description.joints.items()
                 if joint.kind in REVOLUTE_TYPES and name not in driven)
    return Legs(keep, '\n'.join(notes), rest)


def _held(description: RobotDescription, leg: Sequence[str], name: str) -> str:
    """Return why a joint of a leg is not driven, or ''."""
    joint = description.joints[name]
    if joint.mimic in leg:
        raise DescriptionError(f"the joint '{name}' follows '{joint.mimic}' of the same leg: legs "
                               'with coupled joints (four-bar linkages, belts) are not supported')
    if joint.passive and name != leg[-1]:
        raise DescriptionError(f"the joint '{name}' has no motor, and joints below it have: legs "
                               'with springs or passive joints between driven ones are not '
                               'supported')
    return joint.undrivable or ('is a wheel' if _wheel(description, leg, joint) else '')


def _wheel(description: RobotDescription, leg: Sequence[str], joint: JointDescription) -> bool:
    """Return whether a joint is a wheel: unlimited, below two limited, parallel to the last."""
    before = [name for name in leg[:-1] if description.joints[name].kind == 'revolute']
    endless = joint.kind == 'continuous' or joint.upper - joint.lower > UNLIMITED_RANGE
    if not endless or joint.name != leg[-1] or len(before) < 2:
        return False
    return bool(abs(description.direction(joint.name) @ description.direction(before[-1])) > 0.7)
