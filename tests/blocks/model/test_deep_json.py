"""Tests of JSON as deeply nested as a long stack of blocks."""

from __future__ import annotations

import sys
import threading

import pytest

from app.blocks.model import deep_json


def stack(blocks: int) -> dict[str, object]:
    block: dict[str, object] = {"type": "control_wait", "id": "é"}
    for number in range(blocks - 1):
        block = {"type": "control_wait", "id": str(number), "next": {"block": block}}
    return block


@pytest.mark.parametrize("blocks", [1, 400, 600, 3000])
def test_deeply_nested_json_round_trips(blocks: int) -> None:
    text = deep_json.dumps(stack(blocks))
    assert deep_json.are_equal(deep_json.loads(text), stack(blocks))
    assert deep_json.are_equal(deep_json.loads(deep_json.dumps(stack(blocks), indent=1)), stack(blocks))


def test_invalid_json_raises_value_error_and_excessive_depth_raises_recursion_error() -> None:
    with pytest.raises(ValueError, match="Expecting"):
        deep_json.loads("{")
    with pytest.raises(RecursionError):
        deep_json.loads("[" * 100_000)


def test_recursion_limit_and_stack_size_are_restored_after_encoding_deep_json() -> None:
    limit, size = sys.getrecursionlimit(), threading.stack_size()
    deep_json.dumps(stack(2000))
    assert (sys.getrecursionlimit(), threading.stack_size()) == (limit, size)
