"""The watch over the battery: robots charge in time, one at each dock, and the others do without them meanwhile."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import pytest

from agent.build import Shared, build_mind
from agent.policies.charging import Charging
from agent.policies.surround import Surround
from agent.ports import Intent, Place, State, Stay
from fogwatch.inprocess import run_in_process
from patrol.exchange import Sensed
from patrol.journal import TickRecord
from patrol.pose import Pose
from patrol.prepare import prepare
from patrol.radio.message import Position, encode
from patrol.scenario import Scenario, load_scenario
from tests.present import present

if TYPE_CHECKING:
    from agent.mind import Mind
    from agent.view import View

BATTERY = {"capacity": 3.0, "idle": 10.0, "drive": 30.0, "charge": 200.0}
"""10.8 kJ; enough for 196 s of driving at 1.5 m/s."""
DOCKS = [{"place": [10.5, 10.5]}, {"place": [90.5, 10.5]}]


def scenario(count: int = 3, duration: float = 1200.0, docks: Any = DOCKS, **more: Any) -> Scenario:
    robots = {"count": count, "model": "holonomic", "radius": 0.4, "speed": 1.5, "battery": BATTERY}
    raw = {"terrain": {"builtin": "open"}, "point": 1.0, "duration": duration, "robots": robots, "docks": docks}
    return load_scenario({**raw, **more})


class Told:
    """A policy that always wants the same, and keeps what it was shown."""

    def __init__(self, intent: Intent) -> None:
        self.intent = intent
        self.views: list[View] = []

    def decide(self, view: View) -> Intent:
        self.views.append(view)
        return self.intent


class Fleet:
    """One mind that hears others where a test puts them."""

    def __init__(self, setting: Scenario, intent: Intent | None = None) -> None:
        self.mind: Mind = build_mind(Shared(prepare(setting)), 1)
        assert isinstance(self.mind.policy, Charging)
        self.watch = self.mind.policy
        self.watch.otherwise = self.told = Told(intent or Stay())
        self.k = 0

    def step(self, charge: float | None, own: tuple[float, float], others: Mapping[int, tuple[float, float]]) -> str:
        """Decide once; the state that the mind reports."""
        frames = [encode(Position.of(n, self.k, 0.5 * self.k, Pose(*spot, 0.0)), None) for n, spot in others.items()]
        decision = self.mind.step(Sensed(self.k, Pose(*own, 0.0), clock_s=0.5 * self.k, charge=charge), frames)
        self.goal = decision.goal
        self.k += 1
        return decision.state


def test_without_docks_there_is_no_watch() -> None:
    plain = load_scenario({"terrain": {"builtin": "open"}, "point": 1.0})
    assert isinstance(build_mind(Shared(prepare(plain)), 1).policy, Surround)


def test_a_robot_goes_when_the_charge_just_suffices_for_the_way() -> None:
    fleet = Fleet(scenario(count=1))
    # 40 m away, at 30 + 10 / 1.5 J per m and 1.3 times the way: about 2 kJ of 10.8, above the reserve of 0.1.
    for charge, state in ((0.9, State.HOLDING), (0.4, State.HOLDING), (0.25, State.DOCKING), (0.9, State.DOCKING)):
        assert fleet.step(charge, (50.5, 10.5), {}) == state, charge
    assert [fleet.step(0.96, (50.5, 10.5), {}) for _ in range(40)][-1] == State.HOLDING


@pytest.mark.parametrize(("times", "state"), [([[0, 600]], State.DOCKING), ([[600, 900]], State.HOLDING)])
def test_a_robot_goes_earlier_when_the_way_leads_through_a_slow_zone(times: Any, state: str) -> None:
    # 20 m at 0.2 m/s in place of 1.5 m/s: 87 s more at 10 W, 1.3 times: 1.1 kJ, a tenth of the battery.
    ward = {"name": "ward", "polygon": [[20, 0], [40, 0], [40, 100], [20, 100]], "speed": 0.2, "times": times}
    fleet = Fleet(scenario(count=1, zones=[ward], docks=DOCKS[:1]))
    assert fleet.step(0.35, (50.5, 10.5), {}) == state


def test_a_robot_that_does_not_know_its_charge_is_left_alone() -> None:
    fleet = Fleet(scenario(count=1))
    assert fleet.step(None, (50.5, 10.5), {}) == State.HOLDING


@pytest.mark.parametrize(("charge", "goal_m"), [(0.3, 90.5), (0.2, 10.5)])
def test_it_takes_the_nearest_free_dock_that_its_charge_suffices_for(charge: float, goal_m: float) -> None:
    fleet = Fleet(scenario(count=2))
    for _ in range(6):
        fleet.step(0.95, (30.5, 10.5), {2: (10.5, 10.5)})
    assert fleet.step(charge, (30.5, 10.5), {2: (10.5, 10.5)}) == State.DOCKING
    assert fleet.goal == (goal_m, 10.5)


@pytest.mark.parametrize(
    ("times", "step_m", "goal"),
    [
        ([[0, 600]], 0.1, 90.5),  # at 0.2 m/s, as fast as the zone allows
        ([[0, 600]], 0.0, 10.5),
        ([[600, 900]], 0.1, 10.5),  # at 0.2 m/s of 1.5 m/s
        ([[600, 900]], 0.75, 90.5),
    ],
)
def test_a_dock_is_claimed_by_one_that_comes_as_fast_as_zones_allow(times: Any, step_m: float, goal: float) -> None:
    ward = {"name": "ward", "polygon": [[12, 0], [30, 0], [30, 100], [12, 100]], "speed": 0.2, "times": times}
    fleet = Fleet(scenario(count=2, zones=[ward]))
    for k in range(11):
        fleet.step(0.95, (45.5, 10.5), {2: (25.5 - step_m * k, 10.5)})
    assert fleet.step(0.25, (45.5, 10.5), {2: (25.5 - step_m * 11, 10.5)}) == State.DOCKING
    assert fleet.goal == (goal, 10.5)


def test_of_two_that_want_one_dock_the_nearer_goes() -> None:
    for ahead, goal in ((25.5, (90.5, 10.5)), (60.5, (10.5, 10.5))):
        fleet = Fleet(scenario(count=2))
        for k in range(12):
            fleet.step(1.0, (45.5, 10.5), {2: (ahead - 0.75 * k, 10.5)})
        fleet.step(0.25, (45.5, 10.5), {2: (ahead - 0.75 * 12, 10.5)})
        assert fleet.goal == goal, ahead


def test_without_a_free_dock_it_waits_clear_of_them() -> None:
    fleet = Fleet(scenario(count=2, docks=DOCKS[:1]))
    for _ in range(6):
        fleet.step(1.0, (40.5, 10.5), {2: (10.5, 10.5)})
    assert fleet.step(0.1, (40.5, 10.5), {2: (10.5, 10.5)}) == State.DOCKING
    assert fleet.goal is not None
    assert fleet.step(0.1, (15.5, 10.5), {2: (10.5, 10.5)}) == State.DOCKING
    assert fleet.goal is None


def test_one_that_stands_at_a_dock_is_hidden_from_the_policy_and_one_that_passes_is_not() -> None:
    fleet = Fleet(scenario(count=3))
    for k in range(8):
        fleet.step(1.0, (50.5, 50.5), {2: (10.5, 10.5), 3: (5.0 + 1.5 * k, 10.5)})
    assert set(fleet.told.views[0].peers) == {2, 3}
    assert set(fleet.told.views[-1].peers) == {3}
    assert fleet.told.views[-1].charging == {2}


def test_a_policy_that_stands_still_does_not_block_a_dock() -> None:
    fleet = Fleet(scenario(count=1))
    assert fleet.step(0.99, (10.5, 10.5), {}) != State.HOLDING
    assert math.dist(present(fleet.goal), (10.5, 10.5)) > 1.5
    assert fleet.step(0.99, (50.5, 50.5), {}) == State.HOLDING


def driven(fleet: Fleet, charge: float, own: tuple[float, float], ticks: int = 320) -> None:
    """Let robot 2 drive there and back for 20 m, beside the dock at the end: 35 J in each tick, at most all it has."""
    for k in range(ticks):
        fleet.step(charge, own, {2: (15.5, 10.5 + 20.0 * abs((k / 20.0) % 2.0 - 1.0))})


def test_one_that_charges_makes_room_for_one_with_much_less_charge() -> None:
    for used, state in ((False, State.CHARGING), (True, State.PATROLLING)):
        fleet = Fleet(scenario(count=2, docks=DOCKS[:1]), Place(50.0, 50.0))
        if used:
            driven(fleet, 0.15, (10.5, 10.5))
        for _ in range(20):
            assert fleet.step(0.15, (10.5, 10.5), {2: (15.5, 30.5)}) == State.CHARGING
        assert [fleet.step(0.9, (10.5, 10.5), {2: (15.5, 10.5)}) for _ in range(20)][-1] == state


def beside_one_that_charges() -> Fleet:
    """A robot, and another that has stood at a dock for 20 s and has all of its charge."""
    fleet = Fleet(scenario(count=2, docks=[DOCKS[0], {"place": [50.5, 10.5]}]))
    for _ in range(40):
        assert fleet.step(0.5, (50.5, 50.5), {2: (10.5, 10.5)}) == State.HOLDING
    return fleet


def test_a_robot_that_passes_one_that_has_charged_for_long_takes_over() -> None:
    fleet = beside_one_that_charges()
    assert fleet.step(0.5, (15.5, 10.5), {2: (10.5, 10.5)}) == State.DOCKING
    assert fleet.goal is None
    for k in range(1, 6):
        fleet.step(0.5, (15.5, 10.5), {2: (10.5, 10.5 + 0.7 * k)})
    assert fleet.goal == (10.5, 10.5)


def test_a_robot_that_passes_one_that_has_charged_and_waits_beside_the_dock_takes_over() -> None:
    fleet = beside_one_that_charges()
    for _ in range(20):
        fleet.step(0.5, (50.5, 50.5), {2: (10.5, 13.5)})
    assert fleet.step(0.5, (15.5, 10.5), {2: (10.5, 13.5)}) == State.DOCKING
    assert fleet.goal == (10.5, 10.5)


def test_a_robot_with_much_charge_takes_nothing_over() -> None:
    fleet = beside_one_that_charges()
    assert fleet.step(0.8, (15.5, 10.5), {2: (10.5, 10.5)}) == State.HOLDING


def test_it_does_not_wait_long_for_one_that_makes_no_room() -> None:
    fleet = beside_one_that_charges()
    states = [fleet.step(0.5, (15.5, 10.5), {2: (10.5, 10.5)}) for _ in range(60)]
    assert states.count(State.DOCKING) == 30
    assert states[-1] == State.HOLDING


def test_it_waits_again_two_minutes_later() -> None:
    fleet = beside_one_that_charges()
    states = [fleet.step(0.5, (15.5, 10.5), {2: (10.5, 10.5)}) for _ in range(250)]
    assert [k for k, state in enumerate(states) if state == State.DOCKING] == [*range(30), *range(240, 250)]


def test_one_that_charges_makes_room_once_the_other_has_waited_for_four_seconds() -> None:
    fleet = Fleet(scenario(count=2, docks=DOCKS[:1]), Place(50.0, 50.0))
    driven(fleet, 0.15, (10.5, 10.5))
    for k in range(20):
        fleet.step(0.9, (10.5, 10.5), {2: (15.5, 20.0 - 0.5 * k)})
    states = [fleet.step(0.9, (10.5, 10.5), {2: (15.5, 10.5)}) for _ in range(20)]
    assert states == [State.CHARGING] * 7 + [State.PATROLLING] * 13, "it came with the last of the ticks before"


def test_too_many_on_patrol_count_once_that_has_been_so_for_twenty_seconds() -> None:
    fleet = Fleet(scenario())
    others = [{2: (70.5, 30.5), 3: (80.5, 50.5)} for _ in range(60)]
    states = [fleet.step(0.5, (50.5, 30.5 + 0.3 * k), there) for k, there in enumerate(others)]
    assert states.index(State.DOCKING) == 40


def charged_while(others: Mapping[int, tuple[float, float]]) -> Fleet:
    """A robot of three that has charged at a dock, while others are somewhere; two of the three patrol."""
    fleet = Fleet(scenario(), Place(50.0, 50.0))
    for charge in (0.15, 0.15, 0.96):
        fleet.step(charge, (10.5, 10.5), others)
    return fleet


def test_a_robot_that_has_charged_waits_beside_its_dock_while_enough_are_on_patrol() -> None:
    others = {2: (50.5, 30.5), 3: (70.5, 30.5)}
    fleet = charged_while(others)
    assert fleet.goal is not None
    assert math.dist(fleet.goal, (10.5, 10.5)) > 1.5
    for _ in range(80):
        assert fleet.step(0.96, (10.5, 13.5), others) == State.DOCKING
    assert fleet.goal is None


@pytest.mark.parametrize(
    ("third", "later", "ticks"), [((70.5, 30.5), {2: (10.5, 10.5)}, 8), ((90.5, 10.5), {}, 80)], ids=["comes", "few"]
)
def test_it_goes_back_when_another_comes_or_too_few_patrol(
    third: tuple[float, float], later: Mapping[int, tuple[float, float]], ticks: int
) -> None:
    others = {2: (50.5, 30.5), 3: third}
    fleet = charged_while(others)
    states = [fleet.step(0.96, (10.5, 13.5), {**others, **later}) for _ in range(ticks)]
    assert (states[0], states[-1]) == (State.DOCKING, State.PATROLLING)


@pytest.mark.parametrize(("other_m", "state"), [(0.0, State.DOCKING), (0.6, State.HOLDING)])
def test_of_too_many_on_patrol_the_one_with_the_least_charge_goes(other_m: float, state: str) -> None:
    fleet = Fleet(scenario())
    others = [{2: (70.5, 30.5 + other_m * k), 3: (80.5, 50.5)} for k in range(60)]
    assert [fleet.step(0.5, (50.5, 30.5 + 0.3 * k), there) for k, there in enumerate(others)][-1] == state


def test_a_robot_that_has_to_charge_soon_does_so_in_passing() -> None:
    for charge, far, near in ((0.5, State.HOLDING, State.HOLDING), (0.19, State.DOCKING, State.DOCKING)):
        fleet = Fleet(scenario(count=1))
        assert [fleet.step(charge, (x, 10.5), {}) for x in (40.5, 18.5)] == [far, near]


@pytest.mark.parametrize("policy", ["stochastic", "committed", "potential-field", "cr"])
def test_nobody_strands_whatever_the_policy(policy: str) -> None:
    setting = scenario(duration=480.0, patrol={"policy": policy})
    longest = dict.fromkeys(range(1, 4), 0)
    together = 0

    def look(record: TickRecord) -> None:
        nonlocal together
        at = [[r for r in record.robots if math.dist(d.place, (r.x, r.y)) <= d.radius] for d in setting.docks]
        together = max(together, *(sum(r.state == State.CHARGING for r in rows) for rows in at))
        for row in record.robots:
            idles = any(row in rows for rows in at) and row.state != State.CHARGING
            longest[row.number] = longest[row.number] + 1 if idles else 0
            assert longest[row.number] * setting.step < 120.0

    outcome = run_in_process(setting, keep=False, verify_fog=False, progress=look)
    assert outcome.verdict.valid, outcome.verdict.failed
    assert not [line for line in outcome.verdict.warnings if "battery" in line]
    batteries = [robot.battery for robot in outcome.summary.robots.values()]
    assert all(battery is not None and battery.charges >= 1 and battery.least_share > 0.02 for battery in batteries)
    assert together == 1


@pytest.mark.parametrize("policy", ["potential-field", "cr"])
def test_a_robot_does_not_strand_on_a_long_way_through_a_slow_zone(policy: str) -> None:
    battery = {"capacity": 4.0, "idle": 10.0, "drive": 5.0, "charge": 200.0}
    robots = {"model": "holonomic", "radius": 0.4, "speed": 1.5, "battery": battery, "starts": [[80.5, 30.5]]}
    ward = {"name": "ward", "polygon": [[20, 0], [40, 0], [40, 100], [20, 100]], "speed": 0.15}
    more: dict[str, Any] = {"zones": [ward], "patrol": {"policy": policy}, "robots": {"count": 1, **robots}}
    setting = scenario(duration=1500.0, docks=DOCKS[:1], **more)
    outcome = run_in_process(setting, keep=False, verify_fog=False)
    assert outcome.verdict.valid, outcome.verdict.failed
    (used,) = [robot.battery for robot in outcome.summary.robots.values()]
    assert used is not None
    assert used.charges >= 1
    assert used.least_share > 0.1


@pytest.mark.parametrize(("gone_m", "goal"), [(44.0, 10.5), (45.0, 90.5)])
def test_it_keeps_to_a_dock_that_is_up_to_a_quarter_farther_than_another(gone_m: float, goal: float) -> None:
    """The docks are 80 m apart: 0.8 * 44 m is less than 36 m, and 0.8 * 45 m is not less than 35 m."""
    fleet = Fleet(scenario(count=1))
    assert fleet.step(0.25, (50.5, 10.5), {}) == State.DOCKING
    assert fleet.goal == (10.5, 10.5)
    fleet.step(0.25, (10.5 + gone_m, 10.5), {})
    assert fleet.goal == (goal, 10.5)


@pytest.mark.parametrize(("stands", "goal"), [(6, 90.5), (7, 10.5)])
def test_a_dock_is_wanted_by_one_that_came_at_half_of_its_speed_over_five_seconds(stands: int, goal: float) -> None:
    """At 1.5 m/s that is 3.75 m: 4 m in the last 10 ticks are enough, 3 m are not."""
    fleet = Fleet(scenario(count=2))
    spots = [45.5 - k for k in range(20)] + [26.5] * stands
    for x in spots[:-1]:
        fleet.step(0.95, (45.5, 10.5), {2: (x, 10.5)})
    assert fleet.step(0.25, (45.5, 10.5), {2: (spots[-1], 10.5)}) == State.DOCKING
    assert fleet.goal == (goal, 10.5)


@pytest.mark.parametrize(("off_m", "state"), [(0.008, State.CHARGING), (0.015, State.DOCKING)])
def test_a_robot_is_at_a_dock_to_within_the_error_of_its_position(off_m: float, state: str) -> None:
    """The dock's radius is that which is given, and positions are heard to within 0.01 m."""
    fleet = Fleet(scenario(count=1, docks=[{"place": [10.5, 10.5], "radius": 1.5}]))
    assert fleet.step(0.15, (12.0 + off_m, 10.5), {}) == state


