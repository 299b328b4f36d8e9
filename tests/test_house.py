"""The rules of the house that no single module can hold by itself."""

from __future__ import annotations

import ast
import json
import os
import re
import shutil
import subprocess
import sys
import tomllib
import zipfile
from collections.abc import Iterator
from importlib import metadata
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

from tests.conftest import KINDS

ROOT = Path(__file__).resolve().parents[1]
PACKAGES = ("patrol", "runtime", "agent", "worldsim", "monitor", "ros2", "fogwatch", "experiments")
OUTSIDE = ("bench", "tests")
"""Folders of Python that stay in a clone."""
LONGEST_FILE = 600

# A folder of one machine, such as a home; and the hosts that serve Python packages.
MACHINE_PATH = re.compile(r"(?<![\w.~$}-])/(?:work|root|home/\w[\w.-]*|Users/\w[\w.-]*)/")
REGISTRY_HOST = re.compile(r"(?:pypi|pythonhosted|anaconda)\.(?:org|com)\b|--(?:extra-)?index-url|--find-links")


def files_of_ours() -> list[Path]:
    """Every file that git tracks or would track."""
    command = ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"]
    listed = subprocess.run(command, cwd=ROOT, check=True, capture_output=True).stdout.decode()
    return [path for name in sorted(listed.split("\0")) if name and (path := ROOT / name).is_file()]


def python_files() -> list[Path]:
    return [path for path in files_of_ours() if path.suffix == ".py"]


def imports(path: Path) -> Iterator[str]:
    """Absolute names of the modules that a file imports, wherever it imports them."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module is not None:
            yield node.module


CHECKERS = {
    "style": ["ruff", "check", "--quiet", "."],
    "format": ["ruff", "format", "--check", "--quiet", "--diff", "."],
    "types": ["mypy", "--no-error-summary"],
    "layers": ["lint-imports", "--no-cache"],
    "prose": ["python", "-m", "tests.prose"],
}


@pytest.mark.parametrize("name", CHECKERS)
def test_the_checkers_find_nothing(name: str) -> None:
    if name == "types" and sys.version_info[:2] != (3, 11):
        pytest.skip("types are checked with Python 3.11 alone: newer ones have a NumPy whose types differ")
    program, *arguments = CHECKERS[name]
    command = [str(Path(sys.executable).with_name(program)), *arguments]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, f"{done.stdout}\n{done.stderr}"


def test_the_quick_suite_has_one_real_fleet_of_each_kind() -> None:
    marked = [
        name
        for path in (ROOT / "tests").rglob("test_*.py")
        for name in re.findall(r'mark\.kind\("([^"]+)"\)', path.read_text(encoding="utf-8"))
    ]
    assert sorted(marked) == sorted(KINDS)


def test_the_makefile_names_tests_that_exist() -> None:
    asked = subprocess.run(["make", "-n", "test-bounds-quick"], cwd=ROOT, capture_output=True, text=True, check=True)
    named = re.findall(r"tests/[\w./]+", asked.stdout)
    assert "tests/agent/routes" in named
    assert not [name for name in named if not (ROOT / name).exists()]


def test_the_slow_tests_that_are_listed_exist() -> None:
    listed = [line.split("\t")[1] for line in (ROOT / "tests/times.tsv").read_text(encoding="utf-8").splitlines()]
    tests = {
        (str(path.relative_to(ROOT)), name)
        for path in (ROOT / "tests").rglob("test_*.py")
        for name in re.findall(r"^ *def (test_\w+)", path.read_text(encoding="utf-8"), re.MULTILINE)
    }
    named = {(name.partition("::")[0], name.rpartition("::")[2].partition("[")[0]) for name in listed}
    assert named <= tests, named - tests


def test_files_are_short() -> None:
    lengths = {path.relative_to(ROOT): len(path.read_bytes().splitlines()) for path in python_files()}
    assert not {path: lines for path, lines in lengths.items() if lines > LONGEST_FILE}


SECTION = re.compile(r"^(?:Args|Attributes|Raises|Returns|Yields):$", re.MULTILINE)


def names_listed(path: Path) -> bool:
    """Return whether a module lists its public names in ``__all__``."""
    return "\n__all__ = " in path.read_text(encoding="utf-8")


def test_docstrings_have_sections_where_outsiders_call_and_only_there() -> None:
    """That is in modules, or packages, that list their public names, and in kernels."""
    strays = {
        f"{path.relative_to(ROOT)}: {node.name}"
        for path in python_files()
        if path.relative_to(ROOT).parts[0] in PACKAGES and path.parent.name != "kernels"
        if not names_listed(path) and not (path.parent.parent != ROOT and names_listed(path.with_name("__init__.py")))
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef)
        if SECTION.search(ast.get_docstring(node) or "")
    }
    assert not strays


def test_no_package_imports_what_is_not_installed() -> None:
    strays = {
        f"{path.relative_to(ROOT)}: {name}"
        for path in python_files()
        if path.relative_to(ROOT).parts[0] in PACKAGES
        for name in imports(path)
        if name.partition(".")[0] in OUTSIDE
    }
    assert not strays


def test_kernels_import_only_numpy_and_numba() -> None:
    allowed = {"__future__", "collections", "heapq", "math", "numba", "numpy", "typing"}
    strangers = {
        f"{path.relative_to(ROOT)}: {name}"
        for path in python_files()
        if path.parent.name == "kernels"
        for name in imports(path)
        if path.name != "__init__.py" or name != "patrol.kernel_cache"
        if name.partition(".")[0] not in allowed or name == "numpy.random"
    }
    assert not strangers


PURE_FILES = ("worldsim/robots/bodies.py", "agent/bodies/steering.py", "worldsim/checks/bodies.py")
"""Pure files whose names, or whose folders' names, occur beside processes too."""


