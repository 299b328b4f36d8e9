"""The session between the world and a robot's process: the states of both ends, and the events that move them.

Theory of operation
===================

The world greets, the process answers and is given the robot's seat. From then on a tick is two questions and two
answers, until the world dismisses the process:

    the world's end                                          the robot's end
    EXPECTED              Hello     ---------------------->  UNGREETED -> OFFERED
    EXPECTED -> SEATED              <----------------------  HelloReply
                          PhaseA    ---------------------->  OFFERED -> DUE; -> AWAITS_B when its mind takes the tick
                                    <----------------------  ReplyA: frames
                          PhaseB    ---------------------->  AWAITS_B -> AWAITS_A
                                    <----------------------  ReplyB: the command
                          PhaseA    ---------------------->  AWAITS_A -> DUE, and so on
    SEATED -> DISMISSED   Stop      ---------------------->  any -> LEFT
                                    <----------------------  Farewell

Each end is a state machine without I/O. It is told what happens and when: a message has arrived, a liveliness token has
come or gone, time has passed, the mind takes a tick, the world dismisses a robot. It returns effects as values, and its
caller (`agent.robots.sim.SimRobot`, `worldsim.fleet.sessions.Sessions`) carries them out in their order. For example, a
robot that run 5 greets at time 100.0 answers:

    >>> robot.arrived(Hello(0, ANYONE, 0, 5), 100.0)
    (Send(message=HelloReply(incarnation=1, instance=77, k=0, run=5, scenario='a1b2...', protocol=8)),)

`ROBOT` and `SEAT` hold all steps that are legal. These rules always hold:

- An event that a state has no step for changes nothing, and its message is refused as a "stranger". A step may still
  refuse a message for what it says: its tick has not begun ("ahead") or is too old ("late"), or the seat is another
  process's ("seat").
- Roles decide which process may send which message (`runtime.security.roles`): an end believes each message for its
  process and its run.
- A world that greets a robot may end before its first tick. So a robot answers several, and the first phase A binds it
  to the run of that world. Once bound, it leaves only when that world says so or is gone.
- A tick is decided once. A phase that comes again gets the same bytes again.
- At a pace the world waits for no robot: a newer phase A replaces one that the mind has not taken, but each phase B
  counts, in whatever order they come, because each brings other frames.
- One process speaks for a robot: the first that answers. Others are turned away, whenever they ask.
- A liveliness token that comes or goes moves neither end. One that has gone is no farewell: a router closes the
  connection of a client that does not read, and takes all tokens along when it ends. A process is gone when its
  launcher says so; without a launcher, when it has said farewell or stays away for `RETURN_S`.
- LEFT is final. The farewell is sent then, and nothing after it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum
from typing import TypeVar

from runtime.messages.phases import (
    ANYONE,
    NO_RUN,
    PROTOCOL,
    UNLIKE,
    Failed,
    Farewell,
    Hello,
    HelloReply,
    PhaseA,
    PhaseB,
    ReplyA,
    ReplyB,
    Stop,
    ToRobot,
    ToWorld,
)
from runtime.net.mailbox import Presence

SILENCE_S = 5.0
"""Silence of the world after which a robot asks whether it is still part of the run, s."""
UNGREETED_S = 1.0
"""Interval at which a robot asks for a greeting until a world has greeted it, s."""
GRACE_S = 0.3
"""Time without a token, while the router answers, before its robot can count as gone, s."""
RETURN_S = 12.0
"""The same for a robot that no launcher has started and that has not said farewell, s. One that was cut off may have
10 s left of an attempt to connect when the network is back, and the next begins half a second later."""
MESH_RETURN_S = 120.0
"""The same in a mesh at a pace, s. A robot that is cut off loses its token within seconds there, and delays none."""
OLDEST = 256
"""Age of the oldest tick whose answer a world still takes."""

_PAUSE_S = 2.0
_OFFERS = 8
"""Worlds that a robot answers at most, until one of them has begun a tick."""

# --- states, events and steps ----------------------------------------------------------------------------------------

RobotStage = Enum("RobotStage", "UNGREETED OFFERED DUE AWAITS_B AWAITS_A LEFT")
RobotEvent = Enum("RobotEvent", "GREETED OUSTED STRANGER BEGUN HEARD HEARD_OTHER REPEATED TAKEN TAKEN_HEARD LEAVES")
SeatStage = Enum("SeatStage", "VACANT EXPECTED SEATED FAILING DISMISSED")
SeatEvent = Enum("SeatEvent", "EXPECT END ASKS CLAIMS DIFFERS INTRUDES STRANGER RETURNS ANSWERS FAILS DISMISS LEAVES")

S = TypeVar("S", RobotStage, SeatStage)
E = TypeVar("E", RobotEvent, SeatEvent)


def _read_steps(stages: type[S], events: type[E], table: str) -> Mapping[tuple[S, E], S]:
    """Read a table: a row for each event, a column for each state, and the next state where an event is legal."""
    head, *rows = [line.split() for line in table.strip().splitlines()]
    columns = list(enumerate(head, 1))
    return {(stages[column], events[on[0]]): stages[on[to]] for on in rows for to, column in columns if on[to] != "-"}


ROBOT = _read_steps(
    RobotStage,
    RobotEvent,
    """
                UNGREETED  OFFERED   DUE       AWAITS_B  AWAITS_A  LEFT
    GREETED     OFFERED    OFFERED   DUE       AWAITS_B  AWAITS_A  -     by a world; once bound, by its own
    OUSTED      -          -         LEFT      LEFT      LEFT      -     greeted by another world, its own being gone
    STRANGER    -          -         -         -         -         -     for another process, or of another run
    BEGUN       -          DUE       DUE       DUE       DUE       -     phase A of a newer tick
    HEARD       -          -         DUE       AWAITS_A  -         -     phase B of the tick taken last
    HEARD_OTHER -          -         DUE       AWAITS_B  AWAITS_A  -     phase B of another tick
    REPEATED    -          -         DUE       AWAITS_B  AWAITS_A  -     a phase that was answered, or is over
    TAKEN       -          -         AWAITS_B  -         -         -     the mind takes the tick that is due
    TAKEN_HEARD -          -         AWAITS_A  -         -         -     the same, its phase B having come already
    LEAVES      LEFT       LEFT      LEFT      LEFT      LEFT      -     told to, or no world has been there for long
    """,
)
"""Steps of the robot's end. In DUE, AWAITS_B and AWAITS_A it is bound to a run."""

