"""The inboxes' table and kernel against the same rule in plain Python."""

import math

import numpy as np
from hypothesis import example, given, settings
from hypothesis import strategies as st

from patrol.pose import Pose
from patrol.radio.inbox import Heard, Inboxes, Rules
from patrol.radio.message import CONTACT, SPAN, Position, Rejected, RejectReason, decode, encode
from patrol.radio.peers import Peer

SPEED = 4.0
STEP = 0.5
BOUNDS = (0.0, 0.0, 100.0, 88.0)
KEY = b"fleet"


class Plain:
    """The rule in plain Python, for one listener: what `Inboxes` does for a row.

    A sender's past is a list of what was accepted, a set of its sequences, and a set of those whose looks are known.
    """

    def __init__(self, own: int, rules: Rules) -> None:
        self.own, self.rules = own, rules
        self.last: dict[int, tuple[Position, int]] = {}
        self.start: dict[int, float] = {}
        self.used: dict[int, set[int]] = {}
        self.known: dict[int, set[int]] = {}
        self.doubts: dict[int, list[tuple[Position, int]]] = {}

    def hear(self, data: bytes, tick: int) -> tuple[RejectReason | None, list[tuple[int, float, float]]]:
        """Why a frame is refused, or the looks that it makes known."""
        try:
            said = decode(data, self.rules.key)
            if said.robot == CONTACT:
                self.check_place(said, tick)
                self.check_contact(said, tick)
                return None, []
            if said.robot == self.own:
                raise Rejected(RejectReason.OWN, "")
            if said.robot not in self.rules.roster:
                raise Rejected(RejectReason.UNKNOWN, "")
            self.check_place(said, tick)
            return None, self.looks(said, self.accept(said, tick))
        except Rejected as rejected:
            return rejected.reason, []

    def check_place(self, said: Position, tick: int) -> None:
        x_min, y_min, x_max, y_max = self.rules.bounds
        for x, y in ((said.x_cm / 100.0, said.y_cm / 100.0), *said.past):
            if not (x_min - 0.02 <= x <= x_max + 0.02 and y_min - 0.02 <= y <= y_max + 0.02):
                raise Rejected(RejectReason.OUTSIDE, "")
        if self.rules.ahead is not None and said.sequence > tick + self.rules.ahead:
            raise Rejected(RejectReason.AHEAD, "")

    def check_contact(self, said: Position, tick: int) -> None:
        step = self.rules.step
        heard = [self.last[robot] for robot in sorted(self.last)]  # of two equally near ones the lower number counts
        leads = [said.sequence - last.sequence - (tick * step - at * step) / step for last, at in heard]
        if not leads:
            raise Rejected(RejectReason.UNKNOWN, "")
        if min(map(abs, leads)) > 4:
            raise Rejected(RejectReason.AHEAD if min(leads, key=abs) > 0 else RejectReason.OLD, "")

    def accept(self, said: Position, tick: int) -> int:
        """The tick that an accepted frame is of."""
        robot, sequence = said.robot, said.sequence
        if robot not in self.last:
            self.used[robot], self.known[robot], self.start[robot] = set(), set(), math.inf
        else:
            last, at = self.last[robot]
            outdated = last.sequence - sequence >= SPAN
            if (outdated and self.rules.ahead is not None) or (sequence in self.used[robot] and not outdated):
                raise Rejected(RejectReason.OLD, "")
            if sequence < last.sequence and not outdated:
                if self.apart(said, last) > self.rules.speed * (last.sequence - sequence + 1) * self.rules.step + 0.02:
                    raise Rejected(RejectReason.TOO_FAST, "")
                self.used[robot].add(sequence)
                return at - (last.sequence - sequence)
            reason = RejectReason.OLD if outdated else self.implausible((last, at), (said, tick))
            if reason is not None:
                row = self.doubts.get(robot, [])
                agrees = row and sequence > row[-1][0].sequence and not self.implausible(row[-1], (said, tick))
                self.doubts[robot] = [*row, (said, tick)] if agrees else [(said, tick)]
                if len(self.doubts[robot]) < 3:
                    raise Rejected(reason, "")
            if outdated:
                self.used[robot], self.known[robot], self.start[robot] = set(), set(), math.inf
        self.doubts.pop(robot, None)
        self.last[robot] = said, tick
        self.start[robot] = min(self.start[robot], tick * self.rules.step - sequence * self.rules.step)
        self.used[robot].add(sequence)
        return tick

    def implausible(self, before: tuple[Position, int], after: tuple[Position, int]) -> RejectReason | None:
        step = self.rules.step
        elapsed = after[1] * step - before[1] * step
        steps = after[0].sequence - before[0].sequence
        if self.rules.ahead is None and steps > 2.0 * elapsed / step + 64:
            return RejectReason.AHEAD
        delay = before[1] * step - before[0].sequence * step - self.start[before[0].robot]
        held_up = min(max(steps * step - elapsed, 0.0), max(delay, 0.0), SPAN * step)
        far = self.apart(before[0], after[0]) > self.rules.speed * (elapsed + held_up + step) + 0.02
        return RejectReason.TOO_FAST if far else None

    def looks(self, said: Position, tick: int) -> list[tuple[int, float, float]]:
        found, known, newest = [], self.known[said.robot], self.last[said.robot][0].sequence
        places = [(said.x_cm / 100.0, said.y_cm / 100.0), *said.past]
        longest = 100.0 * (self.rules.speed * self.rules.step * self.rules.trail_every + 0.02)
        ends = [place for place, (dx, dy) in enumerate(said.trail) if math.hypot(dx, dy) > longest]
        for place, (x, y) in enumerate(places[: ends[0] + 1 if ends else None]):
            ago = place * self.rules.trail_every
            if (
                ago <= min(tick, said.sequence)
                and newest - said.sequence + ago < SPAN
                and said.sequence - ago not in known
            ):
                known.add(said.sequence - ago)
                found.append((tick - ago, x, y))
        return found

    @staticmethod
    def apart(one: Position, other: Position) -> float:
        return math.hypot(other.x_cm - one.x_cm, other.y_cm - one.y_cm) / 100.0


