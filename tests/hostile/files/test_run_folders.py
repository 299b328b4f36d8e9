"""Run folders of strangers: a result, or one line."""

import os
import shutil
import sys
from argparse import Namespace
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import pytest

from experiments.sweeps.cases import write_text
from experiments.sweeps.results import FILE, open_results
from monitor.replay.run import open_run
from monitor.report.compare import names_of, rows_of
from patrol.scenario import dump_scenario, load_scenario
from tests.hostile.files.looks import MAP, looked_at, one_line
from tests.hostile.files.strange_files import add_event, rewrite_record, rewrite_summary
from tests.recordings import decoded


def _put(name: str, value: Any) -> Callable[[dict[str, Any]], None]:
    def change(record: dict[str, Any]) -> None:
        *way, last = name.split(".")
        node: Any = record
        for part in way:
            node = node[int(part) if isinstance(node, list) else part]
        node[int(last) if isinstance(node, list) else last] = value

    return change


def _write(path: Path, text: str) -> None:
    path.write_text(text, encoding="utf-8")


def _map_elsewhere(folder: Path, old: str, new: str) -> None:
    shutil.copytree(folder / "map", folder.parent, dirs_exist_ok=True)
    path = folder / "scenario.yaml"
    text = path.read_text(encoding="utf-8")
    assert old in text
    path.write_text(text.replace(old, new), encoding="utf-8")


def _image_elsewhere(folder: Path) -> None:
    shutil.copyfile(folder / "map" / "hall.pgm", folder.parent / "hall.pgm")
    (folder / "map" / "hall.yaml").write_text(MAP.replace("map.pgm", "../../hall.pgm"), encoding="utf-8")


def _linked(folder: Path, name: str) -> None:
    (folder / name).rename(folder.parent / Path(name).name)
    (folder / name).symlink_to(folder.parent / Path(name).name)


def _operator(detail: str) -> Callable[[Path], None]:
    return lambda folder: add_event(folder, kind="operator", detail=detail)


