"""Connections of the small client, which recover when libzmq gives one up after a failed handshake."""

from __future__ import annotations

from typing import Any

import zmq

from nep.protocol import topic_pattern
from tests.nep.conformance.client_state import Handshakes, Source, Sub

__all__ = ["Connections", "Handshakes"]


class Connections:
    """Mixin of `Client` for its connections."""

    master: zmq.Socket[bytes]
    master_endpoint: str
    subs: dict[int, Sub]
    filters: Any
    hello: Any

    def connect(self, remotes: Any) -> None:
        for remote in remotes:
            record = remote["publisher"]
            for sub in self.subs.values():
                if self.hears(sub, record["topic"]):
                    source = sub.sources.setdefault(record["id"], Source(""))
                    endpoint = next(iter(record.get("endpoints", ())), "")
                    if not endpoint.startswith("tcp://") or " " in endpoint:
                        self.unusable(sub, endpoint)
                    elif source.endpoint != endpoint:
                        self.move(sub, source, endpoint)

    def expect_all_of(self, publisher: int) -> None:
        for sub in self.subs.values():
            source = sub.sources.get(publisher)
            if source is not None and source.last is None:
                source.last = 0

    def hears(self, sub: Sub, topic: str) -> bool:
        if not sub.record.get("pattern"):
            return bool(sub.record["topic"] == topic)
        if not topic_pattern.matches(sub.record["topic"], topic):
            return False
        if topic not in sub.topics:
            sub.topics.append(topic)
            for each in self.filters(topic, self.hello(sub.id, topic)):
                sub.socket.subscribe(each)
        return True

    def unusable(self, sub: Sub, endpoint: str) -> None:
        sub.problem = f"{endpoint} is not an endpoint"

    def move(self, sub: Sub, source: Source, endpoint: str) -> None:
        if source.endpoint:
            sub.socket.disconnect(source.endpoint)
            source.has_echoed = False
        source.endpoint = endpoint
        sub.socket.connect(endpoint)

    def reconnect_master(self) -> None:
        self.connect_again(self.master, self.master_endpoint)

    def fix(self, sub: Sub, failed: set[str]) -> None:
        # An event of an endpoint that was disconnected meanwhile must not end the connection to the new one.
        for source in sub.sources.values():
            if source.endpoint in failed and not source.has_echoed:
                self.connect_again(sub.socket, source.endpoint)

    def connect_again(self, socket: zmq.Socket[bytes], endpoint: str) -> None:
        socket.disconnect(endpoint)
        socket.connect(endpoint)
