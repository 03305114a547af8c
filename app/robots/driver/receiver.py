"""Reception of a robot's messages: stop commands are executed immediately, everything else is queued.

The network's thread only decodes messages that may be a stop, so that large messages don't delay a stop.
"""

from __future__ import annotations

import json
import logging
import re
import threading
from collections.abc import Callable, Iterable, Sequence
from functools import partial
from typing import Protocol

from app.robots.driver.tasks import Tasks
from nep.errors import DecodeError
from nep.i18n import _, number
from nep.messages.message import Message
from nep.system.log_rarely import is_logged

MAX_COMMAND_BYTES = 64_000
_MAX_BACKLOG = 2_000
_MAX_BACKLOG_BYTES = 16_000_000
_SEARCH_WINDOW_BYTES = 2_048
_ID_PATTERN = re.compile(rb'"id"\s*:\s*"([\w .:/-]{1,200})"', re.ASCII)
_OPERATION_PATTERN = re.compile(rb'"op"\s*:\s*"(\w{1,20})"', re.ASCII)
_log = logging.getLogger(__name__)


class Dialect(Protocol):
    """Interface of an interpreter for the commands on one topic."""

    def is_stop(self, command: object) -> bool:
        """Return True if a command stops the robot. Thread-safe."""

    def stop(self, command: object) -> None:
        """Stop the robot immediately. Thread-safe."""

    def receive(self, command: object, publisher: int | None, epoch: int | None) -> None:
        """Handle a command. Called in the thread of the robot's `Tasks`.

        Args:
            command: Payload of any type.
            publisher: Id of the publisher.
            epoch: Value of `Tasks.epoch` when the message was received.
        """

    def reject(self, command_id: str, operation: str, error: str) -> None:
        """Reply with an error to a command that was not decoded. Called in the thread of the robot's `Tasks`.

        Args:
            command_id: Id of the command.
            operation: Operation of the command, such as "invoke".
            error: Error message.
        """


class RejectedMessages:
    """Counter of messages to one robot that were not handled. Logs at increasing intervals. Thread-safe.

    Args:
        robot: Name of the robot.
    """

    def __init__(self, robot: str) -> None:
        self.count = 0
        self._robot = robot
        self._lock = threading.Lock()

    def add(self, topic: str, reason: str) -> None:
        """Count a message.

        Args:
            topic: Name of the topic.
            reason: Reason for the log.
        """
        with self._lock:
            self.count += 1
            count = self.count
        if is_logged(count):
            _log.warning(
                "%s: a message on '%s' was rejected (%d so far): %s", self._robot, topic, count, reason
            )


class MessageQueue:
    """Bounded queue of a topic's messages, which are decoded in another thread. Thread-safe.

    Args:
        topic: Name of the topic.
        post: Runs a callback in the decoding thread.
        rejected: Counter of messages dropped because they are too large or the queue is full.
        max_message_bytes: Maximum size of a message in bytes.
    """

    def __init__(
        self,
        topic: str,
        post: Callable[[Callable[[], object]], object],
        rejected: RejectedMessages,
        max_message_bytes: int,
    ) -> None:
        self.max_message_bytes = max_message_bytes
        self._topic, self._post, self._rejected = topic, post, rejected
        self._lock = threading.Lock()
        self._count = self._bytes = 0

    def put(self, message: Message, on_payload: Callable[[object], object]) -> bool:
        """Queue a message, or reject it because it is too large or the queue is full.

        Args:
            message: Message.
            on_payload: Called with the payload in the decoding thread.

        Returns:
            False if the message is too large. True also for a message that doesn't fit in the queue.
        """
        size = message.size_bytes
        if size > self.max_message_bytes:
            self._rejected.add(self._topic, self.too_large_message(message))
            return False
        with self._lock:
            has_room = self._count < _MAX_BACKLOG and self._bytes + size <= _MAX_BACKLOG_BYTES
            if has_room:
                self._count += 1
                self._bytes += size
        if has_room:
            self._post(partial(self._decode, message, on_payload))
        else:
            self._rejected.add(self._topic, _("messages arrive faster than they are handled"))
        return True

    def too_large_message(self, message: Message) -> str:
        """Return the error message for a message that is too large."""
        return _("the message is {size} kB in size; the limit is {limit} kB").format(
            size=number(message.size_bytes / 1000, ".0f"), limit=number(self.max_message_bytes / 1000, ".0f")
        )

    def _decode(self, message: Message, on_payload: Callable[[object], object]) -> None:
        with self._lock:
            self._count -= 1
            self._bytes -= message.size_bytes
        try:
            payload = message.payload
        except DecodeError as error:
            self._rejected.add(self._topic, str(error))
        else:
            on_payload(payload)


