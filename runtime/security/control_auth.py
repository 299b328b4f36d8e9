"""Proofs between an operator and a world that both know the fleet's token, which never travels.

    operator to world    nonce                                     under `CHALLENGE`
    world to operator    MAC, run, ticket
    operator to world    MAC, run, nonce, ticket, control          under `ASK`
    world to operator    MAC, answer

Each MAC is HMAC-SHA256 (RFC 2104) with the token as key, over everything that the message and the exchange so far say:
the fleet, the run, the operator's nonce, the world's ticket, the control, the answer. So
reading along gives nothing that is of use in another exchange, and an answer without the token is detected.

A ticket is the time at which it was made, and a MAC of it and the nonce under a key that the world alone has. The
world stores nothing for it, so asking for tickets takes none of its memory. It stores the nonces of requests that it
has obeyed, which only holders of the token can make it do, with the answers. A request that comes twice gets the
answer of the first time and is not carried out again.
"""

from __future__ import annotations

import hashlib
import hmac
import json
import struct
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Protocol

from patrol.errors import Unusable, printable
from patrol.scenario.controls import Answer
from runtime.security.keys import FleetKeys

ASK = "ask"
CHALLENGE = "challenge"
"""The last parts of the keys for controls and for tickets (`runtime.security.keys.FleetKeys.control`)."""

NONCE = 16
"""Bytes of an operator's nonce."""
MAX_CONTROL = 1 << 16
"""Bytes of the longest control."""
LIFETIME_S = 600.0
"""Wall time for which a ticket is good, s; a slow tick may hold up a request for long."""
MAX_OBEYED = 1024
"""Requests within `LIFETIME_S` beyond which a world takes no more."""

_MAC = 32
_TICKET = struct.Struct("<Q16s")
_CHALLENGED = struct.Struct(f"<{_MAC}sQ{_TICKET.size}s")
_REQUEST = struct.Struct(f"<{_MAC}sQ{NONCE}s{_TICKET.size}s")
_MAX_TEXT = 2000
MAX_REQUEST = _REQUEST.size + MAX_CONTROL
"""Bytes of the longest request."""
MAX_ANSWER = _MAC + 6 * _MAX_TEXT + 64
"""Bytes of the longest answer, to a challenge or a request."""


class RequestRefused(Unusable, ValueError):
    """A request without a valid, fresh MAC."""


class Unanswered(Exception):
    """No answer had a valid MAC; one line says what came instead."""


# --- the world -------------------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class Admitted:
    """A request with a valid MAC."""

    control: Any  # anything that JSON can say; None where the request is no JSON
    seal: Callable[[Answer], bytes]  # makes of the answer the bytes to send; to be called once
    answered: bytes | None = None  # the answer's bytes when this request came before; None where it is new


@dataclass(frozen=True, slots=True)
class _Obeyed:
    until: float
    mac: bytes
    answer: bytes


class ControlGate:
    """The world's side: gives tickets, and lets through what carries one and a right MAC."""

    def __init__(self, fleet: str, token: str, run: int, secret: bytes, now: Callable[[], float]) -> None:
        """Open a gate for one run.

        `secret` holds at least 16 random bytes that no other process has. `now` is a monotonic clock in s, never below
        0.
        """
        self._fleet = fleet
        self._token = token
        self._run = run
        self._secret = secret
        self._now = now
        self._obeyed: dict[bytes, _Obeyed] = {}

    def challenge(self, nonce: bytes) -> bytes:
        """Return the answer to an operator's nonce: a ticket, and proof that the world knows the token.

        Any thread may call this.
        """
        if len(nonce) != NONCE:
            raise RequestRefused(f"a nonce has {NONCE} bytes")
        ticket = self._make_ticket(int(self._now() * 1000.0), nonce)
        mac = _compute_mac(self._token, b"challenge", self._fleet, self._run, nonce, ticket)
        return _CHALLENGED.pack(mac, self._run, ticket)

    def open(self, payload: bytes) -> Admitted:
        """Let a request through; raise `RequestRefused` for any other bytes.

        Its sender must know the token, its run and ticket must be ours, its ticket must not be too old, and its nonce
        must not have been used for something else. The same request counts as new until its answer is sealed.
        """
        if not _REQUEST.size <= len(payload) <= MAX_REQUEST:
            raise RequestRefused("no request")
        mac, run, nonce, ticket = _REQUEST.unpack_from(payload)
        control = payload[_REQUEST.size :]
        if run != self._run:
            raise RequestRefused("the request is of another run")
        if not hmac.compare_digest(
            mac, _compute_mac(self._token, b"request", self._fleet, run, nonce, ticket, control)
        ):
            raise RequestRefused("the request's sender does not know the token")
        # The ticket says when it was made, and its tag shows below that this world has said so.
        made_ms = _TICKET.unpack(ticket)[0]
        until = made_ms / 1000.0 + LIFETIME_S
        if not hmac.compare_digest(ticket, self._make_ticket(made_ms, nonce)) or self._now() > until:
            raise RequestRefused("the request's ticket is not ours or too old")
        # Only a request whose MAC is right gets here, so strangers cannot fill the memory.
        before = self._obeyed.get(nonce)
        # The same nonce with the same MAC is the same request, sent again.
        if before is not None and before.mac != mac:
            raise RequestRefused("the request's nonce was used before")
        if before is None:
            self._make_room()

        def seal(answer: Answer) -> bytes:
            # Cut, so that the answer stays below `MAX_ANSWER` whatever it says.
            text = json.dumps({"done": answer.done, "text": answer.text[:_MAX_TEXT]}).encode()
            sealed = _compute_mac(self._token, b"answer", self._fleet, run, nonce, ticket, control, text) + text
            self._obeyed[nonce] = _Obeyed(until, mac, sealed)
            return sealed

        return Admitted(_parse_control(control), seal, None if before is None else before.answer)

    def _make_ticket(self, made_ms: int, nonce: bytes) -> bytes:
        tag = hashlib.blake2b(struct.pack("<Q", made_ms) + nonce, key=self._secret, digest_size=16).digest()
        return _TICKET.pack(made_ms, tag)

    def _make_room(self) -> None:
        if len(self._obeyed) >= MAX_OBEYED:
            now = self._now()
            self._obeyed = {nonce: obeyed for nonce, obeyed in self._obeyed.items() if obeyed.until >= now}
        if len(self._obeyed) >= MAX_OBEYED:
            raise RequestRefused(f"{MAX_OBEYED} requests within {LIFETIME_S:g} s")


