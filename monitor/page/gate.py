"""Who may look at a page, and who may ask for something on it.

On loopback everybody on this machine may look; asking takes the key that the printed address carries. On any other
address both take the token. A key comes once, in the address, and goes on as a cookie that no script can read. A
browser says where a request comes from: pages of other hosts are refused, also under a name that points here.
"""

from __future__ import annotations

import hmac
from collections.abc import Mapping
from dataclasses import dataclass

from patrol.net.keys import is_loopback

LEAST_TOKEN = 16
"""Letters of the shortest token that is accepted."""


@dataclass(frozen=True, slots=True)
class Gate:
    """The page at host:port. key: what proves the right; open: whether looking takes none."""

    host: str
    port: int
    key: str
    open: bool

    @property
    def cookie(self) -> str:
        """The cookie's name; browsers do not tell ports apart."""
        return f"fogwatch-{self.port}"

    @property
    def plain(self) -> str:
        """The page's address without its key."""
        host = f"[{self.host}]" if ":" in self.host else self.host
        return f"http://{host}:{self.port}/"

    @property
    def address(self) -> str:
        """What to open, key included."""
        return f"{self.plain}?key={self.key}"

    def knows(self, key: str | None) -> bool:
        """Whether this is the key."""
        return key is not None and hmac.compare_digest(key.encode(), self.key.encode())

    def host_is_ours(self, headers: Mapping[str, str]) -> bool:
        """Whether the request was made to this machine by a name of its own."""
        return not self.open or is_loopback(_name(headers.get("host", "")))

    def same_origin(self, headers: Mapping[str, str]) -> bool:
        """Whether a page of ours makes the request."""
        host = headers.get("host", "")
        return bool(host) and headers.get("origin") in (f"http://{host}", f"https://{host}")


def _name(host: str) -> str:
    """A Host header without its port."""
    if host.startswith("["):
        return host.partition("]")[0].lstrip("[")
    return host.partition(":")[0]
