"""Operators and worlds that prove to each other that they know a token, and what those without it can do."""

import hmac
import json
import struct
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from itertools import count
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from patrol.scenario.controls import Answer
from runtime.security.control_auth import (
    ASK,
    CHALLENGE,
    LIFETIME_S,
    MAX_CONTROL,
    MAX_OBEYED,
    NONCE,
    ControlClient,
    ControlGate,
    Operated,
    RequestRefused,
    Unanswered,
)
from runtime.security.keys import FleetKeys

TOKEN = "a token that is long enough"
KEYS = FleetKeys("f")
RUN = 9
PAUSE = {"do": "pause"}


@dataclass
class Wire:
    """A world behind its gate, and whoever else answers."""

    gate: ControlGate = None  # type: ignore[assignment]
    time: float = 100.0
    obeyed: list[Any] = field(default_factory=list)
    answer: Answer = field(default_factory=lambda: Answer(True, "done"))
    sent: list[tuple[str, bytes]] = field(default_factory=list)
    before: Callable[[str, bytes], list[bytes]] = lambda _key, _payload: []
    mute: bool = False
    numbers: Iterator[int] = field(default_factory=lambda: count(1))

    def __post_init__(self) -> None:
        self.gate = gate_of(self)

    def random(self, size: int) -> bytes:
        return next(self.numbers).to_bytes(size, "big")

    def client(self, token: str = TOKEN) -> ControlClient:
        return ControlClient(self, KEYS, token, lambda: self.time, self.random)

    def answers_until(
        self, keys: Sequence[str], payload: bytes, longest: int, wait_s: float
    ) -> Iterator[tuple[str, bytes]]:
        assert wait_s > 0.0
        (key,) = keys
        self.sent.append((key, payload))
        yield from ((key, given) for given in self.before(key, payload) if len(given) <= longest)
        if not self.mute and (given := self.world(key, payload)) is not None:
            yield key, given

    def world(self, key: str, payload: bytes) -> bytes | None:
        try:
            if key == KEYS.control(CHALLENGE):
                return self.gate.challenge(payload)
            admitted = self.gate.open(payload)
        except RequestRefused:
            return None
        if admitted.answered is not None:
            return admitted.answered
        self.obeyed.append(admitted.control)
        return admitted.seal(self.answer)

    def request(self, control: object = None) -> bytes:
        """A request that the world has not got."""
        taken, self.mute = self.before, False

        def stop(key: str, payload: bytes) -> list[bytes]:
            self.mute = key == KEYS.control(ASK)
            return taken(key, payload)

        self.before = stop
        with pytest.raises(Unanswered):
            self.client().ask(PAUSE if control is None else control, 1.0)  # type: ignore[arg-type]
        self.before, self.mute = taken, False
        return self.sent[-1][1]


def gate_of(wire: Wire, fleet: str = "f", token: str = TOKEN, run: int = RUN, secret: bytes = b"s" * 16) -> ControlGate:
    return ControlGate(fleet, token, run, secret, lambda: wire.time)


def mac_of(kind: bytes, *parts: bytes) -> bytes:
    """Prove by hand that somebody knows the token."""
    all_parts = (b"fogwatch control", kind, b"f", struct.pack("<Q", RUN), *parts)
    message = b"".join(struct.pack("<I", len(part)) + part for part in all_parts)
    return hmac.digest(TOKEN.encode(), message, "sha256")


def test_a_control_reaches_the_world_and_its_answer_comes_back() -> None:
    wire = Wire(answer=Answer(False, "no such fault"))
    assert wire.client().ask({"do": "heal", "id": "f1"}, 1.0) == Operated(Answer(False, "no such fault"))
    assert wire.obeyed == [{"do": "heal", "id": "f1"}]


def test_neither_the_token_nor_anything_that_repeats_is_sent() -> None:
    wire = Wire()
    for _ in range(2):
        wire.client().ask(PAUSE, 1.0)
    assert len({payload for _, payload in wire.sent}) == 4
    assert not any(TOKEN.encode() in payload for _, payload in wire.sent)
    assert TOKEN not in repr(wire.client())


def test_a_request_that_is_repeated_gets_the_same_answer_and_is_obeyed_once() -> None:
    """A listener may send it again, or an operator whose answer was lost."""
    wire = Wire()
    request = wire.request()
    first = wire.world(KEYS.control(ASK), request)
    wire.answer = Answer(True, "a second time")
    assert wire.world(KEYS.control(ASK), request) == first
    assert wire.obeyed == [PAUSE]


@pytest.mark.parametrize("place", range(0, 32 + 8 + NONCE + 24 + 15, 3))
def test_a_request_that_was_altered_is_refused(place: int) -> None:
    wire = Wire()
    request = bytearray(wire.request())
    request[place] ^= 1
    with pytest.raises(RequestRefused):
        wire.gate.open(bytes(request))


@pytest.mark.parametrize("other", [{"run": RUN + 1}, {"fleet": "g"}, {"token": "another token"}, {"secret": b"t" * 16}])
def test_a_request_counts_for_one_run_of_one_fleet(other: dict[str, Any]) -> None:
    wire = Wire()
    request = wire.request()
    with pytest.raises(RequestRefused):
        gate_of(wire, **other).open(request)


def test_a_request_that_was_held_back_is_refused() -> None:
    wire = Wire()
    request = wire.request()
    wire.time += LIFETIME_S + 0.1
    with pytest.raises(RequestRefused, match="too old"):
        wire.gate.open(request)


