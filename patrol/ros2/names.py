"""Names of ROS 2, its quality of service, and the entities of its graph with the tokens that `rmw_zenoh` gives them."""

from __future__ import annotations

import os
import re
from dataclasses import dataclass
from enum import StrEnum

from patrol.errors import BadInput

_NAME = re.compile(r"/?[A-Za-z_][A-Za-z0-9_]*(?:/[A-Za-z_][A-Za-z0-9_]*)*")
_LONGEST_NAME = 255
_DEFAULT_DEPTH = 42
"""The depth that 0 stands for, which `rmw_zenoh` leaves out."""
_MOST_DEPTH = 10_000
_BEST_EFFORT, _TRANSIENT_LOCAL, _KEEP_ALL = "2", "1", "2"
_PLAIN_NUMBER = re.compile(r"[0-9]{0,19}")

ADMIN_SPACE = "@ros2_lv"
LAST_DOMAIN = 232


def check_name(name: str, option: str) -> str:
    """Check a name or a namespace of ROS, which is a part of keys.

    Args:
        name: Such as ``robot1``, ``/map`` or ``fleet/robot1``; empty is the root namespace.
        option: What errors call it.

    Raises:
        BadInput: It cannot be one.
    """
    if name not in {"", "/"} and (len(name) > _LONGEST_NAME or not _NAME.fullmatch(name)):
        raise BadInput(
            f"{option} {name!r}: not a name in ROS; write letters, digits and '_', the first of each part no digit, "
            "with '/' between parts, such as robot1 or /map"
        )
    return name


def check_domain(domain: int, option: str) -> int:
    """Check a ROS_DOMAIN_ID.

    Args:
        domain: The number.
        option: What errors call it.

    Raises:
        BadInput: It cannot be one.
    """
    if not 0 <= domain <= LAST_DOMAIN:
        raise BadInput(f"{option} {domain}: not a domain of ROS 2; give the robot's ROS_DOMAIN_ID, 0 to {LAST_DOMAIN}")
    return domain


def domain_given(domain: int | None) -> int:
    """Return the ROS_DOMAIN_ID that an option gives, or else the environment, or else 0, as in ROS.

    Args:
        domain: The option's; None where it was not given.

    Raises:
        BadInput: It cannot be one.
    """
    if domain is not None:
        return check_domain(domain, "--domain")
    text = os.environ.get("ROS_DOMAIN_ID", "0")
    if not (text.isascii() and text.isdecimal() and len(text) <= 9):
        raise BadInput(f"ROS_DOMAIN_ID={text[:20]!r} in the environment: expected a whole number, 0 to {LAST_DOMAIN}")
    return check_domain(int(text), "ROS_DOMAIN_ID in the environment:")


def full_name(namespace: str, name: str) -> str:
    """Return a name with its namespace, as ROS resolves it.

    Args:
        namespace: Such as ``robot1`` or ``/robot1``; empty for the root.
        name: Relative to it, or from the root if it begins with a slash.

    Returns:
        The name from the root, with the slash that it begins with.
    """
    if name.startswith("/"):
        return name
    inside = namespace.strip("/")
    return f"/{inside}/{name}" if inside else f"/{name}"


def dds_name(type_name: str) -> str:
    """Return a type as DDS calls it.

    Args:
        type_name: Such as ``geometry_msgs/msg/Twist``.
    """
    package, kind, name = type_name.split("/")
    return f"{package}::{kind}::dds_::{name}_"


def ros_name(dds: str) -> str:
    """Return a type as ROS calls it.

    Args:
        dds: Such as ``geometry_msgs::msg::dds_::Twist_``; anything else comes back as it is.
    """
    parts = dds.split("::")
    if len(parts) == 4 and parts[2] == "dds_" and parts[3].endswith("_"):
        return f"{parts[0]}/{parts[1]}/{parts[3][:-1]}"
    return dds


def mangled(name: str) -> str:
    """Return a name as a part of a token, where no slash may be and nothing may be empty."""
    return name.replace("/", "%") or "%"


def unmangled(part: str) -> str:
    """Return the name in a part of a token; empty for the root."""
    return "" if part == "%" else part.replace("%", "/")


