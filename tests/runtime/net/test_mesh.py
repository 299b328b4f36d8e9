import copy
import re
import shutil
import subprocess
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from socket import SOCK_DGRAM
from typing import Any, cast

import pytest

from fogwatch.fleets.folder import FleetFolder, fleet_to_change, make_fleet
from patrol.errors import BadInput
from runtime.messages.stop_orders import Order, Outcome, StopOrders, ask_robots, robots_to_ask
from runtime.net.link import Link, LinkDown, PortBusy, open_link, open_session
from runtime.net.mailbox import Mailbox
from runtime.net.open_links import open_links
from runtime.net.settings import client_settings
from runtime.security.credentials import Credentials, read_credentials
from runtime.security.keys import WORLD, address_of, fleet_keys
from runtime.security.mesh import MESH, everywhere, read_mesh
from runtime.security.roles import robot_role
from tests.routers import PATIENCE_S, await_seen, free_port, needs_openssl, reach

pytestmark = needs_openssl

MEMBERS = ("r1", "r2", "r3", "world", "viewer", "operator")
KEYS = fleet_keys("mesh")
TRY_S = 0.05
VALID_S = 10.0
"""A certificate's validity at first; doubled until its holder meets the others before the end."""
ENOUGH = 20
SHORT_S = 2.0
"""How long a process tries that nobody lets in."""


def new_fleet(folder: Path, **places: str) -> FleetFolder:
    """A fleet of three robots on this machine; those with a place can be connected to."""
    return make_fleet(folder, "mesh", ["r1", "r2", "r3"], [], free_port(SOCK_DGRAM), 1, places)


