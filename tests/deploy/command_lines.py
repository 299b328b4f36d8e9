"""What the command lines in deploy/ say, as the programs that they start read them."""

from __future__ import annotations

from argparse import Namespace
from collections.abc import Callable, Sequence
from pathlib import Path

import agent.process
import fogwatch.router
import monitor.process
from agent.robots.ros2.options import options_of, wanted
from worldsim.options import WorldOptions, parse_options

DEPLOY = Path(__file__).parents[2] / "deploy"
Options = Namespace | WorldOptions
READERS: dict[str, Callable[[Sequence[str]], Options]] = {
    "agent": lambda words: (options_of if wanted(words) else agent.process.simulated_parser().parse_args)(words),
    "fogwatch.router": fogwatch.router._options,
    "monitor": monitor.process._options,
    "worldsim": parse_options,
}


def options_in(words: Sequence[str]) -> tuple[str, Options]:
    """The module that a command line starts, and the options that it is given.

    Args:
        words: Of the command line, from `-m` on.
    """
    flag, module, *rest = words
    assert flag == "-m"
    return module, READERS[module](rest)
