import json
import os
import shutil
import signal
import stat
import subprocess
import sys
import time
from pathlib import Path

import pytest

from patrol.errors import BadInput
from patrol.kernel_cache import SHIPPED_FOR, cache_home, is_stored, make_folder, runs_shipped
from patrol.scenario import load_scenario
from runtime.starting.compiling import Compiled
from runtime.starting.warmup import COMPILING, SELDOM, WAITING, kernel_files, progress_line, seldom_kernels, warm

KERNELS = "from patrol.kernel_cache import keep_compiled\nkeep_compiled(__name__)\n"

KERNEL = """
from numba import njit

@njit("int64(int64)", cache=True)
def double(n):
    return 2 * n
"""

WARM = """
import sys
from runtime.starting.warmup import warm
said = []
warm(("toy",), said.append)
print(said)
"""

IMPORT = """
import toy.kernels.sums as sums
print([str(sums.double(21)), str(sum(sums.double.stats.cache_hits.values()))])
"""
MEANWHILE = """
import time
from runtime.starting.compiling import compiling_meanwhile
from runtime.starting.warmup import missing_kernels
with compiling_meanwhile(missing_kernels(("toy",))):
    while missing_kernels(("toy",)):
        time.sleep(0.05)
print([])
"""
PROGRESS = progress_line(Compiled(0, 0, None)).partition(":")[0] + ":"
COMPILED, LOADED = ["42", "0"], ["42", "1"]


