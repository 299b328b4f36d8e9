"""The round that a robot shares with others, on ground with and without zones.

On ground with zones there are several rounds, and robots are divided between them
(`agent.policies.commitment.division`); free choices count the age times the weight. Rounds, division and weights follow
the zones that are in force.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from agent.policies.commitment.commitment import Commitment
from agent.policies.commitment.division import Division

if TYPE_CHECKING:
    from agent.ports import PolicySetup
    from agent.view import View
    from patrol.ground.tour.round import Round
    from patrol.ground.tour.zoned import Group, ZonedGround


class SharedRound(Commitment):
    """Shares a round with other robots; the base of policies that say what is next on it."""

    def __init__(self, setup: PolicySetup) -> None:
        super().__init__(setup)
        self.division: Division | None = None  # None where there is at most one round
        self._weighing = setup.weighing
        self._round: Round | None = None
        if setup.zoned is not None:
            self._take_zones(setup.zoned(setup.weighing))
        elif (laid_out := setup.round()) is not None:
            self._share(laid_out, setup.followers(), None)

    def _share(self, laid_out: Round, robots: frozenset[int], view: View | None) -> None:
        """Share a round with some robots, this one among them, from now on.

        Meanwhile `_round` is still the one before, None for none. ``view`` is None before the first tick.
        """
        raise NotImplementedError

    def _round_of(self, zoned: ZonedGround, group: Group) -> Round:
        """Return the round of a group of robots, on ground with zones."""
        return zoned.round_of(group)

    def _leave_round(self) -> None:
        """Share no round from now on."""
        raise NotImplementedError

    def _take_zones(self, zoned: ZonedGround) -> None:
        """Go by the zones that are in force now: divide the robots between their rounds."""
        self._round, setup = None, self._setup
        if not zoned.rounds:
            self.division = None
            self._leave_round()
        elif self.division is None:
            self.division = Division(zoned, setup.spec.number, frozenset(setup.radii), setup.team, setup.step)
        else:
            self.division.divide(zoned)

    def _take_note(self, view: View, goes_on: bool) -> bool:
        if self._setup.zoned is not None and view.weighing != self._weighing:
            self._weighing = view.weighing
            self._take_zones(self._setup.zoned(view.weighing))
        if self.division is not None:
            crew = self.division.crew(view)
            laid_out = self._round_of(self.division.zoned, crew.group)
            self._share(laid_out, crew.robots, view)
            self._round = laid_out
        return super()._take_note(view, goes_on)
