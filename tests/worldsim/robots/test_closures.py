"""Closures in the world: when they close, what they stop and what robots see of them."""

from typing import Any

import pytest

from patrol.changing.ground import ChangingFootprint
from patrol.exchange import Reply, Sensed
from patrol.journal import Event
from patrol.pose import Velocity
from tests.worldsim.conftest import Lab

DISC = {"model": "holonomic", "radius": 0.4}
STRIP = [[8.0, 0.0], [9.0, 0.0], [9.0, 15.0], [8.0, 15.0]]


def strip(**when: Any) -> dict[str, Any]:
    return {"name": "strip", "polygon": STRIP} | when


def tick(world: Any, vx: float) -> tuple[list[Event], Sensed]:
    """One tick in which robot 1 drives along x."""
    events = list(world.close_and_open())
    sensed = world.begin_tick()[1]
    world.exchange({1: ()})
    world.end_tick({1: Reply(Velocity(vx, 0.0), "", None, 0.0, 0)})
    return events, sensed


def test_a_closed_closure_stops_a_body_that_sees_and_bumps_into_it(lab: Lab) -> None:
    world = lab.world([DISC], [(6.0, 7.0, 0.0)], duration=20.0, closures=[strip(closed=[[1, 6]])])
    for _ in range(2):
        events, sensed = tick(world, 1.0)
        assert not events
        assert not sensed.blocked
    events, sensed = tick(world, 1.0)
    assert [(event.k, event.kind, event.detail) for event in events] == [(2, "closed", "strip")]
    assert sensed.blocked
    width = world.terrain.width
    column = int(8.0 / world.terrain.point)
    assert {index % width for index in sensed.blocked} == {column}
    for _ in range(8):
        tick(world, 1.0)
    assert world.bodies[1].pose.x <= 7.6
    assert world.bodies[1].collisions > 0
    opened = [event.kind for _ in range(4) for event in tick(world, 1.0)[0]]
    assert opened == ["opened"]
    assert world.bodies[1].pose.x > 7.6


def test_a_robot_that_bumped_feels_what_is_a_step_and_a_point_away(lab: Lab) -> None:
    """Its radius, a step of 0.5 m and a point of 0.5 m are 1.5 m: it feels through the closed points that it sees.

    The strip is two points deep, from 8 to 9 m. The body stands at 7 m, so the second column begins 1.5 m away.
    """
    disc = {**DISC, "radius": 0.5, "speed": 1.0}
    felt = {}
    for x in (7.0, 6.9375):
        world = lab.world([disc], [(x, 7.25, 0.0)], duration=20.0, closures=[strip(closed=[[0, 9]])])
        tick(world, 0.0)
        body = world.bodies[1]
        body.bumped = True
        footprint = world.truth.footprint
        assert isinstance(footprint, ChangingFootprint)
        shown = world.closing.blocked(body, footprint)
        felt[x] = {divmod(index, world.terrain.width) for index in shown}
    rows = {row for row, col in felt[7.0] if col == 17}
    assert rows == {14}
    assert {col for _, col in felt[6.9375]} == {16}


def test_a_closure_waits_until_bodies_are_clear_of_it(lab: Lab) -> None:
    world = lab.world([DISC], [(6.0, 7.0, 0.0)], duration=20.0, closures=[strip(closed=[[2, 15]])])
    happened = [event for _ in range(12) for event in tick(world, 1.0)[0]]
    waited, closed = happened
    assert waited == Event(4, "waiting", 1, "strip waits to close: r1 in it")
    assert (closed.kind, closed.detail) == ("closed", "strip")
    assert closed.k > 4
    assert world.bodies[1].pose.x >= 9.4


