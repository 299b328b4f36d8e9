"""Opens the links of a process: to the fleet's router, and to the network of positions where it has one of its own."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING

from patrol.errors import BadInput
from runtime.net.link import Link, LinkDown, NotAdmitted, PortBusy, listens, open_link, open_session
from runtime.net.multicast import GroupDown, open_group
from runtime.net.serial_line import SerialDown, open_serial
from runtime.net.settings import client_settings
from runtime.security.credentials import Credentials, read_credentials
from runtime.security.keys import is_group, is_local, is_serial

if TYPE_CHECKING:
    from runtime.net.mailbox import Air

RADIO_LEASE_S = 2.0
"""A client that is silent for so long is gone for a router that carries nothing but positions."""


def open_links(
    router: str,
    radio: str | None,
    wait_s: float,
    say: Callable[[str], None],
    stopped: Callable[[], bool],
    credentials: Credentials | None = None,
    callers: Mapping[int, str] = MappingProxyType({}),
) -> tuple[Link, Air] | None:
    """Open the link to the router and the one for positions; return None when `stopped` says so.

    Where `radio` is None, both are the same link. Each may take `wait_s`. Only a serial line needs `callers`, the keys
    under which the robots send, by their numbers: it carries no keys itself.
    """
    on_a_mesh = _mesh_credentials(radio, credentials)
    if radio is not None and credentials is not None and not (on_a_mesh or is_group(radio) or is_serial(radio)):
        credentials.check_router(radio, "--radio")

    def waiting_for(where: str, own: Credentials | None) -> Callable[[float], None]:
        whom = "a router" if own is None or own.mesh is None else f"a member of fleet {own.fleet}"

        def waiting(waited: float) -> None:
            but = "; something listens there, but has not let this process in" if listens(where) else ""
            say(f"waiting for {whom} at {where} ({waited:.0f} s){but}")

        return waiting

    try:
        link = open_link(router, wait_s, waiting_for(router, credentials), stopped, credentials)
    except NotAdmitted as refused:
        raise BadInput(str(refused)) from None
    except LinkDown as down:
        if stopped():
            return None
        remedy = "" if isinstance(down, PortBusy) else f"; {_remedy_text(router, credentials)}"
        raise BadInput(f"{down}{remedy}") from None
    if radio is None:
        return link, link
    waiting = waiting_for(radio, credentials) if on_a_mesh is None else waiting_for(on_a_mesh.router, on_a_mesh)
    try:
        return link, open_air(radio, wait_s, waiting, stopped, on_a_mesh or credentials, callers)
    except (LinkDown, GroupDown, SerialDown) as down:
        link.close()
        if stopped():
            return None
        raise BadInput(f"--radio {radio}: {down}") from None


def open_air(
    radio: str,
    wait_s: float,
    waiting: Callable[[float], None],
    stopped: Callable[[], bool],
    credentials: Credentials | None = None,
    callers: Mapping[int, str] = MappingProxyType({}),
) -> Air:
    """Open the link for positions alone: a group, a serial line, a mesh, or a router of its own."""
    if is_group(radio):
        return open_group(radio)
    if is_serial(radio):
        return open_serial(radio, callers)
    if credentials is not None and credentials.mesh is not None:
        return open_link(credentials.router, wait_s, waiting, stopped, credentials)
    # A link that has been cut delivers on its return what is long out of date; with a short lease it is a new one.
    settings = client_settings(radio, RADIO_LEASE_S, credentials)
    return Link(open_session(settings, radio, wait_s, waiting, stopped))


def _remedy_text(router: str, credentials: Credentials | None) -> str:
    """Return the remedy where no router or member answers."""
    if credentials is not None and credentials.mesh is not None:
        return "is one of them running, and are the certificates valid: fogwatch fleet check?"
    how = f"--listen {router}" if credentials is None and is_local(router) else "--fleet FOLDER"
    return f"start one with: fogwatch router {how}"


def _mesh_credentials(radio: str | None, own: Credentials | None) -> Credentials | None:
    """Read the credentials for a mesh that carries positions alone; None for another radio. Raises BadInput."""
    if radio is None or not Path(radio).is_dir():
        return None
    identity = read_credentials(Path(radio), "--radio")
    if identity.mesh is None:
        raise BadInput(
            f"--radio {radio}: its fleet meets at a router, {identity.router}; name that, or a mesh's folder"
        )
    if own is not None and (identity.fleet, identity.role) != (own.fleet, own.role):
        raise BadInput(
            f"--radio {radio}: is the folder of {identity.role.name} in fleet {identity.fleet}, and this process is "
            f"{own.role.name} in {own.fleet}; give its folder in a mesh made with: fleet init --name {own.fleet}"
        )
    return identity
