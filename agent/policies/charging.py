"""Charging: a watch over the battery that sends a robot to a dock in time, whatever its policy.

The watch stands between policy and body. It lets the policy decide until the charge only just suffices for the way to a
dock; from then on the robot goes there and stays until it has charged. For example, with 45 J for each metre of driving
and a dock 80 m away, a robot goes when 1.3 * 80 * 45 = 4.7 kJ are left above its reserve. What it uses while the slow
zones in force hold it up on the way comes on top.

Robots tell each other where they are and nothing else, so all is inferred from positions:

- *Taken*: a dock is taken while another robot has stood at it for some seconds, or while something has closed it.
- *Claimed*: of two robots that want one dock, the one with the shorter way goes, at equal lengths the lower number. A
  robot seems to want a dock while its way there gets shorter at half of its speed or more; where slow zones hold it up,
  at half of what they allow.
- *Waiting*: a robot for which no dock is free stands a few lengths away from one, clear of those that leave, and where
  others get past it: in front of no door.
- *Charge of others*: a robot reckons it from where they drive and stand, as if all had a battery like its own.
- *Number on patrol*: as many robots patrol as the others can recharge meanwhile. One that has charged waits beside its
  dock while there are so many. While there are more, the one with the least charge goes to a dock early.
- *Hand-over*: a robot that passes a dock where another has much more charge takes the dock, and the other its place on
  patrol. If that one still charges, it makes room for the robot, which stops beside the dock for it.
- *Passing*: a robot that will have to charge soon does so when its patrol leads it past a free dock.
- *Not on the round*: a robot that stands at a dock, or waits beside it after that, is hidden from the policies of the
  others, which close up.

For example, of six robots that drive for 40 minutes and charge for 18, four patrol and two charge. Each hand-over
leaves the gaps between the four as they are.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Mapping, Set
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from agent.ports import Place, State, Stay
from agent.routes.ground import Ground
from agent.routes.routes import Routes
from agent.routes.slow_ways import SlowWays
from agent.routes.waiting import Waiting

if TYPE_CHECKING:
    from agent.ports import Intent, Policy, PolicySetup
    from agent.routes.ground import Spot
    from agent.view import View
    from patrol.energy.spec import BatterySpec
    from patrol.ground.terrain import Terrain
    from patrol.radio.peers import Peer
    from patrol.zones.ground import SpeedLimits

DETOUR = 1.3
"""Charge that is kept for the way to a dock, in what the shortest way needs: others are in the way, and bodies turn."""

STOOD_S = 2.0
"""A robot that has been at a dock for so long stands there, s; one that drives past does not."""

COURSE_S = 5.0
"""Time over which a robot's way to a dock is compared, s."""

TOWARDS = 0.5
"""A robot that wants a dock comes nearer at this share of its speed at least."""

KEEP = 0.8
"""Weight of the way to the dock that a robot already goes to, so that it does not change its mind at once."""

CLEAR_RADII = 8.0
"""Distance that waiting robots keep from a dock, in radii of the body, beyond the dock's own radius."""

WAITED_S = 4.0
"""A robot that has stood beside a dock for so long waits there, s."""

WORTH = 0.35
"""Share of the capacity that a robot must have more than another that takes over its dock."""

ROUGH = 0.02
"""Error of a charge that is reckoned, as a share of the capacity."""

STILL_CHARGED = 0.5
"""Share of `full` down to which a robot that waits beside its dock need not charge again."""

SETTLED_S = 20.0
"""The number on patrol counts once it has been the same for so long, s: a hand-over changes it for a while."""

ANSWER_S = 15.0
"""Time for which a robot waits beside a dock for another to make room, s."""

PAUSE_S = 120.0
"""Time after which it does so again, s."""

PASSING_S = 8.0
"""A robot that a free dock is so near to, in time at top speed, s, charges `EARLY` already: it need not go back."""

