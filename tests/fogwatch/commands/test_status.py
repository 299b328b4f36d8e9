"""``fogwatch status`` at real routers, with processes that are there as far as anybody can see."""

import json
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from fogwatch.commands.status import look_at
from fogwatch.status import FleetStatus, WorldStatus
from patrol.pose import Pose
from patrol.radio.message import Position, encode
from runtime.net.link import open_link
from runtime.process.lifeline import Ending
from runtime.security.credentials import Credentials
from runtime.security.keys import FleetKeys, fleet_keys
from tests import routers
from tests.fogwatch.conftest import Refused, Shell

FRAME = encode(Position.of(1, 1, 0.0, Pose(2.0, 3.0, 0.0)))


@contextmanager
def robot(router: str, keys: FleetKeys, credentials: Credentials | None = None) -> Iterator[None]:
    """The robot r1, which sends its position all the time."""
    link = open_link(router, routers.PATIENCE_S, credentials=credentials)
    send, over = link.publisher(keys.position("r1")), threading.Event()

    def speak() -> None:
        while not over.wait(0.02):
            send(FRAME)

    speaking = threading.Thread(target=speak)
    try:
        link.live(keys.alive("r1"))
        routers.await_seen(link, keys.alive("r1"))
        speaking.start()
        yield
    finally:
        over.set()
        speaking.join()
        assert link.close(routers.PATIENCE_S)


@pytest.fixture(autouse=True)
def no_niceness(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("os.nice", lambda _: 0)  # it would hold for all tests after this one


@pytest.fixture
def scenario(tmp_path: Path) -> Path:
    """Of the robot r1 and another one, which is not there."""
    file = tmp_path / "real.yaml"
    file.write_text("terrain: {builtin: open}\npoint: 1\nrobots: {count: 2}\n", encoding="utf-8")
    return file


def test_robots_without_a_world(shell: Shell, scenario: Path) -> None:
    with routers.routed() as where, robot(where, fleet_keys("real-1")):
        of = ("--router", where, "--fleet", "real-1", "--scenario", scenario)
        said = shell("status", *of, "--seconds", "2", "--json")
        assert "give --scenario FILE for robots without a world" in shell("status", *of[:4], "--wait", "0.1").err
    status = json.loads(said.out)
    assert said.code == 1
    assert not status["well"]
    assert (status["world"], status["has_world"]) == (None, False)
    r1, r2 = status["robots"]
    assert (r1["name"], r1["status"], r1["place"], r1["wrong"]) == ("r1", "alive", [2.0, 3.0], "")
    assert (r2["name"], r2["status"], r2["wrong"]) == ("r2", "absent", "is not there")


@routers.needs_openssl
def test_a_viewer_of_a_closed_fleet(tmp_path: Path, shell: Shell, scenario: Path) -> None:
    fleet = routers.make_local_fleet(tmp_path / "f", ["r1"])
    scenario.write_text("terrain: {builtin: open}\npoint: 1\nrobots: {count: 1}\n", encoding="utf-8")
    of = ("--credentials", tmp_path / "f" / "viewer", "--scenario", scenario)
    with (
        routers.guarded_by_certificates(fleet) as where,
        robot(where.router, where.keys, where.credentials["robot-r1"]),
    ):
        said = shell("status", *of, "--seconds", "2")
    assert said.code == 0
    assert "r1     alive" in said.out
    assert said.out.endswith("\nall well\n")


def test_nothing_of_the_fleet_is_there(shell: Shell, tmp_path: Path) -> None:
    def refused(*words: str | Path) -> str:
        said = shell("status", *words, "--wait", "0.1")
        assert said.code == 2
        return said.err

    with routers.routed() as where:
        fleet = ("--router", where, "--fleet", "real-1")
        none = (
            f"no world of this fleet answers at {where}; check both, or give --scenario FILE for robots without a world"
        )
        assert none in refused(*fleet)
        assert "give their --scenario FILE as well" in refused(*fleet, "--radio", "serial/dev/ttyUSB0")
        routers.write_access(tmp_path, where)
        assert none in refused(tmp_path), "without a scenario it may be an operator's of robots without a world"
        (tmp_path / "scenario.yaml").write_text("terrain: {builtin: open}\n", encoding="utf-8")
        of_run = refused(tmp_path)
        assert f"its world does not answer at {where}; if it has just been started, look again" in of_run
        assert "--scenario" not in of_run
    assert "no router answers" in refused("--router", routers.free_endpoint(), "--fleet", "real-1")


class Looks:
    """A fleet as it is in one look after the other."""

    def __init__(self, *fleets: FleetStatus) -> None:
        self.fleets = iter(fleets)

    def look(self, _seconds: float) -> FleetStatus:
        return next(self.fleets)

    def close(self) -> None:
        pass


@pytest.mark.parametrize(("warnings", "code"), [((), 0), (("no data for 4 s",), 1)])
def test_watching_ends_with_the_run(warnings: tuple[str, ...], code: int, capsys: pytest.CaptureFixture[str]) -> None:
    running = FleetStatus("f", "tcp/r:1", WorldStatus(1, 2, 0.5, True, 2.0), 1.0, ())
    ended = replace(running, world=WorldStatus(2, 2, 1.0, False, 0.0, "duration"), warnings=warnings)
    looks: Any = Looks(running, ended)
    assert look_at(looks, 1.0, Ending(), watch=True, as_json=True) == code
    shown = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    assert [(look["world"]["ended"], look["well"]) for look in shown] == [(None, True), ("duration", code == 0)]


@pytest.mark.parametrize("watch", [False, True])
def test_an_interrupted_look_says_nothing(watch: bool, capsys: pytest.CaptureFixture[str]) -> None:
    ending = Ending()
    ending.ask("SIGINT")
    looks: Any = Looks(FleetStatus("f", "tcp/r:1", None, None, ()))
    assert look_at(looks, 1.0, ending, watch=watch, as_json=True) == 130
    assert capsys.readouterr().out == ""


@pytest.mark.parametrize(
    ("words", "why"),
    [
        ((), "status: name a run's folder, or --router and --fleet of a running fleet, or --credentials"),
        (("nowhere",), "status nowhere: no such folder"),
        ((".",), "status .: holds no control.json, so no fleet is running there"),
        ((".", "--scenario", "a.yaml"), "status: --scenario is for robots without a world"),
        (("--credentials", "v", "--seconds", "nan"), "--seconds nan: expected 0.1 to 600"),
        (("--credentials", "v", "--wait", "nan"), "--wait nan: expected 0 to 86400"),
        (("--credentials", "v", "--wait", "-1"), "--wait -1: expected 0 to 86400"),
        (("--router", "tcp/127.0.0.1:1", "--fleet", "f", "--scenario", "none.yaml"), "none.yaml"),
    ],
)
def test_bad_arguments(words: tuple[str, ...], why: str, refused: Refused) -> None:
    assert why in refused("status", *words)
