"""Commitment: a robot that has chosen a place goes there until somebody has seen it.

The paper's robot chooses its direction anew at each tick, from sums over directions that may hardly differ. Between two
rooms with equally stale points it turns round again and again, and sees neither. A committed robot takes the one point
that pulls hardest, by the same law and with the same claims, and goes there by the shortest way. It chooses again once
the point has been seen, when no way leads there any more, and when it comes no nearer.

In a large building whatever is stale may lie beyond the reach of the law, where forces are too small to matter. So the
law's unit of length stretches until the farthest point of the robot's claimed ground is within reach: the points that
no other robot has a shorter way to. With claims, a robot leaves other points alone unless its claimed ground is fresh.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from agent.policies.committed.cells import around, cells_of
from agent.policies.committed.kernels.hardest import hardest, reaches
from agent.policies.committed.nearby import Nearby, Question
from agent.policies.committed.search import NO_RIVALS, Decay, Laid, Law, least_ways, part_within
from agent.policies.committed.shunned import Shunned
from agent.policies.committed.stands import nearest_in_sight
from agent.policies.committed.target import Target
from agent.policies.committed.whereabouts import Whereabouts
from agent.policies.potential_field.pull.force import law_reach, log_pull_by_age
from agent.policies.potential_field.pull.windows import window_of
from agent.policies.random_steps import RandomSteps
from agent.policies.separation import Separation
from agent.ports import Bearing, Intent, Place, Stay
from agent.routes.path_window import DIAGONAL, FAR
from agent.routes.wave import LONGEST
from patrol.ground.footprint import Footprint
from patrol.scenario import CommittedOptions

if TYPE_CHECKING:
    from agent.policies.committed.nearby import Found
    from agent.ports import PolicySetup
    from agent.routes.ground import Spot
    from agent.routes.path_window import PathWindow
    from agent.routes.routes import Element, Way
    from agent.view import View

NO_NEARER_S = 15.0
"""A robot that has come no nearer to its target for so long gives it up, s."""

AT_HAND_S = 3.0
"""The same for a robot that is less than a stride away from where it wanted to be, s; at least `AT_HAND_STEPS`."""

AT_HAND_STEPS = 3

TRIES = 3
"""Number of targets that are tried in one tick, where no way leads to the first ones."""

NEARER = 0.1
"""Least share of a stride by which a way must get shorter to count as progress."""

HAND_OVER = 2.0
"""A robot claims a point if no other robot's way there is shorter by more than so many strides."""

NEAR_RANGES = 2.5
"""A target is looked for within so many sensor ranges first; farther away only if something there could pull harder."""

STRETCHED_S = 30.0
"""How often a robot measures how far its claimed ground reaches, s."""

DECIDED = 40.0
"""Number of widths beyond which a claim is decided, as `agent.policies.committed.kernels.hardest` has it."""

WORTH_WHILE = 0.25
"""A point of the claimed ground is fresh below this share of the age of the stalest point."""

STILL_STALE = 0.5
"""A target counts as seen once its age is below this share of what it was when it was chosen."""


