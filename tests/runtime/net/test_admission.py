import shutil
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from fogwatch.fleets.certificates import issue, make_authority
from fogwatch.fleets.folder import FleetFolder, open_fleet_folder
from patrol.errors import BadInput
from runtime.net.link import Link, NotAdmitted, open_link
from runtime.net.mailbox import Mailbox, Presence, Question
from runtime.net.open_links import open_links
from runtime.security.credentials import Credentials, read_credentials
from runtime.security.keys import WORLD, FleetKeys
from runtime.security.roles import robot_role
from tests import routers

pytestmark = routers.needs_openssl

ROBOTS = ("r1", "r2")
REFUSED_S = 2.0
"""How long somebody without rights tries to get in."""
FORGED, HONEST = b"forged", b"honest"

Guard = Callable[[], AbstractContextManager[routers.Guarded]]


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> FleetFolder:
    return routers.make_local_fleet(tmp_path_factory.mktemp("fleet") / "f", ROBOTS)


@pytest.fixture
def fleet(made: FleetFolder, tmp_path: Path) -> FleetFolder:
    shutil.copytree(made.path, tmp_path / "f")
    return open_fleet_folder(tmp_path / "f")


class Members(AbstractContextManager["Members"]):
    """Sessions of a fleet's members at its router."""

    def __init__(self, at: routers.Guarded) -> None:
        self.at = at
        self.keys: FleetKeys = at.keys
        self._links: list[Link] = []

    def join(self, credentials: Credentials | None, wait_s: float = routers.PATIENCE_S) -> Link:
        self._links.append(open_link(self.at.router, wait_s, credentials=credentials))
        return self._links[-1]

    def __getitem__(self, user: str) -> Link:
        return self.join(self.at.credentials[user])

    def __exit__(self, *_: object) -> None:
        for link in self._links:
            assert link.close(routers.PATIENCE_S)


@pytest.fixture(params=["passwords", "certificates"])
def members(request: pytest.FixtureRequest, made: FleetFolder) -> Iterator[Members]:
    guard = (
        routers.guarded_by_passwords(ROBOTS) if request.param == "passwords" else routers.guarded_by_certificates(made)
    )
    with guard as at, Members(at) as members:
        yield members


def letters(*keys: str) -> Mailbox[bytes | Presence]:
    return Mailbox(keys, bytes, 100)


def await_honest(post: Callable[[bytes], None], mailbox: Mailbox[Any]) -> list[tuple[str, object]]:
    """Send until something arrives; return all that has arrived by then."""
    found: list[tuple[str, object]] = [routers.reach(post, mailbox, HONEST)]
    while (arrived := mailbox.get()) is not None:
        found.append(arrived)
    return found


def test_a_robot_speaks_for_itself_alone(members: Members) -> None:
    """One session sends both, in order: what comes under its own key shows that the forged was not let through."""
    keys, world, r2 = members.keys, members["world"], members["robot-r2"]
    own = [make("r2") for make in (keys.reply, keys.position, keys.telemetry)]
    others = [make("r1") for make in (keys.reply, keys.position, keys.telemetry)]
    for forged, honest in zip(others, own, strict=True):
        mailbox: Mailbox[bytes] = Mailbox((forged, honest), bytes, 100)
        world.subscribe(honest.replace("/r2", "/*"), mailbox)
        honestly = r2.post(honest)
        await_honest(honestly, mailbox)
        forge = r2.post(forged)
        for _ in range(20):
            forge(FORGED)
        honestly(b"last")
        assert routers.await_last(mailbox, (honest, b"last")) == {honest}


@pytest.mark.parametrize("who", ["robot-r2", "viewer", "operator"])
def test_nobody_but_the_world_sends_ticks_and_the_truth(members: Members, who: str) -> None:
    keys, world, sender = members.keys, members["world"], members[who]
    heard = {keys.tick("r1"): letters(keys.tick("r1")), keys.truth("metrics"): letters(keys.truth("metrics"))}
    members["robot-r1"].subscribe(keys.tick("r1"), heard[keys.tick("r1")])
    members["viewer"].subscribe(keys.truth("*"), heard[keys.truth("metrics")])
    for key, mailbox in heard.items():
        await_honest(world.post(key), mailbox)
        post = sender.post(key)
        for _ in range(50):
            post(FORGED)
            sender.sees(keys.alive(WORLD))  # answered after the router has seen what was sent before
        assert {payload for _, payload in await_honest(world.post(key), mailbox)} == {HONEST}


