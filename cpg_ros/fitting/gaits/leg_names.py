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

"""Assignment of joints to legs by common naming schemes.

Quadrupeds: a code of two letters (LF or FL, RF or FR; hind LH, HL, RL, BL, LR and RH, HR, RR, BR),
or the words left or right with front or fore, hind, rear or back, anywhere in the name and in any
case: FL_hip_joint, lf_haa, JointPosRR_calf, front_left_knee, hip_hind_right. Hexapods: also LM or
ML and RM or MR, or middle or mid for front: LMCoxa, left_middle_femur. Three pairs or more may be
numbered from the head: L1_coxa ... R3_tibia. Bipeds: left, right, LT, RT, L or R alone: left_knee,
L_hip, hip_rt, LHipPitch. An R after the side stands for roll: LLEG_HIP_R.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
import re

from cpg_ros.common.errors import CpgError
from cpg_ros.networks.leg_numbers import leg_names

#: SIDES, ENDS: letters and words of left and right, and of fore and hind.
SIDES = {'left': 'l', 'l': 'l', 'lt': 'l', 'right': 'r', 'r': 'r', 'rt': 'r'}
ENDS = {'front': 'f', 'fore': 'f', 'hind': 'h', 'rear': 'h', 'back': 'h', 'middle': 'm',
        'mid': 'm'}
#: CODES: code in a name -> leg; in RL and RR the first letter is that of the rear.
CODES = {'lf': 'lf', 'fl': 'lf', 'rf': 'rf', 'fr': 'rf',
         'lh': 'lh', 'hl': 'lh', 'rl': 'lh', 'lr': 'lh', 'bl': 'lh', 'lb': 'lh',
         'rh': 'rh', 'hr': 'rh', 'rr': 'rh', 'br': 'rh', 'rb': 'rh',
         'lm': 'lm', 'ml': 'lm', 'rm': 'rm', 'mr': 'rm'}
#: Words of joints of no leg. ARMS: of arms; APPENDAGES: of neither; NON_LEGS: of both, and of the
#: body; UPPER_LIMBS: of a biped's arms, which a quadruped's fore legs have as well.
ARMS = {'arm', 'gripper', 'finger', 'thumb', 'hand'}
APPENDAGES = {'neck', 'head', 'tail', 'wheel', 'caster', 'rotor', 'eye', 'ear', 'camera',
              'antenna'}
NON_LEGS = {*ARMS, *APPENDAGES, 'torso', 'waist', 'trunk', 'spine', 'pelvis', 'thorax', 'progress'}
UPPER_LIMBS = {'shoulder', 'sho', 'elbow', 'wrist', 'forearm', 'sh', 'el', 'wr'}
#: JOINTS: names of joints, by which a code written without a gap is found: flhip, RRcalf, lknee.
JOINTS = ('hip', 'thigh', 'calf', 'knee', 'ankle', 'abd', 'haa', 'hfe', 'kfe', 'upper', 'lower',
          'shoulder', 'elbow', 'coxa', 'femur', 'tibia', 'foot', 'leg', 'joint', 'hx', 'hy', 'kn')
#: Names of the legs by number of legs, in the networks' order.
HEXAPOD, QUADRUPED, BIPED = leg_names(6), leg_names(4), leg_names(2)

_WORD = re.compile(r'[A-Z]+(?=[A-Z][a-z])|[A-Z]?[a-z]+|[A-Z]+|\d+')
#: Code of a leg that is counted from the head on, such as l1.
_NUMBERED_LEG = re.compile(r'(?<![a-z])([lr])([1-9])(?!\d)', re.IGNORECASE)
_LEG_PREFIX = re.compile(
    rf'(?<![a-z])({"|".join((*CODES, *SIDES, *ENDS))})(?=({"|".join(JOINTS)}))', re.IGNORECASE)


class LegsError(CpgError):
    """No legs can be identified from the names; the message lists those found or missing."""


@dataclass(frozen=True)
class Legs:
    """Joints by leg.

    Attributes:
        joints: leg -> names of its joints in the given order; legs in the order of the networks.
        explanation: how they were read, one line.
        unassigned: joints of no leg.

    """

    joints: Mapping[str, tuple[str, ...]]
    explanation: str = ''
    unassigned: tuple[str, ...] = ()

    def __getitem__(self, leg: str) -> tuple[str, ...]:
        """Return the names of a leg's joints."""
        return self.joints[leg]

    def __iter__(self) -> Iterator[str]:
        """Return the names of the legs."""
        return iter(self.joints)

    def __len__(self) -> int:
        """Return the number of legs."""
        return len(self.joints)


