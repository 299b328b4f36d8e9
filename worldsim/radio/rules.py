"""The effects of radio faults on one frame on one directed link.

Faults act in a fixed order (`DROPS`). The first that applies drops the frame and is named: silence, partition, range,
bandwidth, loss, and of two of one kind the earlier in the scenario. What gets through is held up by all delay and
reorder faults together. Then each duplicate fault that hits adds one copy, which takes as long as the frame itself and
the copy's own delay.

Every draw is a hash of (seed, Purpose.ETHER, fault, source, destination, sequence), so what happens to one frame does
not depend on any other. Only two things have a memory: a burst of losses, which is a function of the tick all the same,
and what a sender has left of its bandwidth, which depends on the frames that it sent before.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from patrol.faults.kinds import (
    Bandwidth,
    Delay,
    Duplicate,
    Fault,
    Loss,
    OnLinks,
    Partition,
    Range,
    Reorder,
    Silence,
    Wait,
)
from patrol.pose import Pose
from patrol.random import Purpose, draw, gauss, mix
from runtime.messages.phases import PHASE_B_SHARE
from worldsim.kernels.radio import below, walls_on_line
from worldsim.radio.fates import STRANGER

if TYPE_CHECKING:
    from patrol.ground.terrain import Terrain
    from patrol.scenario import Scenario
    from worldsim.faults import Entry, Timeline
    from worldsim.radio.fates import Fates, Sent

LEAST_BUCKET = 64.0
"""Bytes that may be sent at once with any bandwidth, so that any frame fits sooner or later."""

BEAM = 1e-6
"""Radius (m) of a line of sight, so that none passes along the crack between two points of a wall."""

DROPS: tuple[type[Fault], ...] = (Silence, Partition, Range, Bandwidth, Loss)
"""The kinds of faults that drop frames, in the order in which they apply."""

_ON_FRAMES: tuple[type[Fault], ...] = (*DROPS, Delay, Reorder, Duplicate)


def arrival(k: int, delay_s: float, step: float) -> int:
    """Return the tick in whose phase B a frame is heard that is sent in phase A of tick k.

    For example, with steps of 0.5 s, tick 7 for a delay of 0.1 s in tick 7 and tick 8 for one of 0.2 s.
    """
    return k + max(0, math.ceil((delay_s - PHASE_B_SHARE * step) / step - 1e-9))


def waited(wait: Wait, *values: int) -> float:
    """Draw the length of a wait, s, at least 0; the draw is a hash of `values`."""
    first, *parameters = wait.values
    match wait.shape:
        case "uniform":
            return first + (parameters[0] - first) * draw(*values)
        case "normal":
            return max(first + parameters[0] * gauss(*values), 0.0)
        case "exponential":
            return -first * math.log(1.0 - draw(*values))
    return first


class Burst:
    """A Gilbert-Elliott chain, of one loss fault on one directed link: good or bad from tick to tick.

    It is bad with probability `rate` when the fault begins. From then on it goes from bad to good with probability
    r = 1 / mean_burst and from good to bad with p = rate r / (1 - rate), one draw a tick whether or not anything is
    sent. All of a tick's frames share its fate.
    """

    def __init__(self, seed: int, entry: Entry, rate: float, mean_burst: float, link: tuple[int, int]) -> None:
        self._draws = (seed, Purpose.ETHER, entry.index, *link)
        self._recovers, self._fails = chain_of(rate, mean_burst)
        self._k = entry.begin
        self._bad = draw(*self._draws, entry.begin) < rate

    def bad(self, k: int) -> bool:
        """Return True if the link is bad in tick k; to be asked in ascending ticks."""
        while self._k < k:
            self._k += 1
            # One draw a tick, whether or not a frame is sent: the burst does not depend on the traffic.
            chance = draw(*self._draws, self._k)
            self._bad = chance >= self._recovers if self._bad else chance < self._fails
        return self._bad


def chain_of(rate: float, mean_burst: float) -> tuple[float, float]:
    """Return the probabilities of a Gilbert-Elliott chain: r (bad to good) and p (good to bad).

    `rate` is the share of bad ticks, `mean_burst` the mean length of a bad spell in ticks.

    For example, a rate of 0.2 and bursts of 4 ticks give r = 0.25 and p = 0.0625.
    """
    r = 1.0 / mean_burst
    return r, min(rate * r / (1.0 - rate), 1.0)


class Bucket:
    """The rest of a sender's bandwidth: a token bucket that holds one second's worth, full to begin with."""

    def __init__(self, bytes_per_s: float, k: int, step: float) -> None:
        self._rate = bytes_per_s * step
        self._capacity = max(LEAST_BUCKET, bytes_per_s)
        self._left = self._capacity
        self._k = k

    def holds(self, size: int, k: int) -> bool:
        """Return True if a frame of `size` bytes may be sent in tick k."""
        # Filled up when asked, for all ticks since the last frame.
        self._left = min(self._capacity, self._left + self._rate * (k - self._k))
        self._k = k
        return size <= self._left

    def take(self, size: int) -> None:
        """Use up the bytes of a frame that is sent."""
        self._left -= size


class RadioRules:
    """The radio faults of a timeline. Call `begin` for each tick in turn, then ask about its frames in their order.

    A frame's origin is the robot from whose radio it comes, or `STRANGER`, not the sender that it claims.
    """

    def __init__(self, scenario: Scenario, timeline: Timeline, terrain: Terrain) -> None:
        self.timeline = timeline
        self._seed = scenario.seed
        self._step = scenario.step
        self._terrain = terrain
        self._opaque = (~terrain.passable).view("uint8")
        self._k = 0
        self._poses: Mapping[int, Pose] = {}
        self._entries: Sequence[Entry] = ()
        self._active: dict[type, list[Entry]] = {}
        self._dropping: list[Entry] = []
        self._bursts: dict[tuple[int, int, int], Burst] = {}
        self._buckets: dict[tuple[int, int], Bucket] = {}

    def begin(self, k: int, poses: Mapping[int, Pose]) -> bool:
        """Begin a tick, with the robots' true poses; return True if any radio fault is active."""
        self._k, self._poses = k, poses
        entries = self.timeline.at(k)
        if entries is not self._entries:
            self._entries = entries
            self._active = {kind: [e for e in entries if isinstance(e.fault, kind)] for kind in _ON_FRAMES}
            self._dropping = [entry for kind in DROPS for entry in self._active[kind]]
        return any(self._active.values())

    @property
    def delays_or_copies(self) -> bool:
        """True if a fault that delays or copies frames is active."""
        return any(self._active.get(kind) for kind in (Delay, Reorder, Duplicate))

    def stop(self, sent: Sent, receivers: NDArray[np.int64], fates: Fates) -> None:
        """Stop the frames that the tick's faults drop: changes `fates` in place.

        `receivers` are the numbers of those to whom the fates belong, int64 (r,).
        """
        jams = self._charge_frames(sent)
        for entry in self._dropping:
            if isinstance(entry.fault, Bandwidth):
                hit = np.array([jam is entry for jam in jams], dtype=np.bool_)[:, None]
            else:
                hit = self._mark_hits(entry, sent, receivers, fates.on_the_way)
            fates.stop(hit, cause(entry))

    def _mark_hits(
        self, entry: Entry, sent: Sent, receivers: NDArray[np.int64], on_the_way: NDArray[np.bool_]
    ) -> NDArray[np.bool_]:
        """Mark the frames on their way that a fault drops, bool (f, r)."""
        fault = entry.fault
        if isinstance(fault, Silence):
            silenced = _mark_members(sent.origin, entry.who) & (fault.direction in ("out", "both"))
            return silenced[:, None] | (_mark_members(receivers, entry.who) & (fault.direction in ("in", "both")))
        if isinstance(fault, Partition):
            return _mark_cuts(entry, fault, sent.origin, receivers)
        if isinstance(fault, Range):
            links: NDArray[np.bool_] = on_the_way & _mark_members(sent.origin, entry.who)[:, None]
            return self._ask_each(links, sent, receivers, partial(self._is_out_of_reach, fault))
        assert isinstance(fault, Loss)
        links = (
            on_the_way & _mark_members(sent.origin, entry.sources)[:, None] & _mark_members(receivers, entry.targets)
        )
        if fault.mean_burst is not None:
            return self._ask_each(
                links, sent, receivers, partial(self._is_in_a_burst, entry, fault.rate, fault.mean_burst)
            )
        states = [mix(self._seed, Purpose.ETHER, entry.index, source) for source in sent.source.tolist()]
        rates = np.broadcast_to(fault.rate, links.shape)
        lost = below(np.array(states, dtype=np.uint64), receivers, sent.sequence, rates)
        links &= lost.view(np.bool_)
        return links

    @staticmethod
    def _ask_each(
        links: NDArray[np.bool_], sent: Sent, receivers: NDArray[np.int64], drops: Callable[[int, int], bool]
    ) -> NDArray[np.bool_]:
        """Ask about each link by its origin and receiver; every frame of an origin has the same answer."""
        hit = np.zeros_like(links)
        dropped: dict[tuple[int, int], bool] = {}
        for frame, column in np.argwhere(links).tolist():
            link = (int(sent.origin[frame]), int(receivers[column]))
            if link not in dropped:
                dropped[link] = drops(*link)
            hit[frame, column] = dropped[link]
        return hit

    def _charge_frames(self, sent: Sent) -> list[Entry | None]:
        """Charge each frame to its sender's bandwidths; return the one that it does not fit into, or None.

        A sender that is silenced sends nothing, and an oversized frame is not sent.
        """
        if not self._active.get(Bandwidth):
            return [None] * len(sent.frames)
        numbers = zip(sent.origin.tolist(), sent.frames, sent.oversized.tolist(), strict=True)
        return [None if oversized else self._charge_frame(origin, len(frame)) for origin, frame, oversized in numbers]

    def _charge_frame(self, origin: int, size: int) -> Entry | None:
        """Charge a frame to its sender's bandwidths; return the one that it does not fit into, or None."""
        entries = [entry for entry in self._active[Bandwidth] if origin in entry.who]
        # A silenced robot's radio is off, so its frames use up nothing.
        if not entries or any(_is_silenced(entry, origin) for entry in self._active.get(Silence, ())):
            return None
        buckets = [self._bucket_of(entry, origin) for entry in entries]
        for entry, bucket in zip(entries, buckets, strict=True):
            if not bucket.holds(size, self._k):
                return entry
        for bucket in buckets:
            bucket.take(size)
        return None

    def delays(self, origin: int, source: int, destination: int, sequence: int) -> list[tuple[str, float]]:
        """Return the faults that delay a frame on a link: their ids, and how long each delays it, s.

        `source` and `sequence` are the frame's in the journal.
        """
        delays = []
        for entry in (*self._active.get(Delay, ()), *self._active.get(Reorder, ())):
            if not _on_link(entry, origin, destination):
                continue
            drawn_from = (self._seed, Purpose.ETHER, entry.index, source, destination, sequence)
            fault = entry.fault
            if isinstance(fault, Delay):
                delays.append((entry.id, waited(fault.delay, *drawn_from)))
            elif isinstance(fault, Reorder) and draw(*drawn_from) < fault.rate:
                delays.append((entry.id, self._step if fault.hold is None else fault.hold))
        return delays

    def copies(self, origin: int, source: int, destination: int, sequence: int) -> list[tuple[str, float]]:
        """Return the faults that copy a frame on a link: their ids, and by how much each copy is later, s.

        The arguments are those of `delays`.
        """
        copies = []
        for entry in self._active.get(Duplicate, ()):
            drawn_from = (self._seed, Purpose.ETHER, entry.index, source, destination, sequence)
            fault = entry.fault
            if not isinstance(fault, Duplicate) or not _on_link(entry, origin, destination):
                continue
            if draw(*drawn_from) < fault.rate:
                copies.append((entry.id, 0.0 if fault.delay is None else waited(fault.delay, *drawn_from, 1)))
        return copies

    def _is_out_of_reach(self, fault: Range, origin: int, destination: int) -> bool:
        sender, receiver = self._poses[origin], self._poses[destination]
        if math.hypot(sender.x - receiver.x, sender.y - receiver.y) > fault.reach:
            return True
        x, y = self._terrain.origin
        line = (self._opaque, self._terrain.point, x, y, sender.x, sender.y, receiver.x, receiver.y, BEAM)
        return not fault.through_walls and walls_on_line(*line) > 0

    def _is_in_a_burst(self, entry: Entry, rate: float, mean_burst: float, origin: int, destination: int) -> bool:
        key = (entry.index, origin, destination)
        if key not in self._bursts:
            self._bursts[key] = Burst(self._seed, entry, rate, mean_burst, (origin, destination))
        return self._bursts[key].bad(self._k)

    def _bucket_of(self, entry: Entry, number: int) -> Bucket:
        bucket = self._buckets.get((entry.index, number))
        if bucket is None:
            assert isinstance(entry.fault, Bandwidth)
            bucket = Bucket(entry.fault.bytes_per_s, entry.begin, self._step)
            self._buckets[entry.index, number] = bucket
        return bucket


