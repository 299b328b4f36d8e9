"""The vocabulary of faults: what may be done to robots, their radio, positions, clocks and motion, and to the ground.

`worldsim.faults` says which robots and ticks a scenario's faults mean.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal, Self, Union, get_args

from pydantic import AfterValidator, BeforeValidator, ConfigDict, Discriminator, Field, Tag, model_validator

from patrol.errors import did_you_mean
from patrol.faults.targets import WHO, WORDS, Who
from patrol.values import (
    Burst,
    Corner,
    Count,
    Flag,
    Growth,
    Name,
    NotNegative,
    Number,
    OneOf,
    Positive,
    Probability,
    RobotName,
    Section,
    Ticks,
    Tolerance,
    at_least,
    by_shape,
    expecting,
    wrong,
)

KIND = "kind of fault"
STRANGER = "stranger"
"""The forger of messages when it is no robot of the fleet."""

# --- how long a frame takes ------------------------------------------------------------------------------------------


class Wait(OneOf):
    """The delay of frames: one of four distributions; drawn times below zero count as zero."""

    CHOICE = "{constant: S}, {uniform: [S, S]}, {normal: [MEAN, SD]} or {exponential: MEAN}"

    constant: NotNegative | None = Field(None, description="s")
    uniform: Annotated[tuple[NotNegative, NotNegative], expecting("[least, most] in s")] | None = Field(
        None, description="s, [least, most]"
    )
    normal: Annotated[tuple[NotNegative, NotNegative], expecting("[mean, standard deviation] in s")] | None = Field(
        None, description="s, [mean, standard deviation]"
    )
    exponential: NotNegative | None = Field(None, description="s, mean")

    @property
    def shape(self) -> str:
        """The name of the one that is given."""
        return next(name for name in type(self).model_fields if getattr(self, name) is not None)

    @property
    def values(self) -> tuple[float, ...]:
        """Its one or two parameters, in s."""
        parameters = getattr(self, self.shape)
        return parameters if isinstance(parameters, tuple) else (parameters,)

    @model_validator(mode="after")
    def _least_comes_first(self) -> Self:
        if self.uniform is not None and self.uniform[0] > self.uniform[1]:
            raise wrong("uniform", "the least value comes first; swap the two")
        return self


# --- the kinds -------------------------------------------------------------------------------------------------------


KINDS: dict[str, type[Fault]] = {}
"""The model of each kind of fault, in the order in which the models are defined here."""

ActsOn = Literal["processes", "frames", "senses", "bodies", "ground"]


class Fault(Section):
    """The base of all faults.

    A subclass whose `kind` is a literal is a kind of fault: the class alone puts it into `KINDS`, the schema and the
    error messages. A nemesis draws it once `patrol.faults.nemesis` says how.
    """

    # processes need a launcher that can start and stop robots, and frames an ether; senses: what a robot measures;
    # bodies: what its body does; ground: closes or opens a part of it
    acts_on: ClassVar[ActsOn]
    EXAMPLE = "{kind: kill, at: 60, who: one}"
    model_config = ConfigDict(serialize_by_alias=True)

    kind: str = Field(description=KIND)
    id: Name | None = Field(None, description="name in journal and verdict; default: f1, f2, ... by place in the list")
    at: NotNegative = Field(0.0, description="s, when it happens or begins")

    @classmethod
    def __pydantic_init_subclass__(cls, **_options: Any) -> None:
        # Bases such as `Lasting` have a plain `str` there, and so no arguments.
        for kind in get_args(cls.model_fields["kind"].annotation):
            KINDS[kind] = cls


class Lasting(Fault):
    """A fault that has an end."""

    lasts: Positive | None = Field(None, alias="for", description="s, duration; null: to the end of the run")


class OnRobots(Fault):
    """A fault that happens to some robots."""

    who: Who = Field(description=WHO)


class OnProcesses(OnRobots):
    """A fault that starts, stops or ends robots' processes."""

    acts_on = "processes"


class Kill(OnProcesses):
    """A robot's process is gone at once; its body stays in the way, or is carried off."""

    kind: Literal["kill"] = Field(description=KIND)
    wreck: Literal["stays", "removed"] = Field("stays", description="stays | removed")


