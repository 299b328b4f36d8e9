"""Calls of commands on files, and the answers that tests expect of a call."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from monitor.recording.run_recorder import Recorder
from monitor.replay.player import Player
from monitor.replay.replay import play
from monitor.replay.run import open_run
from monitor.report.analysis import analyse
from monitor.report.compare import rows_of
from monitor.report.document import report_html
from patrol.errors import BadInput

MAP = "image: map.pgm\nresolution: 0.5\norigin: [0, 0, 0]\nnegate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.2\n"


def write_map(path: Path) -> None:
    path.write_text(MAP.replace("map.pgm", "hall.pgm"), encoding="utf-8")
    cells = np.full((80, 100), 254, dtype=np.uint8)
    cells[[0, -1], :] = cells[:, [0, -1]] = 0
    cells[30:40, 20:60] = 0
    Image.fromarray(cells).save(path.with_name("hall.pgm"))


def looked_at(folder: Path) -> None:
    """All that commands make of a run's folder, figures apart."""
    run = open_run(folder)
    analysis = analyse(run)
    report_html(analysis, [])
    rows_of([run, run])
    player = Player(run)
    for k in (0, run.ticks - 1):
        player.control({"do": "seek", "k": k})
        player.wait(0.0)
    recorder = Recorder(run, folder / "again.mcap")
    try:
        play(run, [recorder])
        recorder.close()
    except BaseException:
        recorder.abandon()
        raise


def one_line(call: Callable[[], object]) -> str:
    """Return the one line of a call that refuses its input."""
    with pytest.raises(BadInput) as caught:
        call()
    assert str(caught.value).isprintable()
    return str(caught.value)


def value_or_line(call: Callable[[], object]) -> None:
    """Call; of all exceptions, only BadInput with one printable line may come out."""
    said = ""
    try:
        call()
    except BadInput as error:
        said = str(error)
    assert said.isprintable()


def as_json(value: Any) -> bytes:
    return json.dumps(value, default=lambda other: other.hex()).encode()
