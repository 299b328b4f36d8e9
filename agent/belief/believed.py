"""The beliefs of one process's robots: the fog, rebuilt from positions alone, and the peers (paper, steps 2 and 3).

Theory of operation
    A fog is that of a group of minds; in a process the group has one member. Where a look makes points fresh, a fog
    follows from the looks that went into it, in any order. So minds that begin with equal fogs and learn of the same
    looks in each tick need one fog, however each of them came to know: by its own sensor, by a frame, by a delayed
    copy. Those that learn of others part with a copy, at that moment. Where a look leaves age, a fog depends on the
    order of the looks, which differs from mind to mind, and each mind is a group of its own.

    The table of inboxes holds the frames that each mind has heard of each robot, and so which looks it learns of.
"""

from __future__ import annotations

import copy
import math
from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from agent.belief.posts import Posts
from patrol.ground.fog import AGELESS, Box, Fog, Looks
from patrol.ground.footprint import Footprint
from patrol.ground.footprint import View as SensorView
from patrol.ground.terrain import BoolGrid
from patrol.pose import Pose
from patrol.radio.inbox import Inboxes, Intake, Peers
from patrol.radio.message import CONTACT, SPAN, Position, RejectReason
from patrol.radio.peers import Peer, Predictor

if TYPE_CHECKING:
    from agent.belief.dilated import Dilated


@dataclass(frozen=True, eq=False)
class Area:
    """The ground of a kind of robot: robots with the same one begin with equal fogs."""

    patrolled: BoolGrid  # the points that the robot patrols
    ground: BoolGrid  # those of them over which staleness spreads
    posts: Posts  # the points on which no body fits, and where to see them from
    dilatation: int  # points, half-width of the window; 0 for no dilatation
    square: bool = False  # True if staleness spreads through walls


class BelievedFog:
    """The fog that the minds of a group believe in, with dilatation.

    Staleness spreads over the points on which these robots can stand, so it never crosses a wall, nor a gap too narrow
    for the body. Stale points on which no body fits count at their post first, the place to see them from.

    `members` has the robots' numbers. `fog` is the fog before dilatation. `looked`, int32 (h, w), is the tick at which
    each point was last in view; it is the fog's own grid where a look makes a point fresh.
    """

    def __init__(self, area: Area, footprint: Footprint) -> None:
        """Start with nothing seen and no members."""
        self.members: set[int] = set()
        self.fog = Fog(area.patrolled)
        # Paths may lead over such points, which must not pull.
        self.fog.last_seen[~area.patrolled] = AGELESS
        self._area = area
        self._footprint = footprint
        self.looked = self.fog.last_seen.copy() if footprint.leaves_age else self.fog.last_seen
        self._tick = 0
        self._dilated: Dilated | None = None
        self._spread(area.ground, area.posts)

    def _spread(self, ground: BoolGrid, posts: Posts) -> None:
        """Begin to spread staleness over some ground, if it spreads at all."""
        if self._area.dilatation > 0:
            from agent.belief.dilated import Dilated  # here, as most robots do without its kernels

            self._dilated = Dilated(self.fog, ground, posts, self._area.dilatation, square=self._area.square)

    def leave_out(self, points: BoolGrid | None, posts: Posts) -> None:
        """Spread no staleness of some points, and that of others by other posts; None for no points."""
        self._spread(self._area.ground if points is None else self._area.ground & ~points, posts)
        height, width = self.looked.shape
        self._note_changes([(0, height - 1, 0, width - 1)], self._tick)

    def fork(self) -> BelievedFog:
        """Return the same fog with its own grids, for others."""
        fork = copy.copy(self)
        fork.members = set()
        fork.fog = self.fog.fork()
        fork.looked = fork.fog.last_seen
        fork._dilated = None if self._dilated is None else self._dilated.fork(fork.fog)
        return fork

    def see(self, looks: Iterable[tuple[int, Pose]], tick: int) -> None:
        """Take in looks, tick and pose of each, one after the other; `tick` is now."""
        self.take(((looked_at, self._footprint.visible(pose)) for looked_at, pose in looks), tick)

    def take(self, views: Iterable[tuple[int, SensorView]], tick: int) -> None:
        """Take in some views, tick and points of each view, one view after the other; `tick` is now."""
        boxes = []
        for looked_at, view in views:
            if self._footprint.leaves_age:
                view.mark(self.looked, looked_at)
            self.fog.observe(view, looked_at)
            boxes.append(view.box(self.looked.shape))
        self._note_changes(boxes, tick)

    def see_some(self, looks: Looks, chosen: NDArray[np.uint8], tick: int) -> None:
        """Take in those of many looks for which `chosen` is not 0; looks must leave no age."""
        self.fog.observe_each(looks, chosen)
        places = [] if self._dilated is None else np.flatnonzero(chosen).tolist()
        self._note_changes([looks.views[look].box(self.looked.shape) for look in places], tick)

    def dilated_within(self, box: Box) -> NDArray[np.int32]:
        """Return the fog after dilatation, up to date in a box: it is computed only where it is read.

        It is int32 (h, w), the tick at which each point was last seen; without dilatation the fog's own grid. Points
        outside the box may be out of date. The box may reach beyond the ground.
        """
        return self.fog.last_seen if self._dilated is None else self._dilated.within(box, self._tick)

    def refresh(self) -> NDArray[np.int32]:
        """Bring all of the dilated fog up to date, and return it as `dilated_within` does."""
        height, width = self.fog.last_seen.shape
        return self.dilated_within((0, height - 1, 0, width - 1))

    def _note_changes(self, boxes: Iterable[Box | None], tick: int) -> None:
        self._tick = tick
        if self._dilated is not None:
            self._dilated.changed([box for box in boxes if box is not None])


