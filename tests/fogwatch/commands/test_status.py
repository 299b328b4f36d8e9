"""``fogwatch status`` at real routers, with processes that are there as far as anybody can see."""

from __future__ import annotations

import json
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import pytest

from fogwatch.commands.status import follow, once
from fogwatch.status import FleetStatus, WorldStatus
from patrol.net.link import Link, open_link
from patrol.pose import Pose
from patrol.process.lifeline import Ending
from patrol.radio.message import Position, encode
from patrol.security.credentials import Credentials
from patrol.security.keys import FleetKeys, fleet_keys
from tests.fogwatch.conftest import Refused, Shell
from tests.routers import (
    PATIENCE_S,
    await_seen,
    free_endpoint,
    guarded_by_certificates,
    make_local_fleet,
    needs_openssl,
    routed,
    write_access,
)

FRAME = encode(Position.of(1, 1, 0.0, Pose(2.0, 3.0, 0.0)))


@contextmanager
def robot(router: str, keys: FleetKeys, credentials: Credentials | None = None) -> Iterator[None]:
    """The robot r1, which sends its position all the time."""
    link = open_link(router, PATIENCE_S, credentials=credentials)
    send, over = link.publisher(keys.position("r1")), threading.Event()

    def speak() -> None:
        while not over.wait(0.02):
            send(FRAME)

    speaking = threading.Thread(target=speak)
    try:
        link.live(keys.alive("r1"))
        await_seen(link, keys.alive("r1"))
        speaking.start()
        yield
    finally:
        over.set()
        speaking.join()
        assert link.close(PATIENCE_S)


def test_a_robot_without_a_world(shell: Shell) -> None:
    with routed() as where, robot(where, fleet_keys("real-1")):
        said = shell("status", "--router", where, "--fleet", "real-1", "--seconds", "2", "--json")
    status = json.loads(said.out)
    assert said.code == 0
    assert status["well"]
    assert status["world"] is None
    assert [(one["name"], one["place"]) for one in status["robots"]] == [("r1", [2.0, 3.0])]


@needs_openssl
def test_a_viewer_of_a_closed_fleet(tmp_path: Path, shell: Shell) -> None:
    fleet = make_local_fleet(tmp_path / "f", ["r1"])
    with guarded_by_certificates(fleet) as of, robot(of.router, of.keys, of.credentials["robot-r1"]):
        said = shell("status", "--credentials", tmp_path / "f" / "viewer", "--seconds", "2")
    assert said.code == 0
    assert "r1     alive" in said.out
    assert said.out.endswith("all well\n")


def test_a_robot_that_is_just_starting_is_looked_for_again(shell: Shell, monkeypatch: pytest.MonkeyPatch) -> None:
    seen, too_early = Link.seen, [list[str]()]
    monkeypatch.setattr(Link, "seen", lambda link, key, most: too_early.pop() if too_early else seen(link, key, most))
    with routed() as where, robot(where, fleet_keys("real-1")):
        said = shell("status", "--router", where, "--fleet", "real-1", "--seconds", "2")
    assert said.code == 0
    assert not too_early
    assert "r1     alive" in said.out


def test_nothing_of_the_fleet_is_there(shell: Shell, tmp_path: Path) -> None:
    def refused(*words: str | Path) -> str:
        said = shell("status", *words, "--wait", "0.1")
        assert said.code == 2
        return said.err

    with routed() as where:
        fleet = ("--router", where, "--fleet", "real-1")
        assert f"nothing of this fleet is at {where} yet; if it has just been started, look again" in refused(*fleet)
        assert "give their --scenario FILE as well" in refused(*fleet, "--radio", "serial/dev/ttyUSB0")
        write_access(tmp_path, where)
        assert f"nothing of this fleet is at {where}" in refused(tmp_path)
    assert "no router answers" in refused("--router", free_endpoint(), "--fleet", "real-1")


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
    assert follow(Looks(running, ended), 1.0, Ending(), as_json=True) == code
    looks = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    assert [(look["world"]["ended"], look["well"]) for look in looks] == [(None, True), ("duration", code == 0)]


@pytest.mark.parametrize("look", [once, follow])
def test_an_interrupted_look_says_nothing(look: Callable[..., int], capsys: pytest.CaptureFixture[str]) -> None:
    ending = Ending()
    ending.ask("SIGINT")
    assert look(Looks(FleetStatus("f", "tcp/r:1", None, None, ())), 1.0, ending, as_json=True) == 130
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
