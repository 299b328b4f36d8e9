"""Checks of a policy's answer, and the account of a policy that has failed."""

from __future__ import annotations

from collections.abc import Container, Mapping, Sequence
from dataclasses import replace
from pathlib import PurePath
from typing import Any

import numpy as np

from agent.ports import Bearing, Intent, Place, PolicyFailed, Stay, Steer
from patrol.pose import Command, Pose, facing_of
from patrol.radio.peers import Peer
from runtime.messages.phases import MAX_STATE
from runtime.process.deadline import Late

MAX_FAILURE = 300
"""Characters of the longest account of a failure."""

LARGEST = 1e9
"""Numbers beyond it mean nothing in metres and radians."""

PAIR = "pair of numbers"

PASSED_ON = (Late, KeyboardInterrupt)
"""Exceptions that interrupt a policy from outside, and so are no failure to catch: its time limit and Ctrl-C."""

_INTENTS = Bearing, Place, Stay, Steer
_MAPPINGS = dict, Mapping


def raised_at(cause: BaseException | None) -> str:
    """Return the innermost line of code of an error, as `` (file.py:27)``; empty without an error."""
    last = None if cause is None else cause.__traceback__
    while last is not None and last.tb_next is not None:
        last = last.tb_next
    return "" if last is None else f" ({PurePath(last.tb_frame.f_code.co_filename).name}:{last.tb_lineno})"


def failure_of(error: BaseException) -> str:
    """Describe an exception of foreign code by its type and message, or by its type alone.

    The message is left out where it cannot be read.
    """
    try:
        return f"{type(error).__name__}: {error}"
    except PASSED_ON:
        raise
    except BaseException:  # noqa: BLE001 - the error's own code is foreign too
        return type(error).__name__


def policy_failure(k: int, failed: BaseException) -> str:
    """Say in one line that a robot's policy has failed at tick k; the same in a process and among other minds."""
    line = " ".join(str(failed).split()) + raised_at(failed.__cause__)
    printable = "".join(letter if letter.isprintable() else "?" for letter in line)
    return f"its policy failed at tick {k}: {printable}"[:MAX_FAILURE]


def checked(intent: object, robots: Container[int] = ()) -> Intent:
    """Return a policy's intent with numbers that a body can use; PolicyFailed if it is no such intent.

    Numpy's numbers become Python's, so that all processes compute alike. A policy may say where ``robots`` are, given
    by number.
    """
    if not isinstance(intent, _INTENTS):
        raise PolicyFailed(f"returned {type(intent).__name__}; return Bearing, Place, Stay or Steer")
    if not isinstance(intent.state, str) or not 0 < len(intent.state) <= MAX_STATE or not intent.state.isprintable():
        raise PolicyFailed(f"returned a state that is no printable word of at most {MAX_STATE} characters")
    figures = intent.figures
    if not isinstance(figures, _MAPPINGS) or not all(isinstance(name, str) for name in figures):
        raise PolicyFailed("returned figures that are no mapping from names to numbers")
    if isinstance(intent, Place) and intent.others is not None:
        # Read once: what is no dict might hold others when the body reads it.
        others = dict(intent.others) if isinstance(intent.others, _MAPPINGS) else None
        if others is None or not all(_is_peer(*other, robots) for other in others.items()):
            remedy = "give a mapping from numbers of the fleet's robots to Peer"
            raise PolicyFailed(f"returned Place with others = {intent.others!r}; {remedy}")
        intent = intent if type(intent.others) is dict else replace(intent, others=others)
    if _is_ready(intent):
        return intent
    kind, plain = type(intent).__name__, _plain_numbers(intent)
    for name, value in _intent_numbers(plain):
        if isinstance(value, bool) or not isinstance(value, int | float) or not -LARGEST <= value <= LARGEST:
            raise PolicyFailed(f"returned {kind} with {name} = {value!r}; give a number from -1e9 to 1e9")
    return plain