def words_of(name: str) -> list[str]:
    """Split a name into lower-case words, at signs, digits, capitals, and after a code."""
    words = [word.lower() for word in _WORD.findall(_LEG_PREFIX.sub(r'\1_', name))]
    side = next((k for k, word in enumerate(words) if word in SIDES), len(words))
    return [word if k <= side or word != 'r' else 'roll' for k, word in enumerate(words)]


def _moving_part(words: Sequence[str]) -> Sequence[str]:
    """Return the words of the part that a joint moves: not torso in torso_to_abduct."""
    return words[words.index('to') + 1:] if 'to' in words else words


def _leg_match(words: Sequence[str]) -> tuple[str, str, frozenset[str]]:
    """Return the leg of four or six, the leg of two ('' for none), and the words that name it."""
    codes = {CODES[word] for word in words if word in CODES}
    sides = {SIDES[word] for word in words if word in SIDES}
    ends = {ENDS[word] for word in words if word in ENDS}
    if len(codes) == 1:
        return codes.pop(), '', frozenset(word for word in words if word in CODES)
    if codes or len(sides) != 1:
        return '', '', frozenset()
    side, leg_words = sides.pop(), frozenset(word for word in words if word in SIDES)
    two = BIPED[side == 'r']
    if len(ends) == 1:
        return side + ends.pop(), two, leg_words | {word for word in words if word in ENDS}
    return '', two, leg_words


def place_of(joints: Sequence[str]) -> tuple[str, str]:
    """Return side (l, r) and end (f, m, h) in the names of a leg's joints, '' for none.

    Both must be the same in all names.
    """
    matches = [_leg_match(words_of(name))[:2] for name in joints]
    sides, ends = {(four or two)[:1] for four, two in matches}, {four[1:] for four, _ in matches}
    return (sides.pop() if len(sides) == 1 else '', ends.pop() if len(ends) == 1 else '')


def limb_of(joints: Sequence[str]) -> str:
    """Return what names of a limb's joints, but the last, say it is, '' for nothing.

    Either ``other``, which is no leg, ``arm``, or ``upper``, an arm or a fore leg.
    """
    words = {word for name in joints[:-1] or joints for word in _moving_part(words_of(name))}
    return next((kind for kind, vocabulary in (('other', APPENDAGES), ('arm', ARMS),
                                               ('upper', UPPER_LIMBS)) if words & vocabulary), '')


def role_of(name: str) -> str:
    """Return a joint's name without its leg, equal for the same joint of each leg."""
    numbers, rest = _NUMBERED_LEG.findall(name), _NUMBERED_LEG.sub('', name)
    if len(numbers) == 1 and any(sign.isalpha() for sign in rest):
        return ' '.join(words_of(rest))
    words = words_of(name)
    leg_words = _leg_match(words)[2]
    return ' '.join(word for word in words if word not in leg_words)


def legs_of(joints: Sequence[str]) -> Legs:
    """Identify the legs of joints from their names.

    Args:
        joints: names.

    Raises:
        LegsError: no leg, or not all of two, four or six legs can be identified, or they belong to
            two robots.

    """
    by_number = _numbered_legs(joints)
    if by_number:
        leg_words = {name: ('', '', frozenset(_NUMBERED_LEG.findall(name)[0]))
                     for names in by_number.values() for name in names}
        return Legs(by_number, _explanation(by_number, leg_words, joints),
                    _rest(by_number, joints))
    _refuse_two(joints)
    words = {name: words_of(name) for name in joints}
    matches = {name: _leg_match(words[name]) for name in joints}
    # A code is a name's own, an L a hint: first four legs are looked for, or six.
    more = HEXAPOD if any(matches[name][0] in ('lm', 'rm') for name in joints) else QUADRUPED
    for labels, column, non_legs in ((more, 0, NON_LEGS), (BIPED, 1, NON_LEGS | UPPER_LIMBS)):
        legs = {leg: tuple(name for name in joints if matches[name][column] == leg
                            and not non_legs & set(_moving_part(words[name]))) for leg in labels}
        present = [leg for leg in labels if legs[leg]]
        if len(present) == len(labels):
            break
        # Two codes may be left and right of a biped by chance, three are a quadruped's.
        if column == 0 and len(present) >= 2 and not _directions(present, matches, joints):
            raise LegsError(_missing(present, labels, matches, joints))
    else:
        if present:
            raise LegsError(_missing(present, labels, matches, joints))
        raise LegsError(f'cannot identify legs from the joint names {_listed(list(joints))}; they '
                        'usually contain LF, RF, LH, RH, front_left ... or left, right; a robot '
                        'file (--robot) says which joint is whose')
    return Legs(legs, _explanation(legs, matches, joints), _rest(legs, joints))


