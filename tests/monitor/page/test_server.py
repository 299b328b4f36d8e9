import asyncio
import json
import re
from collections.abc import Iterator
from http.client import HTTPConnection
from pathlib import Path
from typing import Any

import pytest
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import ClientConnection, connect

from monitor.page.hub import Viewer
from monitor.page.server import FULL
from monitor.process import main
from monitor.replay.player import Player
from runtime.process.lifeline import Ending
from runtime.security.keys import is_loopback
from tests.monitor.conftest import Seen
from tests.monitor.pages import PATIENCE_S, ServedPage
from tests.present import present

TOKEN = "abcdefghij0123456789"
OPTION = re.compile(r"--[a-z]+(?:-[a-z]+)*")


@pytest.fixture(scope="module")
def open_page(quiet: Seen) -> Iterator[ServedPage]:
    page = ServedPage(Player(quiet.open()))
    yield page
    page.close()


@pytest.fixture(scope="module")
def closed_page(quiet: Seen) -> Iterator[ServedPage]:
    """One that others could reach: nobody gets anything without the token."""
    page = ServedPage(Player(quiet.open()), key=TOKEN, host="0.0.0.0")
    yield page
    page.close()


def get(page: ServedPage, path: str, **headers: str) -> tuple[int, dict[str, str], str]:
    connection = HTTPConnection("127.0.0.1", page.port or 0, timeout=PATIENCE_S)
    connection.request("GET", path, headers={name.replace("_", "-"): value for name, value in headers.items()})
    answer = connection.getresponse()
    body = answer.read().decode("utf-8", "replace")
    connection.close()
    return answer.status, {name.lower(): value for name, value in answer.getheaders()}, body


def look(page: ServedPage, origin: str | None = "", key: str = "", **headers: str) -> ClientConnection:
    host = f"127.0.0.1:{page.port}"
    if key:
        headers["Cookie"] = f"fogwatch-{page.port}={key}"
    return connect(
        f"ws://{host}/live",
        origin=None if origin is None else origin or f"http://{host}",  # type: ignore[arg-type]
        additional_headers=headers,
        compression=None,
        proxy=None,
        max_size=1 << 24,
    )


def said(socket: ClientConnection, kind: str) -> dict[str, Any]:
    """The next message of that kind; everything that is shown is drawn at once."""
    while True:
        message = socket.recv(timeout=PATIENCE_S)
        if isinstance(message, str):
            says: dict[str, Any] = json.loads(message)
            if says["type"] == "state":
                socket.send('{"type":"drawn"}')
            if says["type"] == kind:
                return says


def test_files_come_with_a_strict_policy_and_nothing_else_comes(open_page: ServedPage) -> None:
    for path, kind in (("/", "text/html"), ("/main.js", "text/javascript"), ("/page.css", "text/css")):
        status, headers, _ = get(open_page, path)
        assert status == 200
        assert headers["content-type"].startswith(kind)
        policy = headers["content-security-policy"]
        assert policy.startswith("default-src 'none'; script-src 'self'; ")
        assert not any(word in policy for word in ("unsafe", "http"))
    for path in ("/nothing", "/../server.py", "/..%2fserver.py", "/%2e%2e/hub.py", "/static/main.js", "/tiles.py"):
        assert get(open_page, path)[0] == 404


def test_a_name_that_merely_points_here_is_refused(open_page: ServedPage) -> None:
    for host in ("evil.example", f"evil.example:{open_page.port}", "127.0.0.1.evil.example", ""):
        assert get(open_page, "/", Host=host)[0] in (400, 403)
    for host in ("localhost", "[::1]", f"127.0.0.1:{open_page.port}"):
        assert get(open_page, "/", Host=host)[0] == 200


@pytest.mark.parametrize("origin", ["http://evil.example", "null", "http://127.0.0.1:1", None])
def test_a_page_of_another_origin_is_refused(open_page: ServedPage, origin: str | None) -> None:
    with pytest.raises(InvalidStatus) as refused, look(open_page, origin, open_page.key):
        pass
    assert refused.value.response.status_code == 403


