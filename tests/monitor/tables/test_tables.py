"""The tables of a run, read by pandas from Parquet, give the numbers of its summary."""

import sys
from collections import Counter
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from monitor.replay.run import open_run
from monitor.tables import arrow
from monitor.tables.arrow import arrow_table, batches, write_tables
from monitor.tables.columns import TABLES
from patrol.errors import BadInput
from patrol.journal import read_journal
from patrol.journal.records import DEAD_END, TickRecord
from tests.monitor.conftest import DOORS, FAULTS, QUIET, Seen, rewritten, run_of
from tests.monitor.report.test_report_numbers import ALL_KINDS
from tests.present import present

ROUNDED: dict[str, Any] = {"rel": 1e-12, "abs": 1e-12}
"""The summary multiplies a mean of whole ticks by the step, and sums ways in the order of ticks; pandas adds seconds,
and pairwise. So sums of floats agree but for rounding; counts agree exactly."""

GRAPH = {"vertices": [[20, 20], [30, 20], [40, 30], [60, 60]], "edges": [[0, 1, 10], [1, 2, 15], [2, 3, 40]]}
BATTERY = {"capacity": 1.0, "idle": 10, "drive": 30, "charge": 200, "start": 0.3}
SCENARIOS: dict[str, dict[str, Any]] = {
    "troubled": {
        **QUIET,
        "robots": {"count": 4, "spare": 2, "model": "holonomic"},
        "faults": ALL_KINDS,
        "closures": DOORS["closures"],
    },
    "graph": {**QUIET, "terrain": {"builtin": "open", "graph": GRAPH}, "patrol": {"policy": "cr"}, "duration": 60},
    "mixed": {
        **QUIET,
        "robots": [{"model": "car"}, {"model": "differential"}, {"model": "holonomic", "spare": True}],
        "faults": [FAULTS[0], {"kind": "join", "who": "r3", "at": 20}],
    },
    "batteries": {
        **QUIET,
        "terrain": {"builtin": "open"},
        "robots": {"count": 2, "model": "holonomic", "starts": [[12, 10], [20, 16]], "battery": BATTERY},
        "docks": [{"place": [10, 10]}],
    },
}
COMMANDS = ("velocity_x_m_s", "velocity_y_m_s", "speed_m_s", "turn_rate_rad_s", "curvature_1_m")


