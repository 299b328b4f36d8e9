"""Compiled kernels, kept on disk by content, so that all clones, environments and processes of a user share them.

Theory of operation
    An *entry* is a folder with numba's files for one kernel module, and with the SHA-256 of each. Its path holds the
    module's name and a digest of all that its machine code depends on: the source, the versions of Python, numba,
    llvmlite and numpy, the processor, and numba's settings. So an entry is never outdated: a changed source gets a new
    path, and the old entry is no longer read.

    Wheels for x86-64 hold entries for the processor `SHIPPED_FOR` (deploy/wheels.py), in the folder `SHIPPED`. They are
    used on every processor that runs such code, with the same versions; otherwise the user's cache is.

    An entry is made in a folder of its own, under a lock, and moved to its path when it is complete. It is not changed
    afterwards, so it can be read without a lock. Files that do not match their digests are deleted and made again.

    Every package of kernels calls `keep_compiled` before any of its modules is imported. From then on importing one of
    them loads its entry, or compiles the module and stores the entry. `runtime.starting.warmup` does the same
    beforehand, in several processes, for all that a run needs.
"""

from __future__ import annotations

import fcntl
import hashlib
import importlib.util
import json
import os
import platform
import shutil
import stat
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from functools import cache
from importlib.abc import MetaPathFinder
from importlib.machinery import ModuleSpec, PathFinder, SourceFileLoader
from importlib.metadata import version
from pathlib import Path
from types import CodeType, FunctionType, ModuleType
from typing import Any

from patrol.errors import BadInput

NO_SETTINGS = ("NUMBA_CACHE_DIR", "NUMBA_DEBUG_CACHE", "NUMBA_NUM_THREADS", "NUMBA_CPU_NAME", "NUMBA_CPU_FEATURES")
"""Variables of numba that do not change the code that it makes, and those that name the processor."""
SHIPPED = Path(__file__).with_name("compiled")
"""The folder of the entries that come with a wheel; a checkout has none."""
SHIPPED_FOR = "x86-64-v3"
"""The processor that they are compiled for, by LLVM's name."""
_INSTRUCTIONS = (
    *("cx16", "popcnt", "sahf", "sse3", "ssse3", "sse4.1", "sse4.2"),
    *("avx", "avx2", "bmi", "bmi2", "f16c", "fma", "lzcnt", "movbe", "xsave"),
)
"""What such a processor has beyond the first x86-64, as LLVM names it."""
UNUSED_S = 90 * 24 * 3600.0
"""Entries that no process has loaded for this long are deleted when another one of the same module is made."""
_OTHERS_WRITE = stat.S_IWGRP | stat.S_IWOTH
_DAY_S = 24 * 3600.0
_LIST = "files.json"
_UNFINISHED = ".making-"

_packages: set[str] = set()
_folders: dict[str, Path] = {}
"""Folders of numba's files by module name: for kernels that are being imported, and for users' modules."""


def keep_compiled(package: str) -> None:
    """Load a package's kernels from the cache from now on; called by the package itself."""
    _packages.add(package)
    if _FINDER not in sys.meta_path:
        sys.meta_path.insert(0, _FINDER)


def load_alone(name: str, source: Path) -> None:
    """Import a kernel module without the packages that it is in, and compile it where it is not in the cache."""
    spec = importlib.util.spec_from_file_location(name, source, loader=_KernelLoader(name, str(source)))
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module  # numba looks its kernels up by name
    spec.loader.exec_module(module)


def keep_own(name: str, source: bytes) -> None:
    """Keep the kernels of a user's module in the cache too, and not beside its file, which others may have written."""
    _register_locator()
    _folders[name] = _entry_folder(name, source)


def is_stored(name: str, source: Path) -> bool:
    """Return True if a module's entry is there; damaged files are noticed when they are loaded."""
    text = source.read_bytes()
    try:
        shipped = _shipped_entry(name, text)
        return (shipped is not None and (shipped / _LIST).is_file()) or (_entry_folder(name, text) / _LIST).is_file()
    except OSError:  # such as a folder that this user may not read
        return False


def user_cache(kind: str) -> Path | None:
    """Return the user's cache folder for one kind of file; None for a user without a home folder."""
    try:
        return Path(os.environ.get("XDG_CACHE_HOME") or "~/.cache").expanduser() / "fogwatch" / kind
    except RuntimeError:
        return None


def cache_home() -> Path:
    """Return the folder of the cache, which may not exist yet.

    It is below ``NUMBA_CACHE_DIR``, or else the user's cache folder. One that another user may write to raises
    BadInput: what lies there is code that is executed.
    """
    if numba_folder := os.environ.get("NUMBA_CACHE_DIR"):
        home = Path(numba_folder) / "fogwatch"
    elif (user_folder := user_cache("kernels")) is not None:
        home = user_folder
    else:
        raise BadInput(
            "the compiled kernels cannot be stored: this user has no home folder; set NUMBA_CACHE_DIR to a folder"
        )
    try:
        facts = home.stat()
    except OSError:  # it is made later, or cannot be
        return home
    if facts.st_uid not in (0, os.geteuid()) or facts.st_mode & _OTHERS_WRITE:
        raise BadInput(
            f"the compiled kernels in {home} are not used: another user may have written them; delete that folder, or "
            "set NUMBA_CACHE_DIR to a folder of your own"
        )
    return home


