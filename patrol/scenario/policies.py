"""The section `patrol`: what holds for every policy, and the settings of ours.

    patrol: {give_way: false}                                         stochastic, with its defaults
    patrol: {policy: committed, options: {separation: none}}          the tour
    patrol: {policy: potential-field, options: {direction: vector}}   the paper's policy
    patrol: {policy: learned, options: {weights: trained.npz}}        a network that was trained
    patrol: {policy: ./mine.py:Mine, options: {near: 4}}              a policy of one's own, which checks its options

The section is one of five models, chosen by `policy`. The settings of the first four policies are checked with
the rest of the scenario; those of any other, rivals included, when a run finds its class (`agent.policies.found`).

The paper to the letter: which rules of ours a patrol replaces by the paper's (`patrol.options.letter`).

    letter: true                       the paper: every rule below, no giving way, no manoeuvres
    letter: [first-step, no-stop]      two of the paper's rules, and ours otherwise

| rule | the paper's robot |
|---|---|
| first-step | takes for the direction of a force the first of eight steps of the wave's path, not its first bend |
| one-direction | tries the strongest direction only, although a wall may be right there |
| no-stop | does not stop at a stale place close by (cars never do) |
| far-goal | has its goal at the goal distance, although a wall may be in between |
| whole-square | may refine its goal to any point of the square, also to the side or behind a wall |
| square-window | spreads staleness over a square, through walls |
| plain-unstuck | gets out of dead ends by the five printed steps alone, without draws (cars) |
| surround-forces | surrounds an intruder by attraction and repulsion, not by places on a ring |

The paper does not say with which of the equally long paths to a point `first-step` goes (`patrol.options.ties`): the
one that begins diagonally, the one that begins straight, or one that is drawn. On open ground nearly all points have a
path that begins diagonally and one that does not, so a fixed choice puts nearly all forces into four of the eight
directions. Only `drawn` favours none.

A rule that is named has to have an effect in the scenario (`patrol.scenario.policies.check_letter`). `letter: true`
takes those that have one.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Annotated, Any, ClassVar, Final, Literal, Self, get_args

from pydantic import AfterValidator, Discriminator, Field, Tag, model_validator

from patrol.classes.class_file import FIELD as WEIGHTS_FIELD
from patrol.classes.class_file import ClassSection, class_check, weights_content, weights_digest
from patrol.errors import BadInput
from patrol.values import (
    AUTO,
    SEPARATIONS,
    AutoNotNegative,
    AutoPositive,
    ClassText,
    Digest,
    Exponent,
    Flag,
    NotNegative,
    Polygons,
    Positive,
    Probability,
    Section,
    Sectors,
    Separation,
    Tolerance,
    absolute,
    at_least,
    by_shape,
    expecting,
    wrong,
)

RANDOM_FOR: Mapping[str, Any] = {"random_move_for": "all"}
"""What files stated while a setting could forbid cars random steps."""

TOUR_STATED: Mapping[str, Any] = {"unpredictability": 0.0, "random_move": 0.02, **RANDOM_FOR}
"""Settings of `committed` that 1.0 had, and what files stated where its robots followed the tour."""

TO_THE_LETTER: Mapping[str, object] = {"patrol.options.letter": True, "patrol.options.ties": "drawn"}
"""The paper to the letter, by dotted field of the scenario."""

PaperRule = Literal[
    "first-step",
    "one-direction",
    "no-stop",
    "far-goal",
    "whole-square",
    "square-window",
    "plain-unstuck",
    "surround-forces",
]
Ties = Literal["diagonal", "straight", "drawn"]
"""Which of equally long paths of the wave gives its first step, with the rule `first-step`."""

PAPER_RULES: tuple[PaperRule, ...] = get_args(PaperRule)

LETTER = f"true (all) | false (none) | {' | '.join(PAPER_RULES)}, or a list"
Letter = Annotated[
    Annotated[Flag | PaperRule, expecting(LETTER), Tag("=single")]
    | Annotated[tuple[Annotated[PaperRule, expecting(LETTER)], ...], at_least(1, "rules"), Tag("=list")],
    by_shape(LETTER),
]

LETTER_FIELD = "patrol.options.letter"
"""The option's place in a scenario."""


def rules_of(letter: Letter) -> frozenset[PaperRule]:
    """Return the rules of the paper that replace ours."""
    if isinstance(letter, bool):
        return frozenset(PAPER_RULES if letter else ())
    return frozenset((letter,) if isinstance(letter, str) else letter)


LearnedInput = Literal["fog", "pose", "heard", "sectors"]

