"""What routers say of themselves, and what is no such thing."""

from __future__ import annotations

import pytest

from patrol.net.admin_space import RouterFacts, read_facts


def test_a_router_says_its_version_and_its_sessions() -> None:
    answer = b'{"version": "v1.10.2-cc8398 built with rustc 1.97.1", "sessions": [{}, {}], "locators": []}'
    assert list(read_facts([answer])) == [RouterFacts("1.10.2", 2)]


@pytest.mark.parametrize(
    "answer",
    [
        b"",
        b"\xff",
        b"[]",
        b"1",
        b"{}",
        b'{"version": 1, "sessions": []}',
        b'{"version": "1", "sessions": 3}',
        b"[" * 9999,
    ],
)
def test_what_is_no_such_answer_is_left_out(answer: bytes) -> None:
    assert list(read_facts([answer])) == []
