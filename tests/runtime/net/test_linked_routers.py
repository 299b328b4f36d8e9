import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import pytest

import fogwatch.router
from fogwatch.fleets.folder import FleetFolder
from fogwatch.launch.private import Secrets
from runtime.messages.stop_orders import Order, Outcome, StopOrders, ask_robots
from runtime.net.link import Link, open_link, open_router
from runtime.net.mailbox import Mailbox, Presence
from runtime.security.credentials import Credentials, read_credentials, read_router
from runtime.security.keys import WORLD, FleetKeys, fleet_keys
from runtime.security.roles import Kind, Role, robot_role
from tests.routers import PATIENCE_S, await_last, free_endpoint, make_local_fleet, needs_openssl, reach

pytestmark = needs_openssl

TRIES_S = 2.0
"""How long a stranger tries."""
RETURNS = 3
TRY_S = 0.05


def free_tls() -> str:
    return f"tls/{free_endpoint().partition('/')[2]}"


class Sites:
    """Two linked routers of a fleet, and its members, each at the router of its site."""

    def __init__(self, fleet: FleetFolder) -> None:
        self.keys: FleetKeys = fleet_keys(fleet.fleet)
        self.where = (fleet.listen, free_tls())
        self._fleet = fleet
        self._security = read_router(fleet.path, "test")
        self._open: list[Link] = []
        self.first: Link | None = None

    def start_first(self) -> None:
        self.first = self._keep(open_router(self.where[0], self._security))

    def start_second(self) -> None:
        self._keep(open_router(self.where[1], self._security, [self.where[0]]))

    def start_both(self) -> None:
        self.start_first()
        self.start_second()

    @contextmanager
    def process(self, site: int) -> Iterator[None]:
        """A router as a process, which is killed at the end."""
        linked = ["--connect", self.where[0]] if site else []
        command: list[str | Path] = ["-P", "-m", "fogwatch.router", "--fleet", self._fleet.path]
        command += ["--listen", self.where[site], *linked]
        with subprocess.Popen([sys.executable, *command], stdout=subprocess.DEVNULL) as router:
            try:
                yield
            finally:
                router.kill()

    def join(self, role: Role, site: int) -> Link:
        return self._keep(open_link(self.where[site], PATIENCE_S, credentials=self._credentials(role)))

    def close(self) -> None:
        for link in reversed(self._open):
            assert link.close(PATIENCE_S)

    def _credentials(self, role: Role) -> Credentials:
        return read_credentials(self._fleet.path / role.name, "test")

    def _keep(self, link: Link) -> Link:
        self._open.append(link)
        return link


@pytest.fixture(scope="module")
def fleet(tmp_path_factory: pytest.TempPathFactory) -> FleetFolder:
    return make_local_fleet(tmp_path_factory.mktemp("sites") / "f", ("r1", "r2"))


@pytest.fixture
def sites(fleet: FleetFolder) -> Iterator[Sites]:
    sites = Sites(fleet)
    yield sites
    sites.close()


def heard(sender: Link, key: str, receiver: Link) -> bytes:
    """Send under a key until a receiver hears it; return what it hears."""
    mailbox: Mailbox[bytes] = Mailbox([key], bytes, 100)
    receiver.subscribe(key, mailbox)
    return reach(sender.broadcast(key), mailbox)[1]


@pytest.mark.parametrize("first_to_start", [0, 1])
def test_positions_of_both_sites_reach_each_other_whichever_router_starts_first(
    sites: Sites, first_to_start: int
) -> None:
    starts = [sites.start_first, sites.start_second]
    starts[first_to_start]()
    starts[1 - first_to_start]()
    r1, r2 = sites.join(robot_role("r1"), 0), sites.join(robot_role("r2"), 1)
    assert heard(r1, sites.keys.position("r1"), r2) == b"here"
    assert heard(r2, sites.keys.position("r2"), r1) == b"here"


def test_a_world_sees_who_is_alive_at_the_other_site(sites: Sites) -> None:
    sites.start_both()
    world, r2 = sites.join(Role(Kind.WORLD), 0), sites.join(robot_role("r2"), 1)
    alive = sites.keys.alive("r2")
    tokens: Mailbox[bytes | Presence] = Mailbox([alive], bytes, 100)
    world.watch(sites.keys.alive("*"), tokens)
    r2.live(alive)
    assert tokens.get(PATIENCE_S) == (alive, Presence(True))
    world.live(sites.keys.alive(WORLD))
    assert heard(world, sites.keys.tick("r2"), r2) == b"here"
    assert heard(r2, sites.keys.reply("r2"), world) == b"here"


