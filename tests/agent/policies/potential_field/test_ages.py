"""Ground that counts for nothing exerts no force: the table of forces ends with the age of the stalest point."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from agent.kernels.force import gather
from agent.policies import potential_field
from fogwatch.inprocess import run_in_process
from patrol.scenario import load_scenario

GRAPH = {"vertices": [[2.5, 3.0], [5.5, 1.5], [8.5, 4.0]], "edges": [[0, 1, 4], [1, 2, 4]]}
VERTICES: dict[str, Any] = {"terrain": {"graph": GRAPH, "patrolled": "vertices"}, "sensor": {"range": 20}}


@pytest.mark.parametrize("dilatation", [0.0, 5.0])
@pytest.mark.parametrize("paths", ["straight", "wave", "regions"])
def test_no_point_that_pulls_is_older_than_the_stalest(
    paths: str, dilatation: float, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    oldest = []

    def checked(posts: Any, state: Any, length: Any, bend: Any, first: int, last: int, *rest: Any) -> None:
        _, _, _, _, _, row0, col0, seen, _, tick, pull = rest[:11]
        rows, cols = np.nonzero((state & 3 == 3) & (length > first) & (length <= last))
        ticks = seen[rows + row0, cols + col0] if posts is None else seen[posts[:, 0], posts[:, 1]]
        ages = tick - np.maximum(ticks[ticks <= tick], 0)
        oldest.append(int(ages.max(initial=0)))
        assert oldest[-1] < pull.size
        gather(posts, state, length, bend, first, last, *rest)

    monkeypatch.setattr(potential_field, "gather", checked)
    patrol = {"policy": "potential-field", "options": {"paths": paths, "dilatation": dilatation, "distance": "g1"}}
    Image.fromarray(np.full((12, 26), 254, dtype=np.uint8)).save(tmp_path / "m.png")
    facts = "image: m.png\nresolution: 0.5\norigin: [0, 0, 0]\nnegate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.196\n"
    (tmp_path / "m.yaml").write_text(facts)
    robots = {"count": 1, "model": "holonomic", "radius": 0.2, "speed": 1.0}
    given = {"point": 0.5, "duration": 100, "robots": robots, "patrol": patrol, **VERTICES}
    given["terrain"] = {**VERTICES["terrain"], "map": str(tmp_path / "m.yaml")}
    outcome = run_in_process(load_scenario(given))
    assert outcome.verdict.valid, outcome.verdict.failed
    assert oldest