def _is_ready(intent: Intent) -> bool:
    """Return True if all numbers are Python's floats in range, alone or in pairs: the usual case, which is cheap."""
    if type(intent) is Bearing:
        several = type(intent.bearings) is tuple and all(map(_is_float, intent.bearings))
        return several and _is_spot(intent.near) and _is_spot(intent.bend) and _is_turn(intent.wander)
    if type(intent) is Place:
        spots = _is_spot(intent.bend) and _is_spot(intent.lean)
        numbers = (intent.x, intent.y) if intent.step is None else (intent.x, intent.y, *_numbers_of(intent.step))
        return all(map(_is_float, numbers)) and spots and _is_turn(intent.wander) and _is_turn(intent.heading)
    return type(intent) is Stay


def _is_float(value: object) -> bool:
    return type(value) is float and -LARGEST <= value <= LARGEST


def _is_peer(number: object, peer: object, robots: Container[int]) -> bool:
    if type(number) is not int or number not in robots or type(peer) is not Peer or type(peer.pose) is not Pose:
        return False
    pose, ticks = peer.pose, (peer.sequence, peer.tick)
    return all(map(_is_float, (pose.x, pose.y, pose.heading))) and all(
        type(k) is int and abs(k) <= LARGEST for k in ticks
    )


def _is_turn(value: object) -> bool:
    return value is None or _is_float(value)


def _is_spot(value: object) -> bool:
    return value is None or (type(value) is tuple and len(value) == 2 and _is_float(value[0]) and _is_float(value[1]))


def _plain_numbers(intent: Intent) -> Intent:
    """Replace numpy's numbers by Python's, and any other sequence of bearings by a tuple."""
    fields = {name: getattr(intent, name) for name in intent.__match_args__ if name not in ("state", "figures")}
    plain = {name: _plain_value(value) for name, value in fields.items()}
    changed = {name: value for name, value in plain.items() if value is not fields[name]}
    return replace(intent, **changed) if changed else intent


def _plain_value(value: Any) -> Any:
    if isinstance(value, np.generic):
        return value.item()
    if isinstance(value, np.ndarray):
        return tuple(value.tolist())
    if isinstance(value, Sequence) and not isinstance(value, str):
        # Read once: what is no tuple itself might hold other numbers when the body reads it.
        read = value if type(value) is tuple else tuple(value)
        return tuple(map(_plain_value, read)) if any(isinstance(item, np.generic) for item in read) else read
    if isinstance(value, Command) and any(isinstance(number, np.generic) for number in _numbers_of(value)):
        return type(value)(*(_plain_value(number) for number in _numbers_of(value)))
    return value


def _intent_numbers(intent: Intent) -> list[tuple[str, object]]:
    """List every number of an intent that a body computes with, by name."""
    match intent:
        case Bearing(bearings, near, bend, wander):
            alone = [] if wander is None else [("wander", wander)]
            return [*_name_values("bearings", bearings), *alone, *_name_spot("near", near), *_name_spot("bend", bend)]
        case Place(x, y, bend, lean, wander):
            turns = (("wander", wander), ("heading", intent.heading))
            alone = [(name, turn) for name, turn in turns if turn is not None]
            numbers = () if intent.step is None else _numbers_of(intent.step)
            steps = [("step", number) for number in numbers]
            return [("x", x), ("y", y), *_name_spot("bend", bend), *_name_spot("lean", lean), *alone, *steps]
        case Stay():
            return []
        case Steer(command):
            return [("command", number) for number in _numbers_of(command, "Steer", "command")]


def _numbers_of(command: object, kind: str = "Place", name: str = "step") -> tuple[float, ...]:
    if not isinstance(command, Command):
        raise PolicyFailed(f"returned {kind} with {name} = {command!r}, which is no Velocity, Drive or Twist")
    facing = facing_of(command)
    return command.numbers if facing is None else (*command.numbers, facing)


def _name_values(name: str, values: object, kind: str = "tuple of numbers") -> list[tuple[str, object]]:
    if isinstance(values, str) or not isinstance(values, Sequence) or (kind == PAIR and len(values) != 2):
        raise PolicyFailed(f"returned an intent with {name} = {values!r}, which is no {kind}")
    return [(name, value) for value in values]


def _name_spot(name: str, spot: object) -> list[tuple[str, object]]:
    return [] if spot is None else _name_values(name, spot, PAIR)
