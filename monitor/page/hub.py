"""Connects one source with many viewers: one thread reads the source and packs what each viewer needs next.

A viewer receives the next frame only after it has reported the last one as drawn. So a slow or stopped browser skips
frames and costs nothing. Packets for several viewers are packed once.
"""

from __future__ import annotations

import asyncio
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field

from monitor.observation.fault_bands import bands_of
from monitor.observation.source import Layer, Source, State
from monitor.page.maps import TiledMap, layer_number, survey_of, terrain_packet
from monitor.page.messages import (
    bands_message,
    events_message,
    links_message,
    series_message,
    state_message,
    thinned,
    trail_message,
)
from runtime.reporting.vitals import MFOW, PAGES, TICK, Vitals

FRAME_S, LIVE_FRAME_S = 1.0 / 30.0, 1.0 / 10.0
"""Wall time between two frames of a replay, and of a live fleet, with which the page shares the processors."""
SLOW_S = 0.5
"""Wall time between two updates of links, charts and events."""
WAIT_S = 0.1
MOST_POINTS = 5000
"""Points of the chart in one message."""
TRAIL = 240
"""Ticks of a trail; store.js has the same number."""

Message = str | bytes


@dataclass(eq=False)
class Viewer:
    """One open page."""

    loop: asyncio.AbstractEventLoop
    # frames to send; None closes the connection
    outbox: asyncio.Queue[list[Message] | None] = field(default_factory=asyncio.Queue)
    layers: tuple[Layer, ...] = ()
    drawn: bool = True  # it has reported all frames as drawn
    posted: int = 0  # frames put into the outbox
    written: int = 0  # frames that the socket has taken; guards against pages that report frames as drawn too early
    sent: dict[Layer, tuple[int, int]] = field(default_factory=dict)  # version and tick of each fog that it has
    state: State | None = None
    ticks: int = -1  # last tick of its chart
    events: int = 0  # number of events that it has
    slow_due: float = 0.0  # when its links, chart and events are due, s of the hub's clock
    links_k: int = -1  # tick of the links that it has; -1 for none
    trail: range = range(0)  # ticks of the trail that it has

    @property
    def ready(self) -> bool:
        """True if it may receive another frame."""
        return self.drawn and self.written == self.posted

    def post(self, messages: list[Message] | None) -> None:
        """Queue a frame, from the hub's thread; None closes the connection."""
        self.drawn = False
        self.posted += 1
        with suppress(RuntimeError):  # the loop has been closed
            # The queue belongs to the loop's thread; this is the hub's.
            self.loop.call_soon_threadsafe(self.outbox.put_nowait, messages)


