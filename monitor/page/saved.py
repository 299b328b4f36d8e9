"""A run's page as a folder of files, which any browser opens without a server: it plays the messages that a hub sends.

Browsers load no modules for a page that is itself a file. So the page's modules are in index.html, as data that an
import map names, and the messages are a script, `run.js`: gzip in base64 of

    uint32 n, little-endian | n bytes of JSON | packets of tiles, one after the other (`monitor/page/maps.py`)

The JSON has the messages that a page gets once, the trail of the whole run, and for each frame its state and the
length of the packet with what has changed since the frame before. Each `KEY`-th frame also has a packet with the whole
fog, and the links. `recorded.js` plays them.

Two runs are two such folders, within the one that shows them side by side.
"""

from __future__ import annotations

import base64
import gzip
import json
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from importlib.resources import files
from itertools import count
from pathlib import Path
from tempfile import TemporaryDirectory

from monitor.observation.fault_bands import bands_of
from monitor.page.hub import MOST_POINTS
from monitor.page.maps import TRUTH, TiledMap, survey_of, terrain_packet
from monitor.page.messages import (
    bands_message,
    events_message,
    links_message,
    series_message,
    state_message,
    static_message,
    thinned,
    trail_message,
)
from monitor.page.server import PAIR, plotly_file
from monitor.replay.player import Player
from monitor.replay.run import Run
from patrol import palette
from patrol.errors import BadInput
from patrol.files.whole_file import writing

MOST_FRAMES = 1500
"""Frames of a saved page; of a longer run every second tick is shown, or every third, ..."""

KEY = 50
"""Frames from one with the whole fog to the next."""

RECORDED = "run.js"
"""The file with the messages."""

_SCRIPT = re.compile(r'<script src="(\w+\.js)" type="module"></script>')
"""The line of a page that loads its modules."""

_IMPORT = re.compile(r'(from|import) "\./(\w+\.js)"')


def save_page(
    runs: Sequence[Run], folder: Path, progress: Callable[[Iterable[int]], Iterable[int]] = iter
) -> list[int]:
    """Write the page of a run, with the true fog but without beliefs; return its number of frames.

    Two runs are shown side by side. The folder must be new or empty; after an error, none of the files stays.
    `progress` gets the ticks of the frames and returns them, for example `rich.progress.track`.
    """
    plotly_file()  # before long runs are read
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise BadInput(f"{folder}: exists already; name a new or an empty folder")
    frames, pages = zip(*(_replay_files(run, progress) for run in runs), strict=True)
    if len(runs) == 1:
        _write_files(folder, pages[0])
    else:
        saved_files = _page_files("pair.html")
        for name, page in zip(PAIR, pages, strict=True):
            saved_files |= {f"{name}/{file}": content for file, content in page.items()}
        _write_files(folder, saved_files)
    return list(frames)


def _replay_files(run: Run, progress: Callable[[Iterable[int]], Iterable[int]]) -> tuple[int, dict[str, bytes]]:
    """Return the number of frames and the files of the page of one run, by name."""
    frames, messages = _record_frames(run, progress)
    return frames, {
        **_page_files("index.html"),
        RECORDED: b'globalThis.RECORDED = "%s";\n' % base64.b64encode(gzip.compress(messages)),
        "plotly.min.js": plotly_file().read_bytes(),
    }


def _page_files(html: str) -> dict[str, bytes]:
    """Return the files of a page without a run's messages, by name."""
    files = {"index.html": _page_index(html), "palette.css": palette.css()}
    files |= {name: _static_text(name) for name in ("page.css", "icon.svg")}
    return {name: text.encode() for name, text in files.items()}


def _write_files(folder: Path, files: Mapping[str, bytes]) -> None:
    """Write files into a folder and its folders, each as a whole; the page itself, index.html, comes last."""
    with writing(folder, "choose another folder"):
        folder.mkdir(parents=True, exist_ok=True)
        with TemporaryDirectory(prefix=".new-", dir=folder) as temporary:
            part = Path(temporary)
            for name, content in files.items():
                (part / name).parent.mkdir(exist_ok=True)
                (part / name).write_bytes(content)
            # Whoever opens index.html finds all that it loads.
            for entry in sorted(part.iterdir(), key=lambda entry: entry.name == "index.html"):
                entry.rename(folder / entry.name)


def _static_text(name: str) -> str:
    return files("monitor.page").joinpath("static", name).read_text(encoding="utf-8")


def _page_index(html: str) -> str:
    """Return a page with its modules in an import map."""
    folder = files("monitor.page").joinpath("static")
    modules = {
        entry.name: entry.read_text(encoding="utf-8") for entry in folder.iterdir() if entry.name.endswith(".js")
    }
    modules["palette.js"] = palette.script()
    imports = {}
    for name, text in sorted(modules.items()):
        named = _IMPORT.sub(r'\1 "fogwatch/\2"', text)
        imports[f"fogwatch/{name}"] = f"data:text/javascript;base64,{base64.b64encode(named.encode()).decode()}"
    page = _static_text(html)
    loads = _SCRIPT.search(page)
    assert loads is not None
    scripts = (
        f'<script type="importmap">{json.dumps({"imports": imports})}</script>\n'
        f'<script type="module">import "fogwatch/{loads[1]}";</script>'
    )
    recorded = f'<script src="{RECORDED}"></script>\n' if html == "index.html" else ""
    return page.replace(loads[0], recorded + scripts)


def _record_frames(run: Run, progress: Callable[[Iterable[int]], Iterable[int]]) -> tuple[int, bytes]:
    """Return the number of frames, and the messages of all of them."""
    player = Player(run, count().__next__, autoplay=True)  # for the pace at which a run plays by itself
    player.read_all()
    static = replace(player.static(), layers=("truth",))
    every = -(-run.ticks // MOST_FRAMES)
    ticks = [*range(0, run.ticks - 1, every), run.ticks - 1]
    tiled = TiledMap(TRUTH, static.terrain.shape)
    packets = [terrain_packet(static.terrain.passable, static.patrolled)]
    frames = []
    for number, k in enumerate(progress(ticks)):
        player.control({"do": "seek", "k": k})
        state = player.wait(0.0)
        last_seen = player.last_seen("truth")
        assert state is not None
        assert last_seen is not None
        before = tiled.version
        tiled.update(last_seen, k)
        changed, key_packet = tiled.packet(before), tiled.packet(0) if number % KEY == 0 else b""
        packets += [changed, key_packet]
        message = state_message(state, survey_of(last_seen, static.patrolled, k), static)
        links = "null" if number % KEY or state.links is None else links_message(state.links, k)
        frames.append(f'{{"state":{message},"links":{links},"changed":{len(changed)},"whole":{len(key_packet)}}}')
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
