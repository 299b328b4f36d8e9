"""The trace hashes that are written down, run again: a change that moves one says so and writes them anew."""

import json
from pathlib import Path

import pytest

from tests.accept.trace_cases import made_on, traces

pytestmark = [pytest.mark.accept, pytest.mark.timeout(3600)]

WRITTEN = Path(__file__).with_name("traces.json")


def test_no_trace_hash_has_moved() -> None:
    written = json.loads(WRITTEN.read_text(encoding="utf-8"))
    if written["made_on"] != made_on():
        pytest.skip(f"traces.json was written on another machine or lock file: {written['made_on']}")
    found = traces()
    assert list(found) == list(written["hashes"])
    assert {name: found[name] for name in found if found[name] != written["hashes"][name]} == {}
