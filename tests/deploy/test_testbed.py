"""The test bed: what it refuses, and a fleet in network namespaces, where those are to be had (`make test-network`)."""

import json
import subprocess
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

from agent.ports import State
from deploy.testbed import DOWN, HALF, KILLED, UP, Event, as_asked, report, went_on
from patrol.journal import Status, TickRecord, read_journal
from tests.fleets import COARSE

TESTBED = Path(__file__).parents[2] / "deploy" / "testbed.py"
IMPOSSIBLE = 4
TEAM = {"count": 3, "model": "holonomic", "speed": 2.0}
SCENARIO: dict[str, Any] = {**COARSE, "point": 0.5, "duration": 40.0, "pace": 2.0, "watchdog": 1.0, "robots": TEAM}
SCENARIO["radio"] = {"via": "direct"}
TICKS = 80
ROBOTS = ("r1", "r2", "r3")
STARTING = 0.2
"""Share of the frames that a busy machine may lose: before all have found each other, and when nobody reads in time."""
ENOUGH = 0.2
"""Share of the ticks in which a robot must decide in time for a run to tell anything; a busy machine misses many."""


@dataclass
class Ran:
    """The exit code, lines and files of a run of the test bed."""

    code: int
    said: str
    folder: Path

    def file(self, name: str) -> Any:
        return json.loads((self.folder / name).read_text(encoding="utf-8"))

    @property
    def ticks(self) -> list[TickRecord]:
        return list(read_journal(self.folder / "journal").ticks)


Bed = Callable[..., Ran]


def spaces() -> set[str]:
    """The namespaces of all test beds, of those too that others run meanwhile."""
    listed = subprocess.run(["ip", "netns", "list"], capture_output=True, text=True, check=False).stdout
    return {line for line in listed.splitlines() if line.startswith("fogwatch-")}


@pytest.fixture
def bed(tmp_path: Path) -> Iterator[Bed]:
    """Runs a scenario in the test bed; skips where that is not possible."""

    def run(scenario: Mapping[str, Any], *arguments: str) -> Ran:
        path, out = tmp_path / "scenario.yaml", tmp_path / "run"
        path.write_text(json.dumps(scenario), encoding="utf-8")
        command = [sys.executable, "-P", str(TESTBED), str(path), "--out", str(out), *arguments]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        if done.returncode == IMPOSSIBLE:
            pytest.skip(done.stderr.strip())
        return Ran(done.returncode, done.stdout + done.stderr, out)

    before = spaces()
    yield run
    assert not spaces() - before, "namespaces are left"


def decided(ticks: Sequence[TickRecord], place: int) -> list[int]:
    """The ticks in which a decision of a robot, by its place in the roster, has come; not its word that it stops."""
    rows = {tick.k: tick.robots[place] for tick in ticks}
    return [k for k, row in rows.items() if row.decision_ms is not None and row.state != State.HOLDING]


@pytest.mark.parametrize(
    ("changes", "arguments", "says"),
    [
        ({"radio": {"via": "ether"}}, (), "radio.via = ether"),
        ({"pace": "lockstep"}, (), "pace is lockstep"),
        ({"robots": {"count": 2, "spare": 1}}, (), "has spare robots"),
        ({}, ("--loss", "1.5"), "--loss 1.5"),
        ({"radio": {"via": "ether"}, "pace": "lockstep"}, ("--by", "fleet"), "pace = lockstep"),
        ({}, ("--by", "fleet", "--loss", "0.1"), "only radio wires lose frames"),
        ({}, ("--cut", "r2:soon"), "--cut r2:soon: expected ROBOT:AT:FOR"),
        ({}, ("--cut", "r9:1:2"), "has no r9; choose among r1, r2, r3, half"),
        ({}, ("--kill", "r2"), "--kill r2: expected PROCESS:AT"),
        ({}, ("--kill", "r2:1:2"), "--kill r2:1:2: expected PROCESS:AT"),
        ({}, ("--kill", "world:5"), "has no world; choose among r1, r2, r3, page, router"),
    ],
)
def test_what_makes_no_sense_is_refused(
    changes: Mapping[str, Any], arguments: Sequence[str], says: str, bed: Bed
) -> None:
    ran = bed({**SCENARIO, **changes}, *arguments)
    assert ran.code == 2
    assert says in ran.said
    assert not ran.folder.exists()


