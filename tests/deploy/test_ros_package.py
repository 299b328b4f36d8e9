"""The package that colcon builds: it can be read, names one version, and starts an agent with options that it has."""

from __future__ import annotations

import ast
import re
import runpy
import sys
import tomllib
import types
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

import pytest

from tests.deploy.command_lines import DEPLOY

PACKAGE = DEPLOY / "ros" / "fogwatch_agent"
LAUNCH = PACKAGE / "launch" / "agent.launch.py"
VALUES = {"namespace": "robot1", "map": "map.yaml", "connect": "tcp/127.0.0.1:7447"}


def fake_launch() -> dict[str, types.ModuleType]:
    """As much of ROS's package launch as the launch file uses; what is made there remembers what it was made of."""

    def made(kind: str) -> Any:
        return lambda *words, **named: (kind, words, named)

    package, actions, substitutions = (types.ModuleType(f"launch{part}") for part in ("", ".actions", ".substitutions"))
    package.LaunchDescription = lambda entities: entities  # type: ignore[attr-defined]
    actions.DeclareLaunchArgument = made("argument")  # type: ignore[attr-defined]
    actions.ExecuteProcess = made("process")  # type: ignore[attr-defined]
    substitutions.LaunchConfiguration = lambda name: VALUES[name]  # type: ignore[attr-defined]
    return {module.__name__: module for module in (package, actions, substitutions)}


@pytest.fixture
def described(monkeypatch: pytest.MonkeyPatch) -> list[Any]:
    """What the launch file describes."""
    for name, module in fake_launch().items():
        monkeypatch.setitem(sys.modules, name, module)
    entities = runpy.run_path(str(LAUNCH))["generate_launch_description"]()
    assert isinstance(entities, list)
    return entities


def test_the_manifest_is_that_of_an_ament_package() -> None:
    root = ET.parse(PACKAGE / "package.xml").getroot()
    assert (root.tag, root.get("format")) == ("package", "3")
    said = {child.tag: (child.text or "").strip() for child in root}
    assert said["name"] == PACKAGE.name
    assert root.findtext("export/build_type") == "ament_python"
    assert all(said[name] for name in ("version", "description", "maintainer", "license"))


def test_manifest_and_setup_have_the_version_and_licence_of_the_project() -> None:
    project = tomllib.loads((DEPLOY.parent / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    root = ET.parse(PACKAGE / "package.xml").getroot()
    setup = (PACKAGE / "setup.py").read_text(encoding="utf-8")
    assert root.findtext("version") == project["version"]
    assert root.findtext("license") == project["license"]
    assert re.findall(r'version="(.*)"', setup) == [project["version"]]


def test_setup_installs_files_that_exist() -> None:
    call = next(node for node in ast.walk(ast.parse((PACKAGE / "setup.py").read_text())) if isinstance(node, ast.Call))
    files = next(word.value for word in call.keywords if word.arg == "data_files")
    text = ast.unparse(files).replace("{NAME}", PACKAGE.name).replace("f'", "'")
    installed = [Path(name) for _, names in ast.literal_eval(text) for name in names]
    assert installed
    assert all((PACKAGE / name).is_file() for name in installed)


def test_the_launch_file_starts_an_agent_with_the_arguments_that_it_declares(described: list[Any]) -> None:
    *declared, (kind, _, process) = described
    assert kind == "process"
    assert [words[0] for _, words, _ in declared] == list(VALUES)
    assert all(named["description"] for _, _, named in declared)
    given = [word for name, value in VALUES.items() for word in (f"--{name}", value)]
    assert process["cmd"] == ["fogwatch", "agent", "--robot", "ros2", *given]


def test_the_agent_can_read_that_command_line(described: list[Any]) -> None:
    options = pytest.importorskip("agent.robots.ros2.options", reason="no driver for ROS 2 robots is here")
    *_, (_, _, process) = described
    read = options.options_of(process["cmd"][2:])
    assert {name: str(getattr(read, name)) for name in VALUES} == VALUES
