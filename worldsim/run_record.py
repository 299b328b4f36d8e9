"""A run's records: the reasons for its end, ports to write and read them, and what robots reported at the end."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Protocol

from patrol.journal import End, Event, Header, Record, TickRecord

COMPLETED = "completed"
INTERRUPTED = "interrupted"
DESERTED = "nobody is living any more"
"""Reasons for a run's end in journals: all ticks are done, it was asked to stop, or no robot is left."""


class Unwritten(Exception):
    """A run cannot be recorded any more: one line of text with the place and the reason."""


@contextmanager
def recording(folder: Path) -> Iterator[None]:
    """Turn the failure to write a run's files into one line, as `Unwritten`."""
    try:
        yield
    except OSError as error:
        raise Unwritten(
            f"{folder}: the run cannot be recorded any more ({error.strerror}), so it ends here; make room, and run it "
            "again"
        ) from None


class PutOff:
    """Puts off what is written of a tick until no robot waits for the world; the order of all records stays."""

    def __init__(self, on_tick: Callable[[TickRecord], None], on_event: Callable[[Event], None]) -> None:
        """Put off nothing yet."""
        self._on_tick = on_tick
        self._on_event = on_event
        self._record: TickRecord | None = None

    def tick(self, record: TickRecord) -> None:
        """Keep a tick's record for `settle`."""
        self.settle()
        self._record = record

    def event(self, event: Event) -> None:
        """Pass on an event, after the tick before it."""
        self.settle()
        self._on_event(event)

    def settle(self) -> None:
        """Pass on the record that was kept, if there is one."""
        # Taken out first: what is called may come back here.
        record, self._record = self._record, None
        if record is not None:
            self._on_tick(record)


class Writer(Protocol):
    """A receiver of records: `patrol.journal.file.JournalWriter`, or a list in memory."""

    def write(self, record: Record) -> None:
        """Take the next record."""
        ...


class RunRecord(Protocol):
    """A run's records, read back: `patrol.journal.file.Journal`, or a list in memory."""

    @property
    def header(self) -> Header:
        """The first record."""
        ...

    @property
    def ticks(self) -> Iterator[TickRecord]:
        """The ticks in order; a new iterator on each access."""
        ...

    @property
    def events(self) -> tuple[Event, ...]:
        """The events in order."""
        ...

    @property
    def end(self) -> End | None:
        """The last record, or None for a run that was cut off."""
        ...

    @property
    def truncated(self) -> bool:
        """True if something damaged follows the last whole record."""
        ...


class MemoryJournal:
    """A run's records in memory: written like a journal, read like one."""

    truncated = False

    def __init__(self, header: Header, keep: bool = True) -> None:
        """Begin a run's records; unless `keep`, its ticks are dropped."""
        self.header = header
        self._keep = keep
        self.records: list[TickRecord] = []
        self.events: tuple[Event, ...] = ()
        self.end: End | None = None

    @property
    def ticks(self) -> Iterator[TickRecord]:
        """The ticks in order; a new iterator on each access."""
        return iter(self.records)

    def write(self, record: Record) -> None:
        """Append one record."""
        match record:
            case TickRecord():
                if self._keep:
                    self.records.append(record)
            case Event():
                self.events += (record,)
            case End():
                self.end = record
            case Header():
                self.header = record


def totals(links: Iterable[Mapping[str, int]]) -> dict[str, int]:
    """Add up the ``sent`` and ``heard`` of links, and return the sums as ``sent`` and ``delivered``."""
    counts = list(links)
    return {"sent": sum(link["sent"] for link in counts), "delivered": sum(link["heard"] for link in counts)}


def reported(journal: RunRecord) -> dict[str, dict[str, Any]]:
    """Return the counts that each robot with a direct radio reported last, by its name; empty where there are none.

    They are ``sent``, ``heard`` (by sender), ``refused`` and ``final``.
    """
    notes = journal.end.notes if journal.end else {}
    counts: dict[str, dict[str, Any]] = notes.get("direct", {}).get("said", {})
    return counts


def links_of(counts: Mapping[str, Mapping[str, Any]]) -> dict[tuple[str, str], dict[str, int]]:
    """Return the frames sent and heard on each link (sender, hearer) of robots that have both reported.

    `counts` are as `reported` returns them; the result has ``sent`` and ``heard`` for each link.
    """
    return {
        (sender, hearer): {"sent": counts[sender]["sent"], "heard": count}
        for hearer, report in counts.items()
        for sender, count in report["heard"].items()
        if sender in counts
    }
