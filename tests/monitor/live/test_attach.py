from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from monitor.live.attach import open_fleet
from patrol.errors import BadInput
from patrol.process.lifeline import Ending
from patrol.security.access import FILE
from patrol.security.private_files import new_key
from tests.routers import reach_patiently, write_access


@pytest.fixture
def folder(tmp_path: Path) -> Callable[[str], Path]:
    """A run's folder that says where its fleet is met."""

    def make(router: str) -> Path:
        write_access(tmp_path, router)
        return tmp_path

    return make


def test_the_key_that_a_run_s_scenario_names_is_opened_only_when_asked_for(
    endpoint: str, folder: Callable[[str], Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    run, key = folder(endpoint), tmp_path / "fleet.key"
    new_key(key)
    (run / "scenario.yaml").write_text(f"terrain: {{builtin: open}}\nradio: {{key: {key}}}\n", encoding="utf-8")
    reach_patiently(monkeypatch)
    opened: list[Path] = []

    def read(path: Path, _kind: object) -> bytes:
        opened.append(path)
        return b"k" * 16

    monkeypatch.setattr("patrol.security.private_files.read_untrusted", read)
    for access in (run, run / FILE):
        with pytest.raises(BadInput, match="no world of this fleet answers"):
            open_fleet(Ending(), access=access, wait_s=0.2)
    assert opened == []
    with pytest.raises(BadInput, match="no world of this fleet answers"):
        open_fleet(Ending(), access=run, key=key, wait_s=0.2)
    assert opened == [key]


def test_a_scenario_that_leads_out_of_the_run_s_folder_is_not_read(
    endpoint: str, folder: Callable[[str], Path], tmp_path_factory: pytest.TempPathFactory
) -> None:
    run, outside = folder(endpoint), tmp_path_factory.mktemp("outside") / "mine.yaml"
    outside.write_text("terrain: {builtin: open}\n", encoding="utf-8")
    (run / "scenario.yaml").symlink_to(outside)
    with pytest.raises(BadInput, match="is a link that leads out of the run's folder"):
        open_fleet(Ending(), access=run, wait_s=0.2)