@pytest.mark.parametrize(("x", "closes_at"), [(7.5, 0), (7.5625, None)])
def test_a_closure_closes_beside_a_body_that_only_touches_it(lab: Lab, x: float, closes_at: int | None) -> None:
    world = lab.world([{**DISC, "radius": 0.5}], [(x, 7.0, 0.0)], duration=4.0, closures=[strip(closed=[[0, 3]])])
    events = [(event.k, event.kind) for _ in range(4) for event in tick(world, 0.0)[0]]
    assert events == [(0, "waiting") if closes_at is None else (closes_at, "closed")]


def happened(lab: Lab, *faults: dict[str, Any], x: float = 3.0, **when: Any) -> list[tuple[int, str]]:
    """Return the events of 16 ticks of the strip under faults, with a robot that stands somewhere."""
    world = lab.world([DISC], [(x, 7.0, 0.0)], duration=8.0, closures=[strip(**when)], faults=faults)
    return [(event.k, event.kind) for _ in range(16) for event in tick(world, 0.0)[0]]


def test_a_fault_holds_a_closure_whatever_its_own_times_say(lab: Lab) -> None:
    closes = {"kind": "close", "closure": "strip", "at": 1, "for": 2}
    assert happened(lab) == []
    assert happened(lab, closes) == [(2, "closed"), (6, "opened")]
    opens = {"kind": "open", "closure": "strip", "at": 3, "for": 1}
    assert happened(lab, opens, closed=[[2, 5]]) == [(4, "closed"), (6, "opened"), (8, "closed"), (10, "opened")]
    assert happened(lab, {**closes, "at": 4}, closed=[[2, 5]]) == [(4, "closed"), (12, "opened")]


def test_of_several_faults_the_one_that_began_last_holds(lab: Lab) -> None:
    closes, opens = ({"kind": kind, "closure": "strip"} for kind in ("close", "open"))
    assert happened(lab, closes, {**opens, "at": 2, "for": 2}) == [(0, "closed"), (4, "opened"), (8, "closed")]
    assert happened(lab, {**opens, "at": 2, "for": 2}, closes) == [(0, "closed"), (4, "opened"), (8, "closed")]
    assert happened(lab, closes, opens) == []
    assert happened(lab, opens, closes) == [(0, "closed")]


def test_a_fault_does_not_close_on_a_body_and_may_end_before_it_could(lab: Lab) -> None:
    closes = {"kind": "close", "closure": "strip", "at": 1, "for": 2}
    assert happened(lab, closes, x=8.2) == [(2, "waiting"), (6, "stays open")]


def test_a_fault_leaves_no_trace_in_a_closures_draws(lab: Lab) -> None:
    opens = {"kind": "open", "closure": "strip", "at": 2, "for": 2}
    free, held = (happened(lab, *faults, closes=0.8, opens=0.8) for faults in ((), (opens,)))
    assert free != held
    assert [event for event in free if event[0] > 8] == [event for event in held if event[0] > 8]
    assert len([event for event in free if event[0] > 8]) > 1


def test_rates_close_and_open_as_often_as_they_say(lab: Lab) -> None:
    corner = [[18.0, 13.0], [19.0, 13.0], [19.0, 14.0], [18.0, 14.0]]
    door = {"name": "door", "polygon": corner, "closes": 0.2, "opens": 0.4}
    world = lab.world([DISC], [(3.0, 3.0, 0.0)], duration=2000.0, closures=[door])
    closed = 0
    for k in range(4000):
        world.tick = k
        list(world.close_and_open())
        closed += len(world.closing.closed)
    assert 0.28 < closed / 4000 < 0.39  # a third of the time


def test_a_closure_that_waits_for_several_names_them_all_and_bears_the_first_ones_number(lab: Lab) -> None:
    starts = [(3.0, 7.0, 0.0), (8.5, 7.0, 0.0), (8.5, 10.0, 0.0)]
    world = lab.world([DISC] * 3, starts, duration=4.0, closures=[strip(closed=[[0, 3]])])
    events = [event for _ in range(3) for event in tick(world, 0.0)[0]]
    assert events == [Event(0, "waiting", 2, "strip waits to close: r2, r3 in it")]