DEEP = '{"do":' * 100_000 + "1" + "}" * 100_000
ROWS: dict[str, Callable[[Path], None]] = {
    "k is text": lambda folder: rewrite_record(folder, "tick", _put("k", "0")),
    "k jumps": lambda folder: rewrite_record(folder, "tick", _put("k", 2**31)),
    "mfow is huge": lambda folder: rewrite_record(folder, "tick", _put("mfow", 2**64 - 1)),
    "fog is NaN": lambda folder: rewrite_record(folder, "tick", _put("fog_mean", float("nan"))),
    "x is NaN": lambda folder: rewrite_record(folder, "tick", _put("robots.0.2", float("nan"))),
    "x is infinite": lambda folder: rewrite_record(folder, "tick", _put("robots.0.2", float("inf"))),
    "x is far": lambda folder: rewrite_record(folder, "tick", _put("robots.0.2", 1e300)),
    "x is text": lambda folder: rewrite_record(folder, "tick", _put("robots.0.2", "1")),
    "a goal is NaN": lambda folder: rewrite_record(folder, "tick", _put("robots.0.9", [float("nan"), 0.0])),
    "a status is unknown": lambda folder: rewrite_record(folder, "tick", _put("robots.0.1", 9)),
    "a robot is unknown": lambda folder: rewrite_record(folder, "tick", _put("robots.0.0", 77)),
    "a robot is missing": lambda folder: rewrite_record(folder, "tick", _put("robots", [])),
    "a frame is text": lambda folder: rewrite_record(folder, "tick", _put("frames", [[1, "x"]])),
    "a drop of a stranger": lambda folder: rewrite_record(folder, "tick", _put("dropped", [[77, 0, "dead", [1]]])),
    "a delivery to text": lambda folder: rewrite_record(folder, "tick", _put("delivered", [[1, 0, "", ["1"]]])),
    "an event in time without end": lambda folder: add_event(folder, k=2**31),
    "an event is a list": lambda folder: add_event(folder, kind=["fault"]),
    "an event of nobody": lambda folder: add_event(folder, robot="r1"),
    "an operator's JSON is deep": _operator(DEEP),
    "an operator says nothing": _operator("x"),
    "an operator is late": _operator('{"do":"fault","fault":{"kind":"loss","rate":0.1,"at":1e300}}'),
    "the header has no robots": lambda folder: rewrite_record(folder, "header", _put("robots", [])),
    "the header's terrain is huge": lambda folder: rewrite_record(folder, "header", _put("terrain.width", 2**40)),
    "the header's point is NaN": lambda folder: rewrite_record(folder, "header", _put("terrain.point", float("nan"))),
    "the header's bound is text": lambda folder: rewrite_record(folder, "header", _put("bound_s", "x")),
    "the header's body is unknown": lambda folder: rewrite_record(folder, "header", _put("robots.0.model", "tank")),
    "the header's scenario is bytes": lambda folder: rewrite_record(folder, "header", _put("scenario.name", b"x")),
    "the end's reason is a list": lambda folder: rewrite_record(folder, "end", _put("reason", [1])),
    "the end's notes are text": lambda folder: rewrite_record(folder, "end", _put("notes", "x")),
    "the summary is a list": lambda folder: rewrite_summary(folder, lambda _: [1]),
    "its checks are texts": lambda folder: rewrite_summary(folder, _put("verdict.checks", ["x"])),
    "its place is text": lambda folder: rewrite_summary(folder, _put("stalest.worst.x", "x")),
    "its age is NaN": lambda folder: rewrite_summary(folder, _put("stalest.worst.age_s", float("nan"))),
    "its faults are a list": lambda folder: rewrite_summary(folder, _put("faults", [1])),
    "its warnings are numbers": lambda folder: rewrite_summary(folder, _put("verdict.warnings", [1])),
    "the summary holds half of a character": lambda folder: rewrite_summary(folder, _put("verdict.outcome", "\ud800")),
    "a key of it is half of one": lambda folder: rewrite_summary(folder, _put("\ud800", 1)),
    "an operator asks with half of one": _operator('{"do":"fault","fault":{"kind":"\\ud800"}}'),
    "the scenario holds half of one": lambda folder: _write(
        folder / "scenario.yaml", 'terrain: {builtin: open}\nfaults: [{kind: "\\ud800"}]'
    ),
    "the summary is deep": lambda folder: _write(folder / "summary.json", "[" * 200_000),
    "the scenario is another": lambda folder: _write(folder / "scenario.yaml", "terrain: {builtin: open}"),
    "the map is elsewhere": lambda folder: _map_elsewhere(folder, "map/hall.yaml", "../hall.yaml"),
    "the image is elsewhere": _image_elsewhere,
    "the map is a link": lambda folder: _linked(folder, "map/hall.yaml"),
    "the journal is a link": lambda folder: _linked(folder, "journal"),
}


def test_the_honest_run_is_looked_at(strange: Path, fogwatch: Callable[..., int]) -> None:
    """Or the rows below would show nothing."""
    looked_at(strange)
    assert fogwatch("report", str(strange)) == 0
    assert decoded(strange / "recording.mcap")["/mfow"]


@pytest.mark.parametrize("row", ROWS)
def test_a_strange_run_folder_gives_one_line(
    row: str, strange: Path, fogwatch: Callable[..., int], capsys: pytest.CaptureFixture[str]
) -> None:
    ROWS[row](strange)
    for command in (["report", str(strange)], ["compare", str(strange), str(strange)], ["record", str(strange)]):
        capsys.readouterr()
        assert fogwatch(*command) == 2
        told = capsys.readouterr().err.splitlines()
        assert len(told) == 1
        assert told[0].startswith("fogwatch: ")
        assert told[0].isprintable()
    from monitor.process import source_opener
    from runtime.process.lifeline import Ending

    one_line(source_opener(Namespace(replay=[strange], key=None), Ending()))


def _opened_by_looks(folder: Path) -> list[str]:
    """Return what is opened where the folder is looked at.

    It runs in a process of its own: an audit hook cannot be removed, and what interrupts it gets lost.
    """
    opened: list[str] = []

    def note(event: str, arguments: tuple[Any, ...]) -> None:
        if event == "open":
            opened.append(os.fspath(arguments[0]) if isinstance(arguments[0], str | Path) else str(arguments[0]))

    sys.addaudithook(note)
    looked_at(folder)
    return list(opened)


