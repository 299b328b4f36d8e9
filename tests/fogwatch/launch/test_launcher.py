"""How the launcher starts agents, from the fork server or by themselves, and that it waits for nothing when stopped."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

import pytest

from fogwatch.launch.children.children import Child, Children
from fogwatch.launch.folder.runfolder import RunFolder
from fogwatch.launch.launcher import Launch
from fogwatch.launch.private import Secrets
from fogwatch.launch.terminal.live_table import SilentDisplay
from patrol.net.link import LinkDown
from patrol.net.security.seats import SEAT
from patrol.process.starting.readiness import StartPipe


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


class Loading:
    """A fork server that is still loading when the user interrupts the run."""

    def __init__(self) -> None:
        self.awaited = False

    def await_start(self, stopped: Callable[[], bool]) -> None:
        self.awaited = True
        assert stopped()


def launch_of(folder: Path, secrets: Secrets, *, alike: bool = True) -> Launch:
    launch = Launch(RunFolder(folder), "f", ["r1", "r2"], SilentDisplay(), lambda: False, alike=alike)
    launch._secrets = secrets
    return launch


def test_nobody_is_started_any_more_where_the_user_interrupts_the_loading_server(
    tmp_path: Path, secrets: Secrets, alone: dict[str, Mapping[str, str]], monkeypatch: pytest.MonkeyPatch
) -> None:
    server, launch = Loading(), launch_of(tmp_path, secrets)
    launch._fork_server = server  # type: ignore[assignment]
    launch.stop = lambda: server.awaited
    monkeypatch.setattr("fogwatch.launch.launcher.read_credentials", lambda *_: None)
    monkeypatch.setattr("fogwatch.launch.launcher.open_link", no_router)
    launch.watch()
    assert server.awaited
    assert launch.interrupted
    assert not alone


def no_router(*_: object, stopped: Callable[[], bool], **__: object) -> None:
    assert stopped()
    raise LinkDown("no router answers")


def stopped(folder: Path, secrets: Secrets) -> Launch:
    """One that the user has interrupted."""
    launch = launch_of(folder, secrets)
    launch.stop = lambda: True
    return launch


def test_a_router_that_takes_its_time_is_not_awaited_where_the_user_interrupts(
    tmp_path: Path, secrets: Secrets, monkeypatch: pytest.MonkeyPatch
) -> None:
    silent = StartPipe()
    router = Child("the router", None, Path("log"), silent)  # type: ignore[arg-type]
    monkeypatch.setattr(Launch, "_spawn_router", lambda _self: router)
    with pytest.raises(KeyboardInterrupt):
        stopped(tmp_path, secrets)._start_router()
    assert not silent.ended
    silent.close()


def test_a_router_that_cannot_be_reached_is_not_awaited_where_the_user_interrupts(
    tmp_path: Path, secrets: Secrets, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("fogwatch.launch.launcher.open_link", no_router)
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
