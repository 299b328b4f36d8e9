"""The right to view a page, and the right to control the fleet that it shows.

On loopback every user of this machine may view the page; controlling takes the key in the printed address. On any other
address both take the token. The key arrives once, in the address, and stays in a cookie that no script can read.
Requests that come from pages of other hosts are refused, also when another host name points to this machine.
"""

from __future__ import annotations

import hmac
from collections.abc import Mapping
from dataclasses import dataclass

from runtime.security.keys import is_loopback

MIN_TOKEN_LENGTH = 16
"""Characters of the shortest token that is accepted."""


@dataclass(frozen=True, slots=True)
class Authorisation:
    """The rules of the page at host:port."""

    host: str  # address that the page is served on
    port: int
    key: str  # proves the right to control and, unless `view_without_key`, to view
    view_without_key: bool

    @property
    def cookie(self) -> str:
        """The cookie's name. It holds the port because browsers share cookies between the ports of a host."""
        return f"fogwatch-{self.port}"

    @property
    def address_without_key(self) -> str:
        """The page's address without its key."""
        host = f"[{self.host}]" if ":" in self.host else self.host
        return f"http://{host}:{self.port}/"

    @property
    def address(self) -> str:
        """The page's address with its key."""
        return f"{self.address_without_key}?key={self.key}"

    def is_key(self, key: str | None) -> bool:
        """Return whether this is the key; compares in constant time."""
        return key is not None and hmac.compare_digest(key.encode(), self.key.encode())

    def allows_host(self, headers: Mapping[str, str]) -> bool:
        """Return whether a request is addressed to a host name of this machine.

        The headers' names are in lower case.
        """
        # A page of another name that points to this machine could otherwise read it through the browser.
        return not self.view_without_key or is_loopback(_host_name(headers.get("host", "")))

    def same_origin(self, headers: Mapping[str, str]) -> bool:
        """Return whether a request comes from this page.

        The headers' names are in lower case.
        """
        host = headers.get("host", "")
        return bool(host) and headers.get("origin") in (f"http://{host}", f"https://{host}")


def _host_name(host: str) -> str:
    """Return a Host header without its port.

    For example, "127.0.0.1" for ``127.0.0.1:8080`` and "::1" for ``[::1]:8080``.
    """
    if host.startswith("["):
        return host.partition("]")[0].lstrip("[")
    return host.partition(":")[0]
