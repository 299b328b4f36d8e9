import re
import threading
import time
from typing import Any

import runtime.reporting.vitals
from runtime.net.mailbox import Mailbox
from runtime.reporting.vitals import (
    DROPPED,
    FILES,
    MEMORY,
    MFOW,
    PAGES,
    PROCESSOR,
    QUEUE,
    SINCE_TICK,
    STARTED,
    THREADS,
    TICK,
    TICKS,
    VERSION,
    Figure,
    Kind,
    Vitals,
)
from tests.fresh_memory import fresh_memory


class Clock:
    now_s = 100.0

    def __call__(self) -> float:
        return self.now_s


def test_ticks_are_counted_and_before_the_first_only_the_process_is_known() -> None:
    known = Vitals().read()
    assert TICK not in known
    assert SINCE_TICK not in known
    assert known[MEMORY] > 1e6  # type: ignore[operator]
    assert known[PROCESSOR] > 0.0  # type: ignore[operator]
    assert len(known[VERSION]) == 1  # type: ignore[arg-type]
    clock = Clock()
    vitals = Vitals(clock)
    vitals.beat(7, {MFOW: 3.0})
    vitals.beat(9, {MFOW: 4.0})
    clock.now_s += 2.5
    known = vitals.read()
    assert (known[TICK], known[TICKS], known[MFOW], known[SINCE_TICK]) == (9, 2, 4.0, 2.5)


def test_mailboxes_are_added_up() -> None:
    vitals = Vitals()
    boxes = [Mailbox(["a"], bytes, 4), Mailbox(["a"], bytes, 4)]
    for box in boxes:
        vitals.probe_mailbox(box)
        box.deliver("a", b"one")
    boxes[0].deliver("a", b"too long")
    boxes[1].deliver("a", b"too long")
    boxes[1].put("b", b"nobody's")
    known = vitals.read()
    assert known[QUEUE] == 2
    assert known[DROPPED] == {"oversized": 2, "unknown": 1}
    boxes[0].get()
    assert vitals.read()[QUEUE] == 1


def test_a_figure_that_cannot_be_read_hides_no_other() -> None:
    def gone() -> float:
        raise RuntimeError("session closed")

    vitals = Vitals()
    vitals.probe(PAGES, gone)
    vitals.probe(MFOW, lambda: None)
    vitals.probe(QUEUE, lambda: 3)
    known = vitals.read()
    assert PAGES not in known
    assert MFOW not in known
    assert known[QUEUE] == 3


def test_the_memory_is_that_of_this_process() -> None:
    before = Vitals().read()[MEMORY]
    with fresh_memory(64 << 20):
        assert Vitals().read()[MEMORY] > before + 0.5 * (64 << 20)  # type: ignore[operator]


def test_figures_are_named_as_prometheus_wants_it() -> None:
    """Base units in names, `_total` for counters alone, and one line with the unit that the name has."""
    figures = [value for value in vars(runtime.reporting.vitals).values() if isinstance(value, Figure)]
    assert len({figure.name for figure in figures}) == len(figures) > 20
    for figure in figures:
        assert re.fullmatch(r"(fogwatch|process)(_[a-z]+)+", figure.name)
        assert figure.kind is (Kind.COUNTER if figure.name.endswith("_total") else Kind.GAUGE), figure.name
        assert re.fullmatch(r"[A-Z1].*\.", figure.says)
        assert re.fullmatch(r"[a-z]*", figure.label)
        unit = {"seconds": ", s.", "bytes": ", bytes."}.get(figure.name.removesuffix("_total").rpartition("_")[2], "")
        assert figure.says.endswith(unit), figure.name


def test_the_process_itself_is_measured_in_the_units_that_the_names_say() -> None:
    began_s, used_s = time.time(), time.process_time()
    vitals = Vitals()
    known: dict[Figure, Any] = vitals.read()
    assert began_s <= known[STARTED] <= time.time()
    assert used_s <= known[PROCESSOR] <= time.process_time()
    assert known[THREADS] == threading.active_count()
    assert known[FILES] >= 3  # standard input, output and error
    assert list(known[VERSION].values()) == [1]
    assert vitals.read()[STARTED] == known[STARTED]