def test_who_lacks_the_key_looks_but_may_ask_for_nothing(open_page: ServedPage) -> None:
    with look(open_page) as socket:
        facts = said(socket, "static")
        assert (facts["controls"], facts["mayControl"]) == ([], False)
        assert said(socket, "state")["robots"]
        socket.send(json.dumps({"type": "control", "id": 1, "control": {"do": "seek", "k": 5}}))
        answer = said(socket, "answer")
        assert not answer["done"]
        assert "view-only" in answer["text"]


def test_the_key_is_taken_once_and_kept_where_no_script_reads_it(open_page: ServedPage) -> None:
    assert get(open_page, "/?key=wrong")[0] == 403
    status, headers, _ = get(open_page, f"/?key={open_page.key}")
    assert (status, headers["location"]) == (303, "/")
    for time, there in (("1:30.5", "/?t=1:30.5"), ("//example.org", "/"), ("1%0a", "/")):
        assert get(open_page, f"/?key={open_page.key}&t={time}")[1]["location"] == there
    assert headers["set-cookie"].startswith(f"fogwatch-{open_page.port}={open_page.key};")
    assert "httponly" in headers["set-cookie"].lower()
    with look(open_page, key=open_page.key) as socket:
        assert "seek" in said(socket, "static")["controls"]
        socket.send(json.dumps({"type": "control", "id": 7, "control": {"do": "seek", "k": 33}}))
        assert said(socket, "answer") == {"type": "answer", "id": 7, "done": True, "text": ""}
        socket.send(json.dumps({"type": "control", "id": 8, "control": {"do": "seek", "k": 44}}))
        while said(socket, "state")["k"] != 44:
            pass
        refused: list[dict[str, Any]] = [{"do": "fault", "fault": {"kind": "kill", "who": "r1"}}, {"do": []}, {}]
        for control in refused:
            socket.send(json.dumps({"type": "control", "id": 9, "control": control}))
            while (answer := said(socket, "answer"))["id"] != 9:
                pass
            assert not answer["done"]


def test_what_is_no_message_ends_the_connection_alone(open_page: ServedPage, caplog: pytest.LogCaptureFixture) -> None:
    no_number = '{"type":"control","id":"x","control":{}}'
    for nonsense in ("", "{", "[1]", no_number, "[" * 4000, "x" * 5000, '{"type":"show"}', b"\0"):
        with look(open_page) as socket:
            said(socket, "static")
            socket.send(nonsense)
            with pytest.raises(ConnectionClosed) as closed:
                said(socket, "never")
        assert present(closed.value.rcvd).code == 1003
    with look(open_page) as socket:
        assert said(socket, "static")["name"]
    assert caplog.records == [], "no traceback"


def test_a_page_that_reads_nothing_gets_no_frame_before_the_last_one_was_taken() -> None:
    async def flooded() -> None:
        viewer = Viewer(asyncio.get_running_loop())
        assert viewer.ready
        viewer.post(["a frame"])
        viewer.drawn = True
        assert not viewer.ready
        await asyncio.sleep(0)
        assert viewer.outbox.qsize() == 1
        viewer.written += 1
        assert viewer.ready

    asyncio.run(flooded())


