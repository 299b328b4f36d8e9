"""The package that colcon builds: it can be read, names one version, and starts an agent with options that it has."""

import ast
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
FEW = {"connect": "tcp/127.0.0.1:7447"}
ALL = {**FEW, "namespace": "robot1", "map": "/my maps/map.yaml", "options": "--radius 0.2 --set 'robots.speed=1'"}


class Given:
    """The value of an argument; the context of this launch holds them by name."""

    def __init__(self, name: str) -> None:
        self._name = name

    def perform(self, context: dict[str, str]) -> str:
        return context[self._name]


def fake_launch() -> dict[str, types.ModuleType]:
    """As much of ROS's package launch as the launch file uses; what is made there remembers what it was made of."""

    def made(kind: str) -> Any:
        return lambda *words, **named: (kind, words, named)

    package, actions, substitutions = (types.ModuleType(f"launch{part}") for part in ("", ".actions", ".substitutions"))
    package.LaunchDescription = lambda entities: entities  # type: ignore[attr-defined]
    actions.DeclareLaunchArgument = made("argument")  # type: ignore[attr-defined]
    actions.ExecuteProcess = made("process")  # type: ignore[attr-defined]
    actions.OpaqueFunction = made("function")  # type: ignore[attr-defined]
    substitutions.LaunchConfiguration = Given  # type: ignore[attr-defined]
    return {module.__name__: module for module in (package, actions, substitutions)}


@pytest.fixture
def described(monkeypatch: pytest.MonkeyPatch) -> list[Any]:
    for name, module in fake_launch().items():
        monkeypatch.setitem(sys.modules, name, module)
    entities = runpy.run_path(str(LAUNCH))["generate_launch_description"]()
    assert isinstance(entities, list)
    return entities


def command_of(described: list[Any], given: dict[str, str]) -> list[str]:
    *declared, (kind, _, named) = described
    assert kind == "function"
    defaults = {words[0]: said["default_value"] for _, words, said in declared if "default_value" in said}
    ((kind, _, process),) = named["function"]({**defaults, **given})
    assert kind == "process"
    command: list[str] = process["cmd"]
    return command


def test_the_manifest_is_that_of_an_ament_package_with_the_licence_of_the_project() -> None:
    root = ET.parse(PACKAGE / "package.xml").getroot()
    assert (root.tag, root.get("format")) == ("package", "3")
    said = {child.tag: (child.text or "").strip() for child in root}
    assert said["name"] == PACKAGE.name
    assert root.findtext("export/build_type") == "ament_python"
    assert all(said[name] for name in ("version", "description", "maintainer"))
    project = tomllib.loads((DEPLOY.parent / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    assert said["license"] == project["license"]


def test_setup_installs_files_that_exist() -> None:
    call = next(node for node in ast.walk(ast.parse((PACKAGE / "setup.py").read_text())) if isinstance(node, ast.Call))
    files = next(word.value for word in call.keywords if word.arg == "data_files")
    text = ast.unparse(files).replace("{NAME}", PACKAGE.name).replace("f'", "'")
    installed = [Path(name) for _, names in ast.literal_eval(text) for name in names]
    assert installed
    assert all((PACKAGE / name).is_file() for name in installed)


def test_the_launch_file_starts_an_agent_which_can_read_what_it_is_given(described: list[Any]) -> None:
    *declared, _ = described
    assert {words[0] for _, words, _ in declared} == set(ALL)
    assert all(named["description"] for _, _, named in declared)
    start = ["fogwatch", "agent", "--robot", "ros2", "--connect", FEW["connect"]]
    assert command_of(described, FEW) == start
    more = ["--namespace", "robot1", "--map", "/my maps/map.yaml", "--radius", "0.2", "--set", "robots.speed=1"]
    assert command_of(described, ALL) == [*start, *more]
    options = pytest.importorskip("ros2.robot.options", reason="no driver for ROS 2 robots is here")
    few, full = (options.options_of(command_of(described, given)[2:]) for given in (FEW, ALL))
    assert (few.connect, few.namespace, few.map) == (FEW["connect"], "", None)
    assert (full.connect, full.namespace, str(full.map), full.radius) == (FEW["connect"], "robot1", ALL["map"], 0.2)
