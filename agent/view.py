"""The view of a policy in one tick: its robot, the fog that it believes in, the ground, the ways, and the others.

It never holds the truth or another robot's intent: positions are all that robots tell each other.
"""

from __future__ import annotations

import operator
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, TypeVar

import numpy as np
from numpy.typing import NDArray

from patrol.random import Purpose

if TYPE_CHECKING:
    from agent.belief.believed import Belief
    from agent.belief.posts import Posts
    from agent.chance import Draw
    from agent.routes.ground import Disc, Ground, Spot
    from agent.routes.routes import Routes, Way
    from patrol.pose import Pose
    from patrol.radio.peers import Peer
    from patrol.scenario import RobotSpec
    from patrol.zones.spec import Weighing

__all__ = ["FogView", "View"]

T = TypeVar("T", bound=np.generic)


class FogView:
    """The fog as this robot believes it, read-only. Grids are (height, width) of the terrain, by row and column.

    Attributes:
        patrolled: bool, the points that this robot could see from somewhere: those that have an age.
        posts: Where to stand to see patrolled points on which the body does not fit.
        left_out: bool, the points that the robot cannot get to see because of points seen blocked or a wreck, which are
            not among those patrolled for now; None where there is none.
        stands: int64 (h w,), flat index of where it stands to see each point then, -1 for nowhere; None likewise.
    """

    def __init__(self, belief: Belief, patrolled: NDArray[np.bool_], posts: Posts) -> None:
        self._belief = belief
        self._whole = patrolled
        self.left_out: NDArray[np.bool_] | None = None
        self.stands: NDArray[np.int64] | None = None
        self._shown: dict[int, NDArray[np.int32]] = {}
        self.patrolled = _read_only(patrolled)
        self.posts = posts

    @property
    def identity(self) -> int:
        """A number that is the same for all robots of a process that believe in the same fog now."""
        return id(self._belief.shared)

    @property
    def last_seen(self) -> NDArray[np.int32]:
        """int32, the tick at which each point was last seen; -1 where it never was, which counts as tick 0.

        For example, at tick 10 a point with 4 has an age of 6 ticks, and one with -1 an age of 10. A point that the
        robot does not patrol has no age, which reads 2**31 - 1.
        """
        return self._show_grid(0, self._belief.fog.last_seen)

    @property
    def dilated(self) -> NDArray[np.int32]:
        """int32, `last_seen` with staleness spread by the policy's `dilatation` (paper, "dilatation").

        For example, where the points around one were last seen at ticks 8, 3 and 9, its own tick reads 3.
        """
        return self._show_grid(1, self._belief.dilated)

    def dilated_around(self, point: tuple[int, int], span: int) -> NDArray[np.int32]:
        """Return `dilated`, up to date only around a point, which costs less.

        Args:
            point: Row and column.
            span: Number of rows and of columns that are needed on each side.
        """
        row, col = point
        return self._show_grid(1, self._belief.dilated_within((row - span, row + span, col - span, col + span)))

    @property
    def looked(self) -> NDArray[np.int32]:
        """int32, the tick at which each point was last in a robot's view; `last_seen` unless a look leaves age."""
        return self._show_grid(2, self._belief.looked)

    def checked_point(self, point: tuple[int, int]) -> tuple[int, int]:
        """Return a point's row and column as Python's integers.

        Args:
            point: Row and column of a point that the robot patrols; it may be left out for now.

        Raises:
            ValueError: It is anything else.
        """
        try:
            row, col = map(operator.index, point)
            if min(row, col) >= 0 and self._whole[row, col]:
                return row, col
        except (IndexError, TypeError, ValueError):
            pass
        raise ValueError(f"point = {point!r}: expected the row and column of a point that the robot patrols")

    def _show_grid(self, slot: int, grid: NDArray[np.int32]) -> NDArray[np.int32]:
        """Return a read-only view of a grid, which is another one once a belief is no longer shared."""
        shown = self._shown.get(slot)
        if shown is None or shown.base is not grid:
            self._shown[slot] = shown = _read_only(grid)
        return shown

    def leave_out(self, points: NDArray[np.bool_] | None, stands: NDArray[np.int64] | None) -> None:
        """Leave points out of the fog until the next call.

        Args:
            points: `left_out`.
            stands: `stands`.
        """
        self.stands = stands
        if points is not self.left_out:
            self.left_out = points
            self._belief.leave_out(points, self.posts)
            self.patrolled = _read_only(self._whole if points is None else self._whole & ~points)

    def mfow(self, tick: int) -> int:
        """Return the believed age of the stalest point that is not left out, ticks.

        For example, ages of 3, 8 and 5 ticks give 8.
        """
        if self.left_out is None:
            return self._belief.fog.mfow(tick)
        counted = self.last_seen[self.patrolled]
        return tick - max(int(counted.min()), 0) if counted.size else 0

    def age(self, tick: int) -> NDArray[np.int32]:
        """Return the age of every point, int32 ticks; 0 where there is nothing to patrol.

        For example, at tick 10 a point last seen at tick 4 has an age of 6.
        """
        return np.where(self.patrolled, np.int32(tick) - np.maximum(self.last_seen, np.int32(0)), np.int32(0))


