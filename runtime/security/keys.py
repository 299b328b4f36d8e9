"""The key expressions of a fleet, under which its messages travel.

    fogwatch/<fleet>/position/<robot>            positions, when robots talk directly
    fogwatch/<fleet>/robot/<robot>/tick|reply    phases A and B of a simulated robot
    fogwatch/<fleet>/telemetry/<robot>           what a robot decided, for observers; agents never read it
    fogwatch/<fleet>/truth/<topic>               what the world knows, for observers; may be dropped
    fogwatch/<fleet>/control/<what>              what an operator asks of the world
    fogwatch/<fleet>/stop/<robot>                what an operator asks of a robot that no world carries
    fogwatch/<fleet>/alive/<robot>               liveliness tokens

A robot's name has no dot (`patrol.values.RobotName`), so that `WORLD` can never be one.
"""

from __future__ import annotations

import ipaddress
import re
import termios
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from patrol.errors import BadInput

ROOT = "fogwatch"
WORLD = ".world"
_FLEET = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]{0,127}")
_RELIABILITY = r"(?:rel|mixed_rel)=[01]"
_LOCATOR = re.compile(rf"(?:tcp|udp|tls|quic|ws)/[^\s/#?,]+:(\d{{1,5}})(?:\?{_RELIABILITY}(?:;{_RELIABILITY})*)?")
_NUMBERS = re.compile(r"(?:0[xX][0-9A-Fa-f]+|[0-9.])+")
"""What systems take for an IPv4 address in another notation, such as 4294967295, and never for a name."""
_LOSSLESS_DECLARATIONS = "?rel=1;mixed_rel=1"
"""What a locator of udp ends with, so that only what may be lost is sent unreliably."""
DEFAULT_BAUD = 57600
SERIAL_LOCATOR = re.compile(r"serial(/[^\s#]+)(?:#baud=(\d{1,8}))?")
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
        """Return the key of phases A and B, world to robot; ``*`` stands for all robots."""
        return f"{ROOT}/{self.fleet}/robot/{robot}/tick"

    def reply(self, robot: str) -> str:
        """Return the key of a robot's answers, robot to world; ``*`` stands for all robots."""
        return f"{ROOT}/{self.fleet}/robot/{robot}/reply"

    def position(self, robot: str) -> str:
        """Return the key of position frames, robot to robots; ``*`` stands for all robots."""
        return f"{ROOT}/{self.fleet}/position/{robot}"

    def telemetry(self, robot: str) -> str:
        """Return the key of diagnostics, robot to observers; ``*`` stands for all robots."""
        return f"{ROOT}/{self.fleet}/telemetry/{robot}"

    def truth(self, topic: str) -> str:
        """Return the key of what the world publishes under a topic, world to observers."""
        return f"{ROOT}/{self.fleet}/truth/{topic}"

    def control(self, what: str) -> str:
        """Return the key of operators' requests, which the world answers."""
        return f"{ROOT}/{self.fleet}/control/{what}"

    def stop(self, robot: str) -> str:
        """Return the key of an operator's orders to stop, which the robot answers; ``*`` for all robots."""
        return f"{ROOT}/{self.fleet}/stop/{robot}"

    def alive(self, who: str) -> str:
        """Return the key of a liveliness token: a robot's, that of `WORLD`, or with ``*`` those of all."""
        return f"{ROOT}/{self.fleet}/alive/{who}"


def fleet_keys(fleet: str, option: str = "--fleet") -> FleetKeys:
    """Make the keys of a fleet."""
    if not _FLEET.fullmatch(fleet):
        raise BadInput(
            f"{option} {fleet!r}: not a name for a fleet; give at most 128 letters, digits, '.', '_' and '-', "
            "the first a letter or digit"
        )
    return FleetKeys(fleet)


def callers_of(keys: FleetKeys, numbers: Mapping[str, int]) -> dict[int, str]:
    """Return the keys under which robots send positions, by their numbers."""
    return {number: keys.position(name) for name, number in numbers.items()}


def robot_of(key: str) -> str:
    """Return the robot's name in a key; empty for a key that has none.

    Keys of `tick`, `reply`, `alive`, `telemetry` and `position` have one.

    For example, "r1" in ``fogwatch/yard/position/r1`` and in ``fogwatch/yard/robot/r1/tick``.
    """
    parts = key.split("/")
    if len(parts) == 5 and parts[2] == "robot":
        return parts[3]
    return parts[3] if len(parts) == 4 else ""


