"""The kinds, features and states that runs have met, as names such as ``fault loss`` or ``state: a battery is empty``.

A kind of fault is met where it began while a robot was alive. Two names form a pair where one run has met both.
"""

import math
from collections.abc import Iterable, Mapping
from itertools import combinations

from agent.policies.found import POLICIES
from patrol.faults.kinds import KINDS, Silence
from patrol.ground.doors import Rooms
from patrol.journal import Event, RobotTick, Status, TickRecord
from patrol.journal.records import CHARGING, CLOSED, DOCKING, FORGED, STAYS_OPEN, SURROUNDING, sent_at
from patrol.pose import MODELS, Pose
from patrol.prepare import Prepared
from patrol.scenario import Scenario
from patrol.values import BUILTINS
from patrol.zones.ground import SpeedLimits
from patrol.zones.spec import zones_in_force
from worldsim.faults import SKIPPED, WAITING
from worldsim.world import World

ZONES = ("keep-out", "weight", "weights that change", "age", "slow", "times")
FEATURES = (
    *("adaptive sending", "batteries", "direct radio", "docks", "radio budget"),
    *("closures by rates", "closures by times", "graph", "vertices", "intruders", "key", "several bodies"),
    *("narrow view", "view through walls", "poor quality", "path loss", "spares", "trail"),
    *(f"zone: {rule}" for rule in ZONES),
)
STATES = {
    "door": "two robots met in a door",
    "silent door": "two robots met in a door while one of them was silent",
    "bump": "a move was cancelled",
    "dead end": "a robot was in a dead end",
    "closed": "a closure closed",
    "waiting door": "a closure waited for a robot to leave it",
    "kept open": "a closure stayed open because it was to open again",
    "charging": "a robot charged",
    "queue": "a robot was on its way to a dock while another charged",
    "empty": "a battery was empty",
    "down while charging": "a robot was killed, paused or taken away while it charged",
    "killed while paused": "a paused robot was killed or restarted",
    "start taken": "a robot could not appear because another stood on its start",
    "skipped": "an act on a robot made no sense and was skipped",
    "last": "all robots but one were down",
    "late": "a frame arrived from a robot that was down",
    "forged": "a forged frame arrived",
    "in a wall": "a robot believed itself in a wall",
    "surrounded": "two robots surrounded an intruder",
    "slow": "a robot was in a slow zone in force",
    "all silent": "no frame arrived although two robots were alive",
}
"""Short names of the states that must sometimes occur, and what they are."""

NEAR = 1.0
"""Gap between two bodies that meet, in the radius of the larger one."""

SINGLES = (
    *(f"fault {kind}" for kind in KINDS),
    *(f"feature {name}" for name in FEATURES),
    *(f"policy {name}" for name in POLICIES.built_in),
    *(f"body {model}" for model in MODELS),
    *(f"terrain {name}" for name in (*BUILTINS, "building")),
    *(f"state: {what}" for what in STATES.values()),
)
"""Everything that can be met."""

PAIRED = ("fault", "feature")
"""Families whose pairs are counted."""


def of_scenario(scenario: Scenario) -> set[str]:
    """Return what a scenario meets by being run, without its faults and states."""
    radio, sensor, zones = scenario.radio, scenario.sensor, scenario.zones
    features: Mapping[str, object] = {
        "adaptive sending": radio.adaptive,
        "batteries": any(spec.battery for spec in scenario.roster),
        "docks": scenario.docks,
        "radio budget": radio.budget,
        "closures by rates": any(closure.closes for closure in scenario.closures),
        "closures by times": any(closure.closed for closure in scenario.closures),
        "graph": scenario.terrain.graph,
        "vertices": scenario.terrain.patrolled == "vertices",
        "intruders": scenario.intruders,
        "key": radio.key,
        "several bodies": len({spec.model for spec in scenario.roster}) > 1,
        "narrow view": sensor.angle < 360.0,
        "view through walls": not sensor.line_of_sight,
        "poor quality": sensor.quality != 1.0,
        "path loss": radio.model == "path-loss",
        "spares": scenario.spares,
        "trail": radio.trail,
        "zone: keep-out": any(zone.keep_out for zone in zones),
        "zone: weight": any(zone.weight for zone in zones),
        "zone: weights that change": any(zone.weights for zone in zones),
        "zone: age": any(zone.age for zone in zones),
        "zone: slow": any(zone.speed for zone in zones),
        "zone: times": any(zone.times for zone in zones),
    }
    return {
        *(f"feature {name}" for name, present in features.items() if present),
        f"policy {scenario.patrol.policy}",
        *(f"body {spec.model}" for spec in scenario.roster),
        f"terrain {scenario.terrain.builtin or 'building'}",
    }


def pairs(met: Iterable[str]) -> set[tuple[str, str]]:
    """Return the pairs of kinds of faults and features that a run has met."""
    return set(combinations(sorted(name for name in met if name.split()[0] in PAIRED), 2))