SEAT = _read_steps(
    SeatStage,
    SeatEvent,
    """
                VACANT     EXPECTED  SEATED    FAILING   DISMISSED
    EXPECT      EXPECTED   EXPECTED  EXPECTED  EXPECTED  EXPECTED   a process is going to be started
    END         VACANT     VACANT    VACANT    VACANT    VACANT     the process is gone for good
    ASKS        VACANT     EXPECTED  -         -         -          a process asks to be greeted
    CLAIMS      -          SEATED    -         -         -          a process answers the greeting
    DIFFERS     -          EXPECTED  -         -         -          it has another scenario or version
    INTRUDES    VACANT     EXPECTED  SEATED    FAILING   DISMISSED  a process wants a seat that is not for it
    STRANGER    -          -         -         -         -          of a process without a seat, or of another run
    RETURNS     -          -         SEATED    FAILING   DISMISSED  the seated process asks whether it still belongs
    ANSWERS     -          -         SEATED    FAILING   -          it answers a phase
    FAILS       -          -         FAILING   FAILING   -          its mind cannot go on
    DISMISS     -          -         DISMISSED DISMISSED DISMISSED  the world tells it to leave
    LEAVES      VACANT     EXPECTED  SEATED    FAILING   DISMISSED  a process that has, or had, the seat has left
    """,
)
"""Steps of the world's end of one robot's session."""


