"""Metrics for Prometheus: the figures of a process as text, over HTTP, at ``/metrics``.

One thread serves a few connections at a time, each for a limited time and with a limited request, and rests between two
rounds: whatever connects, the process's own loop hardly notices. The figures name no places and no secrets, and nothing
can be changed through this address.
"""

from __future__ import annotations

import math
import selectors
import socket
import threading
import time
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, field

from patrol.errors import BadInput
from patrol.reporting.vitals import Figure, Value, Vitals
from patrol.security.keys import is_loopback

OPTION = "--metrics"
OPEN_OPTION = "--metrics-open"

MOST_CONNECTIONS = 8
"""Connections at a time; with one more, the oldest is closed."""

LONGEST_REQUEST = 4096
"""Bytes of the longest request."""

LIMIT_S = 2.0
"""Longest time of a connection, s."""

REST_S = 0.02
"""Time between two rounds over the connections, s; in a round each is read from or written to once."""

KEEP_S = 0.25
"""Time for which the same text is the answer, s."""

_POLL_S = 0.5
_READ_BYTES = 1024


def render(figures: Mapping[Figure, Value], labels: Mapping[str, str]) -> bytes:
    """Write the figures in Prometheus' text format, version 0.0.4; each number gets all the labels."""
    lines = []
    for figure, value in figures.items():
        lines += [f"# HELP {figure.name} {figure.says}", f"# TYPE {figure.name} {figure.kind}"]
        numbers = value if isinstance(value, Mapping) else {"": value}
        for name, number in numbers.items():
            label = {figure.label: name} if figure.label else {}
            pairs = ",".join(f'{key}="{_escape_label(text)}"' for key, text in {**labels, **label}.items())
            lines.append(f"{figure.name}{{{pairs}}} {_number_text(number)}")
    return "".join(f"{line}\n" for line in lines).encode()


def _escape_label(text: str) -> str:
    return text.replace("\\", "\\\\").replace("\n", "\\n").replace('"', '\\"')


def _number_text(number: float) -> str:
    if math.isnan(number):
        return "NaN"
    if math.isinf(number):
        return "+Inf" if number > 0 else "-Inf"
    return repr(number)


def listen_at(where: str, *, is_open: bool) -> socket.socket:
    """Open a listening socket for metrics at ``HOST:PORT``; port 0 stands for a free one.

    An address that other machines can reach is refused unless `is_open`.
    """
    host, colon, number = where.rpartition(":")
    bare = host[1:-1] if host.startswith("[") and host.endswith("]") else host
    if not colon or not bare or not (number.isascii() and number.isdigit()) or int(number) > 65535:
        raise BadInput(f"{OPTION} {where}: is not HOST:PORT; give, for example, 127.0.0.1:9100")
    if not is_loopback(bare) and not is_open:
        raise BadInput(
            f"{OPTION} {where}: other machines could read the metrics; give a loopback address such as "
            f"127.0.0.1:{number}, or {OPEN_OPTION} as well"
        )
    try:
        family, kind, protocol, _, address = socket.getaddrinfo(bare, int(number), type=socket.SOCK_STREAM)[0]
        listening = socket.socket(family, kind, protocol)
        try:
            listening.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            listening.bind(address)
            listening.listen(MOST_CONNECTIONS)
        except BaseException:
            listening.close()
            raise
    except OSError as error:
        raise BadInput(
            f"{OPTION} {where}: cannot listen there ({error.strerror}); choose another port, or 0 for a free one"
        ) from None
    listening.setblocking(False)
    return listening


@dataclass(eq=False)
class _Connection:
    """A connection, and the parts of its request and answer."""

    end: socket.socket
    until: float
    request: bytes = b""
    answer: memoryview = field(default_factory=lambda: memoryview(b""))


