"""The protocol between the world and a simulated robot, as bytes: two phases a tick, a greeting and a farewell.

    world to robot     Hello      who is there?              robot to world   HelloReply
                       PhaseA     your pose at tick k                         ReplyA    its frames: position, contacts
                       PhaseB     what you hear at tick k                     ReplyB    the command
                       Stop       leave, and why                              Failed    I cannot go on, and why
                                                                              Farewell  I have left

Every message is one msgpack array ``[kind, incarnation, instance, k, run, ...]``. The incarnation counts a robot's
processes (1 for the first). The instance is a random number of one process, which distinguishes it from a second
process under the same name. k is the tick, and run a random number of the world's process. Decoding is strict and pure:
all bytes either give a message or raise `patrol.errors.Malformed`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Any, Self

import msgpack
from pydantic import AfterValidator, Field

from patrol.errors import Malformed
from patrol.exchange import LEAST_WEIGHT, MOST_BLOCKED, MOST_WEIGHT, MOST_ZONES, Reply, Sensed
from patrol.pose import Pose, pack_command, unpack_command
from patrol.radio.message import MAX_CONTACTS, MAX_FRAME, MAX_FRAMES
from patrol.wire import FAIL_FAST, PRINTABLE, Bytes, Finite, Flag, Real, Row, Text, check, unpack

PROTOCOL = 9
ANYONE = 0
"""The instance in a hello, which is for all processes of a robot."""

PHASE_B_SHARE = 0.2
"""The share of a step after which phase B begins: a position that takes no longer is heard in its own tick."""

NO_RUN = 0
"""The run in the messages of a robot that no world has greeted yet; the robot thereby asks for a greeting."""

UNLIKE = "this process was started with another "
"""First words of the reason of a Stop for a process whose scenario or protocol is not the world's."""

MAX_REPLY, MAX_STATE = 2048, 32
"""Sizes of the longest message from a robot, bytes, and of its longest state word, characters."""
_MAX_REASON = 400
_LONGEST_INDEX = 5
"""Bytes of a point's index."""


def _pair_numbers(flat: tuple[float, ...]) -> tuple[tuple[float, float], ...]:
    if len(flat) % 2:
        raise ValueError("contacts are pairs")
    return tuple(zip(flat[::2], flat[1::2], strict=True))


_Count = Annotated[int, Field(strict=True, ge=0, le=2**31 - 1)]
_Id = Annotated[int, Field(strict=True, ge=0, le=2**63 - 1)]
_Reason = Annotated[Text, Field(max_length=_MAX_REASON), PRINTABLE]
_Contacts = Annotated[
    tuple[Finite, ...], Field(max_length=2 * MAX_CONTACTS, fail_fast=True), AfterValidator(_pair_numbers)
]
_Blocked = Annotated[tuple[_Count, ...], Field(max_length=MOST_BLOCKED, fail_fast=True)]
_Weight = Annotated[Finite, Field(ge=LEAST_WEIGHT, le=MOST_WEIGHT)]
_Weights = Annotated[tuple[tuple[_Count, _Weight], ...], Field(max_length=MOST_ZONES, fail_fast=True)]
_Zones = Annotated[tuple[_Count, ...], Field(max_length=MOST_ZONES, fail_fast=True)] | None


@dataclass(frozen=True, slots=True)
class Head(Row):
    """The first fields of every message."""

    incarnation: _Count  # counts the robot's processes, from 1
    instance: _Id  # random number of one process, or `ANYONE`
    k: _Count
    run: _Id  # random number of the run, or `NO_RUN`


@dataclass(frozen=True, slots=True)
class Hello(Head):
    """The world asks which robots are there."""


@dataclass(frozen=True, slots=True)
class PhaseA(Head):
    """The robot's senses at tick k."""

    sensed: Sensed

    @classmethod
    def columns(cls) -> Mapping[str, Any]:  # noqa: D102 - of `Row`
        pose = {"x": Finite, "y": Finite, "heading": Finite}
        senses = {"bumped": Flag, "contacts": _Contacts, "clock_s": Finite, "charge": Finite | None}
        ground = {"blocked": _Blocked, "zones": _Zones, "weights": _Weights}
        return {**Head.columns(), **pose, **senses, **ground}

    @classmethod
    def from_values(cls, *values: Any) -> Self:  # noqa: D102
        incarnation, instance, k, run, x, y, heading, *senses = values
        return cls(incarnation, instance, k, run, Sensed(k, Pose(x, y, heading), *senses))

    def to_values(self) -> tuple[Any, ...]:  # noqa: D102
        sensed, pose = self.sensed, self.sensed.pose
        # The tick is sent once, in the head, and receivers take both from there.
        if sensed.k != self.k:
            raise ValueError(f"a phase A of tick {self.k} cannot say what was sensed at tick {sensed.k}")
        # msgpack does not take all of numpy's numbers.
        pose_values = float(pose.x), float(pose.y), float(pose.heading)
        contacts = [float(value) for contact in sensed.contacts for value in contact]
        charge = None if sensed.charge is None else float(sensed.charge)
        zones = None if sensed.zones is None else list(sensed.zones)
        weights = [(number, float(weight)) for number, weight in sensed.weights]
        senses = bool(sensed.bumped), contacts, float(sensed.clock_s), charge, list(sensed.blocked), zones, weights
        return self.incarnation, self.instance, self.k, self.run, *pose_values, *senses


