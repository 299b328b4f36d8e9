"""The summary of a run as text on a terminal."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table
from rich.text import Text

from fogwatch.launch.live_table import STATUS_STYLES, clock
from patrol.best_tour import NO_BOUND
from patrol.journal import Status
from patrol.printable import printable

_VERDICTS = {"valid": "bold green", "invalid": "bold red", "unknown": "bold yellow"}
MOST_ROBOTS = 40
"""Robots listed at most."""
MOST_WARNINGS = 20
"""Warnings listed at most."""
ABSENT = Status.ABSENT.name.lower()


def print_summary(console: Console, summary: Mapping[str, Any], folder: Path) -> None:
    """Print the summary of a run: the measures, the robots, the verdict, and the files of the run folder.

    Args:
        console: Where to print.
        summary: The summary, as in summary.json.
        folder: The run folder.
    """
    for line in measures(summary):
        console.print(line, markup=False, highlight=False, soft_wrap=True)
    console.print(_robots(summary["robots"]))
    if left_out := _left_out(summary["robots"]):
        console.print(f"and {left_out} more robots, which are in summary.json", highlight=False)
    print_verdict(console, summary["verdict"])
    if trace_hash := summary["trace_hash"]:  # a run that was cut off has none
        console.print(f"trace       {trace_hash}", markup=False, highlight=False, soft_wrap=True)
    files = ", ".join(sorted(path.name for path in folder.iterdir()))
    console.print(printable(f"files       {folder}: {files}"), markup=False, highlight=False, soft_wrap=True)


def print_verdict(console: Console, verdict: Mapping[str, Any]) -> None:
    """Print a verdict, its warnings, and the checks that failed or could not be judged.

    Args:
        console: Where to print.
        verdict: As in summary.json.
    """
    text = Text("verdict     ").append(verdict["outcome"], _VERDICTS[verdict["outcome"]])
    warnings = verdict.get("warnings", ())
    if warnings:
        text.append(", ").append("with warnings", "bold yellow")
    if verdict["valid"]:
        text.append(f": {sum(check['judged'] for check in verdict['checks'])} checks passed")
    console.print(text, highlight=False)
    for line in warnings[:MOST_WARNINGS]:
        text = Text(printable(f"  warning: {line}"), "yellow")
        console.print(text, highlight=False, soft_wrap=True)
    if len(warnings) > MOST_WARNINGS:
        console.print(f"  {len(warnings) - MOST_WARNINGS} more warnings are in summary.json", style="yellow")
    for check in verdict["checks"]:
        if not check["ok"] or not check["judged"]:
            text = Text(printable(f"  {check['name']}: {check['detail']}"), "yellow" if check["ok"] else "red")
            console.print(text, highlight=False, soft_wrap=True)


def measures(summary: Mapping[str, Any]) -> list[str]:
    """The measures of a run, one per line.

    Args:
        summary: The summary, as in summary.json.
    """
    lines = [f"{summary['name']}: {summary['simulated_s']:g} s in {summary['ticks']} ticks"]
    if summary["ended"] != "completed":
        lines[0] += f", {summary['ended'] or 'cut off'}"
    if summary["wall_s"]:
        lines[0] += f"; {clock(summary['wall_s'])} of wall time, {summary['realtime_factor']:.1f} x real time"
    if not summary["ticks"]:
        return lines
    mean, bound = summary["mfow_mean_s"], summary["bound_s"]
    lines.append(f"MFoW        mean {mean:.1f} s, maximum {summary['mfow_max_s']:.1f} s")
    lines += _bounds(mean, bound, summary)
    lines += _stalest(summary)
    lines.append(f"mean fog    {summary['fog_mean_s']:.1f} s")
    area = f"{summary['patrolled_area_m2']:.0f} m² to patrol"
    lines.append(f"coverage    {100.0 * summary['seen_share']:.2f} % of {area}")
    lines += _radio(summary)
    if intruders := summary.get("intruders"):
        lines.append(f"intruders   {_intruders(intruders)}")
    if deadlines := summary.get("deadlines"):
        frames, commands = (sum(deadlines[what].values()) for what in ("late_frames", "late_commands"))
        late = sum(deadlines["too_late"].values())
        lines.append(f"deadlines   missed by {commands} commands and {frames} frames; {late} of them came too late")
        if held_up := deadlines.get("held_up_s"):
            longest = deadlines["longest_held_up_s"]
            lines.append(
                f"            moved by {held_up:.2f} s while the world was held up, {longest:.2f} s at most in one tick"
            )
    return lines


def _radio(summary: Mapping[str, Any]) -> list[str]:
    """How many messages were sent, and what became of them; one message counts once for each robot that is to get it.

    A robot sends whether or not there is another one to hear it.
    """
    messages = summary["messages"]
    lines = [f"messages    {messages['frames']} sent, {messages['bytes_per_robot_s']:.0f} bytes per robot per second"]
    if not messages["sent"]:
        lines[0] += "; no other robot was there to receive them"
        return lines
    received = f"{messages['delivered']} of {messages['sent']}"
    if direct := summary.get("direct"):
        share = "" if direct["heard_share"] is None else f" ({100.0 * direct['heard_share']:.1f} %)"
        return [*lines, f"received    {received}{share} by direct radio, {messages['rejected']} rejected"]
    late = f", {messages['in_flight']} under way at the end" if messages["in_flight"] else ""
    return [*lines, f"received    {received}, {messages['dropped']} dropped, {messages['rejected']} rejected{late}"]


def _intruders(intruders: Sequence[Mapping[str, Any]]) -> str:
    """How many intruders were found and how soon, and for how long they were surrounded."""
    found = [facts for facts in intruders if facts["first_reported_s"] is not None]
    text = f"{len(found)} of {len(intruders)} found"
    if not found:
        return text
    first = min(found, key=lambda facts: facts["first_reported_s"])
    after = first["first_reported_s"] - first["at_s"]
    text += f", the first at {first['first_reported_s']:g} s, {after:g} s after it came"
    around = sum(facts["surrounded_s"] for facts in found)
    most = max(facts["most_robots"] for facts in found)
    return f"{text}; surrounded for {around:g} s, by at most {most} robots" if around else f"{text}; never surrounded"


def _bounds(mean: float, bound: float, summary: Mapping[str, Any]) -> list[str]:
    """What the mean MFoW can be compared with; with the ratio, once all is seen and the run long enough for it."""

    def ratio(of: float) -> str:
        settled = summary["seen_share"] == 1.0 and summary["simulated_s"] >= 4.0 * of > 0.0
        return f", ratio {mean / of:.2f}" if settled else ""

    lower = f"lower bound {bound:.1f} s{ratio(bound)}" if bound else f"lower bound 0: {NO_BOUND}"
    tour = summary.get("best_tour_s")
    best = "" if tour is None else f"best tour found {tour:.1f} s{ratio(tour)}; "
    return [f"bounds      {best}{lower}"]


def _stalest(summary: Mapping[str, Any]) -> list[str]:
    """Where the stalest place was over the run and at its end, and who was nearest."""
    places = summary.get("stalest") or {}
    told = []
    for name, head in (("worst", "over the run"), ("end", "at the end")):
        place = places.get(name)
        if place is not None:
            unseen = "" if place["seen"] else ", never seen until then"
            near = f", nearest robot {place['nearest']} {place['nearest_m']:.0f} m away" if place["nearest"] else ""
            where = f"({place['x']:.1f}, {place['y']:.1f}), {place['age_s']:g} s at {place['at_s']:g} s"
            told.append(f"{head} {where}{unseen}{near}")
    return [f"stalest     {'; '.join(told)}"] if told else []


def _robots(robots: Mapping[str, Mapping[str, Any]]) -> Table:
    table = Table(box=None, padding=(0, 2, 0, 0), header_style="bold")
    heads = ("robot", "status", "distance m", "dead end %", "collisions", "decisions", "p50 ms", "p99 ms")
    for head in heads:
        table.add_column(head, justify="left" if head in ("robot", "status") else "right")
    came = {name: facts for name, facts in robots.items() if facts["status"] != ABSENT}
    for name, facts in list(came.items())[:MOST_ROBOTS]:
        p50, p99 = (facts[f"decision_ms_p{percent}"] for percent in (50, 99))
        table.add_row(
            name,
            Text(facts["status"], STATUS_STYLES[Status[facts["status"].upper()]]),
            f"{facts['distance_m']:.0f}",
            f"{100.0 * facts['dead_end_share']:.1f}",
            str(facts["collisions"]),
            str(facts["decisions"]),
            "-" if p50 is None else f"{p50:.1f}",
            "-" if p99 is None else f"{p99:.1f}",
        )
    return table


def _left_out(robots: Mapping[str, Mapping[str, Any]]) -> int:
    """How many robots of a large fleet are not in the table."""
    came = [name for name, facts in robots.items() if facts["status"] != ABSENT]
    return max(len(came) - MOST_ROBOTS, 0)
