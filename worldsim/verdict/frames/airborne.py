"""The fate of each frame on each link, read from a journal's records.

Of the code that carries frames this uses names only (causes, the order of faults, which statuses are addressed), so an
error there cannot confirm itself.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping
from functools import lru_cache
from typing import TYPE_CHECKING, get_args

import numpy as np

from patrol.faults.kinds import Fault, Loss
from patrol.journal.links import Links, Pairs, WholeLinks, drops_of, joined, links_of, pairs_of
from patrol.journal.records import FORGED, frame_sequence
from worldsim.radio.ether import OVERSIZED, OWN, RECEIVER_ABSENT, RECEIVER_DEAD, RECEIVER_PAUSED, Link
from worldsim.radio.rules import DROPS
from worldsim.verdict.common.faults import NO_ROBOT

if TYPE_CHECKING:
    from patrol.journal.records import TickRecord


def causes_before(kind: type[Fault]) -> frozenset[str]:
    """Return the causes, and kinds of faults, that may drop a frame before a fault of some kind has its turn."""
    return frozenset({OVERSIZED, OWN, *(name_of(earlier) for earlier in DROPS[: DROPS.index(kind)])})


def name_of(kind: type[Fault]) -> str:
    """Return the name of a kind of fault in scenarios and journals."""
    return str(get_args(kind.model_fields["kind"].annotation)[0])


BEFORE_THE_AIR = causes_before(Loss)
"""Causes that drop a frame before it can be lost on its way."""

ON_ARRIVAL = (RECEIVER_DEAD, RECEIVER_PAUSED, RECEIVER_ABSENT)
"""Causes that drop a frame that has got through; all others apply when it is sent."""


def origins_of(record: TickRecord, forgers: Mapping[str, int]) -> dict[tuple[int, int], int]:
    """Return the robot whose radio sends each frame of a tick, by (source, sequence), in frame order.

    It is `NO_ROBOT` for a stranger. `forgers` are as `worldsim.verdict.common.faults.forgers_of` returns them.
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
    """Yield every frame of a tick on every link: the robot whose radio sent it, the link, what stopped it.

    The last is empty where nothing stopped the frame when it was sent, so that it arrives, sooner or later.
    """
    here = [row.number for row in record.robots if row.status.is_present]
    causes = {drop[:3]: drop[3] for drop in record.dropped if drop[3] not in ON_ARRIVAL}
    for (source, sequence), origin in origins_of(record, forgers).items():
        for to in here:
            if to != source:
                link = (source, to, sequence)
                yield origin, link, causes.get(link, "")


def airborne(record: TickRecord, forgers: Mapping[str, int]) -> Iterator[tuple[int, Link]]:
    """Return those of the `fates` that nothing stopped when they were sent, so that they arrive, sooner or later."""
    return ((origin, link) for origin, link, why in fates(record, forgers) if not why)


def arrived(record: TickRecord) -> Links:
    """Return the links of a tick's arriving frames, once for each copy, whether or not the receiver could hear."""
    delivered, dropped = links_of(record.deliveries), drops_of(record.dropped)
    late = [number for number, why in enumerate(dropped.causes) if why in ON_ARRIVAL]
    unheard = np.isin(dropped.cause, late)
    if not unheard.any():
        return delivered
    return joined(delivered, Links(dropped.source[unheard], dropped.destination[unheard], dropped.sequence[unheard]))


def sent_links(record: TickRecord) -> WholeLinks:
    """Return the link of every frame of a tick to every robot that is there, by frame and receiver."""
    places: Counter[int] = Counter()
    sequences = []
    for source, _ in record.frames:
        sequences.append(frame_sequence(record.k, places[source]))
        places[source] += 1
    here = tuple([row.number for row in record.robots if row.status.is_present])
    pairs = _pairs(tuple([source for source, _ in record.frames]), here)
    return WholeLinks(pairs, np.array(sequences, dtype=np.int64))


@lru_cache(maxsize=2)
def _pairs(sources: tuple[int, ...], here: tuple[int, ...]) -> Pairs:
    """Pair each frame with each robot that is there but its sender.

    The ether has code of its own for this, so that an error in it does not confirm itself.
    """
    of, to = np.array(sources, dtype=np.int64), np.array(here, dtype=np.int64)
    frame, receiver = np.nonzero(of[:, None] != to[None, :])
    return pairs_of(frame, of[frame], to[receiver])


def kind_of(cause: str) -> str:
    """Return the kind of what dropped a frame, from the cause that the journal names."""
    return cause.partition(":")[0]


def fault_of(cause: str) -> str:
    """Return the id of the fault that dropped a frame, empty where none did."""
    return cause.partition(":")[2]
