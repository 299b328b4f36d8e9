import math
import os
import re
import socket
import threading
import urllib.request
from collections.abc import Iterator
from contextlib import ExitStack, suppress

import pytest

from patrol.errors import BadInput
from runtime.reporting.metrics import LONGEST_REQUEST, MOST_CONNECTIONS, MetricsServer, listen_at, render
from runtime.reporting.vitals import MFOW, REFUSED, TICK, TICKS, VERSION, Figure, Value, Vitals

PATIENCE_S = 300.0
BAD = (
    b"HTTP/1.1 400 Bad Request\r\nContent-Type: text/plain; version=0.0.4; charset=utf-8\r\nContent-Length: 12\r\n"
    b"Connection: close\r\n\r\nbad request\n"
)
GET = b"GET /metrics HTTP/1.1\r\nHost: x\r\n\r\n"


@pytest.fixture
def server() -> Iterator[MetricsServer]:
    vitals = Vitals()
    vitals.beat(41, {MFOW: 2.5})
    server = MetricsServer(listen_at("127.0.0.1:0", is_open=False), vitals, {"process": "r1"})
    yield server
    server.close()
    assert not any(thread.name == "metrics" for thread in threading.enumerate())


def where(server: MetricsServer) -> tuple[str, int]:
    host, port = re.fullmatch(r"http://([\d.]+):(\d+)/metrics", server.address).groups()  # type: ignore[union-attr]
    return host, int(port)


def asked(server: MetricsServer, request: bytes) -> bytes:
    """All that comes back; empty where the connection is closed without an answer."""
    with socket.create_connection(where(server), PATIENCE_S) as client:
        client.sendall(request)
        answer = b""
        try:
            while some := client.recv(65536):
                answer += some
        except ConnectionResetError:
            pass
        return answer


def scraped(server: MetricsServer) -> str:
    with urllib.request.urlopen(server.address, timeout=PATIENCE_S) as answer:
        assert answer.headers["Content-Type"] == "text/plain; version=0.0.4; charset=utf-8"
        return str(answer.read().decode())


def test_figures_as_prometheus_reads_them() -> None:
    figures: dict[Figure, Value] = {
        TICK: 3,
        REFUSED: {"old": 2, 'a"b\\c\n': 1},
        MFOW: math.inf,
        TICKS: math.nan,
        VERSION: {"1": 1},
    }
    lines = render(figures, {"process": "r1"}).decode().splitlines()
    assert lines[:3] == [
        "# HELP fogwatch_tick The newest tick that the process has done or shown.",
        "# TYPE fogwatch_tick gauge",
        'fogwatch_tick{process="r1"} 3',
    ]
    assert 'fogwatch_frames_refused_total{process="r1",reason="old"} 2' in lines
    assert 'fogwatch_frames_refused_total{process="r1",reason="a\\"b\\\\c\\n"} 1' in lines
    assert 'fogwatch_mfow_seconds{process="r1"} +Inf' in lines
    assert 'fogwatch_ticks_total{process="r1"} NaN' in lines


def test_a_scrape(server: MetricsServer) -> None:
    text = scraped(server)
    assert 'fogwatch_tick{process="r1"} 41\n' in text
    assert 'fogwatch_mfow_seconds{process="r1"} 2.5\n' in text
    assert 'process_resident_memory_bytes{process="r1"} ' in text
    names = [line.split("{")[0] for line in text.splitlines() if not line.startswith("#")]
    assert len(names) == len(set(names) | {"fogwatch_info"}) == text.count("# TYPE ")


@pytest.mark.parametrize(
    ("request_", "status"),
    [
        (b"GET /metrics?x=1 HTTP/1.0\r\n\r\n", b"200 OK"),
        (b"HEAD /metrics HTTP/1.1\r\n\r\n", b"200 OK"),
        (b"GET / HTTP/1.1\r\n\r\n", b"404 Not Found"),
        (b"POST /metrics HTTP/1.1\r\n\r\n", b"405 Method Not Allowed"),
        (b"GET /metrics\r\n\r\n", b"400 Bad Request"),
        (b"\x16\x03\x01\x02\x00\r\n\r\n", b"400 Bad Request"),
        (b"\r\n\r\n", b"400 Bad Request"),
    ],
)
def test_what_is_answered(server: MetricsServer, request_: bytes, status: bytes) -> None:
    head, _, body = asked(server, request_).partition(b"\r\n\r\n")
    assert head.startswith(b"HTTP/1.1 " + status)
    length = int(re.search(rb"Content-Length: (\d+)", head)[1])  # type: ignore[index]
    assert len(body) == (0 if request_.startswith(b"HEAD") else length)


def test_a_long_request_is_not_kept(server: MetricsServer) -> None:
    for request in (b"GET /metrics HTTP/1.1\r\nX: " + b"a" * (4 * LONGEST_REQUEST), os.urandom(1 << 20)):
        answer = b""
        with suppress(BrokenPipeError, ConnectionResetError):  # closed before it has all been sent
            answer = asked(server, request)
        assert answer in (b"", BAD)
    assert "fogwatch_tick" in scraped(server)


def test_who_says_nothing_or_little_keeps_nobody_waiting(server: MetricsServer) -> None:
    with ExitStack() as held:
        for number in range(4 * MOST_CONNECTIONS):
            client = held.enter_context(socket.create_connection(where(server), PATIENCE_S))
            client.sendall(GET[: number % 5])
            if number % MOST_CONNECTIONS == 0:
                assert "fogwatch_tick" in scraped(server)
        assert "fogwatch_tick" in scraped(server)


def test_a_client_that_stays_is_sent_away_and_one_that_leaves_disturbs_nobody(server: MetricsServer) -> None:
    with socket.create_connection(where(server), PATIENCE_S) as client:
        client.sendall(b"GET /met")
        assert client.recv(1) == b""
    for _ in range(20):
        with socket.create_connection(where(server), PATIENCE_S) as client:
            client.sendall(GET)
    assert "fogwatch_tick" in scraped(server)


@pytest.mark.parametrize(
    ("told", "because"),
    [
        *((at, "is not HOST:PORT") for at in ("9100", "localhost:", ":9100", "127.0.0.1:99999", "127.0.0.1:-1")),
        ("127.0.0.1:\u0661", "is not HOST:PORT"),
        *((f"{at}:9100", "other machines could read the metrics") for at in ("0.0.0.0", "[::]", "robot.example")),
    ],
)
def test_where_no_metrics_can_be(told: str, because: str) -> None:
    with pytest.raises(BadInput, match=because) as bad:
        listen_at(told, is_open=False)
    assert str(bad.value).startswith(f"--metrics {told}: ")
    assert "\n" not in str(bad.value)


def test_a_busy_port_is_bad_input_and_other_machines_are_served_only_when_told() -> None:
    why = r"cannot listen there \(Address already in use\); choose another port"
    with listen_at("127.0.0.1:0", is_open=False) as first, pytest.raises(BadInput, match=why):
        listen_at(f"127.0.0.1:{first.getsockname()[1]}", is_open=False)
    with listen_at("0.0.0.0:0", is_open=True) as listening:
        assert listening.getsockname()[0] == "0.0.0.0"