def test_the_layers_know_the_pure_core_by_path(tmp_path: Path) -> None:
    """A clock in a pure file is reported, and so is an exemption that nothing needs."""
    for package in PACKAGES:
        ignored = shutil.ignore_patterns("__pycache__", "static")
        shutil.copytree(ROOT / package, tmp_path / package, ignore=ignored)
    for name in PURE_FILES:
        file = tmp_path / name
        file.write_text(file.read_text(encoding="utf-8") + "\nimport time\n", encoding="utf-8")
    (tmp_path / "worldsim" / "wiring.py").write_text('"""Without a clock."""\n', encoding="utf-8")
    (tmp_path / "pyproject.toml").write_bytes((ROOT / "pyproject.toml").read_bytes())
    linter = str(Path(sys.executable).with_name("lint-imports"))
    environment = {**os.environ, "PYTHONPATH": str(tmp_path), "COLUMNS": "200"}

    def report() -> str:
        command = [linter, "--no-cache", "--contract", "pure"]
        done = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True, check=False)
        assert done.returncode == 1, done.stderr
        return done.stdout

    first = report()
    assert "worldsim.wiring -> time" in first
    (tmp_path / "worldsim" / "wiring.py").write_bytes((ROOT / "worldsim" / "wiring.py").read_bytes())
    second = report()
    assert "worldsim.wiring" not in second
    for name in PURE_FILES:
        assert f"{name.removesuffix('.py').replace('/', '.')} -> time" in second


def test_no_file_names_a_machine_path_or_a_registry() -> None:
    found = []
    for path in files_of_ours():
        try:
            text = path.read_text(encoding="utf-8")
        except UnicodeDecodeError:
            continue  # an image
        for number, line in enumerate(text.splitlines(), start=1):
            if path != Path(__file__) and (MACHINE_PATH.search(line) or REGISTRY_HOST.search(line)):
                found.append(f"{path.relative_to(ROOT)}:{number}: {line.strip()}")
    assert not found


def test_documents_name_files_that_exist() -> None:
    """A name without its folder, or with a part of it, stands for a file that ends with it."""
    files = [str(path.relative_to(ROOT)) for path in files_of_ours()]
    documents = [
        ROOT / "README.md",
        ROOT / "CONTRIBUTING.md",
        *sorted((ROOT / "docs").glob("*.md")),
        *sorted((ROOT / "docs/ros2").glob("*.md")),
    ]
    missing = [
        f"{document.relative_to(ROOT)}:{number}: {name}"
        for document in documents
        for number, line in enumerate(document.read_text(encoding="utf-8").splitlines(), start=1)
        for name in re.findall(r"`(?:\./)?([\w./-]+\.py)(?::\w+)?`", line)
        if not any(f"/{file}".endswith(f"/{name}") for file in files)
    ]
    assert not missing


OWN_LOCKS = ("bench", "docs", "ros")
"""The extras that have lock files of their own, and that no other part of the project asks for."""

LOCKS = ("requirements.lock", "requirements-run.lock", *(f"requirements-{extra}.lock" for extra in OWN_LOCKS))
"""Lock files: of all that work needs, of the part that a run needs, of each extra with its own."""