def _numbered_legs(joints: Sequence[str]) -> dict[str, tuple[str, ...]]:
    """Return the joints of numbered legs, L1 R1 L2 ..., or nothing if they are not numbered.

    Each number of a joint occurs once; each number of a leg occurs with the same joints as others.
    """
    by_leg: dict[tuple[str, int], list[str]] = {}
    for name in joints:
        leg_words = _NUMBERED_LEG.findall(name)
        if len(leg_words) == 1:
            by_leg.setdefault((leg_words[0][0].lower(), int(leg_words[0][1])), []).append(name)
    pairs = len(by_leg) // 2
    roles = {tuple(sorted(_NUMBERED_LEG.sub('', name) for name in names))
             for names in by_leg.values()}
    expected = {(side, k + 1) for side in 'lr' for k in range(pairs)}
    if pairs < 3 or set(by_leg) != expected or len(roles) > 1 or len(next(iter(roles))) < 2:
        return {}
    order = [(side, k) for k in range(pairs, 0, -1) for side in 'lr']
    return {leg: tuple(by_leg[leg_key]) for leg,
            leg_key in zip(leg_names(2 * pairs), order, strict=True)}


def _refuse_two(joints: Sequence[str]) -> None:
    """Refuse names that differ only in what precedes the leg's name."""
    robots: dict[tuple[str, ...], dict[tuple[str, ...], str]] = {}
    for name in joints:
        words = words_of(name)
        leg_words = _leg_match(words)[2]
        index = next((k for k, word in enumerate(words) if word in leg_words), 0)
        if index and not set(words[:index]) & set(JOINTS):
            robots.setdefault(tuple(words[:index]), {})[tuple(words[index:])] = name
    for prefix, names in robots.items():
        # With a single joint a leg, the word before may name the joint.
        roles = {tuple(word for word in rest if word not in _leg_match(rest)[2]) for rest in names}
        other = next((other_names for key, other_names in robots.items() if key != prefix
                      and set(other_names) == set(names)), None)
        if other is not None and len(roles) > 1:
            raise LegsError('joints of two robots are there, such as '
                            f"'{next(iter(names.values()))}' and '{next(iter(other.values()))}'; "
                            'name those of one (--joints)')


def _directions(present: list[str], matches: Mapping, joints: Sequence[str]) -> bool:
    """Tell whether the front of right_hip_front is a direction, as beside right_knee.

    It is if joints without an end have names that those with an end lack.
    """
    with_end = [name for name in joints if matches[name][0] in present]
    plain = {role_of(name) for name in joints if matches[name][1] and not matches[name][0]
             and not (NON_LEGS | UPPER_LIMBS) & set(words_of(name))}
    return (len({leg[1] for leg in present}) == 1 and all(matches[name][1] for name in with_end)
            and bool(plain) and plain.isdisjoint(map(role_of, with_end)))


def _rest(legs: Mapping[str, tuple[str, ...]], joints: Sequence[str]) -> tuple[str, ...]:
    return tuple(name for name in joints if not any(name in names for names in legs.values()))


def _listed(names: list[str]) -> str:
    shown = ', '.join(names[:6])
    return f'{shown} and {len(names) - 6} more' if len(names) > 6 else shown or '(none)'


def _missing(present: list[str], labels: tuple[str, ...], matches: Mapping, joints: Sequence[str]
             ) -> str:
    lacking = ', '.join(leg for leg in labels if leg not in present)
    column = 1 if labels == BIPED else 0
    example = next(name for name in joints if matches[name][column] in present)
    return (f"joints of the legs {', '.join(present)} are there (such as '{example}'), but none "
            f'of {lacking}')


def _explanation(legs: Mapping[str, tuple[str, ...]], matches: Mapping,
                 joints: Sequence[str]) -> str:
    parts = []
    for leg, names in legs.items():
        leg_words = sorted({'_'.join(word for word in words_of(name) if word in matches[name][2])
                            for name in names})
        text = f'{names[0]} ... {names[-1]}' if len(names) > 2 else ', '.join(names)
        parts.append(f"{leg} by '{' or '.join(leg_words)}' ({len(names)} joint"
                     f"{'s' if len(names) > 1 else ''}: {text})")
    rest = _rest(legs, joints)
    return ('legs read from the names: ' + '; '.join(parts)
            + (f'; of no leg: {_listed(list(rest))}' if rest else ''))
