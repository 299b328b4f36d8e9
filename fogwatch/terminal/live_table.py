"""The display of a running fleet: a live table on a terminal, a line every few seconds elsewhere; and progress bars."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from functools import partial

from rich import progress as bars
from rich.console import Console, RenderableType
from rich.control import Control
from rich.live import Live
from rich.progress_bar import ProgressBar
from rich.segment import ControlType
from rich.table import Table
from rich.text import Text

from patrol.errors import printable_lines
from patrol.journal import Status
from runtime.messages.telemetry import FREE, TRAPPED, Metrics, Notice
from runtime.starting.compiling import Compiled
from runtime.starting.warmup import progress_line

PLAIN_S = 5.0
"""Wall time between two lines where there is no terminal."""
LONGEST_S = 1e9
"""The longest time to go that is shown, s; a run that takes 30 years at this rate shows none."""
MOST_ROBOTS = 20
"""Robots in the live table."""
_STYLES = {"patrolling": "green", "free": "blue", "dead-end": "yellow", "holding": "cyan"}
STATUS_STYLES = {
    Status.ABSENT: "dim",
    Status.ALIVE: "",
    Status.PAUSED: "bold yellow",
    Status.DEAD: "bold red",
    Status.LOST: "bold red",
    Status.LEFT: "dim",
}
"""The text styles of the robots' statuses."""


class RunDisplay:
    """Shows the progress of a run; this one shows nothing.

    `announced` is what the run said of its scenario before the first tick, for those who were shown nothing.
    """

    announced: Sequence[str] = ()

    def say(self, line: str) -> None:
        """Show a line of text."""

    def metrics(self, metrics: Metrics) -> None:
        """Show the measures of the run so far."""

    def notice(self, notice: Notice) -> None:
        """Show an event."""

    def progress(self, step: str, share: float | None = None) -> None:
        """Show how far a step of the run's end is, such as ``writing report.html``.

        Several may go on at once. `share` is how much of it is done, 0 to 1; None when unknown.
        """

    def pause(self) -> None:
        """Leave the terminal to others until something is shown again."""

    def close(self) -> None:
        """Stop showing: the run is over."""


class CallbackDisplay(RunDisplay):
    """Passes metrics on to a function and shows nothing else."""

    def __init__(self, metrics: Callable[[Metrics], None]) -> None:
        """Pass metrics on to a function."""
        self._tell = metrics

    def metrics(self, metrics: Metrics) -> None:
        """Pass them on."""
        self._tell(metrics)


class PlainDisplay(RunDisplay):
    """A display that prints a line every few seconds."""

    def __init__(self, console: Console) -> None:
        self._console = console
        self._due = 0.0
        self._step_due: dict[str, float] = {}

    def say(self, line: str) -> None:
        """Print a line."""
        self._console.print(printable_lines(line), markup=False, highlight=False, soft_wrap=True)

    def metrics(self, metrics: Metrics) -> None:
        """Print the measures, if the last such line is `PLAIN_S` old or the run is complete."""
        now = time.monotonic()
        if now >= self._due or metrics.k == metrics.ticks:
            self._due = now + PLAIN_S
            self.say(headline(metrics))

    def notice(self, notice: Notice) -> None:
        """Print an event."""
        self.say(_notice_text(notice))

    def progress(self, step: str, share: float | None = None) -> None:
        """Print that a step begins, and then how far it is, if the last such line is `PLAIN_S` old."""
        now = time.monotonic()
        begins = step not in self._step_due
        if begins or (now >= self._step_due[step] and share != 1.0):
            self._step_due[step] = now + PLAIN_S
            self.say(f"{step} ..." if begins or share is None else f"{step}: {100.0 * share:.0f} %")