class MetricsServer:
    """Answers requests for metrics, from now until `close`."""

    def __init__(self, listening: socket.socket, vitals: Vitals, labels: Mapping[str, str]) -> None:
        """Begin to answer, on a thread of its own; `close` closes the listening socket."""
        self._listening = listening
        self._vitals = vitals
        self._labels = labels
        self._text = (-math.inf, b"")
        self._connections: list[_Connection] = []
        self._selector = selectors.DefaultSelector()
        self._selector.register(listening, selectors.EVENT_READ)
        self._ending = threading.Event()
        self._thread = threading.Thread(target=self._serve_forever, name="metrics", daemon=True)
        self._thread.start()

    @property
    def address(self) -> str:
        """The URL of the metrics."""
        host, port = self._listening.getsockname()[:2]
        return f"http://{f'[{host}]' if ':' in host else host}:{port}/metrics"

    def close(self) -> None:
        """Stop answering."""
        self._ending.set()
        self._thread.join()

    def _serve_forever(self) -> None:
        try:
            while not self._ending.wait(REST_S):
                self._serve_round()
        finally:
            for connection in list(self._connections):
                self._drop_connection(connection)
            self._selector.close()
            self._listening.close()

    def _serve_round(self) -> None:
        """Take in at most one connection, and read from or write to each of those that are ready, once."""
        for key, _ in self._selector.select(_POLL_S):
            if key.data is None:
                self._take_in()
                continue
            try:
                finished = self._serve_connection(key.data)
            except OSError:  # it has gone
                finished = True
            if finished:
                self._drop_connection(key.data)
        now = time.monotonic()
        for late in [connection for connection in self._connections if now > connection.until]:
            self._drop_connection(late)

    def _take_in(self) -> None:
        with suppress(OSError):  # it has gone already, or this process has no descriptor left
            end, _ = self._listening.accept()
            end.setblocking(False)
            connection = _Connection(end, time.monotonic() + LIMIT_S)
            self._connections.append(connection)
            self._selector.register(end, selectors.EVENT_READ, connection)
        if len(self._connections) > MOST_CONNECTIONS:
            self._drop_connection(self._connections[0])

    def _drop_connection(self, connection: _Connection) -> None:
        if connection in self._connections:  # it may have been dropped for a newer one in the same round
            self._connections.remove(connection)
            self._selector.unregister(connection.end)
            connection.end.close()

    def _serve_connection(self, connection: _Connection) -> bool:
        """Read some of a request or write some of the answer; whether the connection is done with."""
        if connection not in self._connections:
            return True
        if not connection.answer:
            some = connection.end.recv(_READ_BYTES)
            connection.request += some
            if not some:
                return True
            if b"\r\n\r\n" not in connection.request and len(connection.request) <= LONGEST_REQUEST:
                return False
            connection.answer = memoryview(self._answer_request(connection.request))
            self._selector.modify(connection.end, selectors.EVENT_WRITE, connection)
        connection.answer = connection.answer[connection.end.send(connection.answer) :]
        return not connection.answer

    def _answer_request(self, request: bytes) -> bytes:
        words = request.partition(b"\r\n")[0].split(b" ")
        if len(request) > LONGEST_REQUEST or len(words) != 3 or not words[2].startswith(b"HTTP/1."):
            return _make_response("400 Bad Request", b"bad request\n")
        if words[0] not in (b"GET", b"HEAD"):
            return _make_response("405 Method Not Allowed", b"only GET\n", "Allow: GET, HEAD\r\n")
        if words[1].partition(b"?")[0] != b"/metrics":
            return _make_response("404 Not Found", b"the metrics are at /metrics\n")
        response = _make_response("200 OK", self._render_metrics())
        return response[: response.index(b"\r\n\r\n") + 4] if words[0] == b"HEAD" else response

    def _render_metrics(self) -> bytes:
        now = time.monotonic()
        made_s, text = self._text
        if now - made_s > KEEP_S:
            text = render(self._vitals.read(), self._labels)
            self._text = now, text
        return text


def _make_response(status: str, body: bytes, more: str = "") -> bytes:
    kind = "text/plain; version=0.0.4; charset=utf-8"
    head = (
        f"HTTP/1.1 {status}\r\nContent-Type: {kind}\r\nContent-Length: {len(body)}\r\nConnection: close\r\n{more}\r\n"
    )
    return head.encode("ascii") + body
