"""A small message broker, which stands in for a real one (MQTT, NATS, Redis) in the example of a back end.

    python3 examples/backend/broker.py 127.0.0.1:7790

Each frame of a client begins with one letter:

    S <number> LF <prefix>         subscribe to all subjects that begin with a prefix
    U <number>                     unsubscribe
    P <subject> NUL <data>         publish
    R <subject> NUL <data>         publish and retain; no data removes the retained message
    Q                              disconnect

A subscriber receives ``<number> NUL <subject> NUL <data>``. Retained messages are delivered to later
subscribers, and are removed when the connection of their publisher ends. Frames of one client are handled in
their order. The queues to the clients are unbounded, so this broker is an example and not a product.
"""

from __future__ import annotations

import contextlib
import logging
import queue
import sys
import threading
import time
import uuid
from collections.abc import Callable, Iterator
from multiprocessing.connection import Client, Connection, Listener

MAX_QUEUED_FRAMES = 100_000
"""Maximum number of frames that wait for a slow broker; further messages are dropped."""
SYNC_TIMEOUT_S = 5.0
POLL_S = 0.2

_Frames = queue.SimpleQueue["bytes | None"]


class _Client:
    def __init__(self, connection: Connection) -> None:
        self.connection = connection
        self.prefixes: dict[bytes, bytes] = {}
        self.outgoing: _Frames = queue.SimpleQueue()
        self.is_closing = False

    def deliver(self, subject: bytes, data: bytes) -> None:
        for number, prefix in self.prefixes.items():
            if subject.startswith(prefix):
                self.outgoing.put(b"\0".join((number, subject, data)))

    def frames(self) -> Iterator[bytes]:
        with contextlib.suppress(EOFError, OSError):  # the client has closed the connection, or was killed
            while not self.is_closing:
                if self.connection.poll(POLL_S):
                    frame = self.connection.recv_bytes()
                    if frame == b"Q":
                        break
                    yield frame

    def send_queued(self) -> None:
        with contextlib.suppress(OSError):  # `frames` ends, too
            while (frame := self.outgoing.get()) is not None:
                self.connection.send_bytes(frame)


class Broker:
    """Broker that listens until it is closed.

    Args:
        address: Address to listen on; port 0 selects a free port.
    """

    def __init__(self, address: str = "127.0.0.1:0") -> None:
        host, _, port = address.rpartition(":")
        self._listener = Listener((host, int(port)), backlog=100)
        self.address = "{}:{}".format(*self._listener.address)
        """Address with the actual port."""
        self._lock = threading.Lock()
        self._clients: list[_Client] = []
        self._retained: dict[bytes, tuple[_Client, bytes]] = {}
        self._is_closed = False
        self._threads: list[threading.Thread] = []
        self._start(self._accept)

    def _start(self, target: Callable[..., None], *arguments: object) -> None:
        thread = threading.Thread(target=target, args=arguments, name="broker", daemon=True)
        self._threads.append(thread)
        thread.start()

    def _accept(self) -> None:
        while not self._is_closed:
            try:
                client = _Client(self._listener.accept())
            except OSError:  # closed, or the client has gone already
                continue
            with self._lock:
                self._clients.append(client)
            self._start(self._serve, client)
            self._start(client.send_queued)

    def _serve(self, client: _Client) -> None:
        for frame in client.frames():
            self._handle(client, frame[:1], frame[1:])
        with self._lock:
            self._clients.remove(client)
            for subject in [each for each, (owner, _) in self._retained.items() if owner is client]:
                self._publish(client, subject, b"", is_retained=True)
        client.outgoing.put(None)
        client.connection.close()

    def _handle(self, client: _Client, operation: bytes, rest: bytes) -> None:
        with self._lock:
            if operation == b"S":
                number, _, prefix = rest.partition(b"\n")
                newcomer = _Client(client.connection)  # only the new subscription gets retained messages
                newcomer.prefixes, newcomer.outgoing = {number: prefix}, client.outgoing
                for subject, (_owner, data) in self._retained.items():
                    newcomer.deliver(subject, data)
                client.prefixes[number] = prefix
            elif operation == b"U":
                client.prefixes.pop(rest, None)
            elif operation in {b"P", b"R"}:
                subject, _, data = rest.partition(b"\0")
                self._publish(client, subject, data, is_retained=operation == b"R")

    def _publish(self, sender: _Client, subject: bytes, data: bytes, *, is_retained: bool) -> None:
        if is_retained:
            self._retained.pop(subject, None)  # the newest is the last
            if data:
                self._retained[subject] = (sender, data)
        for client in self._clients:
            client.deliver(subject, data)

    def close(self) -> None:
        """Stop listening and close all connections."""
        self._is_closed = True
        with contextlib.suppress(OSError):
            Client(self._listener.address).close()  # ends the wait in `accept`
        with self._lock:
            for client in self._clients:
                client.is_closing = True
        for thread in self._threads:
            thread.join()
        self._listener.close()