@dataclass(frozen=True, slots=True)
class PhaseB(Head):
    """The frames that reach the robot in tick k."""

    frames: Annotated[tuple[Annotated[Bytes, Field(max_length=MAX_FRAME)], ...], FAIL_FAST]  # by sender and sequence


@dataclass(frozen=True, slots=True)
class Stop(Head):
    """The world asks the robot to leave."""

    orderly: Flag  # the run is over; else this process is not, or no longer, part of it
    reason: _Reason  # one line


@dataclass(frozen=True, slots=True)
class HelloReply(Head):
    """The robot reports that it is there. Its run is the one that it answers, or `NO_RUN`."""

    # hash, by which the world checks that both use the same one
    scenario: Annotated[Text, Field(max_length=64), PRINTABLE]
    protocol: _Count = PROTOCOL


@dataclass(frozen=True, slots=True)
class ReplyA(Head):
    """The frames that the robot sends in tick k.

    The ether drops and counts those that are too long, so that the result is the same without a wire.
    """

    # its position frame, then those of its contacts; none when silent
    frames: Annotated[tuple[Bytes, ...], Field(max_length=MAX_FRAMES, fail_fast=True)]


@dataclass(frozen=True, slots=True)
class ReplyB(Head):
    """The reply of the robot's mind at tick k.

    The world refuses commands that are not finite, so that the result is the same without a wire.
    """

    reply: Reply

    @classmethod
    def columns(cls) -> Mapping[str, Any]:  # noqa: D102 - of `Row`
        command = {"model": _Count, "first": Real, "second": Real, "facing": Real | None}
        state = {"state": Annotated[Text, Field(max_length=MAX_STATE), PRINTABLE], "goal": tuple[Finite, Finite] | None}
        return {**Head.columns(), **command, **state, "decision_ms": Finite, "rejected": _Id}

    @classmethod
    def from_values(cls, *values: Any) -> Self:  # noqa: D102
        incarnation, instance, k, run, model, first, second, facing, state, goal, decision_ms, rejected = values
        reply = Reply(unpack_command(model, first, second, facing), state, goal, decision_ms, rejected)
        return cls(incarnation, instance, k, run, reply)

    def to_values(self) -> tuple[Any, ...]:  # noqa: D102
        reply = self.reply
        goal = None if reply.goal is None else (float(reply.goal[0]), float(reply.goal[1]))
        notes = str(reply.state), goal, float(reply.decision_ms), int(reply.rejected)
        return self.incarnation, self.instance, self.k, self.run, *pack_command(reply.command), *notes


@dataclass(frozen=True, slots=True)
class Failed(Head):
    """The robot's mind cannot go on after tick k."""

    reason: _Reason


@dataclass(frozen=True, slots=True)
class Farewell(Head):
    """The robot has left after tick k, and sends nothing more."""


ToRobot = Hello | PhaseA | PhaseB | Stop
ToWorld = HelloReply | ReplyA | ReplyB | Failed | Farewell

_TO_ROBOT: Mapping[int, type[ToRobot]] = {0: Hello, 1: PhaseA, 2: PhaseB, 3: Stop}
_TO_WORLD: Mapping[int, type[ToWorld]] = {0: HelloReply, 1: ReplyA, 2: ReplyB, 3: Failed, 4: Farewell}
_KINDS = {kind: number for kinds in (_TO_ROBOT, _TO_WORLD) for number, kind in kinds.items()}


def max_to_robot(robots: int) -> int:
    """Size of the longest message to a robot, in bytes, in a fleet of ``robots``.

    For example, each robot more adds 330 bytes: five frames of 64, and two bytes more for each.
    """
    return MAX_REPLY + robots * MAX_FRAMES * (MAX_FRAME + 2) + MOST_BLOCKED * _LONGEST_INDEX


def encode(message: ToRobot | ToWorld) -> bytes:
    """Pack a message, a reason cut short where it is too long. Receivers check all other limits."""
    fields = message.to_values()
    if isinstance(message, Stop | Failed):
        fields = (*fields[:-1], message.reason[:_MAX_REASON])
    packed: bytes = msgpack.packb((_KINDS[type(message)], *fields))
    return packed


def decode_to_robot(payload: bytes, zones: int = MOST_ZONES) -> ToRobot:
    """Decode a message from the world to a robot of a scenario with `zones` zones.

    Any other bytes raise `Malformed`, and no other exception.
    """
    message: ToRobot = _decode_message(payload, _TO_ROBOT)
    if isinstance(message, PhaseA):
        sensed = message.sensed
        number = max((*(sensed.zones or ()), *(number for number, _ in sensed.weights)), default=-1)
        # Its greatest number tells for all: they are not negative.
        if number >= zones:
            raise Malformed(f"zone {number} is in force, and the scenario's {zones} are numbered from 0")
    return message


def decode_to_world(payload: bytes) -> ToWorld:
    """Decode a message from a robot.

    Any other bytes raise `Malformed`, and no other exception.
    """
    if len(payload) > MAX_REPLY:
        raise Malformed(f"{len(payload)} bytes, at most {MAX_REPLY} are allowed")
    message: ToWorld = _decode_message(payload, _TO_WORLD)
    return message


def _decode_message(payload: bytes, kinds: Mapping[int, type[Any]]) -> Any:
    fields = unpack(payload)
    if type(fields) is not tuple or not fields or type(fields[0]) is not int or fields[0] not in kinds:
        raise Malformed("no array that begins with a known kind")
    return check(kinds[fields[0]], fields[1:])
