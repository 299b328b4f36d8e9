from __future__ import annotations

import argparse

import pytest

from patrol.errors import BadInput
from patrol.reporting.logs import Format
from patrol.reporting.supervision import Supervision, add_supervision, take_supervision


def parsed(*words: str) -> argparse.Namespace:
    parser = argparse.ArgumentParser()
    parser.add_argument("--other", default=1)
    add_supervision(parser)
    return parser.parse_args(words)


def test_nothing_is_asked_for_by_default() -> None:
    options = parsed()
    supervision = take_supervision(options)
    assert supervision == Supervision()
    assert not supervision.counts
    assert vars(options) == {"other": 1}


def test_what_is_asked_for() -> None:
    words = "--log-format json --log-level warning --health 5 --metrics 0.0.0.0:9100 --metrics-open"
    supervision = take_supervision(parsed(*words.split()))
    assert supervision == Supervision(Format.JSON, "warning", 5.0, "0.0.0.0:9100", metrics_open=True)
    assert supervision.counts


@pytest.mark.parametrize("words", ["--health 0", "--health -1", "--health nan", "--health inf", "--health 1e9"])
def test_health_lines_come_at_times_that_make_sense(words: str) -> None:
    with pytest.raises(BadInput, match=r"^--health \S+: give from 0.1 to 86400 seconds$"):
        take_supervision(parsed(*words.split()))


def test_open_metrics_need_metrics() -> None:
    with pytest.raises(BadInput, match="--metrics-open: means nothing without --metrics"):
        take_supervision(parsed("--metrics-open"))
