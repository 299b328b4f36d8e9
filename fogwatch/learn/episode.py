"""An episode: one run of a scenario in this process, halted in each tick where the robots decide.

Theory of operation
    A tick has two halves (`worldsim.fleet.loop`). In the first, robots sense, send and hear; in the second they decide
    and move. An episode stands between the two: what each robot believes is known, and its action is awaited. `advance`
    does the second half of this tick and the first half of the next. The robots' policies only carry out the actions
    that were given before, so minds, bodies, radio, faults and journal are those of any other run.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

from agent.learned.network import Action, Decisions
from agent.policies.found import PolicyKind
from fogwatch.inprocess import fleet_of
from patrol.prepare import sensor_footprint
from patrol.scenario.policies import LEARNED
from worldsim.fleet.acts import Acts
from worldsim.fleet.loop import act_between_ticks, begin_tick, end_tick
from worldsim.output.record import Recorder, header_of
from worldsim.run_record import COMPLETED, DESERTED, MemoryJournal
from worldsim.world import World

if TYPE_CHECKING:
    from agent.ports import Intent, PolicySetup
    from agent.view import View
    from patrol.journal import TickRecord
    from patrol.prepare import Prepared
    from patrol.scenario.policies import LearnedOptions


def _raise_error(number: int, reason: str, error: BaseException | None) -> None:
    """Stop a training in which a robot stands because of an error of its own."""
    raise RuntimeError(f"r{number}: {reason}") from error


class Driven:
    """A policy whose decisions are made outside; without an `action` it goes on as before."""

    def __init__(self, decisions: Decisions) -> None:
        """Take what carries the decisions out."""
        self.decisions = decisions
        self.action: Action | None = None

    def decide(self, view: View) -> Intent:
        """Take the action, if there is one, and do what it means."""
        if self.action is not None:
            self.decisions.take(self.action, view)
        return self.decisions.intent(view)


class Episode:
    """One run of a scenario, tick by tick.

    Attributes:
        world: The ground truth.
        journal: The run's records; of its ticks none unless they are kept.
        views: By robot number, what each robot that takes part in this tick may know.
        over: Whether no tick is left, or no robot.
    """

    def __init__(self, prepared: Prepared, options: LearnedOptions, *, keep: bool = False) -> None:
        """Begin with the first tick.

        Args:
            prepared: The scenario.
            options: What robots see and decide.
            keep: Whether to keep the records of all ticks, which takes memory.

        Raises:
            BadInput: The scenario cannot be run.
        """
        footprint = sensor_footprint(prepared.scenario, prepared.terrain)
        self.world = World(prepared, footprint=footprint)
        self.views: Mapping[int, View] = {}
        self.over = False
        self._options = options
        self._driven: dict[int, Driven] = {}
        kind = PolicyKind(LEARNED, self._make_driven, prepared.scenario.patrol.options, ours=True)
        self._fleet = fleet_of(self.world, footprint, kind=kind, failure=_raise_error)
        self.journal = MemoryJournal(header_of(self.world), keep)
        self._recorder = Recorder(self.journal, prepared.scenario.spares)
        self._acts = Acts(self.world, self._fleet)
        self._begin_tick()

    @property
    def trace_hash(self) -> str:
        """The trace hash of the ticks so far: that of the run, once it is over."""
        return self._recorder.trace_hash

    def decisions(self, number: int) -> Decisions:
        """Return the decisions of the present process of a robot that takes part in this tick."""
        return self._driven[number].decisions

    def take(self, number: int, action: Action) -> None:
        """Give a robot its action for this tick; without one it goes on as before.

        A robot that surrounds an intruder or goes to its dock does not ask for it, and it is lost. The robot takes part
        in this tick; the action is as its `Decisions` take it.
        """
        self._driven[number].action = action

    def advance(self) -> TickRecord:
        """Let the robots act, and begin the next tick; return the record of the tick that this ends."""
        records: list[TickRecord] = []
        end_tick(self.world, self._fleet, self._begun, records.append, self._recorder.event)
        self._recorder.tick(records[0])
        for driven in self._driven.values():
            driven.action = None
        self._begin_tick()
        return records[0]

    def will_be_alive(self, number: int) -> bool:
        """Return True if a robot takes part in ticks, or will again."""
        return self._acts.will_be_alive(number)

    def _begin_tick(self) -> None:
        """Begin the next tick; after the last one only to know what robots see at the end."""
        if self.world.tick >= self.world.ticks:
            self._end_recording(COMPLETED)
        elif not act_between_ticks(self.world, self._acts, self._recorder.event):
            self._end_recording(DESERTED)
        self._begun = begin_tick(self.world, self._fleet)
        self.views = self._fleet.look(self.world.tick, self._begun.heard)

    def _end_recording(self, reason: str) -> None:
        self.over = True
        self._recorder.end(reason)

    def _make_driven(self, setup: PolicySetup) -> Driven:
        """Make the policy of a robot's new process."""
        self._driven[setup.robot.spec.number] = driven = Driven(Decisions(setup, self._options))
        return driven
