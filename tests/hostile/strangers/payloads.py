"""What a stranger sends: noise, changed copies of genuine messages, and well-formed messages that lie."""

import hashlib
import math
import struct
from collections.abc import Sequence

import msgpack

from patrol.exchange import Reply, Sensed
from patrol.journal import Status
from patrol.pose import Pose, Velocity
from patrol.random import Draws
from runtime.messages.feed import TICKS, Batch, batch_bytes
from runtime.messages.phases import ANYONE, Failed, HelloReply, PhaseA, PhaseB, ReplyA, ReplyB, Stop, encode
from runtime.messages.telemetry import EVENTS, METRICS, Metrics, Notice, RobotView, pack_view
from runtime.security.keys import FleetKeys

_EXTREMES = (
    *(b"\x00" * 8, b"\xff" * 8, b"\xcf" + b"\xff" * 8, b"\x91" * 400, b"\xc7\x01\x05\x00"),
    *(b"\xdd\xff\xff\xff\xff", b"\xdf\xff\xff\xff\xff", b"\xc6\x7f\xff\xff\xff"),
    *(b"\xcb" + struct.pack(">d", number) for number in (math.nan, math.inf)),
)
"""Hard pieces of msgpack: endless arrays, maps and bytes, no numbers, deep nesting, extensions."""
_CLEAR = "\x1b[2J"
_LEAPS = (0, 1, 7, 10**6, 2**31 - 1)
_MANY = 2000


def noise(dice: Draws, most: int = 2048) -> bytes:
    """Random bytes."""
    what = dice.whole(0, 1 << 52).to_bytes(8, "little")
    return hashlib.shake_128(what).digest(dice.whole(0, most))


def changed(dice: Draws, payload: bytes) -> bytes:
    """A changed copy of a message."""
    data = bytearray(payload)
    for _ in range(dice.whole(1, 3)):
        at = dice.whole(0, max(len(data) - 1, 0))
        match dice.whole(0, 4):
            case 0 if data:
                data[at] ^= 1 << dice.whole(0, 7)
            case 1:
                del data[at:]
            case 2:
                data[at:at] = noise(dice, 64)
            case 3:
                piece = dice.choice(*_EXTREMES)
                data[at : at + len(piece)] = piece
            case _:
                data += bytes(data)
    return bytes(data)


def all_keys(keys: FleetKeys, robots: Sequence[str]) -> list[str]:
    """Every key of a fleet that anybody publishes under or answers."""
    own = [make(name) for name in robots for make in (keys.tick, keys.reply, keys.position, keys.telemetry)]
    truths = [keys.truth(topic) for topic in (METRICS, EVENTS, TICKS, "fog", "anything")]
    return [*own, *truths, *(keys.control(what) for what in ("ask", "challenge"))]


def forged(dice: Draws, keys: FleetKeys, robots: Sequence[str], newest: PhaseA | None) -> tuple[str, bytes]:
    """A message that a decoder takes, with something false in it, under its key; its run is that of a phase A heard."""
    name = dice.choice(*robots)
    head = (1, ANYONE, 0, 1) if newest is None else (newest.incarnation, newest.instance, newest.k, newest.run)
    incarnation, instance, k, run = head
    k = min(k + dice.choice(*_LEAPS), 2**31 - 1)
    pose = Pose(dice.between(-50.0, 50.0), dice.between(-50.0, 50.0), 0.0)
    frame = noise(dice, 60)
    drive = Velocity(dice.between(-1.0, 1.0), dice.between(-1.0, 1.0))
    sensed = Sensed(k, pose, False, (), k * 0.5)
    stop = Stop(incarnation, dice.choice(ANYONE, instance), k, run, dice.choice(True, False), "go home")
    seat = HelloReply(dice.whole(1, 3), dice.whole(0, 2**62), k, dice.choice(0, run), dice.choice("a", "d") * 64)
    rows = tuple(RobotView(f"{_CLEAR}{robot}", int(Status.DEAD), "", math.nan, 1e308, 0.0) for robot in robots)
    metrics = Metrics(dice.choice(0, 1), 1, 0.0, 0.0, 0.0, 0.0, 2.0, 5e-324, rows)
    records = (msgpack.packb([1, 2**62, {}]), b"\x80" * dice.whole(1, _MANY))
    batch = Batch(dice.whole(0, 2**52), records, True, math.inf)
    to_robot = (PhaseA(incarnation, instance, k, run, sensed), PhaseB(incarnation, instance, k, run, (frame,)), stop)
    to_world = (seat, ReplyA(incarnation, instance, k, run, (frame,)), forged_command(ReplyA(*head, ()), drive))
    return dice.choice(
        *((keys.tick(name), encode(message)) for message in to_robot),
        *((keys.reply(name), encode(message)) for message in to_world),
        (keys.truth(METRICS), pack_view(metrics)),
        (keys.truth(EVENTS), pack_view(Notice(2**62, "lost", name, f"{_CLEAR}{name} is lost"))),
        (keys.truth(TICKS), batch_bytes(batch)),
        (keys.position(name), frame),
    )


def forged_command(head: ReplyA | PhaseA | PhaseB, drive: Velocity) -> ReplyB:
    """A command in the name of the process that a message belongs to."""
    reply = Reply(drive, "patrolling", None, 1.0, 0)
    return ReplyB(head.incarnation, head.instance, head.k, head.run, reply)


def forged_farewell(newest: PhaseA) -> Failed:
    """A robot's message that its mind cannot go on, after which it is lost."""
    return Failed(newest.incarnation, newest.instance, newest.k, newest.run, "I cannot go on")
