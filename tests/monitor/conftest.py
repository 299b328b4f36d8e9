"""Short runs, quiet and with faults, and what their worlds and minds held at chosen ticks."""

import json
import shutil
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from agent.build import Shared, build_mind
from agent.mind import Mind
from fogwatch.inprocess import InProcessFleet
from monitor.replay.run import Run, open_run
from patrol.exchange import FIRST_INCARNATION
from patrol.journal import End, JournalWriter, TickRecord, read_journal
from patrol.own_sensor import allow_sensor
from patrol.prepare import Prepared, prepare, sensor_footprint
from patrol.scenario import dump_scenario, load_scenario
from tests.worldsim.test_operator import Hour, Rests, Script
from worldsim.controls import Operator
from worldsim.fleet.loop import run_ticks
from worldsim.output.record import Recorder, header_of
from worldsim.output.summary import summarise
from worldsim.verdict.judge import judge
from worldsim.world import World

QUIET: dict[str, Any] = {
    "name": "short",
    "terrain": {"builtin": "yards"},
    "point": 1.0,
    "duration": 40,
    "robots": {"count": 3, "model": "holonomic"},
}

SPOOF: dict[str, Any] = {"kind": "spoof", "by": "stranger", "as": "r1", "payload": {"offset": [2.0, 1.0]}}
FAULTS: list[dict[str, Any]] = [
    {"kind": "loss", "rate": 0.5, "at": 3, "for": 12},
    {"kind": "delay", "delay": {"uniform": [0.0, 2.0]}, "at": 10, "for": 10},
    {**SPOOF, "at": 5, "for": 15},
    {"kind": "drift", "who": "r2", "bias": [1.5, 0.0], "at": 12, "for": 6},
    {"kind": "pause", "who": "r3", "at": 18, "for": 4},
    {"kind": "kill", "who": "r1", "at": 22},
    {"kind": "restart", "who": "r1", "at": 28},
]


@dataclass
class Seen:
    """A run in its folder, and by tick what the world's fog and the minds' beliefs held after it."""

    folder: Path
    truth: dict[int, NDArray[np.int32]] = field(default_factory=dict)
    beliefs: dict[tuple[int, int], NDArray[np.int32]] = field(default_factory=dict)

    def open(self) -> Run:
        return open_run(self.folder)


DOORS: dict[str, Any] = {
    **QUIET,
    "name": "doors",
    "robots": {"count": 1, "model": "holonomic"},
    "patrol": {"policy": "committed"},
    "closures": [
        {"name": "gate", "polygon": [[48, 0], [50, 0], [50, 88], [48, 88]], "closed": [[5, 15]]},
        {"name": "crate", "polygon": [[40, 30], [45, 30], [45, 35], [40, 35]]},
    ],
}
BY_HAND: dict[int, list[dict[str, Any]]] = {
    20: [{"do": "fault", "fault": {"kind": "open", "closure": "gate"}}],
    22: [{"do": "fault", "fault": {"kind": "close", "closure": "crate"}}],
    26: [{"do": "heal", "id": "op1"}],
    40: [{"do": "fault", "fault": {"kind": "open", "closure": "crate"}}],
    50: [{"do": "heal", "id": "op3"}],
}
"""Controls of an operator of DOORS, by tick. The robot stands in the crate's place when it is to be closed."""


def run_of(
    folder: Path, scenario: Mapping[str, Any], controls: Mapping[int, list[dict[str, Any]]] | None = None
) -> Seen:
    """Run a scenario in this process under an operator's controls by tick, watching world and minds in each tick."""
    loaded = load_scenario(scenario)
    (folder / "scenario.yaml").write_text(dump_scenario(loaded), encoding="utf-8")
    prepared = prepare(loaded)
    allow_sensor(loaded.sensor)
    footprint = sensor_footprint(loaded, prepared.terrain)
    world = World(prepared, footprint=footprint, operated=controls is not None)
    make, minds = partial(build_mind, Shared(prepared, footprint)), dict[int, Mind]()

    def made(number: int, incarnation: int) -> Mind:
        minds[number] = make(number, incarnation)
        return minds[number]

    fleet = InProcessFleet({number: made(number, FIRST_INCARNATION) for number in world.living}, made)
    seen = Seen(folder)
    with JournalWriter(folder / "journal", header_of(world, "2026-01-02T03:04:05+00:00")) as writer:
        recorder = Recorder(writer, loaded.spares)

        def on_tick(record: TickRecord) -> None:
            recorder.tick(record)
            seen.truth[record.k] = world.truth.fog.last_seen.copy()
            for number in world.living:
                fog = minds[number].belief.fog  # what a robot does not patrol has no age for its mind
                seen.beliefs[record.k, number] = np.where(fog.patrolled, fog.last_seen, np.int32(-1))

        operator = None
        if controls is not None:
            requests = Script(hour := Hour(), controls)
            requests.world = world
            operator = Operator(world, Rests(), requests, hour, controls_processes=True)
        recorder.end(run_ticks(world, fleet, on_tick, recorder.event, control=fleet, operator=operator))
    write_summary(folder, prepared)
    return seen


def write_summary(folder: Path, prepared: Prepared) -> None:
    journal = read_journal(folder / "journal")
    summary = summarise(journal, judge(journal, {}, prepared), prepared)[0].document()
    (folder / "summary.json").write_text(json.dumps(summary), encoding="utf-8")