EXAMPLE_LOCK = "examples/mujoco/requirements.lock"
"""Lock file of an example's library, which nothing else needs."""

RUN_EXTRAS = ("sim", "monitor", "checkout")
"""The extras that the lock file of a run is for."""


def locked(name: str) -> dict[str, list[str]]:
    """Requirement lines of a lock file by name (several where versions differ by Python)."""
    lines = (ROOT / name).read_text().replace("\\\n", " ").splitlines()
    found: dict[str, list[str]] = {}
    for line in lines:
        found.setdefault(canonicalize_name(Requirement(line.partition("--hash")[0]).name), []).append(line)
    return found


def pinned(name: str) -> dict[str, list[str]]:
    """The versions in a lock file by name."""
    return {
        package: [next(iter(Requirement(line.partition("--hash")[0]).specifier)).version for line in lines]
        for package, lines in locked(name).items()
    }


@pytest.mark.parametrize("name", [*LOCKS, EXAMPLE_LOCK])
def test_lock_pins_and_hashes_everything_and_names_no_host(name: str) -> None:
    lines = [line for several in locked(name).values() for line in several]
    assert not [line for line in lines if "==" not in line or "--hash=sha256:" not in line]
    assert "://" not in (ROOT / name).read_text()


def test_locks_hold_what_the_project_asks_for() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())
    extras = dict(project["project"]["optional-dependencies"])
    own = [extras.pop(name) for name in OWN_LOCKS]
    base = [*project["build-system"]["requires"], *project["project"]["dependencies"]]
    asked = [*base, *(line for extra in extras.values() for line in extra)]
    run = [*base, *(line for extra in RUN_EXTRAS for line in extras[extra])]
    for lines, lock in zip((asked, run, *own), map(pinned, LOCKS), strict=True):
        for wanted in map(Requirement, lines):
            if wanted.name == "fogwatch":
                continue
            versions = lock[canonicalize_name(wanted.name)]
            assert all(version in wanted.specifier for version in versions), f"run make lock: {wanted}"


def test_the_locks_agree_and_rivals_are_in_no_other_installation() -> None:
    everybody, run, *others = map(pinned, [*LOCKS, EXAMPLE_LOCK])
    assert {name: versions for name, versions in run.items() if everybody[name] != versions} == {}
    assert run.keys().isdisjoint({"scipy", "dask", "shapely", "pytest", "mypy", "ruff", "hypothesis", "playwright"})
    for own in others:
        assert {name: own[name] for name in own.keys() & everybody.keys() if own[name] != everybody[name]} == {}
    extras = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["optional-dependencies"]
    asked = [line for name, lines in extras.items() if name not in OWN_LOCKS for line in lines]
    assert not [line for line in asked if Requirement(line).extras & set(OWN_LOCKS)]
    assert {"dijkstra3d", "scikit-fmm", "scikit-image", "tcod"} <= others[0].keys() - everybody.keys()
    assert {"sphinx", "furo", "myst-nb"} <= others[1].keys() - everybody.keys()


def base_distributions() -> set[str]:
    """The distributions that `pip install fogwatch` installs, without any extra."""
    pending = ["fogwatch"]
    found: set[str] = set()
    while pending:
        name = canonicalize_name(pending.pop())
        if name in found:
            continue
        found.add(name)
        for line in metadata.requires(name) or []:
            wanted = Requirement(line)
            if wanted.marker is None or wanted.marker.evaluate({"extra": ""}):
                pending.append(wanted.name)
    return found


AGENT_ON_A_BARE_ROBOT = """
import importlib, json, pkgutil, sys
allowed = set(json.loads(sys.argv[1])) | set(sys.stdlib_module_names)

class NothingElse:
    def find_spec(self, name, path=None, target=None):
        # Python's own build settings are a module whose name holds the platform's, so it is in no list.
        if name.partition(".")[0] not in allowed and not name.startswith("_sysconfigdata_"):
            raise ModuleNotFoundError(f"a robot has no {name}", name=name)

sys.meta_path.insert(0, NothingElse())
import agent
for module in pkgutil.walk_packages(agent.__path__, "agent."):
    if not module.name.endswith("__main__"):
        importlib.import_module(module.name)
"""


def test_an_agent_needs_no_extra_and_none_of_the_other_packages() -> None:
    """Import all of `agent` where only the base dependencies can be found.

    Names in `sys.modules` would not do: numba loads scipy where there is one.
    """
    base = base_distributions()
    modules = [
        module
        for module, owners in metadata.packages_distributions().items()
        if module not in PACKAGES and any(canonicalize_name(owner) in base for owner in owners)
    ]
    command = [sys.executable, "-P", "-c", AGENT_ON_A_BARE_ROBOT, json.dumps([*modules, "patrol", "runtime", "agent"])]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


