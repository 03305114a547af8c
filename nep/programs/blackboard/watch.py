"""Watch of a topic whose messages are stored on a blackboard; created by `Blackboard.watch`."""

from __future__ import annotations

import logging
import re
import threading
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, NamedTuple

from nep.errors import DecodeError, NepError, WrongTypeError
from nep.i18n import _
from nep.messages.message import Message
from nep.nodes.subscriber import Subscriber
from nep.programs.blackboard.keys import Key, key_text, parse_key, topic_to_key
from nep.programs.blackboard.perception import parse_perception
from nep.programs.blackboard.values import leaves
from nep.system.forks import current_generation
from nep.system.log_rarely import is_logged

if TYPE_CHECKING:
    from typing_extensions import Self


_logger = logging.getLogger("nep.programs.blackboard")
_PLACEHOLDER = re.compile(r"\{([^{}]+)\}")
_MISSING = object()


class PerceivedValue(NamedTuple):
    """Value found in a message.

    Attributes:
        key: Key for the value.
        value: The value.
        robot: Name of the robot that perceived the value; "" if unknown.
    """

    key: Key
    value: object
    robot: str


class MessageMapping:
    """Conversion of a topic's messages to keys and values. Performs no input or output.

    The arguments are those of `Blackboard.watch`.
    """

    def __init__(
        self,
        key: str | tuple[str, ...] | None = None,
        fields: Sequence[str] | Mapping[str, str] | None = None,
        each: str = "",
    ) -> None:
        self._key = None if key is None else parse_key(key)
        self._has_placeholders = any(_PLACEHOLDER.search(name) for name in self._key or ())
        self._list_path = parse_key(each) if each else ()
        if isinstance(fields, str):
            raise WrongTypeError(_("'fields' must be a list of names, not a string"))
        pairs = fields.items() if isinstance(fields, Mapping) else [(name, name) for name in fields or ()]
        self._fields = (
            None if fields is None else [(parse_key(source), parse_key(name)) for source, name in pairs]
        )

    def items(self, payload: object) -> Sequence[object]:
        """Return the items of a payload, which are stored separately.

        These are the elements of the list in the field `each`; without `each`, the elements of the
        payload if it is a list and the key has placeholders, else the payload as the only item.

        Raises `NepError` if the payload has no list in the field `each`.
        """
        if self._list_path:
            entries = _field_value(payload, self._list_path)
            if not isinstance(entries, list | tuple):
                raise NepError(
                    _("the message has no list in the field '{field}'").format(
                        field=key_text(self._list_path)
                    )
                )
            return entries
        return payload if self._has_placeholders and isinstance(payload, list | tuple) else (payload,)

    def perceived_values(self, topic: str, item: object) -> Iterator[PerceivedValue]:
        """Yield the values of an item with their keys. Fields that the item lacks are skipped.

        Args:
            topic: Topic of the message.
            item: Item returned by `items`.

        Raises:
            NepError: A field that is part of the key is missing in the item, or is neither text
                nor an integer.
        """
        perception = None if self._fields is not None else parse_perception(item)
        if perception is not None:
            prefix = () if self._key is None else self._key_for(item)
            for key, value in leaves(perception.values, (*prefix, *parse_key(perception.primitive))):
                yield PerceivedValue(key, value, perception.robot)
            return
        prefix = topic_to_key(topic) if self._key is None else self._key_for(item)
        robot = item.get("robot") if isinstance(item, Mapping) else None
        robot_name = robot if isinstance(robot, str) else ""
        for field_key, value in self._selected_fields(item):
            for key, leaf in leaves(value, (*prefix, *field_key)):
                yield PerceivedValue(key, leaf, robot_name)

    def _selected_fields(self, item: object) -> Iterator[tuple[Key, object]]:
        if self._fields is None:
            yield (), item
            return
        for field, name in self._fields:
            value = _field_value(item, field)
            if value is not _MISSING:
                yield name, value

    def _key_for(self, item: object) -> Key:
        if not self._has_placeholders:
            return self._key or ()
        return tuple(
            _PLACEHOLDER.sub(lambda match: _name_from_field(item, match[1]), name) for name in self._key or ()
        )


def _field_value(item: object, path: Key) -> object:
    for name in path:
        if not isinstance(item, Mapping) or name not in item:
            return _MISSING
        item = item[name]
    return item


def _name_from_field(item: object, field: str) -> str:
    value = item.get(field) if isinstance(item, Mapping) else None
    if isinstance(value, bool) or not isinstance(value, str | int) or value == "":
        raise NepError(_("an item has no name or number in the field '{field}'").format(field=field))
    return str(value)


def is_change_message(payload: object) -> bool:
    """Return True if a payload is a change published by a blackboard.

    A watch of a pattern ignores such messages, because storing them would publish further changes
    endlessly.
    """
    return isinstance(payload, Mapping) and "blackboard" in payload and "cause" in payload


class BlackboardWatch:
    """Subscription that stores messages on a blackboard, with message counts.

    Thread-safe; usable as a context manager.
    """

    def __init__(
        self,
        topic: str,
        mapping: MessageMapping,
        store: Callable[[Message, Sequence[PerceivedValue]], None],
        *,
        is_pattern: bool,
    ) -> None:
        self.topic = topic
        self.received = 0
        """Number of messages received and decoded."""
        self.refused = 0
        """Number of messages that could not be decoded or stored completely; the reason is logged."""
        self.problem = ""
        """Reason why the last message was rejected; "" if it was stored."""
        self._mapping = mapping
        self._store = store
        self._is_pattern = is_pattern
        self._subscriber: Subscriber | None = None
        self._is_closed = False
        self._lock = threading.Lock()
        self._generation = current_generation()

    def attach(self, subscriber: Subscriber) -> None:
        """Set the subscriber, which is closed with the watch."""
        with self._lock:
            self._subscriber = subscriber
            is_closed = self._is_closed
        if is_closed:
            subscriber.close()

    def store_messages(self, messages: Sequence[Message]) -> None:
        """Store messages on the blackboard. Called in the node's sink thread."""
        for message in messages:
            if self._is_closed or self._generation.is_inherited:
                return
            try:
                self._store_message(message)
            except Exception as error:  # noqa: BLE001 - a bad message must not affect the others
                self._reject(message, error)

    def _store_message(self, message: Message) -> None:
        subscriber = self._subscriber
        # The first messages may arrive before `attach` is called.
        payload = message.payload if subscriber is None else subscriber.decoded(message)
        if self._is_pattern and is_change_message(payload):
            return
        self.received += 1
        problem: NepError | None = None
        for item in self._mapping.items(payload):
            try:
                self._store(message, tuple(self._mapping.perceived_values(message.topic, item)))
            except NepError as error:
                problem = error  # the other items are stored
        if problem is not None:
            raise problem
        self.problem = ""

    def _reject(self, message: Message, error: Exception) -> None:
        self.refused += 1
        self.problem = str(error)
        if not isinstance(error, DecodeError) and is_logged(self.refused):
            _logger.warning(
                "a message on '%s' was not stored completely (%d so far): %s",
                message.topic,
                self.refused,
                error,
            )

    def close(self) -> None:
        """Stop storing messages. Stored values remain on the blackboard. Idempotent."""
        if self._generation.is_inherited:
            return
        with self._lock:
            self._is_closed = True
            subscriber = self._subscriber
        if subscriber is not None:
            subscriber.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_exc: object) -> None:
        self.close()

    def __repr__(self) -> str:
        return f"BlackboardWatch({self.topic!r}, received={self.received}, refused={self.refused})"