class Belief:
    """The belief of one mind: its group's fog, its peers, and intruders."""

    def __init__(self, number: int, beliefs: Beliefs, shared: BelievedFog) -> None:
        """Join a group that shares a fog."""
        self.number = number
        self.contacts = Contacts()
        self.shared = shared
        self._beliefs = beliefs
        self.peers = beliefs.inboxes.peers(number)

    def hear(self, tick: int, own: Pose, frames: Sequence[bytes]) -> None:
        """Take in a tick for this mind alone.

        `own` is the robot's pose as encoded on the wire, `frames` are in the order in which they reach it.
        """
        self._beliefs.hear(tick, {self.number: own}, {self.number: frames})

    @property
    def fog(self) -> Fog:
        """The fog before dilatation."""
        return self.shared.fog

    @property
    def looked(self) -> NDArray[np.int32]:
        """int32 (h, w), the tick at which each point was last in view."""
        return self.shared.looked

    @property
    def dilated(self) -> NDArray[np.int32]:
        """int32 (h, w), the tick at which each point was last seen, after dilatation."""
        return self.shared.refresh()

    def dilated_within(self, box: Box) -> NDArray[np.int32]:
        """`dilated`, up to date in a box only."""
        return self.shared.dilated_within(box)

    @property
    def refused(self) -> Mapping[RejectReason, int]:
        """Number of frames that the robot has refused so far, by reason."""
        return self._beliefs.inboxes.counts(self.number)

    @property
    def rejected(self) -> int:
        """Number of frames that the robot has refused so far."""
        return self._beliefs.inboxes.rejected(self.number)

    def peers_at(self, tick: int, predictor: Predictor | None) -> Mapping[int, Peer]:
        """Return the peers by number where they should be by now.

        Without `predictor` that is where they were heard last, moved on by the time that their frames took.
        """
        peers = self.peers
        if predictor is not None:
            return {
                number: replace(peer, pose=predictor.pose(peers.said(number), tick - peer.sequence))
                for number, peer in peers.items()
            }
        if not peers.is_late:
            return peers
        ahead = self._beliefs.straight_on
        return {
            number: replace(peer, pose=ahead.pose(peers.moving(number), peer.tick - peer.sequence))
            for number, peer in peers.items()
        }

    def stopped(self, number: int) -> Pose:
        """Return where a robot has stopped that is not heard any more: a step after its last position."""
        return self._beliefs.straight_on.pose(self.peers.moving(number), 1)

    def leave_out(self, points: BoolGrid | None, posts: Posts) -> None:
        """Spread no staleness of some points, and that of others by other posts; None for no points.

        Others may believe other points left out, so the mind parts with its group.
        """
        if len(self.shared.members) > 1:
            self.shared.members.discard(self.number)
            self.shared = self.shared.fork()
            self.shared.members.add(self.number)
        self.shared.leave_out(points, posts)

    def lately(self, peers: Mapping[int, Peer], since: int) -> Mapping[int, Peer]:
        """Return those of some peers that were heard at a tick or later."""
        if isinstance(peers, Peers):
            return peers.lately(since)
        return {number: peer for number, peer in peers.items() if peer.tick >= since}


