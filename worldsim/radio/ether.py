"""The ether: whether and when a frame reaches each of the other robots, decided for each directed pair by itself."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from patrol.errors import BadInput
from patrol.faults.kinds import Spoof
from patrol.journal.links import NO_DROPS, Drops, Links, WholeLinks, to_others
from patrol.journal.records import Status
from patrol.radio.inbox import Heard
from runtime.security.private_files import fleet_key
from worldsim.radio.fates import STRANGER, Fates, Forged, Sent
from worldsim.radio.forging import MEMORY, Forger
from worldsim.radio.models import OnAir, cause_of
from worldsim.radio.rules import RadioRules, arrival

if TYPE_CHECKING:
    from patrol.ground.terrain import Terrain
    from patrol.pose import Pose
    from patrol.scenario import Scenario
    from worldsim.faults import Timeline
    from worldsim.radio.models import RadioModel
    from worldsim.robots.senses import Senses

OVERSIZED = "oversized"
RECEIVER_DEAD = "receiver dead"
RECEIVER_PAUSED = "receiver paused"
RECEIVER_ABSENT = "receiver absent"
OWN = "own"
"""The cause for which a robot that forges does not hear its forged frames."""

_DEAF = {
    Status.PAUSED: RECEIVER_PAUSED,
    Status.ABSENT: RECEIVER_ABSENT,
    Status.LEFT: RECEIVER_ABSENT,
    Status.DEAD: RECEIVER_DEAD,
    Status.LOST: RECEIVER_DEAD,
}
"""The cause for which a frame is lost at a robot that is not alive."""

Link = tuple[int, int, int]
"""(source, destination, sequence) of a frame on its way."""


@dataclass(frozen=True, slots=True)
class Delivery:
    """The ether's work in one tick, ordered by sender, sequence and receiver."""

    heard: Mapping[int, list[bytes]]  # by receiver; in order of sender, sequence and copy, forged ones first
    arrived: Sequence[Link]  # once for each copy
    dropped: Sequence[tuple[int, int, int, str]]  # the link of each frame that was dropped, and the cause
    forged: tuple[Forged, ...] = ()  # their source is `patrol.journal.records.FORGED`
    copies: tuple[tuple[int, int, int, str], ...] = ()  # as in `patrol.journal.records.TickRecord`
    delayed: tuple[tuple[int, int, int, str], ...] = ()  # as in `patrol.journal.records.TickRecord`


@dataclass(frozen=True, slots=True, order=True)
class _Flying:
    """A frame in flight. copy: 0 for the frame itself."""

    source: int
    sequence: int
    destination: int
    copy: int
    frame: bytes


class Ether:
    """The radio between robots: each frame to every other robot within the tick, unless faults or the model drop it.

    A frame's sequence says in which tick the world took it and which of its sender's frames it was
    (`patrol.journal.records.frame_sequence`). Its fate on a link is fixed when it is sent, except that it is lost
    where it arrives at a robot that is not alive then. The ether keeps no counts: the journal has every frame's fate,
    and frames without one are still in flight.
    """

    def __init__(
        self,
        step: float = 0.5,
        rules: RadioRules | None = None,
        forger: Forger | None = None,
        model: RadioModel | None = None,
        model_cause: str = "",
    ) -> None:
        """Make a radio; without rules, forger and model every frame arrives within its tick."""
        self._step = step
        self._model = model
        self._model_cause = model_cause
        self._rules = rules
        self._forger = forger
        self._flying: dict[int, list[_Flying]] = defaultdict(list)

    @property
    def in_flight(self) -> Counter[Link]:
        """The frames that have not arrived yet, copies included."""
        return Counter((f.source, f.destination, f.sequence) for flying in self._flying.values() for f in flying)

    def follow(self, timeline: Timeline) -> None:
        """Go on with a timeline that has other faults from the next tick on."""
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
        """Send each robot's frames, in their order, to all others that are there; call it for each tick in turn.

        The statuses are those of all robots, of which only the living hear; the poses are the true ones.
        """
        forged = self._forger.forge(tick, frames, statuses, poses) if self._forger is not None else []
        rules = self._rules if self._rules is not None and self._rules.begin(tick, poses) else None
        sent = Sent.of(tick, frames, forged)
        receivers = tuple(number for number in sorted(statuses) if statuses[number].is_present)
        to_all = to_others(tuple(sent.source.tolist()), receivers)
        deaf = {number: _DEAF[statuses[number]] for number in receivers if statuses[number] in _DEAF}
        # Nearly all ticks: links that are the same in each tick are not made anew.
        if rules is None and self._model is None and not (forged or self._flying or deaf or sent.oversized.any()):
            received = Heard(sent.frames, receivers, to_all.reaches)
            return Delivery(received, WholeLinks(to_all.pairs, sent.sequence), NO_DROPS)
        numbers = np.array(receivers, dtype=np.int64)
        fates = Fates(to_all.reaches.T)
        # First, since such a frame never goes on the air and uses up no bandwidth.
        fates.stop(sent.oversized[:, None], OVERSIZED)
        fates.stop(sent.origin[:, None] == numbers, OWN)
        copies: list[tuple[int, int, int, str]] = []
        delayed: list[tuple[int, int, int, str]] = []
        if rules is not None:
            rules.stop(sent, numbers, fates)
        if self._model is not None and sent.frames:
            on_the_way = fates.on_the_way.copy()
            # A copy of the fates: a model may write into it.
            air = OnAir(tick, sent.frames, sent.origin, sent.source, sent.sequence, numbers, on_the_way, poses)
            fates.stop(self._model.lost(air), self._model_cause)
        if rules is not None and rules.delays_or_copies:
            self._hold_up(tick, sent, receivers, fates, rules, copies, delayed)
        for cause in (RECEIVER_PAUSED, RECEIVER_ABSENT, RECEIVER_DEAD):
            fates.stop(np.array([deaf.get(number) == cause for number in receivers], dtype=np.bool_), cause)
        landing = sorted(self._flying.pop(tick, ()))
        in_vain = [(f, _DEAF[statuses[f.destination]]) for f in landing if statuses[f.destination] in _DEAF]
        dropped = _list_drops(sent, numbers, fates, in_vain)
        hearing = [number for number in receivers if number not in deaf]
        landing = [f for f in landing if statuses[f.destination] not in _DEAF]
        received, arrived = _arrived_frames(sent, numbers, fates.on_the_way, hearing, landing)
        return Delivery(received, arrived, dropped, tuple(forged), tuple(copies), tuple(delayed))

    def _hold_up(
        self,
        tick: int,
        sent: Sent,
        receivers: Sequence[int],
        fates: Fates,
        rules: RadioRules,
        copies: list[tuple[int, int, int, str]],
        delayed: list[tuple[int, int, int, str]],
    ) -> None:
        """Put delayed frames and copies into flight; note both in the lists."""
        for index, column in np.argwhere(fates.on_the_way).tolist():
            origin, source, sequence = (int(numbers[index]) for numbers in (sent.origin, sent.source, sent.sequence))
            frame, destination = sent.frames[index], receivers[column]
            link = (source, destination, sequence)
            delays = rules.delays(origin, *link)
            delay_s = sum(seconds for _, seconds in delays)
            arrival_tick = arrival(tick, delay_s, self._step)
            if arrival_tick > tick:
                self._flying[arrival_tick].append(_Flying(source, sequence, destination, 0, frame))
                # In flight now; it is heard in a later tick.
                fates.on_the_way[index, column] = False
                delayed += ((*link, fault) for fault, seconds in delays if seconds > 0.0)
            for copy, (fault, more_s) in enumerate(rules.copies(origin, *link), start=1):
                copies.append((*link, fault))
                arrival_tick = arrival(tick, delay_s + more_s, self._step)
                self._flying[arrival_tick].append(_Flying(source, sequence, destination, copy, frame))