@pytest.mark.parametrize(("step_m", "hidden"), [(0.012, True), (0.018, True), (0.03, False)])
def test_one_that_waits_beside_a_dock_may_seem_to_move_by_two_roundings(step_m: float, hidden: bool) -> None:
    fleet = Fleet(scenario(count=2))
    for k in range(30):
        fleet.step(1.0, (50.5, 50.5), {2: (10.5, 10.5) if k < 10 else (10.5, 14.0 + step_m * (k % 2))})
    assert (2 not in fleet.told.views[-1].peers) is hidden


@pytest.mark.parametrize(("charge", "goal"), [(0.48, None), (0.47, (10.5, 10.5))])
def test_one_that_waits_beside_its_dock_charges_again_below_half_of_full(
    charge: float, goal: tuple[float, float] | None
) -> None:
    """Docks charge to 0.95."""
    others = {2: (50.5, 30.5), 3: (70.5, 30.5)}
    fleet = charged_while(others)
    assert fleet.step(charge, (10.5, 13.5), others) == State.DOCKING
    assert fleet.goal == goal


@pytest.mark.parametrize(("charge", "state"), [(0.6, State.CHARGING), (0.613, State.PATROLLING)])
def test_room_is_made_by_one_with_a_third_of_the_capacity_more(charge: float, state: str) -> None:
    """The other has driven 220 m in 110 s, and stood for 10 s: 0.278 is left of its charge; 0.35 - 0.02 more: 0.608."""
    fleet = Fleet(scenario(count=2, docks=DOCKS[:1]), Place(50.0, 50.0))
    driven(fleet, 0.15, (10.5, 10.5), ticks=220)
    assert [fleet.step(charge, (10.5, 10.5), {2: (15.5, 10.5)}) for _ in range(20)][-1] == state


@pytest.mark.parametrize(
    ("charge", "x", "state"),
    [
        (0.2, 21.5, State.DOCKING),  # 11 m from the dock
        (0.2, 23.5, State.HOLDING),  # 13 m; 8 s at 1.5 m/s are 12 m
        (0.21, 21.5, State.HOLDING),  # 0.1 above the reserve is 0.2
    ],
)
def test_it_charges_in_passing_within_eight_seconds_of_a_dock(charge: float, x: float, state: str) -> None:
    assert Fleet(scenario(count=1)).step(charge, (x, 10.5), {}) == state
