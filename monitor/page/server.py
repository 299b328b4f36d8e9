"""The page's server: a few files, and one WebSocket for each viewer.

Two replays side by side are two pages, at `PAIR`, in the frames of a third one (pair.html), which has their clock.
"""

from __future__ import annotations

import asyncio
import json
import re
from collections.abc import Mapping, Sequence
from importlib.resources import files
from pathlib import Path
from typing import Any

from starlette.applications import Starlette
from starlette.concurrency import run_in_threadpool
from starlette.requests import Request
from starlette.responses import FileResponse, PlainTextResponse, RedirectResponse, Response
from starlette.routing import BaseRoute, Mount, Route, WebSocketRoute
from starlette.websockets import WebSocket, WebSocketDisconnect

from monitor.observation.source import Answer
from monitor.page.authorisation import Authorisation
from monitor.page.hub import Hub, Viewer
from monitor.page.messages import answer_message, static_message
from patrol import palette
from patrol.errors import BadInput

_EMPTY_STYLE = "'sha256-47DEQpj8HBSa+/TImW+5JCeuQeRkm5NMpJWZG3hSuFU='"
"""Hash of an empty style element, which plotly makes and then adds rules to."""
_MAP_STYLE = "'sha256-ji27qzEtxXZW+7dun6UwjHXJ18e6WAin1VvNtkzIE/o='"
"""Hash of the style that plotly adds for street maps; without it the browser logs an error."""

POLICY = (
    f"default-src 'none'; script-src 'self'; style-src 'self' {_EMPTY_STYLE} {_MAP_STYLE}; "
    "img-src 'self' data:; connect-src 'self'; base-uri 'none'; form-action 'none'; "
)
"""Content security policy: the page may load what this server serves, and nothing else."""

ALONE, FRAMED = "frame-ancestors 'none'", "frame-src 'self'; frame-ancestors 'self'"
"""The policy's end: no page may show this one in a frame, or only a page of this server."""

PAIR = ("first", "second")
"""Where the pages of two replays are; pair.html has the same names."""

HEADERS = {
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Cache-Control": "no-cache",
}

MAX_VIEWERS = 32
"""Pages with the key that are open at a time, and as many without it, which so keep no other viewer out."""
MAX_MESSAGE = 4096
"""Characters of the longest message that a page may send."""
FULL = 4001
"""Close code for a page beyond `MAX_VIEWERS`; main.js has the same number."""

_TIME = re.compile(r"\d{1,9}(:\d{1,9}){0,2}(\.\d{1,9})?")
"""The time in the address of a page at which a replay opens; main.js reads the same."""

_TYPES = {".html": "text/html", ".css": "text/css", ".js": "text/javascript", ".svg": "image/svg+xml"}

_MADE = {"palette.css": palette.css, "palette.js": palette.script}
"""Files that are made when they are asked for."""