LEARNED_INPUTS: tuple[LearnedInput, ...] = ("fog", "pose", "heard", "sectors")
"""What a learned policy can see (`agent.learned.observation`)."""

STOCHASTIC: Final = "stochastic"
"""The policy that draws the next station from good plans."""

COMMITTED: Final = "committed"
"""The policy that follows the best routes found."""

PAPER: Final = "potential-field"
"""The policy of the paper."""

DEFAULT: Final = STOCHASTIC
"""The policy of a scenario that names none."""

BUILT_IN = (STOCHASTIC, COMMITTED, PAPER)
"""The policies whose settings are checked with the scenario; rivals and `learned` come with fogwatch too."""

LEARNED: Final = "learned"
"""A policy that was trained (docs/environments.md)."""

OPTION_LENGTHS = ("dilatation", "obstacle_radius", "fuzzy_distance", "critical_width")
"""Lengths that are settings of policies: fields of `patrol.options` that may be ``auto``."""


class PatrolOptions(Section):
    """Settings that `BUILT_IN` policies share: how robots keep apart."""

    # by setting, the switch that it needs and the values of the switch with which it has an effect; without lengths
    # that follow the body, as those of a whole team are stated together
    NEEDS: ClassVar[dict[str, tuple[str, tuple[str, ...]]]] = {"critical_areas": ("separation", ("semaphores",))}

    separation: Separation = Field("claims", description=SEPARATIONS)
    obstacle_radius: AutoPositive = Field(
        AUTO, description="m, of the artificial obstacle at each other robot; auto: 5 radii"
    )
    critical_areas: Polygons | None = Field(None, description="m, polygons; null: narrow passages")
    critical_width: AutoPositive = Field(
        AUTO, description="m, passages narrower than this are critical areas; auto: 8 radii"
    )

    @model_validator(mode="after")
    def _have_an_effect(self) -> Self:
        """Refuse a setting without effect whose switch is not stated.

        Where both are stated it is accepted: files that fogwatch writes state every setting.
        """
        for field in sorted(self.model_fields_set & self.NEEDS.keys()):
            switch, values = self.NEEDS[field]
            value = self.separations if switch == "separation" else (getattr(self, switch),)
            if switch not in self.model_fields_set and not set(value) & set(values):
                needed = " or ".join(values)
                raise wrong(field, f"has no effect unless {switch} is {needed}; set that as well, or drop this")
        return self

    @property
    def separations(self) -> tuple[str, ...]:
        """The mechanisms in use, none when there are none."""
        chosen = (self.separation,) if isinstance(self.separation, str) else self.separation
        return tuple(name for name in chosen if name != "none")


class CommitmentOptions(PatrolOptions):
    """Settings of the policies that choose one place, and keep to it until it has been seen."""

    separation: Separation = Field("claims", description="none | claims | artificial-obstacles | semaphores, or a list")

    @model_validator(mode="after")
    def _has_no_forces(self) -> Self:
        if "repulsion" in self.separations:
            raise wrong("separation", f"repulsion changes sums of forces, which only {PAPER} has; choose another")
        return self


class StochasticOptions(CommitmentOptions):
    """Settings of `stochastic`: the next station is drawn from good plans for the whole fleet."""

    unpredictability: NotNegative = Field(
        1.0, description="how far a drawn plan may be behind the best one; 0: always the best, about 2: nearly free"
    )


class CommittedOptions(CommitmentOptions):
    """Settings of `committed`, which follows the best routes found."""

    unpredictability: ClassVar[float] = 0.0

    def reduce(self, says: dict[str, Any], files: bool) -> None:
        """Add what older files stated, so that hashes stay as before it was the tour alone."""
        super().reduce(says, files)
        says |= TOUR_STATED