def make_folder(home: Path) -> None:
    """Make the folder of the cache, where there is none.

    Other users may be meant to read what lies there. Where the umask would also let them write, they get no access.
    """
    os.umask(umask := os.umask(0o077))
    home.parent.mkdir(parents=True, exist_ok=True)
    home.mkdir(mode=0o777 if umask & _OTHERS_WRITE == _OTHERS_WRITE else 0o700, exist_ok=True)


@contextmanager
def storing() -> Iterator[None]:
    """Explain an OSError as a cache that cannot be written to."""
    try:
        yield
    except OSError as error:
        raise BadInput(
            f"the compiled kernels cannot be stored in {cache_home()}: {error.strerror or error}; make that folder "
            "writable, or set NUMBA_CACHE_DIR to a folder that is, with 20 MB of room"
        ) from None


class _KernelFinder(MetaPathFinder):
    """Finds the modules of the packages that `keep_compiled` has been called for."""

    def find_spec(
        self, fullname: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        if fullname.rpartition(".")[0] not in _packages:
            return None
        spec = PathFinder.find_spec(fullname, path, target)
        if spec is not None and isinstance(spec.loader, SourceFileLoader):
            spec.loader = _KernelLoader(fullname, spec.loader.path)
        return spec


_FINDER = _KernelFinder()


class _KernelLoader(SourceFileLoader):
    """Executes a kernel module while numba reads, or makes, the files of its entry.

    The source is read once, so that the code that is executed is the code that the entry's digest stands for. Python's
    own cache of byte code goes by time and size, and can hold another source's.
    """

    _source = b""

    def get_code(self, _fullname: str) -> CodeType:
        """Return the byte code of the source as it was read."""
        return self.source_to_code(self._source, self.path)

    def exec_module(self, module: ModuleType) -> None:
        """Execute the module; compile it first where its entry is missing or damaged."""
        self._source = Path(self.path).read_bytes()
        shipped = _shipped_entry(self.name, self._source)
        if shipped is not None and _is_intact(shipped):
            self._execute_module(module, shipped)
            return
        entry = _entry_folder(self.name, self._source)
        if not _is_intact(entry):
            with storing():
                make_folder(entry.parent.parent)
                entry.parent.mkdir(exist_ok=True)
                with (entry.parent / "lock").open("ab") as lock:
                    fcntl.flock(lock, fcntl.LOCK_EX)
                    if not _is_intact(entry):
                        self._make_entry(entry, module)
                        return
        _note_use(entry)
        self._execute_module(module, entry)

    def _make_entry(self, entry: Path, module: ModuleType) -> None:
        """Compile the module and store its entry; no other process makes an entry of this module meanwhile."""
        _clean_entry(entry)
        part = entry.parent / f"{_UNFINISHED}{os.getpid()}"
        part.mkdir()
        try:
            self._execute_module(module, part)
            listed = {file.name: _file_digest(file) for file in part.iterdir()}
            (part / _LIST).write_text(json.dumps(listed), encoding="utf-8")
            try:
                part.rename(entry)
            except OSError:
                if not _is_intact(entry):  # another process has stored it: the lock file had been deleted
                    raise
        finally:
            shutil.rmtree(part, ignore_errors=True)

    def _execute_module(self, module: ModuleType, folder: Path) -> None:
        _register_locator()
        _folders[self.name] = folder
        try:
            super().exec_module(module)
        finally:
            del _folders[self.name]


class _KernelLocator:
    """Tells numba where the files of a kernel are (`numba.core.caching._CacheLocator`)."""

    def __init__(self, folder: Path, line: int) -> None:
        self._folder = folder
        self._line = line

    @classmethod
    def from_function(cls, function: FunctionType, _source: str) -> _KernelLocator | None:
        """Return the locator of a kernel that is being imported or a user's; None for functions of others."""
        folder = _folders.get(function.__module__)
        return None if folder is None else cls(folder, function.__code__.co_firstlineno)

    def ensure_cache_path(self) -> None:
        """Make the folder where it is not there: that of a user's module."""
        with storing():
            make_folder(self._folder.parents[1])
            self._folder.mkdir(parents=True, exist_ok=True)

    def get_cache_path(self) -> str:
        """Return the folder."""
        return str(self._folder)

    def get_source_stamp(self) -> str:
        """Nothing more: the folder holds files of one source only."""
        return ""

    def get_disambiguator(self) -> str:
        """Return the line at which the kernel begins."""
        return str(self._line)


@cache
def _register_locator() -> None:
    """Have numba ask `_KernelLocator` first, leave the processor to the entry's path, and import scipy only for BLAS.

    numba looks for BLAS when it is imported, which takes a fifth of a second in every process where scipy is. It still
    does when a kernel calls BLAS; none of ours does.

    numba also reads a file of settings in the working folder, which may be a received one. The file could name another
    cache there, and what lies in a cache is code that is executed, so the file is left out.
    """
    from numba.core import config
    from numba.core.caching import Cache, CacheImpl
    from numba.np import linalg

    settings: Any = config
    settings._config_fname = ""
    settings.reload_config()
    CacheImpl._locator_classes.insert(0, _KernelLocator)
    numbas: Any = Cache
    key_of = numbas._index_key

    def index_key(cached: Any, signature: object, codegen: object) -> object:
        is_ours = isinstance(cached._impl.locator, _KernelLocator)
        return key_of(cached, signature, _AnyProcessor if is_ours else codegen)

    numbas._index_key = index_key
    ensure_blas, linalg.ensure_blas = linalg.ensure_blas, lambda: None
    try:
        import numba.np.arraymath  # noqa: F401
    finally:
        linalg.ensure_blas = ensure_blas


class _AnyProcessor:
    """Stands in for the code generator, which numba asks for its processor."""

    @staticmethod
    def magic_tuple() -> tuple[()]:
        """Return no facts."""
        return ()


def _entry_folder(name: str, source: bytes) -> Path:
    """Return the folder of a module's entry in the user's cache, whether it is there or not."""
    return cache_home() / _entry_path(name, source, _processor_facts())


def _shipped_entry(name: str, source: bytes) -> Path | None:
    """Return the folder of a module's entry in the wheel; None where there is none, or not for this processor."""
    if not SHIPPED.is_dir() or not runs_shipped():
        return None
    return SHIPPED / _entry_path(name, source, ("x86_64", SHIPPED_FOR, ""))


def _entry_path(name: str, source: bytes, processor: tuple[str, str, str]) -> Path:
    facts = (name, hashlib.sha256(source).hexdigest(), _library_versions(), processor, _numba_settings())
    return Path(name, hashlib.sha256(repr(facts).encode()).hexdigest()[:32])


@cache
def _library_versions() -> tuple[str, ...]:
    numpy = ".".join(version("numpy").split(".")[:2])  # numba's code goes by these two
    optimized = "O" * sys.flags.optimize  # numba tells kernels apart by their byte code, which docstrings move
    python = str(sys.implementation.cache_tag), getattr(sys, "abiflags", "") + optimized
    return (*python, version("numba"), version("llvmlite"), numpy)


@cache
def _processor_facts() -> tuple[str, str, str]:
    """Return the machine, the processor and its features that numba compiles for."""
    from llvmlite.binding import get_host_cpu_features, get_host_cpu_name  # type: ignore[import-untyped]

    name, features = os.environ.get("NUMBA_CPU_NAME"), os.environ.get("NUMBA_CPU_FEATURES")
    return (
        platform.machine(),
        get_host_cpu_name() if name is None else name,
        get_host_cpu_features().flatten() if features is None else features,
    )


@cache
def runs_shipped() -> bool:
    """Return True if this processor runs code for `SHIPPED_FOR`, and numba was asked for no other."""
    from llvmlite.binding import get_host_cpu_features

    features = get_host_cpu_features()
    overridden = "NUMBA_CPU_NAME" in os.environ or "NUMBA_CPU_FEATURES" in os.environ
    return platform.machine() == "x86_64" and not overridden and all(features.get(name) for name in _INSTRUCTIONS)


def _numba_settings() -> tuple[tuple[str, str], ...]:
    """Return numba's settings: variables of the environment."""
    variables = [item for item in os.environ.items() if item[0].startswith("NUMBA_") and item[0] not in NO_SETTINGS]
    return tuple(sorted(variables))


def _is_intact(entry: Path) -> bool:
    """Return whether an entry is there and undamaged."""
    try:
        listed = json.loads((entry / _LIST).read_bytes())
        return all(_file_digest(entry / name) == digest for name, digest in listed.items())
    except (OSError, ValueError, AttributeError, TypeError):
        return False


def _file_digest(file: Path) -> str:
    return hashlib.sha256(file.read_bytes()).hexdigest()


def _note_use(entry: Path) -> None:
    """Keep an entry from being deleted as unused."""
    with suppress(OSError):  # a cache that others have made may be read-only
        if time.time() - (entry / _LIST).stat().st_mtime > _DAY_S:
            os.utime(entry / _LIST)


def _clean_entry(entry: Path) -> None:
    """Delete what is in the way of a new entry: a damaged one, what killed processes have left, and unused ones."""
    for folder in entry.parent.iterdir():
        if folder == entry or folder.name.startswith(_UNFINISHED) or _is_unused(folder):
            shutil.rmtree(folder, ignore_errors=True)


def _is_unused(folder: Path) -> bool:
    try:
        return time.time() - (folder / _LIST).stat().st_mtime > UNUSED_S
    except OSError:
        return False
