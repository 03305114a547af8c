"""Publisher over zenoh, which also replies to the hellos of new subscribers."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from contextlib import suppress
from typing import Any

from nep.backends.base import PublisherSpec
from nep.backends.bases.publisher import BasePublisher
from nep.backends.zenoh.keys import data_key, hello_key
from nep.backends.zenoh.library import create_handler, load_zenoh
from nep.errors import ClosedError
from nep.messages.encoded import Encoded
from nep.messages.history import History
from nep.protocol.requests import PublisherRecord
from nep.protocol.wire import Header, extension_part


class ZenohPublisher(BasePublisher):
    """Publisher of a session.

    zenoh drops messages for subscribers whose queues are full; the subscribers count the losses.

    Args:
        session: Session of zenoh.
        spec: Settings of the publisher.
        count_subscribers: Returns the number of subscribers of a topic.
        on_close: Unregisters and flushes the publisher within a time limit in seconds.
    """

    def __init__(
        self,
        session: Any,  # noqa: ANN401 - zenoh is not typed
        spec: PublisherSpec,
        count_subscribers: Callable[[str], int],
        on_close: Callable[[ZenohPublisher, float], None],
    ) -> None:
        super().__init__(spec, threading.Lock())
        self.missing: tuple[str, ...] = ()
        zenoh = load_zenoh()
        self.record = PublisherRecord(
            spec.id, spec.topic, spec.msg_type, spec.codec.name, (data_key(spec.topic),), spec.is_latched
        )
        self.missing_ids: tuple[int, ...] = ()
        self._count_subscribers = count_subscribers
        self._on_close = on_close
        self._history: History[tuple[bytes, bytes]] = History(spec.history)
        self._is_closed = False
        self._has_matching_subscribers = False
        self._zenoh_publisher: Any = session.declare_publisher(
            data_key(spec.topic), congestion_control=zenoh.CongestionControl.DROP
        )
        self._listener: Any = self._zenoh_publisher.declare_matching_listener(
            create_handler(self._handle_matching)
        )
        self._has_matching_subscribers = bool(self._zenoh_publisher.matching_status.matching)
        self._hello_queryable: Any = session.declare_queryable(
            hello_key(spec.topic, spec.id), create_handler(self._handle_hello)
        )

    # ---- subscribers

    @property
    def subscribers(self) -> int:
        """Number of subscribers of the topic."""
        return self._count_subscribers(self.spec.topic)

    @property
    def has_subscribers(self) -> bool:
        """True if the topic has subscribers, including programs that don't use nep."""
        return self._has_matching_subscribers or self.subscribers > 0

    def _handle_matching(self, status: Any) -> None:  # noqa: ANN401 - zenoh is not typed
        self._has_matching_subscribers = bool(status.matching)

    def _handle_hello(self, query: Any) -> None:  # noqa: ANN401 - zenoh is not typed
        # Runs in a zenoh thread. Replies with the history and the number of the last message.
        with self._stats_lock:
            history = () if self._is_closed else tuple(self._history)
            header = Header(self.spec.codec.number, 0, self.count, time.time_ns(), self.spec.id)
            is_closed = self._is_closed
        with query:  # without the lock: a querier that doesn't read the reply must not block the others
            for data, attachment in history:
                query.reply(self._key, data, attachment=attachment)
            if not is_closed:
                query.reply(self._key, b"", attachment=header.pack())

    @property
    def _key(self) -> str:
        return hello_key(self.spec.topic, self.spec.id)

    # ---- sending

    def send(self, encoded: Encoded) -> None:
        """Publish a message.

        Raises `ClosedError`, and `WireError` for an extension that can't be encoded.
        """
        data = encoded.data if isinstance(encoded.data, bytes) else bytes(encoded.data)
        extension = extension_part(encoded.extension) if encoded.extension else b""
        with self._stats_lock:
            if self._is_closed:
                raise ClosedError(f"publisher '{self.spec.topic}'")
            attachment = self._next_header_locked(len(data), has_extension=bool(extension)).pack() + extension
            self._history.add((data, attachment), len(data))
            self._zenoh_publisher.put(data, attachment=attachment)

    # ---- closing

    def close(self, timeout_s: float) -> None:
        """Flush for up to `timeout_s` seconds and unregister. Must be called only once."""
        self._on_close(self, timeout_s)

    def mark_closed(self) -> bool:
        """Stop accepting messages; return False if the publisher is already closed."""
        with self._stats_lock:
            was_closed, self._is_closed = self._is_closed, True
            return not was_closed

    def release(self) -> None:
        """Undeclare the publisher's key expressions at the session."""
        for entity in (self._hello_queryable, self._listener, self._zenoh_publisher):
            with suppress(load_zenoh().ZError):  # closing the session has undeclared it
                entity.undeclare()
