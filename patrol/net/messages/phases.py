"""The protocol between the world and a simulated robot, as bytes: two phases a tick, a greeting and a farewell.

    world to robot     Hello      who is there?              robot to world   HelloReply
                       PhaseA     your pose at tick k                         ReplyA    its frames: position, contacts
                       PhaseB     what you hear at tick k                     ReplyB    the command
                       Stop       leave, and why                              Failed    I cannot go on, and why
                                                                              Report    what it has sent and acted on

Every message is one msgpack array ``[kind, incarnation, instance, k, run, ...]``. The incarnation counts a robot's
processes (1 for the first). The instance is a random number of one process, which distinguishes it from a second
process under the same name. k is the tick, and run a random number of the world's process. Both phases carry a proof
that their tick has begun (`patrol.net.security.tick_chain`). Decoding is strict and pure: all bytes either give a
message or raise `Malformed`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import msgpack

from patrol.exchange import Reply, Sensed
from patrol.net.security.tick_chain import PROOF
from patrol.net.security.transcripts import DIGEST, MAX_DIGESTS, MAX_LINES, PLACES, Line, digest_of
from patrol.pose import Command, Pose, pack_command, unpack_command
from patrol.radio.message import MAX_CONTACTS, MAX_FRAME, MAX_FRAMES

PROTOCOL = 5
ANYONE = 0
"""The instance in a hello, which is for all processes of a robot."""

PHASE_B_SHARE = 0.2
"""The share of a step after which phase B begins: a position that takes no longer is heard in its own tick."""

NO_RUN = 0
"""The run in the messages of a robot that no world has greeted yet; the robot thereby asks for a greeting."""

UNLIKE = "this process was started with another "
"""How the reason of a Stop begins that turns away a process whose scenario or protocol is not the world's."""

MAX_REPLY, MAX_STATE = 2048, 32
"""Sizes of the longest message from a robot, bytes, and of its longest state word, characters."""

_MAX_COUNT = 2**31 - 1
_MAX_ID = 2**63 - 1
_MAX_REASON = 400
_HASH = 64
_HEAD = 5
_HELLO, _PHASE_A, _PHASE_B, _STOP = 0, 1, 2, 3
_FAILED, _REPORT = 3, 4


class Malformed(ValueError):
    """Bytes that are not a message of this protocol."""


@dataclass(frozen=True, slots=True)
class Head:
    """The first fields of every message.

    Attributes:
        incarnation: Counts the robot's processes, from 1.
        instance: Random number of one process, or `ANYONE`.
        k: The tick.
        run: Random number of the run, or `NO_RUN`.
    """

    incarnation: int
    instance: int
    k: int
    run: int


@dataclass(frozen=True, slots=True)
class Hello(Head):
    """The world asks which robots are there. Its k counts the ticks that have begun.

    Attributes:
        proof: The proof of k, from which the robot goes on.
        stride: Ticks that share a link of the chain.
    """

    proof: bytes
    stride: int


@dataclass(frozen=True, slots=True)
class PhaseA(Head):
    """What the robot senses at tick k.

    Attributes:
        sensed: Of the same tick.
        proof: The proof that k + 1 ticks have begun.
        digest: Of the bytes that it was decoded from.
    """

    sensed: Sensed
    proof: bytes
    digest: bytes = field(default=b"", compare=False, repr=False)


@dataclass(frozen=True, slots=True)
class PhaseB(Head):
    """The frames that reach the robot in tick k.

    Attributes:
        frames: By sender and sequence.
        proof: The proof that k + 1 ticks have begun.
        digest: Of the bytes that it was decoded from.
    """

    frames: tuple[bytes, ...]
    proof: bytes
    digest: bytes = field(default=b"", compare=False, repr=False)


@dataclass(frozen=True, slots=True)
class Stop(Head):
    """The world asks the robot to leave.

    Attributes:
        orderly: Whether the run is over; otherwise this process is not, or no longer, part of the run.
        reason: Why, in one line.
    """

    orderly: bool
    reason: str


@dataclass(frozen=True, slots=True)
class HelloReply(Head):
    """The robot reports that it is there. Its run is the one that it answers, or `NO_RUN`.

    Attributes:
        scenario: The scenario's hash, by which the world checks that both use the same one.
        protocol: Version of this protocol.
    """

    scenario: str
    protocol: int = PROTOCOL


@dataclass(frozen=True, slots=True)
class ReplyA(Head):
    """What the robot sends in tick k.

    Attributes:
        frames: Its position frame, then those of its contacts; none for a robot that stays silent.
        digest: Of the bytes that it was decoded from.
    """

    frames: tuple[bytes, ...]
    digest: bytes = field(default=b"", compare=False, repr=False)


@dataclass(frozen=True, slots=True)
class ReplyB(Head):
    """The reply of the robot's mind at tick k.

    Attributes:
        reply: The command, and diagnostics.
        digest: Of the bytes that it was decoded from.
    """

    reply: Reply
    digest: bytes = field(default=b"", compare=False, repr=False)


