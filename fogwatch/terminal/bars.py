"""The bars that show on a terminal how far long work is."""

from __future__ import annotations

from collections.abc import Callable

from rich.console import Console
from rich.control import Control
from rich.progress import BarColumn, MofNCompleteColumn, Progress, ProgressColumn, TextColumn, TimeElapsedColumn
from rich.segment import ControlType
from rich.text import Text

from patrol.starting.compiling import Compiled
from patrol.starting.warmup import progress_line

WIDTH = 30
"""Width of the kernels' bar, in characters."""


def bar_on(console: Console, left: ProgressColumn) -> Progress:
    """Make a progress bar, which shows on a terminal only and is cleared away in the end.

    It is not started yet. `left` is its last column, for the time left.
    """
    return Progress(
        TextColumn("{task.description}", style="cyan"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        left,
        console=console,
        transient=True,
        disable=not console.is_terminal,
    )


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
            line = Text.assemble(
                (full * filled, "green"), (empty * (WIDTH - filled), "dim"), f" {progress_line(compiled)}"
            )
            line.truncate(console.width - 1)  # a second row would stay
            console.print(line, end="", no_wrap=True)

    return show
