"""A user's cache folder of a test's own, for records of the sensors that the user runs."""

from pathlib import Path

import pytest

from patrol import own_sensor
from patrol.kernel_cache import cache_home


@pytest.fixture(autouse=True)
def records(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The folder of the records, which does not exist yet; kernels stay where they are."""
    kernels = tmp_path / "kernels"
    kernels.mkdir()
    (kernels / "fogwatch").symlink_to(cache_home())
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(kernels))
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.setattr(own_sensor, "_allowed", set())
    return tmp_path / "cache" / "fogwatch" / "sensors"
