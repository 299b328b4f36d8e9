"""Transcripts: hashes of the messages that a robot and the world have each sent and accepted, for comparison.

A process that can publish under a robot's keys can speak for it, or for the world to it. So each robot keeps the
digests of the phases that it has acted on and of the replies that it has sent, and reports them to the world every
`LINES` ticks and when it leaves. The world keeps those of the phases that it has sent and of the replies that it
has acted on. A forged message has a place in one transcript only, and no forger can keep a robot's report from the
world.

Messages that were sent and not acted on count nowhere: at a pace some come too late or get lost.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field

DIGEST = 8
"""Bytes of a digest: the same for two messages once in 2^64 tries."""
LINES = 16
"""Ticks after which a robot reports."""
LAST = 2**31 - 1
"""The tick up to which a robot's last report is complete: it sends no more replies."""
PHASE_A, PHASE_B, REPLY_A, REPLY_B = range(4)
"""Places of the digests in a tick's line."""
PLACES = 4
MAX_LINES = 24
"""Ticks in one message."""
MAX_DIGESTS = 2
"""Digests in one place: a robot that stops because it is blind withdraws the reply that it has sent."""

_LENGTHS = [bytes((length,)) for length in range(MAX_DIGESTS * DIGEST + 1)]


def digest_of(payload: bytes) -> bytes:
    """Return the digest of a message."""
    return hashlib.blake2b(payload, digest_size=DIGEST).digest()


@dataclass(frozen=True, slots=True)
class Line:
    """One tick of a robot's transcript."""

    k: int
    # of `PHASE_A` to `REPLY_B`; each none, one, or for replies several joined
    digests: tuple[bytes, bytes, bytes, bytes]


class RobotTranscript:
    """A robot's own transcript since its last report."""

    def __init__(self) -> None:
        self._lines: dict[int, list[bytes]] = {}
        self._since = 0

    def note(self, k: int, place: int, digest: bytes) -> None:
        """Write down that a message was sent or acted on; its place is one of `PHASE_A` to `REPLY_B`.

        A further digest in the same place is added to those before.
        """
        self._lines.setdefault(k, [b""] * PLACES)[place] += digest

    @property
    def due(self) -> bool:
        """True if there is enough for a report."""
        return len(self._lines) >= LINES

    def report(self, until: int) -> list[tuple[int, int, tuple[Line, ...]]]:
        """Return all ticks up to `until` since the last report, and forget them.

        There is a piece for each message that they need: the first and the last tick for which it is complete, and its
        lines. `until` is the newest tick in which the robot has sent a reply.
        """
        lines = [Line(k, (a, b, c, d)) for k, (a, b, c, d) in sorted(self._lines.items()) if k <= until]
        self._lines = {k: digests for k, digests in self._lines.items() if k > until}
        pieces = [tuple(lines[first : first + MAX_LINES]) for first in range(0, len(lines), MAX_LINES)] or [()]
        reports = []
        for piece_number, piece in enumerate(pieces, 1):
            last = until if piece_number == len(pieces) else piece[-1].k
            reports.append((self._since, last, piece))
            self._since = max(self._since, min(last + 1, LAST))
        return reports


# --- the world -------------------------------------------------------------------------------------------------------

MAX_TICKS = 256
"""Ticks of which the world keeps the digests: a robot's report has to come by then, and it acts on no older reply."""
MAX_REPLIES = 8
"""Different replies to one phase of which the world keeps the digests; a robot sends `MAX_DIGESTS` at most."""
MAX_SPANS = 16
"""Spans of one process; what follows the last is added to it."""


@dataclass(slots=True)
class Span:
    """A stretch of ticks in which the two transcripts of one process agree throughout, or differ in each report."""

    first: int
    last: int  # inclusive
    phases: tuple[str, str] = ("", "")  # running hashes of those that the robot acted on: by the robot, by the world
    replies: tuple[str, str] = ("", "")  # running hashes of those that the world acted on: by the robot, by the world

    @property
    def agrees(self) -> bool:
        """True if both say the same."""
        return self.phases[0] == self.phases[1] and self.replies[0] == self.replies[1]

    def then(self, other: Span) -> Span:
        """Join this span and the one that follows."""
        return Span(
            min(self.first, other.first),
            max(self.last, other.last),
            (_chained(self.phases[0], other.phases[0]), _chained(self.phases[1], other.phases[1])),
            (_chained(self.replies[0], other.replies[0]), _chained(self.replies[1], other.replies[1])),
        )


