"""A body that drives arcs of at least its turning radius, forward and in reverse.

At each tick a car is in one `Mode`. `NEXT` says which event leads from which mode to which:

- *Driving*: towards the goal ahead, turning as tightly as needed (paper, "nonholonomic robots").
- *Parking*: the place is near, with nothing in between; the car takes the step that ends nearest to it.
- *Manoeuvring*: it drives the arcs that a search has found (`agent.bodies.manoeuvre`).
- *Escaping*: no step towards the goal is free, or the car bumped; it gets out of the dead end (`Unstuck`).
- *Retreating*: it and another car block each other; it drives its own way backwards (`Retreat`).

For example, a car that manoeuvres and bumps into another one, three times within 3 s: its arcs are dropped at each bump
(driving), and at the third one it goes back (retreating). When it has gone back far enough it drives again.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Iterable, Mapping
from enum import Enum, auto
from functools import partial
from itertools import chain
from typing import TYPE_CHECKING

from agent.bodies.giveway import Bumps, nearest
from agent.bodies.manoeuvre import Manoeuvres, car_moves
from agent.bodies.setup import CLEAR_SHARE, BodyBase, BodySetup, way_of
from agent.bodies.steering import EASIER, CarSteering, Footing
from agent.ports import Bearing, Choice, Goal, Intent, Place, State
from patrol.ground.swept_path import advance
from patrol.pose import TAU, Drive, wrap
from patrol.random import Purpose

if TYPE_CHECKING:
    from agent.view import View
    from patrol.pose import Pose
    from patrol.radio.peers import Peer

OFTEN = 4
"""Number of bumps in a row from which on a car does not search for a manoeuvre but gets itself unstuck."""

ORIENTED = math.pi / 8
"""Largest deviation from the desired heading that counts as oriented, rad: half of one of eight sectors."""

CALM_S = 10.0
"""A dead end that begins later than this after the last one counts as a new one, s."""

LONGEST_RETREAT = 6
"""Upper bound of the number of steps that a robot backs before it tries again."""

AT_A_LOSS = 4
"""Number of dead ends in a row from which on the next direction is random."""

HOPELESS_S = 10.0
"""Time in one dead end after which the robot takes another, random direction, s."""

YIELDS = 0.5
"""Probability that a robot that bumped stands still for a step, so that of two that block each other one can go."""

PATIENCE = 3
"""Number of bumps after which a car goes back for one with a lower number."""

STUBBORN = 8
"""Number of bumps after which it goes back for one with a higher number, which may have nowhere to go."""

RETREAT_CALM_S = 3.0
"""Bumps further apart than this do not add up, s."""

SHORTEST_S = 2.0
"""Time for which a car goes back at first, s, on average."""

LONGEST_S = 16.0
"""It never goes back for longer than this, s."""

AGAIN_S = 15.0
"""A car that has to go back again within this time goes back twice as far, s."""

LONGEST_TRAIL = 256
"""Steps of the way that it came that a car remembers."""


class Mode(Enum):
    """The modes of a car; see above."""

    DRIVING = auto()
    PARKING = auto()
    MANOEUVRING = auto()
    ESCAPING = auto()
    RETREATING = auto()


class Event(Enum):
    """The events that lead from one mode of a car to another."""

    BUMPED = auto()
    """The last move was cancelled."""
    NEAR = auto()
    """The place is near, with nothing in between."""
    ARCS = auto()
    """There are arcs to be driven."""
    STUCK = auto()
    """No step towards the goal is possible."""
    BLOCKED = auto()
    """The car and another one have bumped again and again."""
    OVER = auto()
    """The end of what the car was doing."""


_DRIVES, _PARKS, _TURNS, _ESCAPES, _GOES_BACK = Mode
NEXT: Mapping[Mode, Mapping[Event, Mode]] = {
    mode: dict(zip(Event, row, strict=True))
    for mode, row in {
        #             BUMPED      NEAR        ARCS        STUCK       BLOCKED     OVER
        _DRIVES:    (_DRIVES,    _PARKS,     _TURNS,     _ESCAPES,   _GOES_BACK, _DRIVES),
        _PARKS:     (_DRIVES,    _PARKS,     _TURNS,     _ESCAPES,   _GOES_BACK, _DRIVES),
        _TURNS:     (_DRIVES,    _PARKS,     _TURNS,     _ESCAPES,   _GOES_BACK, _DRIVES),
        _ESCAPES:   (_ESCAPES,   _ESCAPES,   _ESCAPES,   _ESCAPES,   _GOES_BACK, _DRIVES),
        _GOES_BACK: (_DRIVES,    _GOES_BACK, _GOES_BACK, _GOES_BACK, _GOES_BACK, _DRIVES),
    }.items()
}  # fmt: skip
"""The mode after each event, by the mode before it."""


class Unstuck:
    """Backs out of a dead end, turning towards the direction in which most forces pulled when the robot got stuck.

    Where the robot can back no further it drives forward, still turning; where it can drive forward no further it backs
    again; and it stops as soon as it faces the desired direction. So far the paper. A robot whose nose is against a
    wall right in that direction would stop at once and be stuck again, for ever. So it backs at least one step, and one
    more for each time that it gets stuck again within `CALM_S`.

    A car's moves are not random, so what leads it into a dead end once does so again for ever, and two cars that block
    each other never part. So a robot that bumped sometimes stands still, and after `AT_A_LOSS` dead ends in a row, or
    `HOPELESS_S` in one, it chooses a random direction to face. From then on each bump makes the next move shorter, and
    each successful move makes the next one longer: between a wall and a wreck, which steering does not see, there may
    be room for a short step where a full one always bumps.

    As printed (`patrol.scenario.policies`), the paper's steps are all there is; the first step back is taken in any
    case, because the paper backs before it asks which way the robot faces.
    """

    def __init__(
        self,
        steering: CarSteering,
        speed: float,
        step: float,
        chance: Callable[[int, int], float],
        *,
        as_printed: bool = False,
    ) -> None:
        """Start outside of any dead end; `speed` is the top speed in m/s, `step` is in s per tick.

        `chance` returns a repeatable draw from [0, 1); it is called with a tick and 0 or 1 for the purpose of the draw.
        With `as_printed` the car follows the paper's five steps alone, which draw nothing.
        """
        self._as_printed = as_printed
        self._calm = round(CALM_S / step)
        self._hopeless = max(round(HOPELESS_S / step), 1)
        self._chance = chance
        self._begun = 0
        self._steering = steering
        self._speed = speed
        self._desired = 0.0
        self._backing = True
        self._retreat = 0
        self._in_a_row = 0
        self._wedged = False
        self._ease = 0
        self._stood = True
        self._ended = -self._calm - 1

    def keeps_happening(self, tick: int) -> bool:
        """Return True if the car has lately been stuck more than once in a row."""
        return self._in_a_row > 1 and tick - self._ended <= self._calm

    def begin(self, tick: int, desired: float) -> None:
        """Start to leave a dead end, towards the heading `desired` in rad."""
        again = tick - self._ended <= self._calm
        self._in_a_row = min(self._in_a_row + 1, LONGEST_RETREAT) if again else 1
        self._retreat = 1 if self._as_printed else self._in_a_row
        at_a_loss = self._in_a_row >= AT_A_LOSS and not self._as_printed
        self._desired = TAU * self._chance(tick, 0) if at_a_loss else desired
        self._begun = tick
        self._backing = True
        self._wedged = False
        self._ease = 0
        self._stood = True

    def end(self, tick: int) -> None:
        """Take note that the car has left the dead end, or does something else about it."""
        self._ended = tick

    def step(self, tick: int, pose: Pose, bumped: bool) -> Drive | None:
        """Return the next command on the way out; None when the robot has left the dead end."""
        if self._wedged and not self._stood:
            self._ease = min(self._ease + 1, len(EASIER) - 1) if bumped else max(self._ease - 1, 0)
        self._stood = True
        if bumped:
            self._backing = not self._backing
            if not self._as_printed and self._chance(tick, 1) < YIELDS:
                return Drive(0.0, 0.0)
        if tick - self._begun >= self._hopeless and not self._as_printed:
            self._wedged = True
            self._begun = tick
            self._desired = TAU * self._chance(tick, 0)
        if self._retreat <= 0 and abs(wrap(self._desired - pose.heading)) <= ORIENTED:
            return None
        for _ in range(2):
            for share in EASIER[self._ease :]:
                speed = share * self._speed * (-1.0 if self._backing else 1.0)
                drive = self._steering.turning(pose, self._desired, speed)
                if self._steering.is_free(pose, drive):
                    self._stood = False
                    self._retreat -= 1
                    return drive
            self._backing = not self._backing
        self._retreat -= 1
        return Drive(0.0, 0.0)


class Retreat:
    """Drives back along the car's own way when it and another car block each other."""

    def __init__(
        self,
        steering: CarSteering,
        number: int,
        radii: Mapping[int, float],
        step: float,
        chance: Callable[[int], float],
    ) -> None:
        """Start with an empty trail; radii are in m, `step` is in s per tick.

        `chance` is called with a tick and returns a repeatable draw from [0, 1).
        """
        self._steering = steering
        self._number = number
        self._radii = radii
        self._step = step
        self._chance = chance
        self._trail: deque[Drive] = deque(maxlen=LONGEST_TRAIL)
        self._last: Drive | None = None
        self._until = 0
        self._ended = -math.inf
        self._again = 0
        self._bumps = Bumps(RETREAT_CALM_S / step)

    def remember(self, drive: Drive) -> None:
        """Remember the command of this tick; call it last."""
        self._last = drive if drive.speed != 0.0 else None

    def update(self, tick: int, pose: Pose, bumped: bool, peers: Mapping[int, Peer], *, goes_back: bool) -> bool:
        """Take in the effect of the last command, and return True if the car has to go back from now on.

        Call it first in each tick.
        """
        last, self._last = self._last, None
        if not bumped:
            if last is not None and goes_back:
                self._trail.pop()
            elif last is not None:
                self._trail.append(last)
            return False
        if goes_back:
            return False
        self._bumps.add(tick)
        other = self._neighbour(pose, peers)
        if other is None or not self._trail or self._bumps.count < (PATIENCE if other < self._number else STUBBORN):
            return False
        self._again = self._again + 1 if tick - self._ended <= AGAIN_S / self._step else 0
        spell_s = min(LONGEST_S, SHORTEST_S * 2.0**self._again * (0.5 + self._chance(tick)))
        self._until = tick + max(1, round(spell_s / self._step))
        self._bumps.clear()
        return True

    def next(self, tick: int, pose: Pose) -> Drive | None:
        """Return the next command on the way back; None when the car has gone back far enough or cannot go on."""
        if tick < self._until and self._trail:
            drive = Drive(-self._trail[-1].speed, self._trail[-1].curvature)
            if self._steering.is_free(pose, drive):
                return drive
        return None

    def end(self, tick: int) -> None:
        """Take note that the car goes back no more."""
        self._ended = tick

    def _neighbour(self, pose: Pose, peers: Mapping[int, Peer]) -> int | None:
        """Return the nearest robot's number; None if no robot is within two steps."""
        gap, number = nearest(pose, peers, self._radii)
        return number if gap <= self._radii[self._number] + 2.0 * self._steering.stride else None


