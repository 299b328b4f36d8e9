"""The dashboard and the alert rules: each names only metrics and labels that processes have."""

import json
import re
from collections import Counter
from collections.abc import Iterator
from itertools import combinations
from pathlib import Path
from typing import Any

import pytest
import yaml

from patrol.journal.records import Status
from patrol.radio.message import RejectReason
from runtime.reporting import vitals
from runtime.reporting.vitals import Figure, Kind

FOLDER = Path(__file__).resolve().parents[2] / "deploy" / "metrics"
DASHBOARD: dict[str, Any] = json.loads((FOLDER / "dashboard.json").read_text(encoding="utf-8"))
PANELS: list[dict[str, Any]] = DASHBOARD["panels"]
RULES: dict[str, Any] = yaml.safe_load((FOLDER / "alerts.yaml").read_text(encoding="utf-8"))
FIGURES = {figure.name: figure for figure in vars(vitals).values() if isinstance(figure, Figure)}

OF_PROMETHEUS = {"up": {"job", "instance"}}
"""Metrics that Prometheus makes itself, with their labels."""
USUAL_LABELS = {"process", "fleet", "job", "instance"}
"""Labels of every figure: the process's, and those that Prometheus adds."""
VALUES: dict[tuple[str, str], set[str]] = {
    ("fogwatch_robots", "status"): {status.name.lower() for status in Status},
    ("fogwatch_frames_refused_total", "reason"): {str(reason) for reason in RejectReason},
}
"""What labels can be, where that is declared."""

SELECTED = re.compile(r"\b(fogwatch_\w+|process_\w+|up)\b(?:\{([^}]*)\})?")
MATCHER = re.compile(r'(\w+)(?:=~|!~|!=|=)"([^"]*)"')
RATE_OF = re.compile(r"\b(?:rate|increase)\((\w+)")
GROUPED = re.compile(r"\b(?:by|on) \(([^)]*)\)")


def problems(expression: str) -> list[str]:
    """The names in an expression that nothing has."""
    found = []
    grouped = {label.strip() for labels in GROUPED.findall(expression) for label in labels.split(",")} - {""}
    expression = GROUPED.sub("", expression)
    known: set[str] = set()
    for name, matchers in SELECTED.findall(expression):
        figure = FIGURES.get(name)
        if figure is None and name not in OF_PROMETHEUS:
            found.append(f"no metric {name}")
            continue
        labels = OF_PROMETHEUS[name] if figure is None else USUAL_LABELS | ({figure.label} - {""})
        known |= labels
        for label, value in MATCHER.findall(matchers):
            if label not in labels:
                found.append(f"{name} has no label {label}")
            elif (name, label) in VALUES:
                found += [f"{label} is never {one}" for one in value.split("|") if one not in VALUES[name, label]]
    for name in RATE_OF.findall(expression):
        if name in FIGURES and FIGURES[name].kind is not Kind.COUNTER:
            found.append(f"{name} is no counter")
    return found + [f"no metric here has the label {label}" for label in grouped - known]


def shown() -> Iterator[tuple[str, str, str]]:
    """Each expression of the dashboard, with its panel and its legend."""
    for panel in PANELS:
        for target in panel.get("targets", ()):
            yield panel["title"], target["expr"], target["legendFormat"]


def rules() -> list[dict[str, Any]]:
    return [rule for group in RULES["groups"] for rule in group["rules"]]


@pytest.mark.parametrize(
    ("expression", "problem"),
    [
        ("fogwatch_ticks", "no metric fogwatch_ticks"),
        ('fogwatch_robots{state="dead"}', "fogwatch_robots has no label state"),
        ('fogwatch_robots{status=~"dead|gone"}', "status is never gone"),
        ("rate(fogwatch_tick[1m])", "fogwatch_tick is no counter"),
        ("sum by (reason) (fogwatch_robots)", "no metric here has the label reason"),
    ],
)
def test_what_there_is_not_is_found(expression: str, problem: str) -> None:
    assert problems(expression) == [problem]


