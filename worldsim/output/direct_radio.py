"""The summary of a fleet with direct radio: the frames that robots have counted, since no ether decides fates."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from worldsim.radio.reported import links_of, reported, totals

if TYPE_CHECKING:
    from worldsim.run_record import RunRecord


def as_measured(summary: Mapping[str, Any], journal: RunRecord) -> dict[str, Any]:
    """Replace what a summary says of frames by what the robots of a direct radio reported.

    `delivered` is what was heard; `dropped` and `in_flight` are None, for they are unknown; `frames` and
    `bytes_per_robot_s` are of the frames that the world heard itself. `direct` has, for each directed link of robots
    that have both reported, the frames sent and heard; `heard_share` over all of these; `missed`, the frames that
    reached the world too late; and `unsaid`, the robots whose counts are missing or end before their process did.
    """
    reports = reported(journal)
    links = links_of(reports)
    names = [robot.name for robot in journal.header.robots]
    robots = {name: dict(facts) for name, facts in summary["robots"].items()}
    for name, facts in robots.items():
        facts.update(
            totals(counts for (sender, _), counts in links.items() if sender == name), dropped=None, in_flight=None
        )
    sums = totals(links.values())
    share = sums["delivered"] / sums["sent"] if sums["sent"] else None
    unknown: dict[str, Any] = {"dropped": None, "dropped_by_cause": {}, "in_flight": None}
    messages = {**summary["messages"], **sums, **unknown}
    direct = {
        "links": {f"{source} to {destination}": counts for (source, destination), counts in links.items()},
        "heard_share": share,
        "missed": journal.end.notes["direct"].get("missed", {}) if reports and journal.end else {},
        "unsaid": [name for name in names if name not in reports or not reports[name]["final"]],
    }
    return {**summary, "messages": messages, "robots": robots, "links": {}, "direct": direct}
