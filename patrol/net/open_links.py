"""Opens what a process of a fleet needs: the link to the router, and what carries positions where that is another."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import TYPE_CHECKING

from patrol.errors import BadInput
from patrol.net.carriers.multicast import GroupDown, open_group
from patrol.net.carriers.serial_line import SerialDown, is_serial, open_serial
from patrol.net.keys import is_group, is_local
from patrol.net.link import Link, LinkDown, NotAdmitted, listens, open_link, open_session
from patrol.net.settings import client_settings

if TYPE_CHECKING:
    from patrol.net.mailbox import Air
    from patrol.net.security.credentials import Credentials

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
    """Open the link to the router and the one for positions.

    Args:
        router: The router's locator.
        radio: Where robots hear each other, or None for the same router.
        wait_s: How long to wait for each.
        say: Takes a line now and then while the process waits.
        stopped: Whether to give up.
        credentials: Prove this process's identity at both routers; None for routers that ask for none.
        callers: The keys under which the robots send, by their numbers, for a serial line, which carries no keys.

    Returns:
        Both links, which may be the same; None when `stopped` says so.

    Raises:
        BadInput: When no router has answered after `wait_s`, or the credentials cannot be used at `radio`.
    """
    if radio is not None and credentials is not None and not is_group(radio):
        credentials.check_router(radio, "--radio")

    def waiting_for(where: str) -> Callable[[float], None]:
        def waiting(waited: float) -> None:
            but = "; something listens there, but has not let this process in" if listens(where) else ""
            say(f"waiting for a router at {where} ({waited:.0f} s){but}")

        return waiting

    try:
        link = open_link(router, wait_s, waiting_for(router), stopped, credentials)
    except NotAdmitted as refused:
        raise BadInput(str(refused)) from None
    except LinkDown as down:
        if stopped():
            return None
        how = f"--listen {router}" if credentials is None and is_local(router) else "--fleet FOLDER"
        raise BadInput(f"{down}; start one with: fogwatch router {how}") from None
    if radio is None:
        return link, link
    try:
        if is_group(radio):
            return link, open_group(radio)
        if is_serial(radio):
            return link, open_serial(radio, callers)
        # A link that has been cut delivers on its return what is long out of date; with a short lease it is a new one.
        settings = client_settings(radio, RADIO_LEASE_S, credentials)
        return link, Link(open_session(settings, radio, wait_s, waiting_for(radio), stopped))
    except (LinkDown, GroupDown, SerialDown) as down:
        link.close()
        if stopped():
            return None
        raise BadInput(f"--radio {radio}: {down}") from None
