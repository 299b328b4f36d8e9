"""One belief for many: minds of one process whose fogs are equal share one, until they learn of different looks.

Where a look makes points fresh, a fog follows from the looks that went into it, in any order. So minds that shared a
fog and learn of the same looks in a tick share it still, however each of them came to know: by its own sensor, by a
frame, by a delayed copy. Those that learn of others part with a copy, at that moment.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from agent.belief.believed import Belief
from agent.belief.contacts import Contacts
from agent.belief.kernels.heard import heard_places
from agent.routes.ground import Disc
from patrol.ground.fog import Box, Fog, Looks
from patrol.ground.footprint import Footprint
from patrol.pose import Pose
from patrol.radio.ears import NOTHING, Ear, Ears, Learnt
from patrol.radio.inbox import Inbox
from patrol.radio.message import CONTACT
from patrol.radio.peers import Peer, PeerTracker
from patrol.radio.prediction import Predictor
from patrol.radio.units import CM_PER_M

_Looks = tuple[bytes, frozenset[tuple[int, Pose]]]
"""What a mind has learnt in a tick: which of the tick's looks, and which others."""


@dataclass(slots=True, eq=False)
class _Group:
    """Minds that believe in the same fog."""

    belief: Belief
    members: set[int] = field(default_factory=set)


class HeardPeers(Mapping[int, Peer]):
    """The robots that one listener has heard of, by number, as far as they were heard at some tick or later."""

    def __init__(self, ears: Ears, row: int, since: int = 0) -> None:
        self._ears = ears
        self._row = row
        self._since = since

    def __getitem__(self, number: int) -> Peer:
        column = self._ears.row_of(number)
        if not self._known[column]:
            raise KeyError(number)
        return self._ears.peer(self._row, column)

    def __iter__(self) -> Iterator[int]:
        return iter([self._ears.numbers[column] for column in np.flatnonzero(self._known).tolist()])

    def __len__(self) -> int:
        return int(np.count_nonzero(self._known))

    @property
    def places(self) -> NDArray[np.float64]:
        """float64 (len, 2), x and y of each in m, by number."""
        ears = self._ears
        found = np.empty((len(ears.numbers), 2), dtype=np.float64)
        tables = ears.sequence, ears.at, ears.x, ears.y
        count = heard_places(*tables, self._row, NOTHING, self._since, CM_PER_M, found)
        return found[:count]

    @property
    def _known(self) -> NDArray[np.bool_]:
        heard: NDArray[np.bool_] = self._ears.sequence[self._row] != NOTHING
        return heard if self._since <= 0 else heard & (self._ears.at[self._row] >= self._since)


class SharedBelief:
    """What one mind believes, as `agent.belief.believed.Belief`; its company takes in for it what it hears.

    Attributes:
        contacts: The intruders reported by this robot and by others.
        inbox: Counts the frames that it has refused.
        peers: The robots heard so far, by number.
    """

    def __init__(self, ears: Ears, ear: Ear, group: _Group) -> None:
        self._ears = ears
        self.ear = ear
        self.group = group
        self.contacts = Contacts()
        self.inbox = ear.inbox
        self.peers = HeardPeers(ears, ear.row)
        self._heard_since = 0

    @property
    def fog(self) -> Fog:
        """The fog before dilatation."""
        return self.group.belief.fog

    @property
    def dilated(self) -> NDArray[np.int32]:
        """As of `Belief`."""
        return self.group.belief.dilated

    def dilated_within(self, box: Box) -> NDArray[np.int32]:
        """As of `Belief`."""
        return self.group.belief.dilated_within(box)

    @property
    def looked(self) -> NDArray[np.int32]:
        """As of `Belief`."""
        return self.group.belief.looked

    def update(self, tick: int, own: Pose, frames: Sequence[bytes], step: float) -> None:
        """Not for one alone: `Company.hear` takes in a tick for all."""
        raise NotImplementedError("this mind hears with its company")

    def peers_at(self, tick: int, predictor: Predictor | None) -> Mapping[int, Peer]:
        """The peers as heard last; nobody predicts in a company."""
        del tick, predictor
        return self.peers

    def lately(self, peers: Mapping[int, Peer], since: int) -> Mapping[int, Peer]:
        """As of `Belief`."""
        del peers
        return HeardPeers(self._ears, self.ear.row, since)

    def silent(self, tick: int, patience: int, radii: Mapping[int, float], margin: float) -> list[Disc]:
        """As of `Belief`."""
        if tick - self._heard_since <= patience:
            return []
        row, ears = self.ear.row, self._ears
        heard = np.flatnonzero(ears.sequence[row] != NOTHING)
        at = ears.at[row].take(heard)
        # Whoever is heard again, or for the first time, is heard later than now.
        self._heard_since = int(at.min(initial=tick))
        found = []
        for column in heard[tick - at > patience].tolist():
            pose = ears.peer(row, column).pose
            found.append((pose.x, pose.y, radii[ears.numbers[column]] + margin))
        return found