class PotentialFieldOptions(PatrolOptions):
    """Settings of `potential-field`: the paper's rules, with its switches."""

    LATER = MappingProxyType({"letter": False, "ties": "diagonal", "origin": "point"})
    NEEDS: ClassVar[dict[str, tuple[str, tuple[str, ...]]]] = {
        **PatrolOptions.NEEDS,
        "length": ("distance", ("g3", "g5")),
        "claim_width": ("separation", ("claims",)),
        "repulsion": ("separation", ("repulsion",)),
        "repulsion_reach": ("separation", ("repulsion",)),
    }

    letter: Letter = Field(False, description=f"rules of ours to be replaced by the paper's: {LETTER}")
    ties: Ties = Field(
        "diagonal",
        description="diagonal | straight | drawn, how the one of equally long paths begins that counts (first-step)",
    )
    fow: Literal["f1", "f2", "f3", "f4", "f5"] = Field("f3", description="f1..f5, force of a point's staleness")
    distance: Literal["g1", "g2", "g3", "g4", "g5"] = Field("g4", description="g1..g5, fall of the force with distance")
    alpha: Exponent = Field(40.0, description="weight of staleness in f")
    beta: Positive = Field(4000.0, description="spread of g4, in squared points of 0.1 m for any `point`")
    length: Positive = Field(800.0, description="l of g3 and g5, in points of 0.1 m for any `point`")
    paths: Literal["wave", "straight", "regions"] = Field(
        "wave", description="wave (round obstacles) | straight | regions (straight within convex regions)"
    )
    origin: Literal["point", "robot"] = Field(
        "point",
        description="point (the centre of the robot's point) | robot (its position), where straight paths begin",
    )
    regions: Polygons | None = Field(None, description="m, convex polygons; null: found automatically")
    direction: Literal["mode", "vector"] = Field("mode", description="mode (strongest sector) | vector (sum)")
    sectors: Sectors = Field(8, description="number of sectors that mode chooses from")
    reach: Literal["paper", "area"] = Field(
        "paper", description="paper | area (farther on larger ground), how far g reaches"
    )
    dilatation: AutoNotNegative = Field(AUTO, description="m, how far staleness spreads; 0: not at all; auto: 5 radii")
    separation: Separation = Field("none", description=SEPARATIONS)
    random_move: Probability = Field(
        0.1, description="probability of a random step in a tick, of each robot, so that patrols stay unpredictable"
    )
    claim_width: Positive = Field(0.3, description="m, width s of the claims")
    repulsion: NotNegative = Field(0.5, description="repulsion of a robot nearby, as a share of all attraction")
    repulsion_reach: Positive = Field(10.0, description="m, distance over which the repulsion falls")
    fuzzy: Flag = Field(False, description="obstacles nearby weaken their sector (with direction: mode)")
    fuzzy_distance: AutoPositive = Field(
        AUTO, description="m, R_0: nearer obstacles weaken their sector; auto: 5.5 radii"
    )
    tolerance: Tolerance = Field(1e-16, description="relative error by leaving out far points; 0: none left out")

    @model_validator(mode="after")
    def _fuzzy_weakens_sectors(self) -> Self:
        if self.fuzzy and self.direction != "mode":
            raise wrong("fuzzy", "weakens sectors, and direction is vector; set direction to mode")
        return self

    @model_validator(mode="after")
    def _ties_and_origin_have_an_effect(self) -> Self:
        if self.ties != "diagonal" and "first-step" not in self.paper_rules:
            problem = f"{self.ties} has no effect unless patrol.options.letter has first-step"
            raise wrong("ties", f"{problem}; set that as well, or drop this")
        if self.origin == "robot" and self.paths != "straight":
            problem = "robot has no effect unless patrol.options.paths is straight"
            raise wrong("origin", f"{problem}; set that as well, or drop this")
        return self

    @property
    def paper_rules(self) -> frozenset[PaperRule]:
        """The rules of the paper that replace ours (`letter`)."""
        return rules_of(self.letter)


class LearnedOptions(Section):
    """Settings of `learned`: a trained network, what it gets to see and what its answers mean.

    Without `weights` they are what a learning environment offers, whose actions come from outside.
    """

    weights: Annotated[str, AfterValidator(absolute)] | None = Field(
        None, description="FILE.npz or FILE.onnx beside this file, the trained network"
    )
    weights_sha256: Digest | None = Field(None, description="of that file; filled in when this file is loaded")
    inputs: tuple[LearnedInput, ...] = Field(
        LEARNED_INPUTS, min_length=1, description=f"what it sees, in this order: {', '.join(LEARNED_INPUTS)}"
    )
    actions: Literal["bearing", "place", "node"] = Field(
        "bearing",
        description="bearing (one of 8, or stay) | place (in the window) | node (of terrain.graph, or a made one)",
    )
    decide: Literal["tick", "arrival"] = Field("tick", description="tick | arrival (with actions: place or node)")
    window: int = Field(21, ge=3, le=201, description="points, odd, side of the window of `fog`")
    heard: int = Field(4, ge=1, le=64, description="positions in `heard`, the nearest robots")

    @model_validator(mode="after")
    def _fit_together(self) -> Self:
        if self.weights is None and self.weights_sha256 is not None:
            raise wrong("weights_sha256", "there are no weights; drop it")
        if self.weights is not None and not self.weights.endswith((".npz", ".onnx")):
            raise wrong("weights", "is no .npz or .onnx file; give one of these")
        if self.window % 2 == 0:
            raise wrong("window", "is even, and the robot stands in the middle; give an odd number", self.window)
        if len(set(self.inputs)) < len(self.inputs):
            raise wrong("inputs", "names one of them twice; name each once")
        if self.decide == "arrival" and self.actions == "bearing":
            raise wrong("decide", "is arrival, and a bearing leads to no place; set actions to place or node")
        return self

    def read_weights(self) -> bytes:
        """Read the trained network's file.

        BadInput also if it is not the one that the scenario was resolved with.
        """
        if self.weights is None:
            raise BadInput(f"{WEIGHTS_FIELD}: is missing; train a network with fogwatch.learn, and name its file")
        return weights_content(Path(self.weights), self.weights_sha256)

    def reduce(self, says: dict[str, Any], files: bool) -> None:
        """Let a network enter by its content."""
        super().reduce(says, files)
        digest = says.pop("weights_sha256")
        if not files:
            says["weights"] = self.weights is not None
        elif digest is not None:
            says["weights"] = [digest, Path(str(self.weights)).suffix]

    def with_digests(self) -> Self:
        """Add the SHA-256 of the network."""
        if self.weights is None or self.weights_sha256 is not None or not Path(self.weights).is_file():
            return self
        return self.model_copy(update={"weights_sha256": weights_digest(Path(self.weights))})

    def with_copies(self, folder: Path) -> Self:
        """Copy the network."""
        if self.weights is None:
            return self
        content, name = self.read_weights(), Path(self.weights).name
        (folder / PatrolSpec.SORT).mkdir()
        (folder / PatrolSpec.SORT / name).write_bytes(content)
        return self.model_copy(update={"weights": f"./{PatrolSpec.SORT}/{name}"})