def check_locator(locator: str, option: str, least_port: int = 1) -> str:
    """Check one address as Zenoh writes it, ``tcp/HOST:PORT``, and return it.

    `least_port` is 0 where a process may listen on any free port. Errors call the address `option`.
    """
    match = _LOCATOR.fullmatch(locator)
    if match is None or not least_port <= int(match[1]) < 65536:
        raise BadInput(f"{option} {locator!r}: not a router's address; write tcp/HOST:PORT, such as tcp/127.0.0.1:7447")
    if is_no_host(address_of(locator)[0]):
        raise BadInput(f"{option} {locator!r}: not the address of one machine; write four numbers, as in 192.168.1.10")
    return locator


def check_locators(locators: str, option: str) -> str:
    """Check the addresses of a router, or of several with commas between them, and return them as given."""
    for locator in locators.split(","):
        check_locator(locator, option)
    return locators


def address_of(locator: str) -> tuple[str, int]:
    """Return host and port of a locator; for example, ("::1", 7447) for ``quic/[::1]:7447?mixed_rel=1``."""
    host, _, port = locator.partition("/")[2].partition("?")[0].rpartition(":")
    return host.strip("[]"), int(port)


def is_no_host(host: str) -> bool:
    """Return True if a host is an address that no machine has, such as a group's, or numbers that are no address.

    For example, True for ``224.0.0.1`` and for ``1.2.3``, and False for ``192.168.1.10`` and ``robot-3``.
    """
    try:
        address = ipaddress.ip_address(host)
    except ValueError:
        return _NUMBERS.fullmatch(host) is not None
    return address.is_multicast or (address.version == 4 and address.is_reserved)


def is_loopback(host: str) -> bool:
    """Return True if a host is this machine alone."""
    try:
        return ipaddress.ip_address(host.strip("[]")).is_loopback
    except ValueError:
        return host == "localhost"


def is_local(locator: str) -> bool:
    """Return True if all addresses of a router, with commas between them, are on this machine alone."""
    return all(is_loopback(address_of(address)[0]) for address in locator.split(","))


def is_group(locator: str) -> bool:
    """Return True if a locator is an IPv4 multicast group: ``udp/GROUP:PORT``, perhaps with ``#iface=NAME``."""
    match = _GROUP.fullmatch(locator)
    try:
        return match is not None and 0 < int(match[2]) < 65536 and ipaddress.IPv4Address(match[1]).is_multicast
    except ValueError:
        return False


def is_serial(locator: str) -> bool:
    """Return True if a locator is that of a serial line, at a speed that this system has.

    It is ``serial/DEVICE``, perhaps with ``#baud=SPEED``.
    """
    match = SERIAL_LOCATOR.fullmatch(locator)
    return match is not None and line_speed(match[2]) is not None


def line_speed(baud: str | None) -> int | None:
    """Return the number by which `termios` knows a speed; None for one that it does not have."""
    speed: int | None = getattr(termios, f"B{int(baud or DEFAULT_BAUD)}", None)
    return speed or None


def check_radio(locator: str | None, option: str, via: str) -> str | None:
    """Check the locator under which robots hear each other, and return it; None stays None.

    It is a multicast group, a serial line, a member's folder or routers' addresses. It is refused where `via`, the
    scenario's radio.via, is not ``direct``.

    A router is reached over udp only if it sends subscriptions reliably: they are announced once, and where an
    announcement is lost, a robot is never heard. A group needs no announcements.
    """
    if locator is None:
        return None
    if via != "direct":
        raise BadInput(f"{option} {locator}: the scenario's radio.via is {via}; set it to direct, or omit the option")
    if is_serial(locator) or is_group(locator) or (locator and Path(locator).is_dir()):
        return locator
    for address in locator.split(","):
        match = _LOCATOR.fullmatch(address)
        if match is None or not 0 < int(match[1]) < 65536:
            raise BadInput(
                f"{option} {address!r}: not an address for direct radio; write a multicast group, such as "
                "udp/224.0.0.225:7448#iface=wlan0, a serial line, serial/dev/ttyUSB0#baud=57600, the folder of a "
                "member of a mesh, or the address of a router, quic/HOST:PORT?mixed_rel=1"
            )
        if address.startswith("udp/") and not address.endswith(_LOSSLESS_DECLARATIONS):
            raise BadInput(
                f"{option} {address}: a subscription that is lost on its way would never be heard of again; write "
                f"{address.partition('?')[0]}{_LOSSLESS_DECLARATIONS}"
            )
    return locator
