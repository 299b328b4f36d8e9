"""The verdict's check of keep-outs."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
import yaml
from PIL import Image

from worldsim.verdict.judge import judge

if TYPE_CHECKING:
    from tests.worldsim.conftest import Lab

DISC = {"model": "holonomic", "radius": 0.4}
STAIRS = [[16.0, 10.0], [18.0, 10.0], [18.0, 13.0], [16.0, 13.0]]


def mask_of_stairs(folder: Path) -> str:
    """The rectangle of `STAIRS` as the black pixels of a mask, 1 m each."""
    shades = np.full((15, 20), 255, dtype=np.uint8)
    shades[2:5, 16:18] = 0
    Image.fromarray(shades).save(folder / "mask.pgm")
    facts = {"image": "mask.pgm", "resolution": 1.0, "origin": [0.0, 0.0, 0.0], "negate": 0}
    facts |= {"occupied_thresh": 0.65, "free_thresh": 0.25}
    (folder / "mask.yaml").write_text(yaml.safe_dump(facts), encoding="utf-8")
    return str(folder / "mask.yaml")


@pytest.mark.parametrize("kind", ["polygon", "mask"])
@pytest.mark.parametrize(("x", "caught"), [(16.1, True), (17.9, True), (15.9, False), (18.1, False)])
def test_a_centre_in_a_keep_out_is_caught(lab: Lab, kind: str, x: float, caught: bool, tmp_path: Path) -> None:
    zone: dict[str, Any] = {"name": "stairs", "keep_out": True}
    zone |= {"mask": mask_of_stairs(tmp_path)} if kind == "mask" else {"polygon": STAIRS}
    world = lab.world([DISC], [(3.0, 3.0, 0.0)], duration=4.0, zones=[zone])
    journal = lab.run(world)
    assert "keep-outs" in {check.name for check in judge(journal, {}, world.prepared).checks}
    record = journal.records[3]
    journal.records[3] = replace(record, robots=(replace(record.robots[0], x=x, y=11.5),))
    failed = {check.name: check.detail for check in judge(journal, {}, world.prepared).failed}
    assert ("keep-outs" in failed) == caught
    if caught:
        assert failed["keep-outs"].startswith(f"r1 is in stairs at tick 3, at ({x:.3f}, 11.500)")


def test_without_keep_outs_there_is_no_such_check(lab: Lab) -> None:
    world = lab.world([DISC], [(3.0, 3.0, 0.0)], duration=2.0)
    assert "keep-outs" not in {check.name for check in judge(lab.run(world), {}, world.prepared).checks}