POLICY = (
    "stochastic | committed (the tour) | potential-field (the paper's) | a rival, such as sebs | package.module:Class "
    "| ./file.py:Class beside this file | entry point"
)
"""Values of `policy`, as files and `--help` describe them."""


BLOCKED_MEMORY_S = 120.0
"""Default of `patrol.blocked_memory`."""

PolicyText = Annotated[ClassText, class_check("committed, potential-field")]


class PatrolSpec(ClassSection):
    """Decisions of a robot: the policy, its settings, and the way there."""

    NAMED = "patrol.policy"
    SORT = "policy"
    LATER = MappingProxyType({"blocked_memory": BLOCKED_MEMORY_S})

    policy: PolicyText = Field(DEFAULT, description=POLICY)
    policy_sha256: Digest | None = Field(None, description="of the policy's file; filled in when this file is loaded")
    options: Any = Field(None, description="settings of the policy, by name")
    avoidance: Literal["none", "goal-refinement"] = Field(
        "goal-refinement", description="none | goal-refinement (a goal moves away from obstacles)"
    )
    give_way: Flag = Field(True, description="of two robots that bumped, one goes round the other, or goes back")
    manoeuvres: Flag = Field(
        True, description="cars and differential robots search for arcs; all find back to the ground of routes"
    )
    goal_distance: AutoPositive = Field(
        AUTO, description="m, from the robot to its goal; auto: 2.5 strides, at least 5.5 radii"
    )
    refine_side: AutoPositive = Field(
        AUTO, description="m, side of the square in which the goal is refined; auto: 2 radii"
    )
    refine_reach: AutoPositive = Field(
        AUTO, description="m, reach of the obstacle field psi that refines the goal; auto: 10 radii"
    )
    surround_distance: AutoPositive = Field(
        AUTO, description="m, from an intruder to the robots around it; auto: 8 radii, at most 0.8 sensor ranges"
    )
    surround_repulsion: NotNegative = Field(0.3, description="repulsion of a robot nearby, as a share of attraction")
    contact_memory: NotNegative = Field(
        5.0, description="s after the last report of an intruder until patrolling resumes"
    )
    blocked_memory: Positive = Field(
        BLOCKED_MEMORY_S, description="s after which a robot forgets closed ground or a robot not heard"
    )

    @property
    def needs_rounds(self) -> bool:
        """True if the policy follows tours, or draws from their stations."""
        return isinstance(self.options, CommitmentOptions)

    @property
    def critical_areas(self) -> Polygons | None:
        """The semaphores' areas where the policy's settings state them, m."""
        return self.options.critical_areas if isinstance(self.options, PatrolOptions) else None

    @property
    def regions(self) -> Polygons | None:
        """The regions where the policy's settings state them, m."""
        return self.options.regions if isinstance(self.options, PotentialFieldOptions) else None

    @property
    def paper_rules(self) -> frozenset[PaperRule]:
        """The rules of the paper that replace ours; none but with `potential-field`."""
        return self.options.paper_rules if isinstance(self.options, PotentialFieldOptions) else frozenset()

    @property
    def paths(self) -> Literal["wave", "straight", "regions"]:
        """Kind of paths that the policy measures ways by; all but `potential-field` use the wave."""
        return self.options.paths if isinstance(self.options, PotentialFieldOptions) else "wave"


