"""Processes are followed from outside: logs as JSON lines, health lines, and metrics that anybody may ask for.

Router, world, two agents and a page, started one by one.
"""

import json
import os
import re
import socket
import subprocess
import sys
import urllib.request
from collections.abc import Callable, Iterator
from contextlib import ExitStack, suppress
from pathlib import Path
from typing import Any

import pytest

from tests.fleets import COARSE, Processes, trace_of
from tests.routers import free_endpoint

pytestmark = pytest.mark.processes

PATIENCE_S = 300.0
ROBOTS = [{"name": "anna", "model": "holonomic"}, {"name": "bert", "model": "car"}]
SCENARIO: dict[str, Any] = {**COARSE, "point": 0.5, "duration": 100_000, "robots": ROBOTS}
JSON = ("--log-format", "json", "--health", "0.3", "--metrics", "127.0.0.1:0")
MODULES = {"router": "fogwatch.router", "world": "worldsim", "anna": "agent", "bert": "agent", "monitor": "monitor"}


class Site(Processes):
    """The processes of one fleet, and what each has written: on its standard error, and on its standard output."""

    def __init__(self, folder: Path) -> None:
        super().__init__(folder, PATIENCE_S)
        self.router = free_endpoint()
        self.scenario = folder / "scenario.yaml"

    def start_all(self, scenario: dict[str, Any], *how: str) -> None:
        self.scenario.write_text(json.dumps(scenario), encoding="utf-8")
        fleet = ("--router", self.router, "--fleet", "followed-1")
        self.begin("router", "--listen", self.router, *how)
        self.begin("world", *fleet, "--scenario", str(self.scenario), "--out", str(self.folder / "run"), *how)
        for robot in ("anna", "bert"):
            self.begin(robot, *fleet, "--scenario", str(self.scenario), "--robot", robot, *how)
        self.begin("monitor", *fleet, *how)

    def begin(self, name: str, *arguments: str) -> None:
        command = [sys.executable, "-P", "-m", MODULES[name], *arguments]
        with (self.folder / f"{name}.err").open("ab") as err, (self.folder / f"{name}.out").open("ab") as out:
            self.processes[name] = subprocess.Popen(command, stdout=out, stderr=err)

    def said(self, name: str, stream: str = "err") -> str:
        return (self.folder / f"{name}.{stream}").read_text(encoding="utf-8")

    def lines(self, name: str, stream: str = "err") -> list[dict[str, Any]]:
        return [json.loads(line) for line in self.said(name, stream).splitlines(keepends=True) if line.endswith("\n")]

    def metrics_at(self, name: str) -> tuple[str, int]:
        """The address of a process's metrics, as soon as it has said it."""
        found: list[tuple[str, int]] = []

        def told() -> bool:
            asked = re.search(r"metrics at http://([\d.]+):(\d+)/metrics", self.said(name))
            found.extend([(asked[1], int(asked[2]))] if asked else [])
            return bool(found)

        self.until(told)
        return found[0]

    def metrics(self, name: str) -> dict[str, float]:
        """The metrics of a process without their labels; of several numbers the sum."""
        host, port = self.metrics_at(name)
        with urllib.request.urlopen(f"http://{host}:{port}/metrics", timeout=PATIENCE_S) as answer:
            text = answer.read().decode()
        numbers: dict[str, float] = {}
        for line in text.splitlines():
            if not line.startswith("#"):
                figure, labels, number = re.fullmatch(r"(\w+)\{(.*)\} (\S+)", line).groups()  # type: ignore[union-attr]
                assert f'process="{name}"' in labels
                numbers[figure] = numbers.get(figure, 0.0) + float(number)
        return numbers


@pytest.fixture
def site(tmp_path: Path) -> Iterator[Site]:
    site = Site(tmp_path)
    yield site
    site.end()


def has_grown(site: Site, name: str, figure: str, beyond: float) -> Callable[[], bool]:
    return lambda: site.metrics(name).get(figure, -1.0) > beyond


