"""The verdict on the radio model, from the journal alone: what it lost had to be lost, and nothing else."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from patrol.journal.links import drops_of
from patrol.journal.records import MAX_TICKS
from tests.worldsim.checks.judged import Result, Run, change, checks, failures
from worldsim.radio import path_loss
from worldsim.radio.models import OnAir
from worldsim.radio.path_loss import PathLoss

TICKS = 80
# A room of 20 m by 15 m with a wall: a weak radio, so that some frames get through and some do not.
OPTIONS: dict[str, Any] = {"power": -27.0, "redraw": 4.0, "airtime": 0.05}
RADIO = {"model": "path-loss", "options": OPTIONS}
FAULTS = (
    {"kind": "loss", "rate": 0.2},
    {"kind": "silence", "who": "r2", "direction": "out", "at": 3.0, "for": 4.0},
    {"kind": "partition", "groups": [["r1", "r2"], ["r3", "r4"]], "at": 8.0, "for": 3.0},
    {"kind": "bandwidth", "bytes_per_s": 30.0, "who": "r4"},
    {"kind": "delay", "delay": {"constant": 1.2}, "from": "r1"},
    {"kind": "duplicate", "rate": 0.5, "from": "r3"},
    {"kind": "spoof", "by": "r2", "as": "r1", "payload": {"offset": [1.0, 0.0]}},
    {"kind": "spoof", "as": "r3", "payload": "freeze", "at": 5.0, "for": 5.0},
    {"kind": "pause", "who": "r3", "at": 12.0, "for": 4.0},
    {"kind": "leave", "who": "r4", "at": 25.0},
    {"kind": "kill", "who": "r1", "at": 30.0},
)


def lost_by_model(result: Result, cause: str = "path-loss") -> int:
    return sum(why == cause for record in result[1].ticks for *_, why in record.dropped)


@pytest.mark.parametrize("faults", [(), FAULTS], ids=["calm", "faults"])
@pytest.mark.parametrize("options", [OPTIONS, {**OPTIONS, "edge": 0.0, "airtime": 0.15}, {**OPTIONS, "airtime": 0.0}])
def test_whatever_a_good_model_loses_is_right(
    run: Run, faults: tuple[dict[str, Any], ...], options: dict[str, Any]
) -> None:
    result = run(*faults, radio={"model": "path-loss", "options": options})
    assert failures(result) == {}
    lost = lost_by_model(result)
    assert lost > 50
    assert sum(len(record.deliveries) for record in result[1].ticks) > 20
    assert checks(result)["path loss"].detail.startswith(f"{lost} of ")


Lost = Callable[[PathLoss, OnAir], NDArray[np.bool_]]
GOOD = PathLoss.lost


def with_options(**options: Any) -> Lost:
    """A model that takes other options for its own."""

    def lost(model: PathLoss, air: OnAir) -> NDArray[np.bool_]:
        model.options = model.options.model_copy(update=options)
        return GOOD(model, air)

    return lost


@pytest.mark.parametrize(
    ("lost", "says"),
    [
        (lambda _, air: np.zeros_like(air.on_the_way), "got through and should have been lost"),
        (lambda _, air: np.ones_like(air.on_the_way), "was lost by path loss and should have been received"),
        (with_options(wall=0.0), ""),
        (with_options(exponent=2.4), "got through"),
        (with_options(power=-27.5), "was lost"),
        (with_options(shadowing=0.0), ""),
        (with_options(redraw=None), ""),
        (with_options(airtime=0.0), "got through"),
        (with_options(noise=-95.0), ""),
        (with_options(edge=0.0), ""),
        (lambda model, air: GOOD(model, air).T if air.on_the_way.shape == (4, 4) else GOOD(model, air), ""),
    ],
    ids=["none", "all", "wall", "exponent", "power", "shadowing", "redraw", "airtime", "noise", "edge", "reversed"],
)
def test_a_model_that_is_wrong_in_any_part_fails(
    run: Run, lost: Lost, says: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(PathLoss, "lost", lost)
    found = failures(run(radio=RADIO))
    assert list(found) == ["path loss"]
    assert says in found["path loss"]


def test_a_count_of_walls_that_is_wrong_fails(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(path_loss, "walls_between", lambda *_: np.ones((4, 4), dtype=np.int64))
    assert list(failures(run(radio=RADIO))) == ["path loss"]


def test_a_loss_that_only_the_record_lacks_fails(run: Run) -> None:
    world, journal = run(radio=RADIO)
    k, drop = next((record.k, drop) for record in journal.ticks for drop in record.dropped)
    record = journal.records[k]
    rest = tuple(other for other in record.dropped if other != drop)
    change(journal, k, dropped=rest, deliveries=tuple(sorted((*record.deliveries, drop[:3]))))
    found = failures((world, journal))
    assert {"radio", "path loss"} <= set(found)
    frame = f"a frame from r{drop[0]} to r{drop[1]} of tick {k}"
    assert found["path loss"] == f"{frame} got through and should have been lost by path loss"


def test_a_loss_that_only_the_record_has_fails(run: Run) -> None:
    world, journal = run(radio=RADIO)
    k, link = next((record.k, link) for record in journal.ticks for link in record.deliveries)
    record = journal.records[k]
    rest = tuple(other for other in record.deliveries if other != link)
    change(journal, k, deliveries=rest, dropped=tuple(sorted((*record.dropped, (*link, "path-loss")))))
    assert {"radio", "path loss"} <= set(failures((world, journal)))


@pytest.mark.parametrize("cause", ["path-loss", "model"])
def test_a_loss_by_a_model_that_the_scenario_does_not_have_is_no_explanation(run: Run, cause: str) -> None:
    world, journal = run()
    record = journal.records[3]
    link = next(iter(record.deliveries))
    rest = tuple(other for other in record.deliveries if other != link)
    change(journal, 3, deliveries=rest, dropped=((*link, cause),))
    found = failures((world, journal))
    assert {"radio", "drops"} <= set(found)
    assert found["drops"].endswith(f"for a cause that does not apply: {cause}")


def test_a_stranger_is_heard_everywhere_and_an_insider_is_not(run: Run) -> None:
    spoof = {"kind": "spoof", "as": "r1", "payload": {"offset": [1.0, 0.0]}}
    result = run(*({**spoof, "by": by, "id": by} for by in ("stranger", "r2")), radio=RADIO)
    assert failures(result) == {}
    forged = {"stranger": 0, "r2": 0}
    for record in result[1].ticks:
        drops = drops_of(record.dropped)
        for place, fault in enumerate(record.forged):
            of = (drops.source == 0) & (drops.sequence // (MAX_TICKS + 1) == place)
            if of.any():
                forged[fault] += int(np.count_nonzero(drops.cause[of] == drops.causes.index("path-loss")))
    assert forged["stranger"] == 0
    assert forged["r2"] > 20