@pytest.mark.parametrize("who", ["robot-r2", "viewer", "operator"])
def test_nobody_hears_what_is_not_meant_for_it(members: Members, who: str) -> None:
    keys, listener = members.keys, members[who]
    world, r1 = members["world"], members["robot-r1"]
    secret = [keys.tick("r1"), keys.reply("r1")]
    spied, meant, answered = letters(*secret, keys.position("r1")), letters(keys.tick("r1")), letters(keys.reply("r1"))
    for expression in (*secret, keys.tick("*"), keys.reply("*"), keys.position("*"), f"{keys.anything}", "**"):
        listener.subscribe(expression, spied)
    r1.subscribe(keys.tick("r1"), meant)
    world.subscribe(keys.reply("*"), answered)
    await_honest(r1.post(keys.position("r1")), spied)
    for _ in range(20):
        await_honest(world.post(keys.tick("r1")), meant)
        await_honest(r1.post(keys.reply("r1")), answered)
    heard = {key for key, _ in await_honest(r1.post(keys.position("r1")), spied)}
    assert heard == {keys.position("r1")}


@pytest.mark.parametrize("who", ["robot-r2", "viewer", "operator"])
def test_nobody_is_present_in_another_s_name(members: Members, who: str) -> None:
    keys, world, impostor = members.keys, members["world"], members[who]
    present = letters(keys.alive("r1"), keys.alive("r2"), keys.alive(WORLD))
    world.watch(keys.alive("*"), present)
    impostor.live(keys.alive("r1"))
    impostor.live(keys.alive(WORLD))
    members["robot-r2"].live(keys.alive("r2"))
    assert present.get(routers.PATIENCE_S) == (keys.alive("r2"), Presence(True))
    present.put(keys.alive("r2"), Presence(False))
    assert present.get() == (keys.alive("r2"), Presence(False)), "the impostor came first"
    assert not any(members["operator"].sees(keys.alive(name)) for name in (WORLD, "r1"))


def test_only_operators_are_answered_to_controls_and_only_by_the_world(members: Members) -> None:
    keys, control = members.keys, members.keys.control("ask")
    fog = keys.truth("fog")
    asked: Mailbox[Question] = Mailbox((control, fog, keys.anything), _unread, 100)
    for impostor in ("robot-r1", "viewer", "operator"):
        link = members[impostor]
        for key in (control, fog, keys.anything):
            link.attend(key, 100, asked)
    operator, viewer, robot = members["operator"], members["viewer"], members["robot-r1"]
    assert operator.ask(control, b"token", REFUSED_S) is None, "an impostor was asked"
    assert viewer.ask(fog, b"", REFUSED_S) is None
    assert asked.get() is None
    world = members["world"]
    for key in (control, fog):
        world.attend(key, 100, asked)
    assert _answered(operator, control, asked)
    assert _answered(operator, fog, asked)
    assert _answered(viewer, fog, asked)
    for link, key in ((viewer, control), (robot, control), (robot, fog), (viewer, "**")):
        assert link.ask(key, b"x", REFUSED_S) is None
    assert asked.get() is None


def _unread(_payload: bytes) -> Question:
    raise ValueError


def _answered(link: Link, key: str, asked: Mailbox[Question]) -> bool:
    """Return whether the world is asked and its answer arrives, however long it takes until it is known."""
    end = time.monotonic() + routers.PATIENCE_S
    got: list[bytes | None] = [None]
    while got[0] is None and time.monotonic() < end:
        asking = threading.Thread(target=lambda: got.__setitem__(0, link.ask(key, b"q", routers.PATIENCE_S)))
        asking.start()
        while asking.is_alive():
            if (arrived := asked.get(0.05)) is not None:
                arrived[1].answer(HONEST)
        asking.join()
    return got[0] == HONEST


@pytest.mark.parametrize("who", ["nobody", "wrong", "another's", "unknown"])
def test_a_password_must_be_the_member_s_own(who: str) -> None:
    with routers.guarded_by_passwords(ROBOTS) as at, Members(at) as members:
        r1, r2 = at.credentials["robot-r1"], at.credentials["robot-r2"]
        wrong = {
            "nobody": None,
            "wrong": replace(r1, password="0" * 32),
            "another's": replace(r1, password=r2.password),
            "unknown": replace(r1, role=robot_role("r3")),
        }[who]
        why = "does not let this process in: its credentials are missing, wrong or expired"
        with pytest.raises(NotAdmitted, match=why):
            members.join(wrong, REFUSED_S)
        with pytest.raises(BadInput, match="does not let this process in"):
            open_links(at.router, None, REFUSED_S, lambda _line: None, lambda: False, wrong)
        assert members.join(r1).connected


