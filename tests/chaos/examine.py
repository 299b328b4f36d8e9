"""One scenario of a hunt: it is run in several ways, and what must hold in each of them is checked.

No way may fail, every verdict must be valid, and all traces must be equal. A run that takes too long proves nothing
either way: `TooSlow`.
"""

import tempfile
import time
import traceback
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

from fogwatch.api import RunOptions, execute
from fogwatch.inprocess import Outcome, run_in_process
from patrol.errors import BadInput
from patrol.faults.kinds import KINDS, nothing
from patrol.prepare import Prepared
from patrol.scenario import Scenario, as_mapping, dump_scenario, load_scenario
from tests.chaos.coverage import Watch
from worldsim.run_record import COMPLETED, DESERTED
from worldsim.verdict.judge import Verdict

LIMIT_S = 600.0
"""Wall time after which a run, which should take seconds, is broken off."""

PACKAGES = ("patrol", "runtime", "agent", "worldsim", "fogwatch", "experiments")
TRACES_DIFFER = "traces differ"
DIRECTLY = "by direct radio"
"""The way in which robots hear each other over the network, at a pace."""

PACE = 4.0
"""Of that way, simulated seconds per second."""


class TooSlow(Exception):
    """A run was broken off because it took too long, so that it is unknown whether it holds."""


@dataclass(frozen=True, slots=True)
class Ran:
    """The result of one way of running a scenario.

    Attributes:
        trace: The trace hash.
        verdict: The verdict.
        ended: Why the run ended, as in the journal.
    """

    trace: str
    verdict: Verdict
    ended: str


@dataclass(frozen=True, slots=True)
class Breakage:
    """A promise that did not hold in a scenario.

    Attributes:
        kind: The way of running it and what went wrong, in words that are equal for breakages of the same sort.
        detail: More of it for people, possibly many lines.
        checks: The checks of the verdict that failed.
    """

    kind: str
    detail: str
    checks: tuple[str, ...] = ()


Way = Callable[[Scenario], Ran]


class Examiner:
    """Runs one scenario in its ways, and notes what the first of them meets."""

    def __init__(self, prepared: Prepared, *, processes: bool = False, keep: Path | None = None) -> None:
        """Choose the ways.

        Args:
            prepared: The scenario.
            processes: Whether to run it as a fleet of processes too.
            keep: Where the run folder of such a fleet is moved if something breaks.
        """
        self._prepared = prepared
        self._keep = keep
        self.met: set[str] = set()
        self.ways: dict[str, Way] = {"in process": self._in_process, "replayed": _replayed}
        if processes:
            self.ways |= {"as processes": self._as_processes, DIRECTLY: self._directly}

    def examine(self, scenario: Scenario | None = None) -> Breakage | None:
        """Run the scenario, or another one, in all ways.

        Args:
            scenario: The other one.

        Returns:
            The first thing that does not hold, or None.

        Raises:
            TooSlow: A run took too long.
        """
        traces: dict[str, str] = {}
        for name, way in self.ways.items():
            result = attempt(name, partial(way, scenario or self._prepared.scenario))
            if isinstance(result, Breakage):
                return result
            if name != DIRECTLY:  # keeps to the clock, so it does not repeat
                traces[name] = result.trace
        if len(set(traces.values())) > 1:
            return Breakage(TRACES_DIFFER, "\n".join(f"{name}: {trace}" for name, trace in traces.items()))
        return None

    def _in_process(self, scenario: Scenario) -> Ran:
        watches: list[Watch] = []

        def watch(world: Any) -> Any:
            watches.append(Watch(world))
            return watches[0].tick

        def event(event: Any) -> None:
            watches[0].event(event)

        own = scenario is self._prepared.scenario
        outcome = run_in_process(
            self._prepared if own else scenario, watch=watch, events=event, stop=_limit("in process"), share=False
        )
        if own:
            self.met = watches[0].met
        return _ran(outcome)

    def _as_processes(self, scenario: Scenario) -> Ran:
        with tempfile.TemporaryDirectory(prefix="fogwatch-chaos-", ignore_cleanup_errors=True) as folder:
            out = Path(folder) / "run"
            bare = RunOptions(out, picture=False, recording=False, report=False, page=False)
            result = execute(scenario, replace(bare, stop=_limit("as processes")))
            if not result.verdict.valid and self._keep is not None:
                out.rename(self._keep)
        return Ran(result.trace_hash, result.verdict, str(result.summary["ended"]))

    def _directly(self, scenario: Scenario) -> Ran:
        mapping = as_mapping(scenario)
        radio = {name: mapping["radio"][name] for name in ("key", "trail", "forget_after") if name in mapping["radio"]}
        kept = [fault for fault in mapping.get("faults", ()) if KINDS[fault["kind"]].acts_on != "frames"]
        direct = {"radio": {**radio, "via": "direct"}, "pace": PACE, "faults": kept, "watchdog": 20.0}
        self.met.add("feature direct radio")
        return self._as_processes(load_scenario(mapping | direct))


