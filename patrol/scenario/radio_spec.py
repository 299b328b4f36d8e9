"""The scenario's section about the radio: how positions travel, what reaches whom, and how much the fleet may send.

    radio: {trail: 4}                                             every frame reaches all robots
    radio: {model: path-loss, options: {wall: 10, redraw: 60}}    distance, walls and interference
    radio: {model: ./mine.py:Mine, options: {reach: 40}}          a model of one's own, which checks its options

The section is one of three classes, chosen by `model`, like the section `patrol` by `policy`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Annotated, Any, Final, Literal, Self

from pydantic import Discriminator, Field, Tag, model_validator

from patrol.classes.class_file import ClassSection, class_check
from patrol.radio.allowance import BITS, Share
from patrol.radio.message import MAX_STEP_CM, SPAN, cm_to_m, longest_frame, m_to_cm
from patrol.scenario.sections import BUILT_IN_SENSORS, RobotSpec, SensorSpec
from patrol.values import (
    ClassText,
    Decibels,
    Digest,
    FrameBytes,
    NotNegative,
    Overhead,
    PathLossExponent,
    PathText,
    Positive,
    Power,
    Section,
    Trail,
    TrailEvery,
    expecting,
    wrong,
)

IDEAL: Final = "ideal"
"""The default model: every frame reaches all robots."""

PATH_LOSS: Final = "path-loss"
"""The model of distance, walls and interference."""

MODELS: Mapping[str, str] = MappingProxyType(
    {IDEAL: "worldsim.radio.models:Ideal", PATH_LOSS: "worldsim.radio.path_loss:PathLoss"}
)
"""The classes of the models that come with fogwatch, by name."""

RadioModelText = Annotated[ClassText, class_check(", ".join(MODELS))]

_BUCKET_S = 1.0
"""Most of its share that a robot may save up, s; or a tick, or the longest frame and a contact's, if these are more."""

_ALL_ROUND = 360.0


class BudgetSpec(Section):
    """The budget of the whole fleet; each robot of the roster has an equal share."""

    bits_per_s: Positive = Field(description="bit/s on the air of all robots together, overhead included")
    overhead: Overhead = Field(0, description="bytes that the radio adds to each frame")
    frame: FrameBytes = Field(64, description="bytes of the longest frame; trails are cut to fit")


class AdaptiveSpec(Section):
    """The conditions for sending a frame: the last one predicts the robot wrongly, or is old."""

    error: NotNegative = Field(2.0, description="m, by which the others' prediction of a robot may be off")
    silence: Positive = Field(4.0, description="s, after which a robot sends anyway")


class PathLossOptions(Section):
    """Settings of `path-loss`; docs/radio.md has the formula, and says where the defaults are from."""

    power: Power = Field(0.0, description="dBm, of a sender")
    reference: Decibels = Field(40.0, description="dB, path loss at 1 m")
    exponent: PathLossExponent = Field(2.5, description="n, path loss grows by 10 n dB for each tenfold distance")
    wall: Decibels = Field(6.0, description="dB, loss of each wall on the line")
    shadowing: Decibels = Field(4.0, description="dB, standard deviation of the shadowing of each directed link")
    redraw: Positive | None = Field(None, description="s, after which shadowing is drawn anew; null: never")
    sensitivity: Power = Field(-90.0, description="dBm, at which half of the frames are received")
    edge: Decibels = Field(1.0, description="dB, width of the packet error curve; 0: all or none")
    noise: Power = Field(-100.0, description="dBm, noise at a receiver; interference adds to it")
    airtime: NotNegative = Field(0.002, description="s, that a frame takes on the air; 0: no interference")


RADIO_MODEL = f"{' | '.join(MODELS)} | package.module:Class | ./file.py:Class beside this file | entry point"
"""Values of `model`, as files and `--help` describe them."""


class RadioSpec(ClassSection):
    """The radio: how positions travel, what it adds to them, and when a silent robot's claim ends."""

    NAMED = "radio.model"
    SORT = "model"

    via: Literal["ether", "direct"] = Field(
        "ether", description="ether (the world carries frames) | direct (robots hear each other; not in lockstep)"
    )
    model: RadioModelText = Field(IDEAL, description=RADIO_MODEL)
    model_sha256: Digest | None = Field(None, description="of the model's file; filled in when this file is loaded")
    options: Any = Field(None, description="settings of the model, by name")
    trail: Trail = Field(0, description="number of past positions in each message")
    trail_every: TrailEvery = Field(1, description="ticks between the past positions of a message")
    key: PathText | None = Field(
        None,
        description="file with the fleet's key, relative to this file: for the messages' tags and the robots' draws",
    )
    forget_after: Positive = Field(10.0, description="s of silence after which a robot's claim ends")
    budget: BudgetSpec | None = Field(None, description="{bits_per_s: 1200}, for the whole fleet; null: no limit")
    adaptive: AdaptiveSpec | None = Field(None, description="{error: 2}, m; null: a robot sends in each tick if it may")

    @model_validator(mode="after")
    def _decides_in_the_ether(self) -> Self:
        if self.via == "direct" and self.model != IDEAL:
            problem = (
                "decides what reaches whom in the ether, and radio.via is direct; leave it out, or set via to ether"
            )
            raise wrong("model", problem)
        return self

    def reduce(self, says: dict[str, Any], files: bool) -> None:
        """Let a key enter by its presence alone."""
        super().reduce(says, files)
        says["key"] = self.key is not None

    @property
    def spares_frames(self) -> bool:
        """True if there are ticks in which a living robot sends nothing."""
        return self.budget is not None or self.adaptive is not None

    @property
    def longest_frame(self) -> int:
        """Bytes of the longest frame that a robot sends."""
        longest = longest_frame(self.trail, tagged=self.key is not None)
        return longest if self.budget is None else min(longest, self.budget.frame)

    def silence_ticks(self, step: float) -> int:
        """Return the ticks without a frame after which a robot sends, if it may; 1 without `adaptive`."""
        return 1 if self.adaptive is None else max(1, math.floor(self.adaptive.silence / step + 1e-9))

    def share(self, robots: int, step: float) -> Share | None:
        """Return each robot's share of the budget, or None where there is none.

        `robots` is the number of robots of the roster, spare ones included.
        """
        if self.budget is None:
            return None
        per_s = self.budget.bits_per_s / robots
        overhead, longest = self.budget.overhead, self.longest_frame
        contact = longest_frame(0, tagged=self.key is not None)
        largest_saving = max(per_s * max(_BUCKET_S, step), BITS * float(longest + contact + 2 * overhead))
        return Share(per_tick=per_s * step, most=largest_saving, overhead=overhead, frame=longest)


