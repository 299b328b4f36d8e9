"""Hostile bytes by the thousand, and by the million in the long checks: nothing is raised, kept or left uncounted."""

import gc
import sys
from dataclasses import dataclass, field
from types import BuiltinFunctionType, FunctionType, ModuleType

import msgpack
import pytest
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st

from patrol.exchange import Reply, Sensed
from patrol.pose import Drive, Pose
from patrol.radio.inbox import Inboxes, Rules
from patrol.radio.message import MAX_CM, MAX_FRAMES, MAX_ROBOT, MAX_SEQUENCE, MAX_TRAIL, Position, encode
from patrol.random import mix
from runtime.messages.phases import (
    MAX_REPLY,
    Failed,
    Hello,
    PhaseA,
    PhaseB,
    ReplyA,
    ReplyB,
    ToRobot,
    ToWorld,
    decode_to_robot,
    decode_to_world,
    max_to_robot,
)
from runtime.messages.phases import encode as encode_phase
from runtime.net.mailbox import Mailbox

KEY = b"the fleet's own key"
ROSTER = (1, 2, 3, 4, 5)
BOUNDS = (0.0, 0.0, 100.0, 88.0)
EACH = 20
MUTANTS = 199
FLAT = 20_000
"""Bytes by which what is kept may differ between the beginning and the end: the last frames of each sender."""

CODE = (type, ModuleType, FunctionType, BuiltinFunctionType)


def framed(key: bytes | None) -> st.SearchStrategy[bytes]:
    """Frames of robots that exist and of some that do not, at places on the terrain and off it."""
    trails = st.lists(st.tuples(st.integers(-300, 300), st.integers(-(2**15), 2**15 - 1)), max_size=MAX_TRAIL)
    positions = st.builds(
        Position,
        st.integers(0, 6) | st.integers(0, MAX_ROBOT),
        st.integers(0, 200) | st.integers(0, MAX_SEQUENCE),
        st.integers(0, 2**32 - 1),
        st.integers(0, 10_000) | st.integers(-MAX_CM, MAX_CM),
        st.integers(0, 8_800) | st.integers(-MAX_CM, MAX_CM),
        st.integers(0, 6283),
        trails.map(tuple),
    )
    return positions.map(lambda position: encode(position, key))


plausible = st.builds(
    lambda robot, sequence, x_cm: encode(Position(robot, sequence, 0, 5000 + x_cm, 4000, 0), KEY),
    st.integers(2, 5),
    st.integers(0, 60),
    st.integers(0, 200),
)
frames = framed(None) | framed(KEY) | framed(b"another key")
numbers = st.integers(-(2**63), 2**64 - 1) | st.floats() | st.booleans() | st.none()
junk = st.recursive(
    numbers | st.binary(max_size=80) | st.text(max_size=8),
    lambda inner: st.lists(inner, max_size=10) | st.dictionaries(st.text(max_size=3), inner, max_size=3),
    max_leaves=12,
)
ticks = st.integers(0, 99)
head = st.just(1), st.just(7), ticks, st.just(5)
goals = st.none() | st.just((1.0, 2.0))
phases = st.one_of(
    st.builds(PhaseB, *head, st.lists(frames, max_size=6).map(tuple)),
    st.builds(lambda k, bumped: PhaseA(1, 7, k, 5, Sensed(k, Pose(1.0, 2.0, 3.0), bumped)), ticks, st.booleans()),
    st.builds(Hello, *head[:3], ticks),
    st.builds(ReplyA, *head, st.lists(frames, max_size=MAX_FRAMES).map(tuple)),
    st.builds(
        ReplyB, *head, st.builds(Reply, st.just(Drive(1.0, 0.1)), st.just("patrolling"), goals, st.just(1.0), ticks)
    ),
    st.builds(Failed, *head, st.sampled_from(["", "its policy failed"])),
)
hostile = st.one_of(
    st.binary(max_size=100), frames, plausible, phases.map(encode_phase), st.lists(junk, max_size=10).map(msgpack.packb)
)


