"""Compiling the kernels once on a machine, not once in each of a dozen processes that start together.

Numba keeps compiled kernels on disk; a kernel with an explicit signature is compiled when its module is first imported.
A stamp next to those files says that they are there for these sources, this Python, this numba and this CPU. Without it
one process compiles under a lock that the system drops when the process dies, and the others wait for it.

No kernel of ours does linear algebra. Numba looks for scipy's all the same, which costs each process, where scipy is
installed, a fifth of a second and 15 MB; `numba_alone` keeps it from that. It also loads what numba asks for when the
first array meets a kernel, which would be in the first tick.
"""

from __future__ import annotations

import fcntl
import hashlib
import importlib
import json
import os
import platform
import sys
import tempfile
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from importlib.metadata import version
from importlib.util import find_spec
from pathlib import Path

from patrol.errors import BadInput
from patrol.whole_file import write_whole

KERNELS = "kernels"
COMPILING = "compiling the kernels, once on this machine: about half a minute ..."
WAITING = "another process is compiling the kernels: waiting for it ..."


def warm(packages: Sequence[str], say: Callable[[str], None]) -> None:
    """Make sure that the kernels of some packages are compiled; returns at once when they are.

    Args:
        packages: Their names.
        say: Takes a line when compiling or waiting takes time.

    Raises:
        BadInput: Where nothing can be kept on disk.
    """
    files = {package: kernel_files(package) for package in packages}
    home = cache_home([path for modules in files.values() for path in modules.values()])
    stamps = {package: home / f"fogwatch-{_platform()}-{package}.warm" for package in packages}

    def cold() -> list[str]:
        return [package for package in packages if not _is_warm(stamps[package], _digest(files[package].values()))]

    if not cold():
        return
    with _lock(home / "fogwatch.lock", say):
        if missing := cold():
            say(COMPILING)
        for package in missing:
            indexes = _compile(list(files[package]))
            says = {"sources": _digest(files[package].values()), "indexes": indexes}
            write_whole(stamps[package], json.dumps(says))


def numba_alone() -> None:
    """Load numba without scipy, which stays free to be imported later; for processes that run our kernels only.

    Code that others compile with numba then does without BLAS, as it does where scipy is not installed.
    """
    with _hidden("scipy"), suppress(ImportError):  # where numba has moved its parts, they load when they are needed
        importlib.import_module("numba.np.arraymath")
        importlib.import_module("numpy.ma")


def kernel_files(package: str) -> dict[str, Path]:
    """A package's kernel modules: every module in a folder called kernels.

    Args:
        package: Its name.

    Returns:
        Files by the module's full name.
    """
    found = {}
    spec = find_spec(package)
    for folder in (spec.submodule_search_locations if spec else None) or ():
        for path in sorted(Path(folder).rglob(f"{KERNELS}/*.py")):
            parts = path.relative_to(folder).with_suffix("").parts
            if parts[-1] != "__init__":
                found[".".join((package, *parts))] = path
    return found


def cache_home(kernels: Sequence[Path]) -> Path:
    """The first folder for stamps that can be written to, in the order in which numba looks for its own.

    Args:
        kernels: The kernels' source files.

    Raises:
        BadInput: Where no folder can be written to.
    """
    given = os.environ.get("NUMBA_CACHE_DIR")
    own = os.environ.get("XDG_CACHE_HOME") or "~/.cache"
    beside = [path.parent / "__pycache__" for path in kernels[:1]]
    for folder in [Path(given)] if given else [*beside, Path(own).expanduser() / "fogwatch"]:
        try:
            folder.mkdir(parents=True, exist_ok=True)
            with tempfile.TemporaryFile(dir=folder):
                return folder
        except (OSError, RuntimeError):
            continue
    raise _unwritable()


def _compile(modules: Sequence[str]) -> list[str]:
    """Import the modules, which compiles what is not there yet; the index files that numba keeps of them."""
    indexes: set[str] = set()
    for name in modules:
        try:
            module = importlib.import_module(name)
        except RuntimeError as error:
            if "cannot cache" not in str(error):
                raise
            raise _unwritable() from None
        for kernel in vars(module).values():
            folder = getattr(getattr(kernel, "stats", None), "cache_path", None)
            if folder is not None and getattr(kernel, "__module__", None) == name:
                stem = f"{name.rpartition('.')[2]}.{kernel.__name__}-"
                indexes.update(str(path) for path in Path(folder).glob(f"{stem}*.nbi"))
    return sorted(indexes)


def _is_warm(stamp: Path, sources: str) -> bool:
    try:
        says = json.loads(stamp.read_text(encoding="utf-8"))
        return says["sources"] == sources and all(Path(index).exists() for index in says["indexes"])
    except (OSError, ValueError, LookupError, TypeError):
        return False


@contextmanager
def _hidden(package: str) -> Iterator[None]:
    """A package looks as if it were not installed, unless it has been imported before."""
    if package in sys.modules:
        yield
        return
    sys.modules[package] = None  # type: ignore[assignment]  # this is how to say so; the stubs do not know
    try:
        yield
    finally:
        del sys.modules[package]


@contextmanager
def _lock(path: Path, say: Callable[[str], None]) -> Iterator[None]:
    with path.open("ab") as file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            say(WAITING)
            fcntl.flock(file, fcntl.LOCK_EX)
        yield


def _digest(files: Iterable[Path]) -> str:
    """What numba goes by too: when a source was written, and how long it is."""
    facts = [(str(path), stat.st_mtime_ns, stat.st_size) for path in files for stat in [path.stat()]]
    return hashlib.sha256(json.dumps(facts).encode()).hexdigest()


def _platform() -> str:
    from llvmlite.binding import get_host_cpu_name  # type: ignore[import-untyped]

    facts = (sys.implementation.cache_tag, platform.machine(), get_host_cpu_name(), version("numba"))
    return hashlib.sha256(repr(facts).encode()).hexdigest()[:12]


def _unwritable() -> BadInput:
    return BadInput(
        "the compiled kernels cannot be stored: neither the installed package nor the user's cache folder is writable; "
        "set NUMBA_CACHE_DIR to a folder that is"
    )
