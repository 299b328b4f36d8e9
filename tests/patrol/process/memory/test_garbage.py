from __future__ import annotations

import gc
import weakref
from collections.abc import Iterator

import pytest

from patrol.process.memory.garbage import begin_collection, hold_collection, spare_what_is_loaded, spared


@pytest.fixture(autouse=True)
def collector(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """The collector as it is at the start of a process, and afterwards as it was."""
    monkeypatch.setattr("patrol.process.memory.garbage._spares_what_is_loaded", False)
    were_frozen = gc.get_freeze_count() > 0
    gc.unfreeze()
    yield
    gc.unfreeze()
    if were_frozen:
        gc.freeze()
    gc.enable()


def test_what_is_loaded_while_collection_is_held_is_left_alone_afterwards() -> None:
    hold_collection()
    assert not gc.isenabled()
    loaded: list[list[int]] = [[]]
    begin_collection()
    assert gc.isenabled()
    assert not any(one is loaded for one in gc.get_objects()), "a collection goes through it no more"
    later: list[object] = []
    later.append(later)
    assert any(one is later for one in gc.get_objects())


def test_a_process_that_has_not_held_collection_is_not_changed() -> None:
    before = gc.get_freeze_count()
    begin_collection()
    assert (gc.isenabled(), gc.get_freeze_count()) == (True, before)


def test_what_is_there_before_a_block_is_collected_again_after_it() -> None:
    there: list[list[int]] = [[]]
    with spared():
        assert not any(one is there for one in gc.get_objects())
        made: list[list[int]] = [[]]
        assert any(one is made for one in gc.get_objects())
    assert any(one is there for one in gc.get_objects())


def test_what_is_garbage_before_a_block_is_gone_within_it() -> None:
    class Ring:
        """Refers to itself, so that only a collection finds it."""

    gc.disable()
    ring = Ring()
    ring.self = ring  # type: ignore[attr-defined]
    gone = weakref.ref(ring)
    del ring
    assert gone() is not None
    with spared():
        assert gone() is None


def test_what_is_spared_for_good_stays_so_after_a_block() -> None:
    loaded: list[list[int]] = [[]]
    spare_what_is_loaded()
    later: list[list[int]] = [[]]
    with spared():
        assert any(one is later for one in gc.get_objects()), "what came later is collected within the block too"
    found = gc.get_objects()
    assert not any(one is loaded for one in found)
    assert any(one is later for one in found)
