"""The layouts for Foxglove, Lichtblick and RViz: each topic that they show is there, with the type that it needs."""

import json
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest
import yaml
from mcap.reader import make_reader

from monitor.recording.ros_messages import LATCHED
from monitor.recording.run_recorder import Recorder
from monitor.replay.replay import play
from patrol.exchange import Sensed
from patrol.ground.fog import Fog
from patrol.ground.terrain import Terrain
from patrol.pose import Pose
from ros2.robot.diagnostics import Diagnostics, Patrolling
from ros2.robot.hardware import Hardware
from ros2.robot.options import DriveSettings
from ros2.robot.shown import Shown, show_map
from ros2.wire.codec import CODINGS
from ros2.wire.definitions import store
from tests.monitor.conftest import QUIET, run_of
from tests.ros2_hub import Hub

FOLDER = Path(__file__).resolve().parents[2] / "deploy" / "layouts"
PATIENCE_S = 300.0
GRID, PATH = "nav_msgs/msg/OccupancyGrid", "nav_msgs/msg/Path"
LOG, DIAGNOSTICS = "rcl_interfaces/msg/Log", "diagnostic_msgs/msg/DiagnosticArray"

IN_3D = {
    GRID: {"visible", "frameLocked", "colorMode", "minColor", "maxColor", "unknownColor", "invalidColor"},
    PATH: {"visible", "type", "lineWidth", "gradient"},
}
"""Settings of a topic in the 3D panel, by its type."""
PANELS = {"RosOut": LOG, "DiagnosticSummary": DIAGNOSTICS, "DiagnosticStatusPanel": DIAGNOSTICS}
"""Types that panels with a single topic show."""
DISPLAYS = {"rviz_default_plugins/Map": GRID, "rviz_default_plugins/Path": PATH}
"""Types that RViz's displays show."""


class Topics(NamedTuple):
    """All that can be shown: types by topic, and the topics that late subscribers also get."""

    types: dict[str, str]
    latched: set[str]


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Topics:
    folder = tmp_path_factory.mktemp("run")
    run = run_of(folder, {**QUIET, "duration": 5}).open()
    recorder = Recorder(run, folder / "out.mcap")
    assert play(run, [recorder]) is None
    recorder.close()
    with (folder / "out.mcap").open("rb") as file:
        summary = make_reader(file).get_summary()
    assert summary is not None
    types = {channel.topic: summary.schemas[channel.schema_id].name for channel in summary.channels.values()}
    return Topics(types, set(LATCHED))


@pytest.fixture(scope="module")
def published() -> Topics:
    hub, settings = Hub(), DriveSettings()
    link, terrain = hub.link("fogwatch", "robot1"), Terrain("t", np.ones((4, 6), dtype=np.bool_), 0.5)
    show_map(link, settings, terrain, 1)
    shown = Shown(link, settings, terrain, Fog(np.ones((4, 6), dtype=np.bool_)), lambda: 1)
    decision: Any = None
    shown.report(Sensed(0, Pose(0.0, 0.0, 0.0), False, clock_s=0.0), decision, 0.0)
    Diagnostics(Hardware(link, settings, 1.0, lambda _: None), Patrolling("robot1", {1: "robot1"}, 0.5, 1.0, 10.0), {})
    end = time.monotonic() + PATIENCE_S
    while "/robot1/path" not in hub.latched:
        assert time.monotonic() < end
        time.sleep(0.001)
    names = {kind.__name__: coding.type_name for kind, coding in CODINGS.items()}
    return Topics({one.topic: names[one.type_name] for one in hub.entities}, set(hub.latched))


@pytest.fixture(params=["recording", "robot"])
def layout(request: pytest.FixtureRequest) -> tuple[str, Topics]:
    """A layout's name, and what there is to be shown by it."""
    topics: Topics = request.getfixturevalue({"recording": "recorded", "robot": "published"}[request.param])
    return request.param, topics


def leaves(tree: Any) -> Iterator[str]:
    """The panels of a layout's tree of splits."""
    if isinstance(tree, str):
        yield tree
        return
    assert set(tree) == {"direction", "splitPercentage", "first", "second"}
    assert tree["direction"] in {"row", "column"}
    yield from leaves(tree["first"])
    yield from leaves(tree["second"])


def test_foxglove_and_lichtblick(layout: tuple[str, Topics]) -> None:
    name, topics = layout
    data = json.loads((FOLDER / f"{name}.json").read_text(encoding="utf-8"))
    assert set(data) == {"configById", "globalVariables", "userNodes", "playbackConfig", "layout"}
    assert sorted(leaves(data["layout"])) == sorted(data["configById"])
    for panel, config in data["configById"].items():
        kind = panel.partition("!")[0]
        if kind == "3D":
            for topic, settings in config["topics"].items():
                assert set(settings) <= IN_3D[topics.types[topic]], topic
                assert settings["visible"]
        elif kind == "Plot":
            for path in config["paths"]:
                topic, field = path["value"].split(".")
                assert field in {one for one, _ in store().fielddefs[topics.types[topic]][1]}, path
        else:
            assert topics.types[config["topicToRender"]] == PANELS[kind]


def test_rviz(layout: tuple[str, Topics]) -> None:
    """A display that asks for what was sent before gets nothing of a topic that is not latched."""
    name, topics = layout
    data = yaml.safe_load((FOLDER / f"{name}.rviz").read_text(encoding="utf-8"))["Visualization Manager"]
    assert data["Global Options"]["Fixed Frame"] == "map"
    for display in data["Displays"]:
        if display["Class"] == "rviz_default_plugins/TF":
            continue
        topic = display["Topic"]["Value"]
        full = topic if topic.startswith("/") else f"/robot1/{topic}"
        assert topics.types[full] == DISPLAYS[display["Class"]]
        latched = full in topics.latched
        assert display["Topic"]["Durability Policy"] == ("Transient Local" if latched else "Volatile"), topic


def test_robots_of_a_recording_are_shown_by_their_frames_whatever_their_names(recorded: Topics) -> None:
    assert recorded.types["/tf"] == "tf2_msgs/msg/TFMessage"
    data = json.loads((FOLDER / "recording.json").read_text(encoding="utf-8"))
    panel = data["configById"]["3D!patrol"]
    assert panel["followTf"] == "map"
    assert [frame for frame, settings in panel["transforms"].items() if not settings["visible"]] == ["frame:map"]
    rviz = yaml.safe_load((FOLDER / "recording.rviz").read_text(encoding="utf-8"))
    (shown,) = [one for one in rviz["Visualization Manager"]["Displays"] if one["Class"] == "rviz_default_plugins/TF"]
    assert shown["Show Axes"]
    assert shown["Show Names"]
