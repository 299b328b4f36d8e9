from runtime.net.mailbox import Mailbox, Payload


class Bytes:
    """A payload that has not been copied out of Zenoh yet."""

    def __init__(self, data: bytes) -> None:
        self.data = data
        self.copied = False

    def __len__(self) -> int:
        return len(self.data)

    def __bytes__(self) -> bytes:
        self.copied = True
        return self.data


def box(room: int = 3) -> Mailbox[int]:
    return Mailbox(("a", "b"), int, longest=4, room=room)


def payload(text: str) -> Payload:
    return Bytes(text.encode())


def test_messages_wait_in_order_and_keys_take_turns_and_waiting_ends_in_time() -> None:
    mailbox = box()
    for text in "123":
        mailbox.deliver("a", payload(text))
    mailbox.deliver("b", payload("9"))
    assert [mailbox.get() for _ in range(5)] == [("a", 1), ("b", 9), ("a", 2), ("a", 3), None]
    assert box().get(0.01) is None


def test_what_is_dropped_is_counted_by_reason() -> None:
    mailbox = box()
    long = Bytes(b"12345")
    mailbox.deliver("a", long)
    mailbox.deliver("a", payload("x"))
    mailbox.deliver("c", payload("1"))
    for text in "12345":
        mailbox.deliver("a", payload(text))
    assert not long.copied
    assert mailbox.refused == {"oversized": 1, "malformed": 1, "unknown": 1, "overflow": 2}
    assert [mailbox.get() for _ in range(4)] == [("a", 3), ("a", 4), ("a", 5), None]


def test_a_flood_on_one_key_takes_no_room_from_another() -> None:
    mailbox = box()
    for number in range(1000):
        mailbox.deliver("a", payload(str(number)))
    mailbox.deliver("b", payload("7"))
    assert ("b", 7) in [mailbox.get(), mailbox.get()]


def test_what_waits_is_bounded_in_bytes() -> None:
    mailbox = Mailbox(("a", "b"), int, longest=4, room_bytes=6)
    for text in ("123", "456", "7"):
        mailbox.deliver("a", payload(text))
    assert mailbox.refused == {"overflow": 1}
    assert mailbox.get() == ("a", 123)
    mailbox.deliver("b", payload("789"))
    assert [mailbox.get() for _ in range(3)] == [("a", 456), ("b", 789), None]
    full = Mailbox(("a",), int, longest=4, room=1, room_bytes=6)
    for text in ("123", "456", "789"):  # what a newer one replaces takes no room
        full.deliver("a", payload(text))
    assert full.get() == ("a", 789)