@dataclass(frozen=True, slots=True)
class View:
    """The facts that a robot may know in one tick.

    Attributes:
        tick: The fleet's tick.
        time_s: Since tick 0, s.
        pose: The robot's own, m and rad.
        reported: The same as others hear it, rounded to centimetres and milliradians.
        bumped: Whether its last move was cancelled.
        spec: The robot's model, speed (m/s), radius (m) and turning radius (m).
        stride: How far it drives in a step at top speed, m.
        peers: The robots heard from lately, by number: pose and the tick at which it was heard.
        radii: Of all robots of the fleet, by number, m.
        contacts: The intruders known now, x and y in m.
        fog: The fog that it believes in.
        ground: The points on which its centre may be, less those that are blocked now.
        routes: Lengths of ways, from here and from elsewhere.
        chance: The robot's own draws, of which `draw` asks.
        charge: Share of the robot's battery that is left; None for a robot without a battery.
        zones: Names of the scenario's zones that are in force.
        weighing: Those of them that have a weight or a wanted age, with their weights now.
        charging: Numbers of the robots that stand at docks, or beside them after that; they are not among `peers`.
        obstacles: What nothing shows, such as a robot that has died: discs (x, y and radius in m) into which the
            robot's centre does not get. Their ground is closed.
    """

    tick: int
    time_s: float
    pose: Pose
    reported: Pose
    bumped: bool
    spec: RobotSpec
    stride: float
    peers: Mapping[int, Peer]
    radii: Mapping[int, float]
    contacts: Sequence[Spot]
    fog: FogView
    ground: Ground
    routes: Routes
    chance: Draw
    charge: float | None = None
    zones: frozenset[str] = frozenset()
    weighing: Weighing = frozenset()
    charging: frozenset[int] = frozenset()
    obstacles: Sequence[Disc] = ()

    def draw(self, index: int = 0, purpose: Purpose = Purpose.POLICY) -> float:
        """Draw a random number in [0, 1); within a tick, the same question has the same answer.

        For example, ``view.draw(0)`` and ``view.draw(1)`` are two numbers; ``view.draw(0)`` again is the first of them.

        Args:
            index: Which of this tick's questions, 0 and up.
            purpose: What the draw is for; policies of one's own keep to the default.
        """
        return self.chance(purpose, self.tick, index)

    def point_of(self, place: Spot) -> tuple[int, int]:
        """Return the terrain's point (row, col) on which a place (x, y) in m lies; off the terrain, the nearest one.

        For example, with points of 0.5 m and the origin at (0, 0), the place (1.3, 0.2) lies on the point (0, 2).
        """
        return self.ground.terrain.nearest_point(*place)

    def place_of(self, point: tuple[int, int]) -> Spot:
        """Return the centre (x, y) in m of the terrain's point (row, col).

        For example, with points of 0.5 m and the origin at (0, 0), the point (0, 2) has its centre at (1.25, 0.25).
        """
        return self.ground.terrain.centre(*point)

    def lengths(self, place: Spot | None = None, within: float | None = None) -> NDArray[np.float64]:
        """Compute the lengths of the ways from a place to all points (`agent.routes.routes.Routes.lengths`).

        For example, ``view.lengths(within=20.0)[row, col]`` is infinity for a point that is 25 m away.

        Args:
            place: x and y in m; the robot's own unless given.
            within: m, beyond which no way is followed; None for no limit.

        Returns:
            float64 (height, width) in m, infinity where no way leads.
        """
        return self.routes.lengths((self.pose.x, self.pose.y) if place is None else place, within)

    def stand_to_see(self, point: tuple[int, int]) -> Spot:
        """Return where to stand to see a point: on it, or on its post where no body fits.

        For example, ``Place(*view.stand_to_see((3, 7)))`` goes to where the robot sees point (3, 7).

        Args:
            point: Row and column; one that the robot patrols.

        Returns:
            x and y in m, for a `Place`.

        Raises:
            ValueError: The robot does not patrol it, for example because it is a wall.
        """
        stand = int(self.fog.posts.stands[self.fog.checked_point(point)])
        return self.place_of(divmod(stand, self.ground.terrain.shape[1]))

    def lengths_to_see(self, within: float | None = None) -> NDArray[np.float64]:
        """Compute how far the robot has to go to see each point: `lengths` to the places of `stand_to_see`.

        Args:
            within: As of `lengths`.

        Returns:
            float64 (height, width) in m, infinity where no way leads.
        """
        return self.lengths(within=within).reshape(-1)[self.fog.posts.stands]

    def way(self, place: Spot) -> Way | None:
        """Return the shortest way from here to a place (x, y) in m, or to the nearest one that a way leads to.

        For example, ``way = view.way((12.0, 40.0))``, and then the intent ``Place(*way.place, bend=way.bend)``.

        Returns:
            Where it leads and where it first bends; None for a robot that is off the ground.
        """
        row, col = self.point_of(place)
        start = self.start
        return None if start is None else self.routes.way(start, (row + 1, col + 1))

    @property
    def start(self) -> tuple[int, int] | None:
        """The open element (row, col) of `ground` on which the robot stands or which it joins first, else None."""
        return self.ground.join(self.pose.x, self.pose.y)

    @property
    def mfow(self) -> int:
        """The believed age of the stalest point, ticks."""
        return self.fog.mfow(self.tick)

    @property
    def age(self) -> NDArray[np.int32]:
        """The believed age of every point, int32 (height, width), ticks."""
        return self.fog.age(self.tick)


def _read_only(array: NDArray[T]) -> NDArray[T]:
    view = array.view()
    view.flags.writeable = False
    return view