@dataclass(frozen=True, slots=True)
class Failed(Head):
    """The robot's mind cannot go on after tick k.

    Attributes:
        reason: Why, in one line.
    """

    reason: str


@dataclass(frozen=True, slots=True)
class Report(Head):
    """What the robot has sent and acted on since its last report, complete up to tick k.

    Attributes:
        since: The first tick for which it is complete.
        lines: By tick.
    """

    since: int
    lines: tuple[Line, ...]


ToRobot = Hello | PhaseA | PhaseB | Stop
ToWorld = HelloReply | ReplyA | ReplyB | Failed | Report


def max_to_robot(robots: int) -> int:
    """Size of the longest message to a robot, in bytes, in a fleet of ``robots``."""
    return MAX_REPLY + robots * MAX_FRAMES * (MAX_FRAME + 2)


def encode(message: ToRobot | ToWorld) -> bytes:
    """A message as bytes, a reason cut short where it is too long. It is the receiver who checks all other limits.

    Raises:
        ValueError: A phase A says what was sensed at another tick.
    """
    kind, body = _body(message)
    packed: bytes = msgpack.packb([kind, message.incarnation, message.instance, message.k, message.run, *body])
    return packed


def decode_to_robot(payload: bytes) -> ToRobot:
    """A message from the world.

    Raises:
        Malformed: The bytes are not a message to a robot. No other exception is raised, whatever the bytes.
    """
    message: ToRobot = _decode(payload, _TO_ROBOT)
    return message


def decode_to_world(payload: bytes) -> ToWorld:
    """A message from a robot.

    Raises:
        Malformed: The bytes are not a message to the world. No other exception is raised, whatever the bytes.
    """
    if len(payload) > MAX_REPLY:
        raise Malformed(f"{len(payload)} bytes, at most {MAX_REPLY} are allowed")
    message: ToWorld = _decode(payload, _TO_WORLD)
    return message


def _body(message: ToRobot | ToWorld) -> tuple[int, list[Any]]:
    kind: int
    body: list[Any]
    match message:
        case Hello():
            kind, body = _HELLO, [message.proof, message.stride]
        case HelloReply():
            kind, body = _HELLO, [message.scenario, message.protocol]
        case PhaseA():
            sensed = message.sensed
            if sensed.k != message.k:
                raise ValueError(f"a phase A of tick {message.k} cannot say what was sensed at tick {sensed.k}")
            pose = sensed.pose
            seen = [float(value) for contact in sensed.contacts for value in contact]
            where = [float(pose.x), float(pose.y), float(pose.heading)]
            kind, body = _PHASE_A, [*where, bool(sensed.bumped), seen, float(sensed.clock_s), message.proof]
        case ReplyA():
            kind, body = _PHASE_A, [list(message.frames)]
        case PhaseB():
            kind, body = _PHASE_B, [list(message.frames), message.proof]
        case ReplyB():
            reply = message.reply
            goal = None if reply.goal is None else [float(reply.goal[0]), float(reply.goal[1])]
            diagnostics = [str(reply.state), goal, float(reply.decision_ms), int(reply.rejected)]
            kind, body = _PHASE_B, [*pack_command(reply.command), *diagnostics]
        case Stop():
            kind, body = _STOP, [message.orderly, message.reason[:_MAX_REASON]]
        case Failed():
            kind, body = _FAILED, [message.reason[:_MAX_REASON]]
        case Report():
            kind, body = _REPORT, [message.since, [[line.k, *line.digests] for line in message.lines]]
    return kind, body


# --- decoding --------------------------------------------------------------------------------------------------------


def _decode(payload: bytes, kinds: Mapping[int, tuple[int, Callable[[Any], Any]]]) -> Any:
    try:
        values = msgpack.unpackb(payload, raw=False, use_list=True, ext_hook=_no_extension)
    except (ValueError, TypeError, OverflowError, RecursionError, msgpack.UnpackException) as error:
        raise Malformed(f"no msgpack ({type(error).__name__})") from None
    if type(values) is not list or len(values) < _HEAD or type(values[0]) is not int or values[0] not in kinds:
        raise Malformed("no array that begins with a known kind")
    length, build = kinds[values[0]]
    if len(values) != _HEAD + length:
        raise Malformed(f"{len(values)} values, {_HEAD + length} belong there")
    return build([*values[1:], payload])


def _no_extension(code: int, _data: bytes) -> object:
    raise ValueError(f"extension type {code}")


def _head(values: list[Any]) -> tuple[int, int, int, int]:
    incarnation, instance, k, run = values[: _HEAD - 1]
    return _whole(incarnation, _MAX_COUNT), _whole(instance, _MAX_ID), _whole(k, _MAX_COUNT), _whole(run, _MAX_ID)


def _hello(values: list[Any]) -> Hello:
    return Hello(*_head(values), _bytes(values[4], PROOF, PROOF), _whole(values[5], _MAX_COUNT, least=1))


def _hello_reply(values: list[Any]) -> HelloReply:
    return HelloReply(*_head(values), _text(values[4], _HASH), _whole(values[5], _MAX_COUNT))


