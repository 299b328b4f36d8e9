"""The world's process: what it has opened is closed, whatever happens, and what it says fits how it was started."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from runtime.process.lifeline import Ending
from runtime.process.options import Meeting
from runtime.security.credentials import Credentials
from runtime.security.keys import fleet_keys
from runtime.security.roles import WORLD_ROLE
from worldsim.process import _missing_remedy, main


class FakeLink:
    closed = 0

    mesh = None

    def close(self) -> bool:
        self.closed += 1
        return True


@pytest.mark.parametrize("apart", [False, True])
def test_a_link_is_closed_once_where_the_next_does_not_come(
    apart: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    link, air = FakeLink(), FakeLink()
    told: list[Callable[[str], None]] = []

    def open_links(_router: str, _radio: str | None, _wait_s: float, say: Callable[[str], None], *_: object) -> Any:
        told.append(say)
        return (link, air if apart else link) if len(told) == 1 else None

    monkeypatch.setattr("runtime.net.open_links.open_links", open_links)
    file = tmp_path / "scenario.yaml"
    scenario = {"terrain": {"builtin": "open"}, "point": 1.0, "duration": 5, "robots": [{"model": "holonomic"}]}
    file.write_text(json.dumps(scenario), encoding="utf-8")
    words = ["--router", "tcp/127.0.0.1:7447", "--fleet", "f", "--scenario", str(file), "--out", str(tmp_path / "run")]
    monkeypatch.setattr("runtime.process.context.heed", lambda *_, **__: Ending())
    assert main(words) == 130
    assert (link.closed, air.closed) == (1, int(apart))
    assert len(set(told)) == 2, "what waits for the same router says so once"


def test_robots_that_have_not_come_are_started_as_the_world_was(tmp_path: Path) -> None:
    here = Meeting("tcp/127.0.0.1:7447", fleet_keys("f"))
    assert "fogwatch agent --router tcp/127.0.0.1:7447 --fleet f --robot NAME" in _missing_remedy(here)
    guarded = Meeting("tls/a:7447", fleet_keys("f"), Credentials("f", "tls/a:7447", WORLD_ROLE, folder=tmp_path))
    assert "fogwatch agent --credentials FOLDER" in _missing_remedy(guarded)
    assert "--router" not in _missing_remedy(guarded)
