"""What a benchmark measures: tasks, their repeats, and the comparison of several contenders in turn."""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass

LEAST_S = 0.005
"""A call that takes less is repeated within one reading of the clock, so that reading it costs nothing."""

MOST_CALLS = 10_000
"""Calls within one reading of the clock, at most."""


class Unmeasured(Exception):
    """A measure could not be taken; the message says why in one line."""


@dataclass(frozen=True, slots=True)
class Effort:
    """How thoroughly to measure.

    Attributes:
        repeats: Readings of each measure.
        seconds: Wall time for which a fleet runs, s.
        quick: Whether to leave out what takes long.
    """

    repeats: int
    seconds: float
    quick: bool


THOROUGH = Effort(repeats=15, seconds=30.0, quick=False)
QUICK = Effort(repeats=3, seconds=4.0, quick=True)


@dataclass(frozen=True, slots=True)
class Measured:
    """The readings of one measure.

    Attributes:
        name: What was measured.
        unit: Of the readings.
        values: The readings; empty where there are none.
        ratio: Each reading as a ratio to our own of the same round; empty where this is our own, or nothing is
            compared.
        says: What else there is to say: what a rival's result has to do with ours, or why there are no readings.
    """

    name: str
    unit: str
    values: tuple[float, ...]
    ratio: tuple[float, ...] = ()
    says: str = ""

    @property
    def median(self) -> float:
        """The median of the readings.

        Raises:
            Unmeasured: There are none.
        """
        if not self.values:
            raise Unmeasured(f"{self.name}: has no readings")
        return statistics.median(self.values)


@dataclass(frozen=True, slots=True)
class Task:
    """Something to measure.

    Attributes:
        group: The measures that are shown together.
        name: What it is; unique in its group.
        run: Takes the measures. Raises Unmeasured where it cannot.
    """

    group: str
    name: str
    run: Callable[[Effort], Sequence[Measured]]


@dataclass(frozen=True, slots=True)
class Finding:
    """What came of a task.

    Attributes:
        task: The task.
        measures: What was measured.
        failure: Why nothing was; empty where something was.
        others: How many cores others kept busy in the meantime, and since the finding before that says so; None where
            that was not counted.
    """

    task: Task
    measures: tuple[Measured, ...]
    failure: str = ""
    others: float | None = None


def take(
    tasks: Iterable[Task],
    effort: Effort,
    begin: Callable[[Task], None],
    done: Callable[[Finding], None],
    others: Callable[[], float | None] = lambda: None,
) -> None:
    """Take measures one after the other; a task that fails does not stop the others.

    Args:
        tasks: What to measure.
        effort: How thoroughly.
        begin: Told of each task before it begins.
        done: Told what came of it; nothing for a task that this effort leaves out.
        others: Asked after each task how many cores others kept busy.
    """
    for task in tasks:
        begin(task)
        try:
            measures, failure = tuple(task.run(effort)), ""
        except Unmeasured as why:
            measures, failure = (), str(why)
        if measures or failure:
            done(Finding(task, measures, failure, others()))


def most_of_others(findings: Iterable[Finding]) -> float | None:
    """The most cores that others kept busy while something was measured; None where that was not counted.

    Args:
        findings: What was measured.
    """
    return max((finding.others for finding in findings if finding.others is not None), default=None)


@dataclass(frozen=True, slots=True)
class Contender:
    """One of several ways to the same result.

    Attributes:
        call: The whole of the work.
        says: What its result has to do with ours.
    """

    call: Callable[[], object]
    says: str = ""


def in_turn(contenders: Mapping[str, Contender], repeats: int, unit: str = "ms") -> list[Measured]:
    """The processor time of several contenders, each once in each round, so that what disturbs falls on all.

    Args:
        contenders: By name; the first is ours, and the others are compared with it.
        repeats: Number of rounds.
        unit: ``ms`` or ``us``.

    Returns:
        One measure for each contender, in their order.
    """
    scale = {"ms": 1e3, "us": 1e6}[unit]
    calls = {name: _calls_of(contender.call) for name, contender in contenders.items()}
    readings: dict[str, list[float]] = {name: [] for name in contenders}
    for _ in range(repeats):
        for name, contender in contenders.items():
            readings[name].append(scale * processor_s(contender.call, calls[name]))
    ours, *_ = readings.values()
    return [
        Measured(
            name,
            unit,
            tuple(values),
            () if values is ours else tuple(theirs / own for theirs, own in zip(values, ours, strict=True)),
            contenders[name].says,
        )
        for name, values in readings.items()
    ]


def processor_s(call: Callable[[], object], calls: int = 1) -> float:
    """The processor time of a call, all threads of this process together, s.

    Args:
        call: What to time.
        calls: How often it is called; the result is that of one call.
    """
    begun = time.process_time()
    for _ in range(calls):
        call()
    return (time.process_time() - begun) / calls


def _calls_of(call: Callable[[], object]) -> int:
    """How many calls one reading takes. The first call of all is not counted: it may load or compile something."""
    call()
    once = max(processor_s(call), LEAST_S / MOST_CALLS)
    return max(1, round(LEAST_S / once))