EVENT_S = 1000.0
Reports = Sequence[tuple[float, str, Mapping[str, int]]]
BEFORE: Reports = [(EVENT_S - 0.1, "r1", {"r2": 5, "r3": 5}), (EVENT_S - 0.1, "r3", {"r1": 5, "r2": 5})]
"""r2 dies next."""
R1, R3 = ("r1", {"r3": 6}), ("r3", {"r1": 6})
"""Reports that the one has heard the other once more."""


def left_behind(folder: Path, reports: Reports | None, *events: tuple[str, str]) -> Path:
    """A run folder whose events all happened at the same time."""
    happened = [{"who": who, "what": what, "tick": 9, "at_s": EVENT_S} for who, what in events]
    network = {"by": "mesh", "wires": {name: {"passed": 1, "lost": 0} for name in ROBOTS}, "events": happened}
    (folder / "network.json").write_text(json.dumps(network), encoding="utf-8")
    summary = {"mfow_mean_s": 1.0, "verdict": {"outcome": "valid"}}
    (folder / "summary.json").write_text(json.dumps(summary), encoding="utf-8")
    if reports is not None:
        (folder / "heard.jsonl").write_text("".join(f"{json.dumps(line)}\n" for line in reports), encoding="utf-8")
    return folder


@pytest.mark.parametrize(
    ("reports", "goes_on", "says"),
    [
        (None, False, "r2 killed: no robot's report of whom it hears has come"),
        ([], False, "r2 killed: no robot's report of whom it hears has come"),
        (BEFORE, False, "r2 killed: 0 of 2 pairs of those left heard each other within 2 s, the last, "),
        (BEFORE[:1], False, "r2 killed: 0 of 2 pairs"),
        (
            # What is reported at once may have been heard before the death.
            [*BEFORE, *((EVENT_S + s, name, heard) for s, name, heard in ((0.1, *R1), (0.5, *R1), (0.5, *R3)))],
            False,
            "r2 killed: 1 of 2 pairs of those left heard each other within 2 s, the last, r1 r3, never",
        ),
        (
            [*BEFORE, (EVENT_S + 0.4, *R1), (EVENT_S + 2.1, *R3)],
            False,
            "r2 killed: 1 of 2 pairs of those left heard each other within 2 s, the last, r3 r1, after 2.1 s",
        ),
        (
            [*BEFORE, (EVENT_S + 0.4, *R1), (EVENT_S + 1.9, *R3)],
            True,
            "r2 killed: 2 of 2 pairs of those left heard each other within 2 s, the last, r3 r1, after 1.9 s",
        ),
    ],
)
def test_a_mesh_has_gone_on_after_a_death_only_if_each_pair_is_seen_to_hear_each_other(
    reports: Reports | None, goes_on: bool, says: str, tmp_path: Path
) -> None:
    out = left_behind(tmp_path, reports, ("r2", KILLED))
    assert went_on(out) == goes_on
    assert [line for line in report(out, tmp_path / "world.log") if line.startswith(says)]


@pytest.mark.parametrize(
    ("detail", "fine"),
    [
        ("lost: r2 at tick 7 (gone)", True),
        ("lost: r2 at tick 7; r3 at tick 9", False),
        ("lost: whom it does not say", False),
    ],
)
def test_a_verdict_is_as_asked_if_it_names_none_but_killed_robots(detail: str, fine: bool, tmp_path: Path) -> None:
    checks = [{"name": "nobody lost", "ok": False, "detail": detail}, {"name": "ticks", "ok": True, "detail": "all"}]
    (tmp_path / "summary.json").write_text(json.dumps({"verdict": {"checks": checks}}), encoding="utf-8")
    assert as_asked(tmp_path, [Event(5.0, KILLED, "r2")]) == fine


