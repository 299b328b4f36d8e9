"""Proofs that a tick has begun: whoever has the earlier ones can check one, and make none."""

from __future__ import annotations

import pickle

import pytest
from hypothesis import given
from hypothesis import strategies as st

from patrol.security.tick_chain import CHEAP, COSTLY_S, LONGEST, PROOF, TickChain, TickProofs, stride_of

TICKS = 1000
CHAIN = TickChain(b"secret", TICKS)


NOW = 50.0


def proofs_from(begun: int, chain: TickChain = CHAIN) -> TickProofs:
    return TickProofs(begun, chain.proof(begun), chain.stride, NOW)


@given(st.lists(st.integers(0, TICKS), min_size=1, max_size=8).map(sorted))
def test_each_tick_is_proved_whatever_was_missed(begun: list[int]) -> None:
    proofs = proofs_from(begun[0])
    for seconds, number in enumerate(begun, 1):
        assert proofs.accepts(number, CHAIN.proof(number), NOW + seconds * COSTLY_S)


@given(st.integers(0, 200), st.integers(1, 200), st.integers(0, 200))
def test_no_known_proof_proves_a_later_tick(known: int, more: int, earlier: int) -> None:
    proofs = proofs_from(known)
    assert not proofs.accepts(known + more, CHAIN.proof(max(known - earlier, 0)), NOW)
    assert proofs.accepts(known + 1, CHAIN.proof(known + 1), NOW)


@given(st.integers(0, 2**31), st.binary(min_size=PROOF, max_size=PROOF))
def test_a_guess_proves_nothing(begun: int, proof: bytes) -> None:
    assert not proofs_from(5).accepts(begun, proof, NOW)


def test_what_has_been_passed_still_needs_its_own_proof() -> None:
    proofs = proofs_from(5)
    assert proofs.accepts(9, CHAIN.proof(9), NOW)
    assert proofs.accepts(9, CHAIN.proof(9), NOW)
    assert proofs.accepts(7, CHAIN.proof(7), NOW)
    assert not proofs.accepts(7, CHAIN.proof(6), NOW)
    assert not proofs.accepts(9, CHAIN.proof(8), NOW)
    assert not proofs.accepts(10, CHAIN.proof(9), NOW)


def test_another_run_has_other_proofs() -> None:
    assert not proofs_from(5).accepts(6, TickChain(b"another", TICKS).proof(6), NOW)


def test_forged_proofs_do_not_keep_a_robot_busy() -> None:
    proofs = proofs_from(0)
    assert not proofs.accepts(TICKS, bytes(PROOF), NOW)
    assert not proofs.accepts(TICKS, CHAIN.proof(TICKS), NOW)  # right, but there was a costly one just now
    assert proofs.accepts(CHEAP, CHAIN.proof(CHEAP), NOW)
    assert proofs.accepts(TICKS, CHAIN.proof(TICKS), NOW + COSTLY_S)


@pytest.mark.parametrize("ticks", [0, 1, LONGEST - 1, LONGEST, 3 * LONGEST + 7])
def test_a_long_run_has_a_chain_of_bounded_length(ticks: int) -> None:
    chain = TickChain(b"secret", ticks)
    assert chain.stride == stride_of(ticks) == ticks // LONGEST + 1
    assert len(chain.proof(ticks)) == PROOF
    assert len(pickle.dumps(chain)) <= PROOF * (LONGEST + 2) + 200
    first = max(ticks - 10, 0)
    proofs = proofs_from(first, chain=chain)
    for begun in range(first, ticks + 1):
        assert proofs.accepts(begun, chain.proof(begun), NOW)
    assert not proofs.accepts(ticks + 2 * chain.stride, chain.proof(ticks), NOW)
