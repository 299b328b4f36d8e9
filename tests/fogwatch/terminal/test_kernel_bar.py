from io import BytesIO, StringIO, TextIOWrapper

from rich.console import Console

from fogwatch.terminal.live_table import kernel_bar
from runtime.starting.compiling import Compiled


def test_a_terminal_gets_a_bar_of_one_row_with_the_time_to_go_that_is_removed_in_the_end() -> None:
    file = StringIO()
    show = kernel_bar(Console(file=file, force_terminal=True, width=100))
    assert show is not None
    show(Compiled(20, 80, 12.0))
    assert "compiling the kernels: 20 of 80, about 12 s to go" in file.getvalue()
    assert "\n" not in file.getvalue()
    show(Compiled(80, 80, 0.0))
    assert file.getvalue().endswith("\r\x1b[2K")
    narrow = StringIO()
    show = kernel_bar(Console(file=narrow, force_terminal=True, color_system=None, width=40))
    assert show is not None
    show(Compiled(90, 119, 125.0))
    assert narrow.getvalue().rpartition("\x1b[2K")[2] == "━" * 22 + " " * 8 + " compilin"


def test_a_terminal_without_utf_8_gets_a_bar_of_ascii() -> None:
    file = TextIOWrapper(BytesIO(), encoding="latin-1")
    show = kernel_bar(Console(file=file, force_terminal=True, color_system=None, width=100))
    assert show is not None
    show(Compiled(90, 119, None))
    file.flush()
    assert file.buffer.getvalue().endswith(b"#" * 22 + b" " * 8 + b" compiling the kernels: 90 of 119")


def test_there_is_no_bar_without_a_terminal() -> None:
    assert kernel_bar(Console(file=StringIO())) is None