# --- effects ---------------------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class Send:
    """Send a message to the other end."""

    message: Hello | HelloReply | Stop


@dataclass(frozen=True, slots=True)
class Refuse:
    """Count a message that is refused, by reason."""

    reason: str


@dataclass(frozen=True, slots=True)
class Deliver:
    """Hand on frames for the mind, or an answer for the tick that may wait for it."""

    message: PhaseB | ReplyA | ReplyB


@dataclass(frozen=True, slots=True)
class Repeat:
    """Send the answer to this phase again, if it is the last one."""

    phase: PhaseA | PhaseB


@dataclass(frozen=True, slots=True)
class Halt:
    """Withdraw the last command, if that has not been done: no pose has come for long."""


@dataclass(frozen=True, slots=True)
class Part:
    """Say farewell and leave the fleet; orderly where the run is over."""

    reason: str
    orderly: bool = False


@dataclass(frozen=True, slots=True)
class Unanswered:
    """Say that no world has answered for so long, s."""

    waited_s: float


@dataclass(frozen=True, slots=True)
class Unlike:
    """Call off a run that has not begun: a process is not like the world. Otherwise count that the seat was refused."""

    what: str


Effects = tuple[Send | Refuse | Deliver | Repeat | Halt | Part | Unanswered | Unlike, ...]


# --- the robot's end -------------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class Identity:
    """The identity of a robot's process."""

    name: str
    incarnation: int  # counts the robot's processes, from 1
    instance: int  # random number of this process, above 0
    scenario: str  # hash