class IdealRadio(RadioSpec):
    """The section with the default model."""

    LATER = MappingProxyType({"model": IDEAL, "options": None})
    model: Literal["ideal"] = Field(IDEAL, description=RADIO_MODEL)
    options: Annotated[None, expecting("none: the model ideal has no settings; set radio.model to path-loss")] = Field(
        None, description="ideal has none"
    )


class PathLossRadio(RadioSpec):
    """The section with the model of distance, walls and interference."""

    model: Literal["path-loss"] = Field(description=RADIO_MODEL)
    options: PathLossOptions = Field(default_factory=PathLossOptions, description="settings of path-loss")


class OwnRadio(RadioSpec):
    """The section with a model of one's own."""

    model: RadioModelText = Field(description=RADIO_MODEL, json_schema_extra={"not": {"enum": list(MODELS)}})
    options: dict[str, Any] | None = Field(None, description="settings of a model of one's own, by name")


MODEL_OPTIONS: Mapping[str, type[Section]] = MappingProxyType({PATH_LOSS: PathLossOptions})
"""The settings of models that come with fogwatch and have some, by name."""


def _section_tag(section: Any) -> str:
    model = section.get("model", IDEAL) if isinstance(section, dict) else getattr(section, "model", IDEAL)
    return f"={model}" if isinstance(model, str) and model in MODELS else "=own"


Radio = Annotated[
    Annotated[IdealRadio, Tag("=ideal")]
    | Annotated[PathLossRadio, Tag("=path-loss")]
    | Annotated[OwnRadio, Tag("=own")],
    Discriminator(_section_tag),
]
"""The section `radio` of a scenario."""


def check_radio_spec(
    radio: RadioSpec, roster: Sequence[RobotSpec], step: float, sensor: SensorSpec, *, intruders: bool
) -> None:
    """Check the radio against the rest of a scenario."""
    if isinstance(radio, PathLossRadio):
        airtime, redraw = radio.options.airtime, radio.options.redraw
        if airtime > step:
            limit = f"longer than one step of {step:g} s, in which a robot sends anew; give less"
            raise wrong("radio.options.airtime", limit, airtime)
        if redraw is not None and redraw < step:
            limit = f"shorter than one step of {step:g} s, so that draws would be left out; give more"
            raise wrong("radio.options.redraw", limit, redraw)
    if radio.trail:
        _check_trail(radio, roster, step, sensor)
    if radio.adaptive is not None and not step <= radio.adaptive.silence <= radio.forget_after:
        limit = (
            f"not between one step, {step:g} s, and radio.forget_after, {radio.forget_after:g} s; give a time between"
        )
        raise wrong("radio.adaptive.silence", limit, radio.adaptive.silence)
    share = radio.share(len(roster), step)
    if radio.budget is None or share is None:
        return
    bare = longest_frame(0, tagged=radio.key is not None)
    if radio.budget.frame < bare:
        limit = f"less than a frame without a trail may have, {bare} bytes; give more"
        raise wrong("radio.budget.frame", limit, radio.budget.frame)
    silent_s = step * (share.earns_most_in if intruders else share.earns_frame_in)
    if silent_s > radio.forget_after:
        seconds = f"so low that a robot may be silent for {silent_s:g} s, and claims end after "
        remedy = "give more, a shorter radio.trail or a longer radio.forget_after"
        limit = f"{seconds}{radio.forget_after:g} s; {remedy}"
        raise wrong("radio.budget.bits_per_s", limit, radio.budget.bits_per_s)


def _check_trail(radio: RadioSpec, roster: Sequence[RobotSpec], step: float, sensor: SensorSpec) -> None:
    for spec in roster:
        if m_to_cm(spec.speed * step * radio.trail_every) >= MAX_STEP_CM:
            span = "tick" if radio.trail_every == 1 else f"{radio.trail_every} ticks"
            limit = f"a trail holds steps below {cm_to_m(MAX_STEP_CM):g} m per {span}; set radio.trail to 0"
            raise wrong(f"{spec.section}.speed", limit, spec.speed)
    if radio.trail * radio.trail_every >= SPAN:
        limit = f"a trail reaches back at most {SPAN - 1} ticks, and radio.trail is {radio.trail}; give less"
        raise wrong("radio.trail_every", limit, radio.trail_every)
    narrower = sensor.kind not in BUILT_IN_SENSORS or sensor.angle < _ALL_ROUND
    if narrower and (radio.spares_frames or radio.trail_every > 1):
        limit = "a trail has places and no headings, so a narrower view from them is unknown; set radio.trail to 0"
        raise wrong("radio.trail", limit, radio.trail)
