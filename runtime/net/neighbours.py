"""The processes that a session is connected to, as Zenoh tells of their links."""

from __future__ import annotations

import threading
from collections import Counter
from collections.abc import Callable, Collection

import zenoh


class Neighbours:
    """The members of a mesh that a process is connected to, by the common names of their certificates."""

    def __init__(self, session: zenoh.Session) -> None:
        self._links: Counter[str] = Counter()
        self._changed = threading.Condition()
        self._tell: Callable[[str, bool], None] = lambda _name, _there: None
        handler = zenoh.handlers.Callback(self._take_event, indirect=False)
        self.listener = session.info.declare_link_events_listener(handler, history=True)

    @property
    def names(self) -> frozenset[str]:
        """The names of those that are connected now."""
        with self._changed:
            return frozenset(self._links)

    def tell(self, tell: Callable[[str, bool], None]) -> None:
        """Call a function with each name, and whether it is there, from now on: at once for those that are there."""
        with self._changed:
            self._tell = tell
            for name in sorted(self._links):
                tell(name, True)

    def await_all(self, names: Collection[str], wait_s: float) -> bool:
        """Wait until all of some are connected; return whether they are."""
        with self._changed:
            return self._changed.wait_for(lambda: set(names) <= set(self._links), wait_s)

    def await_any(self, wait_s: float) -> bool:
        """Wait until any other process is connected; return whether one is."""
        with self._changed:
            return self._changed.wait_for(lambda: bool(self._links), wait_s)

    def _take_event(self, event: zenoh.LinkEvent) -> None:
        """Count a link that has come or gone; called on Zenoh's thread."""
        name = event.link.auth_identifier
        if name is None:
            return
        with self._changed:
            before = name in self._links
            self._links[name] += 1 if event.kind == zenoh.SampleKind.PUT else -1
            if self._links[name] <= 0:
                del self._links[name]
            is_linked, tell = name in self._links, self._tell
            self._changed.notify_all()
        if is_linked != before:
            tell(name, is_linked)
