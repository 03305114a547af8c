"""`SavedMessages`: messages that the user saved for repeated use, stored in a file next to the settings."""

from __future__ import annotations

import json
import math
import secrets
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace

from app.core.run.acting.json_text import MAX_LENGTH, parse_json_text, parse_typed_value
from app.core.run.acting.sending import MAX_HZ, MIN_HZ
from app.core.run.acting.templates import is_plain_text
from nep.errors import NepError
from nep.i18n import _

FORMAT_VERSION = 1
MAX_MESSAGES = 200
MAX_REQUESTS = 100
MAX_VALUES = 50
MAX_NAME_LENGTH = 80
MAX_VALUE_LENGTH = 2000
MAX_BYTES = 64 * 2**20
"""Maximum size of the file in bytes; a larger file is not read."""


class NewerSavedMessagesError(NepError):
    """Raised if the file was written by a newer version of Studio."""


def new_message_id() -> str:
    """Return a unique message id."""
    return secrets.token_hex(4)


@dataclass(frozen=True, slots=True)
class SavedMessage:
    """Message that the user saved.

    Attributes:
        values: Name and value of each placeholder, as entered by the user.
    """

    id: str
    name: str
    topic: str
    msg_type: str = "json"
    text: str = "{}"
    values: tuple[tuple[str, str], ...] = ()
    rate_hz: float = 1.0

    def payload(self) -> object:
        """Return a new payload, in which automatic placeholders have new values.

        Raises `NepError` for invalid JSON or a missing value.
        """
        if is_plain_text(self.msg_type):
            return self.text
        values = {name: parse_typed_value(value) for name, value in self.values if value.strip()}
        return parse_json_text(self.text).fill(values)

    @property
    def source(self) -> str:
        """Text that the user wrote, followed by the values of the placeholders."""
        return "\n".join((self.text, *(f"{name}: {value}" for name, value in self.values)))

    def with_value(self, name: str, value: str) -> SavedMessage:
        """Return a copy in which a placeholder has another value."""
        values = {**dict(self.values), name: value[:MAX_VALUE_LENGTH]}
        return replace(self, values=tuple(values.items())[-MAX_VALUES:])


class SavedMessages:
    """Saved messages in order, and the last request of each service. Both are limited in number."""

    def __init__(
        self, messages: Iterable[SavedMessage] = (), requests: Mapping[str, str] | None = None
    ) -> None:
        self._messages = list(messages)[:MAX_MESSAGES]
        self._requests = dict(list((requests or {}).items())[-MAX_REQUESTS:])
        self._last_removed: tuple[SavedMessage, int] | None = None
        self.revision = 0

    @property
    def messages(self) -> tuple[SavedMessage, ...]:
        """All saved messages."""
        return tuple(self._messages)

    @property
    def requests(self) -> Mapping[str, str]:
        """Last request by service, as JSON."""
        return self._requests

    def get(self, id: str) -> SavedMessage | None:
        """Return the message with this id, or None."""
        return next((each for each in self._messages if each.id == id), None)

    def set_message(self, message: SavedMessage) -> bool:
        """Add a message, or replace the message with the same id; return False if no other can be added."""
        index = self._index(message.id)
        if index is None:
            if len(self._messages) >= MAX_MESSAGES:
                return False
            self._messages.append(message)
        elif self._messages[index] == message:
            return True
        else:
            self._messages[index] = message
        self.revision += 1
        return True

    def copy(self, id: str) -> SavedMessage | None:
        """Insert a copy of a message after it, and return the copy.

        Returns None if there is no such message, or no room for another one.
        """
        index = self._index(id)
        if index is None or len(self._messages) >= MAX_MESSAGES:
            return None
        original = self._messages[index]
        copy = replace(original, id=new_message_id(), name=self.free_name(original.name))
        self._messages.insert(index + 1, copy)
        self.revision += 1
        return copy

    def free_name(self, preferred: str) -> str:
        """Return an unused name: ``preferred``, or ``preferred`` with a number, as in "Stand still 2"."""
        used_names = {each.name for each in self._messages}
        number, name = 2, preferred[:MAX_NAME_LENGTH]
        while name in used_names:
            name = f"{preferred[: MAX_NAME_LENGTH - 5]} {number}"
            number += 1
        return name

    def remove(self, id: str) -> SavedMessage | None:
        """Remove a message and return it; None if the id is unknown. Undo with `restore`."""
        index = self._index(id)
        if index is None:
            return None
        removed = self._messages.pop(index)
        self._last_removed = (removed, index)
        self.revision += 1
        return removed

    def restore(self) -> SavedMessage | None:
        """Restore the last removed message at its previous position and return it.

        Returns None if there is none, or no room for it.
        """
        if self._last_removed is None or len(self._messages) >= MAX_MESSAGES:
            return None
        (message, index), self._last_removed = self._last_removed, None
        self._messages.insert(index, message)
        self.revision += 1
        return message

    def set_request(self, service: str, request: str) -> None:
        """Store the JSON text of a request as the last request of a service. Too long texts are ignored."""
        if self._requests.get(service) != request and len(request) <= MAX_LENGTH:
            self._requests.pop(service, None)
            self._requests[service] = request
            while len(self._requests) > MAX_REQUESTS:
                self._requests.pop(next(iter(self._requests)))
            self.revision += 1

    def _index(self, id: str) -> int | None:
        return next((index for index, each in enumerate(self._messages) if each.id == id), None)


