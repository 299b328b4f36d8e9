"""The times and targets of a scenario's faults, and what they do to a robot's process between ticks.

Entries are resolved to ticks and robot numbers. A journal has their effects.

Which robots `one`, `half` and the like are is drawn from (seed, Purpose.FAULT, the fault's index, the field, robot):
the robots with the lowest draws. So it depends on no other fault, and on nothing that happens in the run.
"""

from __future__ import annotations

from bisect import bisect_right
from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

from patrol.errors import in_flow
from patrol.faults.kinds import (
    PROCESS_KINDS,
    STRANGER,
    Fault,
    Join,
    Kill,
    Lasting,
    Leave,
    OnGround,
    OnLinks,
    OnRobots,
    Partition,
    Pause,
    Spoof,
)
from patrol.faults.roster import tick_of, ticks_of
from patrol.faults.targets import Some, TargetField, in_drawn_order, meant
from patrol.journal import Status
from patrol.journal.records import Event
from patrol.scenario import Scenario

FAULT_EVENT = "fault"
"""The kind of the journal's events that report faults."""


@dataclass(frozen=True, slots=True)
class Entry:
    """One fault, resolved."""

    index: int
    fault: Fault
    begin: int  # first tick in which it is active
    end: int | None  # exclusive; None: to the end of the run; equal to `begin` for a fault that happens at once
    who: tuple[int, ...] = ()  # robot numbers, ascending; of a spoof, those of the victims
    sources: tuple[int, ...] = ()  # senders of a link fault; of a spoof, the robot that forges (0 for a stranger)
    targets: tuple[int, ...] = ()  # receivers of a link fault
    groups: tuple[tuple[int, ...], ...] = ()  # of a partition: robot numbers, ascending; every robot is in one group

    @property
    def id(self) -> str:
        """The fault's id: given, or made from its place."""
        return self.fault.id or f"f{self.index + 1}"


@dataclass(frozen=True, slots=True)
class Act:
    """One thing to do to one robot between two ticks."""

    kind: str  # of `patrol.faults.kinds.PROCESS_KINDS`
    number: int
    fault: str
    wreck: Literal["stays", "removed"] = "stays"