def mutant(frame: bytes, other: bytes, chance: int) -> bytes:
    """One of many ways to bend a frame."""
    way, place, value = chance % 8, (chance >> 8) % (len(frame) + 1), (chance >> 40) % 256
    before, after = frame[:place], frame[place:]
    bent = bytes([value])
    return (
        before,
        before + bent + after,
        before + after[1:],
        before + bent + after[1:],
        before + bytes([(after or bent)[0] ^ 1 << value % 8]) + after[1:],
        frame[:-8] + mix(chance).to_bytes(8, "little"),  # a tag that is guessed
        before + other[place:],
        before + after * (1 + value % 4),
    )[way]


@dataclass
class Besieged:
    """Everything that reads what others send: a robot's inboxes and mailbox, and the world's mailbox."""

    sent: int = 0
    believed: list[int] = field(default_factory=lambda: [0, 0])
    open_inboxes: Inboxes = field(default_factory=lambda: Inboxes([1], Rules(ROSTER, BOUNDS, 4.0)))
    keyed_inboxes: Inboxes = field(default_factory=lambda: Inboxes([1], Rules(ROSTER, BOUNDS, 4.0, KEY)))
    robot: Mailbox[ToRobot] = field(default_factory=lambda: Mailbox(("tick",), decode_to_robot, max_to_robot(5)))
    world: Mailbox[ToWorld] = field(default_factory=lambda: Mailbox(("reply",), decode_to_world, MAX_REPLY))
    taken: int = 0
    strangers: int = 0

    def hear(self, data: bytes, tags: set[bytes]) -> None:
        tick = self.sent // 10
        self.sent += 1
        heard = {1: [data]}
        believed = [bool(boxes.hear(tick, heard).positions(1)) for boxes in (self.open_inboxes, self.keyed_inboxes)]
        self.believed = [count + one for count, one in zip(self.believed, believed, strict=True)]
        if believed[1] and data not in tags:
            self.strangers += 1
        self.robot.deliver("tick", data)
        self.world.deliver("reply", data)
        if self.sent % 100 == 0:
            self.empty()

    def empty(self) -> None:
        for mailbox in (self.robot, self.world):
            while mailbox.get() is not None:
                self.taken += 1


def attack(besieged: Besieged, examples: int) -> None:
    """So many examples of `EACH` frames and `MUTANTS` of each."""

    @settings(
        max_examples=examples,
        phases=[Phase.generate],
        suppress_health_check=list(HealthCheck),
        database=None,
        deadline=None,
    )
    @given(st.lists(hostile, min_size=EACH, max_size=EACH), st.integers(0, 2**63))
    def wave(seeds: list[bytes], salt: int) -> None:
        genuine = set(seeds)
        for index, data in enumerate(seeds):
            besieged.hear(data, genuine)
            for number in range(MUTANTS):
                besieged.hear(mutant(data, seeds[number % EACH], mix(salt, index, number)), genuine)

    wave()


def kept(root: object) -> int:
    """Bytes of everything that can be reached from an object, but for modules, classes and code."""
    seen: set[int] = set()
    waiting, size = [root], 0
    while waiting:
        thing = waiting.pop()
        if id(thing) in seen or isinstance(thing, CODE):
            continue
        seen.add(id(thing))
        size += sys.getsizeof(thing)
        waiting += gc.get_referents(thing)
    return size


@pytest.mark.parametrize("examples", [4, pytest.param(250, marks=pytest.mark.accept)], ids=["thousands", "a-million"])
def test_hostile_frames_are_counted_and_nothing_else(examples: int) -> None:
    besieged = Besieged()
    attack(besieged, max(examples // 10, 4))
    besieged.empty()
    before = kept(besieged)
    attack(besieged, examples)
    besieged.empty()
    assert besieged.sent >= examples * EACH * (1 + MUTANTS)
    for believed, inboxes in zip(besieged.believed, (besieged.open_inboxes, besieged.keyed_inboxes), strict=True):
        assert believed + inboxes.rejected(1) == besieged.sent
        assert believed > 0
    refused = besieged.robot.refused.total() + besieged.world.refused.total()
    assert besieged.taken + refused == 2 * besieged.sent
    assert besieged.taken > 0
    assert besieged.strangers == 0
    assert kept(besieged) < before + FLAT
