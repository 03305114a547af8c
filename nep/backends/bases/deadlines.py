"""Timeout thread for service calls, for back ends without an event loop."""

from __future__ import annotations

import math
import threading
import time
from typing import Protocol


class ExpiringClient(Protocol):
    """Client whose pending calls have deadlines."""

    def expire(self, now: float) -> float:
        """Fail calls whose deadline is before `now` and return the next deadline.

        Both times are those of `time.monotonic`; infinity means that no call has a deadline.
        """


class Deadlines:
    """Thread that expires the pending calls of a node's clients. Started with the first client."""

    def __init__(self, node_name: str) -> None:
        self._name = f"nep-calls-{node_name}"
        self._changed = threading.Condition(threading.Lock())
        self._clients: tuple[ExpiringClient, ...] = ()
        self._next_deadline = math.inf
        self._is_closing = False
        self._thread: threading.Thread | None = None

    def add_client(self, client: ExpiringClient) -> None:
        """Add a client and start the thread if necessary."""
        with self._changed:
            self._clients = (*self._clients, client)
            if self._thread is None:
                self._thread = threading.Thread(target=self._run, name=self._name, daemon=True)
                self._thread.start()

    def remove_client(self, client: ExpiringClient) -> None:
        """Remove a closed client."""
        with self._changed:
            self._clients = tuple(each for each in self._clients if each is not client)

    def add(self, deadline: float) -> None:
        """Schedule a check for expired calls at `deadline` (`time.monotonic`) or earlier."""
        with self._changed:
            if deadline < self._next_deadline:
                self._next_deadline = deadline
                self._changed.notify()

    def _run(self) -> None:
        while True:
            with self._changed:
                while not self._is_closing and (remaining_s := self._next_deadline - time.monotonic()) > 0.0:
                    self._changed.wait(min(remaining_s, threading.TIMEOUT_MAX))
                if self._is_closing:
                    return
                self._next_deadline = math.inf
                clients = self._clients
            for client in clients:
                self.add(client.expire(time.monotonic()))

    def close(self, timeout_s: float) -> None:
        """Stop the thread and wait up to `timeout_s` seconds for it to end."""
        with self._changed:
            self._is_closing = True
            self._changed.notify()
        if self._thread is not None and self._thread is not threading.current_thread():
            self._thread.join(timeout_s)