def test_a_member_needs_a_certificate_of_the_fleet_that_is_valid_now(fleet: FleetFolder, tmp_path: Path) -> None:
    fleet.add(robot_role("late"), days=-1)
    good = fleet.path / "r1"
    folders = {name: shutil.copytree(good, tmp_path / name) for name in ("stranger", "swapped", "bare")}
    make_authority(tmp_path / "authority", "f")
    issue(tmp_path / "authority", folders["stranger"], "robot-r1.1", 1)
    shutil.copyfile(good / "authority.pem", folders["stranger"] / "authority.pem")
    shutil.copyfile(fleet.path / "r2" / "key.pem", folders["swapped"] / "key.pem")
    with routers.guarded_by_certificates(fleet) as at, Members(at) as members:
        refused = {
            "expired": at.credentials["robot-late"],
            "wrong authority": read_credentials(folders["stranger"], "test"),
            "another's key": read_credentials(folders["swapped"], "test"),
            "none": None,
            "a password": replace(at.credentials["robot-r1"], password="x" * 32, folder=None),
        }
        for why, credentials in refused.items():
            with pytest.raises(Exception, match=r"does not let this process in|cannot reach a router") as caught:
                members.join(credentials, REFUSED_S)
            assert "\n" not in str(caught.value), why
        assert members.join(at.credentials["robot-r1"]).connected


def test_a_member_does_not_join_a_router_that_another_authority_has_made(fleet: FleetFolder, tmp_path: Path) -> None:
    other = routers.make_local_fleet(tmp_path / "other", ROBOTS)
    mine = read_credentials(fleet.path / "operator", "test")
    with routers.guarded_by_certificates(other) as at, Members(at) as members:
        with pytest.raises(NotAdmitted):
            members.join(mine, REFUSED_S)
        assert members.join(at.credentials["operator"]).connected


def test_a_member_cannot_pass_for_the_router(fleet: FleetFolder) -> None:
    """A robot's certificate is good for a client alone."""
    for name in ("certificate.pem", "key.pem"):
        shutil.copyfile(fleet.path / "r2" / name, fleet.path / "router" / name)
    with routers.guarded_by_certificates(fleet) as at, pytest.raises(NotAdmitted):
        Members(at).join(at.credentials["operator"], REFUSED_S)


def test_a_revoked_member_has_no_rights_and_the_one_that_replaces_it_has(fleet: FleetFolder, tmp_path: Path) -> None:
    stolen = read_credentials(shutil.copytree(fleet.path / "r2", tmp_path / "stolen"), "test")
    keys_of = robot_role("r2")
    fleet.revoke(keys_of, 1)
    fleet.add(keys_of, days=1)
    with routers.guarded_by_certificates(fleet) as at, Members(at) as members:
        keys, world, thief = at.keys, members["world"], members.join(stolen)
        mailbox = letters(keys.reply("r1"), keys.reply("r2"), keys.alive("r2"))
        world.subscribe(keys.reply("*"), mailbox)
        world.watch(keys.alive("r2"), mailbox)
        thief.live(keys.alive("r2"))
        await_honest(members["robot-r1"].post(keys.reply("r1")), mailbox)
        post = thief.post(keys.reply("r2"))
        for _ in range(50):
            post(FORGED)
            thief.sees(keys.alive(WORLD))
        heard = await_honest(members["robot-r1"].post(keys.reply("r1")), mailbox)
        assert {key for key, _ in heard} == {keys.reply("r1")}
        own = letters(keys.reply("r1"), keys.reply("r2"))
        world.subscribe(keys.reply("r2"), own)
        assert {payload for _, payload in await_honest(members["robot-r2"].post(keys.reply("r2")), own)} == {HONEST}


def test_a_viewer_sees_what_observers_may_see(members: Members) -> None:
    keys, viewer = members.keys, members["viewer"]
    senders = {
        keys.truth("ticks"): members["world"],
        keys.position("r1"): members["robot-r1"],
        keys.telemetry("r1"): members["robot-r1"],
    }
    for key, sender in senders.items():
        mailbox = letters(key)
        viewer.subscribe(key.replace("r1", "*"), mailbox)
        assert await_honest(sender.publisher(key), mailbox)[0] == (key, HONEST)
    present = letters(keys.alive(WORLD))
    viewer.watch(keys.alive("*"), present)
    world = members["world"]
    world.live(keys.alive(WORLD))
    assert present.get(routers.PATIENCE_S) == (keys.alive(WORLD), Presence(True))
    routers.await_seen(viewer, keys.alive(WORLD))
    assert world.close(routers.PATIENCE_S)
    while (arrived := present.get(routers.PATIENCE_S)) != (keys.alive(WORLD), Presence(False)):
        assert arrived is not None, "nobody says that it has gone"