def test_the_dashboard_and_the_rules_name_what_there_is() -> None:
    named = [*(one[:2] for one in shown()), *((rule["alert"], rule["expr"]) for rule in rules())]
    assert {name: problems(expression) for name, expression in named if problems(expression)} == {}


def test_the_dashboard_shows_every_metric_but_the_newest_tick() -> None:
    named = {name for _, expression, _ in shown() for name, _ in SELECTED.findall(expression)}
    assert set(FIGURES) - named == {vitals.TICK.name}


def test_legends_name_labels_that_the_result_has() -> None:
    for title, expression, legend in shown():
        labels = {label for name, _ in SELECTED.findall(expression) for label in (*USUAL_LABELS, FIGURES[name].label)}
        assert set(re.findall(r"\{\{(\w+)\}\}", legend)) <= labels, title


def test_grafana_can_lay_out_the_dashboard() -> None:
    assert isinstance(DASHBOARD["schemaVersion"], int)
    assert {"uid", "title", "time", "templating"} <= set(DASHBOARD)
    assert {panel["type"] for panel in PANELS} == {"row", "stat", "timeseries", "state-timeline"}
    assert max(Counter(panel["id"] for panel in PANELS).values()) == 1
    places = [panel["gridPos"] for panel in PANELS]
    assert all(place["x"] >= 0 and place["x"] + place["w"] <= 24 for place in places)
    for one, other in combinations(places, 2):
        apart = any(
            first[at] + first[side] <= second[at]
            for first, second in ((one, other), (other, one))
            for at, side in (("x", "w"), ("y", "h"))
        )
        assert apart, (one, other)


def test_panels_ask_the_chosen_data_source_for_the_chosen_processes() -> None:
    names = {variable["name"] for variable in DASHBOARD["templating"]["list"]}
    for panel in PANELS:
        if panel["type"] == "row":
            continue
        targets = panel["targets"]
        assert len({target["refId"] for target in targets}) == len(targets) > 0
        for part in (panel, *targets):
            assert part["datasource"] == {"type": "prometheus", "uid": "${datasource}"}
        for target in targets:
            assert set(re.findall(r"\$(\w+)", target["expr"])) == {"process"} <= names


def test_rules_have_the_form_that_prometheus_loads() -> None:
    assert set(RULES) == {"groups"}
    assert all(set(group) == {"name", "rules"} for group in RULES["groups"])
    for rule in rules():
        assert set(rule) | {"for"} == {"alert", "expr", "for", "labels", "annotations"}
        assert re.fullmatch(r"[A-Z]\w*", rule["alert"])
        assert re.fullmatch(r"\d+[smh]", rule.get("for", "0s"))
        assert set(rule["labels"]) == {"severity"}
        assert set(rule["annotations"]) == {"summary", "description"}
    assert max(Counter(rule["alert"] for rule in rules()).values()) == 1


def test_alerts_say_what_the_result_knows() -> None:
    for rule in rules():
        expression = rule["expr"]
        labels: set[str] = set()
        for name, _ in SELECTED.findall(GROUPED.sub("", expression)):
            labels |= OF_PROMETHEUS.get(name) or USUAL_LABELS | {FIGURES[name].label}
        if summed := re.match(r"sum by \(([^)]*)\)", expression):
            labels = {label.strip() for label in summed[1].split(",")}
        texts = " ".join(rule["annotations"].values())
        assert set(re.findall(r"\$labels\.(\w+)", texts)) <= labels, rule["alert"]


def test_prometheus_reads_the_rules_under_the_job_that_they_name() -> None:
    config = yaml.safe_load((FOLDER / "prometheus.yaml").read_text(encoding="utf-8"))
    assert config["rule_files"] == ["alerts.yaml"]
    (job,) = config["scrape_configs"]
    jobs = {value for rule in rules() for label, value in MATCHER.findall(rule["expr"]) if label == "job"}
    assert jobs == {job["job_name"]}