@given(st.binary(max_size=200) | st.builds(bytes, st.integers(MAX_CONTROL + 100, MAX_CONTROL + 110)))
def test_bytes_are_refused(payload: bytes) -> None:
    wire = Wire()
    with pytest.raises(RequestRefused):
        wire.gate.open(payload)


@pytest.mark.parametrize("size", [0, NONCE - 1, NONCE + 1])
def test_a_ticket_needs_a_nonce(size: int) -> None:
    with pytest.raises(RequestRefused):
        Wire().gate.challenge(bytes(size))


def test_tickets_take_no_memory_and_obeyed_requests_a_bounded_one() -> None:
    wire = Wire()
    request = wire.request()
    for number in range(5000):
        wire.gate.challenge(struct.pack("<QQ", number, 1))
    assert wire.world(KEYS.control(ASK), request) is not None  # none of them took its place
    for _ in range(MAX_OBEYED - 1):
        wire.client().ask(PAUSE, 1.0)
    with pytest.raises(Unanswered):
        wire.client().ask(PAUSE, 1.0)
    assert wire.world(KEYS.control(ASK), request) is not None  # what was obeyed is still known
    wire.time += LIFETIME_S + 1.0
    assert wire.client().ask(PAUSE, 1.0).answer.done


def test_an_operator_with_another_token_and_a_silent_world_are_told() -> None:
    wire = Wire()
    with pytest.raises(Unanswered, match="either the token is not this fleet's, or somebody answers in the world's"):
        wire.client("another token").ask(PAUSE, 1.0)
    assert [key for key, _ in wire.sent] == [KEYS.control(CHALLENGE)]
    with pytest.raises(Unanswered, match="the world of fleet f did not answer within 3 s"):
        Wire(mute=True).client().ask(PAUSE, 3.0)


FORGED = [
    b"",
    b"{",
    b"[" * 5000,
    bytes(64),
    json.dumps({"done": True, "text": "paused"}).encode(),
    bytes(32) + json.dumps({"done": True, "text": "paused"}).encode(),
    bytes(32) + b"[" * 5000,
    bytes(1 << 20),
]


@pytest.mark.parametrize("forged", FORGED)
def test_a_forged_answer_is_passed_over_and_mentioned(forged: bytes) -> None:
    wire = Wire(before=lambda _key, _payload: [forged])
    operated = wire.client().ask(PAUSE, 1.0)
    assert operated.answer == Answer(True, "done")
    assert ("does not know the token" in operated.warning) == bool(operated.strangers)
    assert operated.strangers == (2 if len(forged) < 10_000 else 0)  # the link drops what is too long


@pytest.mark.parametrize("forged", FORGED[:-1])
def test_a_forged_answer_alone_is_not_believed(forged: bytes) -> None:
    wire = Wire(before=lambda _key, _payload: [forged], mute=True)
    with pytest.raises(Unanswered, match="somebody answered who does not know the token"):
        wire.client().ask(PAUSE, 1.0)


def test_answers_of_other_exchanges_are_not_believed() -> None:
    """Somebody records everything, and answers with it later, or with the world's answer to what he has asked."""
    wire = Wire()
    said: dict[str, list[bytes]] = {}
    for key, payload in ((KEYS.control(CHALLENGE), wire.random(NONCE)), (KEYS.control(ASK), wire.request())):
        if (given := wire.world(key, payload)) is not None:
            said.setdefault(key, []).append(given)
    assert set(said) == {KEYS.control(CHALLENGE), KEYS.control(ASK)}
    wire.before = lambda key, _payload: said[key]
    wire.answer = Answer(False, "no")
    operated = wire.client().ask(PAUSE, 1.0)
    assert operated == Operated(Answer(False, "no"), 2)


@pytest.mark.parametrize(
    "says",
    [[], {}, {"done": 1, "text": "x"}, {"done": True}, {"done": True, "text": 5}, {"done": True, "text": None}, 7],
)
def test_an_answer_of_the_wrong_type_is_no_answer(says: object) -> None:
    """Even of somebody who knows the token: another version, say."""
    wire = Wire()
    text = json.dumps(says).encode()

    def world(key: str, payload: bytes) -> list[bytes]:
        if key != KEYS.control(ASK):
            return []
        nonce, ticket, control = payload[40 : 40 + NONCE], payload[40 + NONCE : 64 + NONCE], payload[64 + NONCE :]
        wire.mute = True
        return [mac_of(b"answer", nonce, ticket, control, text) + text]

    wire.before = world
    with pytest.raises(Unanswered):
        wire.client().ask(PAUSE, 1.0)


def test_what_an_answer_says_cannot_move_a_cursor() -> None:
    wire = Wire(answer=Answer(True, "\x1b[2Jdone\u202e" + "x" * 5000))
    text = wire.client().ask(PAUSE, 1.0).answer.text
    assert text.startswith(r"\x1b[2Jdone\u202exx")
    assert text.isprintable()
    assert len(text) < 2100


def test_half_of_a_surrogate_pair_is_a_token_like_any_other() -> None:
    wire = Wire()
    wire.gate = gate_of(wire, token="\ud800 and more")
    assert wire.client("\ud800 and more").ask(PAUSE, 1.0).answer.done


def test_a_control_that_is_no_json_is_none() -> None:
    """Only somebody who knows the token can send it."""
    wire = Wire()
    request = wire.request()
    nonce, ticket = request[40 : 40 + NONCE], request[40 + NONCE : 64 + NONCE]
    control = b"[" * 30_000
    mac = mac_of(b"request", nonce, ticket, control)
    assert wire.gate.open(mac + request[32 : 64 + NONCE] + control).control is None
