"""Network that delivers each message immediately, in the thread of its publisher."""

from __future__ import annotations

import threading
from typing import Any

from tests.core.robots.stop_model.network import (
    Delivery,
    SimulatedNetwork,
    SimulatedNode,
    SimulatedPublisher,
    SimulatedSubscriber,
)


class _DirectQueue:
    """Queue of deliveries that is always empty."""

    def append(self, delivery: Delivery) -> None:
        if not delivery.subscriber.is_closed:
            delivery.subscriber.sink([delivery.message])

    def extend(self, deliveries: Any) -> None:
        for delivery in list(deliveries):
            self.append(delivery)


class DirectNetwork(SimulatedNetwork):
    """Network for threads in virtual time: no message is in flight while they wait."""

    def __init__(self) -> None:
        super().__init__(lambda: 0.0)
        self.queue: Any = _DirectQueue()
        self.lock = threading.RLock()

    def node(self, name: str, **_options: Any) -> SimulatedNode:
        made = _DirectNode(self, f"{self.next_id():016x}", name, "lab", self.next_id())
        self.nodes[made.id] = made
        return made


class _DirectNode(SimulatedNode):
    def new_pub(self, *given: Any, **options: Any) -> SimulatedPublisher:
        with _lock_of(self):
            made = super().new_pub(*given, **options)
            self.network.connect()
        return made

    def new_sub(self, *given: Any, **options: Any) -> SimulatedSubscriber:
        with _lock_of(self):
            made = super().new_sub(*given, **options)
            self.network.connect()
        return made


def _lock_of(node: SimulatedNode) -> threading.RLock:
    assert isinstance(node.network, DirectNetwork)
    return node.network.lock