class Restart(OnProcesses):
    """A dead robot's process is started again, with an empty memory; a living or paused one is killed first."""

    kind: Literal["restart"] = Field(description=KIND)


class Pause(OnProcesses, Lasting):
    """A robot's process is stopped, and goes on after a while."""

    kind: Literal["pause"] = Field(description=KIND)


class Resume(OnProcesses):
    """A paused robot's process goes on."""

    kind: Literal["resume"] = Field(description=KIND)


class Join(OnProcesses):
    """Absent robots appear at their starts; a robot that joins before it leaves is absent at first."""

    kind: Literal["join"] = Field(description=KIND)


class Leave(OnProcesses):
    """Robots end their patrol in order and are taken off the terrain."""

    kind: Literal["leave"] = Field(description=KIND)


class OnFrames(Lasting):
    """A fault of the frames that robots send."""

    acts_on = "frames"


class OnLinks(OnFrames):
    """A fault of the directed links from some robots to others."""

    sources: Who = Field("all", alias="from", description=f"senders: {WHO}")
    targets: Who = Field("all", alias="to", description=f"receivers: {WHO}")

    @model_validator(mode="after")
    def _between_two(self) -> Self:
        names = [(side,) if isinstance(side, str) else side for side in (self.sources, self.targets)]
        if names[0] == names[1] and isinstance(names[0], tuple) and len(names[0]) == 1 and self.sources not in WORDS:
            raise wrong("to", f"{names[0][0]} hears nothing from itself; name another robot")
        return self


class Loss(OnLinks):
    """Frames are lost, each by itself or in bursts (Gilbert-Elliott)."""

    kind: Literal["loss"] = Field(description=KIND)
    rate: Probability = Field(description="share of the frames")
    mean_burst: Burst | None = Field(None, description="ticks, mean length of a burst; null: each frame by itself")

    @model_validator(mode="after")
    def _bursts_can_be_that_long(self) -> Self:
        # Links are bad for at most b of every b + 1 ticks: each burst of mean length b is followed by a good tick at
        # least.
        if self.mean_burst is not None and self.rate * (1.0 + self.mean_burst) > self.mean_burst * (1.0 + 1e-12):
            most_lost = self.mean_burst / (1.0 + self.mean_burst)
            limit = f"bursts of {self.mean_burst:g} on average cannot lose more than {most_lost:.4g} of the frames"
            raise wrong("rate", f"{limit}; give less, or a longer mean_burst", self.rate)
        return self


class Delay(OnLinks):
    """Frames arrive late."""

    kind: Literal["delay"] = Field(description=KIND)
    delay: Wait = Field(description=f"s, {Wait.CHOICE}")


class Duplicate(OnLinks):
    """Frames arrive twice."""

    kind: Literal["duplicate"] = Field(description=KIND)
    rate: Probability = Field(description="share of the frames")
    delay: Wait | None = Field(None, description="delay of the copy, as in kind delay; null: none")


class Reorder(OnLinks):
    """Frames are held back, so that later ones overtake them."""

    kind: Literal["reorder"] = Field(description=KIND)
    rate: Probability = Field(description="share of the frames")
    hold: Positive | None = Field(None, description="s, how long a frame is held back; null: one step")


Group = Annotated[tuple[RobotName, ...], at_least(1, "names in a group")]
_GROUPS = "halves, one (against the rest) or a list of groups, each a list of names"
Groups = Annotated[
    Annotated[Literal["halves", "one"], expecting(_GROUPS), Tag("=single")]
    | Annotated[tuple[Group, ...], at_least(1, "groups"), Tag("=list")],
    by_shape(_GROUPS),
]


class Partition(OnFrames):
    """Groups of robots cannot hear each other; robots in no group form one more."""

    kind: Literal["partition"] = Field(description=KIND)
    groups: Groups = Field(description=_GROUPS)
    direction: Literal["both", "one-way"] = Field(
        "both", description="both | one-way (an earlier group is not heard by a later one)"
    )


