"""What one robot believes: the fog, rebuilt from positions alone, and the peers' poses (paper, steps 2 and 3)."""

from __future__ import annotations

import copy
from collections.abc import Iterable, Mapping
from dataclasses import replace

import numpy as np

from agent.belief.contacts import Contacts
from agent.belief.kernels.dilate import carry, dilate
from agent.belief.posts import Posts
from agent.routes.ground import Disc
from patrol.ground.fog import Box, Fog
from patrol.ground.footprint import Footprint
from patrol.ground.terrain import BoolGrid
from patrol.pose import Pose
from patrol.radio.inbox import Inbox
from patrol.radio.message import CONTACT
from patrol.radio.peers import Peer, PeerTracker
from patrol.radio.prediction import Predictor


def spreads(posts: Posts, dilatation: int) -> bool:
    """Whether a belief has dilated ticks of its own.

    Without posts, paths lead over every point, so points that are not ground must not pull.

    Args:
        posts: The points on which no body fits.
        dilatation: Half-width of the window in points.
    """
    return dilatation > 0 or not len(posts.rows)


AGELESS = 2**31 - 1
"""Dilated last-seen tick of points that are not ground; such points have no age."""


class Belief:
    """The believed fog of the points this robot can see, with dilatation, and its peers.

    Staleness spreads over the points on which this robot can stand, so it never crosses a wall, nor a gap too narrow
    for the body. Stale points on which no body fits count at their post first, the place to see them from.

    Attributes:
        fog: The fog before dilatation.
        dilated: int32 (h, w), the tick at which each point was last seen, after dilatation; without dilatation the
            fog's own grid.
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
        self._posts = posts
        self.looked = self.fog.last_seen.copy() if footprint.leaves_age else self.fog.last_seen
        self._ground = np.ascontiguousarray(ground).view(np.uint8)
        self._dilatation = dilatation
        self._carried = self.dilated = self.fog.last_seen
        self.spreads = spreads(posts, dilatation)
        if self.spreads:
            self._carried = self.fog.last_seen.copy()
            self.dilated = np.full_like(self.fog.last_seen, AGELESS)
            height, width = self.dilated.shape
            self._refresh((0, height - 1, 0, width - 1), 0)

    def update(self, tick: int, own: Pose, frames: Iterable[bytes], step: float) -> None:
        """Take in the robot's own pose and the frames heard.

        `patrol.radio.peers` says which looks follow from a position.

        Args:
            tick: Now.
            own: The robot's own pose, as encoded on the wire.
            frames: The frames heard at this tick.
            step: s per tick.
        """
        boxes = [self._look(own, tick)]
        for frame in frames:
            position = self.inbox.accept(frame, tick * step)
            if position is not None and position.robot == CONTACT:
                self.contacts.report(position, tick)
            elif position is not None:
                looks = self._tracker.hear(position, tick)
                boxes += [self._look(pose, at) for at, pose in looks]
        self._spread(boxes, tick)

    def see(self, looks: Iterable[tuple[int, Pose]], tick: int) -> None:
        """Take in looks that are new.

        Args:
            looks: Tick and pose of each.
            tick: Now.
        """
        self._spread([self._look(pose, at) for at, pose in looks], tick)

    def fork(self) -> Belief:
        """Another belief in the same fog, with its own grids; inbox, peers and contacts stay the same ones."""
        other = copy.copy(self)
        other.fog = self.fog.fork()
        other.looked = self.looked.copy() if self._footprint.leaves_age else other.fog.last_seen
        other._carried = other.dilated = other.fog.last_seen
        if self.spreads:
            other._carried, other.dilated = self._carried.copy(), self.dilated.copy()
        return other

    def lately(self, peers: Mapping[int, Peer], since: int) -> Mapping[int, Peer]:
        """Those of some peers that were heard at a tick or later.

        Args:
            peers: From `peers_at`.
            since: The tick.
        """
        return {number: peer for number, peer in peers.items() if peer.tick >= since}

    def _spread(self, boxes: Iterable[Box | None], tick: int) -> None:
        for box in boxes:
            if box is not None and self.spreads:
                self._refresh(box, tick)

    def _look(self, pose: Pose, tick: int) -> Box | None:
        view = self._footprint.visible(pose)
        if self._footprint.leaves_age:
            view.mark(self.looked, tick)
        return self.fog.observe(view, tick)

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

    def _refresh(self, box: Box, tick: int) -> None:
        """Dilate anew wherever a point of ``box``, or a post that sees one, is within the window."""
        top, bottom, left, right = box
        changed = (slice(top, bottom + 1), slice(left, right + 1))
        self._carried[changed] = self.fog.last_seen[changed]
        wide = np.array(box, dtype=np.int64)
        posts = self._posts.between(top - self._posts.gap, bottom + self._posts.gap)
        carry(posts, self.fog.last_seen, self._carried, wide)
        top, bottom, left, right = (int(edge) for edge in wide)
        margin = self._dilatation
        around = (top - margin, bottom + margin, left - margin, right + margin)
        dilate(self._carried, self._ground, self._ground, self.dilated, *around, margin, tick)
