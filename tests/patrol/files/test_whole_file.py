from pathlib import Path

import pytest

from patrol.files.whole_file import write_whole
from tests.full_disk import full_disk


def test_what_is_written_takes_the_place_of_what_was_there(tmp_path: Path) -> None:
    file = tmp_path / "summary.json"
    for text in ("{}\n", '{"name": "größer"}\n', ""):
        write_whole(file, text)
        assert file.read_text(encoding="utf-8") == text
    assert list(tmp_path.iterdir()) == [file]


def test_what_cannot_be_written_leaves_what_was_there_and_nothing_else(tmp_path: Path) -> None:
    file = tmp_path / "summary.json"
    write_whole(file, "before")
    with full_disk(1000), pytest.raises(OSError, match="File too large"):
        write_whole(file, "x" * 10_000)
    assert file.read_text(encoding="utf-8") == "before"
    assert list(tmp_path.iterdir()) == [file]
