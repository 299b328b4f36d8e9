"""The counts of frames that robots with direct radio reported, read from the notes at the end of a journal."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from worldsim.run_record import RunRecord


def totals(links: Iterable[Mapping[str, int]]) -> dict[str, int]:
    """Add up links.

    Args:
        links: "sent" and "heard" of each.

    Returns:
        The sums as "sent" and "delivered".
    """
    counts = list(links)
    return {"sent": sum(link["sent"] for link in counts), "delivered": sum(link["heard"] for link in counts)}


def reported(journal: RunRecord) -> dict[str, dict[str, Any]]:
    """Return the counts that each robot reported last.

    Args:
        journal: The run's records.

    Returns:
        "sent", "heard" (by sender), "refused" and "final", by the robots' names; empty where there are none.
    """
    notes = journal.end.notes if journal.end else {}
    counts: dict[str, dict[str, Any]] = notes.get("direct", {}).get("said", {})
    return counts


def links_of(counts: Mapping[str, Mapping[str, Any]]) -> dict[tuple[str, str], dict[str, int]]:
    """Return the frames sent and heard by directed link, of robots that have both reported.

    Args:
        counts: As of `reported`.

    Returns:
        "sent" and "heard" by (sender, hearer).
    """
    return {
        (sender, hearer): {"sent": counts[sender]["sent"], "heard": heard}
        for hearer, report in counts.items()
        for sender, heard in report["heard"].items()
        if sender in counts
    }
