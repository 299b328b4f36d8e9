from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from typing import Annotated, Any

import pytest
from pydantic import BaseModel

from patrol.summary.metric import REDUCTIONS, Metric, metrics_of
from patrol.summary.model import Messages, RobotFigures, Summary, VerdictFacts, unsettled

DOCS = Path(__file__).parents[3] / "docs"


@pytest.mark.parametrize(
    ("metric", "value", "text"),
    [
        (Metric("", "s"), 59.54, "59.5 s"),
        (Metric("", "s"), None, "-"),
        (Metric("", "%", digits=2), 0.73084, "73.08 %"),
        (Metric("", digits=0), 12345, "12'345"),
    ],
)
def test_a_value_is_printed_as_declared(metric: Metric, value: float | None, text: str) -> None:
    assert metric.text(value, "'") == text
    assert metric.number(value, "'") == text.split(maxsplit=1)[0]


@pytest.mark.parametrize(
    ("sweep", "values", "reduced"),
    [
        ("once", [None], None),
        ("count", [["one", "two"]], 2),
        ("sum", [0.1, 0.3], 0.4),
        ("max", [None, 0.3], 0.3),
        ("max", [None], 0.0),
        ("mean", [0.1, 0.3], 0.2),
    ],
)
def test_the_values_of_all_robots_make_one_number(sweep: str, values: list[Any], reduced: float | None) -> None:
    assert Metric("", "%", sweep=sweep).reduced(values) == pytest.approx(reduced)


def test_a_column_of_its_own_holds_values_as_printed_and_an_undeclared_field_is_no_metric() -> None:
    assert Metric("", "%", sweep="mean", column="percent").reduced([0.1, 0.3]) == pytest.approx(20.0)

    class Part(BaseModel):
        name: str = ""
        height_m: Annotated[float, Metric("height", "m")] = 0.0

    assert list(metrics_of(Part)) == [("height_m", Metric("height", "m"))]


@pytest.mark.parametrize("model", [Summary, Messages, RobotFigures])
def test_every_field_is_declared_with_what_it_needs(model: type[BaseModel]) -> None:
    declared = dict(metrics_of(model))
    assert list(declared) == list(model.model_fields)
    for key, metric in declared.items():
        assert metric.meaning, key
        assert metric.better in ("", "lower", "higher"), key
        assert metric.sweep in ("", *REDUCTIONS), key
        assert not key.endswith("_s") or metric.unit in ("", "s"), key


def test_no_two_metrics_share_a_column_of_a_sweep() -> None:
    columns = [
        metric.column or key
        for model in (Summary, RobotFigures, VerdictFacts)
        for key, metric in metrics_of(model)
        if metric.sweep
    ]
    assert len(set(columns)) == len(columns)


def test_the_tables_of_the_documentation_are_current() -> None:
    spec = spec_from_file_location("tables", DOCS / "tables.py")
    assert spec is not None
    assert spec.loader is not None
    tables = module_from_spec(spec)
    spec.loader.exec_module(tables)
    marks = [f"<!-- metrics: {name} -->" for name in tables.MODELS]
    marks += [f"<!-- columns: {name} -->" for name in tables.TABLES]
    texts = [document.read_text(encoding="utf-8") for document in tables.DOCUMENTS]
    assert [mark for mark in marks if not any(mark in text for text in texts)] == []
    for text in texts:
        assert tables.with_tables(text) == text, "run `make tables`"


@pytest.mark.parametrize(
    ("seen_share", "simulated_s", "why"),
    [(1.0, 40.0, ""), (0.999, 40.0, "not all was seen"), (1.0, 39.0, "run too short")],
)
def test_a_mean_mfow_is_compared_once_all_is_seen_and_time_enough(
    seen_share: float, simulated_s: float, why: str
) -> None:
    assert unsettled(Summary(seen_share=seen_share, simulated_s=simulated_s), 10.0) == why


def test_a_document_holds_what_was_set_and_what_other_versions_wrote() -> None:
    document = {"ticks": 3, "messages": {"sent": 2, "heard_twice": 1}, "new": [1]}
    summary = Summary.model_validate(document)
    assert summary.messages.sent == 2
    assert summary.mfow_mean_s is None
    assert summary.document() == document
