"""Networks of every back end for the tests of bridges, and helper functions."""

from __future__ import annotations

import itertools
import os
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from typing import TYPE_CHECKING

import pytest

import nep
from nep.masters.master import Master
from nep.programs.bridges import (
    Bridge,
    BridgeConfiguration,
    BridgeTopic,
    Route,
    RouteCounts,
    TopicEnd,
    side_configuration,
)
from tests.nep.meeting import extend_handshakes
from tests.nep.programs import eventually

if TYPE_CHECKING:
    from typing_extensions import Self

_names = itertools.count()


class Net:
    """Network of one back end, with its own nodes. Usable as a context manager."""

    def __init__(self, backend: str) -> None:
        self.backend = backend
        self._opened = ExitStack()
        number = next(_names)
        if backend in ("zeromq", "nanomsg"):
            self.master = self._opened.enter_context(Master("127.0.0.1:0", learn_s=0.0)).address
        elif backend == "zenoh":
            self.master = f"local/bridges-{os.getpid()}-{number}"
        else:
            self.master = f"bridges-{number}"

    def node(self, name: str) -> nep.Node:
        return self._opened.enter_context(nep.node(name, self.backend, master=self.master))

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_exc: object) -> None:
        self._opened.close()


@contextmanager
def nets(*backends: str) -> Iterator[list[Net]]:
    """Yield a network of each back end; nodes wait long for handshakes."""
    with pytest.MonkeyPatch.context() as monkeypatch, ExitStack() as opened:
        extend_handshakes(monkeypatch)
        yield [opened.enter_context(Net(each)) for each in backends]


def configured(a: Net, b: Net, *topics: BridgeTopic, name: str = "test") -> BridgeConfiguration:
    return BridgeConfiguration(
        name, side_configuration(a.backend, a.master), side_configuration(b.backend, b.master), topics
    )


def topic(a: str, b: str = "", direction: str = "both", **more: object) -> BridgeTopic:
    """Return a topic of a bridge. Keyword arguments include a_type, b_type and max_rate_hz."""
    a_end = TopicEnd(a, str(more.pop("a_type", "")))
    b_end = TopicEnd(b or a, str(more.pop("b_type", "")))
    return BridgeTopic(a_end, b_end, direction, **more)  # type: ignore[arg-type]


@contextmanager
def bridged(a: Net, b: Net, *topics: BridgeTopic, name: str = "test") -> Iterator[Bridge]:
    with Bridge(configured(a, b, *topics, name=name)) as bridge:
        assert bridge.wait_until_ready(30.0)
        yield bridge


def route(bridge: Bridge, origin: str, name: str) -> Route:
    """Return the route that starts at the topic of a side."""
    (found,) = [each for each in bridge.routes if (each.origin.side, each.origin.topic) == (origin, name)]
    return found


def settled(found: Route, received: int) -> RouteCounts:
    """Wait until `received` messages have arrived and none waits. Check that each is counted once."""
    eventually(lambda: found.counts().received >= received and not found.counts().waiting)
    counts = found.counts()
    assert counts.received == counts.sent + counts.thinned + counts.failed + counts.dropped
    return counts


def taken(subscriber: nep.Subscriber, count: int) -> list[object]:
    """Receive `count` payloads."""
    return [subscriber.listen(timeout_s=30.0)[1] for _ in range(count)]


def silent(subscriber: nep.Subscriber) -> bool:
    """Return whether no message arrives within 0.3 s."""
    return subscriber.receive(0.3) is None
