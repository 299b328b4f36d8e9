"""A page served in this process, for tests to look at."""

from __future__ import annotations

import queue
import threading
from urllib.parse import urlsplit

from monitor.observation.source import Source
from monitor.process import serve
from patrol.process.lifeline import Ending

PATIENCE_S = 180.0


class ServedPage:
    """Serves a source, or two side by side, until close()."""

    def __init__(self, *sources: Source, key: str = "", host: str = "127.0.0.1") -> None:
        self._ending = Ending()
        self._addresses: queue.Queue[str] = queue.Queue()
        self._thread = threading.Thread(
            target=lambda: serve(lambda: sources, host, 0, key, self._ending, opened=self._addresses.put)
        )
        self._thread.start()
        self.address = self._addresses.get(timeout=PATIENCE_S)
        parts = urlsplit(self.address)
        self.key = parts.query.removeprefix("key=")
        self.plain = f"http://{parts.netloc}/"
        self.port = parts.port

    def close(self) -> None:
        self._ending.ask("the test is over")
        self._thread.join(PATIENCE_S)
        assert not self._thread.is_alive()
