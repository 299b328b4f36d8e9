"""The conditions of the benchmark: faults by name.

`none`, `loss-P` (P % of all frames), `silence`, `deaths` (two robots), `spoof` (forged positions of a robot) and
`jitter-P` (speeds up to P % lower or higher than commanded), or several at once, as in ``loss-90+deaths``.
"""

from __future__ import annotations

import re
from typing import Any

from patrol.errors import BadInput, did_you_mean

NONE, DEATHS = "none", "deaths"
ALL = (NONE, "loss-50", "loss-90", "silence", DEATHS, "spoof", "jitter-20")
"""All conditions, with examples of `loss-P` and `jitter-P`."""

MOST = {"loss-": 100, "jitter-": 99}
"""The most % of a condition, by its prefix; a robot that jitters by 100 % could stand still."""

DEATHS_S = (300.0, 1100.0)
"""When the robots r1 and r2 die in a run of `DEATHS_OF_S` or more, s; in a shorter run earlier, in proportion."""

DEATHS_OF_S = 1800.0

JITTER_S = 5.0
"""How long a jittered speed holds, s: about a leg between two vertices."""

Faults = list[dict[str, Any]]


def check_condition(name: str) -> None:
    """Refuse a name that is no condition."""
    parts = name.split("+")
    for part in parts:
        if _part_faults(part, DEATHS_OF_S) is None:
            prefix = next((prefix for prefix in MOST if part.startswith(prefix)), None)
            hint = f"no such condition; {did_you_mean(part, ALL)}, or join several, as in loss-90+deaths"
            wrong = hint if prefix is None else f"expected {prefix}1 to {prefix}{MOST[prefix]}, in whole %"
            raise BadInput(f"--conditions {name}: {part}: {wrong}")
    if len(set(parts)) < len(parts) or (NONE in parts and len(parts) > 1):
        raise BadInput(f"--conditions {name}: these do not go together; name each fault once, and none alone")


def least_team(name: str) -> int:
    """Return the smallest team that a condition makes sense for."""
    return max(3 if part == DEATHS else 1 if part == NONE or "jitter" in part else 2 for part in name.split("+"))


def faults_of(name: str, duration_s: float) -> Faults:
    """Return a condition's faults, as in a scenario."""
    return [fault for part in name.split("+") for fault in _part_faults(part, duration_s) or []]


def _part_faults(part: str, duration_s: float) -> Faults | None:
    """Return the faults of one part of a condition; None if there is no such condition."""
    if match := re.fullmatch("(loss-|jitter-)([1-9][0-9]{,2})", part):
        share = int(match[2]) / 100.0
        if int(match[2]) > MOST[match[1]]:
            return None
        if match[1] == "loss-":
            return [{"kind": "loss", "rate": share}]
        return [{"kind": "motion", "who": "all", "jitter": {"size": share, "every": JITTER_S}}]
    earlier = min(duration_s / DEATHS_OF_S, 1.0)
    faults: dict[str, Faults] = {
        NONE: [],
        "silence": [{"kind": "silence", "who": "all"}],
        "spoof": [{"kind": "spoof", "as": "r1", "payload": "random"}],
        DEATHS: [
            {"kind": "kill", "who": f"r{number}", "at": round(at_s * earlier, 3), "wreck": "removed"}
            for number, at_s in enumerate(DEATHS_S, start=1)
        ],
    }
    return faults.get(part)