class Timeline:
    """A scenario's faults in ticks and robot numbers; it has no state and looks at nothing but the scenario."""

    def __init__(self, scenario: Scenario) -> None:
        """Resolve the scenario's faults."""
        self._step = scenario.step
        self._seed = scenario.seed
        self._names = {spec.name: spec.number for spec in scenario.roster}
        self._of_number = {number: name for name, number in self._names.items()}
        self._spares = scenario.spares
        self.entries = tuple(self._make_entry(index, fault) for index, fault in enumerate(scenario.faults))
        self.starts_absent = _absent_at_first(self.entries) | self._spares
        self.needs_process_control = any(entry.fault.kind in PROCESS_KINDS for entry in self.entries)
        self._acts = self._all_acts()
        self._changes, self._active = self._all_active()

    def at(self, k: int) -> tuple[Entry, ...]:
        """Return the lasting faults of radio, senses, bodies and ground that are active in tick k, by index."""
        # The latest change up to the tick; what is active stays so until the next one.
        index = bisect_right(self._changes, k) - 1
        return self._active[index] if index >= 0 else ()

    def acts(self, k: int) -> tuple[Act, ...]:
        """Return the acts on robots before tick k, by fault and then by robot.

        For example, a pause of r1 from tick 4 to tick 10 is an act of kind "pause" before tick 4 and one of kind
        "resume" before tick 10.
        """
        return self._acts.get(k, ())

    def acts_on(self, number: int, since: int) -> Iterator[Act]:
        """Return the acts on one robot before some tick and later ones, in their order."""
        for k in sorted(tick for tick in self._acts if tick >= since):
            yield from (act for act in self._acts[k] if act.number == number)

    def beginnings(self, k: int) -> tuple[Event, ...]:
        """Return the faults that happen or begin before tick k."""
        return tuple(
            Event(k, FAULT_EVENT, None, f"{entry.id} {entry.fault.kind} {_entry_verb(entry)}: {self.describe(entry)}")
            for entry in self.entries
            if entry.begin == k
        )

    def endings(self, k: int) -> tuple[Event, ...]:
        """Return the lasting faults that have ended before tick k."""
        return tuple(
            Event(k, FAULT_EVENT, None, f"{entry.id} {entry.fault.kind} ends")
            for entry in self.entries
            if entry.end == k and entry.end > entry.begin
        )

    @property
    def healed(self) -> int | None:
        """The first tick from which no fault is active and none will be; None when one never ends.

        For example, 10 for a single loss from tick 4 to tick 10, and 4 for a single kill at tick 4.

        Robots may still be dead, paused or gone: that depends on what happens in the run.
        """
        if any(_is_lasting(entry) and entry.end is None for entry in self.entries):
            return None
        ends = [entry.begin if entry.end is None else entry.end for entry in self.entries]
        return max(ends, default=0)

    def describe(self, entry: Entry) -> str:
        """Describe in a few words the targets and the effect of a fault."""
        fault = entry.fault
        parts = []
        if isinstance(fault, OnLinks):
            parts.append(f"{self._name_robots(entry.sources)} to {self._name_robots(entry.targets)}")
        elif isinstance(fault, Partition):
            parts.append(" | ".join(self._name_robots(group) for group in entry.groups))
        elif isinstance(fault, Spoof):
            parts.append(f"{fault.by} as {self._name_robots(entry.who)}")
        elif isinstance(fault, OnGround):
            parts.append(fault.part)
        else:
            parts.append(self._name_robots(entry.who))
        shown = {"id", "kind", "at", "for", "who", "from", "to", "as", "by", "groups", "closure"}
        options = fault.model_dump(mode="json", exclude_none=True, exclude_defaults=True)
        parts += [f"{name} {in_flow(value)}" for name, value in options.items() if name not in shown]
        return ", ".join(parts)

    def _name_robots(self, numbers: Sequence[int]) -> str:
        if len(numbers) == len(self._names) > 1:
            return "all"
        return " ".join(self._of_number[number] for number in numbers) or "nobody"

    def _make_entry(self, index: int, fault: Fault) -> Entry:
        begin = tick_of(fault.at, self._step)
        end: int | None = begin
        if isinstance(fault, Lasting):
            end = None if fault.lasts is None else begin + ticks_of(fault.lasts, self._step)
        robots: dict[str, Any] = {}
        if isinstance(fault, OnLinks):
            robots["sources"] = self._resolve_target(fault.sources, index, TargetField.FROM)
            robots["targets"] = self._resolve_target(fault.targets, index, TargetField.TO)
        elif isinstance(fault, Partition):
            robots["groups"] = self._resolve_groups(fault, index)
        elif isinstance(fault, Spoof):
            robots["who"] = self._resolve_target(fault.victims, index, TargetField.AS)
            robots["sources"] = (0 if fault.by == STRANGER else self._names[fault.by],)
        elif isinstance(fault, OnRobots):
            robots["who"] = self._resolve_target(fault.who, index, TargetField.WHO)
        return Entry(index, fault, begin, end, **robots)

    def _resolve_target(self, who: str | tuple[str, ...] | Some, index: int, field: TargetField) -> tuple[int, ...]:
        """Return the robots that a target means, ascending."""
        return meant(who, self._names, self._spares, (self._seed, index, field))

    def _resolve_groups(self, fault: Partition, index: int) -> tuple[tuple[int, ...], ...]:
        if isinstance(fault.groups, str):
            fleet = (number for number in self._names.values() if number not in self._spares)
            drawn = in_drawn_order(fleet, (self._seed, index, TargetField.GROUPS))
            # Of an odd number the second half is the larger one.
            first = 1 if fault.groups == "one" else len(drawn) // 2
            groups = [drawn[:first], [*drawn[first:], *self._spares]]
        else:
            groups = [[self._names[name] for name in group] for group in fault.groups]
            named = {number for group in groups for number in group}
            # Robots that no group names form one more, or they would hear all groups.
            groups.append([number for number in self._names.values() if number not in named])
        return tuple(tuple(sorted(group)) for group in groups if group)

    def _all_acts(self) -> dict[int, tuple[Act, ...]]:
        acts: dict[int, list[tuple[int, Act]]] = defaultdict(list)
        for entry in self.entries:
            fault = entry.fault
            if fault.kind not in PROCESS_KINDS:
                continue
            wreck = fault.wreck if isinstance(fault, Kill) else "stays"
            acts[entry.begin] += [(entry.index, Act(fault.kind, number, entry.id, wreck)) for number in entry.who]
            if isinstance(fault, Pause) and entry.end is not None:
                acts[entry.end] += [(entry.index, Act("resume", number, entry.id)) for number in entry.who]
        # Stable: a fault's acts are by robot already.
        return {k: tuple(act for _, act in sorted(pairs, key=lambda pair: pair[0])) for k, pairs in acts.items()}

    def _all_active(self) -> tuple[list[int], list[tuple[Entry, ...]]]:
        """Return the ticks at which what is active changes, ascending, and what is active from each of them on."""
        lasting = [entry for entry in self.entries if _is_lasting(entry)]
        changes = sorted({k for entry in lasting for k in (entry.begin, entry.end) if k is not None})
        active = [
            tuple(entry for entry in lasting if entry.begin <= k and (entry.end is None or k < entry.end))
            for k in changes
        ]
        return changes, active


