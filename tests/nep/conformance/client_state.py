"""State of the small client: streams, publishers and subscribers."""

from __future__ import annotations

import queue
from collections import deque
from dataclasses import dataclass, field
from typing import Any

import zmq
from zmq.utils.monitor import recv_monitor_message

from nep.protocol import wire


class Stream:
    """Stream of lines between the tester's thread and the client's."""

    def __init__(self) -> None:
        self._lines: queue.Queue[bytes] = queue.Queue()

    def write(self, line: bytes) -> None:
        self._lines.put(line)

    def flush(self) -> None:
        pass

    def readline(self, _limit: int = -1) -> bytes:
        return self._lines.get()

    def read_now(self) -> bytes | None:
        try:
            return self._lines.get_nowait()
        except queue.Empty:
            return None

    def close(self) -> None:
        self._lines.put(b"")


@dataclass
class Pub:
    record: dict[str, Any]
    socket: zmq.Socket[bytes]
    codec: int
    kept: deque[tuple[bytes, bytes]]
    seq: int = 0
    bytes_sent: int = 0
    others: int = 0
    hellos: dict[int, tuple[bytes, wire.Hello]] = field(default_factory=dict)

    @property
    def id(self) -> int:
        return int(self.record["id"])

    @property
    def topic(self) -> bytes:
        return wire.topic_part(self.record["topic"])


@dataclass
class Source:
    endpoint: str
    last: int | None = None
    has_echoed: bool = False
    promised: int = 0
    late: range = range(0)
    ends_at: float | None = None


class Handshakes:
    """Monitor of a socket for closed connections, which libzmq may not reopen."""

    def __init__(self, socket: zmq.Socket[bytes]) -> None:
        self._socket = socket
        self._monitor = socket.get_monitor_socket(zmq.EVENT_DISCONNECTED)

    def failed(self) -> set[str]:
        """Return the endpoints whose connection has closed since the last call."""
        found = set()
        while self._monitor.poll(0):
            found.add(recv_monitor_message(self._monitor)["endpoint"].decode())
        return found

    def close(self) -> None:
        self._socket.disable_monitor()
        self._monitor.close(0)


@dataclass
class Sub:
    number: int
    record: dict[str, Any]
    socket: zmq.Socket[bytes]
    hello: bytes
    handshakes: Handshakes
    sources: dict[int, Source] = field(default_factory=dict)
    topics: list[str] = field(default_factory=list)
    """Topics that match a subscriber's wildcard pattern."""
    received: int = 0
    lost: int = 0
    problem: str = ""

    @property
    def id(self) -> int:
        return int(self.record["id"])
