"""Reads a message for people: a small one at once, large ones in a thread, one at a time, the newest only."""

from __future__ import annotations

import threading
from dataclasses import dataclass

from app.core.messages.lazy_json import JsonIndex
from nep.errors import NepError
from nep.i18n import _
from nep.messages.message import Message

LARGE_BYTES = 1_000_000
"""JSON above this is looked into, not decoded; what is larger is never read in the window's thread."""
EVERY_S = 1.0


@dataclass(frozen=True, slots=True, eq=False)
class Reading:
    """A message that was read: its ``value``, or the sentence why it can't be (``error``).

    ``index`` tells where things are in a large JSON text; None for other messages.
    """

    message: Message
    value: object = None
    error: str | None = None
    index: JsonIndex | None = None


def read(message: Message) -> Reading:
    """Read a message, in any thread; large JSON is looked into (`app.core.messages.lazy_json`)."""
    try:
        if message.codec == "json" and message.size_bytes > LARGE_BYTES:
            index = JsonIndex(message.data)
            return Reading(message, index.root, index=index)
        return Reading(message, message.payload)
    except (NepError, ValueError) as error:
        return Reading(message, error=str(error))
    except MemoryError:
        return Reading(message, error=_("there is not enough memory for it"))


class Reader:
    """One thread that reads for one panel; it is started by the first message and waits for more."""

    def __init__(self) -> None:
        """Nothing to read yet."""
        self._wake = threading.Condition()
        self._waiting: Message | None = None
        self._reading: Message | None = None
        self._done: Reading | None = None
        self._closing = False
        self._asked_at: float | None = None
        self._thread: threading.Thread | None = None

    @property
    def busy(self) -> bool:
        """Whether something is being read, or waits for it."""
        with self._wake:
            return self._waiting is not None or self._reading is not None

    def ask(self, message: Message) -> None:
        """Read this one next; one that still waits is forgotten."""
        with self._wake:
            self._waiting = message
            if self._thread is None and not self._closing:
                self._thread = threading.Thread(target=self._run, name="studio-reader", daemon=True)
                self._thread.start()
            self._wake.notify()

    def ask_at_leisure(self, message: Message, now: float) -> bool:
        """Read this one unless something is being read, or was begun less than a second ago.

        A large message takes a while, and nobody reads faster. ``now`` is monotonic; whether it will be read.
        """
        if self.busy or (self._asked_at is not None and now - self._asked_at < EVERY_S):
            return False
        self._asked_at = now
        self.ask(message)
        return True

    def take(self) -> Reading | None:
        """What was read last, once."""
        with self._wake:
            done, self._done = self._done, None
        return done

    def forget(self) -> None:
        """Nobody wants what waits or is being read; the next one may be read at once."""
        self._asked_at = None
        with self._wake:
            self._waiting = self._reading = self._done = None

    def close(self) -> None:
        """End the thread; what is being read is waited for a second at most."""
        with self._wake:
            self._closing = True
            self._waiting = self._reading = self._done = None
            self._wake.notify()
        if self._thread is not None:
            self._thread.join(1.0)

    def _run(self) -> None:
        while True:
            with self._wake:
                while self._waiting is None and not self._closing:
                    self._wake.wait()
                if self._closing or self._waiting is None:
                    return
                message = self._reading = self._waiting
                self._waiting = None
            done = read(message)
            with self._wake:
                if self._reading is message:  # else nobody wants it any more
                    self._done, self._reading = done, None
