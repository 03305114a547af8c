"""Tests of the smallest client of docs/smallest-client.md with nodes of nep, in both directions."""

from __future__ import annotations

import importlib.util
import time
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

import nep
from nep.masters.master import Master
from tests.nep.programs import eventually

ROOT = Path(__file__).parents[3]
EXAMPLE = ROOT / "examples" / "smallest_client.py"


@pytest.fixture(scope="module")
def smallest() -> ModuleType:
    """Return the example as a module."""
    spec = importlib.util.spec_from_file_location("smallest_client", EXAMPLE)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture
def node(smallest: ModuleType, master: Master) -> Iterator[Any]:
    made = smallest.Node("small", master.address)
    yield made
    made.close()


def test_publisher_of_the_smallest_client_reaches_a_subscriber(
    smallest: ModuleType, node: Any, master: Master
) -> None:
    with nep.node("ours") as ours:
        subscriber = ours.new_sub("example", "json")
        publisher = smallest.Publisher(node, "example")
        eventually(lambda: publisher.socket.poll(10))
        for number in range(1, 51):
            publisher.publish({"n": number})
        got = [subscriber.listen(timeout_s=30.0) for _number in range(50)]
        assert got == [(True, {"n": number}) for number in range(1, 51)]
        node.serve()
        (listed,) = ours.graph().topics["example"].publishers
        assert listed.node_id == node.id
        assert subscriber.refused == 0


def test_subscriber_of_the_smallest_client_receives_messages(
    smallest: ModuleType, node: Any, master: Master
) -> None:
    subscriber = smallest.Subscriber(node, "example")
    with nep.node("ours") as ours:
        publisher = ours.new_pub("example", "json")
        eventually(lambda: node.serve() or publisher._transport.has_subscribers)
        for number in range(1, 51):
            publisher.publish({"n": number})
        assert [subscriber.receive(30.0) for _number in range(50)] == [{"n": n} for n in range(1, 51)]
        node.renew_at = time.monotonic()
        eventually(lambda: node.serve() or ours.graph().topics["example"].subscribers[0].received == 50)


def test_node_joins_a_restarted_master(smallest: ModuleType) -> None:
    with Master("127.0.0.1:0", learn_s=0.0) as first:
        node = smallest.Node("small", first.address)
        smallest.Publisher(node, "example")
    with Master(first.address, learn_s=0.0) as second:
        node.renew_at = time.monotonic()
        eventually(lambda: node.serve() or "example" in second.view().topics)
        node.close()
        eventually(lambda: "example" not in second.view().topics)


def test_documentation_of_the_smallest_client_contains_the_example() -> None:
    page = (ROOT / "docs" / "smallest-client.md").read_text("utf-8")
    code = EXAMPLE.read_text("utf-8").partition('"""\n\nimport')[2]
    assert page.partition("```python\n")[2].partition("```")[0] == f"import{code}"