@dataclass(frozen=True, slots=True)
class Qos:
    """The quality of service of a publisher or a subscription. Nothing of it keeps the two from meeting.

    Attributes:
        reliable: Whether it wants every message.
        latched: Whether who comes late still gets the last ``depth`` messages: transient local.
        depth: Messages that are kept; 0 stands for 42.
        keep_all: Whether all messages are kept.
    """

    reliable: bool = True
    latched: bool = False
    depth: int = 10
    keep_all: bool = False

    @property
    def text(self) -> str:
        """The text of `rmw_zenoh` in a token: usual values are left out."""
        depth = "" if self.depth in {0, _DEFAULT_DEPTH} else str(self.depth)
        reliability, durability = "" if self.reliable else _BEST_EFFORT, _TRANSIENT_LOCAL if self.latched else ""
        return f"{reliability}:{durability}:{_KEEP_ALL if self.keep_all else ''},{depth}:,:,:,,"


USUAL = Qos()
LATCHED = Qos(latched=True, depth=1)
SENSOR = Qos(reliable=False, depth=5)
SERVICE = Qos()


def qos_of(text: str) -> Qos | None:
    """Return the quality of service in a token.

    Args:
        text: Its last part, or another robot's idea of it.

    Returns:
        What it says; None for what cannot be read.
    """
    parts = text.split(":")
    if len(parts) < 6:
        return None
    history, comma, depth = parts[2].partition(",")
    if not comma or not _PLAIN_NUMBER.fullmatch(depth):
        return None
    kept = min(int(depth or _DEFAULT_DEPTH), _MOST_DEPTH)
    return Qos(parts[0] != _BEST_EFFORT, parts[1] == _TRANSIENT_LOCAL, kept, history == _KEEP_ALL)


class EntityKind(StrEnum):
    """The kinds of entities in the graph."""

    NODE = "NN"
    PUBLISHER = "MP"
    SUBSCRIPTION = "MS"
    SERVER = "SS"
    CLIENT = "SC"


@dataclass(frozen=True, slots=True)
class NodeName:
    """A node.

    Attributes:
        name: Its name, such as ``fogwatch``.
        namespace: Its namespace; empty for the root.
    """

    name: str
    namespace: str = ""


@dataclass(frozen=True, slots=True)
class Entity:
    """A node, or what a node has: a publisher, a subscription, a service's server or client.

    Attributes:
        domain: Its ROS_DOMAIN_ID.
        session: The id of its session.
        node_number: The number of its node in that session.
        number: Its own number in that session.
        kind: What it is.
        node: Its node.
        topic: The topic's or service's full name; empty for a node.
        type_name: The type as ROS calls it; empty for a node.
        type_hash: The type's hash; empty for a node.
        qos: The quality of service; None for a node, or where it cannot be read.
    """

    domain: int
    session: str
    node_number: int
    number: int
    kind: EntityKind
    node: NodeName
    topic: str = ""
    type_name: str = ""
    type_hash: str = ""
    qos: Qos | None = None

    @property
    def token(self) -> str:
        """The key of its liveliness token."""
        inside = self.node.namespace.strip("/")
        node = f"%/{mangled(f'/{inside}') if inside else '%'}/{mangled(self.node.name)}"
        begin = f"{ADMIN_SPACE}/{self.domain}/{self.session}/{self.node_number}/{self.number}/{self.kind}/{node}"
        if self.kind is EntityKind.NODE:
            return begin
        end = self.qos.text if self.qos is not None else Qos().text
        return f"{begin}/{mangled(self.topic)}/{dds_name(self.type_name)}/{self.type_hash}/{end}"


def entity_of(token: str) -> Entity | None:
    """Return the entity that a token stands for.

    Args:
        token: The key of a liveliness token of any node.

    Returns:
        The entity; None for what is none.
    """
    parts = token.split("/")
    if len(parts) < 9 or parts[0] != ADMIN_SPACE or parts[5] not in list(EntityKind):
        return None
    numbers = (parts[1], parts[3], parts[4])
    if not all(part.isascii() and part.isdigit() and len(part) < 20 for part in numbers):
        return None
    domain, node_number, number = map(int, numbers)
    kind, node = EntityKind(parts[5]), NodeName(unmangled(parts[8]), unmangled(parts[7]))
    if kind is EntityKind.NODE:
        return Entity(domain, parts[2], node_number, number, kind, node)
    if len(parts) < 13:
        return None
    topic, type_name, type_hash, qos = parts[9:13]
    return Entity(
        domain,
        parts[2],
        node_number,
        number,
        kind,
        node,
        unmangled(topic),
        ros_name(type_name),
        type_hash,
        qos_of(qos),
    )
