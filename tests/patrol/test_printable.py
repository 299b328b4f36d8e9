import unicodedata

import pytest
from hypothesis import given
from hypothesis import strategies as st

from patrol.errors import printable

CONTROLS = ("Cc", "Cf", "Cs", "Zl", "Zp")


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("loss 0.5 → r1, ä", "loss 0.5 → r1, ä"),
        ("\x1b[2J\x07", r"\x1b[2J\x07"),
        ("a\r\nb\tc", r"a\r\nb\tc"),
        ("\x7f\x9b31m", r"\x7f\x9b31m"),
        ("txt\u202egpj\u2066", r"txt\u202egpj\u2066"),
        ("a\u200bb\u2028c", r"a\u200bb\u2028c"),
        ("\ud800", r"\ud800"),
        ("", ""),
    ],
)
def test_what_a_terminal_might_act_on_is_shown_as_its_escape_sequence(text: str, shown: str) -> None:
    assert printable(text) == shown


@given(st.text())
def test_any_text_becomes_printable_and_stays_so(text: str) -> None:
    shown = printable(text)
    assert shown.isprintable()
    assert printable(shown) == shown
    assert not any(unicodedata.category(char) in CONTROLS for char in shown)
    shown.encode("utf-8")
