"""How the launcher starts agents: from the fork server, or by themselves."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import pytest

from fogwatch.launch.children import Child, Children
from fogwatch.launch.launcher import Launch
from fogwatch.launch.live_table import SilentDisplay
from fogwatch.launch.private import Secrets
from fogwatch.launch.runfolder import RunFolder
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