def _absent_at_first(entries: Sequence[Entry]) -> frozenset[int]:
    """Return the robots that join before they have left."""
    comes: dict[int, bool] = {}
    for entry in sorted(entries, key=lambda entry: entry.begin):
        for number in entry.who if isinstance(entry.fault, Join | Leave) else ():
            # The first of a robot's joins and leaves says whether it was there before.
            comes.setdefault(number, isinstance(entry.fault, Join))
    return frozenset(number for number, joins in comes.items() if joins)


def _is_lasting(entry: Entry) -> bool:
    """Return True if a fault is active over ticks, and no act between two of them."""
    return entry.fault.kind not in PROCESS_KINDS


def _entry_verb(entry: Entry) -> str:
    return "happens" if entry.end == entry.begin else "begins"


SKIPPED = "skipped"
WAITING = "waiting"
LOOKED_AT = "looked at"
"""Kinds of events that change no status; the last reports what was seen of a process when its pause began or ended."""

APPLIES: Mapping[str, frozenset[Status]] = {
    "kill": frozenset({Status.ALIVE, Status.PAUSED}),
    "restart": frozenset({Status.ALIVE, Status.PAUSED, Status.DEAD, Status.LOST}),
    "pause": frozenset({Status.ALIVE}),
    "resume": frozenset({Status.PAUSED}),
    "join": frozenset({Status.ABSENT, Status.LEFT}),
    "leave": frozenset({Status.ALIVE, Status.PAUSED}),
}
"""The statuses of the robots that each kind of act makes sense for; it makes none for one that is being started."""

BECOMES: Mapping[str, Status] = {
    "kill": Status.DEAD,
    "restart": Status.ALIVE,
    "pause": Status.PAUSED,
    "resume": Status.ALIVE,
    "join": Status.ALIVE,
    "leave": Status.LEFT,
}
"""The status that each kind of act gives a robot, once it is done."""

AS_IT_IS: Mapping[Status, str] = {status: status.name.lower() for status in Status} | {
    Status.LEFT: "gone",
    Status.ABSENT: "not there yet",
}
BEING_STARTED = "being started"
"""The words, in events of kind `SKIPPED`, for the status of a robot that an act makes no sense for."""

STOPPED = "its process stands still"
UNSEEN = "its process cannot be looked at here"
"""The journal's words for a process that should be stopped; all others are errors."""


def standing_at_the_end(timeline: Timeline, numbers: Iterable[int], ticks: int) -> dict[int, Status]:
    """Return the robots' statuses after a number of ticks, if their processes do only what faults make them do."""
    standing = {number: Status.ABSENT if number in timeline.starts_absent else Status.ALIVE for number in numbers}
    for k in range(ticks):
        for act in timeline.acts(k):
            if standing[act.number] in APPLIES[act.kind]:
                standing[act.number] = BECOMES[act.kind]
    return standing


def process_name(robot: str, incarnation: int) -> str:
    """Name a robot's process in lists of exit codes: ``r1`` for the first, ``r1 (2)`` for the second."""
    return robot if incarnation <= 1 else f"{robot} ({incarnation})"