def attempt(name: str, way: Callable[[], Ran]) -> Ran | Breakage:
    """Run one way.

    Args:
        name: Its name.
        way: Runs it.
    """
    try:
        ran = way()
    except TooSlow:
        raise
    except BadInput as refused:
        return Breakage(f"{name}: refused", str(refused))
    except Exception as error:  # noqa: BLE001 - to find any error is the purpose
        return Breakage(f"{name}: {type(error).__name__} at {_raised_at(error)}", traceback.format_exc())
    if ran.ended not in (COMPLETED, DESERTED):
        return Breakage(f"{name}: not completed", ran.ended)
    if not ran.verdict.valid:
        failed = tuple(check.name for check in ran.verdict.failed)
        detail = "\n".join(f"{check.name}: {check.detail}" for check in ran.verdict.failed)
        return Breakage(f"{name}: {ran.verdict.outcome} by {', '.join(failed)}", detail, failed)
    return ran


def without_needless_faults(scenario: Scenario, breaks: Callable[[Scenario], bool]) -> Scenario:
    """Replace every fault that it does not take by one without an effect, so that the others keep their draws.

    Args:
        scenario: One that breaks.
        breaks: Whether another one breaks in the same way.
    """
    step, who = scenario.step, scenario.roster[0].name
    mapping = as_mapping(scenario)
    for place, fault in enumerate(mapping.get("faults", ())):
        entries = list(mapping["faults"])
        entries[place] = nothing(fault["id"], 0.0, step, who)
        fewer = mapping | {"faults": entries}
        if breaks(load_scenario(fewer)):
            mapping = fewer
    return load_scenario(mapping)


def _replayed(scenario: Scenario) -> Ran:
    """Write a scenario to a file, read it again, run it, and judge it tick by tick without its fog."""
    with tempfile.TemporaryDirectory(prefix="fogwatch-chaos-") as folder:
        file = Path(folder) / "scenario.yaml"
        file.write_text(dump_scenario(scenario), encoding="utf-8")
        again = load_scenario(file)
    return _ran(run_in_process(again, keep=False, verify_fog=False, stop=_limit("replayed")))


def _ran(outcome: Outcome) -> Ran:
    end = outcome.journal.end
    return Ran(outcome.summary.trace_hash or "", outcome.verdict, end.reason if end else "")


def _limit(name: str) -> Callable[[], bool]:
    """Make what a run asks again and again whether to stop; it raises TooSlow once the time is over."""
    end = time.monotonic() + LIMIT_S

    def stop() -> bool:
        if time.monotonic() > end:
            raise TooSlow(f"{name}: broken off after {LIMIT_S:g} s")
        return False

    return stop


def _raised_at(error: Exception) -> str:
    """Return the innermost place in our own code, as module:line."""
    places = [
        f"{module}:{line}"
        for frame, line in traceback.walk_tb(error.__traceback__)
        if (module := str(frame.f_globals.get("__name__"))).partition(".")[0] in PACKAGES
    ]
    return places[-1] if places else "the hunt itself"
