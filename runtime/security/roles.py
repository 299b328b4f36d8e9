"""The roles in a fleet, and the access rules of its router, or of members without one, that follow from them.

    robot     answers its own phases and orders to stop, sends its own position and telemetry, hears all positions
    world     sends phases to all robots and the truth to observers, and answers viewers and operators
    viewer    hears what is meant for observers, and asks the world for the run so far
    operator  is a viewer that also asks the world to control the run, and robots to stop
    router    passes on what another router of the fleet has let through

Everything that no rule allows is denied, at the router or, without one, by each member. A fleet's name and a
robot's name hold none of the characters that mean something in a key expression (``*``, ``$``, ``#``, ``?``, ``/``), so
a rule for one name never covers another.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import Any

from patrol.errors import BadInput
from runtime.security.keys import WORLD, FleetKeys

_ROBOT = re.compile(r"[A-Za-z0-9][A-Za-z0-9_-]{0,31}")
"""A robot's name, as `patrol.values.RobotName` has it."""

USERNAMES, COMMON_NAMES = "usernames", "cert_common_names"
"""Properties that a router knows a session by: the user of its password, or the common name of its certificate."""


BOTH_WAYS = ("ingress", "egress")
ALL_MESSAGES = (
    "put",
    "declare_subscriber",
    "query",
    "reply",
    "declare_queryable",
    "liveliness_token",
    "declare_liveliness_subscriber",
    "liveliness_query",
)
"""The messages of a fleet in Zenoh's access rules."""


class Kind(StrEnum):
    """The kinds of members that a fleet has."""

    ROBOT = "robot"
    WORLD = "world"
    VIEWER = "viewer"
    OPERATOR = "operator"


RESERVED = frozenset({"authority", "router", *(kind for kind in Kind if kind is not Kind.ROBOT)})
"""Names that stand for something else than a robot where robots and others are named side by side."""


@dataclass(frozen=True, slots=True)
class Role:
    """The role of a member of a fleet."""

    kind: Kind
    robot: str = ""  # its name; empty for other kinds

    @property
    def user(self) -> str:
        """The name that it is known by at the router; no two roles have the same."""
        return f"{self.kind}-{self.robot}" if self.robot else str(self.kind)

    @property
    def name(self) -> str:
        """The name for people: the robot's name, or its kind."""
        return self.robot or str(self.kind)


WORLD_ROLE, VIEWER, OPERATOR = Role(Kind.WORLD), Role(Kind.VIEWER), Role(Kind.OPERATOR)


def robot_role(name: str) -> Role:
    """Return the role of a robot."""
    if not _ROBOT.fullmatch(name):
        raise BadInput(
            f"robot {name!r}: not a robot's name; give at most 32 letters, digits, '_' and '-', the first a letter or "
            "digit"
        )
    return Role(Kind.ROBOT, name)


def role_of(user: str, where: str) -> Role:
    """Return the role whose `Role.user` is the given name.

    For example, "robot-r1" is the role of the robot r1, and "viewer" that of a viewer.
    """
    kind, dash, name = user.partition("-")
    if dash and kind == Kind.ROBOT:
        return robot_role(name)
    # Only robots have a name behind a dash, and none of them has no name.
    if dash or kind == Kind.ROBOT or kind not in list(Kind):
        raise BadInput(f"{where}: {user!r}: no role of a fleet; expected world, viewer, operator or robot-NAME")
    return Role(Kind(kind))


def roles_of(robots: Sequence[str]) -> tuple[Role, ...]:
    """List the roles of a fleet: its robots', and one of each other kind."""
    twice = {name for name in robots if robots.count(name) > 1}
    if twice:
        raise BadInput(f"robot {min(twice)!r}: named twice; name each robot once")
    return (*(robot_role(name) for name in robots), WORLD_ROLE, VIEWER, OPERATOR)


@dataclass(frozen=True, slots=True)
class Rights:
    """The key expressions that a role may use."""

    publish: tuple[str, ...] = ()  # it may publish under
    hear: tuple[str, ...] = ()  # it may subscribe to, and is sent
    ask: tuple[str, ...] = ()  # it may query
    answer: tuple[str, ...] = ()  # it may answer queries of
    announce: tuple[str, ...] = ()  # liveliness tokens that it may declare
    watch: tuple[str, ...] = ()  # liveliness tokens that it may see
    reply: tuple[str, ...] = ()  # of its answers, where they are others than the questions'
    answered: tuple[str, ...] = ()  # of the answers that it may get, where they are others than its questions'


