"""The scenario: its sections put together, and what they must agree on.

Frozen pydantic models that refuse unknown keys. `patrol.scenario.load` reads and writes scenario files and is what
other modules import.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property
from operator import attrgetter
from pathlib import Path
from types import MappingProxyType
from typing import Any, Self

from pydantic import Field, model_validator

from patrol.closures.checks import check_closures
from patrol.closures.spec import Closures
from patrol.energy.checks import check_docks
from patrol.energy.spec import DockSpec
from patrol.faults.kinds import Faults
from patrol.faults.nemesis import NemesisSpec, room_for
from patrol.faults.roster import check_faults
from patrol.journal.records import MAX_TICKS
from patrol.radio.allowance import Share
from patrol.radio.message import MAX_TIME_MS, ms_to_s, s_to_ms
from patrol.scenario.lengths import BodyLengths, check_refinement, resolve_lengths
from patrol.scenario.policies import PaperPatrol, Patrol, StochasticPatrol, check_letter
from patrol.scenario.radio_spec import IdealRadio, Radio, check_radio_spec
from patrol.scenario.sections import IntruderSpec, RobotGroup, Robots, RobotSpec, SensorSpec, TerrainSpec, roster_of
from patrol.scenario.step import PAPER_STEP
from patrol.values import AUTO, BUILTINS, Name, Pace, Positive, Section, Seed, Step, wrong
from patrol.zones.checks import check_zones
from patrol.zones.spec import Zones


class Scenario(Section):
    """Everything that decides how a run goes."""

    LATER = MappingProxyType({"docks": (), "zones": (), "closures": ()})

    name: Name = Field("scenario", description="default: the file's or the terrain's name")
    terrain: TerrainSpec = Field(description=f"{{builtin: {' | '.join(BUILTINS)}}} or {{map: FILE.yaml}}")
    point: Positive = Field(0.1, description="m, side of one point of the grid")
    step: Step = Field(
        PAPER_STEP, description="s per tick; auto: at most 0.5, shorter where bodies on a map have little room"
    )
    duration: Positive = Field(5000.0, description="simulated s")
    seed: Seed = Field(7, description="random seed")
    pace: Pace = Field("lockstep", description="lockstep | realtime | a factor of real time")
    watchdog: Positive = Field(2.0, description="s without a command after which a robot stops")
    robots: Robots = Field(
        default_factory=RobotGroup, description="a group of equal robots, or a list with one entry per robot"
    )
    docks: tuple[DockSpec, ...] = Field((), description="{place: [x, y] m, radius: m}, one robot at a time")
    sensor: SensorSpec = Field(default_factory=SensorSpec, description="what a robot sees")
    patrol: Patrol = Field(default_factory=StochasticPatrol, description="how a robot decides where to go")
    radio: Radio = Field(default_factory=IdealRadio, description="what robots send")
    zones: Zones = Field((), description="what matters more, or is closed: a list, or FILE.yaml that holds one")
    closures: Closures = Field(
        (), description="doors and boxes that close at times: a list, or FILE.yaml that holds one"
    )
    intruders: tuple[IntruderSpec, ...] = Field(
        (), description="{place: [x, y] m, at: s, for: s or null}, standing still"
    )
    faults: Faults = Field((), description="what goes wrong, and when")
    nemesis: NemesisSpec | None = Field(None, description="random faults, written out when this file is loaded")

    @cached_property
    def roster(self) -> tuple[RobotSpec, ...]:
        """The robots in the order of their numbers, 1..N. It is no field: `model_dump` leaves it out."""
        return tuple(roster_of(self.robots))

    @cached_property
    def lengths(self) -> Mapping[int, BodyLengths]:
        """The lengths of every robot's patrol, by robot number, with each ``auto`` resolved."""
        return resolve_lengths(self.patrol, self.roster, self.point, self.step, self.sensor.range)

    @cached_property
    def assumed(self) -> frozenset[str]:
        """Dotted fields of what a run announces that its source leaves out. It is no field, like `roster`."""
        return frozenset()

    def meaning(self, files: bool = True) -> dict[str, Any]:
        """Return what it means, in plain values: no names, robots one by one, and files by their content.

        Without `files` none is read, and they enter by their presence.
        """
        says = self.model_dump(mode="json", exclude={"name", "robots", "nemesis"})
        self.reduce(says, files)
        if self.changes_ground:
            says["patrol"]["blocked_memory"] = self.patrol.blocked_memory
        return {**says, "robots": [spec.meaning for spec in self.roster]}

    @property
    def radio_share(self) -> Share | None:
        """Each robot's share of the radio's budget, spare robots included; None where there is no budget."""
        return self.radio.share(len(self.roster), self.step)

    def model_copy(self, *, update: Mapping[str, Any] | None = None, deep: bool = False) -> Self:
        """Copy like any model; a copy makes its own roster and lengths."""
        copied = super().model_copy(update=update, deep=deep)
        for derived in ("roster", "lengths"):
            copied.__dict__.pop(derived, None)
        return copied

    def known_to_robots(self) -> Self:
        """Leave out the sections that robots do not know."""
        return self.model_copy(update={"faults": (), "nemesis": None, "intruders": (), "closures": ()})

    @property
    def changes_ground(self) -> bool:
        """True if parts of the ground close and open."""
        return bool(self.closures)

    @property
    def numbers(self) -> tuple[int, ...]:
        """The numbers of the robots, 1..N."""
        return tuple(spec.number for spec in self.roster)

    @property
    def spares(self) -> frozenset[int]:
        """Numbers of the robots that are not there until they join."""
        return frozenset(spec.number for spec in self.roster if spec.spare)

    @property
    def team(self) -> int:
        """Number of robots without the spare ones."""
        return len(self.roster) - len(self.spares)

    @property
    def ticks(self) -> int:
        """Number of steps of the run."""
        return round(self.duration / self.step)

    @property
    def factor(self) -> float | None:
        """Simulated seconds per wall second, or None in lockstep."""
        if isinstance(self.pace, float):
            return self.pace
        return 1.0 if self.pace == "realtime" else None

    @property
    def base(self) -> Path:
        """The folder of relative paths: the current one. A scenario read from a file has absolute ones."""
        return Path()

    @model_validator(mode="after")
    def _fits_together(self) -> Self:
        if self.radio.via == "direct":
            self._check_direct()
        if self.step > self.duration:
            limit = f"shorter than one step of {self.step:g} s; give at least {self.step:g}"
            raise wrong("duration", limit, self.duration)
        if self.duration / self.step > MAX_TICKS or s_to_ms(self.duration) > MAX_TIME_MS:
            limit = f"too long: at most {int(ms_to_s(MAX_TIME_MS))} s and {MAX_TICKS} steps fit"
            raise wrong("duration", limit, self.duration)
        for field in ("watchdog", "radio.forget_after"):
            if (value := attrgetter(field)(self)) < self.step:
                limit = f"shorter than one step of {self.step:g} s, so it would end between two messages; give more"
                raise wrong(field, limit, value)
        for field in ("sensor.range", "patrol.goal_distance", "patrol.refine_reach"):
            if (value := attrgetter(field)(self)) != AUTO and value < self.point:
                raise wrong(field, f"shorter than one point of {self.point:g} m; give more, or a smaller point", value)
        check_radio_spec(self.radio, self.roster, self.step, self.sensor, intruders=bool(self.intruders))
        self._check_roster()
        check_refinement(self.patrol, self.roster, self.lengths)
        if isinstance(self.patrol, PaperPatrol):
            check_letter(self.patrol, (spec.model for spec in self.roster), bool(self.intruders))
        check_zones(self.zones, self.roster, self.step, self.ticks)
        check_closures(self.closures, self.patrol.paths, self.step)
        names, closures = ([spec.name for spec in specs] for specs in (self.roster, self.closures))
        check_faults(self.faults, names, self.spares, closures, self.step, self.ticks, self.seed)
        if self.nemesis is not None:
            room_for(self.nemesis, self.step, self.ticks)
        return self

    def _check_direct(self) -> None:
        if self.factor is None:
            limit = "direct radio waits for no tick, and pace is lockstep; set pace to realtime or to a factor"
            raise wrong("radio.via", limit)
        for index, fault in enumerate(self.faults):
            if fault.acts_on == "frames":
                limit = f"{fault.kind} acts on frames in the ether, and radio.via is direct; disturb the network itself"
                raise wrong(f"faults.{index}", limit)

    def _check_roster(self) -> None:
        if all(spec.spare for spec in self.roster):
            raise wrong("robots", "all robots are spare, so none patrols; leave spare out for one")
        check_docks(self.docks, self.roster)
        names: dict[str, int] = {}
        for spec in self.roster:
            if names.setdefault(spec.name, spec.number) != spec.number:
                raise wrong(
                    f"{spec.section}.name", f"robot {names[spec.name]} has the name {spec.name} too; rename one"
                )
            if spec.speed * self.step > (longest_leap := 2.0 * self.sensor.range):
                leap = f"a stride of {spec.speed * self.step:g} m leaps over ground that a sensor with a range of "
                remedy = f"give at most {longest_leap / self.step:g}, a shorter step or a longer sensor.range"
                limit = f"{leap}{longest_leap / 2.0:g} m never sees; {remedy}"
                raise wrong(f"{spec.section}.speed", limit, spec.speed)
