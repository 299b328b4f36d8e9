"""Access rules of the Zenoh router of a ROS 2 robot, as Zenoh's configuration takes them.

ROS itself has no access rules: each client of the router `rmw_zenohd`, which listens on all interfaces, can drive the
robot. Here the robot's own programs are those that come over TCP from the machine itself, and may do everything. A
client that comes over the network needs a certificate of the fleet. The agent's may command the robot and show what it
knows; a viewer's may look, and be seen in the graph as a node with nothing to offer. No other client may do anything.

A latched topic is more than its key: a late subscriber finds its publisher, and asks it, under ``@adv``. The answer,
which is its last message, comes under the topic's own key.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from ros2.wire.formats import Format
from ros2.wire.goals import NAME
from ros2.wire.names import ADMIN_SPACE, EntityKind, full_name, mangled
from runtime.security.roles import ALL_MESSAGES, BOTH_WAYS, COMMON_NAMES, Rights, deny_all_but, rule, rules_of

COMMANDS = ("cmd_vel", "ackermann_cmd")
"""Topics by which an agent drives its robot, relative to its namespace."""
TOLD = ("initialpose",)
"""Topics by which an agent tells its robot's localisation where the robot is."""
SHOWN = ("/map", "map", "fog", "path", "/diagnostics")
"""Topics by which an agent shows its knowledge."""
HEARD = ("/tf", "/tf_static", "/map", "/clock")
"""Topics outside of the robot's namespace that an agent hears."""

COMMAND_HZ = 100.0
"""More commands a second than this do not pass; an agent sends 20 at most."""
COMMAND_BYTES = 1024
"""No longer command passes; the longest names make one of some 400 bytes."""

_LOCAL = "this machine"
_EVERYTHING = ("**", "**/@adv/**", f"{ADMIN_SPACE}/**", f"@/*/{ADMIN_SPACE}/**")


def agent_rights(form: Format, namespace: str, commands: Sequence[str] = COMMANDS) -> Rights:
    """Return the rights of a robot's agent at its router."""
    published = tuple(form.heard(full_name(namespace, name)) for name in (*commands, *TOLD, *SHOWN))
    topics = _heard_keys(form, namespace)
    actions = form.heard(f"{full_name(namespace, NAME)}/_action/*")
    return Rights(
        publish=published,
        hear=topics,
        ask=(*_latched_keys(topics), actions),
        answer=_latched_keys(published),
        announce=(*_latched_keys(published), *_node_tokens(form, namespace, "*/*/*/*", "**")),
        watch=(*_latched_keys(topics), form.graph),
        reply=published,
        answered=topics,
    )


def viewer_rights(form: Format, namespace: str) -> Rights:
    """Return the rights of a client that only reads."""
    topics = _heard_keys(form, namespace)
    latched = _latched_keys(topics)
    node = _node_tokens(form, namespace, f"*/*/*/{EntityKind.NODE}", "*")
    return Rights(hear=topics, ask=latched, announce=node, watch=(*latched, form.graph), answered=topics)


def _heard_keys(form: Format, namespace: str) -> tuple[str, ...]:
    return tuple(dict.fromkeys([form.inside(full_name(namespace, "")), *map(form.heard, HEARD)]))


def _latched_keys(keys: Sequence[str]) -> tuple[str, ...]:
    return tuple(f"{key}/@adv/**" for key in keys)


def _node_tokens(form: Format, namespace: str, entity: str, name: str) -> tuple[str, ...]:
    """Return the tokens of nodes in the robot's own namespace and of their entities, as key expressions.

    `entity` stands for session, node, entity and kind, `name` for the node's name and what follows it. A bridge has no
    tokens.
    """
    if not form.attaches:
        return ()
    inside = namespace.strip("/")
    space = mangled(f"/{inside}" if inside else "")
    return (f"{ADMIN_SPACE}/{form.domain}/{entity}/*/{space}/{name}",)


def access_control(form: Format, namespace: str, members: Mapping[str, Rights]) -> dict[str, Any]:
    """Return the access rules of a robot's router: all but its own programs and `members` are denied.

    `members` are rights by the common name of a certificate.
    """
    topics = _heard_keys(form, namespace)
    allowed = {_LOCAL: [rule(_LOCAL, BOTH_WAYS, _EVERYTHING, (*ALL_MESSAGES, "delete"))]}
    for name, rights in members.items():
        anything = tuple(dict.fromkeys([*topics, *_latched_keys(topics), *rights.publish, *rights.ask]))
        allowed[name] = rules_of(name, rights, anything)
    own_programs = {_LOCAL: {"interfaces": ["lo"], "link_protocols": ["tcp"]}}
    return deny_all_but(allowed, own_programs | {name: {COMMON_NAMES: [name]} for name in members})


def robot_router(
    form: Format,
    namespace: str,
    members: Mapping[str, Rights],
    listen: Sequence[str],
    tls: Mapping[str, object],
    commands: Sequence[str] = COMMANDS,
) -> dict[str, Any]:
    """Return the configuration of a robot's router.

    It is what Zenoh's router reads, such as `rmw_zenohd` by ``ZENOH_ROUTER_CONFIG_URI``. `members` are rights by the
    common name of a certificate. `listen` has locators: TCP on loopback for the robot's own programs, TLS for the
    fleet's members. `tls` says where the router's certificate and key lie, as Zenoh's configuration names them.
    """
    driven = [form.heard(full_name(namespace, name)) for name in commands]
    network = {"link_protocols": ["tls"], "flows": ["ingress"]}
    return {
        "mode": "router",
        "listen": {"endpoints": list(listen)},
        "scouting": {"multicast": {"enabled": False}, "gossip": {"enabled": True}},
        "timestamping": {"enabled": {"router": True, "peer": True, "client": True}},
        "transport": {
            "shared_memory": {"enabled": False},
            "link": {
                "tls": dict(tls),
                # A client that stops reading is cut off, and holds up no other for longer.
                "tx": {"queue": {"congestion_control": {"block": {"wait_before_close": 1_000_000}}}},
            },
        },
        "access_control": access_control(form, namespace, members),
        "downsampling": [
            {
                "id": "commands are few",
                "messages": ["put"],
                "rules": [{"key_expr": key, "freq": COMMAND_HZ} for key in driven],
                **network,
            }
        ],
        "low_pass_filter": [
            {
                "id": "commands are short",
                "messages": ["put"],
                "key_exprs": driven,
                "size_limit": COMMAND_BYTES,
                **network,
            }
        ],
    }