def cause(entry: Entry) -> str:
    """Return the name of a fault that dropped a frame, as in journals."""
    return f"{entry.fault.kind}:{entry.id}"


def _is_silenced(entry: Entry, sender: int) -> bool:
    return isinstance(entry.fault, Silence) and entry.fault.direction in ("out", "both") and sender in entry.who


def _mark_cuts(
    entry: Entry, fault: Partition, origins: NDArray[np.int64], receivers: NDArray[np.int64]
) -> NDArray[np.bool_]:
    """Mark the links that a partition cuts, bool (f, r); a stranger is in every group."""
    receiver_groups = np.array([_group_of(entry.groups, number) for number in receivers.tolist()])
    hit = np.zeros((origins.size, receivers.size), dtype=np.bool_)
    for frame, origin in enumerate(origins.tolist()):
        if origin != STRANGER:
            here = _group_of(entry.groups, origin)
            hit[frame] = here < receiver_groups if fault.direction == "one-way" else here != receiver_groups
    return hit


def _on_link(entry: Entry, origin: int, destination: int) -> bool:
    return origin in entry.sources and destination in entry.targets


def _mark_members(numbers: NDArray[np.int64], members: Collection[int]) -> NDArray[np.bool_]:
    """Mark the numbers that belong to a collection."""
    return np.isin(numbers, np.array(sorted(members), dtype=np.int64))


def _group_of(groups: Sequence[Collection[int]], number: int) -> int:
    return next(index for index, group in enumerate(groups) if number in group)


def receivers(entry: Entry, origin: int, here: frozenset[int]) -> frozenset[int]:
    """Return the robots `here` that a sender's frames reach over the links that a fault acts on.

    The sender itself may be among them. `origin` is the robot whose radio sends, or `STRANGER`.
    """
    match entry.fault:
        case OnLinks() if origin in entry.sources:
            return here.intersection(entry.targets)
        case Range() | Bandwidth() if origin in entry.who:
            return here
        case Silence(direction=direction):
            if origin in entry.who and direction != "in":
                return here
            return here.intersection(entry.who) if direction != "out" else frozenset()
        case Partition(direction=direction):
            places = [index for index, group in enumerate(entry.groups) if origin in group]
            groups = enumerate(entry.groups) if places else ()
            reached_groups = [
                g for index, g in groups if index > places[0] or (index < places[0] and direction == "both")
            ]
            return here.intersection(number for group in reached_groups for number in group)
    return frozenset()
