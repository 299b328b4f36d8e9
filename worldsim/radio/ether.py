"""The ether: whether and when a frame reaches each of the other robots, decided for each directed pair by itself."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from patrol.errors import BadInput
from patrol.journal.links import NO_DROPS, NO_LINKS, Drops, Links, WholeLinks, to_others
from patrol.journal.records import FORGED, Status, frame_sequence
from patrol.radio.fleet_key import fleet_key
from patrol.radio.heard import Heard
from patrol.radio.message import MAX_FRAME
from patrol.scenario.faults.kinds import Spoof
from worldsim.radio.forging import MEMORY, Forged, Forger
from worldsim.radio.rules import NOBODY, RadioRules, arrival

if TYPE_CHECKING:
    from patrol.ground.terrain import Terrain
    from patrol.pose import Pose
    from patrol.scenario import Scenario
    from worldsim.faults.timeline import Timeline
    from worldsim.robots.senses import Senses

OVERSIZED = "oversized"
RECEIVER_DEAD = "receiver dead"
RECEIVER_PAUSED = "receiver paused"
RECEIVER_ABSENT = "receiver absent"
OWN = "own"
"""Why a robot that forges does not hear its forged frames."""

_DEAF = {
    Status.PAUSED: RECEIVER_PAUSED,
    Status.ABSENT: RECEIVER_ABSENT,
    Status.LEFT: RECEIVER_ABSENT,
    Status.DEAD: RECEIVER_DEAD,
    Status.LOST: RECEIVER_DEAD,
}
"""Why a frame is lost that arrives at a robot that is not alive."""

Link = tuple[int, int, int]
"""(source, destination, sequence) of a frame on its way."""


@dataclass(frozen=True, slots=True)
class Delivery:
    """What the ether did in one tick, ordered by sender, sequence and receiver.

    Attributes:
        heard: For each receiver its frames, by sender, sequence and copy, forged ones first.
        arrived: (source, destination, sequence) of each frame that arrived, once for each copy.
        dropped: The same of each frame that was dropped, and the cause.
        forged: The forged frames; their source is `patrol.journal.records.FORGED`.
        copies: As in `patrol.journal.records.TickRecord`.
        delayed: As in `patrol.journal.records.TickRecord`.
    """

    heard: Mapping[int, list[bytes]]
    arrived: Sequence[Link]
    dropped: Sequence[tuple[int, int, int, str]]
    forged: tuple[Forged, ...] = ()
    copies: tuple[tuple[int, int, int, str], ...] = ()
    delayed: tuple[tuple[int, int, int, str], ...] = ()


@dataclass(frozen=True, slots=True, order=True)
class _Flying:
    """A frame in flight. copy: 0 for the frame itself."""

    source: int
    sequence: int
    destination: int
    copy: int
    frame: bytes


class Ether:
    """The radio between robots: every frame to every other robot within the tick, less what the faults do to it.

    A frame's sequence says in which tick the world took it and which of its sender's frames it was
    (`patrol.journal.records.frame_sequence`). Its fate on a link is fixed when it is sent, except that it is lost
    where it arrives at a robot that is not alive then. The ether keeps no counts: the journal has every frame's fate,
    and frames without one are still in flight.
    """

    def __init__(self, step: float = 0.5, rules: RadioRules | None = None, forger: Forger | None = None) -> None:
        """Make a radio; without rules and forger every frame arrives within its tick.

        Args:
            step: Length of a tick, s.
            rules: What faults do to frames, or None.
            forger: What forges frames, or None.
        """
        self._step = step
        self._rules = rules
        self._forger = forger
        self._flying: dict[int, list[_Flying]] = defaultdict(list)

    @property
    def in_flight(self) -> Counter[Link]:
        """The frames that have not arrived yet, copies included."""
        return Counter((f.source, f.destination, f.sequence) for flying in self._flying.values() for f in flying)

    def follow(self, timeline: Timeline) -> None:
        """Go on with a timeline that has other faults from the next tick on.

        Args:
            timeline: The timeline.

        Raises:
            BadInput: The faults cannot be added to this run.
        """
        if self._rules is None or self._forger is None:
            raise BadInput("control: this run takes no faults while it goes on")
        self._forger.follow(timeline)
        self._rules.timeline = timeline

    def carry(
        self,
        tick: int,
        frames: Mapping[int, Sequence[bytes]],
        statuses: Mapping[int, Status],
        poses: Mapping[int, Pose],
    ) -> Delivery:
        """Send each robot's frames, in their order, to all others that are there; to be called for each tick in turn.

        Args:
            tick: The tick.
            frames: By the numbers of their senders, which are alive.
            statuses: Of all robots by number; only those alive hear.
            poses: The true ones, by robot number.

        Returns:
            What happens to frames in this tick.
        """
        forged = self._forger.forge(tick, frames, statuses, poses) if self._forger is not None else []
        troubled = self._rules is not None and self._rules.begin(tick, poses)
        rules = self._rules if troubled else None
        if forged or self._flying or (rules is not None and not rules.only_drop):
            return self._carry_through(tick, frames, statuses, forged, rules)
        return self._carry_at_once(tick, frames, statuses, rules)

    def _carry_at_once(
        self,
        tick: int,
        frames: Mapping[int, Sequence[bytes]],
        statuses: Mapping[int, Status],
        rules: RadioRules | None,
    ) -> Delivery:
        """The same where each frame is heard in its own tick or never: all pairs at once."""
        sent = [(source, place, frame) for source in sorted(frames) for place, frame in enumerate(frames[source])]
        receivers = [number for number in sorted(statuses) if there(statuses[number])]
        hearing = [number for number in receivers if statuses[number] is Status.ALIVE]
        if not sent or not receivers:
            return Delivery({number: [] for number in hearing}, NO_LINKS, NO_DROPS)
        frames_sent = [frame for _, _, frame in sent]
        oversized = [len(frame) > MAX_FRAME for frame in frames_sent]
        sequences = np.array([frame_sequence(tick, place) for _, place, _ in sent], dtype=np.int64)
        everybody = to_others(tuple(source for source, _, _ in sent), tuple(receivers))
        if rules is None and len(hearing) == len(receivers) and not any(oversized):
            links: Links = WholeLinks(everybody.pairs, sequences)
            return Delivery(Heard(frames_sent, hearing, everybody.reaches), links, NO_DROPS)
        sources = np.array([source for source, _, _ in sent], dtype=np.int64)
        numbers = np.array(receivers, dtype=np.int64)
        causes = [OVERSIZED, RECEIVER_PAUSED, RECEIVER_ABSENT, RECEIVER_DEAD]
        deaf = [causes.index(_DEAF[statuses[number]]) if statuses[number] in _DEAF else -1 for number in receivers]
        cause = np.repeat(np.array([deaf], dtype=np.int64), len(sent), axis=0)
        if rules is not None:
            stopped, faults = rules.stopped(sources, numbers, sequences)
            cause = np.where(stopped >= 0, stopped + len(causes), cause)
            causes += faults
        cause[oversized] = 0
        others = everybody.reaches.T
        arrives = others & (cause < 0)
        frame_of, receiver_of = np.nonzero(arrives)
        links = Links(sources[frame_of], numbers[receiver_of], sequences[frame_of])
        alive = np.array([statuses[number] is Status.ALIVE for number in receivers], dtype=np.bool_)
        heard = Heard(frames_sent, hearing, np.ascontiguousarray(arrives[:, alive].T))
        frame_of, receiver_of = np.nonzero(others & (cause >= 0))
        if not frame_of.size:
            return Delivery(heard, links, NO_DROPS)
        dropped = Drops(
            sources[frame_of], numbers[receiver_of], sequences[frame_of], cause[frame_of, receiver_of], tuple(causes)
        )
        return Delivery(heard, links, dropped if rules is None else dropped.sorted())

    def _carry_through(
        self,
        tick: int,
        frames: Mapping[int, Sequence[bytes]],
        statuses: Mapping[int, Status],
        forged: Sequence[Forged],
        rules: RadioRules | None,
    ) -> Delivery:
        """The same where there is something to ask about a frame, or some are in flight."""
        sent = [(FORGED, one.origin, place, one.frame) for place, one in enumerate(forged)]
        sent += [
            (source, source, place, frame) for source in sorted(frames) for place, frame in enumerate(frames[source])
        ]
        receivers = [number for number in sorted(statuses) if there(statuses[number])]
        dropped: list[tuple[int, int, int, str]] = []
        copies: list[tuple[int, int, int, str]] = []
        delayed: list[tuple[int, int, int, str]] = []
        for source, origin, place, frame in sent:
            sequence = frame_sequence(tick, place)
            oversized = len(frame) > MAX_FRAME
            jam = None if rules is None or oversized else rules.jammed(origin, len(frame))
            for destination in receivers:
                if destination == source:
                    continue
                link = (source, destination, sequence)
                cause = OVERSIZED if oversized else OWN if destination == origin else None
                if cause is None and rules is not None:
                    cause = rules.lost(origin, *link, jam)
                if cause is not None:
                    dropped.append((*link, cause))
                    continue
                held = [] if rules is None else rules.delays(origin, *link)
                delay_s = sum(seconds for _, seconds in held)
                due = arrival(tick, delay_s, self._step)
                self._flying[due].append(_Flying(source, sequence, destination, 0, frame))
                if due > tick:
                    delayed += ((*link, fault) for fault, seconds in held if seconds > 0.0)
                for copy, (fault, more_s) in enumerate([] if rules is None else rules.copies(origin, *link), start=1):
                    copies.append((*link, fault))
                    due = arrival(tick, delay_s + more_s, self._step)
                    self._flying[due].append(_Flying(source, sequence, destination, copy, frame))
        heard, arrived = self._land(tick, statuses, dropped)
        return Delivery(heard, arrived, tuple(sorted(dropped)), tuple(forged), tuple(copies), tuple(delayed))

    def _land(
        self, tick: int, statuses: Mapping[int, Status], dropped: list[tuple[int, int, int, str]]
    ) -> tuple[dict[int, list[bytes]], tuple[Link, ...]]:
        """What arrives now, where somebody hears it; what arrives elsewhere is added to `dropped`."""
        heard: dict[int, list[bytes]] = {n: [] for n in sorted(statuses) if statuses[n] is Status.ALIVE}
        arrived = []
        for flying in sorted(self._flying.pop(tick, ())):
            link = (flying.source, flying.destination, flying.sequence)
            deaf = _DEAF.get(statuses[flying.destination])
            if deaf is None:
                heard[flying.destination].append(flying.frame)
                arrived.append(link)
            else:
                dropped.append((*link, deaf))
        return heard, tuple(arrived)


def ether_of(
    scenario: Scenario, timeline: Timeline, terrain: Terrain, senses: Senses, *, operated: bool = False
) -> Ether:
    """Make the ether of a scenario.

    Args:
        scenario: The scenario.
        timeline: Its faults.
        terrain: Its terrain.
        senses: What makes robots report wrong places and times.
        operated: Whether operators may add faults, so that it must be able to `follow` other timelines.

    Returns:
        The ether.

    Raises:
        BadInput: A robot forges and the fleet's key cannot be read.
    """
    if not timeline.entries and not operated:
        return Ether(scenario.step)
    spoofs = [entry for entry in timeline.entries if isinstance(entry.fault, Spoof)]
    forger = None
    if spoofs or operated:
        insiders = any(entry.sources[0] != NOBODY for entry in spoofs)
        key = fleet_key(scenario.radio.key) if insiders else None
        forger = Forger(scenario, timeline, terrain, senses, key, MEMORY if operated else 0)
    return Ether(scenario.step, RadioRules(scenario, timeline, terrain), forger)


def there(status: Status) -> bool:
    """Whether frames are sent to a robot at all."""
    return status is not Status.ABSENT and status is not Status.LEFT