def rights_of(role: Role, keys: FleetKeys) -> Rights:
    """Return the rights of a role; whatever they do not name is denied."""
    everyone = (keys.alive("*"),)
    robot = role.robot
    match role.kind:
        case Kind.ROBOT:
            return Rights(
                publish=(keys.reply(robot), keys.position(robot), keys.telemetry(robot)),
                hear=(keys.tick(robot), keys.position("*")),
                answer=(keys.stop(robot),),
                announce=(keys.alive(robot),),
                watch=(keys.alive(WORLD), keys.alive(robot)),
            )
        case Kind.WORLD:
            return Rights(
                publish=(keys.tick("*"), keys.truth("*")),
                hear=(keys.reply("*"), keys.position("*"), keys.telemetry("*"), keys.truth("*")),
                answer=(keys.truth("*"), keys.control("*")),
                announce=(keys.alive(WORLD),),
                watch=everyone,
            )
        case Kind.VIEWER | Kind.OPERATOR:
            return Rights(
                hear=(keys.truth("*"), keys.position("*"), keys.telemetry("*")),
                ask=(keys.truth("*"), *([keys.control("*"), keys.stop("*")] if role.kind is Kind.OPERATOR else [])),
                watch=everyone,
            )


def router_name(fleet: str) -> str:
    """Return the common name of the certificate of a fleet's routers; no member has it."""
    return f"router.{fleet[:50]}"  # a common name has at most 64 characters


def access_control(
    keys: FleetKeys, members: Mapping[str, Role], known_by: str, *, routers: bool = True
) -> dict[str, Any]:
    """Write the access rules of a router, or of a member of a mesh, as Zenoh's configuration takes them.

    They deny everything but the rights of each member, by the name that the router knows it by: `known_by` is
    `USERNAMES` or `COMMON_NAMES`. Another router of the fleet, which is known by its certificate, may pass on whatever
    belongs to the fleet: it has applied the same rules.
    """
    allowed = {name: rules_of(name, rights_of(role, keys), (keys.anything,)) for name, role in members.items()}
    if routers and known_by == COMMON_NAMES:
        router_rule = router_name(keys.fleet)
        allowed[router_rule] = [rule(router_rule, BOTH_WAYS, [keys.anything])]
    return deny_all_but(allowed, {name: {known_by: [name]} for name in allowed})


def deny_all_but(
    allowed: Mapping[str, Sequence[Mapping[str, Any]]], subjects: Mapping[str, Mapping[str, Any]]
) -> dict[str, Any]:
    """Return access rules for Zenoh's configuration: each subject's own ones, by the properties that it is known by."""
    return {
        "enabled": True,
        "default_permission": "deny",
        "rules": [rule for own in allowed.values() for rule in own],
        "subjects": [{"id": name, **known_by} for name, known_by in subjects.items()],
        "policies": [{"subjects": [name], "rules": [rule["id"] for rule in own]} for name, own in allowed.items()],
    }


def rule(
    name: str, flows: Sequence[str], expressions: Sequence[str], messages: Sequence[str] = ALL_MESSAGES
) -> dict[str, Any]:
    """Write a rule that allows messages under key expressions, as Zenoh's configuration takes it."""
    return {
        "id": name,
        "permission": "allow",
        "flows": list(flows),
        "messages": list(messages),
        "key_exprs": list(expressions),
    }


def rules_of(name: str, rights: Rights, anything: tuple[str, ...]) -> list[dict[str, Any]]:
    """Write the rules of one member, as Zenoh's configuration takes them, under names that begin with `name`.

    Ingress is what it sends to the router, egress what the router sends to it. `anything` covers all that others may
    want of it or offer it.
    """
    rule_parts = (
        ("publish", "ingress", ("put",), rights.publish),
        ("subscribe", "ingress", ("declare_subscriber",), rights.hear),
        ("hear", "egress", ("put",), rights.hear),
        ("ask", "ingress", ("query",), rights.ask),
        ("be-answered", "egress", ("reply",), (*rights.ask, *rights.answered)),
        ("offer", "ingress", ("declare_queryable", "reply"), rights.answer),
        ("reply", "ingress", ("reply",), rights.reply),
        ("be-asked", "egress", ("query",), rights.answer),
        ("announce", "ingress", ("liveliness_token",), rights.announce),
        ("watch", "ingress", ("declare_liveliness_subscriber", "liveliness_query"), rights.watch),
        ("see", "egress", ("liveliness_token",), rights.watch),
        # Zenoh drops data without a matching subscriber, so publishers may see subscriptions, but no content.
        ("be-wanted", "egress", ("declare_subscriber",), anything if rights.publish else ()),
        ("be-offered", "egress", ("declare_queryable",), anything if rights.ask else ()),
    )
    return [
        rule(f"{name} {part}", [flow], expressions, messages)
        for part, flow, messages, expressions in rule_parts
        # A rule without expressions would match nothing, and Zenoh refuses it.
        if expressions
    ]