class RobotEnd:
    """The robot's end. Times are in s.

    `k` is the tick that the mind has taken last, -1 before the first. `world_present` is True where the fleet has a
    world, which may not have greeted this robot yet.
    """

    def __init__(self, identity: Identity, patience_s: float, blind_s: float, now: float) -> None:
        """Begin without a world.

        The robot leaves after `patience_s` without a world and stops after `blind_s` without a new pose, which is
        infinite in lockstep, where the world waits.
        """
        self.stage = RobotStage.UNGREETED
        self.world_present = False
        self.k = -1
        self._identity = identity
        self._patience_s = patience_s
        self._blind_s = blind_s
        self._unbroken = True  # no token has disappeared since our own world's last message
        self._own_news = self._last_news = self._last_said = self._posed = now
        self._runs: list[int] = []  # of the worlds that have greeted this robot; once bound, its own alone
        self._due: PhaseA | None = None
        self._heard_k = -1
        self._early: set[int] = set()  # later ticks whose phase B has come

    def arrived(self, message: ToRobot | Presence, now: float) -> Effects:
        """Take in a message, or a change of the world's liveliness token."""
        if isinstance(message, Presence):
            self.world_present = message.present
            # False until its own world speaks again: a token that comes back may be another world's.
            self._unbroken = self._unbroken and message.present
            self._last_news = now
            return ()
        event = self._event_of(message, now)
        if not self._follow_event(event):
            return () if self.has_left else (Refuse("stranger"),)
        if event is not RobotEvent.OUSTED:
            self._own_news = self._last_news = now
            self._unbroken = True
        effects: Effects = ()
        match event, message:
            case RobotEvent.OUSTED, _:
                effects = (Part("another world has taken over this fleet"),)
            case _, Stop(reason=reason, orderly=orderly):
                effects = (Part(reason, orderly),)
            case _, Hello() as hello:
                effects = self._answer_greeting(hello, now)
            # Before the two cases below, which it would match as well.
            case RobotEvent.REPEATED, (PhaseA() | PhaseB()) as phase:
                effects = (Repeat(phase),)
            case _, PhaseA() as phase:
                # From here on no other run is known, whatever has greeted this robot before.
                self._runs = [phase.run]
                self._due, self._posed = phase, now
            case _, PhaseB() as phase:
                self._note_heard(phase.k)
                effects = (Deliver(phase),)
        return effects

    def waited(self, for_s: float, now: float) -> Effects:
        """Look at the clock in a wait for messages, so long after the last look.

        After a silence the robot asks whether it still belongs to the run, or leaves when the world is lost. A pause of
        its own process, between two looks, is no silence.
        """
        if self.has_left:
            return ()
        # This process stood still, so what came meanwhile is not read yet and may not be missed.
        if for_s > _PAUSE_S:
            self._last_news += for_s
            self._posed += for_s
        effects: Effects = (Halt(),) if now - self._posed > self._blind_s else ()
        silent_s = now - self._last_news
        if not self.world_present and silent_s > self._patience_s:
            return effects + self.leave(f"no world for {silent_s:.0f} s")
        # Not more often, even where no answer comes.
        if min(silent_s, now - self._last_said) > (SILENCE_S if self._runs else UNGREETED_S):
            # Unbound, it asks any world; bound, only the world of its run.
            effects += self._say_hello(self._run if self._is_bound else NO_RUN, now)
            if not self._runs or not self.world_present:
                effects += (Unanswered(silent_s),)
        return effects

    def leave(self, reason: str) -> Effects:
        """Leave for a reason of the robot's own."""
        return (Part(reason),) if self._follow_event(RobotEvent.LEAVES) else ()

    def take(self) -> PhaseA | None:
        """Give the mind phase A of the newest tick; None where no tick is due."""
        if self._due is None:
            return None
        # At a pace, phase B of a tick may have come before the mind takes the tick.
        phase, has_heard = self._due, self._has_heard(self._due.k)
        if not self._follow_event(RobotEvent.TAKEN_HEARD if has_heard else RobotEvent.TAKEN):
            return None
        self._due, self.k = None, phase.k
        return phase

    def head(self, k: int) -> tuple[int, int, int, int]:
        """Return the first fields of a message about a tick."""
        return self._identity.incarnation, self._identity.instance, k, self._run

    @property
    def has_left(self) -> bool:
        """True if nothing follows any more."""
        return self.stage is RobotStage.LEFT

    @property
    def _run(self) -> int:
        return self._runs[-1] if self._runs else NO_RUN

    @property
    def _is_bound(self) -> bool:
        return self.stage not in (RobotStage.UNGREETED, RobotStage.OFFERED)

    @property
    def _newest_k(self) -> int:
        return self.k if self._due is None else self._due.k

    def _has_heard(self, k: int) -> bool:
        return k <= self._heard_k or k in self._early

    def _note_heard(self, k: int) -> None:
        if k > self._newest_k:
            self._early.add(k)
        else:
            self._heard_k = k
            # `_heard_k` covers the earlier ones, which would pile up.
            self._early = {early for early in self._early if early > k}

    def _follow_event(self, event: RobotEvent) -> bool:
        following = ROBOT.get((self.stage, event))
        self.stage = following or self.stage
        return following is not None

    def _event_of(self, message: ToRobot, now: float) -> RobotEvent:
        is_known = message.run in self._runs
        if isinstance(message, Hello):
            # A token that has gone and come may be another world's: then only a recent message counts.
            own_is_there = (self.world_present and self._unbroken) or now < self._own_news + SILENCE_S
            refusal = RobotEvent.STRANGER if own_is_there else RobotEvent.OUSTED
            return refusal if self._is_bound and not is_known else RobotEvent.GREETED
        # Two processes of one robot listen under the same key: messages name the one they are for.
        if (message.incarnation, message.instance) != (self._identity.incarnation, self._identity.instance):
            return RobotEvent.STRANGER
        if isinstance(message, Stop):
            # Until a world has greeted it, any world may turn it away.
            return RobotEvent.STRANGER if self._runs and not is_known else RobotEvent.LEAVES
        # A phase of a run that has never greeted this robot is not for it.
        return self._event_of_phase(message) if is_known else RobotEvent.STRANGER

    def _event_of_phase(self, phase: PhaseA | PhaseB) -> RobotEvent:
        if phase.k <= self._newest_k if isinstance(phase, PhaseA) else self._has_heard(phase.k):
            return RobotEvent.REPEATED
        if isinstance(phase, PhaseA):
            return RobotEvent.BEGUN
        return RobotEvent.HEARD if phase.k == self.k else RobotEvent.HEARD_OTHER

    def _answer_greeting(self, message: Hello, now: float) -> Effects:
        if message.run not in self._runs:
            # Only the latest, or worlds that come and go would make the list grow.
            # The newest last: `_run` is the one that a farewell goes to.
            self._runs = [*self._runs, message.run][-_OFFERS:]
        return self._say_hello(message.run, now)

    def _say_hello(self, run: int, now: float) -> Effects:
        self._last_said = now
        # A message has no tick below 0.
        return (Send(HelloReply(*self.head(max(self.k, 0))[:3], run, self._identity.scenario)),)


