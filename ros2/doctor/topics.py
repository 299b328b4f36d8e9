"""The topics of a robot that matter to a patrol: what comes on them, and whether it can be used."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from patrol.errors import Malformed
from patrol.printable import printable
from ros2.doctor.survey import Survey, Wanted, names_of
from ros2.wire import messages as ros
from ros2.wire.codec import CODINGS, decode
from ros2.wire.definitions import NO_HASH, type_hash
from ros2.wire.ear import Overheard
from ros2.wire.formats import Bridge, Format, Origin
from ros2.wire.names import Entity, EntityKind

ARROW = " -> "

_KNOWN = {coding.type_name: kind for kind, coding in CODINGS.items() if coding.unpack is not None}


@dataclass(frozen=True, slots=True)
class Topic:
    """The nodes and messages of a topic."""

    name: str  # in full
    type_name: str  # empty where no node says
    type_hash: str  # empty where no node says
    rate: float  # messages a second
    messages: int  # number heard
    size: int  # bytes of the longest message
    frames: tuple[str, ...]  # that its messages name
    publishers: int  # number, as far as tokens or attachments tell
    subscribers: int  # number, as far as tokens tell
    wrong: str  # why its messages cannot be used; empty where they can


def topics_of(seen: Survey, form: Format, entities: Sequence[Entity]) -> Iterator[Topic]:
    """Yield the topics that matter, as far as there are any."""
    for name, _ in names_of(seen.namespace, seen.wanted):
        if isinstance(form, Bridge):
            keys = [key for key in seen.heard if key == form.heard(name)]
        else:
            keys = [key for key in seen.heard if key.startswith(f"{form.domain}/{name.strip('/')}/") and "::" in key]
        about = [entity for entity in entities if entity.topic == name]
        publishers = sum(entity.kind is EntityKind.PUBLISHER for entity in about)
        subscribers = sum(entity.kind is EntityKind.SUBSCRIPTION for entity in about)
        for key in keys or [""]:
            origin = form.origin(key) if key else Origin()
            publisher = next(
                (entity for entity in about if entity.kind is EntityKind.PUBLISHER), about[0] if about else None
            )
            type_name = origin.type_name or (publisher.type_name if publisher else "")
            hashed = origin.type_hash or (publisher.type_hash if publisher else "")
            heard = seen.heard.get(key)
            frames, wrong = _look(name, type_name, heard, seen.wanted)
            if type_name in _KNOWN and hashed not in {"", NO_HASH, type_hash(type_name)}:
                wrong = f"its hash is {hashed[:80]}, and so its fields are other than ours"
            if heard is not None or about:
                yield Topic(
                    name,
                    printable(type_name[:255]),
                    printable(hashed[:80]),
                    0.0 if heard is None else heard.rate,
                    0 if heard is None else heard.messages,
                    0 if heard is None else heard.size,
                    frames,
                    max(publishers, 0 if heard is None else len(heard.senders)),
                    subscribers,
                    printable(wrong),
                )


def _look(name: str, type_name: str, heard: Overheard | None, wanted: Wanted) -> tuple[tuple[str, ...], str]:
    """Return the frames in a topic's messages, and why they cannot be used, if so."""
    kind = _KNOWN.get(type_name) or _expected(name, wanted)
    if heard is None or kind is None:
        return (), ""
    frames: dict[str, None] = {}
    try:
        for payload in [*(payload for _, payload in list(heard.recent)), heard.newest]:
            if payload is not None:
                frames |= dict.fromkeys(_frames(decode(kind, payload)))
    except Malformed as bad:
        return tuple(frames), str(bad)
    return tuple(frames), ""


def _expected(name: str, wanted: Wanted) -> Any:
    """Return the class of a topic's messages, where its key does not say."""
    kinds: dict[str, Any] = {
        "tf": ros.TFMessage,
        "tf_static": ros.TFMessage,
        "odom": ros.Odometry,
        "amcl_pose": ros.PoseWithCovarianceStamped,
        "map": ros.OccupancyGrid,
        "clock": ros.Clock,
    }
    return {wanted.topic(usual).rpartition("/")[2]: kind for usual, kind in kinds.items()}.get(name.rpartition("/")[2])


def _frames(message: Any) -> Iterator[str]:
    if isinstance(message, ros.TFMessage):
        for transform in message.transforms:
            yield f"{transform.frame}{ARROW}{transform.child_frame}"
    elif isinstance(message, ros.Odometry):
        yield f"{message.frame}{ARROW}{message.child_frame}"
    elif getattr(message, "frame", ""):
        yield message.frame