def test_the_rules_hold_from_one_site_to_the_other(sites: Sites) -> None:
    """One session sends both, in order: what comes under its own key shows that the forged was not let through."""
    sites.start_both()
    r1, r2 = sites.join(robot_role("r1"), 0), sites.join(robot_role("r2"), 1)
    viewer = sites.join(Role(Kind.VIEWER), 0)
    own, others = sites.keys.position("r2"), sites.keys.position("r1")
    mailbox: Mailbox[bytes] = Mailbox([own, others], bytes, 100)
    viewer.subscribe(sites.keys.position("*"), mailbox)
    heard(r2, own, r1)
    honestly, forge = r2.post(own), r2.post(others)
    for _ in range(20):
        forge(b"forged")
    honestly(b"last")
    assert await_last(mailbox, (own, b"last")) == {own}


def test_a_router_with_the_certificates_of_another_authority_is_not_linked(sites: Sites, tmp_path: Path) -> None:
    sites.start_first()
    theirs = make_local_fleet(tmp_path / "f", ("r1", "r2"))
    assert theirs.fleet == sites.keys.fleet, "only the authority differs"
    where = free_tls()
    stranger = open_router(where, read_router(theirs.path, "test"), [sites.where[0]])
    forger = open_link(where, PATIENCE_S, credentials=read_credentials(theirs.path / "r2", "test"))
    viewer = sites.join(Role(Kind.VIEWER), 0)
    own, others = sites.keys.position("r1"), sites.keys.position("r2")
    mailbox: Mailbox[bytes] = Mailbox([own, others], bytes, 100)
    viewer.subscribe(sites.keys.position("*"), mailbox)
    forge = forger.broadcast(others)
    until = time.monotonic() + TRIES_S
    while time.monotonic() < until:
        forge(b"forged")
        assert mailbox.get(TRY_S) is None
    assert not viewer.sees(sites.keys.alive("r2"))
    assert heard(sites.join(robot_role("r1"), 0), own, viewer) == b"here"
    assert forger.close(PATIENCE_S)
    assert stranger.close(PATIENCE_S)


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["--connect", "tls/10.0.0.1"], "not a router's address"),
        (["--connect", "tcp/10.0.0.1:7447"], "would not be encrypted; write tls/10.0.0.1:7447"),
    ],
)
def test_a_link_that_nobody_would_guard_is_refused(
    words: Sequence[str], says: str, fleet: FleetFolder, capsys: pytest.CaptureFixture[str]
) -> None:
    assert fogwatch.router.main(["--fleet", str(fleet.path), *words]) == 2
    assert says in capsys.readouterr().err


def test_routers_without_certificates_link_on_this_machine_only(capsys: pytest.CaptureFixture[str]) -> None:
    assert fogwatch.router.main(["--connect", "tcp/10.0.0.1:7447"]) == 2
    assert "nobody would be asked who they are" in capsys.readouterr().err
    secrets = Secrets("f", ["r1"])
    try:
        folder = secrets.for_router("tcp/127.0.0.1:7447")
        assert fogwatch.router.main(["--fleet", str(folder), "--connect", "tls/127.0.0.1:7448"]) == 2
        assert "a fleet with passwords is on one machine" in capsys.readouterr().err
    finally:
        secrets.remove()


def test_the_link_comes_back_when_a_router_does(sites: Sites) -> None:
    sites.start_both()
    r2 = sites.join(robot_role("r2"), 1)
    r1 = sites.join(robot_role("r1"), 0)
    heard(r2, sites.keys.position("r2"), r1)
    assert sites.first is not None
    assert sites.first.close(PATIENCE_S)
    sites.start_first()
    assert heard(r2, sites.keys.position("r2"), r1) == b"here"


@pytest.mark.processes
@pytest.mark.parametrize("killed", [0, 1])
def test_positions_and_orders_flow_again_when_a_router_that_was_killed_is_back(killed: int, sites: Sites) -> None:
    """Zenoh's issue 1886: "unknown routing context id" after routers have connected again, and nothing is routed."""
    (sites.start_second, sites.start_first)[killed]()
    stands, members = Outcome(True, "stands"), dict[str, Link]()
    for _ in range(RETURNS):
        with sites.process(killed):
            if not members:
                members = {name: sites.join(robot_role(name), site) for site, name in enumerate(("r1", "r2"))}
                members["operator"] = sites.join(Role(Kind.OPERATOR), 0)
                for name in ("r1", "r2"):
                    StopOrders(members[name], sites.keys, name).obey(lambda _order: stands)
            for sender, receiver in (("r1", "r2"), ("r2", "r1")):
                assert heard(members[sender], sites.keys.position(sender), members[receiver]) == b"here"
            answers = ask_robots(members["operator"], sites.keys, ["r1", "r2"], Order.STOP, PATIENCE_S)
            assert sorted(answers) == [("r1", stands), ("r2", stands)]
