"""The code of a class that runs is that of its digest, whatever else lies beside its file."""

import hashlib
import importlib.machinery
import importlib.util
import marshal
import pickle
import shutil
import sys
from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest
from numba import config

from agent.policies.found import POLICIES
from patrol.classes.named_class import ClassSort, NamedClass, find
from patrol.classes.static_check import announce
from patrol.errors import BadInput
from patrol.own_sensor import SENSORS
from ros2.sim.bodies import BODIES
from worldsim.radio.models import RADIO_MODELS

SORTS = [POLICIES, SENSORS, RADIO_MODELS, BODIES]


def named(sort: ClassSort, file: Path, sha256: str | None = None) -> NamedClass:
    return NamedClass(sort, f"{file}:Mine", sha256, {})


def plant(file: Path, source: str, *, checked: bool) -> None:
    """Plant byte code of another source, which Python's import system takes for that of the file."""
    code = marshal.dumps(compile(source, str(file), "exec"))
    if checked:
        facts = file.stat()
        stamp = int(facts.st_mtime).to_bytes(4, "little") + (facts.st_size & 0xFFFFFFFF).to_bytes(4, "little")
        head = (0).to_bytes(4, "little") + stamp
    else:
        head = (1).to_bytes(4, "little") + importlib.util.source_hash(file.read_bytes())
    cached = Path(importlib.util.cache_from_source(str(file)))
    cached.parent.mkdir(exist_ok=True)
    cached.write_bytes(importlib.util.MAGIC_NUMBER + head + code)


def import_plainly(file: Path) -> ModuleType:
    """Import a file as Python does."""
    spec = importlib.util.spec_from_file_location("plainly", file)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules["plainly"] = module
    try:
        spec.loader.exec_module(module)
    finally:
        del sys.modules["plainly"]
    return module


@pytest.mark.parametrize("checked", [False, True])
@pytest.mark.parametrize("sort", SORTS, ids=lambda sort: sort.noun)
def test_byte_code_beside_a_file_is_not_run(sort: ClassSort, checked: bool, tmp_path: Path) -> None:
    file = tmp_path / "mine.py"
    source = f"class Mine:\n    honest = True\n    def {sort.method}(self): pass\n# {tmp_path}"
    file.write_text(source, encoding="utf-8")
    plant(file, source.replace("True", "False"), checked=checked)
    assert not import_plainly(file).Mine.honest, "the byte code is not what Python would run"
    digest = hashlib.sha256(file.read_bytes()).hexdigest()
    found = find(named(sort, file, digest))
    assert found.__dict__["honest"]
    assert found.__module__.endswith(digest)
    shutil.rmtree(file.parent / "__pycache__")
    find(named(sort, file))
    assert [path.name for path in tmp_path.iterdir()] == ["mine.py"], "nothing is written beside the file"


@pytest.mark.parametrize("suffix", [importlib.machinery.EXTENSION_SUFFIXES[0], ".pyc"])
def test_only_source_is_run(suffix: str, tmp_path: Path) -> None:
    file = tmp_path / f"mine{suffix}"
    file.write_bytes(b"\x7fELF")
    with pytest.raises(BadInput, match=r"is no Python file; give \./file\.py:Class"):
        find(named(SENSORS, file))


def test_a_file_that_changes_while_it_is_read_is_run_as_it_was_hashed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file = tmp_path / "mine.py"
    honest = f"class Mine:\n    def visible(self): pass\n# {tmp_path}".encode()
    file.write_bytes(honest)
    reads = iter([honest])

    def read(*_: Any) -> bytes:
        return next(reads, b"raise SystemExit('ran')")

    monkeypatch.setattr("patrol.classes.class_file.read_untrusted", read)
    assert find(named(SENSORS, file, hashlib.sha256(honest).hexdigest())).__name__ == "Mine"


class Bomb:
    """A pickle that makes a file when it is read."""

    def __init__(self, mark: Path) -> None:
        self.mark = mark

    def __reduce__(self) -> tuple[Callable[..., Any], tuple[Any, ...]]:
        return Path.touch, (self.mark,)


def test_machine_code_beside_a_file_is_not_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """numba keeps compiled functions beside their file, in pickles that it does not compare with the source."""
    monkeypatch.delenv("NUMBA_CACHE_DIR", raising=False)
    monkeypatch.setattr(config, "CACHE_DIR", "")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    folder, mark = tmp_path / "run", tmp_path / "mark"
    folder.mkdir()
    file = folder / "mine.py"
    file.write_text(
        "import numba\n\n@numba.njit('int64(int64)', cache=True)\ndef twice(x):\n    return 2 * x\n\n"
        f"class Mine:\n    def visible(self): return twice(4)\n# {tmp_path}\n",
        encoding="utf-8",
    )
    assert import_plainly(file).twice(2) == 4
    planted = list((folder / "__pycache__").glob("*.nbi"))
    assert planted, "numba keeps nothing beside the file"
    for index in planted:
        index.write_bytes(pickle.dumps(Bomb(mark)))
    import_plainly(file)
    assert mark.exists(), "numba does not read the planted index"
    mark.unlink()

    for _ in range(2):
        found = find(named(SENSORS, file))
        assert found().visible() == 8
        del sys.modules[found.__module__]
    assert not mark.exists()
    assert len(list((tmp_path / "cache").rglob("*.nbi"))) == 1, "the user's cache has it"


def test_each_class_is_named_with_its_file_and_nothing_of_it_runs(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "mine\x1b.py"
    file.write_text("raise SystemExit('ran')", encoding="utf-8")
    installed = NamedClass(SENSORS, "examples.elliptic_sensor:Ellipse", None, {})
    built_in = NamedClass(POLICIES, "sebs", None, {})
    announce([named(POLICIES, file), built_in, installed])
    said = capsys.readouterr().err.splitlines()
    digest = hashlib.sha256(file.read_bytes()).hexdigest()[:12]
    assert said[0] == rf"fogwatch: runs code: patrol.policy = {tmp_path}/mine\x1b.py:Mine, SHA-256 {digest}"
    assert said[1].startswith("fogwatch: runs code: sensor.kind = examples.elliptic_sensor:Ellipse, imported from /")
    assert said[1].endswith("/examples/elliptic_sensor.py")  # no digest: Python may run byte code beside it
    assert len(said) == 2
    with pytest.raises(BadInput, match="cannot be read"):
        announce([named(POLICIES, file), named(SENSORS, tmp_path / "nowhere.py")])
    assert not capsys.readouterr().err
