"""``fogwatch agent``, ``router`` and ``robot-sim``: processes whose command lines are read where they run."""

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
ROUTER_EXAMPLES = [
    "fogwatch router --fleet yards-1/router",
    "fogwatch router",
]
ROUTER_CODES = "0 it was asked to stop, 2 bad input, or the port is taken"
SIM_EXAMPLES = [
    "fogwatch robot-sim --map map.yaml --connect tcp/127.0.0.1:7447 --robots robot1",
]
SIM_CODES = "0 the time is over, 2 bad input, 130 interrupted"


class PassedOn(HelpfulCommand):
    """A command that passes its words on. Where ``--help`` is the only word, it lists the options of all its robots."""

    listed: Callable[[], str]
    """The options that the words may hold, with their explanations."""

    def format_help(self, ctx: Any, formatter: Any) -> None:
        """Show the command's help, and the options of what it passes its words on to."""
        super().format_help(ctx, formatter)
        typer.echo(type(self).listed())

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Leave all words but a lone ``--help`` alone: the context keeps them, and none is left to parse."""
        if args == ["--help"]:
            return super().parse_args(ctx, args)
        ctx.args = list(args)
        return []


class AgentCommand(PassedOn):
    """`fogwatch agent`."""

    @staticmethod
    def listed() -> str:
        """The options of ROS 2 robots, then those of simulated ones."""
        from agent.process import simulated_parser
        from ros2.robot.options import ros2_parser

        ros2, simulated = ros2_parser().list_options(), simulated_parser().list_options()
        return f"For --robot ros2 or rclpy, of ROS 2:\n\n{ros2}\nFor a robot that a world simulates:\n\n{simulated}"


class RouterCommand(PassedOn):
    """`fogwatch router`."""

    @staticmethod
    def listed() -> str:
        """The options of the router."""
        from fogwatch.router import router_parser

        return router_parser().list_options()


class RobotSimCommand(PassedOn):
    """`fogwatch robot-sim`."""

    @staticmethod
    def listed() -> str:
        """The options of simulated ROS 2 robots."""
        from ros2.sim.options import parser

        return parser().list_options()


def agent(ctx: typer.Context) -> int:
    """Run one robot of a fleet: a ROS 2 robot with --robot ros2, otherwise one that a world simulates.

    For a ROS 2 robot, no scenario is needed, and no ROS on this machine.
    """
    from agent.process import main

    return _code(main, ctx.args)


def router(ctx: typer.Context) -> int:
    """Forward messages between the processes of a fleet that does not meet directly.

    All of them must reach it. With --fleet it lets in only the fleet's members. Without it everybody may do everything,
    on this machine alone.
    """
    from fogwatch.router import main

    return _code(main, ctx.args)


def robot_sim(ctx: typer.Context) -> int:
    """Simulate ROS 2 robots on a Zenoh router, to try an agent without a robot.

    They have odometry with noise, drift and delay, a localisation, a watchdog, and Nav2 on request.
    """
    from ros2.sim.process import main

    return _code(main, ctx.args)


def register(app: typer.Typer, panel: str) -> None:
    """Add the commands."""
    command(app, examples=AGENT_EXAMPLES, exit_codes=AGENT_CODES, panel=panel, kind=AgentCommand)(agent)
    command(app, examples=ROUTER_EXAMPLES, exit_codes=ROUTER_CODES, panel=panel, kind=RouterCommand)(router)
    command(app, "robot-sim", examples=SIM_EXAMPLES, exit_codes=SIM_CODES, panel=panel, kind=RobotSimCommand)(robot_sim)


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