class BrokerConnection:
    """Connection of a client: what the library of a real broker provides. Thread-safe.

    Raises `OSError` if the broker can't be reached.

    Args:
        address: Address of the broker.
        wait_s: Seconds to wait for the broker; None waits forever.
        interval_s: Interval of `on_interval` in seconds.
        on_interval: Called in the reading thread.
    """

    def __init__(
        self, address: str, wait_s: float | None, interval_s: float, on_interval: Callable[[], None]
    ) -> None:
        self._interval_s = interval_s
        self._on_interval = on_interval
        self._outgoing: queue.Queue[bytes | None] = queue.Queue(MAX_QUEUED_FRAMES)
        self._callbacks: dict[str, Callable[[str, bytes], None]] = {}
        self._syncs: set[threading.Event] = set()
        self._is_connected = True
        self._connection = _connect(address, wait_s)
        self._threads = [
            threading.Thread(target=each, name="nep-broker", daemon=True)
            for each in (self._read, self._write)
        ]
        for thread in self._threads:
            thread.start()

    def publish(self, subject: str, data: bytes, *, is_retained: bool = False) -> None:
        """Send a message without waiting. It is dropped if the broker is too slow."""
        with contextlib.suppress(queue.Full):
            self._outgoing.put_nowait(
                b"".join((b"R" if is_retained else b"P", subject.encode(), b"\0", data))
            )

    def subscribe(self, prefix: str, callback: Callable[[str, bytes], None]) -> str:
        """Call a function in the reading thread with subject and data of each message; return a number."""
        number = uuid.uuid4().hex
        self._callbacks[number] = callback
        self._outgoing.put(f"S{number}\n{prefix}".encode())
        return number

    def unsubscribe(self, number: str) -> None:
        """End a subscription."""
        self._callbacks.pop(number, None)
        self._outgoing.put(f"U{number}".encode())

    def sync(self) -> None:
        """Wait until all messages that the broker has received so far were handled in this connection."""
        if threading.current_thread() is self._threads[0]:
            return  # the messages before the present one were handled
        arrived = threading.Event()
        self._syncs.add(arrived)
        number = self.subscribe(subject := f"sync\n{uuid.uuid4().hex}", lambda _subject, _data: arrived.set())
        self.publish(subject, b"")
        if self._is_connected:
            arrived.wait(SYNC_TIMEOUT_S)
        self._syncs.discard(arrived)
        self.unsubscribe(number)

    def _read(self) -> None:
        call_at = 0.0
        with contextlib.suppress(EOFError, OSError):  # closed by this program, or the broker has ended
            while True:
                if self._connection.poll(self._interval_s):
                    number, subject, data = self._connection.recv_bytes().split(b"\0", 2)
                    callback = self._callbacks.get(number.decode())
                    if callback is not None:
                        with _logged_errors():
                            callback(subject.decode(), data)
                if time.monotonic() >= call_at:
                    self._on_interval()
                    call_at = time.monotonic() + self._interval_s
        self._is_connected = False
        for arrived in tuple(self._syncs):
            arrived.set()

    def _write(self) -> None:
        with contextlib.suppress(OSError):  # `_read` ends, too
            while (frame := self._outgoing.get()) is not None:
                self._connection.send_bytes(frame)

    def close(self, timeout_s: float) -> None:
        """Send what is queued, disconnect, and join the threads."""
        self.sync()
        self._outgoing.put(b"Q")
        self._outgoing.put(None)
        for thread in self._threads:
            if thread is not threading.current_thread():
                thread.join(timeout_s)
        self._connection.close()


@contextlib.contextmanager
def _logged_errors() -> Iterator[None]:
    try:
        yield
    except Exception:  # a subject that another program made up must not end the thread
        logging.getLogger("nep").exception("callback of the broker's connection failed")


def _connect(address: str, wait_s: float | None) -> Connection:
    host, _, port = address.rpartition(":")
    deadline = None if wait_s is None else time.monotonic() + wait_s
    while True:
        try:
            return Client((host, int(port)))
        except OSError:
            if deadline is not None and time.monotonic() >= deadline:
                raise
            time.sleep(0.05)


if __name__ == "__main__":
    broker = Broker(sys.argv[1] if len(sys.argv) > 1 else "127.0.0.1:7790")
    print(f"broker at {broker.address}; Ctrl+C stops it")
    threading.Event().wait()