@pytest.fixture(scope="module", params=SCENARIOS)
def seen(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Seen:
    return run_of(tmp_path_factory.mktemp(request.param), {**SCENARIOS[request.param], "name": request.param})


@pytest.fixture(scope="module")
def tables(seen: Seen, tmp_path_factory: pytest.TempPathFactory) -> dict[str, pd.DataFrame]:
    """The tables, from Parquet files."""
    folder = tmp_path_factory.mktemp("tables")
    return {file.stem: pd.read_parquet(file) for file in write_tables(seen.open(), folder, "parquet")}


def summary_of(seen: Seen) -> dict[str, Any]:
    return present(seen.open().summary).document()


def dropped_by_cause(links: pd.DataFrame) -> dict[str, int]:
    """Frames that were dropped, by the kind of the cause."""
    lost = links[links.dropped > 0]
    return dict(lost.dropped.groupby([cause.partition(":")[0] for cause in lost.cause]).sum())


def test_the_ground_gives_the_summary_of_the_fog(seen: Seen, tables: dict[str, pd.DataFrame]) -> None:
    summary, ground = summary_of(seen), tables["ground"]
    assert ground.age_mean_s.mean() == pytest.approx(summary["fog_mean_s"], **ROUNDED)
    assert ground.age_max_s.max() == summary["mfow_max_s"]
    assert ground.age_end_s.max() == summary["mfow_end_s"]
    assert ground.seen.mean() == pytest.approx(summary["seen_share"], **ROUNDED)
    assert len(ground) * summary["point_m"] ** 2 == pytest.approx(summary["patrolled_area_m2"], **ROUNDED)


def test_robots_give_the_summary_of_each(seen: Seen, tables: dict[str, pd.DataFrame]) -> None:
    summary = summary_of(seen)
    took_part = set(tables["robots"].robot)
    assert {name for name, robot in summary["robots"].items() if robot["status"] != "absent"} <= took_part
    for name in took_part:
        rows, stated = tables["robots"][tables["robots"].robot == name], summary["robots"][name]
        assert rows.driven_m.sum() == pytest.approx(stated["distance_m"], **ROUNDED)
        sums = {"bumped": "collisions", "refused": "refused_commands", "frame_bytes": "bytes", "rejected": "rejected"}
        assert [rows[column].sum() for column in sums] == [stated[name] for name in sums.values()]
        assert rows.decision_ms.count() == stated["decisions"]
        assert (rows.status == "alive").sum() - rows.decision_ms.count() == stated["missed"]
        dead_ends = (rows.decision_ms.notna() & (rows.state == DEAD_END)).sum()
        assert dead_ends / max(stated["decisions"], 1) == stated["dead_end_share"]
        assert np.percentile(rows.decision_ms.dropna(), 99) == stated["decision_ms_p99"]
        battery = stated.get("battery")
        if battery is None:
            assert rows.charge_share.isna().all()
        else:
            assert rows.charge_share.iloc[-1] == battery["end_share"]
            assert min(BATTERY["start"], rows.charge_share.min()) == battery["least_share"]
    assert tables["robots"].frames.sum() == summary["messages"]["frames"]
    assert tables["robots"].frame_bytes.sum() == summary["messages"]["bytes"]


def test_links_give_the_summary_of_the_frames(seen: Seen, tables: dict[str, pd.DataFrame]) -> None:
    summary, links, ticks = summary_of(seen), tables["links"], tables["ticks"]
    own, messages = links[links.sender != "forger"], summary["messages"]
    for count in ("sent", "delivered", "dropped"):
        assert own[count].sum() == ticks[count].sum() == messages[count]
        by_sender = own.groupby("sender")[count].sum()
        for name in set(tables["robots"].robot):
            assert by_sender.get(name, 0) == summary["robots"][name][count]
    assert dropped_by_cause(own) == messages["dropped_by_cause"]
    for sender, receivers in summary["links"].items():
        for receiver, stated in receivers.items():
            rows = links[(links.sender == sender) & (links.receiver == receiver)]
            assert rows.sent.sum() == stated["sent"]
            assert rows.delivered.sum() == stated["delivered"]
            assert dropped_by_cause(rows) == stated["dropped"]
    assert bool(messages["forged"]) == (links.sender == "forger").any()


def test_visits_give_the_measures_over_visits(seen: Seen, tables: dict[str, pd.DataFrame]) -> None:
    nodes, visits = summary_of(seen).get("nodes"), tables["visits"]
    if nodes is None:
        assert visits.empty
        return
    assert len(visits) == nodes["visits"] > 5
    again = visits[~visits["first"]]
    assert again.idle_s.mean() == pytest.approx(nodes["return_mean_s"], **ROUNDED)
    means = again.groupby("vertex").idle_s.mean().reindex(range(nodes["vertices"]), fill_value=0.0)
    assert means.mean() == pytest.approx(nodes["visits_mean_s"], **ROUNDED)
    assert means.max() == pytest.approx(nodes["visits_worst_s"], **ROUNDED)
    assert sorted(set(range(nodes["vertices"])) - set(visits.vertex)) == nodes["unvisited"]
    assert [[x, y] for x, y in visits[["x_m", "y_m"]].values] == [GRAPH["vertices"][number] for number in visits.vertex]


def test_commands_have_the_columns_of_their_body(tables: dict[str, pd.DataFrame], seen: Seen) -> None:
    models = {robot.name: robot.model for robot in seen.open().robots}
    of_model = {
        "holonomic": {"velocity_x_m_s", "velocity_y_m_s"},
        "differential": {"speed_m_s", "turn_rate_rad_s"},
        "car": {"speed_m_s", "curvature_1_m"},
    }
    commands = sorted(set.union(*of_model.values()))
    for name, rows in tables["robots"].groupby("robot"):
        given = rows[commands].notna()
        assert set(given.columns[given.all()]) == of_model[models[str(name)]]
        assert set(given.columns[given.any()]) == of_model[models[str(name)]]
    driven = tables["robots"]
    way_m = np.hypot(driven.velocity_x_m_s, driven.velocity_y_m_s).fillna(driven.speed_m_s.abs()) * seen.open().step
    assert np.allclose(driven.driven_m, way_m.where(~driven.bumped, 0.0), rtol=1e-12)


def test_robots_are_those_of_the_journal_row_by_row(seen: Seen, tables: dict[str, pd.DataFrame]) -> None:
    run = seen.open()
    names = dict(zip(run.numbers, run.names, strict=True))
    rows = iter(tables["robots"].replace({np.nan: None}).to_dict("records"))
    for record in run.journal.ticks:
        for robot in (robot for robot in record.robots if robot.number in names):
            row = next(rows)
            assert (row["tick"], row["time_s"]) == (record.k, record.k * run.step)
            assert (row["robot"], row["status"]) == (names[robot.number], robot.status.name.lower())
            assert (row["x_m"], row["y_m"], row["heading_rad"]) == (robot.x, robot.y, robot.heading)
            given = [row[name] for name in COMMANDS if row[name] is not None]
            assert given == [robot.c0, robot.c1]
            assert (row["bumped"], row["refused"], row["state"] or "") == (robot.bumped, robot.refused, robot.state)
            assert (row["goal_x_m"], row["goal_y_m"]) == (robot.goal or (None, None))
            assert row["decision_ms"] == robot.decision_ms
            sizes = [len(frame) for source, frame in record.frames if source == robot.number]
            assert (row["frames"], row["frame_bytes"]) == (len(sizes), sum(sizes))
    assert next(rows, None) is None


def test_ticks_are_those_of_the_journal_row_by_row(seen: Seen, tables: dict[str, pd.DataFrame]) -> None:
    run = seen.open()
    points = np.count_nonzero(run.prepared.patrolled)
    for record, (_, row) in zip(run.journal.ticks, tables["ticks"].iterrows(), strict=True):
        standing = Counter(robot.status.name for robot in record.robots)
        counts = [standing[name] for name in ("ALIVE", "PAUSED", "DEAD", "LOST")]
        assert row[["alive", "paused", "dead", "lost", "away"]].tolist() == [*counts, len(record.robots) - sum(counts)]
        assert row.collisions == sum(robot.bumped for robot in record.robots)
        figures = (record.k, record.k * run.step, record.mfow * run.step, record.fog_mean * run.step)
        assert tuple(row[["tick", "time_s", "mfow_s", "fog_mean_s"]]) == pytest.approx(figures, **ROUNDED)
        assert row.seen_share == pytest.approx(record.seen / points, **ROUNDED)


def test_the_ground_has_each_patrolled_point_where_it_lies(seen: Seen, tables: dict[str, pd.DataFrame]) -> None:
    run, ground = seen.open(), tables["ground"]
    patrolled, terrain = run.prepared.patrolled, run.prepared.terrain
    assert [tuple(cell) for cell in np.argwhere(patrolled).tolist()] == list(zip(ground.row, ground.col, strict=True))
    centres = [terrain.centre(int(row), int(col)) for row, col in zip(ground.row[::97], ground.col[::97], strict=True)]
    assert np.allclose(ground[["x_m", "y_m"]][::97], centres, rtol=0, atol=1e-9)
    assert (ground.age_mean_s <= ground.age_max_s).all()
    assert (ground.age_end_s <= ground.age_max_s).all()


def test_visits_lie_at_their_vertices(seen: Seen, tables: dict[str, pd.DataFrame]) -> None:
    run, visits = seen.open(), tables["visits"]
    last: dict[int, float] = {}
    for _, row in visits.iterrows():
        assert [row.x_m, row.y_m] == GRAPH["vertices"][row.vertex]
        assert row.time_s == row.tick * run.step
        assert row["first"] == (row.vertex not in last)
        assert 0 < row.idle_s <= row.time_s - last.get(row.vertex, 0.0)  # it may have stayed
        last[row.vertex] = row.time_s


def test_events_are_those_of_the_journal(seen: Seen, tables: dict[str, pd.DataFrame]) -> None:
    run = seen.open()
    assert tables["events"].kind.tolist() == [event.kind for event in run.events]
    assert tables["events"].tick.tolist() == [event.k for event in run.events]
    assert tables["events"].detail.tolist() == [event.detail for event in run.events]
    assert tables["events"].time_s.tolist() == [event.k * run.step for event in run.events]
    assert Counter(tables["events"].robot.dropna()) == Counter(
        run.journal.header.robots[event.robot - 1].name for event in run.events if event.robot
    )


def test_schemas_name_the_run_and_the_units(faulty: Seen, tmp_path: Path) -> None:
    run = faulty.open()
    for file in write_tables(run, tmp_path, "parquet"):
        schema = pq.read_schema(file)
        declared = TABLES[file.stem]
        assert schema.names == [column.name for column in declared.columns]
        assert schema.metadata[b"trace_hash"].decode() == run.trace
        assert schema.metadata[b"scenario_hash"].decode() == run.journal.header.scenario_hash
        for column in declared.columns:
            metadata = schema.field(column.name).metadata
            assert metadata[b"unit"].decode() == column.unit
            assert metadata[b"meaning"].decode() == column.meaning
            ending = {"m/s": "_m_s", "rad/s": "_rad_s", "1/m": "_1_m", "byte": "_bytes"}.get(column.unit, column.unit)
            assert column.name.endswith(ending)


def test_csv_files_have_the_same_values(faulty: Seen, tmp_path: Path) -> None:
    run = faulty.open()
    for file in write_tables(run, tmp_path, "csv"):
        whole = arrow_table(run, file.stem).to_pandas()
        read = pd.read_csv(file, keep_default_na=False, na_values=[""])
        pd.testing.assert_frame_equal(read, whole, check_dtype=False, check_exact=True)


def test_pieces_make_the_same_table(faulty: Seen, monkeypatch: pytest.MonkeyPatch) -> None:
    run = faulty.open()
    whole = {name: arrow_table(run, name) for name in TABLES}
    monkeypatch.setattr(arrow, "BATCH_ROWS", 7)
    shares: list[float] = []
    pieces: dict[str, list[pa.RecordBatch]] = {name: [] for name in TABLES}
    for name, batch in batches(run, list(TABLES), shares.append):
        pieces[name].append(batch)
    assert len(pieces["links"]) > 10
    for name, some in pieces.items():
        assert pa.Table.from_batches(some).equals(whole[name])
    assert shares == sorted(shares)
    assert shares[-1] == pytest.approx(1.0)


def test_refused_frames_count_from_zero_after_a_restart(quiet: Seen, tmp_path: Path) -> None:
    """The first process has refused seven frames at its last report, the second one three."""
    reports = {10: 4, 20: 7, 40: 2, 50: 3}

    def refusing(record: TickRecord) -> TickRecord:
        first, *others = record.robots
        return replace(record, robots=(replace(first, rejected=reports.get(record.k)), *others))

    run = open_run(rewritten(quiet, tmp_path / "restarted", refusing))
    robots = arrow_table(run, "robots").to_pandas()
    refused = robots[(robots.robot == "r1") & (robots.rejected > 0)]
    assert dict(zip(refused.tick, refused.rejected, strict=True)) == {10: 4, 20: 3, 40: 2, 50: 1}
    assert refused.rejected.sum() == run.figures.robots["r1"].rejected == 10


def test_a_link_has_a_row_for_each_cause_and_its_frames_count_once(quiet: Seen, tmp_path: Path) -> None:
    """In one tick what robot 1 sent is lost for two causes; in the next it sends nothing, and older frames are lost.

    In the third, two older frames are lost, and that of the tick arrives.
    """
    lost = {10: ["loss:f1", "range", "loss:f1"], 11: ["range", "wall"], 12: ["range", "wall"]}

    def losing(record: TickRecord) -> TickRecord:
        causes = lost.get(record.k)
        if causes is None:
            return record
        deliveries = tuple(one for one in record.deliveries if one[0] != 1 or record.k == 12)
        frames = tuple(one for one in record.frames if one[0] != 1) if record.k == 11 else record.frames
        dropped = tuple((1, 2, number, cause) for number, cause in enumerate(causes))
        return replace(record, frames=frames, deliveries=deliveries, dropped=dropped)

    run = open_run(rewritten(quiet, tmp_path / "lost", losing))
    links = arrow_table(run, "links").to_pandas()
    rows = links[(links.sender == "r1") & (links.receiver == "r2") & links.tick.isin(lost)]
    records = {record.k: record for record in read_journal(quiet.folder / "journal").ticks}
    sent = sum(source == 1 for source, _ in records[10].frames)
    columns = ["tick", "sent", "delivered", "dropped", "cause"]
    assert list(rows[columns].itertuples(index=False, name=None)) == [
        (10, sent, 0, 2, "loss:f1"),
        (10, 0, 0, 1, "range"),
        (11, 0, 0, 1, "range"),
        (11, 0, 0, 1, "wall"),
        (12, 1, 1, 1, "range"),
        (12, 0, 0, 1, "wall"),
    ]


def test_an_unknown_table_is_refused(quiet: Seen) -> None:
    with pytest.raises(BadInput, match="did you mean robots"):
        arrow_table(quiet.open(), "robot")


def test_a_run_that_is_being_written_gives_the_ticks_that_it_had(quiet: Seen, tmp_path: Path) -> None:
    content = (quiet.folder / "journal").read_bytes()
    (tmp_path / "scenario.yaml").write_bytes((quiet.folder / "scenario.yaml").read_bytes())
    (tmp_path / "journal").write_bytes(content[: len(content) // 2])
    run = open_run(tmp_path)
    (tmp_path / "journal").write_bytes(content)
    assert arrow_table(run, "ticks").num_rows == run.ticks
    assert arrow_table(run, "robots").num_rows == 3 * run.ticks < 3 * quiet.open().ticks


def test_an_interruption_leaves_the_old_files(quiet: Seen, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    run = quiet.open()
    before = {file: file.read_bytes() for file in write_tables(run, tmp_path, "parquet")}

    def interrupt(done: float) -> None:
        if done > 0.3:
            raise KeyboardInterrupt

    monkeypatch.setattr(arrow, "BATCH_ROWS", 50)  # so that parts of files are on the disk by then
    with pytest.raises(KeyboardInterrupt):
        write_tables(run, tmp_path, "parquet", share=interrupt)
    assert {file: file.read_bytes() for file in tmp_path.iterdir()} == before
    with pytest.raises(KeyboardInterrupt):
        write_tables(run, tmp_path / "new", "csv", share=interrupt)
    assert not list((tmp_path / "new").iterdir())


def test_a_folder_that_cannot_be_written_is_named(quiet: Seen, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("", encoding="utf-8")
    with pytest.raises(BadInput, match=r"file: tables cannot be written .*choose another folder"):
        write_tables(quiet.open(), tmp_path / "file", "csv")


def test_without_pyarrow_the_remedy_is_named(quiet: Seen, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    for call in (lambda: arrow_table(quiet.open(), "ticks"), lambda: write_tables(quiet.open(), tmp_path, "csv")):
        with pytest.raises(BadInput, match=r"pip install 'fogwatch\[tables\]'"):
            call()
