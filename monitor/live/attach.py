"""Opens the source of a running fleet: its world's feed or, without a world, its robots' positions."""

from __future__ import annotations

import time
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from monitor.live.feed_client import FeedClient
from patrol.errors import BadInput, Malformed
from patrol.files.untrusted import leads_out
from runtime.messages.feed import SoFar, read_so_far
from runtime.net.link import Link
from runtime.net.open_links import open_links
from runtime.process.options import Meeting, meeting
from runtime.reporting.logs import Log
from runtime.security.access import FILE, read_access
from runtime.security.credentials import MEMBER
from runtime.security.keys import callers_of, check_radio, fleet_keys
from runtime.security.roles import Kind

if TYPE_CHECKING:
    from monitor.observation.source import Source
    from patrol.scenario import Scenario
    from runtime.process.lifeline import Ending

SCENARIO = "scenario.yaml"
"""Name of the scenario's file in a run's folder."""

_LOG = Log("monitor")

POLL_S = 0.2
"""Wall time between two requests for the state so far, s."""


class NoAnswer(BadInput):
    """A world is there and does not answer yet; `waits` says what is known of it."""

    def __init__(self, fleet: str, waits: str) -> None:
        self.waits = waits
        super().__init__(f"--fleet {fleet}: {waits}")


def open_fleet(
    ending: Ending,
    *,
    access: Path | None = None,
    credentials: Path | None = None,
    router: str | None = None,
    fleet: str | None = None,
    scenario: Path | None = None,
    radio: str | None = None,
    key: Path | None = None,
    wait_s: float = 60.0,
) -> Source | None:
    """Connect to a running fleet; return None when asked to end before there is a source.

    `access` is a run's folder, its control file or an operator's credentials, which give the right to control the
    fleet; `credentials` are a viewer's or an operator's, where there is no `access`. `router` and `fleet` are needed
    where neither names them. `scenario` is for robots without a world, of which only the positions are listened to, on
    `radio` or, if that is None, the router. `key` is the file of the fleet's key, where there is a world; without it
    the tags of messages stay unchecked.
    """
    from runtime.security.private_files import fleet_key

    if key is not None and scenario is not None:
        raise BadInput(f"--key {key}: the scenario of robots without a world names their key; leave the option out")
    if radio is not None and scenario is None:
        raise BadInput(f"--radio {radio}: applies only to robots without a world; give their --scenario FILE as well")
    answer = find_fleet(ending, access, credentials, router, fleet, wait_s)
    if answer is None:
        return None
    met, token = answer
    if scenario is None:
        own_scenario = None if access is None else _own_scenario(access)
        return _of_a_world(met, token, wait_s, ending, own_scenario, fleet_key(key))
    return _of_robots(met, scenario, radio, wait_s, ending)


def find_fleet(
    ending: Ending,
    access: Path | None,
    credentials: Path | None,
    router: str | None,
    fleet: str | None,
    wait_s: float,
    *,
    shown: str = "--access",
) -> tuple[Meeting, str | None] | None:
    """Return where a running fleet meets, without connecting to it, and the token to control it.

    The token is None without the right to control. None is returned when asked to end meanwhile. `wait_s` is how long
    to wait for the file `access`, and `shown` what errors call that argument; the others are as for `open_fleet`.
    """
    if access is None:
        return meeting(credentials, router, fleet, Kind.VIEWER, Kind.OPERATOR), None
    file = access / FILE if access.is_dir() and not (access / MEMBER).exists() else access
    if not ending.wait_for(file, wait_s):
        if ending:
            return None
        raise BadInput(f"{shown} {access}: no such file; a run's {FILE} is removed when the run is over")
    control = read_access(file, shown)
    return Meeting(control.router, fleet_keys(control.fleet), control.credentials), control.token


def _own_scenario(access: Path) -> Scenario | None:
    """Return the scenario beside a control file, which the fleet's launcher has put there; None without one.

    No file that the scenario names is opened: the folder may be a stranger's.
    """
    from patrol.scenario import load_scenario

    folder = access if access.is_dir() else access.parent
    file = folder / SCENARIO
    if leads_out(folder, file):
        raise BadInput(f"{file}: is a link that leads out of the run's folder; put the file itself there")
    return load_scenario(file, opens_classes=False) if file.is_file() else None


def _of_a_world(
    met: Meeting, token: str | None, wait_s: float, ending: Ending, own: Scenario | None, key: bytes | None
) -> Source | None:
    from monitor.live.feed_source import FeedSource

    links = open_links(met.router, None, wait_s, _LOG.info, lambda: bool(ending), met.credentials)
    if links is None:
        return None
    link: Link = links[0]
    client = FeedClient(link, met.keys, token)
    try:
        so_far = _first_answer(client, met, wait_s, ending, own)
        source = None if so_far is None else FeedSource(met.keys.fleet, client, so_far, key=key)
    # Also an interrupt: a link that stays open keeps its thread, and the process.
    except BaseException:
        link.close()
        raise
    if source is None:
        link.close()
    return source


def _first_answer(
    client: FeedClient, met: Meeting, wait_s: float, ending: Ending, own: Scenario | None
) -> SoFar | None:
    """Request the state of the run so far until the world answers; return None when asked to end.

    The answer must be of a run of the scenario `own`, or of any run if that is None.
    """
    from monitor.live.record_checks import is_run_of

    fleet, until = met.keys.fleet, time.monotonic() + wait_s
    while not ending:
        wrong: Malformed | None = None
        for payload in client.so_far():
            try:
                return read_so_far(payload, fits=partial(is_run_of, own))
            except Malformed as malformed:
                wrong = malformed
        if wrong is not None:
            raise BadInput(f"--fleet {fleet}: its world runs another version ({wrong}); use one version on all hosts")
        if time.monotonic() >= until:
            client.batch(0.0)  # learns whether the world is there
            if client.present:
                raise NoAnswer(fleet, client.waits or "the world is there, and gives no answer")
            if own is not None:  # an operator's credentials may be those of robots without a world
                raise BadInput(
                    f"the run {fleet}: its world does not answer at {met.meets_at}; if it has just been started, "
                    "look again; otherwise its logs say what happened"
                )
            revoked = ", or these credentials were revoked" if met.revocable else ""
            raise BadInput(
                f"--fleet {fleet}: no world of this fleet answers at {met.meets_at}{revoked}; check both, or give "
                "--scenario FILE for robots without a world"
            )
        ending.wait(POLL_S)
    return None


def _of_robots(met: Meeting, scenario: Path, radio: str | None, wait_s: float, ending: Ending) -> Source | None:
    from monitor.live.positions_source import PositionsSource
    from patrol.prepare import prepare
    from patrol.scenario import load_scenario, naming

    loaded = load_scenario(scenario)
    on_air = check_radio(radio, "--radio", loaded.radio.via)
    callers = callers_of(met.keys, {spec.name: spec.number for spec in loaded.roster})
    links = open_links(met.router, on_air, wait_s, _LOG.info, lambda: bool(ending), met.credentials, callers)
    if links is None:
        return None
    may_stop = met.credentials is None or met.credentials.role.kind is Kind.OPERATOR
    with naming(scenario):
        prepared = prepare(loaded)
    return PositionsSource(met.keys, prepared, *links, may_stop=may_stop)
