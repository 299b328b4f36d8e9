"""Decisions take as many operations as they did: at most a fifth more or less than what was written down."""

import json
from collections.abc import Mapping

import pytest

from tests.bench.operations import WRITTEN, count, fleets

MOST = 1.2
ALLOWED: Mapping[str, Mapping[str, float]] = json.loads(WRITTEN.read_text(encoding="utf-8"))


@pytest.mark.parametrize("name", ALLOWED)
def test_a_robots_tick_takes_as_many_operations_as_were_written_down(
    name: str, tmp_path_factory: pytest.TempPathFactory
) -> None:
    counted = count(fleets(tmp_path_factory.mktemp("operations"))[name])
    assert counted.keys() == ALLOWED[name].keys()
    written = ALLOWED[name]
    # Far less shows that something is not counted any more.
    other = {what: (now, written[what]) for what, now in counted.items() if not 1 / MOST <= now / written[what] <= MOST}
    assert not other, "`python -m tests.bench.operations` writes them down anew, if that is what is wanted"