def _parse_control(control: bytes) -> Any:
    try:
        return json.loads(control)
    except (ValueError, RecursionError):
        return None


# --- the operator ----------------------------------------------------------------------------------------------------


class Asks(Protocol):
    """A link that sends a question to all that may answer it (`runtime.net.link.Link`)."""

    def answers_until(
        self, keys: Sequence[str], payload: bytes, longest: int, wait_s: float
    ) -> Iterable[tuple[str, bytes]]:
        """Give all answers, as they come; ask again while there is none."""
        ...


@dataclass(slots=True)
class Operated:
    """The outcome of a control."""

    answer: Answer
    strangers: int = 0  # answers without a valid MAC that came before it

    @property
    def warning(self) -> str:
        """One line about the strangers; empty without any."""
        return "somebody who does not know the token has answered as well; that was ignored" if self.strangers else ""


@dataclass(frozen=True, slots=True)
class ControlClient:
    """The operator's side."""

    link: Asks
    keys: FleetKeys
    token: str = field(repr=False)
    now: Callable[[], float]  # monotonic clock, s
    random: Callable[[int], bytes]  # returns that many random bytes

    def ask(self, control: Mapping[str, Any], wait_s: float) -> Operated:
        """Ask the fleet's world for something; raise `Unanswered` where no answer has a valid MAC.

        `control` is as `patrol.scenario.controls.read_control` takes it.
        """
        until = self.now() + wait_s
        fleet, nonce = self.keys.fleet, self.random(NONCE)
        strangers = 0
        for _, received in self.link.answers_until((self.keys.control(CHALLENGE),), nonce, MAX_ANSWER, wait_s):
            if (run_and_ticket := self._read_ticket(received, nonce)) is not None:
                break
            strangers += 1
        else:
            raise Unanswered(self._why_silent(strangers, wait_s))
        run, ticket = run_and_ticket
        text = json.dumps(dict(control)).encode()
        request = _compute_mac(self.token, b"request", fleet, run, nonce, ticket, text)
        request += struct.pack("<Q", run) + nonce + ticket + text
        left_s = max(until - self.now(), 0.001)
        for _, received in self.link.answers_until((self.keys.control(ASK),), request, MAX_ANSWER, left_s):
            mac, answer_bytes = received[:_MAC], received[_MAC:]
            right = _compute_mac(self.token, b"answer", fleet, run, nonce, ticket, text, answer_bytes)
            if hmac.compare_digest(mac, right) and (answer := _read_answer(answer_bytes)) is not None:
                return Operated(answer, strangers)
            strangers += 1
        raise Unanswered(self._why_silent(strangers, wait_s))

    def _read_ticket(self, given: bytes, nonce: bytes) -> tuple[int, bytes] | None:
        """Read run and ticket from an answer to a challenge; return None without a valid MAC."""
        if len(given) != _CHALLENGED.size:
            return None
        mac, run, ticket = _CHALLENGED.unpack(given)
        right = _compute_mac(self.token, b"challenge", self.keys.fleet, run, nonce, ticket)
        return (run, ticket) if hmac.compare_digest(mac, right) else None

    def _why_silent(self, strangers: int, wait_s: float) -> str:
        if strangers:
            return (
                f"fleet {self.keys.fleet}: somebody answered who does not know the token, and nobody else did; either "
                "the token is not this fleet's, or somebody answers in the world's place"
            )
        return f"the world of fleet {self.keys.fleet} did not answer within {wait_s:g} s"


def _read_answer(said: bytes) -> Answer | None:
    """Read a world's answer, its text safe for a terminal; None for anything else."""
    try:
        says = json.loads(said)
    except (ValueError, RecursionError):
        return None
    if not isinstance(says, dict) or type(says.get("done")) is not bool or type(says.get("text")) is not str:
        return None
    return Answer(says["done"], printable(says["text"][:_MAX_TEXT]))


def _compute_mac(token: str, what: bytes, fleet: str, run: int, *parts: bytes) -> bytes:
    """HMAC-SHA256 over the parts, each after its length, so that no two lists of parts give the same bytes.

    For example, the parts "ab" and "c" give another MAC than "a" and "bc".
    """
    framed = (b"fogwatch control", what, fleet.encode(), struct.pack("<Q", run), *parts)
    message = b"".join(struct.pack("<I", len(part)) + part for part in framed)
    return hmac.digest(token.encode("utf-8", "surrogatepass"), message, "sha256")
