"""Subscriber returned by `Node.new_sub`."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING

from nep.backends.base import SubscriberSpec, SubscriberTransport
from nep.errors import ClosedError, DecodeError
from nep.messages.codecs import codec_for
from nep.messages.message import UNDECODED, Message
from nep.nodes.arguments import check_optional_time_limit
from nep.nodes.async_reading import AsyncMessages, AsyncReader
from nep.system.forks import current_generation
from nep.system.log_rarely import is_logged

if TYPE_CHECKING:
    from typing_extensions import Self


WAIT_SLICE_S = 0.1
"""Maximum duration of a single wait in seconds, because on Windows Ctrl+C doesn't interrupt a wait."""

_logger = logging.getLogger("nep")


class Subscriber:
    """Subscriber to one topic or pattern. Created by `Node.new_sub`.

    Messages of one publisher are returned in the order of their publication.

    Iterating (`for` or `async for`) yields `Message` objects until the subscriber is closed. Usable as a
    context manager.

        has_message, payload = sub.listen(timeout_s=1.0)
    """

    is_typed = False
    """True if payloads are instances of a declared type. See `nep.nodes.typed`."""

    def __init__(
        self,
        transport: SubscriberTransport,
        spec: SubscriberSpec,
        on_close: Callable[[Subscriber], object] | None = None,
    ) -> None:
        self._on_close = on_close
        self._generation = current_generation()
        self._transport = transport
        self._spec = spec
        self._ready = transport.ready
        self._empty = codec_for(spec.msg_type).empty
        self._async_reader = AsyncReader(transport, self._take_typed)
        self._problem = ""
        self._undecodable_count = 0

    @property
    def topic(self) -> str:
        """Name of the topic, or the pattern."""
        return self._spec.topic

    @property
    def msg_type(self) -> str:
        """Registered message type. A received message has its publisher's type."""
        return self._spec.msg_type

    @property
    def id(self) -> int:
        """Id of the subscriber in the graph."""
        return self._spec.id

    @property
    def received(self) -> int:
        """Number of received messages."""
        return self._transport.received

    @property
    def lost(self) -> int | None:
        """Number of messages lost in transit or dropped unread; None if the back end can't detect it."""
        return self._transport.lost

    @property
    def refused(self) -> int:
        """Number of received frames that were not valid messages. An alert in the graph states the reason."""
        return self._transport.refused

    @property
    def is_closed(self) -> bool:
        """True if the subscriber or its node was closed."""
        return self._generation.is_inherited or self._transport.is_closed

    def listen(self, block_mode: bool = False, *, timeout_s: float | None = None) -> tuple[bool, object]:
        """Return (True, payload) for the next message, or (False, empty payload) if there is none.

        Messages that can't be decoded are skipped, logged, and reported as an alert in the graph.

        Args:
            block_mode: True to wait without limit, unless `timeout_s` is given.
            timeout_s: Time limit in seconds. Without either argument the call doesn't wait.

        Raises:
            ClosedError: The subscriber is closed.
            ValueError: `timeout_s` is negative or not a number.
        """
        try:
            is_invalid = timeout_s is not None and not timeout_s >= 0.0
        except TypeError:
            is_invalid = True
        if is_invalid:
            check_optional_time_limit("timeout_s", timeout_s)
        while self._ready and not self._generation.is_inherited:  # already read
            try:
                return True, self.decoded_unshared(self._ready.popleft())
            except IndexError:  # another thread took the last one
                break
            except DecodeError:
                continue  # already logged and reported
        return self._wait_and_listen(block_mode, timeout_s)

    def _wait_and_listen(self, block_mode: bool, timeout_s: float | None) -> tuple[bool, object]:
        limit_s = None if block_mode and timeout_s is None else timeout_s or 0.0
        deadline = time.monotonic() + limit_s if limit_s else None
        while True:
            message = self._receive(limit_s)
            if message is None:
                return False, self._empty()
            try:
                return True, self.decoded_unshared(message)
            except DecodeError:
                if deadline is not None:
                    limit_s = max(0.0, deadline - time.monotonic())

    # ---- names of the original module

    def listen_json(self, block_mode: bool = False) -> tuple[bool, object]:
        """Return the next payload as `listen` does, for a topic of type `json`."""
        return self.listen(block_mode)

    def listen_string(self, block_mode: bool = False) -> tuple[bool, object]:
        """Return the next payload as `listen` does, for a topic of type `string`."""
        return self.listen(block_mode)

    def listen_image(self, block_mode: bool = False) -> tuple[bool, object]:
        """Return the next payload as `listen` does, for a topic of type `image`."""
        return self.listen(block_mode)

    def listen_bytes(self, block_mode: bool = False) -> tuple[bool, object]:
        """Return the next payload as `listen` does, for a topic of type `bytes`."""
        return self.listen(block_mode)

    def listen_msgpack(self, block_mode: bool = False) -> tuple[bool, object]:
        """Return the next payload as `listen` does, for a topic of type `msgpack`."""
        return self.listen(block_mode)

    listenJson = listenDictionary = listen_json  # noqa: N815 - names of the original module from 0.5.4.7 on
    listenString = listenStringTopic = listen_string  # noqa: N815
    listenImages = listen_image  # noqa: N815
    listenBytes = listen_bytes  # noqa: N815
    listenMsgPack = listen_msgpack  # noqa: N815

    def receive(self, timeout_s: float | None = None) -> Message | None:
        """Wait for the next message and return it, not yet decoded, or None after the time limit.

        Args:
            timeout_s: Time limit in seconds; None waits without limit.

        Raises:
            ClosedError: The subscriber is closed.
            ValueError: `timeout_s` is negative.
        """
        try:
            is_invalid = timeout_s is not None and not timeout_s >= 0.0
        except TypeError:
            is_invalid = True
        if is_invalid:
            check_optional_time_limit("timeout_s", timeout_s)
        message = self._receive(timeout_s)
        return None if message is None else self.typed(message)

    def _receive(self, timeout_s: float | None) -> Message | None:
        if self._ready or self.is_closed or (timeout_s is not None and timeout_s <= 0.0):
            return self._take_or_raise()
        wait_s = WAIT_SLICE_S if timeout_s is None or timeout_s > WAIT_SLICE_S else timeout_s
        message = self._transport.receive(wait_s)
        return message or self._receive_after_slice(None if timeout_s is None else timeout_s - wait_s)

    def _receive_after_slice(self, timeout_s: float | None) -> Message | None:
        deadline = None if timeout_s is None else time.monotonic() + timeout_s
        while True:
            if self.is_closed:
                raise self._closed_error()
            remaining_s = WAIT_SLICE_S if deadline is None else min(WAIT_SLICE_S, deadline - time.monotonic())
            if remaining_s <= 0.0:
                return None
            message = self._transport.receive(remaining_s)
            if message is not None:
                return message

    async def receive_async(self, timeout_s: float | None = None) -> Message | None:
        """Wait for the next message as `receive` does, in an asyncio event loop.

        Cancelling loses no message.
        """
        return await self._async_reader.receive(check_optional_time_limit("timeout_s", timeout_s))

    async def listen_async(self, timeout_s: float | None = None) -> tuple[bool, object]:
        """Wait for the next payload as `listen` does, in an asyncio event loop.

        Waits without limit by default.
        """
        limit_s = check_optional_time_limit("timeout_s", timeout_s)
        deadline = None if limit_s is None else time.monotonic() + limit_s
        while True:
            message = await self.receive_async(limit_s)
            if message is None:
                return False, self._empty()
            try:
                return True, self.decoded(message)
            except DecodeError:
                limit_s = None if deadline is None else max(0.0, deadline - time.monotonic())

    def take(self) -> Message | None:
        """Return the next message without waiting, not yet decoded or converted to the declared type.

        Returns None if there is none or the subscriber is closed.
        """
        if self._generation.is_inherited:
            return None
        try:
            return self._ready.popleft()
        except IndexError:  # also if another thread took the last one
            return None if self._transport.is_closed else self._transport.poll()

    def _take_or_raise(self) -> Message | None:
        message = self.take()
        if message is None and self.is_closed:
            raise self._closed_error()
        return message

    def _take_typed(self) -> Message | None:
        message = self._take_or_raise()
        return None if message is None else self.typed(message)

    def _closed_error(self) -> ClosedError:
        return ClosedError(f"subscriber '{self.topic}'", is_forked=self._generation.is_inherited)

    def typed(self, message: Message) -> Message:
        """Convert a message of the transport to the message that this subscriber returns."""
        return message

    def decoded(self, message: Message) -> object:
        """Return the decoded payload of a message.

        Errors are logged at increasing intervals, and reported as an alert in the graph.

        Raises:
            DecodeError: The payload can't be decoded.
        """
        try:
            payload = message.payload
        except DecodeError as error:
            self._report_problem(error)
            raise
        if self._problem:
            self._problem = ""
            self._transport.report("")
        return payload

    def decoded_unshared(self, message: Message) -> object:
        """Decode and return the payload of an unshared message without caching it in the message."""
        if self._problem or message.decoded is not UNDECODED:
            return self.decoded(message)
        try:
            return message.kind.decode(message.raw, message.extension)
        except DecodeError as error:
            self._report_problem(error)
            raise

    def _report_problem(self, error: DecodeError) -> None:
        self._undecodable_count += 1
        if is_logged(self._undecodable_count):
            _logger.warning(
                "a message on '%s' can't be read (%d so far): %s", self.topic, self._undecodable_count, error
            )
        self._problem = str(error)
        self._transport.report(self._problem)

    def close(self) -> None:
        """Unregister the subscriber and discard its unread messages. Idempotent."""
        if not self._generation.is_inherited:
            self._transport.close()
            if self._on_close is not None:
                self._on_close(self)

    def __iter__(self) -> Iterator[Message]:
        while True:
            try:
                message = self.receive()
            except ClosedError:
                return
            if message is not None:
                yield message
                message = None  # release the payload before waiting for the next message

    def __aiter__(self) -> AsyncMessages:
        return AsyncMessages(self._async_reader)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_exc: object) -> None:
        self.close()

    def __repr__(self) -> str:
        return f"Subscriber({self.topic!r}, {self.msg_type!r})"
