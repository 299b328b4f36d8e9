"""A fleet of processes under a service manager's socket: each says that it is ready, and is silent once it hangs."""

import json
import os
import signal
import socket
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.fleets import COARSE
from tests.routers import free_endpoint

pytestmark = pytest.mark.processes

PATIENCE_S = 300.0
WATCHDOG_S = 1.0
SCENARIO = {**COARSE, "duration": 5000, "pace": "realtime", "robots": {"count": 1, "model": "holonomic"}}


class Service:
    """A process, and the socket on which it tells its manager how it does."""

    def __init__(self, folder: Path, name: str, module: str, *arguments: str) -> None:
        self.socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        self.socket.bind(str(folder / name))
        given = {"NOTIFY_SOCKET": str(folder / name), "WATCHDOG_USEC": str(round(WATCHDOG_S * 1e6))}
        with (folder / f"{name}.log").open("wb") as log:
            command = [sys.executable, "-P", "-m", module, *arguments]
            self.process = subprocess.Popen(command, env={**os.environ, **given}, stdout=log, stderr=log)

    def next_word(self, within_s: float = PATIENCE_S) -> bytes | None:
        """Its next word, None when it says nothing in time."""
        self.socket.settimeout(within_s)
        try:
            return self.socket.recv(4096)
        except TimeoutError:
            return None

    def forget(self) -> None:
        self.socket.setblocking(False)
        while True:
            try:
                self.socket.recv(4096)
            except BlockingIOError:
                return

    def end(self) -> None:
        if self.process.poll() is None:
            self.process.send_signal(signal.SIGCONT)
            self.process.terminate()
        try:
            self.process.wait(PATIENCE_S)
        finally:
            self.process.kill()
            self.socket.close()


@pytest.fixture
def fleet(tmp_path: Path) -> Iterator[dict[str, Service]]:
    """Router, world, agent and page of one run."""
    where = free_endpoint()
    scenario = tmp_path / "scenario.yaml"
    scenario.write_text(json.dumps(SCENARIO), encoding="utf-8")
    meet = ("--router", where, "--fleet", "watched")
    common = (*meet, "--scenario", str(scenario))
    services: dict[str, Service] = {}
    try:
        services["router"] = Service(tmp_path, "router", "fogwatch.router", "--listen", where)
        services["world"] = Service(tmp_path, "world", "worldsim", *common, "--out", str(tmp_path / "run"))
        services["agent"] = Service(tmp_path, "agent", "agent", *common, "--robot", "r1")
        services["page"] = Service(tmp_path, "page", "monitor", *meet)
        yield services
    finally:
        for service in reversed(services.values()):
            service.end()


def test_each_process_is_ready_and_alive_and_silent_while_it_hangs(fleet: dict[str, Service]) -> None:
    for name, service in fleet.items():
        assert service.next_word() == b"READY=1", name
        for _ in range(4):
            assert service.next_word() == b"WATCHDOG=1", name
    for name in ("page", "agent", "world", "router"):
        service = fleet[name]
        service.process.send_signal(signal.SIGSTOP)
        os.waitid(os.P_PID, service.process.pid, os.WSTOPPED)
        service.forget()
        assert service.next_word(2.0 * WATCHDOG_S) is None, name
        service.process.send_signal(signal.SIGCONT)
        assert service.next_word() == b"WATCHDOG=1", name
