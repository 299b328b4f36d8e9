"""The tours that come with the code are those that the search finds.

After a change of the search, `patrol.measures.best_tour.VERSION` has gone up and the files have other names: delete
those in `patrol/tours/found`, run this, and take what it has left in the cache that it names.
"""

from pathlib import Path

import pytest

from patrol.measures import best_tour as module
from patrol.measures.best_tour import best_tour
from patrol.prepare import prepare
from patrol.scenario import BUILTINS, open_scenario


@pytest.mark.parametrize("terrain", BUILTINS)
def test_a_tour_that_comes_with_the_code_is_the_one_that_is_found(
    terrain: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    monkeypatch.setattr(module, "_known", {})
    found = module.FOUND
    monkeypatch.setattr(module, "FOUND", tmp_path / "none")
    best_tour(prepare(open_scenario(terrain, {})))
    cache = tmp_path / "fogwatch" / "tours"
    (file,) = cache.glob("*.json")
    assert (found / file.name).read_text() == file.read_text(), f"not as found: {cache}"