# ---- file


def encode_saved_messages(saved_messages: SavedMessages) -> bytes:
    """Return saved messages in the file format."""
    value = {
        "format": FORMAT_VERSION,
        "messages": [
            {
                "id": each.id,
                "name": each.name,
                "topic": each.topic,
                "type": each.msg_type,
                "text": each.text,
                "values": dict(each.values),
                "rate_hz": each.rate_hz,
            }
            for each in saved_messages.messages
        ],
        "requests": dict(saved_messages.requests),
    }
    return (json.dumps(value, indent=1, ensure_ascii=False) + "\n").encode("utf-8", "backslashreplace")


def parse_saved_messages(data: bytes) -> tuple[SavedMessages, int]:
    """Parse the content of a file.

    Returns:
        Saved messages, and number of unreadable messages.

    Raises:
        NewerSavedMessagesError: A newer version of Studio wrote the file.
        NepError: The file isn't a file of saved messages.
    """
    try:
        value = json.loads(data.decode("utf-8-sig"))
    except (ValueError, RecursionError) as error:
        raise NepError(_("the file isn't valid JSON")) from error
    message_list = value.get("messages") if isinstance(value, dict) else None
    if not isinstance(value, dict) or not isinstance(message_list, list):
        raise NepError(_("the file has no list of messages"))
    if isinstance(number := value.get("format"), int) and number > FORMAT_VERSION:
        raise NewerSavedMessagesError(_("the file was saved by a newer version of Studio"))
    messages = [_parse_message(each) for each in message_list[:MAX_MESSAGES]]
    valid = {each.id: each for each in messages if each is not None}
    requests = value.get("requests")
    request_texts = {
        name: text
        for name, text in (requests.items() if isinstance(requests, dict) else ())
        if isinstance(text, str) and len(text) <= MAX_LENGTH
    }
    return SavedMessages(valid.values(), request_texts), len(message_list) - len(valid)


def _parse_message(entry: object) -> SavedMessage | None:
    if not isinstance(entry, dict):
        return None
    id, name, topic, msg_type, text = (entry.get(key) for key in ("id", "name", "topic", "type", "text"))
    if not (isinstance(id, str) and id and isinstance(name, str) and isinstance(topic, str)):
        return None
    if not (isinstance(msg_type, str) and isinstance(text, str)) or len(text) > MAX_LENGTH + 1:
        return None
    values, rate_hz = entry.get("values"), entry.get("rate_hz")
    placeholder_values = tuple(
        (name, each[:MAX_VALUE_LENGTH])
        for name, each in (values.items() if isinstance(values, dict) else ())
        if isinstance(each, str)
    )
    valid_rate_hz = 1.0
    if isinstance(rate_hz, (int, float)) and not isinstance(rate_hz, bool) and math.isfinite(rate_hz):
        valid_rate_hz = float(min(MAX_HZ, max(MIN_HZ, rate_hz)))
    return SavedMessage(
        id, name[:MAX_NAME_LENGTH], topic, msg_type, text, placeholder_values[:MAX_VALUES], valid_rate_hz
    )