class CarBody(BodyBase):
    """Drives towards the goal ahead, and gets itself out of dead ends (paper, "unstuck")."""

    command = Drive

    def __init__(self, setup: BodySetup) -> None:
        super().__init__(setup)
        self._steering = CarSteering(setup.spec, setup.ground.terrain, setup.step)
        self._footing = Footing(setup.ground.terrain, setup.ground, setup.spec.radius, wanted=setup.patrol.manoeuvres)
        self._step = setup.step
        chance = setup.chance
        self._unstuck = Unstuck(
            self._steering,
            setup.spec.speed,
            setup.step,
            partial(chance, Purpose.UNSTUCK),
            as_printed="plain-unstuck" in setup.patrol.paper_rules,
        )
        self._parking = max(self.stride, 2.0 * setup.spec.turning_radius)
        self._chance = chance
        self._bumps = 0
        self._mode = Mode.DRIVING
        self._manoeuvres: Manoeuvres | None = None
        self._retreat: Retreat | None = None
        if setup.patrol.manoeuvres:
            self._retreat = Retreat(
                self._steering,
                setup.spec.number,
                setup.radii,
                setup.step,
                lambda k: chance(Purpose.UNSTUCK, k, 2),
            )
            moves = car_moves(setup.spec, setup.step, setup.ground.terrain.point)
            self._manoeuvres = Manoeuvres(moves, setup.spec, setup.ground.terrain, self._steering.is_free, setup.step)

    def obey(self, intent: Intent, view: View) -> Choice:
        """Return the command that best carries out an intent, and remember it for the way back."""
        choice = super().obey(intent, view)
        assert isinstance(choice.command, Drive)
        if self._retreat is not None:
            self._retreat.remember(choice.command)
        return choice

    def _choose(self, intent: Intent, view: View) -> Choice:
        tick, pose = view.tick, view.pose
        if self._retreat is None:
            return super()._choose(intent, view)
        goes_back = self._mode is Mode.RETREATING
        if self._retreat.update(tick, pose, view.bumped, view.peers, goes_back=goes_back):
            self._after(Event.BLOCKED, tick)
        elif view.bumped:
            self._after(Event.BUMPED, tick)
        back = None
        if self._mode is Mode.RETREATING:
            back = self._retreat.next(tick, pose)
            if back is None:
                self._after(Event.OVER, tick)
        return self._carry_out(intent, view) if back is None else Choice(back, intent.state)

    def _after(self, event: Event, tick: int) -> None:
        """Enter the mode that follows, and end what belongs to the one before. Arcs end with a bump."""
        before, self._mode = self._mode, NEXT[self._mode][event]
        if before is Mode.ESCAPING and self._mode is not before:
            self._unstuck.end(tick)
        if before is Mode.RETREATING and self._mode is not before and self._retreat is not None:
            self._retreat.end(tick)
        if event in (Event.BUMPED, Event.BLOCKED) and self._manoeuvres is not None:
            self._manoeuvres.drop()

    def _stay(self, state: str, view: View) -> Choice:
        return self._drive(view, None, None, state) if self._mode is Mode.ESCAPING else self._stand(state)

    def _bear(self, intent: Bearing, view: View) -> Choice:
        bearing, goal = self._ahead(intent, view)
        if view.start is None and (back := self._come_back(view, intent.state)) is not None:
            return back
        if intent.wander is not None and not view.bumped and self._mode is not Mode.ESCAPING:
            aside = self._steering.turning(view.pose, intent.wander, self.spec.speed)
            if self._steering.is_free(view.pose, aside):
                return Choice(aside, intent.state, intent.wander)
        return self._drive(view, bearing, goal, intent.state)

    def _ahead(self, intent: Bearing, view: View) -> tuple[float | None, Goal | None]:
        """The strongest direction that leads at least half a step, and its goal; the strongest of all if none does.

        The paper's forces act along first steps of paths, which are free by construction. A bearing rounded to its
        sector's bisector may point into a wall right beside the robot. Where it does so again and again, a car would
        never get away, because its moves are not random. It then takes the exact bearing of the strongest force.
        """
        start = view.start
        if start is None or not intent.bearings:
            return None, None
        bearings: Iterable[float] = intent.bearings
        centre = view.ground.centre(*start)
        if intent.bend is not None and self._unstuck.keeps_happening(view.tick):
            across, up = (there - here for there, here in zip(intent.bend, centre, strict=True))
            bearings = chain((math.atan2(up, across),), bearings)
        strongest: tuple[float, Goal] | None = None
        for bearing in bearings:
            goal = self.goals.along(bearing, *start)
            if math.dist(goal.goal, centre) >= CLEAR_SHARE * self.stride:
                return bearing, goal
            strongest = strongest or (bearing, goal)
        assert strongest is not None
        return strongest

    def _approach(self, place: Place, view: View) -> Choice:
        """Return the way to a place, and parking there."""
        found = way_of(place, view)
        if found is None:
            return self._come_back(view, place.state) or self._drive(view, None, None, place.state)
        spot, bend = found
        pose = view.pose
        self._bumps = self._bumps + 1 if view.bumped else 0
        if place.wander is not None and not view.bumped and self._mode is not Mode.ESCAPING:
            aside = self._steering.turning(pose, place.wander, self.spec.speed)
            end = advance(pose, aside, self._step)
            if self._steering.is_free(pose, aside) and self._footing.may_end(pose, end.x, end.y):
                return Choice(aside, place.state, place.wander)
        bearing, goal = math.atan2(bend[1] - pose.y, bend[0] - pose.x), Goal(spot, bend)
        exact = place.exact and self._manoeuvres is not None
        parking = self._parking if self._manoeuvres is None else self._manoeuvres.parking
        near = bend == spot and math.dist((pose.x, pose.y), spot) < parking
        if near and not exact and not view.bumped and self._mode is not Mode.ESCAPING:
            self._after(Event.NEAR, view.tick)
            return Choice(self._steering.park(pose, spot), place.state, bearing, goal)
        if self._manoeuvres is not None and self._mode is not Mode.ESCAPING and self._bumps < OFTEN:
            if view.bumped and self._chance(Purpose.UNSTUCK, view.tick, 1) < YIELDS:
                return Choice(Drive(0.0, 0.0), place.state, bearing, goal)
            is_there = exact and view.point_of((view.reported.x, view.reported.y)) == view.point_of(spot)
            drive = Drive(0.0, 0.0) if is_there else self._manoeuvres.next(view, spot, exact=exact)
            self._after(Event.OVER if drive is None else Event.ARCS, view.tick)
            if drive is not None:
                return Choice(drive, place.state, bearing, goal)
        choice = self._drive(view, bearing, goal, place.state)
        return Choice(choice.command, choice.state, bearing, goal)

    def _come_back(self, view: View, state: str) -> Choice | None:
        """Return a step of a car that is off the reachable points, back to them; None where it knows no way there."""
        pose = view.pose
        if self._manoeuvres is None or self._mode is Mode.ESCAPING or not self.way_back.is_needed(pose.x, pose.y):
            return None
        # A manoeuvre may lead over places from which no route leads on: it goes on to its end.
        if not view.bumped and (drive := self._manoeuvres.proceed(pose)) is not None:
            self._after(Event.ARCS, view.tick)
            return Choice(drive, state)
        left = self.way_back.paths(pose.x, pose.y)
        if left is None:
            return None
        drive = None if view.bumped else self._manoeuvres.back(view, left)
        if drive is not None:
            self._after(Event.ARCS, view.tick)
            return Choice(drive, State.DEAD_END)
        self._escape(view.tick, TAU * self._chance(Purpose.UNSTUCK, view.tick, 0))
        return self._drive(view, None, None, State.HOLDING)

    def _drive(self, view: View, bearing: float | None, goal: Goal | None, state: str) -> Choice:
        """Towards the goal ahead in direction ``bearing`` (rad), or out of a dead end."""
        tick, pose, bumped = view.tick, view.pose, view.bumped
        if self._mode is Mode.ESCAPING:
            drive = self._unstuck.step(tick, pose, bumped)
            if drive is not None:
                return Choice(drive, State.DEAD_END, None, goal)
            self._after(Event.OVER, tick)
            bumped = False
        if goal is None or bearing is None:
            return self._stand(State.HOLDING)
        drive = self._steering.towards(pose, goal.refined)
        if not bumped and self._steering.is_free(pose, drive):
            self._after(Event.OVER, tick)
            return Choice(drive, state, bearing, goal)
        self._escape(tick, bearing)
        out = self._unstuck.step(tick, pose, bumped=False)
        if out is None:
            self._after(Event.OVER, tick)
        return Choice(out or Drive(0.0, 0.0), State.DEAD_END, bearing, goal)

    def _escape(self, tick: int, desired: float) -> None:
        """Begin to leave a dead end, to face the direction `desired`, rad."""
        self._after(Event.STUCK, tick)
        self._unstuck.begin(tick, desired)

    def _allowed(self, pose: Pose, wanted: Drive) -> Drive | None:
        return wanted if self._steering.is_free(pose, wanted) else None
