"""What a program needs of NEP, and how it reads its messages."""

from __future__ import annotations

import uuid
from collections.abc import Callable, Mapping, Sequence
from typing import Protocol

from nep.errors import NepError
from nep.messages.message import Message
from nep.protocol.graph_view import GraphView


class Publisher(Protocol):
    """What is needed of NEP's publisher."""

    def publish(self, payload: object) -> None:
        """Send one message."""
        ...


class Node(Protocol):
    """What is needed of NEP's node."""

    def new_pub(self, topic: str, msg_type: str = "json") -> Publisher:
        """A publisher."""
        ...

    def new_sub(
        self, topic: str, msg_type: str = "json", *, sink: Callable[[Sequence[Message]], None]
    ) -> object:
        """A subscriber whose messages go to `sink`, in the node's thread."""
        ...

    def graph(self, timeout_s: float = 2.0) -> GraphView:
        """Who is there."""
        ...


def payload_of(message: Message) -> object:
    """What a message says; None for one that can't be decoded, which is as good as none."""
    try:
        return message.payload
    except NepError:
        return None


def value_of(payload: object) -> object:
    """The value in a property's ``{"value": …}``, else all of it."""
    if isinstance(payload, Mapping) and set(payload) == {"value"}:
        return payload["value"]
    return payload


def new_id(kind: str) -> str:
    """An id that nobody else has, with its kind in front."""
    return f"{kind}-{uuid.uuid4().hex[:12]}"