class Committed:
    """Chooses a target and keeps to it."""

    Options = CommittedOptions

    def __init__(self, setup: PolicySetup) -> None:
        """Start without a target."""
        spec, sensor, terrain, options = setup.spec, setup.sensor, setup.terrain, setup.options
        stride = spec.speed * setup.step
        self._options = options
        self._separation = Separation(setup)
        self._random_steps = RandomSteps(setup)
        # The window of the path method, over the whole terrain; None for the wave of the robot's own routes.
        paths = None
        if options.paths != "wave":
            height, width = terrain.shape
            sizes = height, width, height + width
            paths = window_of(options.paths, sizes, setup.scratch, setup.fields.patrolled, setup.regions)
        width_m = options.claim_width if self._separation.claims else 0.0
        self._point = terrain.point
        self._step = setup.step
        self._posts = setup.posts
        self._paths = paths
        self._width = 100.0 * width_m / self._point
        self._nearer = NEARER * stride
        sight = Footprint(terrain, sensor.range, 360.0, sensor.line_of_sight, sensor.quality)
        self._sight = sight if sensor.angle >= 360.0 and not sight.leaves_age else None
        # A car ends up near the place that it heads for, and not exactly on it.
        self._slack = math.ceil(stride / self._point) if spec.model == "car" else 0
        self._whereabouts = Whereabouts(spec.radius, stride, setup.step)
        self._hand_over = round(100.0 * HAND_OVER * stride / self._point)
        longest = 4 * sum(terrain.shape)  # points; no way is taken to be longer
        self._reach = law_reach(options, self._point, longest)
        self._target: Target | None = None
        self._expected = 0
        self._least = math.inf
        self._least_age = 0
        self._least_at = 0
        self._near = min(math.ceil(NEAR_RANGES * sensor.range / self._point), longest)
        sight_points = sensor.range / self._point
        self._nearby = Nearby(setup.posts, sight_points, 100 * self._near, self._width)
        self._decay = Decay(options, self._point)
        self._stretched_until = -1
        # What a car heads for depends on points in sight of its target, which may lie outside a window.
        self._widens = paths is None and not self._slack and width_m > 0.0
        self._at_hand_s = max(AT_HAND_S, AT_HAND_STEPS * setup.step)
        self._shunned = Shunned(math.ceil((2.0 * max(spec.radius, self._point) / self._point) ** 2), setup.step)

    def decide(self, view: View) -> Intent:
        """The way to the target, or to a new one; now and then a random step."""
        self._separation.keep_apart(view)
        start, wander = view.start, self._random_steps.draw(view)
        if start is None:
            # The body has to find its way back to the reachable ground first.
            return Bearing((), wander=wander)
        self._whereabouts.note(view.tick, (view.pose.x, view.pose.y))
        way = self._way(view, start)
        if way is None:
            way = self._choose(view, start)
        target = self._target
        if way is None or target is None:
            return Stay()
        figures = {"way_m": way.length, "age_s": float(self._age(view, target.point) * self._step)}
        if way.length == 0.0 and target.stand == target.close and self._sight is None:
            # It stands where it should, so it only has to turn.
            across, up = (there - here for there, here in zip(view.place_of(target.point), way.place, strict=True))
            if across != 0.0 or up != 0.0:
                return Bearing((math.atan2(up, across),), wander=wander, figures=figures)
        return Place(*way.place, bend=way.bend, wander=wander, figures=figures)

    def _way(self, view: View, start: Element) -> Way | None:
        """The way to the present target; None without a target, or if it is time for another."""
        target = self._target
        if target is None:
            return None
        age = self._age(view, target.point)
        seen = age < STILL_STALE * target.age
        if seen and not (target.away and self._whereabouts.home() is not None):
            self._shunned.forgive(target.close)
            return None
        way = self._way_to(view, start, target.stand)
        if way is None or (seen and way.length <= view.stride):
            return None
        at_hand = way.length <= view.stride
        if way.length < self._least - self._nearer or age < self._least_age:
            # A look that leaves some of a point's age is progress as well.
            self._least, self._least_at = min(self._least, way.length), view.tick
        self._least_age = age
        stood_s = (view.tick - self._least_at) * self._step
        if target.stand != target.close and (way.length == 0.0 or (at_hand and stood_s > self._at_hand_s)):
            self._target = target = replace(target, stand=target.close)
            self._least, self._least_at = math.inf, view.tick
            return self._way_to(view, start, target.stand)
        if stood_s > (self._at_hand_s if at_hand else NO_NEARER_S):
            self._shunned.add(view.tick, target.close)
            return None
        return way

    def _way_to(self, view: View, start: Element, stand: tuple[int, int]) -> Way | None:
        """The shortest way to a point of the terrain; None if no way leads there now."""
        way = view.routes.way(start, (stand[0] + 1, stand[1] + 1), self._expected)
        if way.place != view.place_of(stand):
            return None
        self._expected = round(100.0 * (way.length + 2.0 * self._nearer / NEARER) / self._point)
        return way

    def _choose(self, view: View, start: Element) -> Way | None:
        """Commit to the point that pulls hardest, and return the way there; None where nothing pulls."""
        self._target = None
        tick = view.tick
        self._shunned.forget(tick)
        if view.mfow == 0:
            return None
        home, others = self._whereabouts.home(), self._separation.rivals(view)
        for _ in range(TRIES):
            target = self._best(view, start, others, home)
            if target is None:
                return None
            way = self._way_to(view, start, target.stand)
            if way is not None:
                self._target = target
                self._least, self._least_age, self._least_at = math.inf, target.age, tick
                return way
            # Only straight paths and paths through regions lead where no way does.
            self._shunned.add(tick, target.close)
        return None

    def _best(self, view: View, start: Element, rivals: NDArray[np.int64], home: Spot | None) -> Target | None:
        """The target that pulls hardest, outside of the circle around ``home`` if possible; None where nothing pulls.

        The paths' window may be shared, so it is used within this call only.
        """
        if self._paths is None and home is None:
            known = view.tick < self._stretched_until
            if known or self._measure_nearby(view, start, rivals):
                asked = self._question(view, rivals)
                nearby, sure = self._nearby.find(asked, start, whole=not known)
                if nearby is None and sure:
                    nearby = self._nearby.find_far(asked, start)
                if nearby is not None:
                    return self._target_near(view, start, nearby)
        if home is None and self._widens:
            target = self._within_reach(view, start, rivals)
            if target is not None:
                return target
        paths = self._paths or view.routes.window()
        laid = self._lay(view, paths, start, rivals, LONGEST)
        self._measure(view.tick, laid)
        law = self._law(view, laid, LONGEST)
        found = None if home is None else self._hardest(view, paths, laid, law, home)
        away = found is not None
        if found is None:
            found = self._hardest(view, paths, laid, law, None)
        if found is None and self._shunned.places:
            self._shunned.places.clear()
            found = self._hardest(view, paths, laid, law, None)
        return None if found is None else self._target_at(view, paths, found, away)

    def _within_reach(self, view: View, start: Element, rivals: NDArray[np.int64]) -> Target | None:
        """The target that the whole terrain would give, from a window that is known to decide it; None if none does.

        Claimed ground is closed: what lies on the way to a claimed point is claimed too. So where none of a window's
        longest ways ends on claimed ground, all of it is in the window, which shows how far it reaches and whether
        anything on it is stale. A rival's way to a point matters up to the length at which the claim is decided, and
        lies within that length of the point.
        """
        reach, decided = 2 * self._near, math.ceil(DECIDED * self._width / 100.0)
        while 2 * (2 * reach + decided) < max(view.ground.terrain.shape):
            window = view.routes.window(2 * reach + decided)
            laid = self._lay(view, window, start, rivals, 100 * reach, 100 * decided)
            if laid.claimed > 0 and laid.handed <= 100 * reach - DIAGONAL:
                self._measure(view.tick, laid)
                law = self._law(view, laid, 100 * reach)
                found = self._hardest(view, window, laid, law, None, decides=True)
                if found is not None:
                    return self._target_at(view, window, found, away=False)
            reach *= 2
        return None

    def _lay(
        self, view: View, paths: PathWindow, start: Element, rivals: NDArray[np.int64], limit: int, more: int = 0
    ) -> Laid:
        """Lay the paths from where the robot stands, and those from where its rivals stand.

        Args:
            view: Of this tick.
            paths: The window to use.
            start: The element of the ground on which the robot stands.
            rivals: Those on which other robots stand, int64 (n, 2).
            limit: The longest path, in hundredths of a point.
            more: How much longer a rival's path may be, in hundredths of a point.
        """
        rival = NO_RIVALS
        # Who is farther away than both ways together meets the robot nowhere.
        rivals = rivals[least_ways(start, rivals) <= 2 * limit + more]
        if self._width > 0.0 and rivals.size:
            others = [(row, col) for row, col in rivals.tolist()]
            rival = paths.lengths_from(view.ground.static, *start, others, limit + more)
        if self._paths is None:
            paths.lengths_from(view.ground, *start, [start], limit)
        else:
            paths.begin(view.ground, *start)
            paths.extend(limit)
        part, lengths = part_within(paths, start, limit), np.zeros(3, dtype=np.int64)
        reaches(paths.state, paths.length, rival, self._hand_over, *part, lengths)
        longest, claimed, handed = lengths.tolist()
        return Laid(rival, part, max(1, longest), claimed, handed)

    def _measure(self, tick: int, laid: Laid) -> None:
        """Stretch the law's unit to the reach of the claimed ground, unless that was done not long ago."""
        if tick >= self._stretched_until:
            self._reaches(tick, laid.claimed or laid.longest)

    def _measure_nearby(self, view: View, start: Element, rivals: NDArray[np.int64]) -> bool:
        """The same without a window, if that can be done. Returns whether it was."""
        claimed = self._nearby.claimed(view, start, rivals - 1)
        if claimed:
            self._reaches(view.tick, claimed)
        return bool(claimed)

    def _reaches(self, tick: int, length: int) -> None:
        """The claimed ground reaches as far as a length in hundredths of a point."""
        self._decay.stretch(max(1.0, length / self._reach))
        self._stretched_until = tick + round(STRETCHED_S / self._step)

    def _law(self, view: View, laid: Laid, limit: int) -> Law:
        """How hard the points pull to which paths are laid, up to a length in hundredths of a point."""
        decay, pull = self._decay.table(laid.longest), self._pull(view)
        return Law(pull, decay, float(pull[-1] + self._decay.of(np.array([limit]))[0]))

    def _pull(self, view: View) -> NDArray[np.float64]:
        """The logarithm of f by age, ticks."""
        return log_pull_by_age(self._options.fow, self._options.alpha, view.mfow)

    def _question(self, view: View, rivals: NDArray[np.int64]) -> Question:
        """What is asked for first: a stale point that is not handed over."""
        others = rivals - 1
        shunned, stale = self._shunned.now(view.tick), self._stale(view)
        return Question(view, self._pull(view), self._decay, others, shunned, stale, self._hand_over)

    @staticmethod
    def _stale(view: View) -> int:
        """The age below which points of the claimed ground are fresh, ticks."""
        return max(1, math.ceil(WORTH_WHILE * view.mfow))

    def _target_near(self, view: View, start: Element, found: Found) -> Target:
        """The target at a point that was found nearby, with where to stand for it."""
        stand = None
        if self._sight is not None and self._slack:
            cells = found.cells
            stand = nearest_in_sight(self._sight, self._slack, cells, found.point)
            if stand is None and cells.limit < found.limit:
                cells = self._nearby.paths(view, start, found.limit)
                stand = nearest_in_sight(self._sight, self._slack, cells, found.point)
            found = found._replace(cells=cells)
        stand = stand or found.close
        self._expected = found.cells.length(*stand) + 200
        return Target(found.point, stand, found.close, self._age(view, found.point), away=False)

    def _target_at(
        self, view: View, paths: PathWindow, found: tuple[tuple[int, int], tuple[int, int]], away: bool
    ) -> Target:
        """The target at a point, with where to stand for it.

        Args:
            view: Of this tick.
            paths: From where the robot stands.
            found: The point, and the point to stand on.
            away: Whether the robot has to leave a circle.
        """
        point, close = found
        stand = close
        # A car may find no way to turn at the point itself, and straight paths lead to points that nobody can stand on.
        # Others head for the point, so that they do not stop short of it.
        # Who has to leave a circle must not stop within it, as soon as the point is in sight.
        if self._sight is not None and not away and (self._slack or self._paths is not None):
            ground = None if self._paths is None else view.ground.state
            cells = cells_of(paths, ground, around([point], self._sight.reach, view.ground.terrain.shape), LONGEST)
            stand = nearest_in_sight(self._sight, self._slack, cells, point) or close
        self._expected = int(paths.length[stand[0] - paths.row0, stand[1] - paths.col0]) + 200
        return Target(point, stand, close, self._age(view, point), away)

    def _hardest(
        self,
        view: View,
        paths: PathWindow,
        laid: Laid,
        law: Law,
        home: Spot | None,
        *,
        decides: bool = False,
    ) -> tuple[tuple[int, int], tuple[int, int]] | None:
        """The point that pulls hardest and the point to stand on, each (row, col) of the terrain; None for none.

        What a rival has the shorter way to counts only where all of the claimed ground is fresh.

        Args:
            view: Of this tick.
            paths: The window of these paths.
            laid: From where the robot stands.
            law: How hard points pull.
            home: x and y in m, the centre of the circle in which the robot must not stand; None for no circle.
            decides: Whether the window holds all of the claimed ground, but not all of the terrain: what is found
                elsewhere has to pull harder than anything outside could.
        """
        fog = view.fog
        grids = (paths.state, paths.length, paths.row0, paths.col0, *laid.part, fog.last_seen, fog.looked)
        posts = self._posts.between(paths.row0 + laid.part[0], paths.row0 + laid.part[1] - 1)
        left_out = self._shunned.now(view.tick)
        squared = math.ceil((self._whereabouts.reach / self._point) ** 2)
        circle = (0, 0, -1) if home is None else (*view.point_of(home), squared)
        stale = self._stale(view)
        rounds = ((self._hand_over, stale), (FAR, stale), (FAR, 1))
        for hand_over, least in rounds[:2] if decides else rounds:
            best, place = np.array([-np.inf]), np.zeros(4, dtype=np.int64)
            for points in (None, posts):
                forces = (view.tick, least, law.pull, law.decay, laid.rival, self._width, hand_over)
                hardest(points, *grids, *forces, left_out, *circle, best, place)
            if best[0] > (law.beyond if decides and hand_over == FAR else -np.inf):
                row, col, stand_row, stand_col = (int(number) for number in place)
                return (row, col), (stand_row, stand_col)
        return None

    @staticmethod
    def _age(view: View, point: tuple[int, int]) -> int:
        return view.tick - max(view.fog.last_seen.item(point), 0)
