"""A fleet without a router: the members that meet each other directly, and where the first ones listen.

Each member's folder holds the same file `MESH`, which is no secret: who is a member, and known addresses. A member
listens at its own, if it has one, and connects to all others; gossip tells it of those without. Both ends connect,
since each lets in one at a time: a connection whose packets are lost can hold up all others for 30 s. A
member lets in each process with a certificate of the fleet's authority. That process may do what its role may do at a
router: each member applies the access rules to what comes in.

The name of a host is not verified, because members may have any address: the certificate's common name says which
member it is, and nothing is accepted from one that no rule names.
"""

from __future__ import annotations

import ipaddress
import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from patrol.errors import BadInput
from runtime.security.keys import address_of, check_locator, fleet_keys, is_local
from runtime.security.private_files import read_object, text_in
from runtime.security.roles import COMMON_NAMES, Role, access_control, role_of

MESH = "mesh.json"
"""The file in a member's folder that names the members of a fleet without a router."""
LEASE_S = 5.0
"""A member that is silent for so long is gone for the others, s: the longest time until they notice its death."""
_SIGNS = 16
"""Signs of life in that time, of each link. Where all are lost, the link for what may be lost is given up for good, and
positions then travel on the other one, which repeats them until they arrive: late. With Zenoh's 4 this happened within
minutes where 30 % of the datagrams were lost."""
GUARDED = ("quic/", "tls/")
"""How locators of carriers begin that know certificates; a member of a mesh uses no others."""
_ANYWHERE, _HERE = "quic/0.0.0.0:0?mixed_rel=1", "quic/127.0.0.1:0?mixed_rel=1"
"""Any free port, for members whose address nobody needs to know."""
_REMEDY = "copy mesh.json from the fleet's folder again"


@dataclass(frozen=True, slots=True)
class Mesh:
    """A fleet without a router, as each of its members knows it."""

    fleet: str
    members: Mapping[str, Role]  # by the common name of the certificate
    places: Mapping[str, str]  # known locators that others connect to, by `Role.user`

    @property
    def robots(self) -> list[str]:
        """The names of all robots."""
        return sorted(role.robot for role in self.members.values() if role.robot)

    def others(self, role: Role) -> tuple[str, ...]:
        """Return the locators that a member connects to."""
        return tuple(address for user, address in self.places.items() if user != role.user)

    def listens_at(self, role: Role, *, beside: bool) -> str:
        """Return where a member listens: at its known address alone, so that what it hears comes by that network.

        A name may stand for loopback on its own machine: then, on all addresses. Without a known one, on any free port;
        also where another session of this process listens at the address already (`beside`).
        """
        address = None if beside else self.places.get(role.user)
        if address is None:
            return _HERE if all(map(is_local, self.places.values())) else _ANYWHERE
        return address if is_address(address) else everywhere(address)

    def session(self, listen: str) -> dict[str, object]:
        """Give the settings for Zenoh's configuration of a member's session, but for its certificate, by key."""
        return {
            "mode": "peer",
            "scouting/gossip/enabled": True,
            "scouting/gossip/autoconnect_strategy": {"peer": {"to_router": "always", "to_peer": "greater-zid"}},
            "listen/endpoints": [listen],
            "transport/link/protocols": [protocol.removesuffix("/") for protocol in GUARDED],
            "transport/link/tx/lease": round(LEASE_S * 1000),
            "transport/link/tx/keep_alive": _SIGNS,
            "transport/link/tls/verify_name_on_connect": False,
            "access_control": access_control(fleet_keys(self.fleet), self.members, COMMON_NAMES, routers=False),
        }


def mesh_json(mesh: Mesh) -> str:
    """Return the text of the file `MESH`."""
    users = {name: role.user for name, role in mesh.members.items()}
    return f"{json.dumps({'fleet': mesh.fleet, 'members': users, 'places': dict(mesh.places)}, indent=2)}\n"


def read_mesh(file: Path, option: str) -> Mesh:
    """Read the file `MESH`."""
    says = read_object(file, option)
    where = f"{option}: {file}"
    fleet = fleet_keys(text_in(says, "fleet's name", "fleet", where), f"{where}: fleet").fleet
    members, places = (_read_texts(says, name, where) for name in ("members", "places"))
    for user, address in places.items():
        role_of(user, f"{where}: places")
        check_place(address, f"{where}: places: {user}:")
    # Gossip needs a first member whose address is known.
    if not places:
        raise BadInput(f"{where}: names no address; give a robot one: fogwatch fleet revoke and add NAME --host HOST")
    return Mesh(fleet, {name: role_of(user, f"{where}: members") for name, user in members.items()}, places)


def check_place(place: str, option: str) -> str:
    """Check the address of a member of a mesh; return it. Raises BadInput."""
    check_locator(place, option)
    if not place.startswith(GUARDED):
        raise BadInput(f"{option} {place}: members have certificates, which need quic or tls; write quic/HOST:PORT")
    return place


def _read_texts(says: Mapping[str, Any], name: str, where: str) -> dict[str, str]:
    value = says.get(name)
    if not isinstance(value, dict) or not all(isinstance(text, str) for text in value.values()):
        raise BadInput(f'{where}: expected "{name}", an object of texts; {_REMEDY}')
    return value


def is_address(place: str) -> bool:
    """Return True if a locator names its host by an address, or is this machine alone."""
    if is_local(place):
        return True
    try:
        ipaddress.ip_address(address_of(place)[0].strip("[]"))
    except ValueError:
        return False
    return True


def everywhere(place: str) -> str:
    """Return the locator to listen on at a place's port, where its address is not this machine's: on all addresses.

    For example, ``quic/0.0.0.0:7447?mixed_rel=1`` for ``quic/robot-1.lan:7447?mixed_rel=1``.
    """
    host, port = address_of(place)
    protocol, _, tail = place.partition("/")
    _, mark, reliability = tail.partition("?")
    return f"{protocol}/{'[::]' if ':' in host else '0.0.0.0'}:{port}{mark}{reliability}"
