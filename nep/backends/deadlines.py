"""Deadlines: a thread that ends calls that waited too long, for back ends that have no loop of their own."""

from __future__ import annotations

import math
import threading
import time
from typing import Protocol

__all__ = ["Deadlines", "Expiring"]


class Expiring(Protocol):
    """A client that has calls under way."""

    def expire(self, now: float) -> float:
        """End what waited too long; when to do so again."""


class Deadlines:
    """A thread for all clients of a node, from the first one on."""

    def __init__(self, node_name: str) -> None:
        self._name = f"nep-calls-{node_name}"
        self._changed = threading.Condition(threading.Lock())
        self._clients: tuple[Expiring, ...] = ()
        self._due = math.inf
        self._is_closing = False
        self._thread: threading.Thread | None = None

    def watch(self, client: Expiring) -> None:
        """Its calls, too."""
        with self._changed:
            self._clients = (*self._clients, client)
            if self._thread is None:
                self._thread = threading.Thread(target=self._run, name=self._name, daemon=True)
                self._thread.start()

    def forget(self, client: Expiring) -> None:
        """It is closed."""
        with self._changed:
            self._clients = tuple(each for each in self._clients if each is not client)

    def add(self, deadline: float) -> None:
        """A call ends then at the latest."""
        with self._changed:
            if deadline < self._due:
                self._due = deadline
                self._changed.notify()

    def _run(self) -> None:
        while True:
            with self._changed:
                while not self._is_closing and (left := self._due - time.monotonic()) > 0.0:
                    self._changed.wait(min(left, threading.TIMEOUT_MAX))
                if self._is_closing:
                    return
                self._due = math.inf
                clients = self._clients
            for client in clients:
                self.add(client.expire(time.monotonic()))

    def close(self, timeout_s: float) -> None:
        """End the thread."""
        with self._changed:
            self._is_closing = True
            self._changed.notify()
        if self._thread is not None and self._thread is not threading.current_thread():
            self._thread.join(timeout_s)