EARLY = 0.1
"""Share of the capacity by which it is early then: about what one time around uses."""

SHUT_OUT_M = 1e6
"""Length of a way to a dock that none leads to because of what was seen blocked, m."""

ROUNDED_M = 0.01
"""Error of a position that was heard, m."""


class _Seen(NamedTuple):
    """A place at which a robot was heard, and the tick."""

    tick: int
    spot: Spot


@dataclass(slots=True, eq=False)
class _Dock:
    """A dock as one robot knows it."""

    place: Spot
    radius: float
    ways: NDArray[np.float32]  # (h, w), lengths of the ways to it, m; infinity where none leads
    slow_ways: SlowWays  # the cost of slow zones on these
    point: tuple[int, int]  # row and column of its place
    clear: NDArray[np.bool_]  # (h, w), the points beside it that are clear of all docks
    exit: Spot  # where a robot goes that leaves it without another aim
    used_since: int | None = None  # tick since which something has been at it

    def holds(self, spot: Spot) -> bool:
        """Return True if a robot whose centre is heard there is at the dock."""
        return math.dist(self.place, spot) <= self.radius + ROUNDED_M


@dataclass(slots=True)
class _Heard:
    """A robot as it was heard."""

    course: deque[_Seen] = field(default_factory=deque)  # oldest first, over `COURSE_S`
    at: _Dock | None = None  # the dock at which it is
    since: int = 0  # tick since which `at` holds
    rests: _Dock | None = None  # the dock at which it stood last, while it stays near
    still_since: int = 0  # tick since which it has not moved
    charge: float = 1.0  # by reckoning, as a share of the battery's capacity