@pytest.fixture
def toy(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A package with one kernel, and a cache of its own."""
    make_toy(tmp_path)
    monkeypatch.setenv("PYTHONPATH", python_path(tmp_path))
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "cache"))
    return tmp_path


def source_of(folder: Path) -> Path:
    return folder / "toy" / "kernels" / "sums.py"


def make_toy(folder: Path) -> None:
    kernels = folder / "toy" / "kernels"
    kernels.mkdir(parents=True)
    (folder / "toy" / "__init__.py").touch()
    (kernels / "__init__.py").write_text(KERNELS, encoding="utf-8")
    source_of(folder).write_text(KERNEL, encoding="utf-8")


def python_path(folder: Path) -> str:
    return os.pathsep.join([str(folder), os.environ.get("PYTHONPATH", "")]).rstrip(os.pathsep)


def start(code: str = WARM, **environment: str) -> subprocess.Popen[str]:
    command, pipe = [sys.executable, "-P", "-c", code], subprocess.PIPE
    return subprocess.Popen(command, stdout=pipe, stderr=pipe, text=True, env={**os.environ, **environment})


def said(process: subprocess.Popen[str]) -> list[str]:
    output, errors = process.communicate(timeout=600)
    assert process.returncode == 0, errors
    lines: list[str] = json.loads(output.replace("'", '"'))
    return [line for line in lines if not line.startswith(PROGRESS)]  # how many there are depends on the machine


def failed(process: subprocess.Popen[str]) -> str:
    _, errors = process.communicate(timeout=600)
    assert process.returncode != 0
    return errors


def entry_files(folder: Path) -> list[Path]:
    """The files of the one entry of a cache."""
    return sorted(path for path in (folder / "cache").rglob("*") if path.is_file() and path.name != "lock")


def test_every_kernel_of_ours_and_each_that_is_needed_seldom_is_found() -> None:
    found = kernel_files("patrol")
    assert "patrol.kernels.fog" in found
    assert all(path.is_file() for path in found.values())
    assert kernel_files("there_is_no_such_package") == {}
    packages = ("patrol", "agent", "worldsim", "monitor", "experiments")
    assert SELDOM.keys() <= {name for package in packages for name in kernel_files(package)}


@pytest.mark.parametrize(
    ("settings", "expected"),
    [
        ({}, set()),
        ({"terrain.builtin": "open"}, {"agent.kernels.dilate"}),
        ({"patrol.policy": "potential-field"}, {"agent.kernels.dilate", "agent.kernels.force"}),
        (
            {"patrol.policy": "potential-field", "patrol.options.paths": "regions"},
            {"agent.kernels.region_paths", "patrol.kernels.regions"},
        ),
        ({"patrol.policy": "potential-field", "patrol.options.paths": "straight"}, {"agent.kernels.straight"}),
        ({"patrol.policy": "learned"}, {"agent.kernels.surroundings"}),
    ],
)
def test_a_scenario_says_which_seldom_kernels_it_needs(settings: dict[str, object], expected: set[str]) -> None:
    scenario = load_scenario({"terrain": {"builtin": "yards"}}, settings)
    needed = set(seldom_kernels(scenario))
    assert expected <= needed
    assert bool(expected) == bool(needed)


RUN = """
import sys
from fogwatch.inprocess import run_in_process
from patrol.scenario import load_scenario
from runtime.starting.warmup import SELDOM, seldom_kernels
scenario = load_scenario({"terrain": {"builtin": "yards"}, "point": 0.5, "robots": {"count": 2}, "duration": 20})
run_in_process(scenario)
print(*sorted(SELDOM.keys() & sys.modules.keys() - set(seldom_kernels(scenario))))
"""


def test_a_default_run_loads_no_kernels_that_are_needed_seldom() -> None:
    run = subprocess.run([sys.executable, "-c", RUN], capture_output=True, text=True, check=True)
    assert run.stdout == "\n"


@pytest.mark.parametrize("module", ["fogwatch.api", "worldsim.process", "agent.own_robot", "monitor.process"])
def test_what_compiles_the_kernels_imports_none_before(module: str) -> None:
    code = f"import sys, {module}; print('numba' in sys.modules)"
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert run.stdout == "False\n"


def test_python_without_docstrings_has_entries_of_its_own(toy: Path) -> None:
    source_of(toy).write_text(KERNEL.replace("    return", '    """Return twice n."""\n    return'), encoding="utf-8")
    hits = [said(start(IMPORT, PYTHONOPTIMIZE=level)) for level in ("", "2", "", "2")]
    assert hits == [COMPILED, COMPILED, LOADED, LOADED]


def test_a_warm_machine_compiles_and_says_nothing() -> None:
    packages = ("patrol", "agent", "worldsim")
    warm(packages, lambda _line: None)
    lines: list[str] = []
    warm(packages, lines.append)
    assert lines == []


@pytest.mark.processes
def test_processes_that_start_together_compile_once(toy: Path) -> None:
    processes = [start() for _ in range(3)]
    lines = [said(process) for process in processes]
    assert sum(COMPILING in told for told in lines) == 1
    assert all(told in ([], [COMPILING], [WAITING]) for told in lines)
    assert said(start()) == []
    assert said(start(IMPORT)) == LOADED
    assert list((toy / "cache").rglob("sums.double-*.nbi"))


@pytest.mark.processes
def test_processes_that_import_a_kernel_together_store_it_once(toy: Path) -> None:
    answers = [said(process) for process in [start(IMPORT) for _ in range(3)]]
    assert sorted(answers) == sorted([COMPILED, LOADED, LOADED])
    assert len(entry_files(toy)) == 3  # numba's index and data, and the list of both


OVERTAKEN_KERNEL = f"""
import os, subprocess, sys
from pathlib import Path

if os.environ.pop("OVERTAKEN", None):
    next(Path(os.environ["NUMBA_CACHE_DIR"]).rglob("lock")).unlink()
    subprocess.run([sys.executable, "-P", "-c", "import toy.kernels.sums"], check=True)
{KERNEL}
"""


@pytest.mark.processes
def test_a_process_that_is_overtaken_where_somebody_has_deleted_its_lock_goes_on(toy: Path) -> None:
    source_of(toy).write_text(OVERTAKEN_KERNEL, encoding="utf-8")
    assert said(start(IMPORT, OVERTAKEN="1")) == COMPILED
    assert said(start(IMPORT)) == LOADED
    assert len(entry_files(toy)) == FILES_OF_AN_ENTRY


@pytest.mark.processes
def test_a_clone_elsewhere_finds_what_was_compiled(toy: Path) -> None:
    assert said(start(IMPORT)) == COMPILED
    make_toy(toy / "clone")
    os.utime(source_of(toy / "clone"), (1, 1))
    assert said(start(IMPORT, PYTHONPATH=python_path(toy / "clone"))) == LOADED
    assert said(start(PYTHONPATH=python_path(toy / "clone"))) == []


@pytest.mark.processes
def test_a_changed_source_and_other_settings_have_entries_of_their_own(toy: Path) -> None:
    assert said(start()) == [COMPILING]
    assert said(start(NUMBA_BOUNDSCHECK="1")) == [COMPILING]
    source_of(toy).write_text(f"{KERNEL}\n# changed\n", encoding="utf-8")
    assert said(start()) == [COMPILING]
    source_of(toy).write_text(KERNEL, encoding="utf-8")
    assert said(start()) == []
    assert said(start(NUMBA_BOUNDSCHECK="1")) == []


@pytest.mark.processes
def test_numbas_settings_in_the_working_folder_do_not_count(
    toy: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """They come with a folder that was received, and name a cache there; what lies in a cache is executed."""
    received = tmp_path / "received"
    received.mkdir()
    settings = "cache_dir: planted\ncache_locator_classes: UserProvidedCacheLocator\n"
    (received / ".numba_config.yaml").write_text(settings, encoding="utf-8")
    monkeypatch.chdir(received)
    monkeypatch.delenv("NUMBA_CACHE_DIR")
    monkeypatch.setenv("XDG_CACHE_HOME", str(toy / "cache"))
    plainly = (
        f"import sys; sys.path.insert(0, {str(source_of(toy).parent)!r}); import sums; sums.double(21); print('[]')"
    )
    assert said(start(plainly)) == []
    assert (received / "planted").is_dir(), "numba would not use that cache"
    shutil.rmtree(received / "planted")
    assert said(start(IMPORT)) == COMPILED
    assert not (received / "planted").exists()
    assert len(entry_files(toy)) == 3


SHIPPED = """
from pathlib import Path
import patrol.kernel_cache as kernel_cache
kernel_cache.SHIPPED = Path({folder!r})
"""
FOR_WHEELS = {"NUMBA_CPU_NAME": SHIPPED_FOR, "NUMBA_CPU_FEATURES": ""}


@pytest.mark.processes
@pytest.mark.skipif(not runs_shipped(), reason="this processor does not run what wheels for x86-64 hold")
def test_what_a_wheel_holds_is_loaded_and_nothing_is_stored(toy: Path) -> None:
    assert said(start(IMPORT, **FOR_WHEELS)) == COMPILED
    (toy / "cache" / "fogwatch").rename(toy / "shipped")
    warm_up, load = (SHIPPED.format(folder=str(toy / "shipped")) + code for code in (WARM, IMPORT))
    (toy / "cache").rmdir()
    (toy / "cache").touch()  # so that nothing could be stored
    assert said(start(warm_up)) == []
    assert said(start(load)) == LOADED
    (toy / "cache").unlink()
    (data,) = (toy / "shipped").rglob("*.nbc")
    data.write_bytes(data.read_bytes()[:-1])
    assert said(start(load)) == COMPILED


FILES_OF_AN_ENTRY = 3
DAMAGES = [
    pytest.param(damage, at, marks=() if at == place % FILES_OF_AN_ENTRY else pytest.mark.accept)
    for place, damage in enumerate(("truncated", "emptied", "changed", "lost"))
    for at in range(FILES_OF_AN_ENTRY)
]
"""CI damages one file in each way; `make accept` damages every file in each way."""


@pytest.mark.processes
@pytest.mark.parametrize(("damage", "at"), DAMAGES)
def test_a_damaged_file_is_noticed_and_made_again(toy: Path, damage: str, at: int) -> None:
    assert said(start(IMPORT)) == COMPILED
    file = entry_files(toy)[at]
    whole = file.read_bytes()
    if damage == "lost":
        file.unlink()
    else:
        half = len(whole) // 2
        changed = whole[:half] + bytes([whole[half] ^ 1]) + whole[half + 1 :]
        file.write_bytes({"truncated": whole[:half], "emptied": b"", "changed": changed}[damage])
    assert said(start(IMPORT)) == COMPILED, file.name
    assert said(start(IMPORT)) == LOADED, file.name
    assert len(entry_files(toy)) == FILES_OF_AN_ENTRY


@pytest.mark.processes
def test_a_process_that_is_killed_while_it_compiles_leaves_nothing_behind(toy: Path) -> None:
    source_of(toy).write_text(f"{KERNEL}\nimport os, signal\nos.kill(os.getpid(), signal.SIGKILL)\n", encoding="utf-8")
    process = start(IMPORT)
    process.communicate(timeout=600)
    assert process.returncode == -signal.SIGKILL
    assert list((toy / "cache").rglob(".making-*"))
    assert "sums.py ended with signal 9; run the command again" in failed(start()).splitlines()[-1]
    source_of(toy).write_text(KERNEL, encoding="utf-8")
    assert said(start()) == [COMPILING]
    assert said(start(IMPORT)) == LOADED
    assert not list((toy / "cache").rglob(".making-*"))


@pytest.mark.processes
def test_ctrl_c_ends_the_workers(toy: Path) -> None:
    begun = toy / "begun"
    wait = f"import os, time\nopen({str(begun)!r}, 'w').write(str(os.getpid()))\ntime.sleep(3600)\n"
    source_of(toy).write_text(f"{KERNEL}\n{wait}", encoding="utf-8")
    process = start()
    while not (begun.exists() and begun.read_text(encoding="utf-8")):
        assert process.poll() is None
        time.sleep(0.05)
    worker = int(begun.read_text(encoding="utf-8"))
    process.send_signal(signal.SIGINT)
    process.communicate(timeout=600)
    with pytest.raises(ProcessLookupError):
        os.kill(worker, 0)
    source_of(toy).write_text(KERNEL, encoding="utf-8")
    assert said(start()) == [COMPILING]


@pytest.mark.processes
@pytest.mark.usefixtures("toy")
def test_kernels_that_are_needed_later_are_compiled_meanwhile() -> None:
    assert said(start(MEANWHILE)) == []
    assert said(start(IMPORT)) == LOADED


@pytest.mark.processes
def test_a_kernel_that_cannot_be_compiled_is_named(toy: Path) -> None:
    source_of(toy).write_text(KERNEL.replace("2 * n", "n.missing"), encoding="utf-8")
    assert f"{source_of(toy)} cannot be compiled: TypingError" in failed(start())


@pytest.mark.processes
def test_entries_that_nobody_has_used_for_long_are_deleted(toy: Path) -> None:
    for source_text, days in ((f"{KERNEL}# 1\n", 100), (f"{KERNEL}# 2\n", 10)):
        before = {*(toy / "cache").rglob("files.json")}
        source_of(toy).write_text(source_text, encoding="utf-8")
        assert said(start(IMPORT)) == COMPILED
        (new,) = {*(toy / "cache").rglob("files.json")} - before
        long_ago = time.time() - days * 86400
        os.utime(new, (long_ago, long_ago))
    source_of(toy).write_text(f"{KERNEL}# 3\n", encoding="utf-8")
    assert said(start(IMPORT)) == COMPILED
    source_of(toy).write_text(f"{KERNEL}# 2\n", encoding="utf-8")
    assert said(start(IMPORT)) == LOADED
    assert len([*(toy / "cache").rglob("files.json")]) == 2
    assert all(time.time() - file.stat().st_mtime < 86400 for file in (toy / "cache").rglob("files.json"))


@pytest.mark.processes
@pytest.mark.parametrize("code", [WARM, IMPORT])
def test_where_nothing_can_be_stored_the_error_is_kind(toy: Path, code: str) -> None:
    (toy / "file").touch()
    errors = failed(start(code, NUMBA_CACHE_DIR=str(toy / "file")))
    assert "set NUMBA_CACHE_DIR to a folder" in errors.splitlines()[-1]


def test_the_cache_is_where_the_user_wants_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "given"))
    assert cache_home() == tmp_path / "given" / "fogwatch"
    monkeypatch.delenv("NUMBA_CACHE_DIR")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "user"))
    assert cache_home() == tmp_path / "user" / "fogwatch" / "kernels"
    monkeypatch.delenv("XDG_CACHE_HOME")
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    assert cache_home() == tmp_path / "home" / ".cache" / "fogwatch" / "kernels"

    def homeless(_path: Path) -> Path:
        raise RuntimeError("Could not determine home directory.")

    monkeypatch.setattr(Path, "expanduser", homeless)
    with pytest.raises(BadInput, match="NUMBA_CACHE_DIR"):
        is_stored("patrol.kernels.fog", kernel_files("patrol")["patrol.kernels.fog"])
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "given"))
    assert cache_home() == tmp_path / "given" / "fogwatch"


def test_the_progress_names_kernels_and_the_time_to_go() -> None:
    assert progress_line(Compiled(3, 40, None)) == "compiling the kernels: 3 of 40"
    assert progress_line(Compiled(20, 40, 12.4)) == "compiling the kernels: 20 of 40, about 12 s to go"


def test_a_cache_that_others_may_write_is_not_used(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    home = cache_home()
    home.mkdir()
    for mode in (0o755, 0o700):
        home.chmod(mode)
        assert cache_home() == home
    for mode in (0o775, 0o757):
        home.chmod(mode)
        with pytest.raises(BadInput, match="another user may have written them; delete that folder, or set NUMBA_CAC"):
            cache_home()


@pytest.mark.parametrize(("umask", "mode"), [(0o022, 0o755), (0o002, 0o700), (0o000, 0o700), (0o077, 0o700)])
def test_nobody_else_can_write_to_a_new_cache(tmp_path: Path, umask: int, mode: int) -> None:
    before = os.umask(umask)
    try:
        make_folder(tmp_path / "user" / "cache")
        make_folder(tmp_path / "user" / "cache")
        assert os.umask(umask) == umask
    finally:
        os.umask(before)
    assert stat.S_IMODE((tmp_path / "user" / "cache").stat().st_mode) == mode


@pytest.mark.processes
def test_another_source_of_the_same_size_and_time_is_not_taken_for_the_first(toy: Path) -> None:
    os.utime(source_of(toy), (1, 1))
    assert said(start(IMPORT, PYTHONDONTWRITEBYTECODE="")) == COMPILED
    source_of(toy).write_text(KERNEL.replace("2 * n", "3 * n"), encoding="utf-8")
    os.utime(source_of(toy), (1, 1))
    assert said(start(IMPORT, PYTHONDONTWRITEBYTECODE="")) == ["63", "0"]