class CommandReceiver:
    """Receiver of the messages on one command topic of a robot.

    Args:
        topic: Name of the topic.
        tasks: Tasks of the robot.
        dialect: Interpreter of the commands.
        stop_words: Texts, one of which occurs in every stop command.
        rejected: Counter of messages that are too large, can't be decoded, or don't fit in the queue.
        queues_stops: True to also queue an executed stop, so that `Dialect.receive` replies to it.
    """

    def __init__(
        self,
        topic: str,
        tasks: Tasks,
        dialect: Dialect,
        stop_words: Iterable[str],
        rejected: RejectedMessages,
        *,
        queues_stops: bool = False,
    ) -> None:
        self._tasks, self._dialect, self._queues_stops = tasks, dialect, queues_stops
        self._queue = MessageQueue(topic, tasks.call_soon, rejected, MAX_COMMAND_BYTES)
        self._needles = sorted(
            {json.dumps(stop_word)[1:-1].encode() for stop_word in stop_words if stop_word}
        )

    def process(self, messages: Sequence[Message]) -> None:
        """Process received messages. Called in the network's thread; never raises."""
        stop_indexes = [index for index, message in enumerate(messages) if self._is_stop(message)]
        older_epoch = self._tasks.epoch
        for index in stop_indexes:
            self._stop(messages[index])
        epoch, last_stop, handled_indexes = (
            self._tasks.epoch,
            max(stop_indexes, default=-1),
            frozenset(stop_indexes),
        )
        for index, message in enumerate(messages):
            if self._queues_stops or index not in handled_indexes:
                self._enqueue(message, epoch if index >= last_stop else older_epoch)

    def _is_stop(self, message: Message) -> bool:
        if message.size_bytes > MAX_COMMAND_BYTES:
            return _search(_OPERATION_PATTERN, message) == "stop"
        raw = bytes(message.raw)
        if not any(needle in raw for needle in self._needles):
            return False
        try:
            return self._dialect.is_stop(message.payload)
        except Exception:  # noqa: BLE001 - raised and reported again in the thread of the tasks
            return False

    def _stop(self, message: Message) -> None:
        if message.size_bytes > MAX_COMMAND_BYTES:
            self._dialect.stop({"op": "stop", "id": _search(_ID_PATTERN, message)})
        else:
            self._dialect.stop(message.payload)

    def _enqueue(self, message: Message, epoch: int) -> None:
        if self._queue.put(message, partial(self._receive, message.publisher, epoch)):
            return
        command_id, operation = _search(_ID_PATTERN, message), _search(_OPERATION_PATTERN, message)
        if command_id and operation == "invoke" and self._tasks.backlog < _MAX_BACKLOG:
            error = self._queue.too_large_message(message)
            self._tasks.call_soon(partial(self._dialect.reject, command_id, operation, error))

    def _receive(self, publisher: int | None, epoch: int, command: object) -> None:
        self._dialect.receive(command, publisher, epoch)


def _search(pattern: re.Pattern[bytes], message: Message) -> str:
    data = message.data
    match = pattern.search(bytes(data[:_SEARCH_WINDOW_BYTES])) or pattern.search(
        bytes(data[-_SEARCH_WINDOW_BYTES:])
    )
    return "" if match is None else match[1].decode()