class Charging:
    """A policy that charges the robot's battery, and otherwise leaves the decision to another policy."""

    def __init__(self, setup: PolicySetup, otherwise: Policy, speed_limits: SpeedLimits) -> None:
        spec, terrain = setup.robot.spec, setup.ground.terrain
        self.otherwise = otherwise
        self.goes = False  # on the way to a dock, waiting for one, or charging
        self._number = spec.number
        self._battery = spec.battery
        self._speed = spec.speed
        self._step = setup.fleet.step
        self._clear_m = CLEAR_RADII * spec.radius
        routes = Routes(Ground(terrain, setup.ground.fields.reach))
        self._docks: list[_Dock] = []
        for dock_spec in setup.fleet.docks:
            ways = routes.lengths(dock_spec.place).astype(np.float32)
            if np.isfinite(ways).any():
                point = terrain.point_at(*dock_spec.place)
                slow_ways = SlowWays(ways, terrain.point, spec.speed, speed_limits)
                place, radius = dock_spec.place, dock_spec.radius
                self._docks.append(_Dock(place, radius, ways, slow_ways, point, np.isfinite(ways), place))
        self._waiting = Waiting(terrain, setup.ground.fields.reach, spec.radius)
        self._waits_at: Spot | None = None
        for dock in self._docks:
            self._find_clear_points(dock, terrain)
        self._others: dict[int, _Heard] = {}
        self._charged = frozenset(robot.number for robot in setup.fleet.roster if robot.battery is not None)
        self._ready = False
        self._first_charge = 1.0 if self._battery is None else self._battery.start
        self._own = _Heard(charge=self._first_charge)
        self._patrolling: Set[int] = frozenset()
        self._patrolling_since = 0
        self._dock: _Dock | None = None
        self._asks: _Dock | None = None
        self._asked_at = -(2**30)

    def decide(self, view: View) -> Intent:
        """Let the other policy decide, or go to a dock."""
        self._listen_to_others(view)
        if self._battery is not None and view.charge is not None and self._docks:
            charge = view.charge
            if self.goes and self._is_done(view, charge):
                self.goes, self._ready, self._dock, self._waits_at = False, False, None, None
            elif not self.goes and self._is_due(view, charge):
                self.goes = True
            if self.goes:
                return self._to_dock(view)
            if self._asks_for_room(view, charge):
                return Stay(State.DOCKING)
        return self._let_patrol(view)

    # --- what is heard -----------------------------------------------------------------------------------------------

    def _listen_to_others(self, view: View) -> None:
        """Take note of where the others are, and of the docks that something is at."""
        for number in [number for number in self._others if number not in view.peers]:
            del self._others[number]
        for number, peer in view.peers.items():
            neighbour = self._others.setdefault(number, _Heard(charge=self._first_charge))
            self._note_place(neighbour, (peer.pose.x, peer.pose.y), peer.tick)
        self._note_place(self._own, (view.reported.x, view.reported.y), view.tick)
        patrolling = self._others.keys() & self._charged - self._off_patrol(view.tick)
        if patrolling != self._patrolling:
            self._patrolling, self._patrolling_since = patrolling, view.tick
        is_open = view.ground.open_now
        used = {neighbour.at for neighbour in self._others.values()}
        for dock in self._docks:
            if dock not in used and is_open[dock.point]:
                dock.used_since = None
            elif dock.used_since is None:
                dock.used_since = view.tick

    def _note_place(self, robot: _Heard, spot: Spot, tick: int) -> None:
        """Take note of where a robot is, this one or another."""
        course = robot.course
        # Nothing has been heard of it since.
        if course and course[-1].tick >= tick:
            return
        if course:
            self._reckon_charge(robot, (tick - course[-1].tick) * self._step, math.dist(course[-1].spot, spot))
        # Each of the two positions is rounded, so a robot that stands may seem to move.
        if not course or math.dist(course[-1].spot, spot) > 2.0 * ROUNDED_M:
            robot.still_since = tick
        course.append(_Seen(tick, spot))
        while course[0].tick < tick - COURSE_S / self._step:
            course.popleft()
        dock = next((dock for dock in self._docks if dock.holds(spot)), None)
        if dock is not robot.at:
            if robot.at is not None and self._has_lasted(robot.since, tick, STOOD_S):
                robot.rests = robot.at
            robot.at, robot.since = dock, tick
        if robot.rests is not None and not self._is_beside(robot.rests, spot):
            robot.rests = None

    def _reckon_charge(self, robot: _Heard, passed_s: float, driven_m: float) -> None:
        """Subtract the use of a robot from its charge, or add the gain at a dock."""
        if (battery := self._battery) is None:
            return
        gained_j = -battery.idle * passed_s - battery.drive * driven_m
        if robot.at is not None and self._has_lasted(robot.since, robot.course[-1].tick, STOOD_S):
            gained_j += battery.charge * passed_s
        # It may have begun with more than docks charge to; that is not taken away.
        ceiling = max(robot.charge, battery.full)
        robot.charge = min(max(robot.charge + gained_j / battery.capacity_j, 0.0), ceiling)

    def _has_lasted(self, since: int | None, tick: int, seconds: float) -> bool:
        return since is not None and (tick - since) * self._step >= seconds

    def _find_docked(self, tick: int) -> set[int]:
        """Return the robots that stand at docks."""
        robots = self._others.items()
        return {n for n, robot in robots if robot.at is not None and self._has_lasted(robot.since, tick, STOOD_S)}

    def _is_beside(self, dock: _Dock, spot: Spot) -> bool:
        """Return True if x and y in m are at a dock or near enough to wait for it."""
        return math.dist(dock.place, spot) <= dock.radius + 2.0 * self._clear_m

    def _wants_room(self, other: _Heard, tick: int) -> _Dock | None:
        """Return the dock beside which a robot waits for one with much more charge to make room."""
        if other.at is not None or not self._has_lasted(other.still_since, tick, WAITED_S):
            return None
        for dock in self._docks:
            if self._is_beside(dock, other.course[-1].spot):
                robots = self._own, *self._others.values()
                charged = (robot.charge for robot in robots if dock in (robot.at, robot.rests))
                # Both robots reckon this charge, and neither quite rightly.
                if max(charged, default=0.0) >= other.charge + WORTH - ROUGH:
                    return dock
        return None

    def _off_patrol(self, tick: int) -> set[int]:
        """Return the robots that stand at docks, beside them after that, or beside them to take over."""
        numbers = self._find_docked(tick)
        for number, robot in self._others.items():
            still = self._has_lasted(robot.still_since, tick, WAITED_S)
            if still and (robot.rests is not None or self._wants_room(robot, tick) is not None):
                numbers.add(number)
        return numbers

    def _count_surplus(self, view: View) -> int:
        """Return how many robots more are on patrol than the others can recharge meanwhile; 0 until that is settled."""
        battery = self._battery
        assert battery is not None
        if not self._has_lasted(self._patrolling_since, view.tick, SETTLED_S):
            return 0
        fleet = 1 + len(self._others.keys() & self._charged)
        return len(self._patrolling) + (not self.goes) - battery.most_on_patrol(fleet, self._speed)

    def _let_patrol(self, view: View) -> Intent:
        """Let the policy decide, without the robots off patrol; it does not stand still at a dock."""
        off_patrol = self._off_patrol(view.tick)
        if off_patrol:
            peers: Mapping[int, Peer] = {n: peer for n, peer in view.peers.items() if n not in off_patrol}
            view = replace(view, peers=peers, charging=frozenset(off_patrol))
        intent = self.otherwise.decide(view)
        # Standing still there, it would keep others from the dock.
        if isinstance(intent, Stay):
            for dock in self._docks:
                if math.dist(dock.place, (view.pose.x, view.pose.y)) <= dock.radius + view.spec.radius:
                    return Place(*dock.exit)
        return intent

    # --- when to go --------------------------------------------------------------------------------------------------

    def _is_due(self, view: View, charge: float) -> bool:
        """Return True if it is time to charge, or if the robot takes over a free dock from one that waits beside it."""
        battery = self._battery
        assert battery is not None
        best = self._choose_dock(view)
        nearest = self._find_nearest(view) if best is None else best
        direct_m = self._open_length(nearest, (view.pose.x, view.pose.y), view)
        way_m = DETOUR * direct_m + 2.0 * view.stride
        left_j = (charge - battery.reserve) * battery.capacity_j
        if left_j <= self._needed_j(battery, nearest, way_m, view):
            return True
        if self._count_surplus(view) > 0:
            # The charge that the others reckon, not the true one, so that all find the same robot.
            own_rank = self._own.charge, self._number
            lowest = all(own_rank < (self._others[number].charge, number) for number in self._patrolling)
            return best is not None and lowest and charge <= battery.full - WORTH
        if best is None or direct_m > PASSING_S * self._speed:
            return False
        if charge <= battery.reserve + EARLY:
            return True
        return any(o.rests is best and o.charge >= charge + WORTH for o in self._others.values())

    def _asks_for_room(self, view: View, charge: float) -> bool:
        """Return True while the robot stands beside a dock for another to make room; it goes there when that does."""
        tick = view.tick
        if self._asks is not None:
            if not self._is_taken(self._asks, tick):
                self.goes, self._dock, self._asks = True, self._asks, None
                return True
            if not self._has_lasted(self._asked_at, tick, ANSWER_S):
                return True
            self._asks = None
        pose = view.pose.x, view.pose.y
        beside = next((dock for dock in self._docks if self._is_beside(dock, pose)), None)
        if beside is None or not self._has_lasted(self._asked_at, tick, PAUSE_S):
            return False
        standing = (self._others[number] for number in self._find_docked(tick))
        if not any(neighbour.at is beside and neighbour.charge >= charge + WORTH for neighbour in standing):
            return False
        self._asks, self._asked_at = beside, tick
        return True

    def _is_done(self, view: View, charge: float) -> bool:
        """Return True if the robot has charged and is needed on patrol, or makes room for one that takes over."""
        assert self._battery is not None
        tick, pose = view.tick, (view.pose.x, view.pose.y)
        # The bound is lower once it has charged, or waiting beside the dock would send it back at once.
        self._ready = charge >= (STILL_CHARGED if self._ready else 1.0) * self._battery.full
        if self._ready:
            is_relieved = any(self._others[number].at is self._dock for number in self._find_docked(tick))
            return self._dock is None or is_relieved or self._count_surplus(view) < 0
        if self._dock is None or not self._dock.holds(pose):
            return False
        return any(
            self._wants_room(self._others[number], tick) is self._dock
            and charge >= self._others[number].charge + WORTH - ROUGH
            for number in self._others.keys() & self._charged
        )

    # --- where to ----------------------------------------------------------------------------------------------------

    def _to_dock(self, view: View) -> Intent:
        pose = view.pose.x, view.pose.y
        if self._ready and self._dock is not None:
            return self._beside_dock(view, self._dock)
        self._dock = dock = self._choose_dock(view)
        if dock is not None:
            centre = view.place_of(dock.point)
            # The point that it drives to may lie farther off than half of the radius.
            if math.dist(dock.place, pose) <= max(0.5 * dock.radius, math.dist(dock.place, centre) + ROUNDED_M):
                return Stay(State.CHARGING)
            state = State.CHARGING if dock.holds(pose) else State.DOCKING
            return self._go_to_spot(view, centre, state)
        return self._beside_dock(view, self._find_nearest(view))

    def _beside_dock(self, view: View, dock: _Dock) -> Intent:
        """Return the way to where a robot waits beside a dock: near it, and clear of all docks."""
        pose = view.pose.x, view.pose.y
        if self._measure_way(dock, pose, view) > self._beside_m(dock):
            self._waits_at = None
            return self._go_to_spot(view, view.place_of(dock.point), State.DOCKING)
        others = (self._others[number].course[-1].spot for number in sorted(self._off_patrol(view.tick)))
        near = [spot for spot in others if math.dist(spot, pose) <= 4.0 * self._clear_m]
        waits_at = self._waits_at
        # Another robot stands there by now.
        if waits_at is not None and any(math.dist(waits_at, position) <= 2.0 * view.spec.radius for position in near):
            waits_at = None
        if waits_at is None or math.dist(waits_at, pose) > view.stride:
            # It need not go on to where it wanted to wait if others can pass where it is.
            if dock.clear[view.point_of(pose)] and self._waiting.lets_others_pass(pose, near):
                waits_at = pose
            elif waits_at is None:
                waits_at = self._waiting.nearest(dock.ways, dock.clear, near) or dock.exit
        self._waits_at = waits_at
        if math.dist(waits_at, pose) <= view.stride:
            return Stay(State.DOCKING)
        return self._go_to_spot(view, waits_at, State.DOCKING)

    def _go_to_spot(self, view: View, spot: Spot, state: str) -> Intent:
        way = view.way(spot)
        if way is None:
            return Place(*spot, state=state)
        return Place(*way.place, bend=way.bend, exact=True, state=state)

    def _measure_way(self, dock: _Dock, spot: Spot, view: View) -> float:
        """Return `_open_length`; of a dock that the robot believes shut out `SHUT_OUT_M`, so that it takes another."""
        if view.fog.left_out is not None and view.fog.left_out[dock.point]:
            return SHUT_OUT_M
        return self._open_length(dock, spot, view)

    def _open_length(self, dock: _Dock, spot: Spot, view: View) -> float:
        """Return the length of the way from x and y in m to a dock, m; as the crow flies where no way is known."""
        length = float(dock.ways[view.point_of(spot)])
        return length if math.isfinite(length) else math.dist(dock.place, spot)

    def _needed_j(self, battery: BatterySpec, dock: _Dock, way_m: float, view: View) -> float:
        """Return the energy for a way of some m to a dock, and for the time that slow zones in force cost on it, J."""
        delay_s = self._delay_s(dock, (view.pose.x, view.pose.y), view)
        return way_m * (battery.drive + battery.idle / self._speed) + DETOUR * delay_s * battery.idle

    def _delay_s(self, dock: _Dock, spot: Spot, view: View) -> float:
        """Return the time that slow zones in force cost on the way from x and y in m to a dock, s."""
        return dock.slow_ways.delay_s(view.point_of(spot), view.zones)

    def _is_taken(self, dock: _Dock, tick: int) -> bool:
        return self._has_lasted(dock.used_since, tick, STOOD_S)

    def _find_nearest(self, view: View) -> _Dock:
        """Return the nearest dock, taken or not."""
        pose = view.pose.x, view.pose.y
        return min(self._docks, key=lambda dock: self._measure_way(dock, pose, view))

    def _choose_dock(self, view: View) -> _Dock | None:
        """Return the dock to go to: the nearest that is not taken, best one that none claims; or None."""
        battery, charge, pose = self._battery, view.charge, (view.pose.x, view.pose.y)
        assert battery is not None
        assert charge is not None
        left_j, nearest = charge * battery.capacity_j, self._find_nearest(view)
        best: tuple[bool, float, int] | None = None
        for index, dock in enumerate(self._docks):
            if dock is self._dock and dock.holds(pose):
                return dock
            if self._is_taken(dock, view.tick):
                continue
            way_m = self._measure_way(dock, pose, view)
            # A dock beyond the nearest one is of use only while the charge suffices for it.
            if self.goes and dock is not nearest and left_j < self._needed_j(battery, dock, DETOUR * way_m, view):
                continue
            claimed = any(self._is_claimed_by(number, dock, way_m, view) for number in self._others)
            key = claimed, way_m * (KEEP if dock is self._dock else 1.0), index
            best = key if best is None else min(best, key)
        return None if best is None else self._docks[best[2]]

    def _is_claimed_by(self, number: int, dock: _Dock, own_m: float, view: View) -> bool:
        """Return True if another robot goes to a dock, and has the shorter way."""
        neighbour = self._others[number]
        first, last = neighbour.course[0], neighbour.course[-1]
        passed_s = (last.tick - first.tick) * self._step
        if passed_s <= 0.0 or neighbour.at is not None:
            return neighbour.at is dock
        way_m = self._measure_way(dock, last.spot, view)
        # The other robot compares the same two pairs, so only one of them gives up the dock.
        if (way_m, number) > (own_m, self._number):
            return False
        nearer_m = self._measure_way(dock, first.spot, view) - way_m
        held_up_s = self._delay_s(dock, first.spot, view) - self._delay_s(dock, last.spot, view)
        return nearer_m + self._speed * held_up_s >= TOWARDS * self._speed * passed_s

    def _beside_m(self, dock: _Dock) -> float:
        """Return the length of the way to a dock up to which a robot is beside it, m."""
        return 1.5 * (dock.radius + self._clear_m)

    def _find_clear_points(self, dock: _Dock, terrain: Terrain) -> None:
        """Find the points beside a dock that are clear of all docks, and the nearest of them from which others pass.

        Where there is none, a robot leaves to the nearest clear point, and where all is near docks, not at all.
        """
        for other_dock in self._docks:
            dock.clear &= other_dock.ways > other_dock.radius + 0.5 * self._clear_m
        if not dock.clear.any():
            return
        # Before the points are narrowed down to near ones, of which there may be none.
        row, col = np.unravel_index(int(np.where(dock.clear, dock.ways, np.inf).argmin()), dock.ways.shape)
        nearest = terrain.centre(int(row), int(col))
        dock.clear &= dock.ways <= self._beside_m(dock)
        dock.exit = self._waiting.nearest(dock.ways, dock.clear, ()) or nearest
