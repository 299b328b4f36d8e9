"""What a journal tells of frames in the air, read without the code that carries them."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING

from patrol.journal.records import FORGED, frame_sequence
from patrol.scenario.faults.kinds import Spoof
from worldsim.radio.ether import OVERSIZED, OWN, RECEIVER_ABSENT, RECEIVER_DEAD, RECEIVER_PAUSED, Link, there

if TYPE_CHECKING:
    from patrol.journal.records import TickRecord
    from worldsim.timeline import Entry, Timeline

BEFORE_THE_AIR = ("silence", "partition", "range", "bandwidth", OVERSIZED, OWN)
"""Why a frame is dropped before it can be lost on its way."""

ON_ARRIVAL = (RECEIVER_DEAD, RECEIVER_PAUSED, RECEIVER_ABSENT)
"""Why one is dropped that has got through; all other causes apply when it is sent."""

NO_ROBOT = 0
"""The origin of frames that come from no robot's radio."""


def origins_of(record: TickRecord, forgers: Mapping[str, int]) -> dict[tuple[int, int], int]:
    """The robot from whose radio each frame of a tick comes, by (source, sequence), in the frames' order.

    forgers: as of `forgers_of`.
    """
    origins: dict[tuple[int, int], int] = {}
    places: Counter[int] = Counter()
    for source, _ in record.frames:
        place = places[source]
        places[source] += 1
        origin = source
        if source == FORGED:
            origin = forgers.get(record.forged[place], NO_ROBOT) if place < len(record.forged) else NO_ROBOT
        origins[source, frame_sequence(record.k, place)] = origin
    return origins


def fates(record: TickRecord, forgers: Mapping[str, int]) -> Iterator[tuple[int, Link, str]]:
    """Every frame of a tick on every link: whose radio it comes from, and what stopped it when it was sent.

    That is empty where nothing did, so that the frame arrives, sooner or later.
    forgers: as of `forgers_of`.
    """
    here = [row.number for row in record.robots if there(row.status)]
    stopped = {drop[:3]: drop[3] for drop in record.dropped if drop[3] not in ON_ARRIVAL}
    for (source, sequence), origin in origins_of(record, forgers).items():
        for to in here:
            if to != source:
                link = (source, to, sequence)
                yield origin, link, stopped.get(link, "")


def airborne(record: TickRecord, forgers: Mapping[str, int]) -> Iterator[tuple[int, Link]]:
    """Those of them that nothing stopped when they were sent, so that they arrive somewhere, sooner or later."""
    return ((origin, link) for origin, link, why in fates(record, forgers) if not why)


def arrived(record: TickRecord) -> list[Link]:
    """What arrived in a tick, once for each copy, whether or not anybody was there to hear it."""
    return [*record.deliveries, *(drop[:3] for drop in record.dropped if drop[3] in ON_ARRIVAL)]


def forgers_of(timeline: Timeline) -> dict[str, int]:
    """By the ids of spoofs the robots that forge."""
    return {entry.id: entry.sources[0] for entry in timeline.entries if isinstance(entry.fault, Spoof)}


def active(entry: Entry, k: int) -> bool:
    """Whether a lasting fault is active in tick k."""
    return entry.begin <= k and (entry.end is None or k < entry.end)


def on_link(entry: Entry, origin: int, to: int) -> bool:
    """Whether a fault of links befalls what one robot's radio sends to another."""
    return origin in entry.sources and to in entry.targets


def kind_of(cause: str) -> str:
    """The kind of what dropped a frame, from the journal's words."""
    return cause.partition(":")[0]


def fault_of(cause: str) -> str:
    """The id of the fault that dropped a frame, empty where none did."""
    return cause.partition(":")[2]