class LiveTable(PlainDisplay):
    """A display that keeps a table of the robots at the bottom of a terminal, and prints lines above it."""

    def __init__(self, console: Console) -> None:
        super().__init__(console)
        self._live = Live(console=console, refresh_per_second=8, transient=True)
        self._steps: dict[str, tuple[float, float | None]] = {}

    def metrics(self, metrics: Metrics) -> None:
        """Update the table."""
        self._show_content(_metrics_table(metrics))

    def progress(self, step: str, share: float | None = None) -> None:
        """Show a bar for each step that goes on, instead of the table."""
        began, _ = self._steps.get(step, (time.monotonic(), None))
        self._steps[step] = began, share
        if share == 1.0:
            del self._steps[step]
        self._show_content(_StepBars(self._steps))

    def pause(self) -> None:
        """Remove the table."""
        self._live.stop()

    def close(self) -> None:
        """Remove the table."""
        self.pause()

    def _show_content(self, content: RenderableType) -> None:
        self._live.start()
        self._live.update(content)


class _StepBars:
    """A bar and the time spent for each of some steps, as of the moment at which they are drawn."""

    def __init__(self, steps: Mapping[str, tuple[float, float | None]]) -> None:
        """Show steps: for each, when it began (`time.monotonic`), and its share done, None when unknown."""
        self._steps = dict(steps)

    def __rich__(self) -> Table:
        rows = Table.grid(padding=(0, 1))
        now = time.monotonic()
        for step, (began, share) in self._steps.items():
            bar = ProgressBar(total=1.0, completed=share or 0.0, width=30, pulse=share is None, animation_time=now)
            rows.add_row(Text(step), bar, duration_text(now - began))
        return rows


class GuardedDisplay(RunDisplay):
    """A display whose failures do not reach the run.

    Any error of the other display is counted, and reported once through it; the run goes on.
    """

    def __init__(self, shown: RunDisplay) -> None:
        """Guard a display."""
        self.shown = shown
        self.failures = 0
        for name in vars(RunDisplay):
            if not name.startswith("_") and name != "close":
                setattr(self, name, partial(self._attempt_show, getattr(shown, name)))

    def close(self) -> None:
        """Stop showing, and report how much could not be shown."""
        self._attempt_show(self.shown.close)
        if self.failures > 1:
            self.say(f"{self.failures} lines or tables could not be shown")

    def _attempt_show(self, show: Callable[..., None], *shown: object, **named: object) -> None:
        try:
            show(*shown, **named)
        except Exception as error:  # noqa: BLE001 - a display may fail in any way, and none of them may end a run
            self.failures += 1
            if self.failures == 1:
                self.say(f"the display failed ({type(error).__name__}: {error}); the run goes on")


class _QuietOnBrokenPipe(Console):
    """A console that prints no more once its reader has left; the run goes on."""

    def on_broken_pipe(self) -> None:
        self.quiet = True


def make_display(quiet: bool) -> RunDisplay:
    """Make the display that suits the standard error: a live table on a terminal, else plain lines."""
    if quiet:
        return RunDisplay()
    console = _QuietOnBrokenPipe(stderr=True)
    return GuardedDisplay(LiveTable(console) if console.is_terminal else PlainDisplay(console))


def headline(metrics: Metrics) -> str:
    """Write the measures of a run so far in one line."""
    rate = metrics.ticks_per_s
    step = metrics.time_s / metrics.k
    parts = [
        f"tick {metrics.k}/{metrics.ticks} ({metrics.time_s:.0f} s)",
        f"MFoW {metrics.mfow_s:.1f} s{_place_text(metrics.stalest)}, mean {metrics.mfow_mean_s:.1f} s",
        f"seen {100.0 * metrics.seen_share:.1f} %",
        _standing_text(metrics),
        f"{rate:.1f} ticks/s, {rate * step:.1f} x real time",
    ]
    remaining = metrics.ticks - metrics.k
    if metrics.k > 1 and remaining and remaining <= rate * LONGEST_S:  # the first tick says little about the others
        parts.append(f"{duration_text(remaining / rate)} to go")
    return "; ".join(parts)


def robots_text(count: int) -> str:
    """Return a number of robots in words, such as "1 robot"."""
    return f"{count} robot{'s' if count > 1 else ''}"


