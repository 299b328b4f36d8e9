"""The two formats: the keys and attachments of messages.

    rmw_zenoh              0/robot1/cmd_vel/geometry_msgs::msg::dds_::Twist_/RIHS01_9c45...   with an attachment
    zenoh-bridge-ros2dds   robot1/cmd_vel

They do not understand each other: a link speaks one of them.
"""

from __future__ import annotations

import hashlib
import struct
from collections.abc import Callable
from dataclasses import dataclass

from patrol.errors import BadInput
from ros2.wire.definitions import NO_HASH, type_hash
from ros2.wire.names import ADMIN_SPACE, Entity, EntityKind, NodeName, dds_name, entity_of, ros_name

_ATTACHMENT = struct.Struct("<qqB16s")
_GID = 16
_SLASH = "§"
_BRIDGED = {
    "MP": (EntityKind.PUBLISHER, ""),
    "MS": (EntityKind.SUBSCRIPTION, ""),
    "SS": (EntityKind.SERVER, ""),
    "SC": (EntityKind.CLIENT, ""),
    "AS": (EntityKind.SERVER, "/_action/send_goal"),
    "AC": (EntityKind.CLIENT, "/_action/send_goal"),
}
"""The character for a slash in the tokens of a bridge, and their kinds of entities."""


@dataclass(frozen=True, slots=True)
class Attachment:
    """The data attached to a message of `rmw_zenoh`."""

    sequence: int  # counts the sender's messages, from 1
    sent_ns: int  # since the epoch, by the sender's clock
    sender: bytes  # 16 bytes that stand for the publisher or client

    def to_bytes(self) -> bytes:
        """Return the 33 bytes of it."""
        return _ATTACHMENT.pack(self.sequence, self.sent_ns, _GID, self.sender)


def attachment_of(given: bytes) -> Attachment | None:
    """Return the attachment in some bytes; None if there is none."""
    # The byte after the two numbers is the length of what stands for the sender.
    if len(given) != _ATTACHMENT.size or given[16] != _GID:
        return None
    sequence, sent_ns, _, sender = _ATTACHMENT.unpack(given)
    return Attachment(sequence, sent_ns, sender)


def gid_of(token: str) -> bytes:
    """Return the 16 bytes that stand for an entity, made from its liveliness token.

    `rmw_zenoh` makes them by another hash, but receivers only compare them.
    """
    return hashlib.blake2b(token.encode(), digest_size=_GID).digest()


@dataclass(frozen=True, slots=True)
class Origin:
    """The part of a key that describes the messages under it."""

    type_name: str = ""  # as ROS calls it; empty where the format does not say
    type_hash: str = ""  # empty where the format does not say


@dataclass(frozen=True, slots=True)
class RmwZenoh:
    """The format of `rmw_zenoh`. Names are full (`ros2.wire.names.full_name`)."""

    domain: int = 0  # ROS_DOMAIN_ID
    hashed: bool = True  # False for ROS 2 Humble, where types have no hashes
    attaches = True  # messages have an `Attachment`, and entities a token

    @property
    def name(self) -> str:
        """The name for people."""
        return "rmw_zenoh" if self.hashed else "rmw_zenoh (Humble)"

    @property
    def graph(self) -> str:
        """The key expression of the tokens of everything in the graph."""
        return f"{ADMIN_SPACE}/{self.domain}/**"

    def key(self, topic: str, type_name: str, /) -> str:
        """Return the key of a topic that we publish, or of a service that we offer."""
        return f"{self.domain}/{topic.strip('/')}/{dds_name(type_name)}/{self.hash_of(type_name)}"

    def heard(self, topic: str) -> str:
        """Return the key expression of a topic that others publish.

        It has any type and hash, so that a wrong one can be reported.
        """
        return f"{self.domain}/{topic.strip('/')}/*/*"

    def inside(self, namespace: str, /) -> str:
        """Return the key expression of all topics and services in a namespace."""
        inside = namespace.strip("/")
        return f"{self.domain}/{inside}/**" if inside else f"{self.domain}/**"

    def service_key(self, service: str, type_name: str, /) -> str:
        """Return the key expression of a service that others offer.

        It has any hash: releases differ in fields that are not read here.
        """
        return f"{self.domain}/{service.strip('/')}/{dds_name(type_name)}/*"

    def origin(self, key: str, /) -> Origin:
        """Read from a key which messages are under it."""
        parts = key.split("/")
        # From the end: a topic's name has as many parts as it likes.
        return Origin(ros_name(parts[-2]), parts[-1]) if len(parts) >= 4 else Origin()

    def hash_of(self, type_name: str, /) -> str:
        """Return the hash of a type in keys and tokens."""
        return type_hash(type_name) if self.hashed else NO_HASH

    def entity(self, token: str, /) -> Entity | None:
        """Return the entity that a token of any node stands for; None if it is none."""
        return entity_of(token)


@dataclass(frozen=True, slots=True)
class Bridge:
    """The format of `zenoh-bridge-ros2dds`: a topic's name is its key, and the bridge itself shows what it carries."""

    domain = 0
    attaches = False
    name = "zenoh-bridge-ros2dds"
    graph = "@/*/@ros2_lv/**"

    def key(self, topic: str, _type_name: str, /) -> str:
        """Return the key of a topic or service, ours or another's."""
        return topic.strip("/")

    def heard(self, topic: str) -> str:
        """Return the key of a topic that others publish."""
        return topic.strip("/")

    def inside(self, namespace: str, /) -> str:
        """Return the key expression of all topics and services in a namespace."""
        inside = namespace.strip("/")
        return f"{inside}/**" if inside else "**"

    service_key = key

    def origin(self, _key: str, /) -> Origin:
        """Return nothing: keys do not name types."""
        return Origin()

    def hash_of(self, _type_name: str, /) -> str:
        """Return nothing: there are no hashes."""
        return ""

    def entity(self, token: str, /) -> Entity | None:
        """Return the entity that a token of a bridge stands for; an action's server counts as that of its send_goal."""
        parts = token.split("/")
        if len(parts) < 6 or parts[0] != "@" or parts[2] != ADMIN_SPACE or parts[3] not in _BRIDGED:
            return None
        topic, type_name = (part.replace(_SLASH, "/") for part in parts[4:6])
        kind, suffix = _BRIDGED[parts[3]]
        return Entity(0, parts[1], 0, 0, kind, NodeName(""), f"/{topic}{suffix}", type_name)


Format = RmwZenoh | Bridge

FORMATS: dict[str, Callable[[int], Format]] = {
    "rmw_zenoh": RmwZenoh,
    "rmw_zenoh-humble": lambda domain: RmwZenoh(domain, hashed=False),
    "bridge": lambda _domain: Bridge(),
}
"""Formats by the names that options have for them, each made for a ROS_DOMAIN_ID."""


def other_format(form: Format, tokens: Callable[[str], list[str]]) -> str:
    """Return the other format that nodes on a router speak, with the remedy; empty where there is none.

    For example "rmw_zenoh; give --format rmw_zenoh". `tokens` returns the liveliness tokens under a key expression.
    """
    for name in ("rmw_zenoh", "bridge"):
        candidate = FORMATS[name](form.domain)
        if type(candidate) is not type(form) and any(candidate.entity(token) for token in tokens(candidate.graph)):
            return f"{candidate.name}; give --format {name}"
    return ""


def format_named(name: str, domain: int, option: str) -> Format:
    """Return the format of a name."""
    if name not in FORMATS:
        raise BadInput(f"{option} {name!r}: no such format; known are {', '.join(FORMATS)}")
    return FORMATS[name](domain)