# --- the world's end -------------------------------------------------------------------------------------------------


@dataclass(slots=True)
class WorldRun:
    """A run as a world offers it to its robots."""

    number: int  # random number of the run
    scenario: str  # hash
    return_s: float = RETURN_S  # time without a token after which a process is gone
    k: int = 0  # the newest tick that a robot was told of
    begun: int = 0  # number of ticks that have begun

    def unlike(self, message: HelloReply) -> str:
        """Return what of a process is not as in this run, and the remedy; empty when all is."""
        if message.protocol != PROTOCOL:
            versions = f"{message.protocol}, the world's is {PROTOCOL}"
            return f"protocol ({versions}); run the same version of fogwatch on all hosts"
        if message.scenario != self.scenario:
            hashes = f"hash {message.scenario[:12]}, the world's is {self.scenario[:12]}"
            return f"scenario ({hashes}); give all processes the same file"
        return ""


class WorldEnd:
    """The world's end of one robot's session. Times are in s.

    `present` is True while there is a liveliness token of the robot. `away_since` is when it was found to have gone,
    None where it is there or was never seen. `process` is the one in the seat, by incarnation and instance. `reason`
    says why the mind cannot go on, or why the process was dismissed.
    """

    def __init__(self, run: WorldRun, number: int, name: str, *, expected: bool = True) -> None:
        """Begin without a process; where one is `expected`, it may be of any incarnation."""
        self.stage = SeatStage.EXPECTED if expected else SeatStage.VACANT
        self.number = number
        self.name = name
        self.present = False
        self.away_since: float | None = None
        self.process: tuple[int, int] | None = None
        self.reason = ""
        self._farewells: dict[tuple[int, int], bool] = {}  # by each process that has, or had, the seat
        self._run = run
        self._incarnation: int | None = None  # the only one expected; None for any

    def arrived(self, message: ToWorld | Presence, now: float) -> Effects:
        """Take in a message under the robot's key, or a change of its liveliness token."""
        if isinstance(message, Presence):
            self.present = message.present
            # Where a token goes twice, the first time counts.
            self.away_since = None if self.present else now if self.away_since is None else self.away_since
            return self.greet()
        event = self._event_of(message)
        effects: Effects = ()
        match message:
            case _ if not self._follow_event(event):
                effects = (Refuse("stranger"),)
            # A tick that has not begun was not asked for; a very old one may be a replay.
            case ReplyA() | ReplyB() if self._run.begun - OLDEST <= message.k < self._run.begun:
                effects = (Deliver(message),)
            case ReplyA() | ReplyB():
                effects = (Refuse("ahead" if message.k >= self._run.begun else "late"),)
            case HelloReply():
                effects = self._answer_hello(message, event)
            case Farewell():
                self._farewells[message.incarnation, message.instance] = True
            case Failed():
                self.reason = message.reason
        return effects

    def greet(self) -> Effects:
        """Greet a process that is expected, if one is there."""
        if not self.present or self.stage is not SeatStage.EXPECTED:
            return ()
        return (Send(Hello(0, ANYONE, self._run.begun, self._run.number)),)

    def dismiss(self, reason: str, *, orderly: bool) -> Effects:
        """Tell the process in the seat to leave, orderly where that is as planned; it is told again when it asks."""
        if self.process is None or not self._follow_event(SeatEvent.DISMISS):
            return ()
        self.reason = reason
        return (Send(Stop(*self.process, self._run.k, self._run.number, orderly, reason)),)

    def end(self) -> None:
        """Forget the process, which is gone for good, and expect no other."""
        self._follow_event(SeatEvent.END)
        self.process = None

    def expect(self, incarnation: int) -> None:
        """Forget the process, and expect one of that incarnation and no other."""
        self._follow_event(SeatEvent.EXPECT)
        self.process = self.away_since = None
        self._incarnation = incarnation

    @property
    def said_farewell(self) -> bool:
        """True if the process in the seat has said farewell."""
        return self.process is not None and self._farewells[self.process]

    def is_missing(self, now: float, for_s: float = GRACE_S) -> bool:
        """Return True if the token has been gone for so long; after `GRACE_S` the process may have ended."""
        return self.away_since is not None and now - self.away_since >= for_s

    def is_gone(self, now: float) -> bool:
        """Return whether the process is gone, as far as can be told without a launcher."""
        # With a farewell, the token alone decides; without one, the robot may only be cut off.
        return self.is_missing(now) and (self.said_farewell or self.is_missing(now, self._run.return_s))

    def _follow_event(self, event: SeatEvent) -> bool:
        following = SEAT.get((self.stage, event))
        self.stage = following or self.stage
        return following is not None

    def _event_of(self, message: ToWorld) -> SeatEvent:
        sender = message.incarnation, message.instance
        if isinstance(message, HelloReply):
            return self._event_of_hello(message)
        # Only processes that have, or had, the seat have an entry.
        if message.run != self._run.number or sender not in self._farewells:
            return SeatEvent.STRANGER
        if isinstance(message, Farewell):
            return SeatEvent.LEAVES
        if sender != self.process:
            return SeatEvent.STRANGER
        return SeatEvent.FAILS if isinstance(message, Failed) else SeatEvent.ANSWERS

    def _event_of_hello(self, message: HelloReply) -> SeatEvent:
        run, incarnation = self._run, message.incarnation
        if message.run not in (run.number, NO_RUN):
            return SeatEvent.STRANGER
        if self.process is not None:
            return SeatEvent.RETURNS if message.instance == self.process[1] else SeatEvent.INTRUDES
        # One of another protocol is not greeted: below, it is told why.
        if message.run == NO_RUN and message.protocol == PROTOCOL:
            return SeatEvent.ASKS
        if self.stage is not SeatStage.EXPECTED or self._incarnation not in (None, incarnation):
            return SeatEvent.INTRUDES
        return SeatEvent.DIFFERS if run.unlike(message) else SeatEvent.CLAIMS

    def _answer_hello(self, message: HelloReply, event: SeatEvent) -> Effects:
        match event:
            case SeatEvent.ASKS:
                # It is there, even if its token has not arrived yet.
                self.present, self.away_since = True, None
                return self.greet()
            case SeatEvent.CLAIMS:
                self.process = message.incarnation, message.instance
                self._farewells[self.process] = False
            case SeatEvent.DIFFERS:
                unlike = self._run.unlike(message)
                return self._turn_away(message, f"{UNLIKE}{unlike}"), Unlike(unlike)
            case SeatEvent.INTRUDES if self.process is None:
                return Refuse("seat"), self._turn_away(message, f"no process is expected for {self.name} now")
            case SeatEvent.INTRUDES:
                return Refuse("seat"), self._turn_away(message, f"another process is {self.name} already")
            case SeatEvent.RETURNS if self.stage is SeatStage.DISMISSED:
                return (self._turn_away(message, self.reason),)
        return ()

    def _turn_away(self, message: HelloReply, reason: str) -> Send:
        stop = Stop(message.incarnation, message.instance, self._run.k, self._run.number, orderly=False, reason=reason)
        return Send(stop)
