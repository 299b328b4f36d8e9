"""The key expressions of a fleet, under which its messages travel.

    fogwatch/<fleet>/position/<robot>            positions, when robots talk directly
    fogwatch/<fleet>/robot/<robot>/tick|reply    phases A and B of a simulated robot
    fogwatch/<fleet>/telemetry/<robot>           what a robot decided, for observers; agents never read it
    fogwatch/<fleet>/truth/<topic>               what the world knows, for observers; may be dropped
    fogwatch/<fleet>/control/<what>              what an operator asks of the world
    fogwatch/<fleet>/stop/<robot>                what an operator asks of a robot that no world carries
    fogwatch/<fleet>/alive/<robot>               liveliness tokens

A robot's name has no dot (`patrol.values.types.RobotName`), so that `WORLD` can never be one.
"""

from __future__ import annotations

import ipaddress
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from patrol.errors import BadInput
from patrol.net.carriers.serial_line import is_serial

ROOT = "fogwatch"
WORLD = ".world"
_FLEET = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]{0,127}")
_RELIABILITY = r"(?:rel|mixed_rel)=[01]"
_LOCATOR = re.compile(rf"(?:tcp|udp|tls|quic|ws)/[^\s/#?,]+:(\d{{1,5}})(?:\?{_RELIABILITY}(?:;{_RELIABILITY})*)?")
_LOSSLESS_DECLARATIONS = "?rel=1;mixed_rel=1"
"""What a locator of udp ends with, so that only what may be lost is sent unreliably."""
_GROUP = re.compile(r"udp/(\S+):(\d{1,5})(?:#iface=[^\s/#;]{1,15})?")


@dataclass(frozen=True, slots=True)
class FleetKeys:
    """The keys of one fleet; fleets of different names share a router and never meet."""

    fleet: str

    @property
    def anything(self) -> str:
        """All keys of the fleet."""
        return f"{ROOT}/{self.fleet}/**"

    def tick(self, robot: str) -> str:
        """Key of phases A and B, world to robot.

        Args:
            robot: Its name, or ``*`` for all robots.
        """
        return f"{ROOT}/{self.fleet}/robot/{robot}/tick"

    def reply(self, robot: str) -> str:
        """Key of a robot's answers, robot to world.

        Args:
            robot: Its name, or ``*`` for all robots.
        """
        return f"{ROOT}/{self.fleet}/robot/{robot}/reply"

    def position(self, robot: str) -> str:
        """Key of position frames, robot to robots.

        Args:
            robot: Its name, or ``*`` for all robots.
        """
        return f"{ROOT}/{self.fleet}/position/{robot}"

    def telemetry(self, robot: str) -> str:
        """Key of diagnostics, robot to observers.

        Args:
            robot: Its name, or ``*`` for all robots.
        """
        return f"{ROOT}/{self.fleet}/telemetry/{robot}"

    def truth(self, topic: str) -> str:
        """Key of what the world publishes, world to observers.

        Args:
            topic: Such as `patrol.net.messages.telemetry.METRICS`.
        """
        return f"{ROOT}/{self.fleet}/truth/{topic}"

    def control(self, what: str) -> str:
        """Key of operators' requests, which the world answers.

        Args:
            what: Such as `patrol.net.security.control_auth.ASK`.
        """
        return f"{ROOT}/{self.fleet}/control/{what}"

    def stop(self, robot: str) -> str:
        """Key of an operator's orders to stop, which the robot answers.

        Args:
            robot: Its name, or ``*`` for all robots.
        """
        return f"{ROOT}/{self.fleet}/stop/{robot}"

    def alive(self, who: str) -> str:
        """Key of a liveliness token.

        Args:
            who: a robot's name, `WORLD`, or ``*`` for all of them.
        """
        return f"{ROOT}/{self.fleet}/alive/{who}"


def fleet_keys(fleet: str, option: str = "--fleet") -> FleetKeys:
    """Make the keys of a fleet.

    Args:
        fleet: Its name.
        option: What errors call it.

    Raises:
        BadInput: When the name cannot be a part of a key.
    """
    if not _FLEET.fullmatch(fleet):
        raise BadInput(
            f"{option} {fleet!r}: not a name for a fleet; give at most 128 letters, digits, '.', '_' and '-', "
            "the first a letter or digit"
        )
    return FleetKeys(fleet)


