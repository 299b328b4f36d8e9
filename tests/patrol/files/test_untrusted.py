import os
from contextlib import suppress
from pathlib import Path

import pytest

from patrol.files.untrusted import KEY, FileRefused, Kind, check_regular, leads_out, open_untrusted, read_untrusted

SMALL = Kind("a note", 2048)


def test_a_regular_file_is_read_unless_it_is_too_large(tmp_path: Path) -> None:
    path = tmp_path / "note"
    path.write_bytes(b"x" * SMALL.most)
    assert read_untrusted(path, SMALL) == b"x" * SMALL.most
    with open_untrusted(path, SMALL) as file:
        assert file.read(1) == b"x"
    path = tmp_path / "note"
    path.write_bytes(b"x" * (SMALL.most + 1))
    for read in (read_untrusted, open_untrusted):
        with pytest.raises(FileRefused) as caught:
            read(path, SMALL)
        assert caught.value.strerror == "is larger than a note may be, 2 KiB"


def test_a_file_that_does_not_say_how_large_it_is_is_read_no_further_than_it_may() -> None:
    path = Path("/proc/self/smaps")
    assert path.stat().st_size == 0
    with pytest.raises(FileRefused, match="larger than a note"):
        read_untrusted(path, SMALL)


def test_nothing_is_waited_for(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    for path, why in ((tmp_path / "pipe", "is a named pipe"), (Path("/dev/zero"), "is a device")):
        with pytest.raises(FileRefused, match=why):
            read_untrusted(path, KEY)


def test_what_is_no_regular_file_is_not_even_opened(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Opening some devices does something, and opening a pipe wakes whoever waits to write to it."""
    os.mkfifo(tmp_path / "pipe")
    flags: list[int] = []
    opens = os.open

    def watched(path: str, how: int) -> int:
        flags.append(how)
        return opens(path, how)

    monkeypatch.setattr(os, "open", watched)
    for path in (tmp_path / "pipe", Path("/dev/zero"), tmp_path):
        with pytest.raises(OSError, match=r"is a|directory"):
            open_untrusted(path, KEY)
    assert len(flags) == 3
    assert all(how & os.O_PATH for how in flags)


def test_the_file_that_was_checked_is_the_one_that_is_opened(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "note"
    path.write_bytes(b"checked")

    def replaced(descriptor: int, path: Path, kind: Kind) -> None:
        check_regular(descriptor, path, kind)
        path.unlink()
        os.mkfifo(path)

    monkeypatch.setattr("patrol.files.untrusted.check_regular", replaced)
    assert read_untrusted(path, SMALL) == b"checked"


def test_what_the_system_does_not_open_keeps_its_reason(tmp_path: Path) -> None:
    cases = ((tmp_path / "none", FileNotFoundError), (tmp_path, IsADirectoryError), (Path("a\0b"), FileRefused))
    for path, why in cases:
        with pytest.raises(why, match="null character" if why is FileRefused else None):
            read_untrusted(path, KEY)


def opened(path: Path) -> int:
    """The number of this process's descriptors of a path. Its other threads open and close others meanwhile."""
    count = 0
    for entry in Path("/proc/self/fd").iterdir():
        with suppress(FileNotFoundError):
            count += entry.readlink() == path
    return count


def test_no_descriptor_is_left_open(tmp_path: Path) -> None:
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    for path in (tmp_path, pipe, Path("/dev/zero")):
        before = opened(path)
        with pytest.raises(OSError):  # noqa: PT011 - whichever
            open_untrusted(path, KEY)
        assert opened(path) == before


def test_a_path_that_leads_out_of_a_folder_is_told(tmp_path: Path) -> None:
    folder = tmp_path / "folder"
    folder.mkdir()
    (folder / "link").symlink_to(tmp_path)
    (folder / "loop").symlink_to(folder / "loop")
    ways = ("a", "b/../a", "loop", "../a", "/etc/passwd", "link")
    assert [leads_out(folder, folder / way) for way in ways] == [False] * 3 + [True] * 3
