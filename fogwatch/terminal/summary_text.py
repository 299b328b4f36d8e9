"""The summary of a run as text on a terminal."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from rich.console import Console
from rich.table import Table
from rich.text import Text

from fogwatch.terminal.live_table import STATUS_STYLES, duration_text
from patrol.errors import printable
from patrol.journal import Status
from patrol.measures.best_tour import NO_BOUND
from patrol.scenario.patrols import describe_patrol
from patrol.summary.features import FEATURES
from patrol.summary.metric import metrics_of
from patrol.summary.model import RobotFigures, Summary, VerdictFacts, ground_text, unsettled

_VERDICTS = {"valid": "bold green", "invalid": "bold red", "unknown": "bold yellow"}
MOST_ROBOTS = 40
"""Robots listed at most."""
MOST_WARNINGS = 20
"""Warnings listed at most."""
ABSENT = Status.ABSENT.name.lower()


def print_summary(console: Console, summary: Summary) -> None:
    """Print the summary of a run: the measures, the robots and the verdict."""
    for line in measures(summary):
        console.print(line, markup=False, highlight=False, soft_wrap=True)
    present = {name: robot for name, robot in summary.robots.items() if robot.status != ABSENT}
    console.print(_robots_table(present))
    if len(present) > MOST_ROBOTS:
        console.print(f"and {len(present) - MOST_ROBOTS} more robots, which are in summary.json", highlight=False)
    if summary.verdict is not None:
        print_verdict(console, summary.verdict)
    if summary.trace_hash:  # a run that was cut off has none
        console.print(f"trace       {summary.trace_hash}", markup=False, highlight=False, soft_wrap=True)


def print_files(console: Console, folder: Path) -> None:
    """Print the files of a run folder."""
    files = ", ".join(sorted(path.name for path in folder.iterdir()))
    console.print(printable(f"files       {folder}: {files}"), markup=False, highlight=False, soft_wrap=True)


def print_verdict(console: Console, verdict: VerdictFacts) -> None:
    """Print a verdict, its warnings, and the checks that failed or could not be judged."""
    text = Text("verdict     ").append(verdict.outcome, _VERDICTS[verdict.outcome])
    warnings = verdict.warnings
    if warnings:
        text.append(", ").append("with warnings", "bold yellow")
    if verdict.valid:
        text.append(f": {sum(check.judged for check in verdict.checks)} checks passed")
    console.print(text, highlight=False)
    for line in warnings[:MOST_WARNINGS]:
        text = Text(printable(f"  warning: {line}"), "yellow")
        console.print(text, highlight=False, soft_wrap=True)
    if len(warnings) > MOST_WARNINGS:
        console.print(f"  {len(warnings) - MOST_WARNINGS} more warnings are in summary.json", style="yellow")
    for check in verdict.checks:
        if not check.ok or not check.judged:
            text = Text(printable(f"  {check.name}: {check.detail}"), "yellow" if check.ok else "red")
            console.print(text, highlight=False, soft_wrap=True)


def measures(summary: Summary) -> list[str]:
    """List the measures of a run, one per line."""
    lines = [f"{summary.name}: {summary.simulated_s:g} s in {summary.ticks} ticks"]
    if summary.ended != "completed":
        lines[0] += f", {summary.ended or 'cut off'}"
    if summary.wall_s:
        lines[0] += f"; {duration_text(summary.wall_s)} of wall time, {summary.realtime_factor:.1f} x real time"
    if summary.policy:  # summaries of earlier versions have none
        lines.append(printable(f"patrol      {describe_patrol(summary.policy)}"))
    if not summary.ticks:
        return lines
    text = {key: metric.text(getattr(summary, key)) for key, metric in metrics_of(Summary) if metric.title}
    lines.append(f"MFoW        mean {text.pop('mfow_mean_s')}, maximum {text.pop('mfow_max_s')}")
    if summary.mfow_late_mean_s == 0.0 and summary.seen_share == 1.0:
        in_sight = "all ground stays in sight, so no robot has to move"
        lines.append(f"            {in_sight}; give --sensor-range if the sensor sees less")
    lines.append(_bounds_text(summary, text.pop("best_tour_s")))
    lines += [line for feature in FEATURES for line in feature.lines(summary)]
    lines += _stalest_lines(summary)
    coverage = f"coverage    {text.pop('seen_share')} of {ground_text(summary)} to patrol"
    if summary.left_out is not None:
        coverage += f"; left out: {summary.left_out.text}"
    if summary.planned_share is None:
        del text["planned_share"]
    others = [(metric, text[key]) for key, metric in metrics_of(Summary) if key in text]
    lines += [f"{metric.title:<11} {value} {metric.note}".rstrip() for metric, value in others]
    lines.append(coverage)
    lines += _radio_lines(summary)
    if deadlines := summary.deadlines:
        frames, commands = sum(deadlines.late_frames.values()), sum(deadlines.late_commands.values())
        late = sum(deadlines.too_late.values())
        lines.append(f"deadlines   missed by {commands} commands and {frames} frames; {late} of them came too late")
        if deadlines.held_up_s:
            moved, longest = deadlines.held_up_s, deadlines.longest_held_up_s
            lines.append(
                f"            moved by {moved:.2f} s while the world was held up, {longest:.2f} s at most in one tick"
            )
    return lines


def _radio_lines(summary: Summary) -> list[str]:
    """Describe the messages: how many were sent, and how many arrived.

    One message counts once for each robot that is to get it. A robot sends whether or not there is another one to hear
    it.
    """
    messages = summary.messages
    lines = [f"messages    {messages.frames} sent, {messages.bytes_per_robot_s:.0f} bytes per robot per second"]
    if not messages.sent:
        lines[0] += "; no other robot was there to receive them"
        return lines
    received = f"{messages.delivered} of {messages.sent}"
    if "direct" in summary.model_fields_set:
        share = "" if summary.direct.heard_share is None else f" ({100.0 * summary.direct.heard_share:.1f} %)"
        return [*lines, f"received    {received}{share} by direct radio, {messages.rejected} rejected"]
    late = f", {messages.in_flight} under way at the end" if messages.in_flight else ""
    return [*lines, f"received    {received}, {messages.dropped} dropped, {messages.rejected} rejected{late}"]


def _bounds_text(summary: Summary, tour: str) -> str:
    """Describe what the mean MFoW can be compared with; with the ratio, once that says something."""

    def ratio(yardstick_s: float | None) -> str:
        if not yardstick_s or summary.mfow_mean_s is None or unsettled(summary, yardstick_s):
            return ""
        return f", ratio {summary.mfow_mean_s / yardstick_s:.2f}"

    bound, tour_s = summary.bound_s, summary.best_tour_s
    lower = f"lower bound {bound:.1f} s{ratio(bound)}" if bound else f"lower bound 0: {NO_BOUND}"
    best = "" if tour_s is None else f"best tour found {tour}{ratio(tour_s)}; "
    return f"bounds      {best}{lower}"


def _stalest_lines(summary: Summary) -> list[str]:
    """Describe the stalest place over the run and at its end, and the robot nearest to it."""
    sentences = []
    for head, stalest in (("over the run", summary.stalest.worst), ("at the end", summary.stalest.end)):
        if stalest is not None:
            unseen = "" if stalest.seen else ", never seen until then"
            near = f", nearest robot {stalest.nearest} {stalest.nearest_m:.0f} m away" if stalest.nearest else ""
            age = f"({stalest.x:.1f}, {stalest.y:.1f}), {stalest.age_s:g} s at {stalest.at_s:g} s"
            sentences.append(f"{head} {age}{unseen}{near}")
    return [f"stalest     {'; '.join(sentences)}"] if sentences else []


def _robots_table(robots: Mapping[str, RobotFigures]) -> Table:
    # With this column it is wider than 80 characters, and a line above has the fleet's share.
    columns = [(key, metric) for key, metric in metrics_of(RobotFigures) if metric.title and key != "planned_share"]
    table = Table("robot", "status", box=None, padding=(0, 2, 0, 0), header_style="bold")
    for _, metric in columns:
        table.add_column(f"{metric.title} {metric.unit}".rstrip(), justify="right")
    for name, robot in list(robots.items())[:MOST_ROBOTS]:
        status = Text(robot.status, STATUS_STYLES[Status[robot.status.upper()]])
        table.add_row(name, status, *(metric.number(getattr(robot, key)) for key, metric in columns))
    return table
