"""The command lines in deploy/, as the programs that they start read them."""

from argparse import Namespace
from collections.abc import Callable, Sequence
from pathlib import Path

import agent.process
import fogwatch.router
import monitor.process
from ros2.robot.options import options_of
from worldsim.process import world_parser

DEPLOY = Path(__file__).parents[2] / "deploy"
READERS: dict[str, Callable[[Sequence[str]], Namespace]] = {
    "agent": agent.process.simulated_parser().parse_args,
    "ros2.robot": options_of,
    "fogwatch.router": fogwatch.router.router_parser().parse_args,
    "monitor": monitor.process.page_parser().parse_args,
    "worldsim": world_parser().parse_args,
}


def options_in(words: Sequence[str]) -> tuple[str, Namespace]:
    """The module that a command line starts, and the options that it is given.

    Args:
        words: Of the command line, from `-m` on.
    """
    flag, module, *rest = words
    assert flag == "-m"
    return module, READERS[module](rest)
