"""Typed messages: `msg_type` may be a dataclass or TypedDict wherever it may be a name.

`nep.messages.typed`, which analyses the declarations, is imported when the first type is used.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from nep.backends.base import Backend, Sink, SubscriberSpec, SubscriberTransport
from nep.messages.codecs import Codec
from nep.messages.message import Message
from nep.nodes.arguments import check_function
from nep.nodes.subscriber import Subscriber
from nep.system.arguments import check_type_name
from nep.system.lazy_import import lazy_module

if TYPE_CHECKING:
    from nep.messages import typed
else:
    typed = lazy_module("nep.messages.typed")


MsgType = str | type
"""Name of a message type, or a dataclass or TypedDict whose instances are the payloads."""


def name_of(msg_type: object) -> str:
    """Return the name of a message type: the name that a class declares, or the string itself.

    Raises `ValueError` if the name is invalid, or if the class can't be a message type.
    """
    return (
        typed.message_type(msg_type).name
        if isinstance(msg_type, type)
        else check_type_name("msg_type", msg_type)
    )


def codec_of(backend: Backend, msg_type: MsgType) -> Codec:
    """Return the codec of a publisher's message type; for a class, the codec of its instances.

    Raises `ValueError` if the class can't be a message type.
    """
    if not isinstance(msg_type, type):
        return backend.codec_for(msg_type)
    declared = typed.message_type(msg_type)
    return typed.typed_codec(declared, backend.codec_for(declared.name))


def wrap_sink(msg_type: MsgType, sink: Sink | None) -> Sink | None:
    """Return a sink that passes messages with typed payloads to `sink`.

    Returns `sink` itself if `msg_type` is a name, and None if `sink` is None. Raises `ValueError` if
    `sink` isn't callable or `msg_type` is a class that can't be a message type.
    """
    if sink is None or not isinstance(msg_type, type):
        return None if sink is None else check_function("sink", sink)
    call_sink, reader = check_function("sink", sink), typed.TypedReader(typed.message_type(msg_type))
    return lambda messages: call_sink([reader.convert(each) for each in messages])


class TypedSubscriber(Subscriber):
    """Subscriber whose payloads are instances of a declared type."""

    is_typed = True

    def __init__(
        self,
        transport: SubscriberTransport,
        spec: SubscriberSpec,
        on_close: Callable[[Subscriber], object],
        msg_type: type,
    ) -> None:
        super().__init__(transport, spec, on_close)
        self._reader = typed.TypedReader(typed.message_type(msg_type))
        self._empty = _empty_payload

    def typed(self, message: Message) -> Message:
        """Return a copy of `message` whose payload is an instance of the declared type."""
        return self._reader.convert(message)

    def decoded_unshared(self, message: Message) -> object:
        """Return the typed payload of a message that no other reader shares."""
        return self.decoded(self._reader.convert(message))


def _empty_payload() -> object:
    return None


def new_subscriber(
    transport: SubscriberTransport,
    spec: SubscriberSpec,
    on_close: Callable[[Subscriber], object],
    msg_type: MsgType,
) -> Subscriber:
    """Create a subscriber for the message type."""
    if isinstance(msg_type, type):
        return TypedSubscriber(transport, spec, on_close, msg_type)
    return Subscriber(transport, spec, on_close)
