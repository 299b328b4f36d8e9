import socket
from collections.abc import Iterator

import pytest

from runtime.net.mailbox import Mailbox
from runtime.net.multicast import Group, GroupDown, open_group
from tests.routers import free_port, take_messages


@pytest.fixture
def members() -> Iterator[list[Group]]:
    """Two members of a group on this machine alone."""
    port = free_port(socket.SOCK_DGRAM)
    joined = [open_group(f"udp/239.255.77.1:{port}#iface=lo") for _ in range(2)]
    yield joined
    for member in joined:
        assert member.close()
        assert member.close(), "closing twice does no harm"


def box(*keys: str) -> Mailbox[bytes]:
    return Mailbox(keys, bytes, longest=8, room=4)


def test_all_hear_a_frame_but_its_sender(members: list[Group]) -> None:
    first, second = members
    own, others = box("f/position/a", "f/position/b"), box("f/position/a", "f/position/b")
    first.subscribe("f/position/*", own)
    second.subscribe("f/position/*", others)
    post, answer = first.broadcast("f/position/a"), second.broadcast("f/position/b")
    post(b"\0one\0")
    assert take_messages(others, 1) == [("f/position/a", b"\0one\0")]
    answer(b"two")
    assert take_messages(own, 1) == [("f/position/b", b"two")]
    assert own.get() is None
    assert others.get() is None


def test_other_fleets_are_not_heard_and_what_is_wrong_is_counted(members: list[Group]) -> None:
    first, second = members
    mailbox = box("f/position/a")
    second.subscribe("f/position/*", mailbox)
    for key, frame in (("g/position/a", b"x"), ("f/position/z", b"x"), ("f/position/a", b"much too long")):
        first.broadcast(key)(frame)
    first.broadcast("f/position/a")(b"last")
    assert take_messages(mailbox, 1) == [("f/position/a", b"last")]
    assert mailbox.refused == {"unknown": 1, "oversized": 1}


def test_a_group_on_no_interface_is_down() -> None:
    with pytest.raises(GroupDown, match="cannot join the group at"):
        open_group("udp/239.255.77.1:7448#iface=none0")
