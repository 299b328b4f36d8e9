import stat
from pathlib import Path

import pytest
from typer.testing import CliRunner

from fogwatch.commands.fleet import app
from patrol.errors import BadInput
from runtime.security.private_files import LONGEST_KEY, fleet_key, new_key


def test_a_new_key_is_random_long_and_for_its_owner_alone(tmp_path: Path) -> None:
    paths = [tmp_path / "a.key", tmp_path / "b.key"]
    for path in paths:
        result = CliRunner().invoke(app, ["key", str(path)], catch_exceptions=False)
        assert (result.exit_code, str(path) in result.output) == (0, True)
        assert stat.S_IMODE(path.stat().st_mode) == 0o600
    keys = [fleet_key(path) for path in paths]
    assert keys[0] != keys[1]
    assert [len(key or b"") for key in keys] == [LONGEST_KEY, LONGEST_KEY]


def test_a_key_that_is_there_is_not_overwritten(tmp_path: Path) -> None:
    path = tmp_path / "fleet.key"
    new_key(path)
    before = path.read_bytes()
    with pytest.raises(BadInput, match="exists already"):
        new_key(path)
    assert path.read_bytes() == before
    with pytest.raises(BadInput, match="is a folder; name a new file in it"):
        new_key(tmp_path)
    with pytest.raises(BadInput, match="cannot be written"):
        new_key(tmp_path / "nowhere" / "fleet.key")


@pytest.mark.parametrize(
    ("data", "why"), [(b"short", "holds 5 bytes"), (b"x" * 65, "holds 65 bytes"), (None, "No such")]
)
def test_a_key_that_is_none_is_bad_input(tmp_path: Path, data: bytes | None, why: str) -> None:
    path = tmp_path / "fleet.key"
    if data is not None:
        path.write_bytes(data)
    with pytest.raises(BadInput, match=why):
        fleet_key(path)
    assert fleet_key(None) is None
