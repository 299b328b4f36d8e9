"""``fogwatch doctor``: what there is of a ROS 2 robot on its Zenoh router. Raises BadInput; the caller prints it."""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from fogwatch.cli.columns import aligned
from fogwatch.cli.command_help import command
from fogwatch.cli.options import option
from fogwatch.commands.fleet import LISTEN_S, Seconds
from patrol.errors import BadInput

if TYPE_CHECKING:
    from ros2.doctor import Examined

UNFIT = 1
WAIT_S = 10.0


@command(
    examples=[
        "fogwatch doctor --connect tcp/192.168.1.20:7447 --namespace robot1",
        "fogwatch doctor --connect tls/robot-1:7448 --credentials yards-1/r1 --namespace robot1 --json",
    ],
    exit_codes="0 a patrol could start, 1 something that it needs is missing, 2 bad input or no router",
)
def doctor(
    connect: Annotated[str, option("LOCATOR", "The robot's Zenoh router, tcp/HOST:7447.")],
    namespace: Annotated[str, option("NAME", "The robot's namespace (default: none).")] = "",
    domain: Annotated[int | None, option("N", "The robot's ROS_DOMAIN_ID (default: of the environment, or 0).")] = None,
    credentials: Annotated[
        Path | None, option("PATH", "A robot's credentials, where its router asks for them.")
    ] = None,
    topic: Annotated[
        list[str] | None, option("NAME=TOPIC", "Another name of a topic, as for the agent: odom=odometry/filtered.")
    ] = None,
    localisation: Annotated[str, option("tf|pose|odometry", "What corrects the odometry, as for the agent.")] = "tf",
    map_frame: Annotated[str, option("NAME", "The map's frame.")] = "map",
    use_sim_time: Annotated[
        bool, option("", "The robot's time is on /clock: it is simulated.", "--use-sim-time")
    ] = False,
    seconds: Seconds = LISTEN_S,
    wait: Annotated[float, option("S", "How long to wait for the router, in s.")] = WAIT_S,
    as_json: Annotated[bool, option("", "Print JSON.", "--json")] = False,
) -> int:
    """Say what there is of a ROS 2 robot on its Zenoh router, what is missing for a patrol, and what to do about it.

    It needs no ROS, finds out whether the robot speaks rmw_zenoh or zenoh-bridge-ros2dds, and sends nothing to it.
    """
    from ros2.doctor import examine, survey
    from ros2.robot.localisation import LocalisationSettings, Source
    from ros2.robot.options import DriveSettings, topics_given
    from ros2.wire.formats import RmwZenoh
    from ros2.wire.link import open_ros2
    from ros2.wire.names import NodeName, check_name, domain_given
    from runtime.net.link import LinkDown
    from runtime.security.credentials import read_credentials
    from runtime.security.keys import check_locator

    check_locator(connect, "--connect")
    check_name(namespace, "--namespace")
    number = domain_given(domain)
    if localisation not in (sources := [source.value for source in Source]):
        raise BadInput(f"--localisation {localisation}: unknown; give {', '.join(sources)}")
    settings = LocalisationSettings(Source(localisation), map_frame)
    wanted = DriveSettings(localisation=settings, sim_time=use_sim_time, topics=topics_given(topic or ()))
    member = None if credentials is None else read_credentials(credentials, "--credentials")
    node = NodeName("fogwatch_doctor", namespace)
    try:
        link = open_ros2(connect, RmwZenoh(number), node, wait, credentials=member)
    except LinkDown as down:
        raise BadInput(f"--connect: {down}; is the robot's router running?") from None
    try:
        examination = examine(survey(link, number, namespace, wanted, seconds))
    finally:
        link.close()
    facts = {"fit": examination.fit, **asdict(examination)}
    typer.echo(json.dumps(facts, indent=2) if as_json else _as_text(examination, connect))
    return 0 if examination.fit else UNFIT


def _as_text(found: Examined, connect: str) -> str:
    lines = [f"{connect}: {found.speaks or 'no robot'}"]
    if found.topics:
        rows = [("topic", "type", "rate", "bytes", "publish", "obey", "frames")]
        for topic in found.topics:
            rate = f"{topic.rate:.1f}/s" if topic.messages > 1 else str(topic.messages or "-")
            links = str(topic.publishers), str(topic.subscribers), ", ".join(topic.frames)
            rows.append((topic.name, topic.type_name or "?", rate, str(topic.size or "-"), *links))
        lines += aligned(rows)
    for finding in found.findings:
        remedy = f"; {finding.remedy}" if finding.remedy else ""
        lines.append(f"{finding.level:8} {finding.says}{remedy}")
    lines.append("a patrol could start" if found.fit else "a patrol cannot start")
    return "\n".join(lines)
