"""Names of ROS 2, its quality of service, and the entities of its graph with the tokens that `rmw_zenoh` gives them."""

from __future__ import annotations

import os
import re
from dataclasses import dataclass, field
from enum import StrEnum

from patrol.errors import BadInput

_NAME = re.compile(r"/?[A-Za-z_][A-Za-z0-9_]*(?:/[A-Za-z_][A-Za-z0-9_]*)*")
_LONGEST_NAME = 255
_BEST_EFFORT, _TRANSIENT_LOCAL = "2", "1"

ADMIN_SPACE = "@ros2_lv"
LAST_DOMAIN = 232


def check_name(name: str, option: str) -> str:
    """Check and return a name or namespace of ROS, which is a part of keys; empty is the root namespace."""
    if name not in {"", "/"} and (len(name) > _LONGEST_NAME or not _NAME.fullmatch(name)):
        raise BadInput(
            f"{option} {name!r}: not a name in ROS; write letters, digits and '_', the first of each part no digit, "
            "with '/' between parts, such as robot1 or /map"
        )
    return name


def check_domain(domain: int, option: str) -> int:
    """Check a ROS_DOMAIN_ID."""
    if not 0 <= domain <= LAST_DOMAIN:
        raise BadInput(f"{option} {domain}: not a domain of ROS 2; give the robot's ROS_DOMAIN_ID, 0 to {LAST_DOMAIN}")
    return domain


def domain_given(domain: int | None) -> int:
    """Return the ROS_DOMAIN_ID that an option gives, or else the environment, or else 0, as in ROS."""
    if domain is not None:
        return check_domain(domain, "--domain")
    text = os.environ.get("ROS_DOMAIN_ID", "0")
    if not (text.isascii() and text.isdecimal() and len(text) <= 9):
        raise BadInput(f"ROS_DOMAIN_ID={text[:20]!r} in the environment: expected a whole number, 0 to {LAST_DOMAIN}")
    return check_domain(int(text), "ROS_DOMAIN_ID in the environment:")


def full_name(namespace: str, name: str) -> str:
    """Return a name with its namespace, as ROS resolves it, with a leading slash.

    A name that begins with a slash is taken from the root.

    For example, cmd_vel in the namespace robot1 is /robot1/cmd_vel, and /map stays /map.
    """
    if name.startswith("/"):
        return name
    inside = namespace.strip("/")
    return f"/{inside}/{name}" if inside else f"/{name}"


def dds_name(type_name: str) -> str:
    """Return a type such as ``geometry_msgs/msg/Twist`` as DDS calls it.

    For example, ``geometry_msgs::msg::dds_::Twist_``.
    """
    package, kind, name = type_name.split("/")
    return f"{package}::{kind}::dds_::{name}_"


def ros_name(dds: str) -> str:
    """Return a type such as ``geometry_msgs::msg::dds_::Twist_`` as ROS calls it; any other text as it is."""
    parts = dds.split("::")
    if len(parts) == 4 and parts[2] == "dds_" and parts[3].endswith("_"):
        return f"{parts[0]}/{parts[1]}/{parts[3][:-1]}"
    return dds


def mangled(name: str) -> str:
    """Return a name as a part of a token, where no slash may be and nothing may be empty.

    For example, /robot1/cmd_vel is %robot1%cmd_vel, and the root is %.
    """
    return name.replace("/", "%") or "%"


def unmangled(part: str) -> str:
    """Return the name in a part of a token; empty for the root."""
    return "" if part == "%" else part.replace("%", "/")


@dataclass(frozen=True, slots=True)
class Qos:
    """The quality of service of a publisher or a subscription; a mismatch does not keep the two apart."""

    reliable: bool = True
    latched: bool = False  # transient local: a late subscriber still gets the last `depth` messages
    depth: int = 10  # messages that are kept

    @property
    def text(self) -> str:
        """The text of `rmw_zenoh` in a token: usual values are left out.

        For example, "::,10:,:,:,," for a reliable topic, and "2::,5:,:,:,," for a sensor's.
        """
        reliability, durability = "" if self.reliable else _BEST_EFFORT, _TRANSIENT_LOCAL if self.latched else ""
        return f"{reliability}:{durability}:,{self.depth}:,:,:,,"


USUAL = Qos()
LATCHED = Qos(latched=True, depth=1)
SENSOR = Qos(reliable=False, depth=5)
SERVICE = Qos()


class EntityKind(StrEnum):
    """The kinds of entities in the graph."""

    NODE = "NN"
    PUBLISHER = "MP"
    SUBSCRIPTION = "MS"
    SERVER = "SS"
    CLIENT = "SC"


@dataclass(frozen=True, slots=True)
class NodeName:
    """A node."""

    name: str
    namespace: str = ""  # empty for the root


@dataclass(frozen=True, slots=True)
class Entity:
    """A node, or a part of one: a publisher, a subscription, a service's server or client."""

    domain: int  # ROS_DOMAIN_ID
    session: str
    node_number: int  # of its node in that session
    number: int  # its own in that session
    kind: EntityKind
    node: NodeName
    topic: str = ""  # full name of the topic or service; empty for a node
    type_name: str = ""  # as ROS calls it; empty for a node
    type_hash: str = ""  # empty for a node
    qos: Qos = field(default=USUAL, compare=False)  # of ours; that of others is not read

    @property
    def token(self) -> str:
        """The key of its liveliness token."""
        inside = self.node.namespace.strip("/")
        node = f"%/{mangled(f'/{inside}') if inside else '%'}/{mangled(self.node.name)}"
        begin = f"{ADMIN_SPACE}/{self.domain}/{self.session}/{self.node_number}/{self.number}/{self.kind}/{node}"
        if self.kind is EntityKind.NODE:
            return begin
        return f"{begin}/{mangled(self.topic)}/{dds_name(self.type_name)}/{self.type_hash}/{self.qos.text}"


def entity_of(token: str) -> Entity | None:
    """Return the entity that a token stands for."""
    parts = token.split("/")
    if len(parts) < 9 or parts[0] != ADMIN_SPACE or parts[5] not in list(EntityKind):
        return None
    numbers = (parts[1], parts[3], parts[4])
    # ASCII first: isdigit takes superscripts as well, which int refuses.
    if not all(part.isascii() and part.isdigit() and len(part) < 20 for part in numbers):
        return None
    domain, node_number, number = map(int, numbers)
    kind, node = EntityKind(parts[5]), NodeName(unmangled(parts[8]), unmangled(parts[7]))
    if kind is EntityKind.NODE:
        return Entity(domain, parts[2], node_number, number, kind, node)
    if len(parts) < 13:
        return None
    topic, type_name, type_hash = unmangled(parts[9]), ros_name(parts[10]), parts[11]
    return Entity(domain, parts[2], node_number, number, kind, node, topic, type_name, type_hash)
