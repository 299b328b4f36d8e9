"""Checks that records of a feed can be of its run: sizes, robots and the order of ticks.

Any member that may publish on the feed's key can send records. Their types and limits are those of all records
(`patrol.journal.records`); here is what a run adds to them. Records that pass these checks break no viewer. Only the
router can ensure that they are true: it lets only the world publish there.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from patrol.errors import BadInput, Malformed
from patrol.journal import unpack
from patrol.journal.records import FORGED, MAX_TICKS, End, Event, Header, Record, RobotTick, TickRecord
from patrol.scenario import Scenario, load_scenario, same_but_for_files
from runtime.messages.feed import longest_record
from runtime.security.control_auth import MAX_CONTROL

MAX_TEXT = 500
"""Characters of the longest name, state or kind of event."""
MAX_FRAME = 1 << 16
"""Bytes of the longest frame, forged ones included."""
MAX_ANGLE = 1e6
"""The greatest heading, either sign, rad."""
MAX_HEADER = 1 << 24
"""Bytes of the longest header; it holds the scenario."""
_SEQUENCES = 1 << 62


def record_of(packed: bytes, longest: int = MAX_HEADER) -> Record | None:
    """Return the record that is packed in a feed's bytes; None for anything else.

    More than `longest` bytes are not looked at.
    """
    if len(packed) > longest:
        return None
    try:
        return unpack(packed)
    except Malformed:
        return None


def scenario_of(header: Header, height: int, width: int) -> Scenario | None:
    """Return the scenario in a feed's header; None where the header does not fit the terrain's size.

    Height and width are in points.
    """
    facts = header.terrain
    try:
        loaded = load_scenario(header.scenario, opens_classes=False)
    except BadInput:
        return None
    roster = tuple((spec.number, spec.name, spec.model, spec.radius) for spec in loaded.roster)
    robots = tuple((robot.number, robot.name, robot.model, robot.radius) for robot in header.robots)
    fits = robots == roster and facts.point == loaded.point and (facts.height, facts.width) == (height, width)
    return loaded if fits else None


def is_run_of(own: Scenario | None, packed: bytes, height: int, width: int) -> bool:
    """Return whether a feed's header is that of a scenario's run, on a terrain of this size.

    `own` is None where the viewer does not know the scenario; then any will do. Height and width are in points.
    """
    header = record_of(packed)
    scenario = scenario_of(header, height, width) if isinstance(header, Header) else None
    return scenario is not None and (own is None or same_but_for_files(scenario, own))


@dataclass(frozen=True, slots=True)
class RunChecks:
    """Checks records against what never changes in a run."""

    numbers: tuple[int, ...]  # in roster order
    ticks: int  # of the whole run
    bounds: tuple[float, float, float, float]  # of the terrain: least x and y, greatest x and y, m
    longest: int  # bytes of the longest record

    @classmethod
    def of(cls, scenario: Scenario, bounds: tuple[float, float, float, float]) -> RunChecks:
        """Return the checks of a scenario's run."""
        numbers = scenario.numbers
        return cls(numbers, min(scenario.ticks, MAX_TICKS), bounds, longest_record(len(numbers)))

    def record(self, packed: bytes, k: int) -> TickRecord | Event | End | None:
        """Return the record in a feed's bytes if it can follow on what came before; otherwise None.

        `k` is the tick that must come next.
        """
        record = record_of(packed, self.longest)
        match record:
            case TickRecord():
                fits = record.k == k and self.tick(record)
            case Event():
                fits = self.event(record)
            case End():
                fits = len(record.reason) <= MAX_CONTROL
            case _:
                return None
        return record if fits else None

    def tick(self, record: TickRecord) -> bool:
        """Return whether a tick can be of this run."""
        k = record.k
        if (
            k >= self.ticks
            or tuple(row.number for row in record.robots) != self.numbers
            or not all(map(self._check_row, record.robots))
        ):
            return False
        senders = {FORGED, *self.numbers}
        causes = (*record.dropped, *record.copies, *record.delayed)
        links = (*record.deliveries, *(link[:3] for link in causes))
        return (
            all(source in senders and len(frame) <= MAX_FRAME for source, frame in record.frames)
            and all(source in senders and to in senders and sequence <= _SEQUENCES for source, to, sequence in links)
            and all(len(cause) <= MAX_TEXT for cause in (*record.forged, *(link[3] for link in causes)))
            # At tick k, ground that was never seen has the age k + 1.
            and record.mfow <= k + 1
            and record.fog_mean <= k + 1
        )

    def event(self, event: Event) -> bool:
        """Return whether an event can be of this run."""
        is_known = event.robot is None or event.robot in self.numbers
        return is_known and event.k <= self.ticks and len(event.detail) <= MAX_CONTROL

    def events(self, packed: Sequence[bytes]) -> list[Event]:
        """Return the events of this run in an answer's bytes, and leave out anything else."""
        records = (record_of(payload, self.longest) for payload in packed)
        return [event for event in records if isinstance(event, Event) and self.event(event)]

    def _check_row(self, row: RobotTick) -> bool:
        x_min, y_min, x_max, y_max = self.bounds
        placed = x_min <= row.x <= x_max and y_min <= row.y <= y_max and abs(row.heading) <= MAX_ANGLE
        return (placed or not row.status.is_present) and len(row.state) <= MAX_TEXT
