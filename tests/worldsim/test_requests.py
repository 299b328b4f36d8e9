"""Requests under the key for controls: those of operators come through to the world, of others none."""

import os
from collections import Counter, deque
from collections.abc import Iterator, Sequence
from typing import Any

import pytest

from patrol.errors import BadInput
from patrol.scenario.controls import Answer, Pause
from runtime.net.mailbox import Question
from runtime.security.control_auth import ASK, CHALLENGE, ControlClient, ControlGate, Unanswered
from runtime.security.keys import FleetKeys
from worldsim.controls import ControlMailbox, answer_challenge

# Not the product's own, so that a wrong one there is noticed.
MOST_AT_ONCE = 64

KEYS = FleetKeys("f")
TOKEN = "a token that is long enough"


class Door:
    """A world's mailbox for controls, and operators who ask it."""

    def __init__(self) -> None:
        self.refused: Counter[str] = Counter()
        self.waiting: deque[Question] = deque()
        self.gate = ControlGate("f", TOKEN, 9, b"s" * 16, lambda: 5.0)
        self.requests = ControlMailbox(self, self.gate)
        self.strangers: list[bytes] = []

    def get(self, timeout_s: float = 0.0) -> tuple[str, Question] | None:
        del timeout_s
        return (KEYS.control(ASK), self.waiting.popleft()) if self.waiting else None

    def answers_until(
        self, keys: Sequence[str], payload: bytes, longest: int, wait_s: float
    ) -> Iterator[tuple[str, bytes]]:
        assert wait_s > 0.0
        (key,) = keys
        said: list[bytes] = []
        if key == KEYS.control(CHALLENGE):
            answer_challenge(self.gate, Question(payload, said.append), self.refused)
        else:
            self.waiting += [Question(stranger, self.strangers.append) for stranger in self.strangers]
            self.waiting += [Question(payload, said.append) for _ in range(2)]
            for _ in range(5):
                if (request := self.requests.get(0.1)) is not None:
                    refusal = str(request.control) if isinstance(request.control, BadInput) else ""
                    self.got = request.control
                    request.answer(Answer(not refusal, refusal or "paused"))
        assert all(len(one) <= longest for one in said)
        yield from ((key, one) for one in said)

    def ask(self, token: str = TOKEN, **control: object) -> Answer:
        return ControlClient(self, KEYS, token, lambda: 1.0, os.urandom).ask(control, 1.0).answer


def test_a_request_is_taken_once_and_answered_each_time() -> None:
    door = Door()
    assert door.ask(do="pause") == Answer(True, "paused")
    assert isinstance(door.got, Pause)
    assert not door.refused


@pytest.mark.parametrize(
    ("control", "says"),
    [({"do": "destroy"}, "known are"), ({"do": "fault", "fault": {"kind": "\ud800"}}, "holds half of a character")],
    ids=["unknown", "no text"],
)
def test_what_cannot_be_done_is_refused_with_its_reason(control: dict[str, Any], says: str) -> None:
    answer = Door().ask(**control)
    assert not answer.done
    assert says in answer.text


def test_strangers_get_no_answer_and_are_counted() -> None:
    door = Door()
    with pytest.raises(Unanswered):
        door.ask(token="another token", do="pause")
    door.strangers = [b"", b"{", b'{"token": "x", "control": {"do": "go"}}', bytes(500)]
    kept = list(door.strangers)
    assert door.ask(do="pause").done
    assert door.strangers == kept
    assert door.refused == {"token": 4}


def test_a_flood_of_strangers_is_read_a_part_at_a_time() -> None:
    door = Door()
    door.waiting += [Question(b"junk", door.strangers.append) for _ in range(3 * MOST_AT_ONCE)]
    assert door.requests.get(0.0) is None
    assert door.refused == {"token": MOST_AT_ONCE}
    assert len(door.waiting) == 2 * MOST_AT_ONCE


def test_a_challenge_of_the_wrong_length_is_counted_and_not_answered() -> None:
    door = Door()
    said: list[bytes] = []
    answer_challenge(door.gate, Question(b"short", said.append), door.refused)
    assert (said, door.refused) == ([], {"malformed": 1})
