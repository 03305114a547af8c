"""Tests that each parser returns a value or raises a documented error for any bytes, within a time limit.

`python3 dev.py fuzz` runs the same targets for longer (docs/fuzzing.md). Its findings are kept in
`cases`.
"""

from __future__ import annotations

import time
from random import Random

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from tests.fuzz import mutation
from tests.fuzz.cases import CASES
from tests.fuzz.target import Target
from tests.fuzz.targets import TARGETS

FEW = settings(
    deadline=None,
    max_examples=25,
    derandomize=True,
    database=None,
    suppress_health_check=[HealthCheck.too_slow, HealthCheck.data_too_large, HealthCheck.filter_too_much],
)
SECONDS = 2.0
"""Time limit of one parser run in seconds of processor time, which a busy computer does not increase."""


def mutated(target: Target) -> st.SearchStrategy[bytes]:
    """Return a strategy for random bytes and for seeds with parts cut, repeated or replaced."""
    seeds = st.sampled_from([*target.seeds(), b""])
    piece = st.binary(max_size=12) | st.sampled_from([*target.words, b"\0", b"\xff" * 4])

    def change(seed: bytes, at: float, count: float, new: bytes) -> bytes:
        begin = int(at * len(seed))
        return seed[:begin] + new + seed[begin + int(count * (len(seed) - begin)) :]

    share = st.floats(0, 1)
    once = st.builds(change, seeds, share, share, piece)
    twice = st.builds(change, once, share, st.just(0.0) | share, piece)

    def other_value(seed: bytes, number: int) -> bytes:
        chance = Random(number)
        once = mutation.mutated(seed, chance) or seed
        return mutation.mutated(once, chance) or once

    values = st.builds(other_value, seeds, st.integers(0, 2**32))
    return st.binary(max_size=80) | once | twice | values


@pytest.mark.parametrize("name", sorted(TARGETS))
def test_parser_handles_mutated_bytes_within_the_time_limit(name: str) -> None:
    target = TARGETS[name]

    @FEW
    @given(mutated(target))
    def soon(data: bytes) -> None:
        began = time.thread_time()
        target.try_bytes(data)
        assert time.thread_time() - began < SECONDS

    soon()


@pytest.mark.parametrize("name", sorted(TARGETS))
def test_parser_accepts_a_seed_of_its_corpus(name: str) -> None:
    target, taken = TARGETS[name], 0
    for seed in target.seeds():
        target.try_bytes(seed)
        try:
            target.run(seed)
        except target.errors:
            continue
        taken += 1
    assert taken, "a target that refuses all of its seeds tries nothing"


@pytest.mark.parametrize(("name", "data"), [(name, data) for name, found in CASES.items() for data in found])
def test_fuzz_regression_inputs_are_handled_within_the_time_limit(name: str, data: bytes) -> None:
    if name not in TARGETS:
        pytest.skip("needs a package that is not here")
    began = time.thread_time()
    TARGETS[name].try_bytes(data)
    assert time.thread_time() - began < SECONDS
