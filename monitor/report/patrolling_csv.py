"""The CSV files that the monitor of patrolling_sim writes, for programs that read those.

They have its columns, separator and rounding; info.csv has no line of headings there either. Robots count from 0, and
time from the run's beginning. As there, a vertex's first visit counts nowhere.
"""

from __future__ import annotations

import statistics
from typing import TYPE_CHECKING

from patrol.errors import BadInput
from patrol.files.whole_file import writing
from patrol.measures.nodes import node_totals

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from monitor.replay.run import Run

EVERY_S = 900.0
"""Time between two lines of timeresults.csv, s; the run's end has one as well."""


def write_csv(run: Run, folder: Path) -> list[Path]:
    """Write idleness.csv (a line for each visit), timeresults.csv and info.csv of a run with a graph."""
    header = run.journal.header
    totals = node_totals(header)
    if totals is None:
        raise BadInput(
            f"--csv {folder}: {run.folder} has no terrain.graph, whose vertices the files are about; drop it"
        )
    for record in run.journal.ticks:
        totals.tick(record)
    again = [visit for visit in totals.visits if not visit.first]
    visits = ["Time;Robot;Node;Idleness;Interferences"]
    visits += [f"{v.at_s:.1f};{v.robot - 1};{v.vertex};{v.idle_s:.1f};{v.interference}" for v in again]
    lines = ["Time;Idleness min;Idleness avg;Idleness stddev;Idleness max;Interferences"]
    end_s = run.ticks * run.step
    times = [EVERY_S * number for number in range(1, int(end_s / EVERY_S) + 1)]
    for at_s in times if end_s in times else [*times, end_s]:
        interference = sum(interfered_s <= at_s for interfered_s in totals.interfered_s)
        lines.append(
            f"{at_s:.1f};{_spread_columns([visit.idle_s for visit in again if visit.at_s <= at_s])};{interference}"
        )
    terrain, interference = header.terrain.name, len(totals.interfered_s)
    info = [
        *(terrain, str(len(header.robots)), "", "0.0", "0.00", "fogwatch", header.scenario["patrol"]["policy"], "", ""),
        *(
            header.started or "",
            f"{end_s:.1f}",
            "",
            str(interference),
            "TIMEOUT" if run.ended == "completed" else "ABORT",
        ),
        *(_spread_columns([visit.idle_s for visit in again]), f"{60.0 * interference / end_s if end_s else 0.0:.2f}"),
        *(str(len(again)), f"{len(again) / totals.vertices:.1f}", str(min(map(len, totals.intervals())))),
    ]
    files = {"idleness.csv": visits, "timeresults.csv": lines, "info.csv": [";".join(info)]}
    with writing(f"--csv {folder}", "name another folder"):
        folder.mkdir(parents=True, exist_ok=True)
        for name, text in files.items():
            (folder / name).write_text("".join(f"{line}\n" for line in text), encoding="utf-8")
    return [folder / name for name in files]


def _spread_columns(idle_s: Sequence[float]) -> str:
    """Return least, mean, standard deviation and greatest, as four columns.

    For example, "2.0;3.0;1.0;4.0" for 2 and 4 s.
    """
    if not idle_s:
        return "0.0;0.0;0.0;0.0"
    numbers = min(idle_s), statistics.fmean(idle_s), statistics.pstdev(idle_s), max(idle_s)
    return ";".join(f"{number:.1f}" for number in numbers)
