"""Only regular files of a bearable size are read, and none takes much memory."""

import json
import os
import shutil
import struct
import subprocess
import sys
import zlib
from collections.abc import Callable
from functools import partial
from pathlib import Path

import msgpack
import pytest

from experiments.sweeps.plan import read_plan
from experiments.sweeps.results import FILE, open_results
from fogwatch.grounds.bags import extract_map
from monitor.replay.run import open_run
from patrol.classes.class_file import file_digest
from patrol.errors import BadInput
from patrol.maps.load import load_terrain, read_terrain
from patrol.maps.map_file import map_meaning
from patrol.scenario import load_scenario, open_scenario
from runtime.security.access import read_access
from runtime.security.private_files import fleet_key
from tests.hostile.files.looks import MAP, looked_at, one_line
from tests.hostile.files.strange_files import journal_of, records_of

PATIENCE_S = 300.0
"""How long anything may take, on a machine with much else to do."""

LITTLE = 300 << 20
"""Bytes that a hostile file may take beyond an honest one."""


def special(kind: str, folder: Path) -> Path:
    """Something that is no regular file of a bearable size."""
    path = folder / kind
    match kind:
        case "fifo":
            os.mkfifo(path)
        case "zero":
            path = Path("/dev/zero")
        case "huge":
            with path.open("wb") as file:
                file.truncate(1 << 36)
        case "loop":
            path.symlink_to(path)
        case "link":
            path.symlink_to("/dev/zero")
    return path


def map_of(image: Path) -> Path:
    path = Path("map.yaml").absolute()
    path.write_text(MAP.replace("map.pgm", str(image)), encoding="utf-8")
    return path


def folder_of(path: Path, name: str) -> Path:
    """The run folder in the current folder, with that path in the place of one of its files."""
    file = Path("run", name).absolute()
    file.unlink(missing_ok=True)
    if path.is_fifo() or path.is_file():
        path.rename(file)
    else:
        file.symlink_to(path)
    return file.parent


def results_of(path: Path) -> None:
    with open_results(folder_of(path, FILE)):
        pass


READERS: dict[str, Callable[[Path], object]] = {
    "scenario": load_scenario,
    "scenario or map": lambda path: open_scenario(str(path)),
    "map": lambda path: read_terrain(path, 1.0),
    "image": lambda path: read_terrain(map_of(path), 1.0),
    "map's hash": lambda path: map_meaning(map_of(path)),
    "key": fleet_key,
    "access": lambda path: read_access(path, "--access"),
    "policy": lambda path: file_digest(path, "patrol.policy"),
    "sweep": read_plan,
    "journal": lambda path: open_run(folder_of(path, "journal")),
    "run's scenario": lambda path: open_run(folder_of(path, "scenario.yaml")),
    "run's summary": lambda path: open_run(folder_of(path, "summary.json")),
    "bag": lambda path: extract_map(path, Path("maps")),
    "results": results_of,
}


