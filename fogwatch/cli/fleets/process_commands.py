"""``fogwatch agent`` and ``fogwatch robot-sim``: processes whose command lines are read where they run."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import typer

from fogwatch.cli.bad_arguments import HelpfulCommand
from fogwatch.cli.command_help import START, OrderedGroup, command

AGENT_EXAMPLES = [
    "fogwatch agent --robot ros2 --namespace robot1 --map map.yaml --connect tcp/192.168.1.20:7447",
    "fogwatch agent --robot ros2 --help",
    "fogwatch agent --credentials yards-1/r1 --scenario yards.yaml",
]
AGENT_CODES = "0 the run is over, 1 the robot failed, 2 bad input, 130 interrupted"
SIM_EXAMPLES = [
    "fogwatch robot-sim --map map.yaml --connect tcp/127.0.0.1:7447 --robots robot1",
    "fogwatch robot-sim --list-options",
]
SIM_CODES = "0 the time is over, 2 bad input, 130 interrupted"


class PassedOn(HelpfulCommand):
    """A command that passes its words on. Its own help is shown where ``--help`` is the only word."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Leave all words but a lone ``--help`` alone.

        Args:
            ctx: The context of the call, which keeps them.
            args: The words.

        Returns:
            No word that is left to parse.
        """
        if args == ["--help"]:
            return super().parse_args(ctx, args)
        ctx.args = list(args)
        return []


def agent(ctx: typer.Context) -> int:
    """Run one robot of a fleet: a ROS 2 robot with --robot ros2, otherwise one that a world simulates.

    For a ROS 2 robot, no scenario is needed, and no ROS on this machine: see fogwatch agent --robot ros2 --help. The
    options of a simulated robot are those of python -m agent --help.
    """
    from agent.process import main

    return _code(main, ctx.args)


def robot_sim(ctx: typer.Context) -> int:
    """Simulate ROS 2 robots on a Zenoh router, to try an agent without a robot.

    They have odometry with noise, drift and delay, a localisation, a watchdog, and Nav2 on request. All options are
    listed by fogwatch robot-sim --list-options.
    """
    from worldsim.ros2.process import main

    words = ["--help"] if ctx.args == ["--list-options"] else ctx.args
    return _code(main, words)


def register(app: typer.Typer, panel: str) -> None:
    """Add the commands.

    Args:
        app: The group that they belong to.
        panel: The panel that the group's help lists them in.
    """
    command(app, examples=AGENT_EXAMPLES, exit_codes=AGENT_CODES, panel=panel, kind=PassedOn)(agent)
    command(app, "robot-sim", examples=SIM_EXAMPLES, exit_codes=SIM_CODES, panel=panel, kind=PassedOn)(robot_sim)


def only_these() -> typer.Typer:
    """The command `fogwatch` with no commands but these, which quickly begins."""
    app = typer.Typer(cls=OrderedGroup, add_completion=False, pretty_exceptions_enable=False)
    register(app, START)
    return app


def _code(main: Callable[[Sequence[str]], int], words: Sequence[str]) -> int:
    """The exit code of a process's main function; argparse ends the process on help and on usage errors."""
    try:
        return main(words)
    except SystemExit as asked:
        return asked.code if isinstance(asked.code, int) else 0