def test_what_a_strange_scenario_names_is_not_opened(strange: Path, tmp_path: Path) -> None:
    """A key, a policy and a map of a stranger's scenario are paths on the victim's machine."""
    key, policy = tmp_path / "fleet.key", tmp_path / "mine.py"
    key.write_bytes(b"k" * 32)
    policy.write_text("", encoding="utf-8")
    path = strange / "scenario.yaml"
    named = {"radio.key": str(key), "patrol.policy": f"{policy}:Mine"}
    path.write_text(dump_scenario(load_scenario(path, named, opens_classes=False)), encoding="utf-8")
    with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as others:
        opened = others.submit(_opened_by_looks, strange).result()
    assert [name for name in opened if name.endswith("/journal")]
    assert not {str(key), str(policy)} & set(opened)
    assert open_run(strange, key).key == b"k" * 32
    assert open_run(strange).keyless


def test_escape_sequences_do_not_reach_the_terminal(
    strange: Path, fogwatch: Callable[..., int], capsys: pytest.CaptureFixture[str]
) -> None:
    rewrite_record(strange, "end", _put("reason", "\x1b]0;owned\x07\u202e"))
    rewrite_summary(strange, _put("verdict.outcome", "\x1b[1A"))
    other = strange.rename(strange.with_name("\x1b[31mrun"))
    assert fogwatch("record", str(other), "--out", "again.mcap") == 0
    assert fogwatch("report", str(other / "\x1b[2J")) == 2
    said = "".join(capsys.readouterr())
    assert r"\x1b]0;owned\x07\u202e" in said
    assert not {"\x1b", "\x07", "\u202e"} & set(said)
    runs = [open_run(other)] * 2
    cells = [*names_of(runs), *(cell for row in rows_of(runs) for cell in row)]
    assert r"\x1b[1A" in cells
    assert not {"\x1b", "\x07", "\u202e"} & set("".join(cells))


def test_a_journal_that_was_cut_off_anywhere_is_read(strange: Path) -> None:
    """A folder that a kill leaves is no attack."""
    whole = (strange / "journal").read_bytes()
    (strange / "summary.json").write_text('{"verdict": {"val', encoding="utf-8")
    for length in (len(whole) - 1, len(whole) * 2 // 3, len(whole) // 2):
        (strange / "journal").write_bytes(whole[:length])
        run = open_run(strange)
        assert run.ticks > 0
        assert run.ended is None
        assert run.summary is None


def test_nothing_is_written_through_a_link_of_a_strange_folder(
    strange: Path, tmp_path: Path, fogwatch: Callable[..., int]
) -> None:
    """Whoever made the folder knows which files a command writes into it."""
    victim = tmp_path / "victim"
    victim.write_text("mine", encoding="utf-8")
    for name in ("report.html", "recording.mcap"):
        (strange / name).unlink(missing_ok=True)
        for link in (name, f"{name}.part", f".{name}.part"):
            (strange / link).symlink_to(victim)
    assert fogwatch("report", str(strange)) == 0
    assert fogwatch("record", str(strange)) == 0
    assert victim.read_text(encoding="utf-8") == "mine"
    assert (strange / "report.html").read_bytes().startswith(b"<!")
    assert not (strange / "recording.mcap").is_symlink()


@pytest.mark.parametrize("there", [True, False])
def test_no_file_is_cut_or_made_through_a_link_of_a_strange_sweep(there: bool, tmp_path: Path) -> None:
    """The last line of results is cut off where it is not whole."""
    victim, folder = tmp_path / "victim", tmp_path / "sweep"
    folder.mkdir()
    if there:
        victim.write_text("a line without an end", encoding="utf-8")
    (folder / FILE).symlink_to(victim)

    def opened() -> None:
        with open_results(folder):
            pass

    assert one_line(opened) == f"{folder / FILE}: is a link; put the file itself there, or choose another --out"
    assert victim.exists() == there
    assert not there or victim.read_text(encoding="utf-8") == "a line without an end"
    (folder / "summary.csv").symlink_to(victim)
    write_text(folder / "summary.csv", "new")
    assert not there or victim.read_text(encoding="utf-8") == "a line without an end"
    assert not (folder / "summary.csv").is_symlink()