class Beliefs:
    """The beliefs of all minds of a process."""

    def __init__(self, inboxes: Inboxes, footprint: Footprint, *, shares: bool = False) -> None:
        """Start without minds; `shares` lets them share a fog, where a look leaves no age."""
        self.inboxes = inboxes
        self.shares = shares and not footprint.leaves_age
        self.straight_on = Predictor(footprint.terrain, 1, SPAN)
        self._footprint = footprint
        self._minds: dict[int, Belief] = {}
        self._blank: dict[Area, BelievedFog] = {}

    def join(self, number: int, area: Area) -> Belief:
        """Make a belief for a mind that begins, in the place of the robot's mind before it."""
        self.leave(number)
        self.inboxes.clear(number)
        fog = self._blank.get(area) or BelievedFog(area, self._footprint)
        if self.shares:
            self._blank[area] = fog
        fog.members.add(number)
        mind = self._minds[number] = Belief(number, self, fog)
        return mind

    def leave(self, number: int) -> None:
        """Drop a mind with its belief."""
        mind = self._minds.pop(number, None)
        if mind is not None:
            mind.shared.members.discard(number)

    def hear(self, tick: int, own: Mapping[int, Pose], heard: Mapping[int, Sequence[bytes]]) -> None:
        """Take in a tick for all minds that take part in it, those in `heard`.

        `own` has, by number, where each takes itself to be, as encoded on the wire; `heard` the frames that reach each,
        in their order.
        """
        # Once a tick has been heard, a fog is blank no longer, so minds that begin later get one of their own.
        self._blank.clear()
        if not heard:
            return
        intake = self.inboxes.hear(tick, heard)
        minds = {number: self._minds[number] for number in heard}
        if any(position is not None and position.robot == CONTACT for position in intake.said):
            for number, mind in minds.items():
                for position in intake.positions(number):
                    if position.robot == CONTACT:
                        mind.contacts.report(position, tick)
        if self._footprint.leaves_age:
            for number, mind in minds.items():
                mind.shared.see([(tick, own[number]), *intake.looks(number)], tick)
            return
        looks, chosen = _side_by_side(intake, [own[number] for number in minds], self._footprint)
        # As bytes, which can be a key: minds that have learnt of the same looks stay together.
        learnt = {number: row.tobytes() for number, row in zip(minds, chosen, strict=True)}
        for fog in {id(mind.shared): mind.shared for mind in minds.values()}.values():
            for part, chosen_looks in self._part_group(fog, learnt):
                part.see_some(looks, np.frombuffer(chosen_looks, dtype=np.uint8), tick)

    def _part_group(self, fog: BelievedFog, learnt: Mapping[int, bytes]) -> list[tuple[BelievedFog, bytes]]:
        """Part a group by the looks that its minds have learnt; minds without part in the tick keep their belief."""
        parts: dict[bytes | None, set[int]] = defaultdict(set)
        for number in fog.members:
            parts[learnt.get(number)].add(number)
        # The largest part keeps the fog, so that the fewest minds pay for a copy; ties go to the lowest number.
        largest = max(parts.values(), key=lambda members: (len(members), -min(members)))
        groups = []
        for learnt_looks, members in parts.items():
            part = fog if members is largest else fog.fork()
            for number in members:
                self._minds[number].shared = part
            groups.append((part, members, learnt_looks))
        for part, members, _ in groups:
            part.members = members
        return [(part, learnt_looks) for part, _, learnt_looks in groups if learnt_looks is not None]


def _side_by_side(intake: Intake, own: Sequence[Pose], footprint: Footprint) -> tuple[Looks, NDArray[np.uint8]]:
    """Return all looks of a tick, each once, and which of them each mind learns of, uint8 (minds, looks)."""
    places: dict[tuple[int, Pose], int] = {}

    def place(tick: int, pose: Pose) -> int:
        return places.setdefault((tick, pose), len(places))

    columns = np.flatnonzero(intake.plain.any(axis=0)).tolist()
    numbers = [place(intake.tick, position.pose) for sender in columns if (position := intake.said[sender]) is not None]
    mine = [place(intake.tick, pose) for pose in own]
    past = [(row, place(tick, pose)) for row, _, tick, pose in intake.past]
    chosen = np.zeros((len(own), len(places)), dtype=np.uint8)
    # Nearly always: one assignment for all columns. Two frames with one pose share a look and are joined below.
    if len(set(numbers)) == len(numbers):
        chosen[:, numbers] = intake.plain[:, columns]
    else:
        for look, column in zip(numbers, columns, strict=True):
            chosen[:, look] |= intake.plain[:, column]
    chosen[np.arange(len(own)), mine] = 1
    for row, look in past:
        chosen[row, look] = 1
    return Looks([(tick, footprint.visible(pose)) for tick, pose in places]), chosen


SAME = 2.0
"""Two reports closer together than this (m) are of the same intruder."""

Place = tuple[float, float]
"""x and y in m."""


class Contacts:
    """The last report of each intruder."""

    def __init__(self) -> None:
        self._seen: dict[Place, int] = {}

    def report(self, contact: Position, tick: int) -> None:
        """Take in a report and forget earlier reports of the same intruder.

        For example, reports at (1, 1) and (2, 1) in two ticks are of one intruder, which is at (2, 1) then.
        """
        spot = contact.pose.x, contact.pose.y
        self._seen = {earlier: k for earlier, k in self._seen.items() if k == tick or math.dist(earlier, spot) >= SAME}
        # Several robots report the same intruder in a tick; the first report counts.
        if all(math.dist(earlier, spot) >= SAME for earlier in self._seen):
            self._seen[spot] = tick

    def known(self, tick: int, memory: int) -> list[Place]:
        """Return the places of the intruders reported within the last `memory` ticks, ascending."""
        if not self._seen:
            return []
        self._seen = {spot: k for spot, k in self._seen.items() if tick - k <= memory}
        return sorted(self._seen)