def _list_drops(
    sent: Sent, receivers: NDArray[np.int64], fates: Fates, in_vain: Sequence[tuple[_Flying, str]]
) -> Drops:
    """List the frames that were stopped, and those that were in flight to a robot that does not hear."""
    frame, receiver = np.nonzero(fates.cause >= 0)
    causes = fates.causes
    late = [(f.source, f.destination, f.sequence, causes.index(cause)) for f, cause in in_vain]
    if not frame.size and not late:
        return NO_DROPS
    rows = np.array(late, dtype=np.int64).reshape(-1, 4).T
    now = (sent.source[frame], receivers[receiver], sent.sequence[frame], fates.cause[frame, receiver])
    source, destination, sequence, cause = (np.concatenate(pair) for pair in zip(now, rows, strict=True))
    # The last key counts most: by source, sequence, destination, cause.
    order = np.lexsort((cause, destination, sequence, source))
    return Drops(source[order], destination[order], sequence[order], cause[order], tuple(causes))


def _arrived_frames(
    sent: Sent,
    receivers: NDArray[np.int64],
    on_the_way: NDArray[np.bool_],
    hearing: Sequence[int],
    landing: Sequence[_Flying],
) -> tuple[Heard, Links]:
    """Return the frames of this tick that got through and those that land now, as heard and as links."""
    frames, reaches = [*sent.frames, *(f.frame for f in landing)], on_the_way
    source, sequence, copy = sent.source, sent.sequence, np.zeros(len(sent.frames), dtype=np.int64)
    if landing:
        late = np.array([(f.source, f.sequence, f.copy, f.destination) for f in landing], dtype=np.int64).T
        source, sequence, copy = (np.concatenate(pair) for pair in zip((source, sequence, copy), late[:3], strict=True))
        order = np.lexsort((copy, sequence, source))
        reaches = np.vstack([on_the_way, late[3][:, None] == receivers])[order]
        source, sequence, copy = source[order], sequence[order], copy[order]
        frames = [frames[index] for index in order.tolist()]
    frame, receiver = np.nonzero(reaches)
    if landing:  # a frame's copies come after it at each receiver
        order = np.lexsort((copy[frame], receiver, sequence[frame], source[frame]))
        frame, receiver = frame[order], receiver[order]
    links = Links(source[frame], receivers[receiver], sequence[frame])
    return Heard(frames, hearing, np.ascontiguousarray(reaches[:, np.isin(receivers, hearing)].T)), links


def ether_of(
    scenario: Scenario,
    timeline: Timeline,
    terrain: Terrain,
    senses: Senses,
    *,
    model: RadioModel | None = None,
    operated: bool = False,
) -> Ether:
    """Make the ether of a scenario.

    If `operated`, it can `follow` other timelines, since operators may add faults. Without a model only faults stop
    frames.
    """
    model_cause = cause_of(scenario.radio.model)
    if not timeline.entries and not operated:
        return Ether(scenario.step, None, None, model, model_cause)
    spoofs = [entry for entry in timeline.entries if isinstance(entry.fault, Spoof)]
    forger = None
    if spoofs or operated:
        insiders = any(entry.sources[0] != STRANGER for entry in spoofs)
        key = fleet_key(scenario.radio.key) if insiders else None
        forger = Forger(scenario, timeline, terrain, senses, key, MEMORY if operated else 0)
    return Ether(scenario.step, RadioRules(scenario, timeline, terrain), forger, model, model_cause)
