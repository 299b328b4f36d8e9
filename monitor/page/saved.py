"""A run's page as a folder of files, which any browser opens without a server: it plays the messages that a hub sends.

Browsers load no modules for a page that is itself a file. So the page's modules are in index.html, as data that an
import map names, and the messages are a script, `run.js`: gzip in base64 of

    uint32 n, little-endian | n bytes of JSON | packets of tiles, one after the other (`monitor/page/tiles.py`)

The JSON has the messages that a page gets once, the trail of the whole run, and for each frame its state and the
length of the packet with what has changed since the frame before. Each `KEY`-th frame also has a packet with the whole
fog, and the links. `recorded.js` plays them.
"""

from __future__ import annotations

import base64
import gzip
import json
import re
from collections.abc import Callable, Iterable
from contextlib import ExitStack
from dataclasses import replace
from importlib.resources import files
from itertools import count
from pathlib import Path

from monitor.observation.fault_bands import bands_of
from monitor.page.hub import MOST_POINTS
from monitor.page.messages import (
    bands_message,
    events_message,
    links_message,
    series_message,
    state_message,
    static_message,
    trail_message,
)
from monitor.page.server import plotly_file
from monitor.page.survey import survey_of
from monitor.page.thinning import thinned
from monitor.page.tiles import TRUTH, TiledMap, terrain_packet
from monitor.replay.player import Player
from monitor.replay.run import Run
from patrol import palette
from patrol.errors import BadInput
from patrol.files.whole_file import replacing

MOST_FRAMES = 1500
"""Frames of a saved page; of a longer run every second tick is shown, or every third, ..."""

KEY = 50
"""Frames from one with the whole fog to the next."""

RECORDED = "run.js"
"""The file with the messages."""

_MAIN = '<script src="main.js" type="module"></script>'
"""The line of index.html that loads the page's modules."""

_IMPORT = re.compile(r'(from|import) "\./(\w+\.js)"')


def save_page(run: Run, folder: Path, progress: Callable[[Iterable[int]], Iterable[int]] = iter) -> int:
    """Write the page of a run, with the true fog but without beliefs. After an error, none of its files stays.

    Args:
        run: The run.
        folder: New or empty.
        progress: Gets the ticks of the frames and returns them, for example `rich.progress.track`.

    Returns:
        The number of frames.

    Raises:
        BadInput: The folder holds files or cannot be written, or plotly is not installed.
    """
    plotly = plotly_file()
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise BadInput(f"{folder}: exists already; name a new or an empty folder")
    frames, data = _recorded(run, progress)
    written: dict[str, bytes] = {
        "index.html": _index().encode(),
        "palette.css": palette.css().encode(),
        RECORDED: b'globalThis.RECORDED = "%s";\n' % base64.b64encode(gzip.compress(data)),
        "plotly.min.js": plotly.read_bytes(),
    }
    for name in ("page.css", "icon.svg"):
        written[name] = _static(name).encode()
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with ExitStack() as whole:
            for name, content in written.items():
                whole.enter_context(replacing(folder / name)).write_bytes(content)
    except OSError as error:
        raise BadInput(f"{folder}: cannot be written ({error.strerror}); choose another folder") from None
    return frames


def _static(name: str) -> str:
    return files("monitor.page").joinpath("static", name).read_text(encoding="utf-8")


def _index() -> str:
    """Return index.html with the page's modules in an import map."""
    folder = files("monitor.page").joinpath("static")
    modules = {
        entry.name: entry.read_text(encoding="utf-8") for entry in folder.iterdir() if entry.name.endswith(".js")
    }
    modules["palette.js"] = palette.script()
    imports = {}
    for name, text in sorted(modules.items()):
        named = _IMPORT.sub(r'\1 "fogwatch/\2"', text)
        imports[f"fogwatch/{name}"] = f"data:text/javascript;base64,{base64.b64encode(named.encode()).decode()}"
    scripts = (
        f'<script src="{RECORDED}"></script>\n<script type="importmap">{json.dumps({"imports": imports})}</script>\n'
        '<script type="module">import "fogwatch/main.js";</script>'
    )
    page = _static("index.html")
    assert _MAIN in page
    return page.replace(_MAIN, scripts)


def _recorded(run: Run, progress: Callable[[Iterable[int]], Iterable[int]]) -> tuple[int, bytes]:
    """Return the number of frames, and the messages of all of them."""
    player = Player(run, count().__next__, autoplay=True)  # for the pace at which a run plays by itself
    player.read_all()
    static = replace(player.static(), layers=("truth",))
    every = -(-run.ticks // MOST_FRAMES)
    ticks = [*range(0, run.ticks - 1, every), run.ticks - 1]
    tiled = TiledMap(TRUTH, static.passable.shape)
    packets = [terrain_packet(static.passable, static.patrolled)]
    frames = []
    for number, k in enumerate(progress(ticks)):
        player.control({"do": "seek", "k": k})
        state = player.wait(0.0)
        seen = player.last_seen("truth")
        assert state is not None
        assert seen is not None
        before = tiled.version
        tiled.update(seen, k)
        changed, whole = tiled.packet(before), tiled.packet(0) if number % KEY == 0 else b""
        packets += [changed, whole]
        message = state_message(state, survey_of(seen, static.patrolled, k), static)
        links = "null" if number % KEY or state.links is None else links_message(state.links, k)
        frames.append(f'{{"state":{message},"links":{links},"changed":{len(changed)},"whole":{len(whole)}}}')
    events = player.events(0)
    trail = trail_message(0, player.trail(0, run.ticks - 1))
    once = [
        static_message(static, may_control=True),
        events_message(events, 0),
        bands_message(bands_of(events, run.step, run.ticks * run.step)),
        series_message(thinned(player.series(-1), MOST_POINTS)),
    ]
    head = (
        f'{{"once":[{",".join(once)}],"trail":{trail},"every":{every},"key":{KEY},"terrain":{len(packets[0])},'
        f'"frames":[{",".join(frames)}]}}'
    ).encode()
    return len(frames), len(head).to_bytes(4, "little") + head + b"".join(packets)