class StochasticPatrol(PatrolSpec):
    """The section with the default policy."""

    policy: Literal["stochastic"] = Field(STOCHASTIC, description=POLICY)
    options: StochasticOptions = Field(default_factory=StochasticOptions, description="settings of stochastic")


class CommittedPatrol(PatrolSpec):
    """The section with the tour."""

    policy: Literal["committed"] = Field(description=POLICY)
    options: CommittedOptions = Field(default_factory=CommittedOptions, description="settings of committed")


class PaperPatrol(PatrolSpec):
    """The section with the paper's policy."""

    policy: Literal["potential-field"] = Field(description=POLICY)
    options: PotentialFieldOptions = Field(
        default_factory=PotentialFieldOptions, description="settings of potential-field"
    )

    @model_validator(mode="before")
    @classmethod
    def _letter_switches_off_what_is_ours(cls, section: Any) -> Any:
        """Give `give_way` and `manoeuvres` the paper's values where the whole letter is wanted, unless stated."""
        options = section.get("options") if isinstance(section, dict) else None
        if isinstance(options, dict) and options.get("letter") is True:
            return {"give_way": False, "manoeuvres": False, **section}
        return section


def check_letter(patrol: PaperPatrol, models: Iterable[str], intruders: bool) -> None:
    """Refuse a rule that has no effect, and what contradicts the whole letter."""
    letter, bodies = patrol.options.letter, set(models)
    if letter is True:
        _check_whole(patrol, bodies)
    elif letter is not False:
        named = patrol.paper_rules
        for rule, (has_effect, remedy) in _rule_needs(patrol, bodies, intruders).items():
            if rule in named and not has_effect:
                raise wrong(LETTER_FIELD, f"{rule} has no effect here; drop it, or {remedy}")


def _check_whole(patrol: PaperPatrol, bodies: set[str]) -> None:
    if "differential" in bodies:
        remedy = "set their model to holonomic or car, or name the rules that you want"
        raise wrong(LETTER_FIELD, f"true, and the paper has no differential robots; {remedy}")
    for field, ours in (("give_way", "give way"), ("manoeuvres", "search for manoeuvres")):
        if getattr(patrol, field):
            problem = f"true, and {LETTER_FIELD} is true: the paper's robots do not {ours}; set it to false, or drop it"
            raise wrong(f"patrol.{field}", problem)


def _rule_needs(patrol: PaperPatrol, bodies: set[str], intruders: bool) -> dict[PaperRule, tuple[bool, str]]:
    """Return, by rule, whether the scenario has what it acts on, and how to get that."""
    options = patrol.options
    return {
        "first-step": (options.paths == "wave", "set patrol.options.paths to wave"),
        "no-stop": (bodies != {"car"}, "set a robot's model to holonomic"),
        "whole-square": (patrol.avoidance == "goal-refinement", "set patrol.avoidance to goal-refinement"),
        "square-window": (options.dilatation != 0.0, "give a patrol.options.dilatation above 0"),
        "plain-unstuck": ("car" in bodies, "set a robot's model to car"),
        "surround-forces": (intruders, "give intruders"),
    }


class LearnedPatrol(PatrolSpec):
    """The section with a policy that was trained."""

    policy: Literal["learned"] = Field(description=POLICY)
    options: LearnedOptions = Field(default_factory=LearnedOptions, description="settings of learned")


class OwnPatrol(PatrolSpec):
    """The section with a policy of one's own."""

    policy: PolicyText = Field(description=POLICY, json_schema_extra={"not": {"enum": [*BUILT_IN, LEARNED]}})
    options: dict[str, Any] | None = Field(None, description="settings of a policy of one's own, by name")


def _section_tag(section: Any) -> str:
    policy = section.get("policy", DEFAULT) if isinstance(section, dict) else getattr(section, "policy", DEFAULT)
    return f"={policy}" if policy in (*BUILT_IN, LEARNED) else "=own"


Patrol = Annotated[
    Annotated[StochasticPatrol, Tag("=stochastic")]
    | Annotated[CommittedPatrol, Tag("=committed")]
    | Annotated[PaperPatrol, Tag("=potential-field")]
    | Annotated[LearnedPatrol, Tag("=learned")]
    | Annotated[OwnPatrol, Tag("=own")],
    Discriminator(_section_tag),
]
"""The section `patrol` of a scenario."""