def duration_text(seconds: float) -> str:
    """Format a duration, for example "42 s", "7 min 05 s" or "2 h 05 min"."""
    total_s = round(seconds)
    if total_s < 60:
        return f"{total_s} s"
    minutes, remainder_s = divmod(total_s, 60)
    if minutes < 60:
        return f"{minutes} min {remainder_s:02d} s"
    return f"{minutes // 60} h {minutes % 60:02d} min"


def _place_text(place: tuple[float, float] | None) -> str:
    return "" if place is None else f" at ({place[0]:.1f}, {place[1]:.1f})"


def _notice_text(notice: Notice) -> str:
    if notice.kind in (TRAPPED, FREE):
        return f"tick {notice.k}: {notice.robot} {notice.kind} {notice.detail}"
    return " ".join(part for part in (f"tick {notice.k}:", notice.robot, f"{notice.kind}:", notice.detail) if part)


def _standing_text(metrics: Metrics) -> str:
    """Write how many robots are alive, and the statuses of the others that are or were there."""
    count = Counter(robot.status for robot in metrics.robots)
    usual = (Status.ALIVE, Status.ABSENT)  # most of the absent ones are spare, and never asked for
    abnormal = [f"{count[status]} {status.name.lower()}" for status in Status if status not in usual and count[status]]
    alive = f"{count[Status.ALIVE]}/{len(metrics.robots) - count[Status.ABSENT]} robots"
    return f"{alive} ({', '.join(abnormal)})" if abnormal else alive


def _metrics_table(metrics: Metrics) -> Table:
    outer = Table.grid(padding=(0, 1))
    outer.add_row(ProgressBar(total=metrics.ticks, completed=metrics.k, width=60))
    outer.add_row(Text(headline(metrics)))
    robots = Table(box=None, padding=(0, 2), header_style="bold")
    for head in ("robot", "state", "x m", "y m"):
        robots.add_column(head, justify="right" if head.endswith(" m") else "left")
    present = [robot for robot in metrics.robots if robot.status != Status.ABSENT]
    for robot in present[:MOST_ROBOTS]:
        status = Status(robot.status)
        alive = status is Status.ALIVE
        state = robot.state or "waiting" if alive else status.name.lower()
        style = _STYLES.get(state, "") if alive else STATUS_STYLES[status]
        robots.add_row(Text(robot.name), Text(state, style), f"{robot.x:.1f}", f"{robot.y:.1f}")
    outer.add_row(robots)
    if len(present) > MOST_ROBOTS:
        outer.add_row(f"and {len(present) - MOST_ROBOTS} more robots")
    return outer


WIDTH = 30
"""Width of the kernels' bar, in characters."""


def bar_on(console: Console | None = None, left: bars.ProgressColumn | None = None) -> bars.Progress:
    """Make a progress bar, which shows on a terminal only and is cleared away in the end.

    It is not started yet. `console` is the standard error, and `left`, its last column, the time left, unless given.
    """
    console, left = console or Console(stderr=True), left or bars.TimeRemainingColumn()
    task = bars.TextColumn("{task.description}", style="cyan"), bars.BarColumn(), bars.MofNCompleteColumn()
    hidden = not console.is_terminal
    return bars.Progress(*task, bars.TimeElapsedColumn(), left, console=console, transient=True, disable=hidden)


def kernel_bar(console: Console) -> Callable[[Compiled], None] | None:
    """Return a function that draws the bar over the last one; None without a terminal.

    The function removes the bar in the end.
    """
    if not console.is_terminal:
        return None

    full = "#" if console.options.ascii_only else "━"
    empty = full if console.color_system else " "

    def show(compiled: Compiled) -> None:
        console.control(Control(ControlType.CARRIAGE_RETURN, (ControlType.ERASE_IN_LINE, 2)))
        if compiled.kernels < compiled.of:
            filled = WIDTH * compiled.kernels // compiled.of
            bar = (full * filled, "green"), (empty * (WIDTH - filled), "dim")
            line = Text.assemble(*bar, f" {progress_line(compiled)}")
            line.truncate(console.width - 1)  # a second row would stay
            console.print(line, end="", no_wrap=True)

    return show
