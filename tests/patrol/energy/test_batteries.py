from dataclasses import replace
from typing import Any

import pytest

from patrol.energy.batteries import Batteries
from patrol.errors import BadInput
from patrol.journal import RobotTick, Status
from patrol.scenario import Scenario, load_scenario

DISC = {"model": "holonomic", "speed": 2.0, "radius": 0.4}
BATTERY = {"capacity": 1.0, "idle": 10.0, "drive": 100.0, "charge": 110.0, "start": 0.5}


def scenario(robots: int = 1, **battery: Any) -> Scenario:
    entry = {**DISC, "battery": {**BATTERY, **battery}}
    docks = [{"place": [5.0, 5.0], "radius": 1.0}]
    return load_scenario({"terrain": {"builtin": "open"}, "point": 1.0, "robots": [entry] * robots, "docks": docks})


def batteries_of(scenario: Scenario) -> Batteries:
    return Batteries(scenario.roster, scenario.docks, scenario.step)


def row(x: float, y: float, speed: float = 0.0, number: int = 1) -> RobotTick:
    return RobotTick(number, Status.ALIVE, x, y, 0.0, speed, 0.0, False, "patrolling", None, None, None)


def test_driving_uses_charge_by_time_and_way() -> None:
    batteries = batteries_of(scenario())
    batteries.tick([row(20.0, 20.0, speed=2.0)])  # half a second, 1 m
    assert batteries.share(1) == pytest.approx((1800.0 - 5.0 - 100.0) / 3600.0)
    batteries.tick([replace(row(20.0, 20.0, speed=2.0), bumped=True)])  # its move was cancelled
    assert batteries.share(1) == pytest.approx((1800.0 - 10.0 - 100.0) / 3600.0)


def test_a_robot_charges_while_it_stands_at_a_dock_and_is_the_nearest() -> None:
    batteries = batteries_of(scenario())
    for x, speed, change in ((5.9, 0.0, 50.0), (6.0, 0.0, 50.0), (6.001, 0.0, -5.0), (5.9, 2.0, -105.0)):
        before = batteries.share(1)
        assert before is not None
        batteries.tick([row(x, 5.0, speed)])
        assert batteries.share(1) == pytest.approx(before + change / 3600.0)
        assert batteries.docked == ({1} if change > 0.0 else set())
    batteries = batteries_of(scenario(2))
    batteries.tick([row(5.6, 5.0), row(4.5, 5.0, number=2)])
    assert batteries.docked == {2}


def test_charge_stays_between_nothing_and_the_capacity() -> None:
    batteries = batteries_of(scenario(start=1.0))
    batteries.tick([row(5.0, 5.0)])
    assert batteries.share(1) == 1.0
    batteries = batteries_of(scenario(start=0.001))
    batteries.tick([row(20.0, 20.0)])
    assert batteries.share(1) == 0.0
    assert batteries.is_empty(1)
    batteries.tick([row(5.0, 5.0)])
    assert not batteries.is_empty(1)


def test_a_robot_that_was_gone_comes_back_with_the_charge_of_the_start() -> None:
    batteries = batteries_of(scenario())
    batteries.tick([row(20.0, 20.0, speed=2.0)])
    batteries.tick([replace(row(20.0, 20.0), status=Status.PAUSED)])
    used = 1800.0 - 105.0 - 5.0
    assert batteries.share(1) == pytest.approx(used / 3600.0)
    batteries.tick([replace(row(20.0, 20.0), status=Status.DEAD)])
    assert batteries.share(1) == pytest.approx(used / 3600.0)
    batteries.tick([row(20.0, 20.0)])
    assert batteries.share(1) == pytest.approx((1800.0 - 5.0) / 3600.0)


def test_a_robot_without_a_battery_never_gets_empty() -> None:
    batteries = batteries_of(load_scenario({"terrain": {"builtin": "open"}, "point": 1.0}))
    batteries.tick([row(1.0, 1.0, 2.0)])
    batteries.renew(1)
    assert batteries.share(1) is None
    assert not batteries.is_empty(1)


@pytest.mark.parametrize(
    ("battery", "message"),
    [
        ({"charge": 10.0}, r"charge = 10(\.0)?: no more than the 10 W that the robot uses at rest"),
        ({"reserve": 0.95}, r"reserve = 0\.95: not below full \(0\.95\)"),
    ],
)
def test_a_battery_that_never_charges_or_never_leaves_is_refused(battery: dict[str, Any], message: str) -> None:
    with pytest.raises(BadInput, match=message):
        scenario(**battery)
    scenario(**{name: value + (0.1 if name == "charge" else -0.01) for name, value in battery.items()})


def test_a_robot_that_left_keeps_its_charge_until_it_joins_again_with_that_of_the_start() -> None:
    batteries = batteries_of(scenario())
    for k in range(50):
        batteries.tick([row(20.0, 20.0) if k < 10 else replace(row(20.0, 20.0), status=Status.LEFT)])
    assert batteries.share(1) == pytest.approx((1800.0 - 10 * 5.0) / 3600.0)
    batteries.tick([row(20.0, 20.0)])
    assert batteries.share(1) == pytest.approx((1800.0 - 5.0) / 3600.0)


def test_who_was_dead_where_one_goes_on_from_comes_back_with_the_charge_of_the_start() -> None:
    batteries = batteries_of(scenario(2))
    batteries.resume({1: 0.2, 2: 0.2}, [replace(row(20.0, 20.0), status=Status.DEAD), row(30.0, 20.0, number=2)])
    batteries.tick([row(20.0, 20.0), row(30.0, 20.0, number=2)])
    assert batteries.shares == pytest.approx({1: (1800.0 - 5.0) / 3600.0, 2: (720.0 - 5.0) / 3600.0})
