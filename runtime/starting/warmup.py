"""Compiling the kernels that a run needs before it begins, so that none of its processes has to.

Importing a kernel module that is not in the cache compiles it (`patrol.kernel_cache`), in one process and when it is
imported: in the middle of a tick, at worst. `warm` compiles modules beforehand, in several processes. Processes that
start together wait for the first of them.

Kernels that few runs need are listed in `SELDOM`: the rest are compiled before a scenario runs, these only where it
uses them. A module that is missing there is compiled before every first run. One that is listed although a run needs it
is compiled when that run imports it, in one process while the others wait.
"""

from __future__ import annotations

import fcntl
import time
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO

from patrol.kernel_cache import cache_home, is_stored, make_folder, storing
from runtime.starting.compiling import Compiled, compile_modules

if TYPE_CHECKING:
    from patrol.scenario import Scenario


def _follows_forces(scenario: Scenario) -> bool:
    """Return True if robots sum forces, or may: a policy of another kind can build on anything."""
    return not scenario.patrol.needs_rounds and not _is_learned(scenario)


def _needs_dilation(scenario: Scenario) -> bool:
    """Return True if beliefs spread staleness (`agent.belief.believed.BelievedFog`); an open field has no posts."""
    return _follows_forces(scenario) or scenario.terrain.builtin == "open"


def _is_learned(scenario: Scenario) -> bool:
    from patrol.scenario.policies import LEARNED  # here, as processes that compile need no scenario

    return scenario.patrol.policy == LEARNED


def _has_regions(scenario: Scenario) -> bool:
    return scenario.patrol.paths == "regions"


SELDOM: Mapping[str, Callable[[Scenario], bool]] = {
    "agent.kernels.changes": _needs_dilation,
    "agent.kernels.dilate": _needs_dilation,
    "agent.kernels.surroundings": _is_learned,
    "agent.kernels.force": _follows_forces,
    "agent.kernels.region_paths": _has_regions,
    "agent.kernels.straight": lambda scenario: scenario.patrol.paths == "straight",
    "patrol.kernels.doors": lambda _: False,  # where a random start may be shut in
    "patrol.kernels.regions": _has_regions,
}
"""Modules, and whether a run of a scenario needs them."""


def seldom_kernels(scenario: Scenario) -> list[str]:
    """Return the modules of `SELDOM` that a run needs."""
    return [name for name, needs in SELDOM.items() if needs(scenario)]


KERNELS = "kernels"
COMPILING = "compiling the kernels, once on this machine ..."
WAITING = "another process is compiling the kernels: waiting for it ..."
LINE_S = 5.0
"""Time between two lines that say how far compiling is."""


def warm(
    packages: Sequence[str],
    say: Callable[[str], None],
    also: Collection[str] = (),
    show: Callable[[Compiled], None] | None = None,
) -> None:
    """Make sure that the kernels of some packages are compiled; returns at once when they are.

    Modules listed in `SELDOM` are left out, but for those in `also`. `say` takes a line when compiling or waiting takes
    time, and one with the progress every few seconds unless `show` shows it.
    """
    if missing_kernels(packages, also):
        with _lock_cache(cache_home(), say):
            # Asked again: another process may have compiled them while this one waited.
            if todo := missing_kernels(packages, also):
                say(COMPILING)
                compile_modules(todo, show or _progress_lines(say))


def missing_kernels(packages: Sequence[str], also: Collection[str] = ()) -> dict[str, Path]:
    """List the modules of some packages that are not compiled, without those of `SELDOM` that are not in `also`."""
    return {
        name: file
        for package in packages
        for name, file in kernel_files(package).items()
        if (name not in SELDOM or name in also) and not is_stored(name, file)
    }


def kernel_files(package: str) -> dict[str, Path]:
    """List a package's kernel modules by full name: every module in a folder called kernels."""
    files = {}
    spec = find_spec(package)
    for folder in (spec.submodule_search_locations if spec else None) or ():
        for path in sorted(Path(folder).rglob(f"{KERNELS}/*.py")):
            parts = path.relative_to(folder).with_suffix("").parts
            if parts[-1] != "__init__":
                files[".".join((package, *parts))] = path
    return files


def progress_line(compiled: Compiled) -> str:
    """Describe for people how far compiling is.

    For example, "compiling the kernels: 12 of 40, about 9 s to go".
    """
    time_left = "" if compiled.left_s is None else f", about {max(round(compiled.left_s), 1)} s to go"
    return f"compiling the kernels: {compiled.kernels} of {compiled.of}{time_left}"


def _progress_lines(say: Callable[[str], None]) -> Callable[[Compiled], None]:
    """Make a display that says how far compiling is every `LINE_S`."""
    due = time.monotonic() + LINE_S

    def show(compiled: Compiled) -> None:
        nonlocal due
        if time.monotonic() >= due and compiled.kernels < compiled.of:
            due = time.monotonic() + LINE_S
            say(progress_line(compiled))

    return show


@contextmanager
def _lock_cache(home: Path, say: Callable[[str], None]) -> Iterator[None]:
    with storing():
        make_folder(home)
        file = (home / "lock").open("ab")
    with file:
        if not _try_lock(file, fcntl.LOCK_NB):
            say(WAITING)
            _try_lock(file)
        yield


def _try_lock(file: BinaryIO, flags: int = 0) -> bool:
    """Lock a file; return whether that was possible without waiting, where the flags say not to wait."""
    with storing():  # not every file system can lock
        try:
            fcntl.flock(file, fcntl.LOCK_EX | flags)
        except BlockingIOError:
            return False
        return True
