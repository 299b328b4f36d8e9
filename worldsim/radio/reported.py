"""The counts of frames that robots with direct radio reported, read from the notes at the end of a journal."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from worldsim.run_record import RunRecord


def totals(links: Iterable[Mapping[str, int]]) -> dict[str, int]:
    """Add up the ``sent`` and ``heard`` of links, and return the sums as ``sent`` and ``delivered``."""
    counts = list(links)
    return {"sent": sum(link["sent"] for link in counts), "delivered": sum(link["heard"] for link in counts)}


def reported(journal: RunRecord) -> dict[str, dict[str, Any]]:
    """Return the counts that each robot reported last, by its name; empty where there are none.

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
