"""Decisions take no more operations than they did: at most a fifth more than what was written down."""

from __future__ import annotations

import json
from collections.abc import Mapping

import pytest

from tests.bench.operations import WRITTEN, count, fleets

MOST = 1.2
ALLOWED: Mapping[str, Mapping[str, float]] = json.loads(WRITTEN.read_text(encoding="utf-8"))


@pytest.mark.parametrize("name", ALLOWED)
def test_a_robots_tick_takes_no_more_operations_than_were_written_down(
    name: str, tmp_path_factory: pytest.TempPathFactory
) -> None:
    counted = count(fleets(tmp_path_factory.mktemp("operations"))[name])
    assert counted.keys() == ALLOWED[name].keys()
    more = {what: (now, ALLOWED[name][what]) for what, now in counted.items() if now > MOST * ALLOWED[name][what]}
    assert not more, "`python -m tests.bench.operations` writes them down anew, if that is what is wanted"
