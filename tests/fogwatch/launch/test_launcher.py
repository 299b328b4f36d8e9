"""The launcher starts agents from the fork server or by themselves, and waits for nothing when stopped."""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import pytest

from fogwatch.launch.children import Child, Children
from fogwatch.launch.launcher import ROUTER, WORLD, Launch
from fogwatch.run_folder.runfolder import RunFolder
from fogwatch.terminal.live_table import RunDisplay
from runtime.net.link import LinkDown
from runtime.starting.readiness import StartPipe, StartReport


class Fleet:
    """The children of a launcher, none of which is a process.

    Attributes:
        started: The environments of those that were started by themselves, by name.
        router: The pipe on which the router does not report; None for a router that is ready at once.
    """

    def __init__(self) -> None:
        self.started: dict[str, Mapping[str, str]] = {}
        self.router: StartPipe | None = None

    def spawn(self, name: str, *_: Any, environment: Mapping[str, str] | None = None, **__: Any) -> Child:
        self.started[name] = environment or {}
        return Starting(name, None, Path("log"), self.router if name == ROUTER else None)  # type: ignore[arg-type]


class Starting(Child):
    """A child that is ready at once where it has no pipe to say so."""

    def await_start(self, limit_s: float, stopped: Callable[[], bool] = lambda: False) -> StartReport | None:
        return StartReport("") if self.start is None else super().await_start(limit_s, stopped)


@pytest.fixture
def fleet(monkeypatch: pytest.MonkeyPatch) -> Fleet:
    made = Fleet()
    monkeypatch.setattr(Children, "spawn", lambda _self, *words, **how: made.spawn(*words, **how))
    return made


class Loading:
    """A fork server that is still loading when the user interrupts the run."""

    def __init__(self, *_: object) -> None:
        self.awaited = False

    def await_start(self, stopped: Callable[[], bool]) -> None:
        self.awaited = True
        assert stopped()

    def close(self) -> None:
        """It has no process."""


def launch_of(folder: Path, stop: Callable[[], bool] = lambda: False, *, alike: bool = True) -> Launch:
    return Launch(RunFolder(folder), "f", ["r1", "r2"], RunDisplay(), stop, alike=alike)


def test_nobody_is_started_any_more_where_the_user_interrupts_the_loading_server(
    tmp_path: Path, fleet: Fleet, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Nor is a router awaited that cannot be reached."""
    server = Loading()
    launch = launch_of(tmp_path, lambda: server.awaited)
    monkeypatch.setattr("fogwatch.launch.launcher.can_fork", lambda: True)
    monkeypatch.setattr("fogwatch.launch.launcher.ForkServer", lambda *_: server)
    monkeypatch.setattr("fogwatch.launch.launcher.open_link", no_router)
    launch.start()
    launch.watch()
    assert server.awaited
    assert launch.interrupted
    assert fleet.started.keys() == {ROUTER, WORLD}
    launch.finish()


def no_router(*_: object, stopped: Callable[[], bool], **__: object) -> None:
    assert stopped()
    raise LinkDown("no router answers")


def test_a_router_that_takes_its_time_is_not_awaited_where_the_user_interrupts(tmp_path: Path, fleet: Fleet) -> None:
    fleet.router = StartPipe()
    launch = launch_of(tmp_path, lambda: True, alike=False)
    with pytest.raises(KeyboardInterrupt):
        launch.start()
    assert not fleet.router.ended
    fleet.router.close()
    launch.finish()


@pytest.mark.parametrize("alike", [True, False])
def test_minds_of_ours_run_without_threads_of_openblas_however_they_are_started(
    alike: bool, tmp_path: Path, fleet: Fleet, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("fogwatch.launch.launcher.can_fork", lambda: False)
    launch = launch_of(tmp_path, alike=alike)
    launch.start()
    assert fleet.started.keys() == {ROUTER, WORLD, "r1", "r2"}
    for name in launch.robots:
        assert fleet.started[name] == ({"OPENBLAS_NUM_THREADS": "1"} if alike else {})
    launch.finish()
