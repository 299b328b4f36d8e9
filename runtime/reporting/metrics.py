"""Metrics for Prometheus: the figures of a process as text, over HTTP, at ``/metrics``.

One thread serves a few connections at a time, each for a limited time and with a limited request, and rests again and
again: whatever connects, the process's own loop hardly notices. The figures name no places and no secrets, and nothing
can be changed through this address.
"""

from __future__ import annotations

import asyncio
import math
import socket
import threading
import time
from collections.abc import Mapping
from contextlib import suppress

from patrol.errors import BadInput
from runtime.reporting.supervision import OPEN_OPTION, OPTION
from runtime.reporting.vitals import Figure, Value, Vitals
from runtime.security.keys import is_loopback

MOST_CONNECTIONS = 8
"""Connections at a time; with one more, the oldest is closed."""

LONGEST_REQUEST = 4096
"""Bytes of the longest request."""

LIMIT_S = 2.0
"""Longest time of a connection, s."""

REST_S = 0.02
"""Rest after a connection was taken in, and before each piece of a request is read, s."""

KEEP_S = 0.25
"""Time for which the same text is the answer, s."""

_READ_BYTES = 1024


def render(figures: Mapping[Figure, Value], labels: Mapping[str, str]) -> bytes:
    """Write the figures in Prometheus' text format, version 0.0.4; each number gets all the labels.

    For example, a line may read ``fogwatch_tick{process="world"} 12``.
    """
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
    # All digits: counters grow large, and a rounded one would seem to stand still.
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


class MetricsServer:
    """Answers requests for metrics, from now until `close`."""

    def __init__(self, listening: socket.socket, vitals: Vitals, labels: Mapping[str, str]) -> None:
        """Begin to answer, on a thread of its own; `close` closes the listening socket."""
        self._listening = listening
        self._vitals = vitals
        self._labels = labels
        self._text = (-math.inf, b"")
        self._loop = asyncio.new_event_loop()
        self._ending = asyncio.Event()
        self._thread = threading.Thread(target=self._run_loop, name="metrics", daemon=True)
        self._thread.start()

    @property
    def address(self) -> str:
        """The URL of the metrics."""
        host, port = self._listening.getsockname()[:2]
        return f"http://{f'[{host}]' if ':' in host else host}:{port}/metrics"

    def close(self) -> None:
        """Stop answering."""
        self._loop.call_soon_threadsafe(self._ending.set)
        self._thread.join()

    def _run_loop(self) -> None:
        with self._listening, asyncio.Runner(loop_factory=lambda: self._loop) as runner:
            runner.run(self._serve())  # which then cancels what is still under way

    async def _serve(self) -> None:
        accepting = self._loop.create_task(self._accept_connections())
        await self._ending.wait()
        accepting.cancel()

    async def _accept_connections(self) -> None:
        """Take in a connection at a time, with a rest after each; for one too many, the oldest is closed."""
        connections: list[asyncio.Task[None]] = []
        while True:
            with suppress(OSError):  # it has gone already, or this process has no descriptor left
                end, _ = await self._loop.sock_accept(self._listening)
                # Oldest first, as they came.
                connections = [task for task in connections if not task.done()]
                connections.append(self._loop.create_task(self._serve_connection(end)))
                if len(connections) > MOST_CONNECTIONS:
                    connections[0].cancel()
            await asyncio.sleep(REST_S)

    async def _serve_connection(self, end: socket.socket) -> None:
        """Answer one request, if it comes in time."""
        with end, suppress(OSError):  # it has gone, or is late
            async with asyncio.timeout(LIMIT_S):
                request = b""
                while b"\r\n\r\n" not in request and len(request) <= LONGEST_REQUEST:
                    await asyncio.sleep(REST_S)
                    some = await self._loop.sock_recv(end, _READ_BYTES)
                    if not some:
                        return
                    request += some
                await self._loop.sock_sendall(end, self._answer_request(request))

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
        # Several readers that ask at once cost as much as one.
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
