"""What a page is told in words: JSON messages, one kind each."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from monitor.page.tiles import SIDE, layer_number
from monitor.report.faultbands import Band
from monitor.source import Answer, Links, Series, State, Static
from patrol.journal.records import Event


def static_words(static: Static, may_ask: bool) -> str:
    """What never changes. may_ask: whether this viewer has the right to ask for anything."""
    height, width = static.passable.shape
    return _json(
        {
            "type": "static",
            "name": static.name,
            "width": width,
            "height": height,
            "side": SIDE,
            "point": static.point,
            "origin": list(static.origin),
            "step": static.step,
            "ticks": static.ticks,
            "bound": static.bound_s,
            "live": static.live,
            "truth": static.has_truth,
            "layers": [[layer_number(layer), str(layer)] for layer in static.layers],
            "controls": list(static.controls) if may_ask else [],
            "mayAsk": may_ask or not static.controls,
            "note": static.note,
            "direct": static.direct,
            "late": static.late,
            "robots": [
                {
                    "number": robot.number,
                    "name": robot.name,
                    "model": robot.model,
                    "radius": robot.radius,
                    "range": robot.range_m,
                    "angle": robot.angle_deg,
                }
                for robot in static.robots
            ],
        }
    )


def state_words(state: State) -> str:
    """A state, but for its links. A robot: status, state, pose, goal, decision_ms, heard_s, rejected."""
    return _json(
        {
            "type": "state",
            "k": state.k,
            "time": state.time_s,
            "running": state.running,
            "pace": state.pace,
            "rate": _short(state.ticks_per_s),
            "mfow": _short(state.mfow_s),
            "mean": _short(state.fog_mean_s),
            "ended": state.ended,
            "note": state.note,
            "intruders": [list(place) for place in state.intruders],
            "linked": state.links is not None,
            "faults": [dict(fault) for fault in state.faults],
            "robots": [
                [
                    int(robot.status),
                    robot.state,
                    None
                    if robot.pose is None
                    else [_short(v) for v in (robot.pose.x, robot.pose.y, robot.pose.heading)],
                    None if robot.goal is None else [_short(value) for value in robot.goal],
                    _short(robot.decision_ms),
                    _short(robot.heard_s),
                    robot.rejected,
                ]
                for robot in state.robots
            ],
        }
    )


def trail_words(first: int, trail: NDArray[np.float64]) -> str:
    """Where robots were from the tick `first` on: x and y of each robot in turn, a row for each tick."""
    rows = trail.reshape(len(trail), -1).tolist()
    return _json({"type": "trail", "first": first, "rows": [[_short(value) for value in row] for row in rows]})


def links_words(links: Links, k: int) -> str:
    """The links: source by destination."""
    return _json(
        {
            "type": "links",
            "k": k,
            "sent": _flat(links.sent),
            "delivered": _flat(links.delivered),
            "heard": _flat(links.heard),
        }
    )


def series_words(series: Series) -> str:
    """More of the chart."""
    return _json(
        {
            "type": "series",
            "k": series.ticks.tolist(),
            "mfow": [_short(value) for value in series.mfow_s.tolist()],
            "mean": [_short(value) for value in series.fog_mean_s.tolist()],
        }
    )


def events_words(events: Sequence[Event], first: int) -> str:
    """Events, the first of them with this number."""
    said = [[event.k, event.kind, event.robot, event.detail] for event in events]
    return _json({"type": "events", "first": first, "events": said})


def bands_words(bands: Sequence[Band]) -> str:
    """The faults so far: all of them, each time."""
    said = [[band.id, band.kind, band.begin, band.end, band.text] for band in bands]
    return _json({"type": "bands", "bands": said})


def answer_words(number: object, answer: Answer) -> str:
    """What became of the control that the page gave this number."""
    return _json({"type": "answer", "id": number, "done": answer.done, "text": answer.text})


def _flat(values: NDArray[np.int64]) -> list[int]:
    return [int(value) for value in values.ravel()]


def _short(value: float | None) -> float | None:
    """A number as short as eyes need it; JSON has no infinities."""
    return None if value is None or not math.isfinite(value) else round(value, 4)


def _json(says: dict[str, Any]) -> str:
    return json.dumps(says, separators=(",", ":"), allow_nan=False)
