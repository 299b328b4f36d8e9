"""Names and addresses of the machines of a fleet's router or robots: which can work, and the locators that follow."""

from __future__ import annotations

import ipaddress
import re
from collections.abc import Collection, Sequence

from patrol.errors import BadInput
from patrol.security.keys import is_loopback

LOCAL = ("127.0.0.1", "localhost")
"""Those of every machine itself."""

_LABEL = r"[A-Za-z0-9_](?:[A-Za-z0-9_-]{0,61}[A-Za-z0-9_])?"
_NAME = re.compile(rf"(?=.{{1,253}}\Z){_LABEL}(?:\.{_LABEL})*")
_NUMBERS = re.compile(r"[0-9.]*")
_WITH_PORT = re.compile(r"(?:[^:]+|\[.*\]):[0-9]+")


def checked_hosts(hosts: Sequence[str], called: str = "--host") -> list[str]:
    """Check hosts, and return each of them once, addresses without brackets.

    Refused is one by which other machines could not reach its machine. Errors name it by `called`.
    """
    return [*dict.fromkeys(_check_host(host, called) for host in hosts)]


def member_locator(hosts: Sequence[str], port: int) -> str:
    """Return the locator that members use: that of the first of the router's checked hosts."""
    return f"tls/{_join_authority(hosts[0], port)}"


def mesh_locator(host: str, port: int, taken: Collection[str]) -> str:
    """Return the locator of a member that others connect to without a router.

    Positions may be lost on it, the rest not. `port` is the first UDP port to try: one on the same host as a locator in
    `taken` needs another port.
    """
    while (locator := f"quic/{_join_authority(host, port)}?mixed_rel=1") in taken:
        port += 1
    return locator


def _join_authority(host: str, port: int) -> str:
    return f"[{host}]:{port}" if ":" in host else f"{host}:{port}"


def listening_locator(hosts: Sequence[str], port: int) -> str:
    """Return the locator that the router listens on: all addresses of its machine, or this machine alone."""
    if all(is_loopback(host) for host in hosts):
        return member_locator(hosts, port)
    return f"tls/{'[::]' if any(':' in host for host in hosts) else '0.0.0.0'}:{port}"


def _check_host(host: str, called: str) -> str:
    bare = host[1:-1] if host[:1] == "[" and host[-1:] == "]" else host
    try:
        address = ipaddress.ip_address(bare)
    except ValueError:
        return _checked_name(host, called)
    if address.is_unspecified or address.is_multicast:
        raise BadInput(f"{called} {host}: is no machine's own address; give the one that members reach it at")
    if "%" in bare:
        interface = bare[bare.index("%") :]
        raise BadInput(f"{called} {host}: no certificate or file can name an interface; leave {interface} out")
    return str(address)


def _checked_name(host: str, called: str) -> str:
    if _WITH_PORT.fullmatch(host):
        name, _, port = host.rpartition(":")
        raise BadInput(f"{called} {host!r}: holds a port; write {name} here, and --port {port}")
    if not _NAME.fullmatch(host) or _NUMBERS.fullmatch(host):
        raise BadInput(f"{called} {host!r}: not the name or address of a machine; write it as in 192.168.1.10")
    return host