def test_logs_are_json_health_lines_come_and_ticks_grow(site: Site) -> None:
    site.start_all({**SCENARIO, "pace": 10}, *JSON)
    for name in ("world", "anna", "bert"):
        site.until(has_grown(site, name, "fogwatch_ticks_total", 2.0))
        before = site.metrics(name)
        site.until(has_grown(site, name, "fogwatch_ticks_total", before["fogwatch_ticks_total"] + 5.0))
        site.until(has_grown(site, name, "fogwatch_tick", before["fogwatch_tick"] + 5.0))
        assert before["process_resident_memory_bytes"] > 1e6
    site.until(has_grown(site, "monitor", "fogwatch_tick", 5.0))
    site.until(lambda: site.metrics("router")["fogwatch_connections"] >= 4)
    site.until(lambda: site.metrics("anna")["fogwatch_peers_heard"] == 1)
    assert site.metrics("anna")["fogwatch_decision_seconds_total"] > 0.0
    assert site.metrics("world")["fogwatch_robots"] == 2
    for name in MODULES:
        site.until(lambda name=name: any("health" in line for line in site.lines(name)))  # type: ignore[misc]
    site.until(lambda: any(line.get("health", {}).get("fogwatch_tick", 0) > 0 for line in site.lines("bert")))
    for name in ("world", "anna", "bert", "monitor", "router"):
        if name not in ("anna", "bert"):  # the world tells these to leave
            site.processes[name].terminate()
        assert site.code(name) == {"world": 130, "monitor": 130}.get(name, 0), site.said(name)
    for name in MODULES:
        told = site.lines(name) + site.lines(name, "out")
        assert {line["process"] for line in told} == {name}
        assert {line["level"] for line in told} <= {"debug", "info", "warning", "error"}
        assert all(re.fullmatch(r"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d\.\d{3}Z", line["time"]) for line in told)
        assert all(isinstance(line["message"], str) and line["message"] for line in told)
        assert {line["pid"] for line in told} == {site.processes[name].pid}
    assert any(line["message"].startswith("router ready at") for line in site.lines("router", "out"))
    assert any(line["message"].startswith("page: http://") for line in site.lines("monitor", "out"))
    assert any(line["message"].startswith("verdict valid") for line in site.lines("world"))


def test_without_options_lines_are_for_people(site: Site) -> None:
    site.start_all({**SCENARIO, "duration": 20})
    assert [site.code(name) for name in ("world", "anna", "bert")] == [0, 0, 0]
    assert all(line.startswith("world: ") for line in site.said("world").splitlines())
    assert "health" not in site.said("anna")
    assert site.said("router", "out").startswith("router ready at ")


def test_bad_input_is_one_line_in_each_format(site: Site) -> None:
    busy = socket.create_server(("127.0.0.1", 0))
    with busy:
        port = busy.getsockname()[1]
        site.start_all(SCENARIO, "--metrics", f"127.0.0.1:{port}")
        assert [site.code(name) for name in MODULES] == [2] * len(MODULES)
        for name in MODULES:
            (line,) = site.said(name).splitlines()
            assert f"--metrics 127.0.0.1:{port}: cannot listen there (Address already in use); choose another" in line
    site.begin("anna", "--scenario", str(site.folder / "none.yaml"), "--log-format", "json")
    assert site.code("anna") == 2
    line = json.loads(site.said("anna").splitlines()[-1])
    assert (line["level"], line["process"]) == ("error", "agent")


def test_whatever_connects_to_the_metrics_changes_nothing(site: Site, tmp_path: Path) -> None:
    site.start_all({**SCENARIO, "duration": 100_000}, *JSON)
    site.until(has_grown(site, "world", "fogwatch_ticks_total", 10.0))
    with ExitStack() as held:
        for name in ("world", "anna"):
            where = site.metrics_at(name)
            for number in range(12):  # who says nothing, or half of a request
                client = held.enter_context(socket.create_connection(where, PATIENCE_S))
                client.sendall(b"GET /metrics HTTP/1.1\r\nX: y"[: number * 3])
            for garbage in (os.urandom(1 << 20), b"GET " + b"/" * 100_000, b"\r\n\r\n", b"\x00" * 9000):
                with socket.create_connection(where, PATIENCE_S) as client, suppress(OSError):
                    client.sendall(garbage)
                    client.recv(65536)
            assert site.metrics(name)["fogwatch_ticks_total"] >= 10.0
        ticks = site.metrics("world")["fogwatch_ticks_total"]
        site.until(has_grown(site, "world", "fogwatch_ticks_total", ticks + 20.0))
        site.processes["world"].terminate()
        assert [site.code(name) for name in ("world", "anna", "bert")] == [130, 0, 0], site.said("world")
    summary = json.loads((site.folder / "run" / "summary.json").read_text(encoding="utf-8"))
    assert summary["verdict"]["valid"]
    assert summary["trace_hash"] == trace_of(SCENARIO, summary["ticks"], tmp_path)