def test_a_network_that_parts_and_joins_again_is_in_the_report_and_no_death(tmp_path: Path) -> None:
    out = left_behind(tmp_path, [*BEFORE, (EVENT_S + 0.4, "r1", {"r2": 6, "r3": 6})], (HALF, DOWN), (HALF, UP))
    lines = [line for line in report(out, tmp_path / "world.log") if line.startswith(HALF)]
    assert [line.partition(" of those")[0] for line in lines] == ["half down: 2 of 6 pairs", "half up: 2 of 6 pairs"]
    assert went_on(out)


@pytest.mark.network
@pytest.mark.parametrize("by", ["group", "quic", "mesh"])
def test_robots_on_a_network_hear_each_other(by: str, bed: Bed) -> None:
    ran = bed(SCENARIO, "--by", by)
    assert ran.code == 0, ran.said
    summary = ran.file("summary.json")
    assert summary["direct"]["unsaid"] == []
    assert set(summary["direct"]["links"]) == {f"{a} to {b}" for a in ROBOTS for b in ROBOTS if a != b}
    for link, counts in summary["direct"]["links"].items():
        timely = len(decided(ran.ticks, ROBOTS.index(link[:2])))
        assert counts["heard"] >= (1.0 - STARTING) * counts["sent"], link
        assert counts["sent"] >= timely > ENOUGH * TICKS, link
    sent = sum(summary["direct"]["links"][f"{a} to {b}"]["sent"] for a, b in (("r1", "r2"), ("r2", "r3"), ("r3", "r1")))
    overheard = summary["messages"]["frames"] + sum(summary["direct"]["missed"].values())
    assert overheard >= (1.0 - STARTING) * sent, "the world overhears them"
    assert summary["messages"]["rejected"] == 0


@pytest.mark.network
def test_a_robot_that_is_cut_off_halts_and_comes_back_while_the_others_go_on(bed: Bed) -> None:
    ran = bed(SCENARIO, "--cut", "r2:10:8")
    assert ran.code == 0, ran.said
    down, up = (switch["tick"] for switch in ran.file("network.json")["events"])
    ticks = ran.ticks
    quiet = ticks[down + 4 : up]  # the watchdog takes two ticks; the tick in which the link went, two more
    places = {(tick.robots[1].x, tick.robots[1].y) for tick in quiet}
    assert len(places) == 1, "it has not halted"
    assert not [tick.k for tick in quiet if 2 in dict(tick.frames)], "its position was heard"
    assert not set(decided(ticks, 1)) & {tick.k for tick in quiet}
    for place in (0, 2):
        timely = decided(ticks, place)
        going_on = [k for k in timely if down <= k < up]
        otherwise = (len(timely) - len(going_on)) / (len(ticks) - (up - down))
        assert len(going_on) >= 0.8 * otherwise * (up - down) > 0.0, f"{ROBOTS[place]} stood still too"
    back = [k for k in decided(ticks, 1) if k > up]
    assert back, "it has not come back"
    assert back[0] - up <= 5.0 / 0.25, "it took more than 5 s of wall time"
    after = ticks[back[0] + 3 :]
    assert len({(tick.robots[1].x, tick.robots[1].y) for tick in after}) > 0.7 * len(after)
    assert [tick.k for tick in after if 2 in dict(tick.frames)]
    links = ran.file("summary.json")["direct"]["links"]
    lost = {link: counts["sent"] - counts["heard"] for link, counts in links.items()}
    for number, link in ((1, "r1 to r2"), (3, "r3 to r2")):
        overheard = sum(number in dict(tick.frames) for tick in quiet)
        cut = [k for k in decided(ticks, number - 1) if down + 4 <= k < up]
        assert lost[link] >= overheard >= 0.8 * len(cut) > 0, "it has heard what it cannot have heard"
    assert lost["r1 to r3"] <= STARTING * TICKS


