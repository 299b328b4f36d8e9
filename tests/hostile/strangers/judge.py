"""The verdict on a fleet that a stranger has attacked: the facts of a spell, and the faults in them."""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from tests.hostile.strangers.door import LET_IN
from tests.hostile.strangers.member import ASKED, OVERHEARD
from tests.hostile.strangers.spell import Holds, Spell
from tests.hostile.strangers.watch import MOST_GROWTH_MB
from worldsim.run_record import COMPLETED

BEGUN = "attacks"
"""The count of the attacks that a stranger has begun."""

NOT_FOR_STRANGERS = (LET_IN, OVERHEARD, ASKED)
"""Counts of the stranger's that have to stay 0."""


@dataclass(frozen=True, slots=True)
class Seen:
    """The facts of a spell.

    Attributes:
        ended: Why the run ended, as in its journal; what went wrong instead, where it has none.
        outcome: The verdict's; empty without one.
        failed: Details of the verdict's failed checks, by name.
        trace: The trace hash.
        honest: The trace hash of the same scenario without a stranger; empty where it cannot be compared.
        restarts: Lines about processes that died and were started again.
        crashes: Names of logs with a traceback.
        growth_mb: The most memory that each process took beyond what it had when the stranger began, MB.
        counts: What the stranger did, and what came of it.
        ticks: Ticks done.
        longest_s: The longest wall time between two ticks, s.
        stranger: What the stranger itself said when it could not go on; empty where it could.
    """

    ended: str
    outcome: str = ""
    failed: Mapping[str, str] = field(default_factory=dict)
    trace: str = ""
    honest: str = ""
    restarts: Sequence[str] = ()
    crashes: Sequence[str] = ()
    growth_mb: Mapping[str, float] = field(default_factory=dict)
    counts: Mapping[str, int] = field(default_factory=Counter)
    ticks: int = 0
    longest_s: float = 0.0
    stranger: str = ""


def problems(spell: Spell, seen: Seen) -> list[str]:
    """List the faults, one line each; nothing where the fleet has held out.

    A stranger with no secret, or with a viewer's credentials, changes nothing: the verdict is valid, and in lockstep
    the trace is that of the run without it. One with a robot's credentials may speak for that robot. Then the verdict
    is valid, or names the robot and no other.
    """
    found = []
    if seen.stranger:
        found.append(f"the stranger could not attack: {seen.stranger}")
    elif not seen.counts.get(BEGUN, 0):
        found.append("the stranger has not attacked")
    if seen.ended != COMPLETED:
        found.append(f"the run did not complete: {seen.ended}")
    found += [f"{what}: {seen.counts[what]} times" for what in NOT_FOR_STRANGERS if seen.counts.get(what, 0)]
    own = spell.holds is Holds.ROBOT
    blamed = [name for name, detail in seen.failed.items() if own and _names_only(detail, spell)]
    found += [f"verdict: {name}: {detail}" for name, detail in seen.failed.items() if name not in blamed]
    if seen.outcome not in ("valid", "invalid" if blamed else "valid", ""):
        found.append(f"the verdict is {seen.outcome}")
    if not own and seen.outcome == "valid" and seen.honest and seen.trace != seen.honest:
        found.append("the verdict is valid, but the trace is not that of the run without the stranger")
    found += [f"a process died: {line}" for line in seen.restarts]
    found += [f"a traceback in the log {name}" for name in seen.crashes]
    grown = {name: mb for name, mb in seen.growth_mb.items() if mb > MOST_GROWTH_MB}
    found += [f"{name} took {mb:.0f} MB more than before the stranger came" for name, mb in grown.items()]
    return found


def _names_only(detail: str, spell: Spell) -> bool:
    """Return True if a check's detail names the stranger's robot and no other."""
    words = set(detail.replace(":", " ").replace(",", " ").replace(";", " ").split())
    others = {robot.name for robot in spell.scenario.roster} - {spell.victim}
    return spell.victim in words and not others & words
