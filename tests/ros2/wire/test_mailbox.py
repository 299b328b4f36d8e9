import threading

from ros2.wire.formats import Attachment
from ros2.wire.mailbox import Ear, Received, RosMailbox
from tests.present import present
from tests.routers import PATIENCE_S


def received(message: int) -> Received[int]:
    return Received(message, float(message))


def test_the_newest_stays_and_what_is_old_makes_room() -> None:
    mailbox: RosMailbox[int] = RosMailbox(2)
    assert mailbox.take() is None
    assert mailbox.newest is None
    for number in range(5):
        mailbox.put(received(number))
    assert mailbox.received == 5
    taken = [mailbox.take(), mailbox.take(), mailbox.take(0.01)]
    assert [one.message if one else None for one in taken] == [3, 4, None]
    assert present(mailbox.newest).message == 4


def test_who_waits_is_woken() -> None:
    mailbox: RosMailbox[int] = RosMailbox()
    threading.Timer(0.05, lambda: mailbox.put(received(7))).start()
    assert present(mailbox.take(PATIENCE_S)).message == 7


def test_what_is_refused_is_counted_and_said_once() -> None:
    mailbox: RosMailbox[int] = RosMailbox()
    for number in range(100):
        mailbox.refuse("hash", f"line {number}")
        mailbox.refuse(f"reason {number}", "x")
    assert mailbox.refused["hash"] == 100
    assert mailbox.said["hash"] == "line 0"
    assert len(mailbox.said) == 16


def test_what_is_overheard() -> None:
    ear = Ear()
    for number in range(11):
        attached = Attachment(number, 1000 - number, bytes(16)).to_bytes()
        ear.note("a", b"x" * number, attached, number * 0.1, 1000 + number)
    heard = ear.heard["a"]
    assert (heard.messages, heard.size, heard.age_ns, len(heard.senders)) == (11, 10, 0, 1)
    assert abs(heard.rate - 10.0) < 1e-9
    assert heard.newest == b"x" * 10


def test_a_flood_of_keys_and_of_bytes_takes_no_memory() -> None:
    ear = Ear()
    for number in range(1000):
        ear.note(f"{number}", b"", b"", 0.0, 0)
    assert len(ear.heard) == 64
    for _ in range(100):
        ear.note("0", bytes(5_000_000), b"?", 1.0, 1)
    heard = ear.heard["0"]
    assert (heard.newest, heard.size, heard.age_ns) == (None, 5_000_000, None)
    assert len(heard.recent) <= 32
