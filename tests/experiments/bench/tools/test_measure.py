"""How benchmarks measure: contenders in turn, and tasks that fail without stopping the others."""

from __future__ import annotations

from collections.abc import Sequence

import pytest

from experiments.bench.tools.measure import (
    QUICK,
    Contender,
    Effort,
    Finding,
    Measured,
    Task,
    Unmeasured,
    in_turn,
    most_of_others,
    take,
)


def test_contenders_run_in_turn_and_rivals_are_compared_round_by_round() -> None:
    calls: list[str] = []

    def work(name: str, amount: int) -> None:
        calls.append(name)
        sum(range(amount))

    ours, rival = in_turn(
        {
            "ours": Contender(lambda: work("ours", 300_000)),
            "rival": Contender(lambda: work("rival", 600_000), "sums equal"),
        },
        repeats=3,
    )
    assert (ours.name, rival.name, rival.says) == ("ours", "rival", "sums equal")
    assert ours.ratio == ()
    assert rival.ratio == tuple(theirs / own for theirs, own in zip(rival.values, ours.values, strict=True))
    turns = [name for name, before in zip(calls[1:], calls, strict=False) if name != before]
    assert turns == ["rival", *["ours", "rival"] * 3]  # first what finds out how long a call takes, then the rounds


def test_a_measure_without_readings_has_no_median() -> None:
    with pytest.raises(Unmeasured, match="nothing: has no readings"):
        _ = Measured("nothing", "ms", ()).median
    assert Measured("three", "ms", (3.0, 1.0, 2.0)).median == 2.0


def test_a_task_that_fails_does_not_stop_the_others() -> None:
    def works(_: Effort) -> Sequence[Measured]:
        return [Measured("one", "ms", (1.0,))]

    def fails(_: Effort) -> Sequence[Measured]:
        raise Unmeasured("the dog ate it")

    def left_out(_: Effort) -> Sequence[Measured]:
        return []

    tasks = [Task("group", name, run) for name, run in (("a", fails), ("b", left_out), ("c", works))]
    begun: list[str] = []
    found: list[Finding] = []
    readings = iter([0.5, None])
    take(tasks, QUICK, lambda task: begun.append(task.name), found.append, lambda: next(readings))
    assert begun == ["a", "b", "c"]
    assert [(one.task.name, one.failure, len(one.measures), one.others) for one in found] == [
        ("a", "the dog ate it", 0, 0.5),
        ("c", "", 1, None),
    ]
    assert most_of_others(found) == 0.5
    assert most_of_others(found[1:]) is None