@pytest.fixture(scope="module")
def template(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A fleet whose third robot has no known address, made once."""
    return new_fleet(tmp_path_factory.mktemp("meshes") / "mesh", r1="127.0.0.1", r2="127.0.0.1").path


@pytest.fixture
def folder(template: Path, tmp_path: Path) -> Path:
    """The fleet at other ports: a session that has been closed keeps its own for a moment."""
    made = Path(shutil.copytree(template, tmp_path / "mesh"))
    ports = {address_of(place)[1]: free_port(SOCK_DGRAM) for place in read_mesh(made / MESH, "test").places.values()}
    for file in (made / "fleet.json", *made.rglob(MESH)):
        text = file.read_text(encoding="utf-8")
        file.write_text(re.sub(r":(\d+)\?", lambda found: f":{ports[int(found[1])]}?", text), encoding="utf-8")
    return made


Join = Callable[..., Link]
Change = Callable[[dict[str, Any]], None]
"""Changes the access rules of a member's session."""


def drop_rules(access: dict[str, Any]) -> None:
    access["enabled"] = False


def tell_all(access: dict[str, Any]) -> None:
    """Let everybody learn what a member wants and offers: then its rules for what comes in decide alone."""
    kinds = ("put", "declare_subscriber", "query", "reply", "declare_queryable", "liveliness_token")
    rule = {"permission": "allow", "flows": ["egress"], "messages": [*kinds], "key_exprs": [KEYS.anything]}
    access["rules"].append({"id": "tell-all", **rule})
    for policy in access["policies"]:
        policy["rules"].append("tell-all")


@pytest.fixture
def join(folder: Path) -> Iterator[Join]:
    """Opens members' links, on demand with other rules."""
    links: list[Link] = []

    def opened(name: str, own: Path = folder, change: Change | None = None) -> Link:
        credentials = read_credentials(own / name, "test")
        settings = copy.deepcopy(client_settings(credentials.router, 1.0, credentials))
        if change is None:
            links.append(open_link(credentials.router, PATIENCE_S, credentials=credentials))
        else:
            change(cast("dict[str, Any]", settings["access_control"]))
            links.append(Link(open_session(settings, credentials.router, PATIENCE_S, lambda _: None, lambda: False)))
        return links[-1]

    yield opened
    for link in links:
        link.close()


def await_neighbours(link: Link, *names: str) -> None:
    kinds = {name: f"robot-{name}.1" if name.startswith("r") else f"{name}.1" for name in names}
    assert link.neighbours.await_all(kinds.values(), PATIENCE_S), f"has met {set(link.neighbours.names)} alone"


def hear(receiver: Link, expression: str, *keys: str) -> Mailbox[bytes]:
    mailbox: Mailbox[bytes] = Mailbox(keys, bytes, 100)
    receiver.subscribe(expression, mailbox)
    return mailbox


def test_every_robot_hears_every_other_though_one_s_address_was_told_to_nobody(join: Join) -> None:
    """Nor are the viewer's and r3's told to each other: Zenoh's issue 2753, peers that do not find each other."""
    robots = {name: join(name) for name in ("r3", "r1", "r2")}
    boxes = {name: hear(link, KEYS.position("*"), *map(KEYS.position, robots)) for name, link in robots.items()}
    for sender, link in robots.items():
        post = link.broadcast(KEYS.position(sender))
        for receiver in robots:
            if receiver != sender:
                while reach(post, boxes[receiver])[0] != KEYS.position(sender):
                    pass
    await_neighbours(join("viewer"), *robots)


def test_the_death_of_a_robot_silences_no_other(join: Join) -> None:
    r1, r2, r3 = join("r1"), join("r2"), join("r3")
    await_neighbours(r2, "r1", "r3")
    r1.close()
    box = hear(r3, KEYS.position("*"), KEYS.position("r2"))
    assert reach(r2.broadcast(KEYS.position("r2")), box)[0] == KEYS.position("r2")


def another(name: str) -> str:
    return "operator" if name == "viewer" else "viewer"


@pytest.mark.processes
@pytest.mark.parametrize("liar", MEMBERS)
def test_no_member_can_speak_for_another(liar: str, join: Join) -> None:
    """A witness without rules shows that the forged was sent, and to all that have rules: they want it as well."""
    witness = join(another(liar), change=drop_rules)
    guarded = {name: join(name, change=tell_all) for name in MEMBERS if name not in (liar, another(liar))}
    link = join(liar, change=drop_rules)
    await_neighbours(link, another(liar), *guarded)
    makers = (KEYS.position, KEYS.tick, KEYS.reply, KEYS.telemetry)
    every = [KEYS.truth("metrics"), *(make(name) for name in ("r1", "r2", "r3") for make in makers)]
    heard, sent = (Mailbox(every, bytes, 100) for _ in range(2))
    for listener in (*guarded.values(), witness):
        for key in every:
            listener.subscribe(key, sent if listener is witness else heard)
    posts = [link.post(key) for key in every]
    own = {make(liar) for make in (KEYS.position, KEYS.reply, KEYS.telemetry)} if liar.startswith("r") else set()
    if liar == "world":
        own = {KEYS.truth("metrics"), *map(KEYS.tick, ("r1", "r2", "r3"))}
    arrived: dict[bool, set[str]] = {True: set(), False: set()}
    until = time.monotonic() + PATIENCE_S
    rounds_left = ENOUGH
    while rounds_left and time.monotonic() < until:
        for post in posts:
            post(b"x")
        for is_sent, mailbox in ((True, sent), (False, heard)):
            while (news := mailbox.get(TRY_S)) is not None:
                arrived[is_sent].add(news[0])
        rounds_left -= arrived[True] == set(every) and arrived[False] >= own
    assert arrived == {True: set(every), False: own}


@pytest.mark.processes
@pytest.mark.parametrize("liar", ["r1", "world", "viewer"])
def test_no_member_can_stand_in_for_another(liar: str, join: Join) -> None:
    """Neither its tokens nor its answers to orders: a witness without rules gets them all."""
    join("r2")  # the others meet there
    witness, guarded = join(another(liar), change=drop_rules), join("operator", change=tell_all)
    link = join(liar, change=drop_rules)
    await_neighbours(link, "operator", another(liar))
    names = ["r1", "r2", "r3"]
    tokens = {KEYS.alive(name) for name in (*names, WORLD)}
    for token in tokens:
        link.live(token)
    for name in names:
        StopOrders(link, KEYS, name).obey(lambda _order: Outcome(True, "stands"))
    for token in tokens:
        await_seen(witness, token)
    assert {name for name, _ in ask_robots(witness, KEYS, names, Order.STOP, PATIENCE_S)} == set(names)
    own = {liar} & set(names)
    rightful = {KEYS.alive(WORLD)} if liar == "world" else set(map(KEYS.alive, own))
    for token in rightful:
        await_seen(guarded, token)
    assert {token for token in tokens if guarded.sees(token)} == rightful
    assert {name for name, _ in ask_robots(guarded, KEYS, sorted(own), Order.STOP, PATIENCE_S)} == own
    assert not list(ask_robots(guarded, KEYS, sorted({*names} - own), Order.STOP, SHORT_S))


@pytest.mark.processes
def test_strangers_and_members_that_were_revoked_do_not_get_in(join: Join, folder: Path, tmp_path: Path) -> None:
    """The others hear a member, which shows that they would have heard the stranger."""
    strange = new_fleet(tmp_path / "strange", r1="127.0.0.1").path
    shutil.copy(folder / MESH, strange / "r3" / MESH)
    own = Path(shutil.copytree(folder, tmp_path / "own"))
    with fleet_to_change(own) as fleet:
        fleet.revoke(robot_role("r2"), 1)
    r1 = join("r1", own)
    stranger, revoked, r3 = join("r3", strange), join("r2", folder), join("r3", own)
    await_neighbours(r3, "r1")
    assert revoked.neighbours.await_any(PATIENCE_S), "its certificate is still valid, so it gets a session"
    box = hear(r1, KEYS.position("*"), *(KEYS.position(name) for name in ("r2", "r3")))
    for post in (stranger.broadcast(KEYS.position("r3")), revoked.broadcast(KEYS.position("r2"))):
        for _ in range(int(SHORT_S / TRY_S)):
            post(b"x")
            assert box.get(TRY_S) is None
    assert reach(r3.broadcast(KEYS.position("r3")), box)[0] == KEYS.position("r3")
    assert not stranger.neighbours.names
    shutil.copy(own / MESH, folder / "r2" / MESH)
    with pytest.raises(BadInput, match="r2 is no member of fleet mesh; copy the fleet's"):
        read_credentials(folder / "r2", "test")


def end_certificate(fleet: Path, member: str, common_name: str, after_s: float) -> None:
    """Replace a member's certificate by one that ends soon."""
    own, work = fleet / member, fleet / f"work-{after_s:g}"
    work.mkdir()
    (work / "index").touch()
    (work / "serial").write_text("10\n", encoding="ascii")
    (work / "ca.cnf").write_text(
        f"[ca]\ndefault_ca=own\n[own]\nnew_certs_dir={work}\ndatabase={work}/index\nserial={work}/serial\n"
        "default_md=sha256\npolicy=any\nx509_extensions=of\n[any]\nO=optional\nCN=supplied\n"
        "[of]\nextendedKeyUsage=serverAuth,clientAuth\n",
        encoding="ascii",
    )
    end = time.strftime("%Y%m%d%H%M%SZ", time.gmtime(time.time() + after_s))
    wish, authority = str(work / "wish.pem"), fleet / "authority"
    request: list[str | Path] = ["openssl", "req", "-new", "-key", own / "key.pem", "-out", wish]
    request += ["-subj", f"/O=fogwatch/CN={common_name}"]
    subprocess.run(request, check=True, capture_output=True)
    command: list[str | Path] = ["openssl", "ca", "-batch", "-notext", "-config", work / "ca.cnf", "-in", wish]
    command += ["-enddate", end]
    command += ["-cert", authority / "certificate.pem", "-keyfile", authority / "key.pem"]
    subprocess.run([*command, "-out", own / "certificate.pem"], check=True, capture_output=True)


def join_again(join: Join, name: str) -> Link:
    """Open a member's link anew: the one that was closed keeps its port for a moment."""
    until = time.monotonic() + PATIENCE_S
    while True:
        try:
            return join(name)
        except PortBusy:
            if time.monotonic() > until:
                raise
            time.sleep(TRY_S)


@pytest.mark.processes
def test_a_connection_ends_with_the_certificate_and_its_owner_gets_no_other(join: Join, folder: Path) -> None:
    """A connection that is made in the very second of the end stays (docs/security.md), so the second try is later."""
    r1, r3 = join("r1"), join("r3")
    await_neighbours(r1, "r3")
    came, gone = threading.Event(), threading.Event()

    def note(name: str, there: bool) -> None:
        if name == "robot-r2.1":
            (came if there else gone).set()

    r1.neighbours.tell(note)
    valid_s = VALID_S
    while True:
        end_s = time.time() + valid_s
        end_certificate(folder, "r2", "robot-r2.1", valid_s)
        r2 = join_again(join, "r2")
        if came.wait(max(0.0, end_s - time.time())):
            break
        r2.close()
        if came.is_set():  # only just
            assert gone.wait(PATIENCE_S)
            came.clear()
            gone.clear()
        valid_s *= 2.0
    assert gone.wait(valid_s + PATIENCE_S)
    assert time.time() >= end_s - 1.0
    assert r2.close(PATIENCE_S)
    time.sleep(max(0.0, end_s + 1.0 - time.time()))
    again = join_again(join, "r2")
    assert not again.neighbours.await_any(SHORT_S)
    assert r1.neighbours.names == {"robot-r3.1"}
    box = hear(r3, KEYS.position("*"), KEYS.position("r1"))
    assert reach(r1.broadcast(KEYS.position("r1")), box)[0] == KEYS.position("r1")


def test_neighbours_can_be_read_while_a_change_is_told(join: Join) -> None:
    r1, began, over = join("r1"), threading.Event(), threading.Event()
    ended: list[bool] = []

    def tell(_name: str, _there: bool) -> None:
        began.set()
        ended.append(over.wait(PATIENCE_S))

    r1.neighbours.tell(tell)
    join("r2")
    assert began.wait(PATIENCE_S)
    assert r1.neighbours.names == {"robot-r2.1"}
    assert not ended
    over.set()


def test_a_copy_of_a_certificate_shows_itself_to_its_owner(join: Join, folder: Path) -> None:
    """Others cannot tell the two apart."""
    r1, r2 = join("r1"), join("r2")
    await_neighbours(r2, "r1")
    assert "robot-r2.1" not in r2.neighbours.names
    credentials = replace(read_credentials(folder / "r2", "test"), beside=True)
    thief = open_link(credentials.router, PATIENCE_S, credentials=credentials)
    await_neighbours(r2, "r2")
    box = hear(r1, KEYS.position("*"), KEYS.position("r2"))
    assert reach(thief.broadcast(KEYS.position("r2")), box)[0] == KEYS.position("r2")
    thief.close()


def test_a_member_that_floods_takes_no_room_from_the_others(join: Join) -> None:
    r1, r2, r3 = join("r1"), join("r2"), join("r3")
    await_neighbours(r3, "r1", "r2")
    box = hear(r3, KEYS.position("*"), KEYS.position("r1"), KEYS.position("r2"))
    flood, own = r2.broadcast(KEYS.position("r2")), r1.broadcast(KEYS.position("r1"))
    assert reach(flood, box)[0] == KEYS.position("r2")
    over = threading.Event()

    def go_on() -> None:
        while not over.is_set():
            flood(bytes(60))

    flooding = threading.Thread(target=go_on)
    flooding.start()
    heard = flooded = 0
    until = time.monotonic() + PATIENCE_S
    while (heard < ENOUGH or flooded < 10 * ENOUGH) and time.monotonic() < until:
        own(b"here")
        for _ in range(ENOUGH):
            if (news := box.get(TRY_S)) is not None:
                mine = news[0] == KEYS.position("r1")
                heard, flooded = heard + mine, flooded + (not mine)
    over.set()
    flooding.join()
    assert heard >= ENOUGH
    assert flooded + box.refused["overflow"] >= 10 * ENOUGH


def test_an_order_to_all_reaches_robots_that_have_not_been_met_yet(join: Join) -> None:
    for name in ("r1", "r2", "r3"):
        StopOrders(join(name), KEYS, name).obey(lambda order: Outcome(order is Order.STOP, "stands"))
    operator = join("operator")
    assert robots_to_ask(operator, KEYS) == ["r1", "r2", "r3"]
    answers = ask_robots(operator, KEYS, robots_to_ask(operator, KEYS), Order.STOP, PATIENCE_S)
    assert sorted(name for name, outcome in answers if outcome.done) == ["r1", "r2", "r3"]


def test_tokens_are_seen_as_at_a_router(join: Join) -> None:
    world, r1 = join("world"), join("r1")
    world.live(KEYS.alive(WORLD))
    r1.live(KEYS.alive("r1"))
    await_seen(world, KEYS.alive("r1"))
    await_seen(r1, KEYS.alive(WORLD))
    await_seen(join("viewer"), KEYS.alive(WORLD))


def test_a_viewer_waits_for_the_first_member_and_says_when_there_is_none(folder: Path, join: Join) -> None:
    credentials = read_credentials(folder / "viewer", "test")
    with pytest.raises(LinkDown, match="no member of fleet mesh answers at quic/127"):
        open_link(credentials.router, 0.2, credentials=credentials)
    with pytest.raises(BadInput, match="are the certificates valid: fogwatch fleet check"):
        open_links(credentials.router, None, 0.2, print, lambda: False, credentials)
    join("r2")
    assert join("viewer").neighbours.await_any(PATIENCE_S)


def test_two_processes_cannot_be_the_same_robot_on_one_machine_but_a_process_may_have_two_sessions(
    folder: Path, join: Join
) -> None:
    join("r1")
    credentials = read_credentials(folder / "r1", "test")
    with pytest.raises(PortBusy, match="the port is busy"):
        open_link(credentials.router, PATIENCE_S, credentials=credentials)
    second = open_link(credentials.router, PATIENCE_S, credentials=replace(credentials, beside=True))
    second.close()


def test_a_radio_on_a_mesh_of_its_own(folder: Path, join: Join, tmp_path: Path) -> None:
    radio = new_fleet(tmp_path / "radio", r1="127.0.0.1", r2="127.0.0.1").path
    credentials = read_credentials(folder / "r1", "test")
    links = open_links(credentials.router, str(radio / "r1"), PATIENCE_S, print, lambda: False, credentials)
    assert links is not None
    box = hear(join("r2", radio), KEYS.position("*"), KEYS.position("r1"))
    assert reach(links[1].broadcast(KEYS.position("r1")), box)[0] == KEYS.position("r1")
    for link in links:
        link.close()


@pytest.mark.parametrize(("fleet", "name"), [("mesh", "r2"), ("mesh-radio", "r1")])
def test_a_radio_on_the_mesh_of_another_is_bad_input(fleet: str, name: str, folder: Path, tmp_path: Path) -> None:
    """All others would deny what the process sends there."""
    radio = make_fleet(tmp_path / "radio", fleet, ["r1", "r2"], [], 7447, 1, {"r1": "127.0.0.1"}).path / name
    credentials = read_credentials(folder / "r1", "test")
    says = f"--radio {radio}: is the folder of {name} in fleet {fleet}, and this process is r1 in mesh; give its folder"
    with pytest.raises(BadInput, match=re.escape(says)):
        open_links(credentials.router, str(radio), 0.0, print, lambda: False, credentials)


def test_a_viewer_waits_for_a_mesh_that_carries_positions(folder: Path, join: Join, tmp_path: Path) -> None:
    join("r2")
    radio = new_fleet(tmp_path / "radio", r1="127.0.0.1")
    place, lines = radio.places["robot-r1"], list[str]()
    own = read_credentials(folder / "viewer", "test")

    def stopped() -> bool:
        return any(place in line for line in lines)

    assert open_links(own.router, f"{radio.path}/viewer", PATIENCE_S, lines.append, stopped, own) is None
    assert lines[-1].startswith(f"waiting for a member of fleet mesh at {place} (")


def test_a_member_listens_everywhere_where_its_address_is_not_this_machine_s(tmp_path: Path, join: Join) -> None:
    """The one that others know may be that of a router before it, as with containers, or come later."""
    port = free_port(SOCK_DGRAM)
    made = make_fleet(tmp_path / "f", "mesh", ["r1", "r2"], [], port, 1, {"r1": "192.0.2.1", "r2": "127.0.0.1"})
    r1 = join("r1", made.path)
    text = (made.path / MESH).read_text(encoding="utf-8").replace("192.0.2.1", "127.0.0.1")
    (made.path / "viewer" / MESH).write_text(text, encoding="utf-8")
    await_neighbours(join("viewer", made.path), "r1")
    await_neighbours(r1, "viewer")


def test_where_members_listen(tmp_path: Path) -> None:
    made = make_fleet(tmp_path / "f", "f", ["r1", "r2"], [], 7447, 1, {"r1": "192.0.2.1", "r2": "fd00::2"})
    assert made.mesh == read_mesh(made.path / MESH, "test") == read_mesh(made.path / "viewer" / MESH, "test")

    def own(name: str) -> Credentials:
        return read_credentials(made.path / name, "test")

    assert own("r1").listens_at == "quic/192.0.2.1:7447?mixed_rel=1"
    assert own("r2").listens_at == "quic/[fd00::2]:7447?mixed_rel=1"
    assert everywhere(own("r1").listens_at) == "quic/0.0.0.0:7447?mixed_rel=1"
    assert everywhere(own("r2").listens_at) == "quic/[::]:7447?mixed_rel=1"
    named = make_fleet(tmp_path / "g", "g", ["r1"], [], 7447, 1, {"r1": "robot-1.local"})
    assert read_credentials(named.path / "r1", "test").listens_at == "quic/0.0.0.0:7447?mixed_rel=1"
    assert replace(own("r2"), beside=True).listens_at == own("viewer").listens_at == "quic/0.0.0.0:0?mixed_rel=1"
    assert own("r1").router == "quic/[fd00::2]:7447?mixed_rel=1"
    assert own("world").router == "quic/192.0.2.1:7447?mixed_rel=1,quic/[fd00::2]:7447?mixed_rel=1"
    with pytest.raises(BadInput, match="without a router"):
        own("r1").check_router("tls/192.0.2.9:7447", "--router")


def test_members_that_are_made_anew_keep_their_addresses(tmp_path: Path) -> None:
    made = new_fleet(tmp_path / "f", r1="127.0.0.1", r2="127.0.0.1")
    places = dict(made.places)
    for name in ("r1", "r2"):
        with fleet_to_change(made.path) as fleet:
            fleet.revoke(robot_role(name), 1)
            assert f"robot-{name}" not in read_mesh(made.path / "r3" / MESH, "test").places
            fleet.add(robot_role(name), 1)
    assert read_mesh(made.path / "r3" / MESH, "test").places == places


def test_a_member_whose_host_cannot_be_leaves_nothing(tmp_path: Path) -> None:
    made = new_fleet(tmp_path / "f", r1="127.0.0.1")
    with fleet_to_change(made.path) as fleet:
        for host in ("r4:7447", "0.0.0.0"):
            with pytest.raises(BadInput, match=f"--host .?{host}"):
                fleet.add(robot_role("r4"), 1, host)
        fleet.add(robot_role("r4"), 1, "127.0.0.1")
    assert read_mesh(made.path / "r4" / MESH, "test").places.keys() == {"robot-r1", "robot-r4"}


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("[]", "expected a JSON object"),
        ('{"fleet": "mesh", "members": {"r": "robot-r1"}, "places": {}}', "names no address"),
        ('{"fleet": "mesh", "members": {}}', 'expected "places"'),
        ('{"fleet": "mesh", "members": {"a": "x"}, "places": {"robot-r1": "quic/a:1"}}', "'x': no role of a fleet"),
        ('{"fleet": "mesh", "members": {"a": 1}, "places": {}}', 'expected "members"'),
        ('{"fleet": "mesh", "members": {}, "places": {"robot-r1": "tcp/a:1"}}', "which need quic or tls"),
        ('{"fleet": "mesh", "members": {}, "places": {"robot-r1": "here"}}', "not a router's address"),
        ('{"fleet": "other", "members": {"r": "robot-r1"}, "places": {"robot-r1": "quic/a:1"}}', "is of fleet other"),
    ],
)
def test_a_file_of_a_mesh_that_says_something_else_is_bad_input(
    text: str, says: str, folder: Path, tmp_path: Path
) -> None:
    own = Path(shutil.copytree(folder / "r1", tmp_path / "r1"))
    (own / MESH).write_text(text, encoding="utf-8")
    with pytest.raises(BadInput, match=says):
        read_credentials(own, "--credentials")
