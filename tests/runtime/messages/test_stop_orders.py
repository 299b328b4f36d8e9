import threading
import time
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import pytest

from fogwatch.commands.control import control
from runtime.messages import stop_orders
from runtime.net.link import Link, open_link
from runtime.security.keys import WORLD, FleetKeys, fleet_keys
from tests.routers import PATIENCE_S, guarded_by_passwords, routed

SHORT_S = 1.0
STOPPED = stop_orders.Outcome(True, "stopped by an operator")


Answers = list[tuple[str, stop_orders.Outcome]]


def asked(
    link: Link, keys: FleetKeys, robots: list[str], order: stop_orders.Order, wait_s: float = PATIENCE_S
) -> Answers:
    return sorted(stop_orders.ask_robots(link, keys, robots, order, wait_s), key=lambda one: one[0])


def test_robots_obey_operators_and_nobody_else() -> None:
    obeyed: list[tuple[str, stop_orders.Order]] = []
    with guarded_by_passwords(["r1", "r2"]) as fleet:
        links = {
            user: open_link(fleet.router, PATIENCE_S, credentials=fleet.credentials[user])
            for user in ("robot-r1", "robot-r2", "operator", "viewer")
        }
        for robot in ("r1", "r2"):
            links[f"robot-{robot}"].live(fleet.keys.alive(robot))

            def carry_out(order: stop_orders.Order, robot: str = robot) -> stop_orders.Outcome:
                obeyed.append((robot, order))
                return STOPPED

            stop_orders.StopOrders(links[f"robot-{robot}"], fleet.keys, robot).obey(carry_out)
        end = time.monotonic() + PATIENCE_S
        operator = links["operator"]
        while stop_orders.robots_there(operator, fleet.keys) != ["r1", "r2"]:
            assert time.monotonic() < end
        while asked(operator, fleet.keys, ["r1", "r2"], stop_orders.Order.STOP) != [("r1", STOPPED), ("r2", STOPPED)]:
            assert time.monotonic() < end
        obeyed.clear()
        assert asked(operator, fleet.keys, ["r2"], stop_orders.Order.RELEASE) == [("r2", STOPPED)]
        for other in ("viewer", "robot-r1"):
            assert asked(links[other], fleet.keys, ["r2"], stop_orders.Order.STOP, SHORT_S) == []
        operator.ask(fleet.keys.stop("r1"), b"jump", SHORT_S)
        operator.ask(fleet.keys.stop("r1"), bytes(1000), SHORT_S)
        assert asked(operator, fleet.keys, ["r1"], stop_orders.Order.STOP) == [("r1", STOPPED)]
        assert obeyed == [("r2", stop_orders.Order.RELEASE), ("r1", stop_orders.Order.STOP)]
        for link in links.values():
            assert link.close(PATIENCE_S)


@pytest.mark.parametrize(
    ("answer", "outcome"),
    [
        (stop_orders.Outcome(True, "stands").to_bytes(), stop_orders.Outcome(True, "stands")),
        (stop_orders.Outcome(False, "drives").to_bytes(), stop_orders.Outcome(False, "drives")),
        (b"", stop_orders.Outcome(False, "")),
        (b"doner", stop_orders.Outcome(False, "")),
        (b"\xff\xff done", stop_orders.Outcome(False, "done")),
    ],
)
def test_only_a_robot_that_says_so_has_done_it(answer: bytes, outcome: stop_orders.Outcome) -> None:
    assert stop_orders.outcome_of(answer) == outcome
    assert len(stop_orders.Outcome(True, "\u20ac" * 1000).to_bytes()) <= stop_orders.LONGEST_ANSWER


class Fleet:
    """Robots at a router that asks nobody."""

    def __init__(self, endpoint: str) -> None:
        self.endpoint, self.keys = endpoint, fleet_keys("patrol")
        self.asked: dict[str, threading.Event] = {}
        self._links: list[Link] = []

    def join(self, name: str, outcome: stop_orders.Outcome | None, after: threading.Event | None = None) -> None:
        """A robot that answers with an outcome, once something has happened; never, if there is none."""
        link = open_link(self.endpoint, PATIENCE_S)
        self._links.append(link)
        heard = self.asked[name] = threading.Event()

        def carry_out(_order: stop_orders.Order) -> stop_orders.Outcome:
            heard.set()
            assert after is None or after.wait(PATIENCE_S)
            assert outcome is not None
            return outcome

        orders = stop_orders.StopOrders(link, self.keys, name)
        if outcome is not None:
            orders.obey(carry_out)
        link.live(self.keys.alive(name))

    def ready(self) -> None:
        """Wait until all robots are there."""
        looks = open_link(self.endpoint, PATIENCE_S)
        self._links.append(looks)
        end = time.monotonic() + PATIENCE_S
        while set(stop_orders.robots_there(looks, self.keys)) != set(self.asked):
            assert time.monotonic() < end

    def close(self) -> None:
        for link in self._links:
            assert link.close(PATIENCE_S)


@pytest.fixture
def fleet(monkeypatch: pytest.MonkeyPatch) -> Iterator[Fleet]:
    monkeypatch.setattr("fogwatch.commands.control.ROBOTS_S", PATIENCE_S)
    with routed() as endpoint:
        made = Fleet(endpoint)
        yield made
        made.close()


def stop_all(fleet: Fleet) -> int:
    return control(Path(fleet.endpoint), "stop", None, PATIENCE_S, "patrol")


def test_no_robot_is_told_later_because_another_one_hangs(fleet: Fleet) -> None:
    """The first robot answers only when the last one has been told: asked in turn, neither would be in time."""
    fleet.join("r2", STOPPED)
    fleet.join("r1", STOPPED, fleet.asked["r2"])
    fleet.ready()
    assert stop_all(fleet) == 0


def test_a_robot_that_does_not_answer_is_named(
    fleet: Fleet, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("fogwatch.commands.control.ROBOTS_S", SHORT_S)
    for name in ("r1", "r2", "r3"):
        fleet.join(name, None)
    fleet.join("r4", STOPPED)
    fleet.ready()
    end = time.monotonic() + PATIENCE_S
    out = errors = ""
    while out != "r4: stopped by an operator\n":  # on a slow machine it may take longer to answer
        assert time.monotonic() < end
        assert stop_all(fleet) == 3
        out, errors = capsys.readouterr()
    assert "no answer from r1, r2, r3; use another way to stop" in errors


def test_robots_that_a_world_simulates_are_held_by_other_words(
    fleet: Fleet, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("fogwatch.commands.control.ROBOTS_S", SHORT_S)
    fleet.join("r1", None)
    fleet.ready()
    with closing(open_link(fleet.endpoint, PATIENCE_S)) as world:
        world.live(fleet.keys.alive(WORLD))
        assert stop_all(fleet) == 3
    said = capsys.readouterr().err
    assert "no answer from r1; a world simulates this fleet" in said
    assert "fogwatch control RUN pause" in said
    assert "fogwatch control RUN fault '{kind: pause, who: all}'" in said


def test_neither_no_robot_nor_one_that_may_still_drive_is_a_success(
    fleet: Fleet, capsys: pytest.CaptureFixture[str]
) -> None:
    assert stop_all(fleet) == 3
    assert "no robot is there" in capsys.readouterr().err
    fleet.join("r1", STOPPED)
    fleet.join("r2", stop_orders.Outcome(False, "may still drive: its odometry says 0.50 m/s"))
    fleet.ready()
    assert stop_all(fleet) == 1
    assert "r2: may still drive" in capsys.readouterr().err
