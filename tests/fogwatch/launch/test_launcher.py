"""How the launcher starts agents, from the fork server or by themselves, and that it waits for nothing when stopped."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

import pytest

from fogwatch.launch.children import Child, Children
from fogwatch.launch.launcher import Launch
from fogwatch.launch.live_table import SilentDisplay
from fogwatch.launch.private import Secrets
from fogwatch.launch.runfolder import RunFolder
from patrol.net.link import LinkDown
from patrol.net.security.seats import SEAT


@pytest.fixture
def alone(monkeypatch: pytest.MonkeyPatch) -> dict[str, Mapping[str, str]]:
    """The environments of the children that were started by themselves."""
    started: dict[str, Mapping[str, str]] = {}

    def spawn(_self: Children, name: str, *_: Any, environment: Mapping[str, str]) -> Child:
        started[name] = environment
        return Child(name, None, Path("log"))  # type: ignore[arg-type]

    monkeypatch.setattr(Children, "spawn", spawn)
    return started


@pytest.fixture
def secrets() -> Iterator[Secrets]:
    drawn = Secrets("f", ["r1", "r2"])
    yield drawn
    drawn.remove()


class Silent:
    """The pipe of a router that takes its time; it is an error to listen to it on and on."""

    ended = False

    def __init__(self) -> None:
        self._rounds = itertools.count(1)

    def report(self, _timeout_s: float) -> None:
        assert next(self._rounds) < 3, "the router is awaited although the user has interrupted the run"


class NoUse:
    """A fork server that makes nothing, and is asked for it when the user interrupts the run."""

    def __init__(self) -> None:
        self.asked = False

    def make(self, *_: object) -> None:
        self.asked = True


def launch_of(folder: Path, secrets: Secrets, server: NoUse | None = None, *, alike: bool = True) -> Launch:
    """One that is asked to stop while its fork server is asked for an agent."""
    stop = (lambda: False) if server is None else (lambda: server.asked)
    launch = Launch(RunFolder(folder), "f", ["r1", "r2"], SilentDisplay(), stop, alike=alike)
    launch._secrets = secrets
    launch._fork_server = server  # type: ignore[assignment]
    return launch


def test_nobody_is_started_any_more_where_the_user_interrupts_the_loading_server(
    tmp_path: Path, secrets: Secrets, alone: dict[str, Mapping[str, str]]
) -> None:
    server = NoUse()
    launch_of(tmp_path, secrets, server)._spawn_agents()
    assert server.asked
    assert not alone


def stopped(folder: Path, secrets: Secrets) -> Launch:
    """One that the user has interrupted."""
    launch = launch_of(folder, secrets)
    launch.stop = lambda: True
    return launch


def test_a_router_that_takes_its_time_is_not_awaited_where_the_user_interrupts(
    tmp_path: Path, secrets: Secrets, monkeypatch: pytest.MonkeyPatch
) -> None:
    router = Child("the router", None, Path("log"), Silent())  # type: ignore[arg-type]
    monkeypatch.setattr(Launch, "_spawn_router", lambda _self: router)
    with pytest.raises(KeyboardInterrupt):
        stopped(tmp_path, secrets)._start_router()


def test_a_router_that_cannot_be_reached_is_not_awaited_where_the_user_interrupts(
    tmp_path: Path, secrets: Secrets, monkeypatch: pytest.MonkeyPatch
) -> None:
    def join(*_: object, stopped: Callable[[], bool], **__: object) -> None:
        assert stopped()
        raise LinkDown("no router answers")

    monkeypatch.setattr("fogwatch.launch.launcher.open_link", join)
    launch = stopped(tmp_path, secrets)
    secrets.for_members("tcp/127.0.0.1:1")
    launch.watch()
    assert launch.interrupted


@pytest.mark.parametrize("alike", [True, False])
def test_minds_of_ours_run_without_threads_of_openblas_however_they_are_started(
    alike: bool, tmp_path: Path, secrets: Secrets, alone: dict[str, Mapping[str, str]]
) -> None:
    launch_of(tmp_path, secrets, alike=alike)._spawn_agents()
    assert alone.keys() == {"r1", "r2"}
    for environment in alone.values():
        given = {**environment}
        assert given.pop(SEAT)
        assert given == ({"OPENBLAS_NUM_THREADS": "1"} if alike else {})
