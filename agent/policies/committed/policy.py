"""The tour: a robot follows a round, and goes on when what it went to see has been seen.

- *On the round*: the first stale point ahead on a short closed tour that shows all of the ground
  (`agent.policies.committed.rounds`). All robots follow the same tour, evenly spaced
  (`agent.policies.committed.spacing`).
- *Free choice*, commitment and giving up: `agent.policies.commitment.commitment`.
- *Blocked*: while no way leads on along the round, choices are free; after a while the robot goes on from there.

Where there is no round, because the ground is too large for a tour or the sensor does not look all around, each choice
is free. So it is where free choices turn out to be fresher (`agent.policies.committed.comparison`).

On ground with zones the robots are divided between several rounds (`agent.policies.commitment.shared_round`).
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from agent.policies.commitment.commitment import NO_NEARER_S, TRIES, Target
from agent.policies.commitment.loss import Loss
from agent.policies.commitment.shared_round import SharedRound
from agent.policies.committed.comparison import Comparison
from agent.policies.committed.rounds import RoundAhead
from agent.policies.committed.spacing import ZONE_SLACK, Spacing
from patrol.measures.best_tour import most_planned
from patrol.scenario import CommittedOptions

if TYPE_CHECKING:
    from agent.ports import PolicySetup
    from agent.routes.routes import Element, Way
    from agent.view import View
    from patrol.ground.tour.round import Round

PROMPT_TICKS = 4
"""Ticks after tick 0, or after other zones have come into force, in which a robot still begins the round together with
the others."""


class Committed(SharedRound):
    """Follows the round together with the others."""

    Options = CommittedOptions

    def __init__(self, setup: PolicySetup) -> None:
        self.ahead: RoundAhead | None = None  # None where each choice is free
        self.spacing: Spacing | None = None  # likewise
        self._rounds_since = 0
        self._blocked_since: int | None = None
        self._loss = Loss(setup.step)
        self._comparison: Comparison | None = None  # None on ground with zones, where ages have several meanings
        super().__init__(setup)

    def _share(self, laid_out: Round, robots: frozenset[int], view: View | None) -> None:
        if self.spacing is not None and laid_out is self._round:
            if robots != self.spacing.followers:
                self.spacing.follow_with(robots)
            return
        setup = self._setup
        stride = max(setup.spec.speed * setup.step, setup.terrain.point)
        whole, most_slack = len(robots), ZONE_SLACK
        if self.division is None:
            whole, most_slack = max(1, round(len(robots) / len(setup.radii) * setup.team)), math.inf
        self.target = None
        self.ahead = RoundAhead(setup, laid_out)
        self.spacing = Spacing.on(
            laid_out, setup.spec, robots, whole, stride, setup.sight.range_m, setup.terrain, most_slack
        )
        if self.division is None:
            most = most_planned(len(laid_out.points) * setup.terrain.point_area, setup.sight.range_m)
            self._comparison = Comparison(setup.step, laid_out.length_m / setup.spec.speed, whole, whole > most)
        if view is not None and self._round is not None:
            self.ahead.go_to(self.spacing.along_m(self.spacing.nearest((view.reported.x, view.reported.y))))

    def _leave_round(self) -> None:
        self.ahead = self.spacing = None

    def _take_note(self, view: View, goes_on: bool) -> bool:
        if view.weighing != self._weighing:
            self._rounds_since = view.tick if goes_on else 0
        super()._take_note(view, goes_on)
        if self.ahead is None or self.spacing is None:
            return True
        self.spacing.listen(view)
        if self._comparison is not None:
            was_on_round = self._comparison.on_round
            self._loss.note(view, self.spacing.followers & view.peers.keys())
            self._comparison.note(view, self.spacing.team, self._loss.is_lossy)
            if not self._comparison.on_round:
                return True
            if not was_on_round:
                self.ahead.cursor, self._rounds_since = None, view.tick
                self.spacing.robots.clear()
        if self.ahead.cursor is None and view.tick - self._rounds_since <= PROMPT_TICKS:
            self.ahead.go_to(self.spacing.along_m(self.spacing.begin(view)))
            self.target = None
        if self.ahead.cursor is not None:
            self.spacing.note(view)
        return False

    def _waits(self, view: View) -> bool:
        return self.spacing is not None and self._is_on_round and self.spacing.waits(view)

    def _forget(self) -> None:
        super()._forget()
        if self.ahead is not None and self.spacing is not None:
            self.ahead.cursor = None
            self.spacing.robots.clear()
            self.spacing.heard.clear()

    def _chosen(self, view: View, start: Element) -> Way | None:
        self.target = None
        ahead, spacing = self.ahead, self.spacing
        if ahead is None or spacing is None or not self._is_on_round:
            return self._free_choice(view, start)
        if ahead.cursor is not None:
            way = self._next_on_round(view, start, ahead, spacing)
            if way is not None:
                self._blocked_since = None
                return way
            if self._blocked_since is None:
                self._blocked_since = view.tick
        # A robot that joins the others on the round begins where most is to be seen. So does one that has found the
        # round ahead blocked for long, for example by a robot that has died there. Robots that meet part before.
        way = self._free_choice(view, start)
        if self.target is not None and (ahead.cursor is None or self._is_blocked_for_long(view)):
            ahead.go_to(spacing.along_m(spacing.nearest(view.place_of(self.target.stand))))
        return way

    @property
    def _is_on_round(self) -> bool:
        return self._comparison is None or self._comparison.on_round

    def _is_blocked_for_long(self, view: View) -> bool:
        """Return True if no way has led on along the round for a while."""
        return self._blocked_since is not None and (view.tick - self._blocked_since) * self._step >= NO_NEARER_S

    def _next_on_round(self, view: View, start: Element, ahead: RoundAhead, spacing: Spacing) -> Way | None:
        """Commit to the first stale point ahead on the round, and return the way there; None where none leads there."""
        for _ in range(TRIES):
            stop = ahead.next(view, spacing.team, self.given_up)
            self._expected = 0
            way = self._way_to(view, start, stop.stand)
            if way is None:
                if not self._is_blocked_for_long(view):
                    return None
                self.given_up.add(view.tick, stop.stand)
                continue
            # A car comes no nearer to where it parks. It goes on from there, because nothing is stale.
            parked, self._was_at = self._was_at, (view.pose.x, view.pose.y)
            arrived = way.length == 0.0 or (way.length <= view.stride and parked == self._was_at)
            if stop.age > 0 or arrived:
                ahead.cursor = stop.place
            else:
                ahead.come_to(spacing.along_m(spacing.own_place))
            self._commit(view, Target(stop.point, stop.stand, stop.age))
            return way
        # Robots on a short round may stand in each other's way for good, with nothing stale on it.
        return None if self.division is None else self._free_choice(view, start)