@pytest.mark.network
@pytest.mark.parametrize("via", ["direct", "ether"])
def test_a_host_that_is_cut_off_from_the_fleet_s_router_comes_back_by_itself(via: str, bed: Bed) -> None:
    """Longer than the router's other end waits: the session ends, and the robot keeps its seat all the same."""
    at_pace = {**SCENARIO, "robots": {"count": 2, "model": "holonomic"}, "radio": {"via": via}, "pace": "realtime"}
    ran = bed({**at_pace, "duration": 50.0, "watchdog": 2.0}, "--by", "fleet", "--cut", "r2:10:20")
    assert ran.code == 0, ran.said
    assert "r2 decided again" in ran.said
    down, up = (switch["tick"] for switch in ran.file("network.json")["events"])
    quiet = range(down + 6, up)
    assert not set(decided(ran.ticks, 1)) & set(quiet)
    assert len(set(decided(ran.ticks, 0)) & set(quiet)) > ENOUGH * len(quiet), "r1 stood still too"
    assert [k for k in decided(ran.ticks, 1) if k > up], "it has not come back"
    assert {robot.status for tick in ran.ticks for robot in tick.robots} == {Status.ALIVE}


@pytest.mark.network
def test_a_lossy_network_loses_its_share_and_the_fleet_patrols_on(bed: Bed) -> None:
    loss = 0.3
    ran = bed(SCENARIO, "--loss", str(loss))
    assert ran.code == 0, ran.said
    for wire in ran.file("network.json")["wires"].values():
        carried = wire["passed"] + wire["lost"]
        assert wire["lost"] / carried == pytest.approx(loss, abs=5.0 * (loss * (1.0 - loss) / carried) ** 0.5)
    summary = ran.file("summary.json")
    sent = summary["messages"]["sent"]
    deviation = (loss * (1.0 - loss) / sent) ** 0.5
    share = summary["direct"]["heard_share"]
    assert 1.0 - loss - 5.0 * deviation - STARTING <= share <= 1.0 - loss + 5.0 * deviation
    timely = sum(len(decided(ran.ticks, place)) for place in range(len(ROBOTS)))
    assert sent >= 0.9 * 2 * timely, "each robot's position goes to two others"
    links = next(check for check in summary["verdict"]["checks"] if check["name"] == "links add up")
    assert links["ok"]
    assert not links["judged"]
    ticks = ran.ticks
    for place, name in enumerate(ROBOTS):
        assert len(decided(ticks, place)) > ENOUGH * TICKS
        assert summary["robots"][name]["distance_m"] > 10.0
    assert ticks[-1].seen > 2 * ticks[0].seen


@pytest.mark.network
def test_a_robot_that_dies_in_a_mesh_silences_no_other(bed: Bed) -> None:
    ran = bed(SCENARIO, "--by", "mesh", "--loss", "0.3", "--kill", "r1:20")
    assert ran.code == 0, ran.said
    (death,) = ran.file("network.json")["events"]
    assert (death["who"], death["what"]) == ("r1", "killed")
    heard = [json.loads(line) for line in (ran.folder / "heard.jsonl").read_text(encoding="utf-8").splitlines()]
    for robot, other in (("r2", "r3"), ("r3", "r2")):
        counts = [counts[other] for at_s, name, counts in heard if name == robot and at_s > death["at_s"] + 1.0]
        assert counts[-1] > counts[0], f"{robot} has not heard {other} any more"
    silent = [counts["r1"] for at_s, name, counts in heard if name == "r2" and at_s > death["at_s"] + 1.0]
    assert len(set(silent)) == 1, "a dead robot was heard"
    for name, wire in ran.file("network.json")["wires"].items():
        assert 0.2 < wire["lost"] / (wire["lost"] + wire["passed"]) < 0.4, name
    assert "r1 killed: " in ran.said