def _phase_a(values: list[Any]) -> PhaseA:
    pose = Pose(_finite(values[4]), _finite(values[5]), _finite(values[6]))
    flat = values[8]
    if type(flat) is not list or len(flat) % 2 or len(flat) > 2 * MAX_CONTACTS:
        raise Malformed(f"contacts are an array of at most {MAX_CONTACTS} pairs")
    seen = [_finite(value) for value in flat]
    contacts = tuple(zip(seen[::2], seen[1::2], strict=True))
    head = _head(values)
    sensed = Sensed(head[2], pose, _flag(values[7]), contacts, _finite(values[9]))
    return PhaseA(*head, sensed, _bytes(values[10], PROOF, PROOF), digest_of(values[-1]))


def _reply_a(values: list[Any]) -> ReplyA:
    # The ether drops and counts frames that are too long, so that the result is the same without a wire.
    frames = values[4]
    if type(frames) is not list or len(frames) > MAX_FRAMES or any(type(frame) is not bytes for frame in frames):
        raise Malformed(f"frames are an array of at most {MAX_FRAMES} times bytes")
    return ReplyA(*_head(values), tuple(frames), digest_of(values[-1]))


def _phase_b(values: list[Any]) -> PhaseB:
    frames = values[4]
    if type(frames) is not list or any(type(frame) is not bytes or len(frame) > MAX_FRAME for frame in frames):
        raise Malformed(f"frames are an array of at most {MAX_FRAME} bytes each")
    return PhaseB(*_head(values), tuple(frames), _bytes(values[5], PROOF, PROOF), digest_of(values[-1]))


def _reply_b(values: list[Any]) -> ReplyB:
    goal = values[8]
    if goal is not None and (type(goal) is not list or len(goal) != 2):
        raise Malformed("a goal is a pair or nothing")
    reply = Reply(
        command=_command_in(values[4], _real(values[5]), _real(values[6])),
        state=_text(values[7], MAX_STATE),
        goal=None if goal is None else (_finite(goal[0]), _finite(goal[1])),
        decision_ms=_finite(values[9]),
        rejected=_whole(values[10], _MAX_ID),
    )
    return ReplyB(*_head(values), reply, digest_of(values[-1]))


def _command_in(model: object, first: float, second: float) -> Command:
    # The world refuses commands that are not finite, so that the result is the same without a wire.
    try:
        return unpack_command(_whole(model, _MAX_COUNT), first, second)
    except ValueError:
        raise Malformed("unknown kind of command") from None


def _report(values: list[Any]) -> Report:
    lines = values[5]
    if type(lines) is not list or len(lines) > MAX_LINES:
        raise Malformed(f"lines are an array of at most {MAX_LINES}")
    return Report(*_head(values), _whole(values[4], _MAX_COUNT), tuple(map(_line, lines)))


def _line(values: object) -> Line:
    if type(values) is not list or len(values) != 1 + PLACES:
        raise Malformed(f"a line is an array of {1 + PLACES}")
    k, *digests = values
    if any(type(one) is not bytes or len(one) > MAX_DIGESTS * DIGEST for one in digests):
        raise Malformed(f"no digests of at most {MAX_DIGESTS * DIGEST} bytes")
    return Line(_whole(k, _MAX_COUNT), tuple(digests))


def _whole(value: object, most: int, least: int = 0) -> int:
    if type(value) is not int or not least <= value <= most:
        raise Malformed(f"no whole number from {least} to {most}")
    return value


def _bytes(value: object, least: int, most: int) -> bytes:
    if type(value) is not bytes or not least <= len(value) <= most:
        raise Malformed(f"no {least} to {most} bytes")
    return value


def _real(value: object) -> float:
    if type(value) is not float:
        raise Malformed("no float")
    return value


def _finite(value: object) -> float:
    number = _real(value)
    if not math.isfinite(number):
        raise Malformed("no finite float")
    return number


def _flag(value: object) -> bool:
    if type(value) is not bool:
        raise Malformed("neither true nor false")
    return value


def _text(value: object, most: int) -> str:
    if type(value) is not str or len(value) > most or not value.isprintable():
        raise Malformed(f"no printable text of at most {most} characters")
    return value


_TO_ROBOT: Mapping[int, tuple[int, Callable[[Any], ToRobot]]] = {
    _HELLO: (2, _hello),
    _PHASE_A: (7, _phase_a),
    _PHASE_B: (2, _phase_b),
    _STOP: (2, lambda values: Stop(*_head(values), _flag(values[4]), _text(values[5], _MAX_REASON))),
}
_TO_WORLD: Mapping[int, tuple[int, Callable[[Any], ToWorld]]] = {
    _HELLO: (2, _hello_reply),
    _PHASE_A: (1, _reply_a),
    _PHASE_B: (7, _reply_b),
    _FAILED: (1, lambda values: Failed(*_head(values), _text(values[4], _MAX_REASON))),
    _REPORT: (2, _report),
}