@pytest.mark.parametrize("kind", ["fifo", "zero", "huge", "loop", "link"])
@pytest.mark.parametrize("reader", READERS)
def test_only_regular_files_of_a_bearable_size_are_read(
    reader: str, kind: str, strange: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A pipe would be waited for, a device has no end, and neither would end on SIGTERM."""
    monkeypatch.chdir(strange.parent)
    if reader == "journal" and kind == "huge":
        pytest.skip("read piece by piece, whatever its size")
    one_line(lambda: READERS[reader](special(kind, tmp_path)))


def test_a_key_that_is_a_pipe_is_named(tmp_path: Path) -> None:
    said = one_line(lambda: fleet_key(special("fifo", tmp_path)))
    why = "is a named pipe; give a regular file; name a readable key file"
    assert said == f"radio.key: cannot read {tmp_path}/fifo: {why}"


def bombs(folder: Path) -> dict[str, Callable[[], object]]:
    """Calls, by name, that meet a small file, or one of a bearable size, that stands for much."""

    def scenario(name: str, text: str) -> Callable[[], object]:
        path = folder / f"{name}.yaml"
        path.write_text(text, encoding="utf-8")
        return partial(load_scenario, path)

    levels = "".join(f"a{n}: &a{n} [{f'*a{n - 1},' * 9}]\n" for n in range(1, 40))
    merges = "".join(f"m{n}: &m{n} {{<<: [{f'*m{n - 1},' * 9}], k{n}: 1}}\n" for n in range(1, 20))
    corners = ",".join(f"[{n % 1000}, {n // 1000}]" for n in range(300_000))
    yards = "terrain: {builtin: yards}\n"

    def image(name: str, head: bytes, resolution: float = 0.5) -> Callable[[], object]:
        path = folder / f"{name}.map.yaml"
        (folder / name).write_bytes(head)
        text = MAP.replace("map.pgm", name).replace("0.5", str(resolution), 1)
        path.write_text(text, encoding="utf-8")
        return partial(read_terrain, path, 0.1)

    def png(side: int) -> bytes:
        def chunk(kind: bytes, data: bytes) -> bytes:
            return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

        body = chunk(b"IHDR", struct.pack(">IIBBBBB", side, side, 8, 0, 0, 0, 0))
        return b"\x89PNG\r\n\x1a\n" + body + chunk(b"IDAT", zlib.compress(b"\0" * (1 << 20))) + chunk(b"IEND", b"")

    return {
        "merge": scenario("merge", f"m0: &m0 {{k: 1}}\n{merges}{yards}"),
        "alias": scenario("alias", f"a0: &a0 [1, 2]\n{levels}{yards}"),
        "deep": scenario("deep", "a: " + "[" * 100_000),
        "wide": scenario("wide", f"{yards}name: [{'1,' * 600_000}]"),
        "corners": scenario("corners", f"terrain: {{builtin: yards, keep_out: [[{corners}]]}}"),
        "fewer corners": scenario("fewer", f"terrain: {{builtin: yards, keep_out: [[{corners[:60_000]}1]]]}}"),
        "polygons": scenario("polygons", f"terrain: {{builtin: yards, keep_out: [{'[[0,0],[1,0],[1,1]],' * 2000}]}}"),
        "robots": scenario("robots", f"{yards}robots: {{count: 1000000000}}"),
        "hex seed": scenario("seed", f"{yards}seed: 0x{'f' * 5000}"),
        "long text": scenario("text", f"{yards}name: {'x' * 1_000_000}"),
        "tiny points": lambda: load_terrain(load_scenario({"terrain": {"builtin": "site"}}).terrain, 1e-9, Path("/")),
        "pixels": image("wide.png", png(60_000)),
        "declared pixels": image("declared.png", png(9_999), 1e9),
        "text pixels": image("text.pgm", b"P2\n99999 99999\n255\n0 "),
    }


def strange_run_bombs(folder: Path) -> dict[str, Callable[[], object]]:
    """Calls that meet journals and a recording that stand for much."""
    honest = records_of((folder / "journal").read_bytes())
    tick = msgpack.unpackb(next(one for one in honest if one[1:11] == b"\xa4type\xa4tick"))

    def journal(name: str, *payloads: bytes) -> Callable[[], object]:
        made = Path(shutil.copytree(folder, folder.with_name(f"bomb-{name}")))
        (made / "journal").write_bytes(journal_of([honest[0], *payloads, *honest[1:]]))
        return lambda: list(open_run(made).journal.ticks)

    links = [[1, 0, "", b"\0" * 100]] * 3
    everybody = [[1, 0, "", [1] * 1_000_000]] * 4
    return {
        "empty lists": journal("lists", b"\x82\xa4type\xa4tick\xa1k\xdd\x00\x3f\xff\x00" + b"\x90" * 0x3FFF00),
        "empty maps": journal("maps", b"\x82\xa4type\xa5event\xa1k\xdd\x00\x3f\xff\x00" + b"\x80" * 0x3FFF00),
        "numbers": journal("numbers", b"\x82\xa4type\xa5event\xa1k\xdd\x00\x3f\xff\x00" + b"\xe0" * 0x3FFF00),
        "links": journal("links", msgpack.packb({**tick, "delivered": everybody})),
        "wrong links": journal("wrong", msgpack.packb({**tick, "delivered": links})),
        "8 MB": journal("long", b"\x82\xa4type\xa4tick\xa1k\xdd\x00\x80\x00\x00" + b"\x90" * 0x800000),
    }


def measured(folder: Path, honest: Path) -> None:
    """In a process of its own: meet each bomb after an honest run, and print how much memory more that took."""
    import resource

    resource.setrlimit(resource.RLIMIT_AS, (16 << 30, 16 << 30))
    looked_at(honest)
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    said = {}
    for name, call in {**bombs(folder), **strange_run_bombs(honest)}.items():
        made = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
        try:
            call()
            said[name] = "a value"
        except BadInput as error:
            said[name] = str(error)
        after = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
        said[name] = [said[name], (after - before) << 10, (after - made) << 10]  # type: ignore[assignment]
    print(json.dumps(said))


@pytest.mark.processes
def test_small_files_do_not_take_much_memory(strange: Path, tmp_path: Path) -> None:
    """None hangs, each is refused in one line, and none takes 300 MB more than an honest run."""
    (tmp_path / "bombs").mkdir()
    code = (
        "from pathlib import Path; from tests.hostile.files.test_what_is_opened import measured;"
        f"measured(Path({str(tmp_path / 'bombs')!r}), Path({str(strange)!r}))"
    )
    root = Path(__file__).resolve().parents[3]
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=root, capture_output=True, text=True, timeout=PATIENCE_S, check=False
    )
    assert done.returncode == 0, done.stderr
    said = json.loads(done.stdout)
    assert len(said) == 20
    for name, (text, above, _) in said.items():
        assert above < LITTLE, (name, said)
        assert text.isprintable(), name
        assert text != "a value" or name == "8 MB", name  # a record that is too long ends the journal
