"""Readable: what an inlet reads from: a socket that turns parts into messages."""

from __future__ import annotations

from collections import deque
from typing import Protocol

from nep.backends.zeromq.refusals import Refusals
from nep.messages.message import Message

__all__ = ["Into", "Readable"]

Into = list[Message] | deque[Message]
"""Where messages are put."""


class Readable(Protocol):
    """A socket that turns what comes into messages. It is used under the inlet's lock only."""

    fd: int
    refusals: Refusals
    """Messages that could not be understood."""

    @property
    def received(self) -> int:
        """Messages that arrived."""

    @property
    def lost(self) -> int | None:
        """Messages that did not; None when nobody can know."""

    @property
    def problem(self) -> str:
        """What is wrong as long as nothing changes; empty when nothing is."""

    @property
    def has_input(self) -> bool:
        """Whether something can be read. Also takes note of connections that came and went."""

    def read_into(self, into: Into, most: int, room: int, *, may_wait: bool = False) -> int:
        """Read until there is nothing more, `most` are read, or `room` bytes are full; how many were.

        With `may_wait` the first is waited for, `SHORT_WAIT_S` at most.
        """

    def read(self, *, may_wait: bool = False) -> Message | None:
        """The next message; None when there is nothing more, with `may_wait` within `SHORT_WAIT_S`."""

    def dropped(self, count: int) -> None:
        """So many messages that had been received were dropped for lack of room."""

    def close(self) -> None:
        """Close the socket."""
