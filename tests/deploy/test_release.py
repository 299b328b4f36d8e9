"""The files of a release: all name the version and the dependencies of pyproject.toml."""

import csv
import re
import tomllib
from typing import Any

import pytest
import yaml
from packaging.requirements import Requirement

from tests.deploy.command_lines import DEPLOY

ROOT = DEPLOY.parent
PROJECT: dict[str, Any] = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
RECIPE: dict[str, Any] = yaml.safe_load((DEPLOY / "conda" / "recipe.yaml").read_text(encoding="utf-8"))
CONDA = {"dask": "dask-core", "matplotlib": "matplotlib-base", "msgpack": "msgpack-python"}
"""Packages that conda-forge has under another name."""


def requirements(extra: str) -> set[str]:
    """Return the requirements of an extra of ours, as conda writes them."""
    lines: set[str] = set()
    for wanted in map(Requirement, PROJECT["optional-dependencies"][extra]):
        if wanted.name == "fogwatch":
            lines |= {line for other in wanted.extras for line in requirements(other)}
        else:
            lines.add(in_conda(wanted))
    return lines


def in_conda(wanted: Requirement) -> str:
    bounds = sorted(map(str, wanted.specifier), reverse=True)
    return f"{CONDA.get(wanted.name, wanted.name.lower())} {','.join(bounds)}"


@pytest.mark.parametrize(
    ("file", "line"),
    [
        ("CITATION.cff", r"^version: (.*)$"),
        ("CHANGELOG.md", r"^## (\d+\.\d+\.\d+)"),
        ("deploy/Containerfile", r"--tag fogwatch-\$role:([\d.]+) "),
        ("deploy/compose.yaml", r"image: fogwatch-\w+:(.*)$"),
        ("deploy/conda/recipe.yaml", r'^  version: "(.*)"$'),
        ("deploy/ros/fogwatch_agent/package.xml", r"<version>(.*)</version>"),
        ("deploy/ros/fogwatch_agent/setup.py", r'version="(.*)"'),
    ],
)
def test_every_file_names_the_version_of_the_project(file: str, line: str) -> None:
    found = re.findall(line, (ROOT / file).read_text(encoding="utf-8"), re.MULTILINE)
    assert found, file
    assert set(found[:1] if file == "CHANGELOG.md" else found) == {PROJECT["version"]}


def test_the_conda_package_asks_for_what_all_of_the_project_asks_for() -> None:
    base = {in_conda(Requirement(line)) for line in PROJECT["dependencies"]}
    python = f"python {PROJECT['requires-python']}"
    assert set(RECIPE["requirements"]["run"]) == {"__linux", python} | base | requirements("all")
    assert python in RECIPE["requirements"]["host"]
    assert RECIPE["package"]["name"] == PROJECT["name"]
    commands = [f"{name} = {function}" for name, function in PROJECT["scripts"].items()]
    assert RECIPE["build"]["python"]["entry_points"] == commands


def test_the_paper_cites_what_its_bibliography_has_and_shows_figures_that_exist() -> None:
    text = (ROOT / "paper" / "paper.md").read_text(encoding="utf-8")
    entries = re.findall(r"^@\w+\{(\w+),", (ROOT / "paper" / "paper.bib").read_text(encoding="utf-8"), re.MULTILINE)
    assert set(re.findall(r"\[@(\w+)\]", text)) == set(entries)
    figures = re.findall(r"\]\((\.\./\S+\.png)\)", text)
    assert len(figures) == 2
    assert all((ROOT / "paper" / name).is_file() for name in figures)


def test_the_paper_has_the_figures_of_the_page_of_policies() -> None:
    text = " ".join((ROOT / "paper" / "paper.md").read_text(encoding="utf-8").split())
    with (ROOT / "docs" / "results" / "policies.csv").open(encoding="utf-8") as file:
        rows = [row for row in csv.DictReader(file) if row["ground"] in ("open", "yards", "clutter", "site")]
    mfow: dict[str, list[float]] = {}
    for row in rows:
        mfow.setdefault(row["policy"], []).append(float(row["mfow_s"]))
    best = [float(row["best_tour_s"]) for row in rows if row["policy"] == "stochastic"]
    rivals = [row for name, row in mfow.items() if name not in ("stochastic", "committed", "potential-field")]
    assert len(rivals) == 16
    least = [min(column) for column in zip(*rivals, strict=True)]
    for numbers in (mfow["stochastic"], best, mfow["committed"], least):
        assert "{:.0f}, {:.0f}, {:.0f} and {:.0f} s".format(*numbers) in text