def rewritten(
    seen: Seen,
    folder: Path,
    tick: Callable[[TickRecord], TickRecord | None] = lambda record: record,
    scenario: Mapping[str, Any] | None = None,
    notes: Mapping[str, Any] | None = None,
) -> Path:
    """Write a run's folder with another story in its journal, judged anew.

    tick: what becomes of each tick, None for nothing. scenario: another one. notes: of the journal's end.
    """
    journal = read_journal(seen.folder / "journal")
    loaded = load_scenario(journal.header.scenario if scenario is None else scenario)
    prepared = prepare(loaded)
    folder.mkdir()
    (folder / "scenario.yaml").write_text(dump_scenario(loaded), encoding="utf-8")
    end = journal.end or End("completed", "")
    with JournalWriter(folder / "journal", header_of(World(prepared))) as writer:
        for record in (*journal.events, *map(tick, journal.ticks), replace(end, notes=notes or end.notes)):
            if record is not None:
                writer.write(record)
    write_summary(folder, prepared)
    return folder


BODY = {"model": "holonomic"}
CORNERS = {"top": [50.0, 87.0], "topmost-left": [1.0, 87.0], "lowest-right": [99.0, 1.0], "bottom": [50.0, 1.0]}
SAVING = {"trail": 4, "trail_every": 2, "budget": {"bits_per_s": 700, "overhead": 8}, "adaptive": {"error": 1}}
SIDES = ([15, 15, 25, 16], [15, 24, 25, 25], [15, 15, 16, 25], [24, 15, 25, 25])
RING: dict[str, Any] = {
    "robots": {"count": 1, **BODY, "speed": 1.0, "radius": 0.4, "starts": [[20, 20]]},
    "closures": [
        {"name": f"side{i}", "polygon": [[x0, y0], [x1, y0], [x1, y1], [x0, y1]], "closed": [[2, 300]]}
        for i, (x0, y0, x1, y1) in enumerate(SIDES)
    ],
}

RUNS: dict[str, dict[str, Any]] = {
    "quiet": {"name": "short"},
    # Losses, delays, forged frames, a drift, a pause, a death and a restart.
    "faulty": {"faults": FAULTS},
    # The same without the drift, with robots that save on their radio: most ticks have no frame of theirs.
    "saving": {"faults": [fault for fault in FAULTS if fault["kind"] != "drift"], "radio": SAVING},
    # Sensors leave a part of each point's age.
    "hazy": {"sensor": {"quality": 0.6}},
    # Nobody hears the first robot from tick 10 on.
    "muted": {"faults": [{"kind": "silence", "who": "r1", "direction": "both", "at": 5}]},
    "alone": {"duration": 10, "robots": {"count": 1, **BODY}},
    # The second robot hardly moves, and dies at the end.
    "trapped": {
        "duration": 200,
        "robots": [BODY, {**BODY, "speed": 0.01}],
        # So that choices are free: by a plan the first one would see what the other is far from.
        "sensor": {"quality": 0.99},
        "patrol": {"policy": "committed"},
        "faults": [{"kind": "kill", "who": "r2", "at": 195}],
    },
    # From 2 s on the robot is shut in by a ring of four closures.
    "shut_in": {"terrain": {"builtin": "open"}, "duration": 200, **RING},
    # One of two spare robots joins.
    "spare": {
        "duration": 20,
        "robots": {"count": 2, "spare": 2, **BODY},
        "faults": [{"kind": "join", "who": "r3", "at": 10}],
    },
    # Robots begin at the upper and the lower edge of the terrain, two of them in corners.
    "edges": {"duration": 5, "robots": [{**BODY, "name": name, "start": start} for name, start in CORNERS.items()]},
    # Robots do not all get everywhere.
    "mixed": {"duration": 10, "sensor": {"range": 3.0}, "robots": [{**BODY, "radius": size} for size in (0.3, 2.5)]},
    # Robots would hear each other by themselves; here nobody carries their frames.
    "direct": {"duration": 10, "pace": "realtime", "radio": {"via": "direct"}},
}
"""Facts of runs besides `QUIET`, by their fixture's name. No test writes into their folders."""


def fixture_of(name: str) -> Any:
    """Return the fixture of one of `RUNS`."""

    @pytest.fixture(scope="session", name=name)
    def seen(tmp_path_factory: pytest.TempPathFactory) -> Seen:
        return run_of(tmp_path_factory.mktemp(name), {**QUIET, "name": name, **RUNS[name]})

    return seen


quiet, faulty, saving, hazy, muted, alone, trapped, shut_in, spare, edges, mixed, direct = map(fixture_of, RUNS)


@pytest.fixture(scope="session")
def doors(tmp_path_factory: pytest.TempPathFactory) -> Seen:
    """A run of one robot, with a gate that closes by itself and a crate, both closed and opened by an operator too."""
    return run_of(tmp_path_factory.mktemp("doors"), DOORS, BY_HAND)


@pytest.fixture
def copied(tmp_path: Path) -> Callable[[Seen], Path]:
    """A copy of a run's folder, to change."""

    def copy(seen: Seen) -> Path:
        folder = tmp_path / seen.folder.name
        shutil.copytree(seen.folder, folder)
        return folder

    return copy


def shorten_range(folder: Path) -> None:
    """Change the sensors' range in a run's scenario, so that it is not the one that was run."""
    text = (folder / "scenario.yaml").read_text(encoding="utf-8")
    assert "range: 10.0" in text
    (folder / "scenario.yaml").write_text(text.replace("range: 10.0", "range: 9.0"), encoding="utf-8")


def cut(folder: Path, share: float) -> None:
    """Leave a part of the journal, and no summary: the run was killed."""
    journal = folder / "journal"
    whole = journal.read_bytes()
    journal.write_bytes(whole[: int(len(whole) * share)])
    (folder / "summary.json").unlink(missing_ok=True)
