"""A source over a fleet that is running: from its world's feed, or from what its robots say where there is no world."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING

from monitor.live.wire import FeedWire, first_answer
from patrol.errors import BadInput
from patrol.net.access import FILE, read_access
from patrol.net.keys import WORLD, FleetKeys, check_locator, check_radio, fleet_keys, is_local
from patrol.net.link import Link, LinkDown, open_link, open_links

if TYPE_CHECKING:
    from monitor.source import Source
    from patrol.process.lifeline import Ending

POLL_S = 0.2
ANSWER_S = 2.0
"""How long the router of a run that may be over is waited for."""


def goes_on(folder: Path) -> bool:
    """Whether the world of the run in a folder is there now; a launcher that was killed leaves its control file.

    Asked is a router of this machine alone, where a launcher's is: a folder may come from anybody.
    """
    try:
        access = read_access(folder, str(folder))
        if not is_local(access.router):
            return False
        link = open_link(access.router, ANSWER_S)
    except (BadInput, LinkDown):
        return False
    try:
        return link.sees(fleet_keys(access.fleet).alive(WORLD))
    finally:
        link.close()


def open_fleet(
    ending: Ending,
    *,
    access: Path | None = None,
    router: str | None = None,
    fleet: str | None = None,
    scenario: Path | None = None,
    radio: str | None = None,
    wait_s: float = 60.0,
) -> Source | None:
    """Watch a fleet; None when told to end before there was anything to see.

    access: a run's folder or its control file, which gives the right to control it, or else router and fleet, without
    it. scenario: where given, positions alone are listened to, as on a fleet of real robots, which has no world. radio:
    where these robots hear each other. Raises BadInput where nobody is met within wait_s.
    """
    token = None
    if radio is not None and scenario is None:
        raise BadInput(f"--radio {radio}: is for robots without a world; give their --scenario FILE as well")
    if access is not None:
        file = access / FILE if access.is_dir() else access
        if not ending.wait_for(file, wait_s):
            if ending:
                return None
            raise BadInput(f"--access {access}: there is no such file; a run's is gone when the run is over")
        found = read_access(file, "--access")
        router, fleet, token = found.router, found.fleet, found.token
    if router is None or fleet is None:
        raise BadInput("which fleet? give --access RUN, or --router LOCATOR and --fleet NAME")
    router, keys = check_locator(router, "--router"), fleet_keys(fleet)
    if scenario is None:
        return _of_a_world(router, keys, token, wait_s, ending)
    return _of_robots(router, keys, scenario, radio, wait_s, ending)


def _of_a_world(router: str, keys: FleetKeys, token: str | None, wait_s: float, ending: Ending) -> Source | None:
    from monitor.live.feed_source import LiveSource

    links = open_links(router, None, wait_s, _say, lambda: bool(ending))
    if links is None:
        return None
    link: Link = links[0]
    wire = FeedWire(link, keys, token)
    waited = 0.0

    def waits(pause_s: float) -> bool:
        nonlocal waited
        waited += pause_s
        if waited >= wait_s:
            raise BadInput(
                f"--fleet {keys.fleet}: no world of this fleet at {router} tells anything; for robots without a world "
                "give --scenario FILE as well"
            )
        return ending.wait(pause_s)

    try:
        so_far = first_answer(wire, keys.fleet, lambda: bool(ending), waits)
        source = None if so_far is None else LiveSource(keys.fleet, wire, so_far)
    except BaseException:
        link.close()
        raise
    if source is None:
        link.close()
    return source


def _of_robots(
    router: str, keys: FleetKeys, scenario: Path, radio: str | None, wait_s: float, ending: Ending
) -> Source | None:
    from monitor.live.positions_source import EarSource
    from patrol.prepare import prepare
    from patrol.scenario import load_scenario

    loaded = load_scenario(scenario)
    on_air = check_radio(radio, "--radio", loaded.radio.via)
    links = open_links(router, on_air, wait_s, _say, lambda: bool(ending))
    return None if links is None else EarSource(keys, prepare(loaded), *links)


def _say(line: str) -> None:
    print(f"monitor: {line}", file=sys.stderr, flush=True)
