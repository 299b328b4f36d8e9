"""The page's server: a few files, and one WebSocket for each viewer."""

from __future__ import annotations

import asyncio
import json
from collections.abc import Mapping
from importlib.resources import files
from pathlib import Path
from typing import Any

from starlette.applications import Starlette
from starlette.concurrency import run_in_threadpool
from starlette.requests import Request
from starlette.responses import FileResponse, PlainTextResponse, RedirectResponse, Response
from starlette.routing import Route, WebSocketRoute
from starlette.websockets import WebSocket, WebSocketDisconnect

from monitor.page import words
from monitor.page.gate import Gate
from monitor.page.hub import Hub, Viewer
from monitor.source import Answer
from patrol.errors import BadInput

_EMPTY_STYLE = "'sha256-47DEQpj8HBSa+/TImW+5JCeuQeRkm5NMpJWZG3hSuFU='"
"""Of a style element without content, which the charts' library makes to add rules to."""
_MAP_STYLE = "'sha256-ji27qzEtxXZW+7dun6UwjHXJ18e6WAin1VvNtkzIE/o='"
"""Of the style that the same library adds for street maps; without it the browser's console has an error."""

POLICY = (
    f"default-src 'none'; script-src 'self'; style-src 'self' {_EMPTY_STYLE} {_MAP_STYLE}; "
    "img-src 'self' data:; connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)
"""What the page may load: what this server serves, and nothing else."""

HEADERS = {
    "Content-Security-Policy": POLICY,
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Cache-Control": "no-cache",
}

MOST_VIEWERS = 32
LONGEST = 4096
"""Letters of the longest thing that a page may say."""
FULL = 4001
"""The code that a page over `MOST_VIEWERS` is told; main.js knows it."""

_TYPES = {".html": "text/html", ".css": "text/css", ".js": "text/javascript", ".svg": "image/svg+xml"}


class Server:
    """The application around a hub."""

    def __init__(self, hub: Hub, gate: Gate) -> None:
        self._hub = hub
        self._gate = gate
        self._viewers = 0
        folder = Path(str(files("monitor.page").joinpath("static")))
        self._files = {path.name: path for path in sorted(folder.iterdir()) if path.suffix in _TYPES}
        self._files["plotly.min.js"] = plotly_file()
        routes = [Route("/", self._index), Route("/{name}", self._file), WebSocketRoute("/live", self._live)]
        self.app = Starlette(routes=routes)

    async def _index(self, request: Request) -> Response:
        key = request.query_params.get("key")
        if key is None:
            return self._serve(request, "index.html")
        if not self._gate.knows(key) or not self._gate.host_is_ours(request.headers):
            return _refused("this is not the key of this page; open the address as it was printed")
        response = RedirectResponse("/", status_code=303, headers=HEADERS)
        response.set_cookie(self._gate.cookie, key, httponly=True, samesite="lax")
        return response

    async def _file(self, request: Request) -> Response:
        return self._serve(request, request.path_params["name"])

    def _serve(self, request: Request, name: str) -> Response:
        if not self._gate.host_is_ours(request.headers):
            return _refused("this page is served on this machine only, under its own names")
        if not (self._gate.open or self._gate.knows(request.cookies.get(self._gate.cookie))):
            return _refused("this page needs its token; open the address as it was printed")
        path = self._files.get(name)
        if path is None:
            return PlainTextResponse("there is no such file\n", status_code=404, headers=HEADERS)
        return FileResponse(path, media_type=_TYPES[path.suffix], headers=HEADERS)

    async def _live(self, socket: WebSocket) -> None:
        gate = self._gate
        may_ask = gate.knows(socket.cookies.get(gate.cookie))
        ours = gate.host_is_ours(socket.headers) and gate.same_origin(socket.headers)
        if not ours or not (gate.open or may_ask):
            await socket.close(1008)  # before accepting: the browser sees a 403
            return
        self._viewers += 1
        try:
            await socket.accept()
            if self._viewers > MOST_VIEWERS:
                await socket.close(FULL)
                return
            viewer = Viewer(asyncio.get_running_loop())
            await socket.send_text(words.static_words(self._hub.static, may_ask))
            await socket.send_bytes(self._hub.terrain)
            self._hub.enter(viewer)
            writer = asyncio.create_task(_write(socket, viewer))
            try:
                await self._read(socket, viewer, may_ask)
            finally:
                self._hub.leave(viewer)
                writer.cancel()
        except (WebSocketDisconnect, RuntimeError):
            pass  # it has left
        finally:
            self._viewers -= 1

    async def _read(self, socket: WebSocket, viewer: Viewer, may_ask: bool) -> None:
        while True:
            message = await socket.receive()
            if message["type"] == "websocket.disconnect":
                return
            says = _understood(message.get("text"))
            match says:
                case {"type": "drawn"}:
                    viewer.drawn = True
                    self._hub.wake()
                case {"type": "show", "layers": list() as numbers}:
                    self._hub.show(viewer, [number for number in numbers if type(number) is int])
                    viewer.drawn = True
                    self._hub.wake()
                case {"type": "ask", "id": int() as number, "control": dict() as control}:
                    answer = await self._answer(control, may_ask)
                    await socket.send_text(words.answer_words(number, answer))
                case _:
                    await socket.close(1003)
                    return

    async def _answer(self, control: Mapping[str, Any], may_ask: bool) -> Answer:
        if not may_ask:
            return Answer(False, "this page may only look; open the address as it was printed to ask for something")
        if control.get("do") not in self._hub.static.controls:
            return Answer(False, "this cannot be asked for here")
        try:
            return await run_in_threadpool(self._hub.source.ask, control)
        except BadInput as bad:
            return Answer(False, str(bad))


async def _write(socket: WebSocket, viewer: Viewer) -> None:
    while (messages := await viewer.outbox.get()) is not None:
        for message in messages:
            if isinstance(message, str):
                await socket.send_text(message)
            else:
                await socket.send_bytes(message)
        viewer.written += 1
    await socket.close(1001)


def _understood(text: str | None) -> object:
    """What a page says; None for what is no text, and for other nonsense."""
    if text is None or len(text) > LONGEST:
        return None
    try:
        says: object = json.loads(text)
    except (ValueError, RecursionError):
        return None
    return says


def _refused(why: str) -> Response:
    return PlainTextResponse(f"{why}\n", status_code=403, headers=HEADERS)


def plotly_file() -> Path:
    """The charts' library, out of its Python package; BadInput where that is missing."""
    from importlib.util import find_spec

    spec = find_spec("plotly")
    if spec is None or spec.origin is None:
        raise BadInput("the page needs plotly; install it with: pip install 'fogwatch[monitor]'")
    return Path(spec.origin).parent / "package_data" / "plotly.min.js"
