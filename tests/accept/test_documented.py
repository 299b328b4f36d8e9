"""The sampled numbers of docs/results come out within their intervals."""

from __future__ import annotations

import pytest

from docs.samples import main

pytestmark = [pytest.mark.accept, pytest.mark.timeout(3600)]


def test_the_sampled_numbers_have_not_changed(capsys: pytest.CaptureFixture[str]) -> None:
    assert main() == 0, capsys.readouterr().out