class Hub:
    """Reads a source in its own thread, from start() to close().

    `failure` is what ended the thread unexpectedly; None while all is well.
    """

    def __init__(self, source: Source, now: Callable[[], float] = time.monotonic) -> None:
        """Prepare to read the source, which close() closes."""
        self.source = source
        self.static = source.static()
        self.terrain = terrain_packet(self.static.terrain.passable, self.static.patrolled)
        self.failure: BaseException | None = None
        self._now = now
        self._frame_s = LIVE_FRAME_S if self.static.live else FRAME_S
        self._by_number = {layer_number(layer): layer for layer in self.static.layers}
        self._lock = threading.Lock()
        self._viewers: list[Viewer] = []
        self._maps: dict[Layer, TiledMap] = {}
        self._state: State | None = None
        self._state_message = ""
        """Empty until a page needs it."""
        self._wake = threading.Event()
        self._ending = threading.Event()
        self._thread = threading.Thread(target=self._run_loop, name="hub", daemon=True)

    def start(self) -> None:
        """Start the thread."""
        self._thread.start()

    def close(self) -> None:
        """Stop the thread and close the source."""
        self._ending.set()
        if self._thread.is_alive():
            self._thread.join()
        self.source.close()

    def add(self, viewer: Viewer) -> None:
        """Add a page; it shows the first layer until it selects another."""
        viewer.layers = self.static.layers[:1]
        with self._lock:
            self._viewers.append(viewer)

    def remove(self, viewer: Viewer) -> None:
        """Remove a page that was closed."""
        with self._lock:
            self._viewers.remove(viewer)

    def show(self, vitals: Vitals) -> None:
        """Let `vitals` report the tick and the MFoW shown, and the number of open pages."""
        vitals.probe(TICK, lambda: None if self._state is None else self._state.k)
        vitals.probe(MFOW, lambda: None if self._state is None else self._state.mfow_s)
        vitals.probe(PAGES, lambda: len(self._viewers))

    def select(self, viewer: Viewer, numbers: list[int]) -> None:
        """Set which fogs a page shows, by the numbers of one or two layers; unknown ones are ignored."""
        viewer.layers = tuple(self._by_number[number] for number in numbers[:2] if number in self._by_number)

    def _run_loop(self) -> None:
        try:
            while not self._ending.is_set():
                begun = self._now()
                self.turn()
                self._ending.wait(max(self._frame_s - (self._now() - begun), 0.0))
        except BaseException as error:
            self.failure = error
            raise
        finally:
            with self._lock:
                for viewer in self._viewers:
                    viewer.post(None)

    def wake(self) -> None:
        """Check again whether a page is ready."""
        self._wake.set()

    def turn(self) -> None:
        """Take one turn: read the source, and send news to each page that is ready. The thread repeats this."""
        viewers, ready = self._viewers_and_ready()
        if viewers and not ready and not self.static.live:
            # A replay's next state is that of when a page has drawn the last one. A live fleet is always followed.
            self._wake.clear()
            if not any(viewer.ready for viewer in viewers):
                self._wake.wait(WAIT_S)
        state = self.source.wait(WAIT_S)
        if state is not None:
            self._state, self._state_message = state, ""
        if self._state is None:
            return
        _, ready = self._viewers_and_ready()
        self._update_maps(ready)
        for viewer in ready:
            if messages := self._new_messages(viewer, self._state):
                viewer.post(messages)

    def _viewers_and_ready(self) -> tuple[list[Viewer], list[Viewer]]:
        """Return the open pages, and those of them that are ready. Maps that no page shows are dropped.

        A page in the background, whose browser draws nothing, counts as open.
        """
        with self._lock:
            viewers = list(self._viewers)
            shown = {layer for viewer in viewers for layer in viewer.layers}
            self._drop_hidden(shown)
        self.source.set_shown(shown)
        return viewers, [viewer for viewer in viewers if viewer.ready]

    def _update_maps(self, viewers: list[Viewer]) -> None:
        """Update the maps of the fogs that these pages show."""
        for layer in dict.fromkeys(layer for viewer in viewers for layer in viewer.layers):
            now = self.source.last_seen(layer)
            if now is not None:
                if layer not in self._maps:
                    self._maps[layer] = TiledMap(layer_number(layer), now.shape)
                self._maps[layer].update(now, self.source.tick(layer))

    def _drop_hidden(self, shown: set[Layer]) -> None:
        """Drop the maps that no page shows; when shown again they are sent as a whole."""
        for layer in self._maps.keys() - shown:
            del self._maps[layer]
            for viewer in self._viewers:
                # Its versions begin anew, so what a page has of it means nothing any more.
                viewer.sent.pop(layer, None)

    def _new_messages(self, viewer: Viewer, state: State) -> list[Message]:
        """Return the messages that a viewer lacks; empty when it is up to date."""
        messages: list[Message] = []
        for layer in viewer.layers:
            # None while the fog is being computed for the first time.
            tiled = self._maps.get(layer)
            if tiled is None:
                continue
            version, tick = viewer.sent.get(layer, (0, -1))
            if (version, tick) != (tiled.version, tiled.tick):
                viewer.sent[layer] = tiled.version, tiled.tick
                # While a fog is computed, or lags, this is the map of an earlier tick; the packet says which.
                messages.append(tiled.packet(version, self.source.since(layer)))
        now = self._now()
        if now >= viewer.slow_due:
            viewer.slow_due = now + SLOW_S
            self._add_slow(viewer, state, messages)
        if messages or viewer.state is not state:
            if viewer.state is not state:
                self._add_trail(viewer, state.k, messages)
            if state.links is None:
                viewer.links_k = -1
            viewer.state = state
            self._state_message = self._state_message or self._pack_state(state)
            messages.append(self._state_message)
        return messages

    def _pack_state(self, state: State) -> str:
        """Return a state's message, with the survey of the first layer's fog."""
        fog, layer = None, self.static.layers[0]
        if state.mfow_s is not None:
            fog = self.source.last_seen(layer)
        survey = None if fog is None else survey_of(fog, self.static.patrolled, self.source.tick(layer))
        return state_message(state, survey, self.static)

    def _add_trail(self, viewer: Viewer, k: int, messages: list[Message]) -> None:
        """Add the ticks of the trail up to k that a viewer lacks: before or after those that it has, or all.

        For example, a viewer with the trail of ticks 0 to 100 that is shown tick 103 gets the ticks 101 to 103.
        """
        wanted, has = range(max(k - TRAIL, 0), k + 1), viewer.trail
        first, last = wanted.start, k
        # Time went on: only the newest ticks are missing.
        if wanted.start in has:
            first = has.stop
        # A replay went back: only the oldest ticks are missing.
        elif k in has:
            last = has.start - 1
        viewer.trail = wanted
        trail = self.source.trail(first, last) if first <= last else None
        if trail is not None:
            messages.append(trail_message(first, trail))

    def _add_slow(self, viewer: Viewer, state: State, messages: list[Message]) -> None:
        events = self.source.events(viewer.events)
        if events:
            messages.append(events_message(events, viewer.events))
            viewer.events += len(events)
            # A fault in force is drawn up to the end of the run or, if that is unknown, to now.
            end_s = (state.k if self.static.ticks is None else self.static.ticks) * self.static.step
            messages.append(bands_message(bands_of(self.source.events(0), self.static.step, end_s)))
        series = self.source.series(viewer.ticks)
        if len(series.ticks):
            viewer.ticks = int(series.ticks[-1])
            messages.append(series_message(thinned(series, MOST_POINTS)))
        if state.links is not None and state.k != viewer.links_k:
            viewer.links_k = state.k
            messages.append(links_message(state.links, state.k))
