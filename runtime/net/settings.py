"""The settings of a Zenoh session, for members and routers of a fleet, by the keys of Zenoh's configuration.

Socket buffers are small: with the system's, a flood of a million tiny messages a second left 300 000 of them between a
tick and its reader, which received the tick seconds late; with small ones the delay is a tenth of a second.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from runtime.security.credentials import Credentials, RouterSecurity

_RETRY = {"period_init_ms": 100, "period_max_ms": 500, "period_increase_factor": 1.5}
_SOCKET = 65536
QUEUE = 16
"""Messages that may wait to be sent, the most that Zenoh allows. With its 2 a busy machine dropped, of what may be, one
in seven from the third of a burst on: at a pace, only the first two robots of a fleet received every pose. Messages of
a burst may also share a place (`runtime.net.link.Link.post`)."""
_DROP_US = 100
"""Waiting time for a receiver that does not read, before dropping, us; all other receivers wait too."""

MOST_STRANGERS = 512
"""Most connections at a router that have not proved their identity yet; above it, new ones wait. Each has 10 s
for it, and takes a file descriptor, of which a process often has 1024. With the 100 of Zenoh, 200 silent connections
kept a fleet from starting."""

MAX_MESSAGE = 1 << 24
"""Bytes of the longest message that a fleet's sessions put together. A router puts messages together before it looks at
who may send them: with Zenoh's limit of 1 GiB, a message of 400 MB that its sender was not allowed to send took as much
of the router's memory, for good."""

_CLOSE_US = 1_000_000
"""Waiting time for a receiver that does not read, where nothing may be dropped, before its connection is closed, us.
All others wait as well: with Zenoh's 5 s, twice over, three that stopped one after the other cost a fleet its
robots."""

_TO_LISTEN: dict[str, object] = {
    "transport/unicast/accept_pending": MOST_STRANGERS,
    "transport/link/tx/queue/congestion_control/block/wait_before_close": _CLOSE_US,
}
"""What a router needs, and a member of a mesh."""

_QUIET: dict[str, object] = {
    "scouting/multicast/enabled": False,
    "scouting/gossip/enabled": False,
    "transport/shared_memory/enabled": False,
    "transport/link/rx/max_message_size": MAX_MESSAGE,
    "transport/link/tcp/so_rcvbuf": _SOCKET,
    "transport/link/tcp/so_sndbuf": _SOCKET,
    "transport/link/tx/queue/congestion_control/drop/wait_before_drop": _DROP_US,
    "transport/link/tx/queue/size/interactive_high": QUEUE,
}


def client_settings(router: str, lease_s: float, credentials: Credentials | None = None) -> dict[str, object]:
    """Return the settings of a client of a router, or of a member of a mesh; each waits, and connects again, for ever.

    `router` may name several routers, with commas between them, which are tried in turn; in a mesh it names other
    members. The router drops a client that is silent for `lease_s`; a mesh has a lease of its own.
    """
    return {
        **_QUIET,
        "mode": "client",
        "connect/endpoints": router.split(",") if router else [],
        "connect/timeout_ms": -1,
        "connect/exit_on_failure": False,
        "connect/retry": _RETRY,
        "listen/endpoints": [],
        "transport/link/tx/lease": round(lease_s * 1000),
        **({} if credentials is None else credentials.session()),
        **(_TO_LISTEN if credentials is not None and credentials.mesh is not None else {}),
    }


def router_settings(
    listen: str, security: RouterSecurity | None = None, others: Sequence[str] = ()
) -> dict[str, object]:
    """Return the settings of a router that listens at one locator; without `security` it allows everything.

    `others` are routers of the same fleet, at other sites. One that is not there, or goes, is tried again for ever.
    """
    return {
        **_QUIET,
        "mode": "router",
        "listen/endpoints": [listen],
        "connect/endpoints": list(others),
        "connect/timeout_ms": -1,
        "connect/exit_on_failure": False,
        "connect/retry": _RETRY,
        **_TO_LISTEN,
        **({} if security is None else security.session()),
    }
