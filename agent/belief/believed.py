"""What one robot believes: the fog, rebuilt from positions alone, and the peers' poses (paper, steps 2 and 3)."""

from __future__ import annotations

import copy
from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from agent.belief.contacts import Contacts
from agent.belief.posts import Posts
from agent.routes.ground import Disc
from patrol.ground.fog import Box, Fog, Looks
from patrol.ground.footprint import Footprint
from patrol.ground.terrain import BoolGrid
from patrol.pose import Pose
from patrol.radio.inbox import Inbox
from patrol.radio.message import CONTACT
from patrol.radio.peers import Peer, PeerTracker
from patrol.radio.prediction import Predictor

if TYPE_CHECKING:
    from agent.belief.dilated import Dilated


def spreads(posts: Posts, dilatation: int) -> bool:
    """Whether a belief has dilated ticks of its own.

    Without posts, paths lead over every point, so points that are not ground must not pull.

    Args:
        posts: The points on which no body fits.
        dilatation: Half-width of the window in points.
    """
    return dilatation > 0 or not len(posts.rows)


class Belief:
    """The believed fog of the points this robot can see, with dilatation, and its peers.

    Staleness spreads over the points on which this robot can stand, so it never crosses a wall, nor a gap too narrow
    for the body. Stale points on which no body fits count at their post first, the place to see them from.

    Attributes:
        fog: The fog before dilatation.
        looked: int32 (h, w), the tick at which each point was last in view; the fog's own grid where a look makes a
            point fresh.
        peers: The robots heard so far, by number.
        contacts: The intruders reported by this robot and by others.
        inbox: Accepts or rejects the frames heard.
    """

    def __init__(
        self,
        patrolled: BoolGrid,
        ground: BoolGrid,
        posts: Posts,
        footprint: Footprint,
        inbox: Inbox,
        dilatation: int,
        fog: Fog | None = None,
    ) -> None:
        """Start with nothing seen and no peer heard.

        Args:
            patrolled: bool (h, w), the points this robot can see.
            ground: bool (h, w), the points over which staleness spreads.
            posts: The points on which no body fits, and where to see them from.
            footprint: What the sensor sees from a pose.
            inbox: Judges the frames heard.
            dilatation: Half-width of the window in points; 0 for no dilatation.
            fog: Nothing seen of the same points; made unless given.
        """
        self.fog = fog or Fog(patrolled)
        self.inbox = inbox
        self._tracker = PeerTracker(inbox.trail_every)
        self.peers = self._tracker.peers
        self.contacts = Contacts()
        self._footprint = footprint
        self.looked = self.fog.last_seen.copy() if footprint.leaves_age else self.fog.last_seen
        self._tick = 0
        self._dilated: Dilated | None = None
        if spreads(posts, dilatation):
            from agent.belief.dilated import Dilated  # here, as most robots do without its kernels

            self._dilated = Dilated(self.fog, ground, posts, dilatation)

    def update(self, tick: int, own: Pose, frames: Iterable[bytes], step: float) -> None:
        """Take in the robot's own pose and the frames heard.

        `patrol.radio.peers` says which looks follow from a position.

        Args:
            tick: Now.
            own: The robot's own pose, as encoded on the wire.
            frames: The frames heard at this tick.
            step: s per tick.
        """
        self._tick = tick
        boxes = [self._look(own, tick)]
        for frame in frames:
            position = self.inbox.accept(frame, tick * step)
            if position is not None and position.robot == CONTACT:
                self.contacts.report(position, tick)
            elif position is not None:
                looks = self._tracker.hear(position, tick)
                boxes += [self._look(pose, at) for at, pose in looks]
        self._changed(boxes)

    def see(self, looks: Iterable[tuple[int, Pose]], tick: int) -> None:
        """Take in looks that are new.

        Args:
            looks: Tick and pose of each.
            tick: Now.
        """
        self._tick = tick
        self._changed([self._look(pose, at) for at, pose in looks])

    def see_some(self, looks: Looks, chosen: NDArray[np.uint8], tick: int) -> None:
        """Take in some of many looks.

        Args:
            looks: They are all of the belief's sensor.
            chosen: uint8, for each of them, not 0 for those to take in.
            tick: Now.
        """
        self._tick = tick
        self.fog.observe_each(looks, chosen)
        if self._dilated is not None:
            shape = self.looked.shape
            self._changed([looks.views[place].box(shape) for place in np.flatnonzero(chosen).tolist()])

    def fork(self) -> Belief:
        """Another belief in the same fog, with its own grids; inbox, peers and contacts stay the same ones."""
        other = copy.copy(self)
        other.fog = self.fog.fork()
        other.looked = self.looked.copy() if self._footprint.leaves_age else other.fog.last_seen
        other._dilated = None if self._dilated is None else self._dilated.fork(other.fog)
        return other

    @property
    def dilated(self) -> NDArray[np.int32]:
        """int32 (h, w), the tick at which each point was last seen, after dilatation (`dilated_within`)."""
        return self.refresh()

    def refresh(self) -> NDArray[np.int32]:
        """Bring all of `dilated` up to date; until the next look, several threads may then read it at once.

        Returns:
            int32 (h, w), as `dilated_within`.
        """
        height, width = self.fog.last_seen.shape
        return self.dilated_within((0, height - 1, 0, width - 1))

    def dilated_within(self, box: Box) -> NDArray[np.int32]:
        """The fog after dilatation, up to date in a box: it is computed only where it is read.

        Args:
            box: The points that are going to be read; it may reach beyond the ground.

        Returns:
            int32 (h, w), the tick at which each point was last seen; without dilatation the fog's own grid. Points
            outside the box may be out of date.
        """
        return self.fog.last_seen if self._dilated is None else self._dilated.within(box, self._tick)

    def lately(self, peers: Mapping[int, Peer], since: int) -> Mapping[int, Peer]:
        """Those of some peers that were heard at a tick or later.

        Args:
            peers: From `peers_at`.
            since: The tick.
        """
        return {number: peer for number, peer in peers.items() if peer.tick >= since}

    def _changed(self, boxes: Iterable[Box | None]) -> None:
        if self._dilated is not None:
            self._dilated.changed([box for box in boxes if box is not None])

    def _look(self, pose: Pose, tick: int) -> Box | None:
        view = self._footprint.visible(pose)
        if self._footprint.leaves_age:
            view.mark(self.looked, tick)
        self.fog.observe(view, tick)
        return view.box(self.looked.shape)

    def peers_at(self, tick: int, predictor: Predictor | None) -> Mapping[int, Peer]:
        """The peers where they should be by now.

        Args:
            tick: Now.
            predictor: What the fleet's robots predict each other by; None where they do not.

        Returns:
            By number; as heard last where there is no prediction.
        """
        if predictor is None:
            return self.peers
        said = self._tracker.said
        return {
            number: replace(peer, pose=predictor.pose(said[number], tick - peer.sequence))
            for number, peer in self.peers.items()
        }

    def silent(self, tick: int, patience: int, radii: Mapping[int, float], margin: float) -> list[Disc]:
        """Discs around the last poses of silent peers.

        A robot that has died is still in the way. Nothing else is assumed about a silent one.

        Args:
            tick: Now.
            patience: Ticks after which an unheard peer counts as silent.
            radii: Radius in m of each robot, by number.
            margin: Added to each radius, m.

        Returns:
            Discs (x, y, radius) in m, by robot number.
        """
        return [
            (peer.pose.x, peer.pose.y, radii[number] + margin)
            for number, peer in sorted(self.peers.items())
            if tick - peer.tick > patience
        ]