def callers_of(keys: FleetKeys, numbers: Mapping[str, int]) -> dict[int, str]:
    """Return the keys under which robots send positions, by their numbers.

    Args:
        keys: Of their fleet.
        numbers: By their names.
    """
    return {number: keys.position(name) for name, number in numbers.items()}


def robot_of(key: str) -> str:
    """Return the robot's name in a key of `tick`, `reply`, `alive`, `telemetry` or `position`; empty for another key.

    Args:
        key: Any key.
    """
    parts = key.split("/")
    if len(parts) == 5 and parts[2] == "robot":
        return parts[3]
    return parts[3] if len(parts) == 4 else ""


def check_locator(locator: str, option: str, least_port: int = 1) -> str:
    """Check one address as Zenoh writes it, ``tcp/HOST:PORT``.

    Args:
        locator: The address.
        option: What errors call it.
        least_port: 0 where a process may listen on any free port.

    Returns:
        The locator.

    Raises:
        BadInput: For anything else.
    """
    match = _LOCATOR.fullmatch(locator)
    if match is None or not least_port <= int(match[1]) < 65536:
        raise BadInput(f"{option} {locator!r}: not a router's address; write tcp/HOST:PORT, such as tcp/127.0.0.1:7447")
    return locator


def check_locators(locators: str, option: str) -> str:
    """Check the addresses of a router, or of routers that are tried in turn.

    Args:
        locators: One locator, or several with commas between them.
        option: What errors call them.

    Returns:
        The locators, as given.

    Raises:
        BadInput: One of them is no locator.
    """
    for locator in locators.split(","):
        check_locator(locator, option)
    return locators


def address_of(locator: str) -> tuple[str, int]:
    """Return host and port of a locator.

    Args:
        locator: Such as ``quic/[::1]:7447?mixed_rel=1``.
    """
    host, _, port = locator.partition("/")[2].partition("?")[0].rpartition(":")
    return host.strip("[]"), int(port)


def is_loopback(host: str) -> bool:
    """Return True if a host is this machine alone.

    Args:
        host: a name or an address.
    """
    try:
        return ipaddress.ip_address(host.strip("[]")).is_loopback
    except ValueError:
        return host == "localhost"


def is_local(locator: str) -> bool:
    """Return True if all addresses of a router are on this machine alone.

    Args:
        locator: Such as ``tcp/127.0.0.1:7447``; several with commas between them.
    """
    return all(is_loopback(address_of(one)[0]) for one in locator.split(","))


def is_group(locator: str) -> bool:
    """Return True if a locator is an IPv4 multicast group.

    Args:
        locator: ``udp/GROUP:PORT``, perhaps with ``#iface=NAME``.
    """
    match = _GROUP.fullmatch(locator)
    try:
        return match is not None and 0 < int(match[2]) < 65536 and ipaddress.IPv4Address(match[1]).is_multicast
    except ValueError:
        return False


def check_radio(locator: str | None, option: str, via: str) -> str | None:
    """Check where robots hear each other: a multicast group, a serial line, a member's folder or routers' addresses.

    A router is reached over udp only if it sends subscriptions reliably: they are announced once, and where an
    announcement is lost, a robot is never heard. A group needs no announcements.

    Args:
        locator: The place, or None.
        option: What errors call it.
        via: The scenario's radio.via.

    Returns:
        The locator.

    Raises:
        BadInput: For anything else, and for a locator where radio.via is not direct.
    """
    if locator is None:
        return None
    if via != "direct":
        raise BadInput(f"{option} {locator}: the scenario's radio.via is {via}; set it to direct, or omit the option")
    if is_serial(locator) or is_group(locator) or (locator and Path(locator).is_dir()):
        return locator
    for one in locator.split(","):
        match = _LOCATOR.fullmatch(one)
        if match is None or not 0 < int(match[1]) < 65536:
            raise BadInput(
                f"{option} {one!r}: not an address for direct radio; write a multicast group, such as "
                "udp/224.0.0.225:7448#iface=wlan0, a serial line, serial/dev/ttyUSB0#baud=57600, the folder of a "
                "member of a mesh, or the address of a router, quic/HOST:PORT?mixed_rel=1"
            )
        if one.startswith("udp/") and not one.endswith(_LOSSLESS_DECLARATIONS):
            raise BadInput(
                f"{option} {one}: a subscription that is lost on its way would never be heard of again; write "
                f"{one.partition('?')[0]}{_LOSSLESS_DECLARATIONS}"
            )
    return locator
