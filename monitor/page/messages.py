"""The JSON messages that a page receives, one function for each type, and charts thinned to what a screen can show."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Sequence
from dataclasses import asdict
from typing import Any

import numpy as np
from numpy.typing import NDArray

from monitor.observation.fault_bands import Band
from monitor.observation.source import Answer, LinkCounts, Series, State, Static
from monitor.page.maps import SIDE, Survey, layer_number
from patrol.ground.marks import outline
from patrol.journal.records import Event
from patrol.scenario.marks import marks_of
from patrol.scenario.patrols import describe_patrol


def static_message(static: Static, may_control: bool) -> str:
    """Return the constant properties of the source, the first message of a connection."""
    patrol = static.scenario.get("patrol")
    return _to_json(
        {
            "type": "static",
            "name": static.name,
            "title": str(static.scenario.get("name", static.name)),
            "patrol": describe_patrol(patrol["policy"]) if patrol else "",
            "width": static.terrain.width,
            "height": static.terrain.height,
            "side": SIDE,
            "point": static.terrain.point,
            "origin": list(static.terrain.origin),
            "step": static.step,
            "ticks": static.ticks,
            "bound": static.bound_s,
            "live": static.live,
            "truth": static.has_truth,
            "layers": [[layer_number(layer), str(layer)] for layer in static.layers],
            "controls": list(static.controls) if may_control else [],
            "mayControl": may_control or not static.controls,
            "note": static.note,
            "direct": static.direct,
            "late": static.late,
            "marks": _map_marks(static),
            "robots": [asdict(robot) for robot in static.robots],
        }
    )


def state_message(state: State, survey: Survey | None, static: Static) -> str:
    """Return a state without its links, as JSON.

    A robot is a list of status (`Status` as a number), state, pose, goal, decision_ms, heard_s, for one that is
    trapped since when (s) and whether that is exact, and the share of its battery that is left. The stalest point is a
    list of x and y (m), age (s) and whether it was ever seen. `survey` is that of the first layer's fog, None when
    unknown.
    """
    return _to_json(
        {
            "type": "state",
            "k": state.k,
            "time": state.time_s,
            "running": state.running,
            "pace": state.pace,
            "rate": _round_number(state.ticks_per_s),
            "mfow": _round_number(state.mfow_s),
            "mean": _round_number(state.fog_mean_s),
            "ended": state.ended,
            "note": state.note,
            "intruders": [list(intruder) for intruder in state.intruders],
            "looks": {section: dict(looks) for section, looks in state.looks.items()},
            "linked": state.links is not None,
            "faults": [dict(fault) for fault in state.faults],
            "seen": None if survey is None else survey.seen_share,
            "stalest": None if survey is None else _stalest_values(survey, static),
            "robots": [
                [
                    int(robot.status),
                    robot.state,
                    None if robot.pose is None else _round_numbers((robot.pose.x, robot.pose.y, robot.pose.heading)),
                    None if robot.goal is None else _round_numbers(robot.goal),
                    _round_number(robot.decision_ms),
                    _round_number(robot.heard_s),
                    None if robot.trapped is None else [_round_number(robot.trapped.since_s), robot.trapped.exact],
                    _round_number(robot.charge),
                ]
                for robot in state.robots
            ],
        }
    )


def trail_message(first: int, trail: NDArray[np.float64]) -> str:
    """Encode the robots' positions as JSON: a row for each tick, with x and y of each robot in turn.

    `trail` is float64 (ticks, robots, 2), m, with NaN for robots without a body. `first` is the tick of its first row.
    """
    rows = trail.reshape(len(trail), -1).tolist()
    return _to_json({"type": "trail", "first": first, "rows": list(map(_round_numbers, rows))})


def links_message(links: LinkCounts, k: int) -> str:
    """Encode the frame counts by link at tick k as JSON.

    Each kind of count is a flat list, row by row (sender by receiver).
    """
    return _to_json(
        {
            "type": "links",
            "k": k,
            "sent": links.sent.ravel().tolist(),
            "delivered": links.delivered.ravel().tolist(),
            "heard": links.heard.ravel().tolist(),
            "since": links.since,
        }
    )


def series_message(series: Series) -> str:
    """Encode new ticks of the chart of MFoW and mean fog."""
    return _to_json(
        {
            "type": "series",
            "k": series.ticks.tolist(),
            "mfow": _round_numbers(series.mfow_s.tolist()),
            "mean": _round_numbers(series.fog_mean_s.tolist()),
        }
    )


def events_message(events: Sequence[Event], first: int) -> str:
    """Encode events as JSON: each is a list of tick, kind, robot number and detail.

    `first` is the number of the first of them.
    """
    rows = [[event.k, event.kind, event.robot, event.detail] for event in events]
    return _to_json({"type": "events", "first": first, "events": rows})


def bands_message(bands: Sequence[Band]) -> str:
    """Return all faults so far; a fault is a list of id, kind, begin and end in s, and text."""
    rows = [[band.id, band.kind, band.begin, band.end, band.text] for band in bands]
    return _to_json({"type": "bands", "bands": rows})


def answer_message(number: object, answer: Answer) -> str:
    """Return the result of a control."""
    return _to_json({"type": "answer", "id": number, "done": answer.done, "text": answer.text})


def _map_marks(static: Static) -> list[dict[str, Any]]:
    """Return the scenario's marks on the map: kind, name, place, and the outline of ground in m.

    For ground that may be closed, `runs` holds its points, as [first, count] of each run; for other marks it is [].
    """
    terrain, shown = static.terrain, []
    for mark in marks_of(static.scenario, terrain):
        says: dict[str, Any] = {
            "section": mark.section,
            "kind": mark.kind,
            "name": mark.name,
            "label": mark.label,
            "at": _round_numbers(mark.at),
            "radius": mark.radius,
            "edges": [],
            "runs": [],
        }
        if mark.points is not None:
            says["edges"] = list(map(_round_numbers, outline(mark.points, terrain).tolist()))
            if mark.closes:
                indices = np.flatnonzero(mark.points)
                # A run ends with its row, too: the page draws them row by row.
                begins = 1 + np.flatnonzero((np.diff(indices) != 1) | (indices[1:] % terrain.width == 0))
                says["runs"] = [[int(run[0]), run.size] for run in np.split(indices, begins)]
        shown.append(says)
    return shown


def _stalest_values(survey: Survey, static: Static) -> list[float | bool | None]:
    centre = static.terrain.centre(survey.row, survey.col)
    return [*_round_numbers((*centre, survey.age * static.step)), survey.ever_seen]


def _round_number(value: float | None) -> float | None:
    """Return a number rounded to four decimals; None for infinity and NaN, which JSON does not have.

    For example, 0.3333 for a third.
    """
    return None if value is None or not math.isfinite(value) else round(value, 4)


def _round_numbers(values: Iterable[float]) -> list[float | None]:
    return [_round_number(value) for value in values]


def _to_json(message: dict[str, Any]) -> str:
    return json.dumps(message, separators=(",", ":"), allow_nan=False)


def thinned(series: Series, most: int) -> Series:
    """Reduce a series to `most` + 1 ticks or fewer, keeping its extremes.

    A series of at most `most` ticks is returned as it is. Of a longer one, each interval keeps its first tick and the
    one with the largest MFoW; the last tick stays too.
    """
    count = len(series.ticks)
    if count <= most:
        return series
    # Twice as long as it would be: each interval keeps two ticks.
    size = -(-2 * count // most)
    first = np.arange(0, count, size)
    padded = np.full(len(first) * size, -np.inf)
    padded[:count] = np.nan_to_num(series.mfow_s, nan=-np.inf)
    stalest = first + padded.reshape(-1, size).argmax(axis=1)
    chosen = np.unique(np.concatenate((first, stalest, [count - 1])))
    return Series(series.ticks[chosen], series.mfow_s[chosen], series.fog_mean_s[chosen])