def test_who_finds_no_room_is_told_so(open_page: ServedPage, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("monitor.page.server.MAX_VIEWERS", 1)
    with look(open_page) as first:
        said(first, "state")
        with look(open_page) as second, pytest.raises(ConnectionClosed) as closed:
            second.recv(timeout=PATIENCE_S)
        assert present(closed.value.rcvd).code == FULL
        with look(open_page, key=open_page.key) as owner:  # who has the key has a place of its own
            said(owner, "state")
            with look(open_page, key=open_page.key) as another, pytest.raises(ConnectionClosed):
                another.recv(timeout=PATIENCE_S)


def test_whatever_the_jumps_a_page_has_the_whole_trail(open_page: ServedPage, quiet: Seen) -> None:
    poses = quiet.open().poses[:, :, :2]
    with look(open_page, key=open_page.key) as socket:
        has: dict[int, list[float]] = {}
        for k in (50, 53, 20, 70):
            socket.send(json.dumps({"type": "control", "id": 1, "control": {"do": "seek", "k": k}}))
            shown = -1
            while shown != k:
                says = json.loads(text) if isinstance(text := socket.recv(timeout=PATIENCE_S), str) else {}
                if says.get("type") == "trail":
                    has |= dict(enumerate(says["rows"], start=says["first"]))
                elif says.get("type") == "state":  # the last message of a frame
                    shown = says["k"]
                    socket.send('{"type":"drawn"}')
            for tick in range(k + 1):
                assert has[tick] == pytest.approx(poses[tick].ravel().tolist(), abs=1e-3)
            has = {tick: row for tick, row in has.items() if tick <= k}


def test_off_loopback_nothing_is_had_without_the_token(closed_page: ServedPage) -> None:
    for path in ("/", "/main.js", "/plotly.min.js"):
        assert get(closed_page, path)[0] == 403
        assert get(closed_page, path, Cookie=f"fogwatch-{closed_page.port}=wrong")[0] == 403
        assert get(closed_page, path, Cookie=f"fogwatch-{closed_page.port}={TOKEN}")[0] == 200
    for key in ("", "wrong"):
        with pytest.raises(InvalidStatus), look(closed_page, key=key):
            pass
    with look(closed_page, key=TOKEN) as socket:
        assert said(socket, "static")["mayControl"]


def test_what_loopback_is() -> None:
    hosts = ("127.0.0.1", "127.9.9.9", "::1", "localhost", "0.0.0.0", "lab")
    assert [is_loopback(host) for host in hosts] == [True, True, True, True, False, False]


BAD_INPUT: tuple[tuple[list[str], str, str], ...] = (
    (["--replay", "RUN", "--host", "0.0.0.0"], "", "--host 0.0.0.0: "),
    (["--replay", "RUN"], "short", "FOGWATCH_PAGE_KEY: has 5 characters"),
    (["--replay", "RUN"], "not-letters-and-digits", "FOGWATCH_PAGE_KEY: "),
    (["--replay", "RUN/nowhere"], "", "no such folder"),
    (["--router", "tcp/127.0.0.1:1"], "", "--fleet"),
    (["--router", "tcp/127.0.0.1:1", "--fleet", "x", "--radio", "tcp/127.0.0.1:2"], "", "give their --scenario"),
    (["--replay", "RUN", "--page-port", "99999"], "", "--page-port 99999: ports go from 1 to 65535"),
    (["--replay", "RUN", "--page-port", "-1"], "", "--page-port -1: ports go from 1 to 65535"),
    (["--replay", "RUN", "--host", "no.such.host.invalid"], "", "--host"),
)


@pytest.mark.parametrize(("arguments", "token", "problem"), BAD_INPUT)
def test_bad_input_is_reported_in_terms_of_the_options_that_there_are(
    arguments: list[str], token: str, problem: str, tmp_path: Path, capsys: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("runtime.process.context.heed", lambda *_, **__: Ending())
    monkeypatch.setattr("os.nice", lambda _: 0)  # it would hold for all tests after this one, and for what they start
    monkeypatch.setenv("FOGWATCH_PAGE_KEY", token)
    assert main([argument.replace("RUN", str(tmp_path)) for argument in arguments]) == 2
    (says,) = (line for line in capsys.readouterr().err.splitlines() if not line.startswith("compiling"))
    assert problem in says
    with pytest.raises(SystemExit):
        main(["--help"])
    options = set(OPTION.findall(capsys.readouterr().out))
    assert set(OPTION.findall(says)) <= options