def scripted(dice: np.random.Generator, now: int, places: dict[int, list[float]]) -> bytes:
    """A frame as a radio and those who forge might bring it: of now, late, far ahead, moved, with a trail or none."""
    robot = int(dice.choice([0, 1, 2, 2, 2, 3, 3, 3, 9]))
    ago = int(dice.choice([0, 0, 0, 0, 1, 2, 5, 40, 63, 64, 65, 90, -1, -3, -70]))
    x, y = places.setdefault(robot, [50.0, 40.0])
    places[robot] = x, y = [float(np.clip(v + dice.choice([0.0, 1.0, -1.0, 2.0]), 0, 88)) for v in (x, y)]
    if dice.random() < 0.15:
        x = float(dice.choice([-0.01, -0.03, 3.0, 80.0, 100.02, 100.03]))
    elif dice.random() < 0.1:
        places[robot] = [80.0 - x / 2.0, y]
    steps = [
        (int(dice.choice([-200, 0, 100, 230])), int(dice.choice([0, 50]))) for _ in range(int(dice.integers(0, 5)))
    ]
    position = Position.of(robot, max(now - ago, 0), 0.0, Pose(x, y, 0.5), tuple(steps) if dice.random() < 0.5 else ())
    return encode(position, KEY if dice.random() < 0.97 else b"another")


@settings(max_examples=60)
@given(
    seed=st.integers(0, 2**32 - 1),
    ahead=st.sampled_from([0, 0, 4, None]),
    every=st.sampled_from([1, 3]),
    listeners=st.sampled_from([(1,), (1, 2, 3)]),
)
@example(seed=141, ahead=0, every=1, listeners=(1, 2, 3))  # a contact as far ahead of one robot as behind another
def test_every_row_does_what_the_plain_rule_does(
    seed: int, ahead: int | None, every: int, listeners: tuple[int, ...]
) -> None:
    dice = np.random.default_rng(seed)
    rules = Rules((1, 2, 3), BOUNDS, SPEED, KEY, STEP, ahead, every)
    inboxes, plain = Inboxes(listeners, rules), {number: Plain(number, rules) for number in listeners}
    refused = {number: dict.fromkeys(RejectReason, 0) for number in listeners}
    now, places, sent = 60, dict[int, list[float]](), list[bytes]()
    for _ in range(60):
        now += int(dice.choice([0, 1, 1, 1, 2, 9]))
        frames = [scripted(dice, now, places) for _ in range(int(dice.integers(0, 5)))]
        frames += [sent[int(dice.integers(len(sent)))] for _ in range(2) if sent and dice.random() < 0.2]
        sent += frames
        reaches = dice.random((len(listeners), len(frames))) < 0.8
        intake = inboxes.hear(now, Heard(frames, listeners, reaches))
        for row, number in enumerate(listeners):
            heard = [data for data, hears in zip(frames, reaches[row], strict=True) if hears]
            found = [plain[number].hear(data, now) for data in heard]
            for reason, _ in found:
                if reason is not None:
                    refused[number][reason] += 1
            expected = [look for _, seen in found for look in seen]
            assert [(tick, pose.x, pose.y) for tick, pose in intake.looks(number)] == expected
            assert len(intake.positions(number)) == sum(reason is None for reason, _ in found)
            assert inboxes.counts(number) == refused[number]
            peers = {n: Peer(said.sequence, said.pose, at) for n, (said, at) in plain[number].last.items()}
            assert dict(inboxes.peers(number)) == peers
