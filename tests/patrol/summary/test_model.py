"""What a summary says without being told, and its ground in words."""

import inspect
from typing import Any

from pydantic import BaseModel

import patrol.summary.model
from patrol.summary.model import LeftOutFacts, Summary, ground_text

PARTS = {
    name: part
    for name, part in vars(patrol.summary.model).items()
    if inspect.isclass(part) and issubclass(part, BaseModel) and part.__module__ == patrol.summary.model.__name__
}

SAYS_SOMETHING: dict[str, Any] = {
    "BatteryFigures.patrol_share": 1.0,
    "CheckFacts.judged": True,
    "RobotFigures.status": "absent",
    "VerdictFacts.outcome": "unknown",
    "ZoneFigures.weight": 1.0,
}


def test_what_an_older_run_did_not_write_reads_as_nothing() -> None:
    """No field invents a frame, a second or a metre; the few that say something else are listed."""
    defaults = {
        f"{name}.{key}": field.default
        for name, part in PARTS.items()
        for key, field in part.model_fields.items()
        if not field.is_required() and not isinstance(field.default, BaseModel)
    }
    assert {key: value for key, value in defaults.items() if value} == SAYS_SOMETHING
    assert len(defaults) > 100


def test_the_ground_is_said_in_whole_square_metres_or_vertices() -> None:
    assert ground_text(Summary(patrolled_area_m2=17.5001)) == "18 m²"
    assert ground_text(Summary(patrolled_area_m2=17.0, patrolled_vertices=12)) == "12 vertices"


def test_what_is_left_out_is_said_in_the_same_words_as_when_it_was_found() -> None:
    facts = LeftOutFacts(area_m2=23.4, parts=2, largest_m2=20.0, x=1.25, y=-3.5, why="walled off", small_parts=0)
    words = (
        "23 m² of free ground in 2 parts, which no robot sees; the largest, 20 m², is around (1.25, -3.50), walled off"
    )
    assert facts.text == words
