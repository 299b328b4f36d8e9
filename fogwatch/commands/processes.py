"""``fogwatch agent``, ``router`` and ``robot-sim``: processes whose command lines are read where they run.

A robot's small computer loads these commands alone, so this module stands on nothing that the others load.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from importlib import import_module
from typing import Any

import typer

from fogwatch.cli.bad_arguments import HelpfulCommand
from fogwatch.cli.command_help import command


class PassedOn(HelpfulCommand):
    """A command that passes its words on. Where ``--help`` is the only word, it lists the options of all its robots."""

    listed: Callable[[], str]
    """Return the options that the words may hold, with their explanations."""

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


def _agent_options() -> str:
    """List the options of ROS 2 robots, then those of simulated ones."""
    from agent.process import simulated_parser
    from ros2.robot.options import ros2_parser

    ros2, simulated = ros2_parser().list_options(), simulated_parser().list_options()
    return f"For --robot ros2 or rclpy, of ROS 2:\n\n{ros2}\nFor a robot that a world simulates:\n\n{simulated}"


@command(
    examples=[
        "fogwatch agent --robot ros2 --namespace robot1 --map map.yaml --connect tcp/192.168.1.20:7447",
        "fogwatch agent --robot ros2 --help",
        "fogwatch agent --credentials yards-1/r1 --scenario yards.yaml",
    ],
    exit_codes="0 the run is over, 1 the robot failed, 2 bad input, 130 interrupted",
    kind=PassedOn,
    listed=_agent_options,
)
def agent(ctx: typer.Context) -> int:
    """Run one robot of a fleet: a ROS 2 robot with --robot ros2, otherwise one that a world simulates.

    For a ROS 2 robot, no scenario is needed, and no ROS on this machine.
    """
    from agent.process import main as drive_simulated
    from ros2.robot import is_for_ros2
    from ros2.robot import main as drive_ros2

    return _exit_code_of(drive_ros2 if is_for_ros2(ctx.args) else drive_simulated, ctx.args)


@command(
    examples=["fogwatch router --fleet yards-1/router", "fogwatch router"],
    exit_codes="0 it was asked to stop, 2 bad input, or the port is taken",
    kind=PassedOn,
    listed=lambda: import_module("fogwatch.router").router_parser().list_options(),
)
def router(ctx: typer.Context) -> int:
    """Forward messages between the processes of a fleet that does not meet directly.

    All of them must reach it. With --fleet it lets in only the fleet's members. Without it everybody may do everything,
    on this machine alone.
    """
    from fogwatch.router import main

    return _exit_code_of(main, ctx.args)


@command(
    examples=["fogwatch robot-sim --map map.yaml --connect tcp/127.0.0.1:7447 --robots robot1"],
    exit_codes="0 the time is over, 2 bad input, 130 interrupted",
    kind=PassedOn,
    listed=lambda: import_module("ros2.sim.options").parser().list_options(),
)
def robot_sim(ctx: typer.Context) -> int:
    """Simulate ROS 2 robots on a Zenoh router, to try an agent without a robot.

    They have odometry with noise, drift and delay, a localisation, a watchdog, and Nav2 on request.
    """
    from ros2.sim.process import main

    return _exit_code_of(main, ctx.args)


def _exit_code_of(main: Callable[[Sequence[str]], int], words: Sequence[str]) -> int:
    """Return the exit code of a process's main function; argparse ends the process on help and on usage errors."""
    try:
        return main(words)
    except SystemExit as asked:
        return asked.code if isinstance(asked.code, int) else 0
