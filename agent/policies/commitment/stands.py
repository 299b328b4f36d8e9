"""The places from which a robot sees the points of a round."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from agent.policies.commitment.given_up import GivenUp
    from agent.ports import PolicySetup
    from agent.view import View
    from patrol.ground.tour.round import Round

Flat = NDArray[np.int64]


class RoundStands:
    """The stands of one robot for the points of a round.

    A point is seen from its place on the round. Where that is given up, or no way leads there now, it may be seen from
    the point itself, or from its post where no body fits.
    """

    def __init__(self, setup: PolicySetup, laid_out: Round) -> None:
        """Find the point itself, or its post, for each point of the round."""
        points = laid_out.points
        own = np.where(setup.fields.reach.reshape(-1)[points], points, setup.fields.proxy.reshape(-1)[points])
        self._round = laid_out
        self._own = np.where(own >= 0, own, laid_out.stands)
        self._width = setup.terrain.width

    def of(self, view: View, given_up: GivenUp, span: slice) -> tuple[Flat, NDArray[np.bool_]]:
        """Return the flat indices from which to see some of `Round.points` now, and which of them are usable.

        Usable are those that the robot gets to and has not given up.
        """
        stands, own = self._round.stands[span], self._own[span]
        usable = np.ones(stands.shape, dtype=np.bool_)
        if (now := view.fog.stands) is not None:
            own = now[self._round.points[span]]
            usable = own >= 0
            stands = np.where(now[stands] == stands, stands, own)
        if given_up.now(view.tick).size:
            stands = np.where(given_up.covers(view.tick, stands, self._width), own, stands)
            usable &= ~given_up.covers(view.tick, stands, self._width)
        return stands, usable
