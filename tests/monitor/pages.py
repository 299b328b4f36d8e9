"""A page served in this process, for tests to look at."""

import queue
import threading
from collections.abc import Iterator
from contextlib import closing, contextmanager
from typing import Any
from urllib.parse import urlsplit

from monitor.observation.source import Source
from monitor.process import serve
from runtime.process.lifeline import Ending
from tests.browser import Look

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


@contextmanager
def look_at(
    browser: Any, source: Source, plain: bool = False, width: int = 1280, height: int = 720, scheme: str = "light"
) -> Iterator[Look]:
    """A look at a source's page, once it shows the map; `plain` without the key."""
    with (
        closing(ServedPage(source)) as served,
        Look(browser, served.plain if plain else served.address, width, height, scheme) as look,
    ):
        look.until("document.body.dataset.frames > 0")
        yield look


def pixels(are_counted: str) -> str:
    """A script that counts the pixels of the map for whose channels, `d[i]` and the next two, a condition holds."""
    return f"""(() => {{
        const {{ width, height }} = document.getElementById('canvas');
        const copy = new OffscreenCanvas(width, height).getContext('2d', {{ willReadFrequently: true }});
        copy.drawImage(document.getElementById('canvas'), 0, 0);
        const d = copy.getImageData(0, 0, width, height).data;
        let found = 0;
        for (let i = 0; i < d.length; i += 4) found += {are_counted};
        return found;
    }})()"""


NOTE_LABELS = """() => {
    const paint = CanvasRenderingContext2D.prototype, fill = paint.fillText;
    window.labels = [];
    window.boxes = {};
    paint.fillText = function (text, x, y) {
        const { width, height, id } = this.canvas, box = this.measureText(text);
        if (id === 'canvas') window.boxes[text] = [x - box.actualBoundingBoxLeft, y - box.actualBoundingBoxAscent,
            x + box.actualBoundingBoxRight, y + box.actualBoundingBoxDescent];
        if (id === 'canvas') window.labels.push([text, x - box.actualBoundingBoxLeft >= 0
            && y - box.actualBoundingBoxAscent >= 0 && x + box.actualBoundingBoxRight <= width
            && y + box.actualBoundingBoxDescent <= height]);
        fill.call(this, text, x, y);
    };
}"""
"""Has the map note each text that it draws, and whether all of it is on the map, in `window.labels`.

The newest box of each text, in pixels of the canvas, is in `window.boxes`.
"""