class Silence(OnRobots, OnFrames):
    """Robots hear nothing, are not heard, or both."""

    kind: Literal["silence"] = Field(description=KIND)
    direction: Literal["in", "out", "both"] = Field("both", description="in (hears nothing) | out (not heard) | both")


class Range(OnRobots, OnFrames):
    """Robots are heard only within a distance."""

    kind: Literal["range"] = Field(description=KIND)
    who: Who = Field("all", description=f"senders: {WHO}")
    reach: Positive = Field(description="m, largest distance between true positions")
    through_walls: Flag = Field(True, description="false: only along a line of sight")


class Bandwidth(OnRobots, OnFrames):
    """Robots can send only a number of bytes a second."""

    kind: Literal["bandwidth"] = Field(description=KIND)
    who: Who = Field("all", description=f"senders: {WHO}")
    bytes_per_s: Positive = Field(description="bytes/s that each of them can send")


class Forgery(OneOf):
    """Content of a forged message, beyond freeze and random."""

    CHOICE = "{offset: [DX, DY]}, {replay: S}, {invented: N} or {ahead: N}"

    offset: Corner | None = Field(None, description="m, [dx, dy] added to the true position")
    replay: Positive | None = Field(None, description="s, age of the victim's frame that is sent again")
    invented: Count | None = Field(None, description="number of invented robots")
    ahead: Ticks | None = Field(None, description="ticks by which the sequence is ahead; the position is the true one")


_PAYLOAD = "{offset: [DX, DY]}, freeze, {replay: S}, random, {invented: N} or {ahead: N}"
Payload = Annotated[
    Annotated[Literal["freeze", "random"], expecting(_PAYLOAD), Tag("=single")] | Annotated[Forgery, Tag("=mapping")],
    by_shape(_PAYLOAD),
]


class Spoof(OnFrames):
    """A robot or a stranger sends positions in others' names."""

    kind: Literal["spoof"] = Field(description=KIND)
    by: RobotName = Field(STRANGER, description="stranger (has no key) or a robot's name (has the fleet's key)")
    victims: Who = Field("one", alias="as", description=f"victims, in whose name frames are sent: {WHO}")
    payload: Payload = Field(description=_PAYLOAD)


class OnSenses(OnRobots, Lasting):
    """A fault of the robots' measurements."""

    acts_on = "senses"


class Jump(Section):
    """A localisation that jumps from time to time."""

    every: Positive = Field(description="s, between jumps")
    size: NotNegative = Field(description="m, of each jump, in a random direction")


class Drift(OnSenses):
    """Robots mistake their own position."""

    kind: Literal["drift"] = Field(description=KIND)
    bias: Corner = Field((0.0, 0.0), description="m, [dx, dy], from the beginning")
    growth: Corner = Field((0.0, 0.0), description="m/s, [dx, dy] by which the bias grows")
    noise: NotNegative = Field(0.0, description="m, standard deviation in x and in y, new in each tick")
    jump: Jump | None = Field(None, description="{every: s, size: m}, jumps that add up")


class Clock(OnSenses):
    """Robots' clocks are wrong."""

    kind: Literal["clock"] = Field(description=KIND)
    offset: Number = Field(0.0, description="s, by which the clock is ahead")
    rate: Growth = Field(0.0, description="s/s, by which the clock gains")


class Jitter(Section):
    """A speed that changes from time to time."""

    size: Tolerance = Field(description="the speed is multiplied by 1 - size to 1 + size, all equally likely")
    every: Positive | None = Field(None, description="s, for which each factor holds; null: one step")


class Slip(Section):
    """Wheels that slip from time to time."""

    rate: Probability = Field(description="share of the time in which the body does not move")
    every: Positive | None = Field(None, description="s, between draws; null: one step")