def test_the_wheel_holds_the_packages_and_nothing_else(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", str(tmp_path)]
    subprocess.run(command, cwd=ROOT, check=True, capture_output=True)
    (wheel,) = tmp_path.glob("fogwatch-*.whl")
    with zipfile.ZipFile(wheel) as archive:
        names = archive.namelist()
    assert {name.partition("/")[0] for name in names if ".dist-info/" not in name} == set(PACKAGES)
    assert {f"{package}/py.typed" for package in PACKAGES} <= set(names)
    data = {
        str(path.relative_to(ROOT))
        for path in files_of_ours()
        if path.relative_to(ROOT).parts[0] in PACKAGES and path.suffix not in {".py", ".pyc"}
    }
    assert data <= set(names)
    assert any(name.endswith("licenses/LICENSE") for name in names)


# Files that this program wrote itself, in a place of its own, or brought along.
OWN_FILES = {
    "agent/learned/network.py": "bytes that patrol/files/untrusted.py has read",
    "agent/psi.py": "fields that its launcher prepared",
    "experiments/benchmark/presets.py": "data of the package",
    "experiments/paper/printed.py": "data of the package",
    "experiments/sweeps/results.py": "the file that it goes on with, checked like others",
    "fogwatch/cli/main.py": "what stands in for a standard stream that is closed",
    "fogwatch/fleets/certificates.py": "the certificate of the authority that it has made",
    "fogwatch/launch/child_control.py": "the kernel's facts about its own children",
    "fogwatch/launch/children.py": "logs of its own children",
    "monitor/page/saved.py": "data of the packages",
    "monitor/report/html.py": "data of the package",
    "patrol/measures/best_tour.py": "the user's own cache",
    "patrol/ground/fields.py": "fields that the launcher prepared",
    "patrol/kernel_cache.py": "the user's own cache, and kernels of the packages",
    "runtime/net/serial_line.py": "the line that its user names; what comes over it is judged like any frame",
    "patrol/tours/round.py": "the user's own cache",
    "patrol/prepare.py": "fields that the launcher prepared",
    "runtime/process/lifeline.py": "the kernel's facts about this process",
    "runtime/starting/environment.py": "the kernel's facts about this process",
    "runtime/reporting/vitals.py": "the kernel's facts about this process",
    "runtime/starting/compiling.py": "kernels of the packages",
    "patrol/regions/split.py": "fields that the launcher prepared",
    "patrol/files/untrusted.py": "the one place that opens files of others",
}
WRITING = ("'x", "'w", "'a", "O_EXCL", "O_APPEND", "O_WRONLY", "O_DIRECTORY")
READERS = {"read_text", "read_bytes", "fromfile", "loadtxt", "genfromtxt", "memmap", "imread", "copyfile"}
LOADERS = {"np", "json", "pickle", "marshal", "mpl"}
OTHER_OPENERS = {"Image", "_gate", "webbrowser", "zenoh"}
"""What has a method `open` that opens no file by its path; of an image it is given an open file."""


def readings(path: Path) -> Iterator[str]:
    """The calls in a file that open another one for reading."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if not isinstance(node, ast.Call):
            continue
        called = node.func
        name = called.attr if isinstance(called, ast.Attribute) else called.id if isinstance(called, ast.Name) else ""
        owner = ast.unparse(called.value).rpartition(".")[2] if isinstance(called, ast.Attribute) else ""
        if name == "read_text" and not isinstance(called, ast.Attribute):
            continue  # `patrol.files.yaml_text.read_text`, which reads by `patrol.files.untrusted`
        if name in {"open", "fdopen"} and owner not in OTHER_OPENERS:
            told = ast.unparse(node)
            if not any(mode in told for mode in WRITING):
                yield f"{name} in line {node.lineno}"
        elif name in READERS or (name == "load" and owner in LOADERS):
            yield f"{name} in line {node.lineno}"


def test_files_of_others_are_opened_in_one_place() -> None:
    found = {
        str(path.relative_to(ROOT)): said
        for path in python_files()
        if path.relative_to(ROOT).parts[0] in PACKAGES and (said := list(readings(path)))
    }
    assert {name: said for name, said in found.items() if name not in OWN_FILES} == {}
    assert OWN_FILES.keys() <= found.keys() | {"patrol/files/untrusted.py"}, "drop what opens no file any more"
