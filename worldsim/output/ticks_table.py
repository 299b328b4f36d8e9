"""ticks.csv: one line a tick, for spreadsheets and quick plots; the journal has everything."""

from __future__ import annotations

from collections import Counter
from contextlib import suppress
from pathlib import Path

from patrol.journal import Status, TickRecord

HEAD = "k,time_s,mfow_s,fog_mean_s,seen,living,sent,delivered,dropped,collisions,paused,dead,lost,away"


class TicksTable:
    """Writes ticks.csv as the run goes; each line reaches the operating system as soon as it is written."""

    def __init__(self, path: Path, step: float) -> None:
        """Create the file; raise FileExistsError where it exists."""
        self._file = path.open("x", encoding="ascii", newline="", buffering=1)
        self._step = step
        self._file.write(f"{HEAD}\n")

    def tick(self, record: TickRecord) -> None:
        """Append one tick's line."""
        # A `Counter` gives 0 for a status that no robot has.
        standing = Counter(robot.status for robot in record.robots)
        delivered, dropped = len(record.deliveries), len(record.dropped)
        numbers = (
            record.k,
            f"{record.k * self._step:.6g}",
            f"{record.mfow * self._step:.6g}",
            f"{record.fog_mean * self._step:.6g}",
            record.seen,
            standing[Status.ALIVE],
            delivered + dropped,
            delivered,
            dropped,
            sum(robot.bumped for robot in record.robots),
            standing[Status.PAUSED],
            standing[Status.DEAD],
            standing[Status.LOST],
            standing[Status.ABSENT] + standing[Status.LEFT],
        )
        self._file.write(f"{','.join(map(str, numbers))}\n")

    def close(self) -> None:
        """Close the file; closing twice is fine. A line that could not be written was reported by `tick`."""
        with suppress(OSError):
            self._file.close()
