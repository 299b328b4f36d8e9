"""What a page is sent over its WebSocket: it answers, or closes that one connection, and serves the others."""

import json
from collections.abc import Iterator

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import ClientConnection

from monitor.replay.player import Player
from tests.monitor.conftest import Seen, quiet
from tests.monitor.page.test_server import look
from tests.monitor.pages import PATIENCE_S, ServedPage

__all__ = ["quiet"]

UNSUPPORTED = 1003
"""The close code for a message that is none of a page's."""

VALUES = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(st.characters(exclude_categories=()), max_size=9),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=5), inner, max_size=4),
    max_leaves=8,
)
CONTROLS = st.fixed_dictionaries(
    {"do": st.sampled_from(["play", "seek", "speed", "pause", "step", "nothing"]) | VALUES},
    optional={"to": VALUES, "ticks": VALUES, "factor": VALUES},
)
OF_A_PAGE = st.fixed_dictionaries(
    {"type": st.sampled_from(["drawn", "show", "control"]) | VALUES},
    optional={"layers": VALUES, "id": st.integers() | VALUES, "control": CONTROLS | VALUES},
).map(json.dumps)
NESTED = st.integers(100, 2000).map(lambda deep: "[" * deep)
LONG = st.just("x" * 5000)
MESSAGES = OF_A_PAGE | NESTED | LONG | VALUES.map(json.dumps) | st.text(max_size=200) | st.binary(max_size=200)


@pytest.fixture(scope="module")
def page(quiet: Seen) -> Iterator[ServedPage]:
    page = ServedPage(Player(quiet.open()))
    yield page
    page.close()


def answered(socket: ClientConnection) -> bool:
    """Whether a page is answered to a control; false where its connection was closed."""
    try:
        socket.send(json.dumps({"type": "control", "id": 7, "control": {"do": "no such thing"}}))
        while True:
            message = socket.recv(timeout=PATIENCE_S)
            says = json.loads(message) if isinstance(message, str) else {}
            if (says.get("type"), says.get("id")) == ("answer", 7):
                return True
    except ConnectionClosed:
        return False


def test_no_message_ends_a_page(page: ServedPage) -> None:
    closed = set()
    with look(page, key=page.key) as kept:

        @settings(deadline=None, max_examples=60, suppress_health_check=list(HealthCheck))
        @given(MESSAGES)
        def check(message: str | bytes) -> None:
            with look(page, key=page.key) as socket:
                socket.send(message)
                closed.add(None if answered(socket) else socket.close_code)

        check()
        assert closed == {None, UNSUPPORTED}
        assert answered(kept)
