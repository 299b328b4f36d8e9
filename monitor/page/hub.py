"""Between one source and many viewers: one thread that reads the source and packs what each viewer needs next.

A viewer is sent a frame, and the next one only when it says that it has drawn that: a slow or stopped browser skips
frames and costs nothing. What is common to several viewers is packed once.
"""

from __future__ import annotations

import asyncio
import threading
import time
from collections.abc import Callable, Collection
from contextlib import suppress
from dataclasses import dataclass, field

from monitor.page import words
from monitor.page.thinning import thinned
from monitor.page.tiles import TileBook, layer_number, terrain_packet
from monitor.report.faultbands import bands_of
from monitor.source import Layer, Source, State

FRAME_S, LIVE_FRAME_S = 1.0 / 30.0, 1.0 / 10.0
"""Wall time between two frames of a replay, and of a live fleet, whose processors they are taken from."""
SELDOM_S = 0.5
"""Wall time between two looks at links, charts and events."""
WAIT_S = 0.1
DRAWING_S = 1.0
"""A page that has drawn nothing for so long is in the background: nothing is worked out ahead for it."""
MOST_POINTS = 5000
"""Of the chart, at once."""
TRAIL = 240
"""Ticks of a trail, as in store.js."""

Message = str | bytes


@dataclass(eq=False)
class Viewer:
    """One open page. layers: the fogs it shows. sent: the version and the tick that it has of each.

    drawn: it says that it has drawn all it got; drew_s: when it last had, s of any clock. posted, written: frames
    handed over, and those that the socket took; a page that says more than is true gets no frame before the last one is
    on its way.
    """

    loop: asyncio.AbstractEventLoop
    outbox: asyncio.Queue[list[Message] | None] = field(default_factory=asyncio.Queue)
    layers: tuple[Layer, ...] = ()
    drawn: bool = True
    drew_s: float = 0.0
    posted: int = 0
    written: int = 0
    sent: dict[Layer, tuple[int, int]] = field(default_factory=dict)
    state: State | None = None
    ticks: int = -1
    events: int = 0
    seldom: float = 0.0
    links_k: int = -1
    trail: range = range(0)

    @property
    def ready(self) -> bool:
        """Whether another frame may be handed over."""
        return self.drawn and self.written == self.posted

    def post(self, messages: list[Message] | None) -> None:
        """Hand over a frame, from the hub's thread; None: there will be no more."""
        self.drawn = False
        self.posted += 1
        with suppress(RuntimeError):  # the loop has been closed
            self.loop.call_soon_threadsafe(self.outbox.put_nowait, messages)


