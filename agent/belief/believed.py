"""What one robot believes: the fog, rebuilt from positions alone, and where the others are (paper, steps 2 and 3)."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

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
from patrol.radio.peers import PeerTracker

AGELESS = 2**31 - 1
"""Dilated last-seen tick of what is no ground: nothing there has an age."""


class Belief:
    """The believed fog of the points this robot could see, with dilatation, and its peers.

    dilated: int32 (h, w), the tick at which each point was last seen, made worse by dilatation; without any, the
    fog's own.

    looked: int32 (h, w), the tick at which each point was last in view; the fog's own where a look makes a point fresh.

    Staleness spreads over the points where this robot can stand, so it never crosses a wall nor a gap too narrow for
    the body. What is stale where no body fits first counts at its post, the place to see it from.

    contacts: the intruders that others report, and those that the robot itself does.
    """

    def __init__(
        self, patrolled: BoolGrid, ground: BoolGrid, posts: Posts, footprint: Footprint, inbox: Inbox, dilatation: int
    ) -> None:
        """patrolled: bool (h, w), what this robot could see. ground: bool (h, w), what staleness spreads over.

        dilatation: half-width of the window, points; 0 for none.
        """
        self.fog = Fog(patrolled)
        self.inbox = inbox
        self._tracker = PeerTracker()
        self.peers = self._tracker.peers
        self.contacts = Contacts()
        self._footprint = footprint
        self._posts = posts
        self.looked = self.fog.last_seen.copy() if footprint.leaves_age else self.fog.last_seen
        self._ground = np.ascontiguousarray(ground).view(np.uint8)
        self._dilatation = dilatation
        self._carried = self.fog.last_seen.copy()
        self.dilated = self.fog.last_seen
        # Without posts, what is no ground must not pull: such paths lead over everything.
        self._spreads = dilatation > 0 or not len(posts.rows)
        if self._spreads:
            self.dilated = np.full_like(self.fog.last_seen, AGELESS)
            height, width = self.dilated.shape
            self._refresh((0, height - 1, 0, width - 1), 0)

    def update(self, tick: int, own: Pose, frames: Iterable[bytes], step: float) -> None:
        """Take in the own pose (as encoded on the wire) and what was heard at ``tick``; ``step`` in s.

        What a position tells of is said in `patrol.radio.peers`.
        """
        boxes = [self._look(own, tick)]
        for frame in frames:
            position = self.inbox.accept(frame, tick * step)
            if position is not None and position.robot == CONTACT:
                self.contacts.report(position, tick)
            elif position is not None:
                looks = self._tracker.hear(position, tick)
                boxes += [self._look(pose, at) for at, pose in looks]
        for box in boxes:
            if box is not None and self._spreads:
                self._refresh(box, tick)

    def _look(self, pose: Pose, tick: int) -> Box | None:
        view = self._footprint.visible(pose)
        if self._footprint.leaves_age:
            view.mark(self.looked, tick)
        return self.fog.observe(view, tick)

    def silent(self, tick: int, patience: int, radii: Mapping[int, float], margin: float) -> list[Disc]:
        """The last places of peers unheard for more than ``patience`` ticks, with their radius plus ``margin`` (m).

        A dead robot is still in the way; nothing else is believed of a silent one.
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
