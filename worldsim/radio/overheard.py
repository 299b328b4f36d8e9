"""A fleet whose robots hear each other directly: what the world can still know of their radio.

It carries no frame. It overhears those that reach it too, and each robot says how many it has sent and heard. So a
frame's fate on a link is unknown; how many of a link's frames were heard is measured, by those who should have.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

from patrol.net.keys import FleetKeys, robot_of
from patrol.net.telemetry import Traffic
from patrol.radio.message import CONTACT, Rejected, decode
from worldsim.verdict.checks import Check

if TYPE_CHECKING:
    from patrol.journal import TickRecord
    from worldsim.fleet.sessions import Mailbox
    from worldsim.run_record import RunRecord

ROOM = 64
"""Frames of one robot that wait for the world to look at them."""

MAX_TRAFFIC = 1024
"""Bytes of the longest telemetry, for each robot of the fleet."""

LAST_WORDS_S = 2.0
"""How long the world waits for what robots have to say when they leave."""


@dataclass(slots=True)
class _Said:
    """What the processes of one robot have said together; the newest process speaks, the others have."""

    senders: frozenset[str]
    last: Traffic | None = None
    sent: int = 0
    refused: int = 0
    heard: Counter[str] = field(default_factory=Counter)

    def take(self, traffic: Traffic) -> None:
        """The next that it says; what an older process says comes too late."""
        if self.last is not None and traffic.incarnation < self.last.incarnation:
            return
        if self.last is not None and traffic.incarnation > self.last.incarnation:
            self.sent += self.last.sent
            self.refused += self.last.refused
            self.heard.update(self.last.heard)
        heard = {sender: count for sender, count in traffic.heard.items() if sender in self.senders}
        self.last = replace(traffic, heard=heard)

    @property
    def has_left(self) -> bool:
        """Whether there is no more to come."""
        return self.last is not None and self.last.final

    def total(self) -> dict[str, Any]:
        """For the journal; what is not final may lack the frames of its last moments."""
        last = self.last
        assert last is not None
        heard = {sender: self.heard[sender] + count for sender, count in sorted(last.heard.items())}
        refused = self.refused + last.refused
        return {"sent": self.sent + last.sent, "heard": heard, "refused": refused, "final": last.final}


class Ear:
    """What the world hears of a direct radio, and what robots say of it.

    numbers: of the robots by name. positions: the frames, by the senders' keys. telemetry: `Traffic`, by the robots'.
    """

    def __init__(
        self,
        keys: FleetKeys,
        numbers: Mapping[str, int],
        positions: Mailbox,
        telemetry: Mailbox,
        now: Callable[[], float],
    ) -> None:
        self.missed: Counter[int] = Counter()
        self._numbers = {keys.position(name): number for name, number in numbers.items()}
        self._positions = positions
        self._telemetry = telemetry
        self._now = now
        self._said = {name: _Said(frozenset(numbers) - {name}) for name in numbers}

    def overhear(self, k: int) -> dict[int, list[bytes]]:
        """The frames of tick k that have reached the world by now, of each robot its position first.

        Frames of another tick have come too late, or say what is not so; they are counted as missed, and so are
        contacts without a position.
        """
        frames: dict[int, list[bytes]] = {}
        while (arrived := self._positions.get()) is not None:
            number = self._numbers[arrived[0]]
            place = _place(arrived[1], k)
            if place is None or (place == CONTACT) is (number not in frames):
                self.missed[number] += 1
            else:
                frames.setdefault(number, []).append(arrived[1])
        self._listen()
        return frames

    def notes(self) -> dict[str, Any]:
        """For the journal's end: what each robot said last, and what the world itself has missed.

        Waits, not for long, for robots that are leaving now.
        """
        until = self._now() + LAST_WORDS_S
        self._listen()
        while not all(said.has_left for said in self._said.values()) and (left := until - self._now()) > 0.0:
            self._listen(left)
        said = {name: said.total() for name, said in self._said.items() if said.last is not None}
        missed = {robot_of(key): self.missed[number] for key, number in self._numbers.items()}
        return {"direct": {"said": said, "missed": missed}}

    def _listen(self, wait_s: float = 0.0) -> None:
        while (arrived := self._telemetry.get(wait_s)) is not None:
            self._said[robot_of(arrived[0])].take(arrived[1])
            wait_s = 0.0


def _place(frame: bytes, k: int) -> int | None:
    """The robot number in a frame of tick k; None for any other frame."""
    try:
        position = decode(frame)
    except Rejected:
        return None
    return position.robot if position.sequence == k else None


class DirectLinks:
    """By what robots say themselves nobody has heard more of a robot than it has sent.

    What became of the other frames nobody knows, so there is no more to judge.
    """

    def __init__(self, journal: RunRecord) -> None:
        self._journal = journal

    def tick(self, record: TickRecord) -> None:
        """A tick says nothing of links."""

    def check(self) -> Check:
        """The result, once the journal has ended."""
        said = _said(self._journal)
        problems = [
            f"{hearer} heard {count} frames of {sender}, which sent {said[sender]['sent']}"
            for hearer, says in said.items()
            for sender, count in says["heard"].items()
            if sender in said and said[sender]["final"] and count > said[sender]["sent"]
        ]
        if problems:
            return Check("links add up", False, problems[0])
        sums = _totals(_links(said).values())
        measured = "no two robots say what they heard"
        if sums["sent"]:
            measured = f"robots say that they heard {sums['delivered']} of {sums['sent']} frames"
        why = "with direct radio nobody knows a frame's fate"
        return Check("links add up", True, f"not judged: {why}; {measured}", judged=False)


def as_measured(summary: Mapping[str, Any], journal: RunRecord) -> dict[str, Any]:
    """The summary of a fleet with direct radio: frames by what the robots say, where an ether would know.

    delivered: heard. dropped, in_flight: None, for nobody knows. frames, bytes_per_robot_s: of what the world has
    overheard. direct: for each directed link of robots that have both said so the frames sent and heard; heard_share:
    over all of these; missed: frames that reached the world too late to be overheard; unsaid: robots whose counts are
    missing or end before their process did.
    """
    said = _said(journal)
    links = _links(said)
    names = [robot.name for robot in journal.header.robots]
    robots = {name: dict(facts) for name, facts in summary["robots"].items()}
    for name, facts in robots.items():
        facts.update(
            _totals(counts for (sender, _), counts in links.items() if sender == name), dropped=None, in_flight=None
        )
    totals = _totals(links.values())
    share = totals["delivered"] / totals["sent"] if totals["sent"] else None
    unknown: dict[str, Any] = {"dropped": None, "dropped_by_cause": {}, "in_flight": None}
    messages = {**summary["messages"], **totals, **unknown}
    direct = {
        "links": {f"{source} to {destination}": counts for (source, destination), counts in links.items()},
        "heard_share": share,
        "missed": journal.end.notes["direct"]["missed"] if said and journal.end else {},
        "unsaid": [name for name in names if name not in said or not said[name]["final"]],
    }
    return {**summary, "messages": messages, "robots": robots, "links": {}, "direct": direct}


def _totals(links: Iterable[Mapping[str, int]]) -> dict[str, int]:
    """What some links add up to, in the summary's words."""
    counts = list(links)
    return {"sent": sum(link["sent"] for link in counts), "delivered": sum(link["heard"] for link in counts)}


def _said(journal: RunRecord) -> dict[str, dict[str, Any]]:
    """What each robot said last, by name."""
    notes = journal.end.notes if journal.end else {}
    said: dict[str, dict[str, Any]] = notes.get("direct", {}).get("said", {})
    return said


def _links(said: Mapping[str, Mapping[str, Any]]) -> dict[tuple[str, str], dict[str, int]]:
    """Frames sent and heard by directed link, of robots that have both said so."""
    return {
        (sender, hearer): {"sent": said[sender]["sent"], "heard": count}
        for hearer, says in said.items()
        for sender, count in says["heard"].items()
        if sender in said
    }
