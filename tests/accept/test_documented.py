"""The sampled numbers of docs/results come out within their intervals."""

from __future__ import annotations

import pytest

from fogwatch.cli.app import app
from fogwatch.cli.ending import guarded

pytestmark = [pytest.mark.accept, pytest.mark.timeout(3600)]


def test_the_sampled_numbers_have_not_changed(capsys: pytest.CaptureFixture[str]) -> None:
    assert guarded(lambda: app(["reproduce", "check"], standalone_mode=False)) == 0, capsys.readouterr().out
