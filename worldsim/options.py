"""The command line of the world's process."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from patrol.process.deadline import ANSWER_S
from patrol.process.options import TOGETHER, fleet_parser
from patrol.process.reporting.supervision import Supervision, take_supervision

_EPILOG = f"""
The world of a fleet whose router and robots run elsewhere. {TOGETHER}

The run begins when all robots of the scenario are there. The folder gets the journal and ticks.csv; without a launcher
also summary.json and scenario.yaml with a copy of its map, for `fogwatch report`, `replay` and `record`.
Exit codes: 0 verdict valid, 1 invalid, 2 bad input, 3 unknown (it could not be judged), 130 interrupted.
"""


@dataclass(frozen=True, slots=True)
class WorldOptions:
    """What the command line says.

    Attributes:
        credentials: The world's credentials, or None.
        router: Address of the router, as given; None for that of the credentials.
        fleet: The fleet's name; None for that of the credentials.
        scenario: The scenario's file.
        radio: Where robots hear each other directly, or None.
        static: Folder in which the launcher puts the static fields, or None to compute them here.
        wait: How long to wait for the router and the robots, s.
        lifeline: File descriptor of the launcher's pipe; None for a world started by hand.
        out: The run's folder.
        deadline: In lockstep, wall time for an answer, s.
        control: File with the token of operators who may control the run; None for that of the credentials, if any.
        process_control: File descriptor of the socket to the launcher that kills, pauses and starts processes, or None.
        supervision: How the process is followed.
    """

    credentials: Path | None
    router: str | None
    fleet: str | None
    scenario: Path
    radio: str | None
    static: Path | None
    wait: float
    lifeline: int | None
    out: Path
    deadline: float
    control: Path | None
    process_control: int | None
    supervision: Supervision

    @property
    def launched(self) -> bool:
        """Whether a launcher has started this process; then it keeps the scenario and judges the run."""
        return self.lifeline is not None


def parse_options(arguments: Sequence[str] | None) -> WorldOptions:
    """Parse the command line; ends the process on ``--help`` and on usage errors.

    Args:
        arguments: The command line's words, None for those of this process.

    Returns:
        The options.

    Raises:
        BadInput: An option does not fit.
    """
    parser = fleet_parser("worldsim", "The world of a simulated fleet, as a process.", _EPILOG, "router and robots")
    add = parser.add_argument
    add("--out", required=True, type=Path, metavar="DIR", help="folder for the journal and ticks.csv")
    add(
        "--deadline",
        type=float,
        default=ANSWER_S,
        metavar="S",
        help="lockstep: wall time for an answer (%(default)g s)",
    )
    add(
        "--control",
        type=Path,
        metavar="FILE",
        help="obey operators who have the token in this file (default: the credentials')",
    )
    add(
        "--process-control",
        type=int,
        metavar="FD",
        help="socket on which to ask for kills, pauses and starts (set by the launcher)",
    )
    told = parser.parse_args(arguments)
    supervision = take_supervision(told)
    return WorldOptions(**vars(told), supervision=supervision)