class Hub:
    """Reads a source in a thread of its own, from start() to close()."""

    def __init__(self, source: Source, now: Callable[[], float] = time.monotonic) -> None:
        self.source = source
        self.static = source.static()
        self.terrain = terrain_packet(self.static.passable, self.static.patrolled)
        self.failure: BaseException | None = None
        self._now = now
        self._frame_s = LIVE_FRAME_S if self.static.live else FRAME_S
        self._by_number = {layer_number(layer): layer for layer in self.static.layers}
        self._lock = threading.Lock()
        self._viewers: list[Viewer] = []
        self._books: dict[Layer, TileBook] = {}
        self._state: State | None = None
        self._words = ""
        self._ahead = False  # the state and its fogs are ready, and no page was
        self._woken = threading.Event()
        self._ending = threading.Event()
        self._thread = threading.Thread(target=self._run, name="hub", daemon=True)

    def start(self) -> None:
        """Begin to read."""
        self._thread.start()

    def close(self) -> None:
        """Stop reading."""
        self._ending.set()
        if self._thread.is_alive():
            self._thread.join()
        self.source.close()

    def enter(self, viewer: Viewer) -> None:
        """A page was opened; it is shown the best fog until it asks for another."""
        viewer.layers = self.static.layers[:1]
        with self._lock:
            self._viewers.append(viewer)

    def leave(self, viewer: Viewer) -> None:
        """A page was closed."""
        with self._lock:
            self._viewers.remove(viewer)

    def show(self, viewer: Viewer, numbers: list[int]) -> None:
        """The page shows these fogs from now on; those that there are not are left out."""
        viewer.layers = tuple(self._by_number[number] for number in numbers[:2] if number in self._by_number)

    def _run(self) -> None:
        try:
            while not self._ending.is_set():
                begun = self._now()
                self._turn()
                self._ending.wait(max(self._frame_s - (self._now() - begun), 0.0))
        except BaseException as error:
            self.failure = error
            raise
        finally:
            with self._lock:
                for viewer in self._viewers:
                    viewer.post(None)

    def wake(self) -> None:
        """A page may be ready for what waits for it."""
        self._woken.set()

    def _turn(self) -> None:
        if self._ahead and not self._send_ahead():
            return
        state = self.source.wait(WAIT_S)
        if state is not None:
            self._state, self._words = state, words.state_words(state)
        if self._state is None:
            return
        viewers, ready = self._pages()
        # Of a replay the next moment is worked out while pages draw the one before; of a fleet only what is sent.
        drawing = [viewer for viewer in viewers if self._now() < viewer.drew_s + DRAWING_S]
        self._ahead = state is not None and bool(drawing) and not ready and not self.static.live
        self._take_up(drawing if self._ahead else ready)
        self._send(ready)

    def _send_ahead(self) -> bool:
        """Send what was worked out ahead to those who are ready for it by now; whether there is anybody."""
        viewers, ready = self._pages()
        if not ready and self._woken.wait(WAIT_S):
            viewers, ready = self._pages()
        self._woken.clear()
        self._ahead = bool(viewers) and not ready
        # Whoever shows another fog by now has that of the same moment.
        self._take_up(ready, self._books.keys())
        self._send(ready)
        return not self._ahead

    def _pages(self) -> tuple[list[Viewer], list[Viewer]]:
        """The open pages, and those of them that are ready. What nobody shows is not kept any more.

        A page that its browser lets draw nothing, as it is in the background, is open all the same.
        """
        with self._lock:
            viewers = list(self._viewers)
            shown = {layer for viewer in viewers for layer in viewer.layers}
            self._forget(shown)
        self.source.keep(shown)
        ready = [viewer for viewer in viewers if viewer.ready]
        for viewer in ready:
            viewer.drew_s = self._now()
        return viewers, ready

    def _take_up(self, viewers: list[Viewer], but: Collection[Layer] = ()) -> None:
        """Bring the fogs that these pages show to the state, but for some."""
        for layer in dict.fromkeys(layer for viewer in viewers for layer in viewer.layers if layer not in but):
            now = self.source.last_seen(layer)
            if now is not None:
                if layer not in self._books:
                    self._books[layer] = TileBook(layer_number(layer), now.shape)
                self._books[layer].take(now, self.source.tick(layer))

    def _send(self, ready: list[Viewer]) -> None:
        for viewer in ready:
            if self._state is not None and (messages := self._news(viewer, self._state)):
                viewer.post(messages)

    def _forget(self, shown: set[Layer]) -> None:
        """Keep no map that no page shows; one that is shown again is sent as a whole."""
        for layer in self._books.keys() - shown:
            del self._books[layer]
            for viewer in self._viewers:
                viewer.sent.pop(layer, None)

    def _news(self, viewer: Viewer, state: State) -> list[Message]:
        """What a viewer does not have yet; empty when it has everything."""
        messages: list[Message] = []
        for layer in viewer.layers:
            book = self._books.get(layer)
            if book is None:
                continue
            version, tick = viewer.sent.get(layer, (0, -1))
            if (version, tick) != (book.version, book.tick):
                viewer.sent[layer] = book.version, book.tick
                # While a fog is worked out, or lags, this is of an earlier tick, which the page sees.
                messages.append(book.packet(version, self.source.since(layer)))
        now = self._now()
        if now >= viewer.seldom:
            viewer.seldom = now + SELDOM_S
            self._seldom(viewer, state, messages)
        if messages or viewer.state is not state:
            if viewer.state is not state:
                self._trail(viewer, state.k, messages)
            if state.links is None:
                viewer.links_k = -1
            viewer.state = state
            messages.append(self._words)
        return messages

    def _trail(self, viewer: Viewer, k: int, messages: list[Message]) -> None:
        """The ticks of the trail up to k that a viewer lacks, at either end of those it has, or all of them."""
        wanted, has = range(max(k - TRAIL, 0), k + 1), viewer.trail
        first, last = wanted.start, k
        if wanted.start in has:
            first = has.stop
        elif k in has:
            last = has.start - 1
        viewer.trail = wanted
        trail = self.source.trail(first, last) if first <= last else None
        if trail is not None:
            messages.append(words.trail_words(first, trail))

    def _seldom(self, viewer: Viewer, state: State, messages: list[Message]) -> None:
        events = self.source.events(viewer.events)
        if events:
            messages.append(words.events_words(events, viewer.events))
            viewer.events += len(events)
            bands = bands_of(self.source.events(0), self.static.step, self._end_s(state))
            messages.append(words.bands_words(bands))
        series = self.source.series(viewer.ticks)
        if len(series.ticks):
            viewer.ticks = int(series.ticks[-1])
            messages.append(words.series_words(thinned(series, MOST_POINTS)))
        if state.links is not None and state.k != viewer.links_k:
            viewer.links_k = state.k
            messages.append(words.links_words(state.links, state.k))

    def _end_s(self, state: State) -> float:
        """Up to when a fault that has not ended is drawn: to the end of the run, if there is one."""
        return (state.k if self.static.ticks is None else self.static.ticks) * self.static.step