class Company:
    """All minds of one process, and what they believe in groups."""

    def __init__(
        self, numbers: Sequence[int], step: float, speed: float, footprint: Footprint, *, at_once: bool = False
    ) -> None:
        """Nobody has joined yet.

        Args:
            numbers: Of all robots.
            step: s per tick.
            speed: Of the fastest robot, m/s.
            footprint: What the sensor sees from a pose; a look leaves no age.
            at_once: Whether minds decide at once in several threads, so that what they share must be up to date before.
        """
        if footprint.leaves_age:
            raise ValueError("looks that leave age depend on their order, which differs from mind to mind")
        self._ears = Ears(numbers, step, speed)
        self._footprint = footprint
        self._at_once = at_once
        self._minds: dict[int, SharedBelief] = {}
        self._blank: dict[object, _Group] = {}

    def join(self, number: int, inbox: Inbox, blank: Callable[[], Belief], kind: object) -> SharedBelief:
        """A belief for a mind that begins, in the place of the robot's mind before it.

        Args:
            number: Of the robot.
            inbox: Its own.
            blank: Makes a belief in which nothing was seen.
            kind: Minds of equal kinds begin with equal beliefs.
        """
        self.leave(number)
        row = self._ears.row_of(number)
        self._ears.clear(row)
        ear = Ear(row, inbox, PeerTracker(inbox.trail_every))
        if kind not in self._blank:
            self._blank[kind] = _Group(blank())
        group = self._blank[kind]
        group.members.add(number)
        mind = self._minds[number] = SharedBelief(self._ears, ear, group)
        return mind

    def leave(self, number: int) -> None:
        """A mind is gone, with all that it knew.

        Args:
            number: Of its robot.
        """
        mind = self._minds.pop(number, None)
        if mind is not None:
            mind.group.members.discard(number)

    def hear(self, tick: int, own: Mapping[int, Pose], heard: Mapping[int, Sequence[bytes]]) -> None:
        """Take in a tick for all minds that take part in it.

        Args:
            tick: Now.
            own: Where each takes itself to be, as encoded on the wire, by number.
            heard: The frames that reach each of them, in their order.
        """
        self._blank.clear()
        minds = {number: self._minds[number] for number in heard}
        learnt = self._ears.listen(tick, {number: mind.ear for number, mind in minds.items()}, heard)
        for number, accepted in learnt.accepted.items():
            for position in accepted:
                if position.robot == CONTACT:
                    minds[number].contacts.report(position, tick)
        looks = _Tick(tick, learnt, {number: own[number] for number in minds}, self._footprint)
        groups = {id(mind.group): mind.group for mind in minds.values()}
        for group in groups.values():
            for part, what in self._parted(group, looks):
                looks.show(part.belief, what)
                if self._at_once and len(part.members) > 1:
                    part.belief.refresh()

    def _parted(self, group: _Group, looks: _Tick) -> list[tuple[_Group, _Looks]]:
        """A group's minds that take part in a tick, by what they learn; those that do not keep what they believe."""
        parts: dict[_Looks | None, set[int]] = defaultdict(set)
        for number in group.members:
            parts[looks.of.get(number)].add(number)
        largest = max(parts.values(), key=lambda members: (len(members), -min(members)))
        found = []
        for what, members in parts.items():
            part = group
            if members is not largest:
                part = _Group(group.belief.fork())
                for number in members:
                    self._minds[number].group = part
            if what is not None:
                found.append((part, what))
        for members in parts.values():
            part = self._minds[min(members)].group
            part.members = members
        return found


class _Tick:
    """The looks of one tick.

    Attributes:
        of: What each mind that takes part has learnt.
    """

    def __init__(self, tick: int, learnt: Learnt, own: Mapping[int, Pose], footprint: Footprint) -> None:
        self._tick = tick
        poses, knows = [said.pose for said in learnt.said], learnt.knows
        place = {said.robot: at for at, said in enumerate(learnt.said)}
        own_place: list[int] = []
        for number, pose in own.items():
            at = place.get(number)
            if at is None or poses[at] != pose:
                at = len(poses)
                poses.append(pose)
            own_place.append(at)
        wide = np.zeros((len(own), len(poses)), dtype=np.uint8)
        wide[:, : knows.shape[1]] = knows
        wide[np.arange(len(own)), own_place] = 1
        self._looks = Looks([(tick, footprint.visible(pose)) for pose in poses])
        more = {number: frozenset(learnt.more.get(number, ())) for number in own}
        self.of: dict[int, _Looks] = {number: (wide[row].tobytes(), more[number]) for row, number in enumerate(own)}

    def show(self, belief: Belief, what: _Looks) -> None:
        """Let a belief take in looks."""
        belief.see_some(self._looks, np.frombuffer(what[0], dtype=np.uint8), self._tick)
        belief.see(what[1], self._tick)
        belief.fog.mfow(self._tick)  # found now, so that minds that decide at once in several threads only read
