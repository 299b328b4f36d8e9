"""The measurement of a router: all members hear all others, round by round."""

import pytest

from bench import router
from bench.router import BYTE_ROUNDS, Heard, Load

pytestmark = pytest.mark.processes


def test_a_router_delivers_every_frame_to_everybody_else() -> None:
    with Load(3) as load:
        assert load.bytes_sent(1) > BYTE_ROUNDS * 6 * 20
        assert load.router_time(2) >= 0.0


def test_what_does_not_arrive_is_counted(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(router, "PATIENCE_S", 0.0)
    heard = Heard()
    heard.take(b"")
    heard.wait_for(1)
    heard.take(b"")
    with pytest.raises(RuntimeError, match="2 of 3 messages have not arrived"):
        heard.wait_for(3)