class Server:
    """The web application around a hub."""

    def __init__(self, hubs: Sequence[Hub], authorisation: Authorisation) -> None:
        """Find the static files.

        There is one hub, or two for replays side by side; the caller starts and closes them.
        """
        self._authorisation = authorisation
        self._viewers = {True: 0, False: 0}
        folder = Path(str(files("monitor.page").joinpath("static")))
        self._files = {path.name: path for path in sorted(folder.iterdir()) if path.suffix in _TYPES}
        self._files["plotly.min.js"] = plotly_file()
        paired = len(hubs) > 1
        self._headers = {**HEADERS, "Content-Security-Policy": POLICY + (FRAMED if paired else ALONE)}
        self._first = "pair.html" if paired else "index.html"
        routes: list[BaseRoute] = [Route("/", self._serve_index), Route("/{name}", self._serve_file)]
        if paired:
            routes += [Mount(f"/{name}", routes=self._page_routes(hub)) for name, hub in zip(PAIR, hubs, strict=True)]
        else:
            routes += self._page_routes(hubs[0])
        self.app = Starlette(routes=routes)

    def _page_routes(self, hub: Hub) -> list[BaseRoute]:
        """Return the routes of the page of one hub."""

        async def live(socket: WebSocket) -> None:
            await self._serve_live(socket, hub)

        return [Route("/{name}", self._serve_file), WebSocketRoute("/live", live)]

    async def _serve_index(self, request: Request) -> Response:
        key = request.query_params.get("key")
        if key is None:
            return self._file_response(request, self._first)
        if not self._authorisation.is_key(key) or not self._authorisation.allows_host(request.headers):
            return _refuse_request("the key is wrong; open the address exactly as printed")
        time = request.query_params.get("t", "")
        response = RedirectResponse(
            f"/?t={time}" if _TIME.fullmatch(time) else "/", status_code=303, headers=self._headers
        )
        response.set_cookie(self._authorisation.cookie, key, httponly=True, samesite="lax")
        return response

    async def _serve_file(self, request: Request) -> Response:
        return self._file_response(request, request.path_params["name"])

    def _file_response(self, request: Request, name: str) -> Response:
        if not self._authorisation.allows_host(request.headers):
            return _refuse_request("this page is served to this machine only; open it at 127.0.0.1 or localhost")
        rules = self._authorisation
        if not (rules.view_without_key or rules.is_key(request.cookies.get(rules.cookie))):
            return _refuse_request("this page needs its token; open the address exactly as printed")
        if (make_file := _MADE.get(name)) is not None:
            return Response(make_file(), media_type=_TYPES[Path(name).suffix], headers=self._headers)
        path = self._files.get(name)
        if path is None:
            return PlainTextResponse("no such file\n", status_code=404, headers=self._headers)
        return FileResponse(path, media_type=_TYPES[path.suffix], headers=self._headers)

    async def _serve_live(self, socket: WebSocket, hub: Hub) -> None:
        authorisation = self._authorisation
        # From the cookie alone: a key in the address of a socket would end up in logs.
        may_control = authorisation.is_key(socket.cookies.get(authorisation.cookie))
        ours = authorisation.allows_host(socket.headers) and authorisation.same_origin(socket.headers)
        if not ours or not (authorisation.view_without_key or may_control):
            await socket.close(1008)  # before the connection is accepted, so the browser gets a 403
            return
        self._viewers[may_control] += 1
        try:
            await socket.accept()
            if self._viewers[may_control] > MAX_VIEWERS:
                # Accepted before, since only an open socket can give its reason.
                await socket.close(FULL)
                return
            viewer = Viewer(asyncio.get_running_loop())
            await socket.send_text(static_message(hub.static, may_control))
            await socket.send_bytes(hub.terrain)
            hub.add(viewer)
            writer = asyncio.create_task(_write_messages(socket, viewer))
            try:
                await self._read_controls(socket, hub, viewer, may_control)
            finally:
                hub.remove(viewer)
                writer.cancel()
        except (WebSocketDisconnect, RuntimeError):
            pass  # the page was closed
        finally:
            self._viewers[may_control] -= 1

    async def _read_controls(self, socket: WebSocket, hub: Hub, viewer: Viewer, may_control: bool) -> None:
        while True:
            received = await socket.receive()
            if received["type"] == "websocket.disconnect":
                return
            match _parse_message(received.get("text")):
                case {"type": "drawn"}:
                    viewer.drawn = True
                    hub.wake()
                case {"type": "show", "layers": list() as numbers}:
                    hub.select(viewer, [number for number in numbers if type(number) is int])
                    viewer.drawn = True
                    hub.wake()
                case {"type": "control", "id": int() as number, "control": dict() as control}:
                    answer = await self._answer_control(hub, control, may_control)
                    await socket.send_text(answer_message(number, answer))
                case _:
                    await socket.close(1003)
                    return

    async def _answer_control(self, hub: Hub, control: Mapping[str, Any], may_control: bool) -> Answer:
        if not may_control:
            return Answer(False, "this page is view-only; to control, open the address exactly as printed")
        if control.get("do") not in hub.static.controls:
            return Answer(False, f"{str(control.get('do'))[:40]}: this control is not available here")
        try:
            return await run_in_threadpool(hub.source.control, control)
        except BadInput as bad:
            return Answer(False, str(bad))


async def _write_messages(socket: WebSocket, viewer: Viewer) -> None:
    while (messages := await viewer.outbox.get()) is not None:
        for message in messages:
            if isinstance(message, str):
                await socket.send_text(message)
            else:
                await socket.send_bytes(message)
        viewer.written += 1
    await socket.close(1001)


def _parse_message(text: str | None) -> object:
    """Return a message of a page; None for anything but JSON text of a sensible length."""
    if text is None or len(text) > MAX_MESSAGE:
        return None
    try:
        message: object = json.loads(text)
    except (ValueError, RecursionError):
        return None
    return message


def _refuse_request(why: str) -> Response:
    return PlainTextResponse(
        f"{why}\n", status_code=403, headers={**HEADERS, "Content-Security-Policy": POLICY + ALONE}
    )


def plotly_file() -> Path:
    """Return the path of plotly's script in its Python package."""
    from importlib.util import find_spec

    spec = find_spec("plotly")
    if spec is None or spec.origin is None:
        raise BadInput("the page needs plotly; install it with: pip install 'fogwatch[monitor]'")
    return Path(spec.origin).parent / "package_data" / "plotly.min.js"