@dataclass(slots=True)
class WorldTranscript:
    """The world's transcript of its exchange with one process, and what has been compared of it.

    Digests are kept for a while after they have been compared. So a forged report that agrees with forged replies hides
    nothing: the robot's own report of the same ticks is compared as well.
    """

    spans: list[Span] = field(default_factory=list)  # in the order of the reports
    messages: int = 0  # number of messages compared
    asked: int = -1  # the newest tick that the process was sent; -1 for none
    closed: bool = False  # the process has sent its last report
    _missed: int = 0
    _until: int = -1
    _forgotten: int = -1
    _sent: dict[int, list[bytes]] = field(default_factory=dict)
    """Digests of both phases by tick, until they have been compared."""
    _acted_on: dict[int, list[dict[bytes, bool]]] = field(default_factory=dict)
    """Digests by tick and place, with True once a report has covered them."""

    @property
    def missed(self) -> int:
        """Number of replies that the world acted on and that no report covers, because reports were lost."""
        return self._missed + sum(_uncovered(self._acted_on[k]) for k in self._acted_on if k <= self._until)

    def sent(self, k: int, place: int, digest: bytes) -> None:
        """Write down that the robot was sent a phase; its place is `PHASE_A` or `PHASE_B`."""
        self.asked = max(self.asked, k)
        self._sent.setdefault(k, [b"", b""])[place] = digest
        while len(self._sent) > MAX_TICKS:
            self._forget(next(iter(self._sent)))

    def acted_on(self, k: int, place: int, digest: bytes) -> None:
        """Write down that the world acts on a reply; its place is `REPLY_A` or `REPLY_B`."""
        if k <= self._forgotten:
            self._missed += 1
            return
        digests = self._acted_on.setdefault(k, [{}, {}])[place - REPLY_A]
        if len(digests) < MAX_REPLIES:
            digests.setdefault(digest, False)
        if len(self._acted_on) > MAX_TICKS:
            self._missed += _uncovered(self._acted_on.pop(next(iter(self._acted_on))))

    def compare(self, since: int, until: int, lines: Iterable[Line]) -> None:
        """Compare a report of the robot with what the world has written down.

        The report is complete from `since` to `until`, both included. Earlier ticks were in earlier reports, which may
        have been lost while the router was down.
        """
        self.closed = self.closed or until == LAST
        self._until = max(self._until, until)
        by_tick = {line.k: line.digests for line in lines}
        phases: tuple[list[bytes], list[bytes]] = ([], [])
        replies: tuple[list[bytes], list[bytes]] = ([], [])
        ticks = sorted({*by_tick, *(k for k in self._acted_on if since <= k <= until)})
        for k in ticks:
            says = by_tick.get(k, (b"",) * PLACES)
            ours = self._sent.get(k, [b"", b""])
            for phase in (PHASE_A, PHASE_B):
                if says[phase] and k > self._forgotten:
                    phases[0].append(says[phase])
                    phases[1].append(ours[phase])
                    ours[phase] = b""  # no robot acts on a phase twice
            for phase, digests in enumerate(self._acted_on.get(k, ()), REPLY_A):
                reported = _apart(says[phase])
                for digest in digests:
                    if digest in reported or k >= since:
                        digests[digest] = True
                        replies[0].append(digest if digest in reported else says[phase])
                        replies[1].append(digest)
        if phases[0] or replies[0]:
            self.messages += len(phases[0]) + len(replies[0])
            self._add(Span(ticks[0], ticks[-1], _hashed(*phases), _hashed(*replies)))

    def _forget(self, k: int) -> None:
        self._forgotten = max(self._forgotten, k)
        del self._sent[k]
        self._missed += _uncovered(self._acted_on.pop(k, ()))

    def _add(self, span: Span) -> None:
        if self.spans and (self.spans[-1].agrees == span.agrees or len(self.spans) == MAX_SPANS):
            self.spans[-1] = self.spans[-1].then(span)
        else:
            self.spans.append(span)


def as_notes(transcripts: Mapping[tuple[int, int], WorldTranscript]) -> list[dict[str, object]]:
    """Make notes of transcripts, by robot number and incarnation, for a journal's end."""
    return [
        {
            "robot": robot,
            "incarnation": incarnation,
            "asked": transcript.asked,
            "messages": transcript.messages,
            "missed": transcript.missed,
            "closed": transcript.closed,
            "spans": [[span.first, span.last, *span.phases, *span.replies] for span in transcript.spans],
        }
        for (robot, incarnation), transcript in sorted(transcripts.items())
    ]


def _uncovered(places: Iterable[Mapping[bytes, bool]]) -> int:
    return sum(not covered for digests in places for covered in digests.values())


def _apart(digests: bytes) -> Sequence[bytes]:
    if len(digests) == DIGEST:
        return (digests,)
    return [digests[begin : begin + DIGEST] for begin in range(0, len(digests), DIGEST)]


def _hashed(by_robot: Sequence[bytes], by_world: Sequence[bytes]) -> tuple[str, str]:
    ours = _hash(by_world)
    return (ours if by_robot == by_world else _hash(by_robot)), ours


def _hash(digests: Sequence[bytes]) -> str:
    return hashlib.blake2b(b"".join([_LENGTHS[len(digest)] + digest for digest in digests]), digest_size=16).hexdigest()


def _chained(before: str, after: str) -> str:
    return hashlib.blake2b(f"{before}{after}".encode(), digest_size=16).hexdigest()