class Motion(OnRobots, Lasting):
    """Bodies do not do quite what they are commanded: noise of speed and turning, jitter of travel times, slip."""

    acts_on = "bodies"

    kind: Literal["motion"] = Field(description=KIND)
    speed: Probability = Field(0.0, description="standard deviation of the speed, as a share of it, new in each tick")
    turning: Probability = Field(0.0, description="rad per rad turned, standard deviation, new in each tick")
    veer: Probability = Field(0.0, description="rad per m driven, standard deviation, new in each tick")
    jitter: Jitter | None = Field(None, description="{size: share, every: s}, a speed that changes from time to time")
    slip: Slip | None = Field(None, description="{rate: share, every: s}, times in which the body does not move")

    @model_validator(mode="after")
    def _changes_something(self) -> Self:
        sizes = (self.speed, self.turning, self.veer, self.jitter and self.jitter.size, self.slip and self.slip.rate)
        if not any(sizes):
            raise wrong("", "it changes nothing; give speed, turning, veer, jitter or slip above 0, or drop it")
        return self


class OnGround(Lasting):
    """A fault that decides whether a part of the ground is closed; of several in force, the latest one does."""

    acts_on = "ground"

    part: Name = Field(alias="closure", description="name of a closure of the scenario")


class Close(OnGround):
    """A closure is closed, whatever its own times and rates say."""

    kind: Literal["close"] = Field(description=KIND)


class Open(OnGround):
    """A closure is open, whatever its own times and rates say."""

    kind: Literal["open"] = Field(description=KIND)


def nothing(name: str, at: float, step: float, who: str) -> dict[str, Any]:
    """Make an entry that changes nothing, for a place that others' draws depend on.

    For example, ``nothing("f2", 10.0, 0.5, "r1")`` is a clock of r1 that is right from 10 to 10.5 s.

    It is a clock that is not wrong, from `at` (s) on for one `step` (s).
    """
    return {"kind": "clock", "id": name, "at": at, "for": step, "who": [who]}


def kinds_acting_on(what: ActsOn) -> tuple[str, ...]:
    """List the kinds of faults that act on processes, frames, senses, bodies or the ground."""
    return tuple(kind for kind, model in KINDS.items() if model.acts_on == what)


PROCESS_KINDS = kinds_acting_on("processes")
FRAME_KINDS = kinds_acting_on("frames")


def _kind_of(fault: Any) -> str:
    kind = fault.get("kind") if isinstance(fault, Mapping) else getattr(fault, "kind", None)
    return f"={kind}"


def _has_a_kind(fault: Any) -> Any:
    """Refuse what no kind's model would take, in words that name the key `kind`."""
    if isinstance(fault, Fault):
        return fault
    known_kinds = ", ".join(KINDS)
    if not isinstance(fault, Mapping):
        raise wrong("", f"expected a fault such as {{kind: kill, at: 60, who: one}}, with kind one of {known_kinds}")
    kind = fault.get("kind")
    if kind is None:
        raise wrong("kind", f"missing; give one of {known_kinds}")
    if not isinstance(kind, str) or kind not in KINDS:
        raise wrong("kind", f"{kind} is not a kind of fault; {did_you_mean(str(kind), tuple(KINDS))}")
    if kind in INSTANT and "for" in fault:
        raise wrong("for", f"a {kind} happens at once; leave 'for' out")
    return fault


INSTANT = tuple(kind for kind, model in KINDS.items() if not issubclass(model, Lasting))
"""The kinds that happen at once and have no `for`."""


def _name_faults(faults: Sequence[Fault]) -> tuple[Fault, ...]:
    """Give those without an id one by their place; no two may have the same."""
    named = [f if f.id is not None else f.model_copy(update={"id": f"f{i}"}) for i, f in enumerate(faults, start=1)]
    first_by_id: dict[str | None, int] = {}
    for index, fault in enumerate(named):
        if (first_index := first_by_id.setdefault(fault.id, index)) != index:
            raise wrong(f"{index}.id", f"faults.{first_index} has the id {fault.id} too; rename one")
    return tuple(named)


if TYPE_CHECKING:
    OneFault = Fault
else:
    _EACH = tuple(Annotated[model, Tag(f"={kind}")] for kind, model in KINDS.items())
    OneFault = Annotated[Union[_EACH], Discriminator(_kind_of), BeforeValidator(_has_a_kind)]  # noqa: UP007 - made here
Faults = Annotated[tuple[OneFault, ...], AfterValidator(_name_faults)]
