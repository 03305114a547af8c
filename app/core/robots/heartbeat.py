"""Tells robots that a person's try-out goes on; a robot that hears nothing stops by itself."""

from __future__ import annotations

import threading
import uuid

from nep.errors import NepError
from nep.nodes.publisher import Publisher

ALIVE_S = 0.2


class Heartbeat:
    """Sends ``alive`` five times a second to each robot that beats, in a thread of its own."""

    def __init__(self, sender: str) -> None:
        """``sender`` is the program id of the commands."""
        self._sender = sender
        self._lock = threading.Lock()
        self._robots: dict[str, Publisher] = {}
        self._changed = threading.Event()
        self._closing = False
        self._thread: threading.Thread | None = None

    def beat(self, name: str, publisher: Publisher) -> None:
        """Keep this robot going until `rest`."""
        with self._lock:
            self._robots[name] = publisher
            if self._thread is None and not self._closing:
                self._thread = threading.Thread(target=self._run, name="studio-alive", daemon=True)
                self._thread.start()
        self._changed.set()

    def rest(self, name: str) -> None:
        """This robot is not kept going any more."""
        with self._lock:
            self._robots.pop(name, None)

    def close(self) -> None:
        """End the thread."""
        self._closing = True
        self._changed.set()
        if self._thread is not None:
            self._thread.join(timeout=2)

    def _run(self) -> None:
        while not self._closing:
            with self._lock:
                robots = list(self._robots.values())
            for publisher in robots:
                _tell(publisher, self._sender)
            self._changed.clear()
            self._changed.wait(ALIVE_S if robots else None)


def _tell(publisher: Publisher, sender: str) -> None:
    try:
        publisher.publish({"id": uuid.uuid4().hex, "op": "alive", "from": sender})
    except NepError:
        return  # it has gone; its robot's watchdog does the rest
