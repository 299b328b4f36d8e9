from pathlib import Path

import pytest

from monitor.live.attach import open_fleet
from patrol.errors import BadInput
from runtime.process.lifeline import Ending
from runtime.security.access import FILE
from runtime.security.private_files import new_key
from tests.routers import reach_patiently, write_access


def test_a_scenario_s_key_is_opened_only_when_asked_for(
    endpoint: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    run, key = tmp_path, tmp_path / "fleet.key"
    write_access(run, endpoint)
    new_key(key)
    (run / "scenario.yaml").write_text(f"terrain: {{builtin: open}}\nradio: {{key: {key}}}\n", encoding="utf-8")
    reach_patiently(monkeypatch)
    opened: list[Path] = []

    def read(path: Path, _kind: object) -> bytes:
        opened.append(path)
        return b"k" * 16

    monkeypatch.setattr("runtime.security.private_files.read_untrusted", read)
    for access in (run, run / FILE):
        with pytest.raises(BadInput, match="its world does not answer"):
            open_fleet(Ending(), access=access, wait_s=0.2)
    assert opened == []
    with pytest.raises(BadInput, match="its world does not answer"):
        open_fleet(Ending(), access=run, key=key, wait_s=0.2)
    assert opened == [key]


def test_a_scenario_that_leads_out_of_the_run_s_folder_is_not_read(endpoint: str, tmp_path: Path) -> None:
    run, outside = tmp_path / "run", tmp_path / "mine.yaml"
    run.mkdir()
    write_access(run, endpoint)
    outside.write_text("terrain: {builtin: open}\n", encoding="utf-8")
    (run / "scenario.yaml").symlink_to(outside)
    with pytest.raises(BadInput, match="is a link that leads out of the run's folder"):
        open_fleet(Ending(), access=run, wait_s=0.2)