class Watch:
    """Notes which states a run meets; `watch` of `run_in_process` makes it."""

    def __init__(self, world: World) -> None:
        """Look at a world before its first tick."""
        self._world = world
        self._limits = SpeedLimits(world.scenario.zones, world.terrain)
        self._silences = [entry for entry in world.timeline.entries if isinstance(entry.fault, Silence)]
        self._before: tuple[RobotTick, ...] = ()
        self._radii = {spec.number: spec.radius for spec in world.scenario.roster}
        self._doors = _doors(world.prepared)
        self.met = of_scenario(world.scenario)
        self._begins = [(entry.begin, entry.fault.kind) for entry in world.timeline.entries]

    def event(self, event: Event) -> None:
        """Take in an event."""
        if event.kind == CLOSED:
            self._note("closed")
        elif event.kind == STAYS_OPEN:
            self._note("kept open")
        elif event.kind == SKIPPED:
            self._note("skipped")
        elif event.kind == WAITING:
            self._note("start taken" if "its start is taken" in event.detail else "waiting door")

    def tick(self, record: TickRecord) -> None:
        """Take in a tick."""
        rows = {row.number: row for row in record.robots}
        alive = [row for row in record.robots if row.status is Status.ALIVE]
        if alive:
            self.met.update(f"fault {kind}" for begin, kind in self._begins if begin == record.k)
        self._look_at_frames(record, rows, len(alive))
        self._look_at_doors([row for row in record.robots if row.status.is_present], record.k)
        in_force = zones_in_force(self._world.scenario.zones, record.k * self._world.step)
        holds = {
            "bump": any(row.bumped for row in alive),
            "dead end": any(row.state == "dead-end" for row in alive),
            "charging": any(row.state == CHARGING for row in alive),
            "queue": {CHARGING, DOCKING} <= {row.state for row in alive},
            "empty": any(self._world.batteries.is_empty(row.number) for row in alive),
            "last": len(rows) > 2 and len(alive) == 1,
            "surrounded": sum(row.state == SURROUNDING for row in alive) > 1,
            "in a wall": any(self._is_in_a_wall(row, record.k) for row in alive),
            "slow": any(math.isfinite(self._limits.at(row.x, row.y, in_force)) for row in alive),
            "down while charging": any(
                row.state == CHARGING and rows[row.number].status is not Status.ALIVE for row in self._before
            ),
            "killed while paused": any(
                row.status is Status.PAUSED and rows[row.number].status is Status.DEAD for row in self._before
            ),
        }
        for name, is_met in holds.items():
            if is_met:
                self._note(name)
        self._before = record.robots

    def _note(self, name: str) -> None:
        self.met.add(f"state: {STATES[name]}")

    def _look_at_frames(self, record: TickRecord, rows: Mapping[int, RobotTick], alive: int) -> None:
        arrived = False
        for source, _, sequence in record.deliveries:
            arrived = True
            if source == FORGED:
                self._note("forged")
            elif sent_at(sequence) < record.k and rows[source].status is not Status.ALIVE:
                self._note("late")
        if alive > 1 and not arrived:
            self._note("all silent")

    def _look_at_doors(self, present: list[RobotTick], k: int) -> None:
        for row, other in combinations(present, 2):
            larger = max(self._radii[row.number], self._radii[other.number])
            gap = math.dist((row.x, row.y), (other.x, other.y)) - self._radii[row.number] - self._radii[other.number]
            if gap > NEAR * larger or Status.ALIVE not in (row.status, other.status):
                continue
            middle = 0.5 * (row.x + other.x), 0.5 * (row.y + other.y)
            if any(math.dist(middle, (x, y)) <= 0.5 * width + larger for x, y, width in self._doors):
                self._note("door")
                if self._is_silent(row, k) or self._is_silent(other, k):
                    self._note("silent door")

    def _is_silent(self, row: RobotTick, k: int) -> bool:
        return row.status is not Status.ALIVE or any(
            row.number in entry.who and entry.begin <= k and (entry.end is None or k < entry.end)
            for entry in self._silences
        )

    def _is_in_a_wall(self, row: RobotTick, k: int) -> bool:
        terrain = self._world.terrain
        pose = self._world.senses.pose(row.number, k, Pose(row.x, row.y, row.heading))
        place = terrain.point_at(pose.x, pose.y)
        return not terrain.inside(*place) or not terrain.free[place]


def _doors(prepared: Prepared) -> list[tuple[float, float, float]]:
    """Return x, y and width of the doors of the first robot's ground, m."""
    spec = prepared.scenario.roster[0]
    rooms = Rooms(prepared.terrain, spec.radius, prepared.fields[spec.number].reach)
    return [(door.x, door.y, door.width) for door in rooms.doors()]
