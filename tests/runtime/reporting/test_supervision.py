import argparse
import itertools
import os
import socket
from collections.abc import Iterator
from pathlib import Path

import pytest

from patrol.errors import BadInput
from runtime.reporting.logs import Format
from runtime.reporting.supervision import Notifier, Supervision, add_supervision, take_supervision


def parsed(*words: str) -> argparse.Namespace:
    parser = argparse.ArgumentParser()
    parser.add_argument("--other", default=1)
    add_supervision(parser)
    return parser.parse_args(words)


def test_what_is_asked_for_and_by_default_nothing() -> None:
    options = parsed()
    supervision = take_supervision(options)
    assert supervision == Supervision()
    assert not supervision.counts
    assert vars(options) == {"other": 1}
    words = "--log-format json --log-level warning --health 5 --metrics 0.0.0.0:9100 --metrics-open"
    supervision = take_supervision(parsed(*words.split()))
    assert supervision == Supervision(Format.JSON, "warning", 5.0, "0.0.0.0:9100", metrics_open=True)
    assert supervision.counts


@pytest.mark.parametrize("words", ["0", "0.0999", "-1", "nan", "inf", "86400.1", "1e9"])
def test_health_lines_come_at_times_that_make_sense(words: str) -> None:
    assert [take_supervision(parsed("--health", limit)).health for limit in ("0.1", "86400")] == [0.1, 86400.0]
    with pytest.raises(BadInput, match=r"^--health \S+: give from 0.1 to 86400 seconds$"):
        take_supervision(parsed("--health", words))


@pytest.mark.parametrize("words", ["--health 5", "--metrics 127.0.0.1:0", "--log-level debug"])
def test_each_of_these_alone_wants_each_ticks_figures(words: str) -> None:
    assert take_supervision(parsed(*words.split())).counts
    assert not take_supervision(parsed("--log-level", "error")).counts


def test_open_metrics_need_metrics() -> None:
    with pytest.raises(BadInput, match="--metrics-open: means nothing without --metrics"):
        take_supervision(parsed("--metrics-open"))


class Manager:
    def __init__(self, address: str | bytes) -> None:
        self.socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        self.socket.bind(address)
        self.socket.setblocking(False)

    def told(self) -> list[bytes]:
        told = []
        while True:
            try:
                told.append(self.socket.recv(4096))
            except BlockingIOError:
                return told


@pytest.fixture
def manager(tmp_path: Path) -> Iterator[Manager]:
    manager = Manager(str(tmp_path / "notify"))
    yield manager
    manager.socket.close()


def environment(tmp_path: Path, **more: str) -> dict[str, str]:
    return {"NOTIFY_SOCKET": str(tmp_path / "notify"), **more}


def test_the_first_sign_of_life_says_ready_and_the_next_come_four_times_within_the_patience(
    manager: Manager, tmp_path: Path
) -> None:
    now = 100.0
    notifier = Notifier(environment(tmp_path, WATCHDOG_USEC="8000000", WATCHDOG_PID=str(os.getpid())), lambda: now)
    assert manager.told() == []
    notifier.alive()
    assert manager.told() == [b"READY=1", b"WATCHDOG=1"]
    now = 101.9
    notifier.alive()
    assert manager.told() == []
    now = 102.0
    notifier.alive()
    assert manager.told() == [b"WATCHDOG=1"]


@pytest.mark.parametrize("more", [{}, {"WATCHDOG_USEC": "8000000", "WATCHDOG_PID": "1"}, {"WATCHDOG_USEC": "soon"}])
def test_without_a_watchdog_of_its_own_a_process_says_only_that_it_is_ready(
    more: dict[str, str], manager: Manager, tmp_path: Path
) -> None:
    notifier = Notifier(environment(tmp_path, **more))
    for _ in range(3):
        notifier.alive()
    notifier.busy(60.0)
    assert manager.told() == [b"READY=1"]


def test_long_work_asks_for_patience_and_a_manager_may_be_in_the_abstract_name_space(
    manager: Manager, tmp_path: Path
) -> None:
    Notifier(environment(tmp_path, WATCHDOG_USEC="8000000")).busy(60.0)
    assert manager.told() == [b"WATCHDOG_USEC=60000000"]
    name = f"fogwatch-test-{os.getpid()}"
    abstract = Manager(f"\0{name}")
    Notifier({"NOTIFY_SOCKET": f"@{name}"}).alive()
    assert abstract.told() == [b"READY=1"]
    abstract.socket.close()


def test_a_manager_that_does_not_read_or_is_gone_holds_up_nobody(manager: Manager, tmp_path: Path) -> None:
    seconds = itertools.count()
    notifier = Notifier(environment(tmp_path, WATCHDOG_USEC="4"), lambda: float(next(seconds)))
    for _ in range(10_000):
        notifier.alive()
    assert 0 < len(manager.told()) < 10_000
    (tmp_path / "notify").unlink()
    notifier.busy(1.0)


@pytest.mark.parametrize("environment", [{}, {"NOTIFY_SOCKET": ""}], ids=["unset", "empty"])
def test_without_a_manager_nothing_is_told(environment: dict[str, str], monkeypatch: pytest.MonkeyPatch) -> None:
    opened: list[tuple[object, ...]] = []

    def no_socket(*how: object) -> None:
        opened.append(how)
        raise OSError("none is to be opened")

    monkeypatch.setattr("runtime.reporting.supervision.socket.socket", no_socket)
    notifier = Notifier({"WATCHDOG_USEC": "4", **environment})
    notifier.alive()
    notifier.busy(1.0)
    assert not opened
