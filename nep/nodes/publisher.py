"""Publisher returned by `Node.new_pub`.

A payload that can't be encoded is dropped, not raised: it is counted in `Publisher.refused`, logged at
increasing intervals and reported as an alert in the graph. Encoding happens only while the topic has
subscribers, so raising would make a program fail only when someone starts to watch it
(docs/adr/0013-watching.md). With ``strict=True`` every payload is encoded, and errors are raised.
"""

from __future__ import annotations

import logging
import math
import time
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from nep.backends.base import (
    PublisherSpec,
    PublisherTransport,
    SupportsSendBytes,
    SupportsSubscriberIds,
)
from nep.errors import ClosedError, EncodeError, WireError
from nep.i18n import _
from nep.messages.codecs import NULL, JsonEncoder, fast_encoder
from nep.messages.encoded import Encoded, new_encoded
from nep.nodes.arguments import check_time_limit
from nep.protocol.wire import extension_part
from nep.system.forks import current_generation
from nep.system.log_rarely import is_logged
from nep.text import escaped, shortened

if TYPE_CHECKING:
    from numpy.typing import NDArray
    from typing_extensions import Self


_logger = logging.getLogger("nep")
_VALIDATE_INTERVAL_S = 1.0
"""Interval in seconds at which a payload of an unsubscribed topic is encoded to detect errors early."""
_VALIDATE_PAUSE_FACTOR = 50
_MAX_NODES_CHECKED = 10_000
_MAX_DEPTH = 50
_MAX_TEXT_LENGTH = 300

_BYTES_TYPES = (bytes, memoryview)  # created once: checked for every unsubscribed message


class Publisher:
    """Publisher of messages on one topic. Thread-safe. Created by `Node.new_pub`.

    Usable as a context manager. `close` delivers the published messages first.

        with node.new_pub("/robot/pose") as pub:
            pub.publish({"x": 1.5, "y": 0.0})
    """

    def __init__(
        self,
        transport: PublisherTransport,
        spec: PublisherSpec,
        on_close: Callable[[Publisher], object] | None = None,
        *,
        is_strict: bool = False,
    ) -> None:
        self._on_close = on_close
        self._is_strict = is_strict
        self._generation = current_generation()
        self._transport = transport
        self._spec = spec
        self._json_encoder = (
            JsonEncoder(spec.topic, encode=spec.codec.encode) if spec.codec.name == "json" else None
        )
        self._encode = spec.codec.encode if self._json_encoder is None else self._json_encoder.encode
        self._rejected = RejectedPayloads(spec.topic, spec.codec.encode, transport.report)
        self._is_latched = spec.is_latched
        self._is_closed = False
        self._encode_fast = fast_encoder(spec.codec)
        self._raw_type = bytes if spec.codec.name == "bytes" else None
        """Type of payloads that are sent unchanged, without encoding; None if there is none."""
        self._fast_transport = (
            transport if isinstance(transport, SupportsSendBytes) and self._encode_fast is not None else None
        )

    @property
    def topic(self) -> str:
        """Name of the topic."""
        return self._spec.topic

    @property
    def msg_type(self) -> str:
        """Registered message type."""
        return self._spec.msg_type

    @property
    def id(self) -> int:
        """Id of the publisher, the same as in `Message.publisher` and in the graph."""
        return self._spec.id

    @property
    def is_closed(self) -> bool:
        """True if the publisher or its node was closed."""
        return self._is_closed or self._generation.is_inherited

    @property
    def subscribers(self) -> int:
        """Number of connected subscribers."""
        return 0 if self._generation.is_inherited else self._transport.subscribers

    @property
    def subscriber_ids(self) -> frozenset[int]:
        """Ids of connected subscribers, the same as in the graph.

        The subscriber of a program that doesn't respond stays connected after its node was removed from the
        graph. Empty for back ends that can't identify subscribers.
        """
        if self._generation.is_inherited or not isinstance(self._transport, SupportsSubscriberIds):
            return frozenset()
        return self._transport.subscriber_ids

    @property
    def missing(self) -> tuple[str, ...]:
        """Names of subscribed nodes that aren't connected, because they are starting or don't respond."""
        return () if self._generation.is_inherited else self._transport.missing

    @property
    def count(self) -> int:
        """Number of published messages, including those without a subscriber."""
        return self._transport.count

    @property
    def nulled(self) -> int:
        """Number of messages in which NaN or infinity was replaced by ``null``, which JSON lacks."""
        return 0 if self._json_encoder is None else self._json_encoder.count

    @property
    def refused(self) -> int:
        """Number of payloads that could not be encoded. The log and a graph alert state the reason."""
        return self._rejected.count

    @property
    def problem(self) -> str:
        """Reason why the newest payload was rejected, or "" if it could be encoded."""
        return self._rejected.problem

    def publish(self, payload: object, *, strict: bool = False) -> None:
        """Encode and send a payload. Never blocks.

        While the topic has no subscriber and is not latched, payloads are encoded only once per second
        to detect errors.

        Args:
            payload: Value of the publisher's message type; an `Encoded` is sent unchanged.
            strict: Always encode, also without subscribers, and raise `EncodeError` for any payload
                that can't be encoded. Otherwise only a wrong type is raised; errors inside the payload
                are counted in `refused`, logged, and reported as an alert in the graph until a payload
                can be encoded.

        Raises:
            EncodeError: The message type does not accept the type of the payload; or `strict` is set
                and the payload can't be encoded.
            ClosedError: The publisher is closed.
        """
        fast_transport, encode = self._fast_transport, self._encode_fast
        if (
            fast_transport is not None
            and encode is not None
            and fast_transport.has_subscribers
            and not (strict or fast_transport.is_closed or fast_transport.problem)
            and type(payload) is not Encoded
            and not self._generation.is_inherited
        ):
            try:
                data: Any = payload if type(payload) is self._raw_type else encode(payload)
            except Exception:  # noqa: BLE001, S110 - a payload may be of any class; it is sent or reported below
                pass
            else:
                if self._json_encoder is not None and data.rfind(NULL) >= 0:
                    self._json_encoder.check_for_nan(payload)
                fast_transport.send_bytes(data)
                return
        if strict or self._is_strict:
            self._publish_strict(payload)
            return
        if (
            self._is_closed
            or self._generation.is_inherited
            or not (self._transport.has_subscribers or self._is_latched)
        ):
            self._skip(payload)
            return
        try:
            encoded_payload = payload if isinstance(payload, Encoded) else self._encode(payload)
        except Exception as error:  # noqa: BLE001 - a payload of any class may raise anything
            self._check_payload(payload)
            self._rejected.add(payload, error)
            return
        if encoded_payload is payload or self._rejected.problem:
            self._send(encoded_payload)
        else:
            self._transport.send(encoded_payload)

    def _publish_strict(self, payload: object) -> None:
        if self.is_closed:
            raise self._closed_error()
        try:
            if isinstance(payload, Encoded):
                self._check_payload(payload)
                check_sendable(payload)
                encoded_payload = payload
            else:
                encoded_payload = self._encode(payload)
        except Exception as error:
            self._check_payload(payload)  # raises a more specific error
            raise self._rejected.error(payload, error, self._spec.codec.name) from error
        self._rejected.resolve()
        if self._transport.has_subscribers or self._is_latched:
            self._transport.send(encoded_payload)
        else:
            self._transport.skip()

    def publish_bytes(self, data: bytes | memoryview, extension: Mapping[str, object] | None = None) -> None:
        """Send data that is already encoded. Thread-safe.

        Args:
            data: Encoded payload.
            extension: Additional header fields of the message.

        Raises:
            EncodeError: The data is not bytes, or the extension is not a map.
            ClosedError: The publisher is closed.
        """
        if self.is_closed or not (self._transport.has_subscribers or self._is_latched):
            self._skip(Encoded(data, extension))
        else:
            self._send(new_encoded((data, extension)))

    def refuse(self, payload: object, error: Exception) -> None:
        """Count and report a payload that could not be encoded outside of `publish`.

        Args:
            payload: The rejected payload.
            error: Exception of the encoder.
        """
        self._rejected.add(payload, error)

    def _send(self, encoded_payload: Encoded) -> None:
        if type(encoded_payload.data) is not bytes or encoded_payload.extension is not None:
            self._check_payload(encoded_payload)
        try:
            self._transport.send(encoded_payload)
        except WireError as error:  # in the extension
            self._rejected.add(encoded_payload, error)
            return
        if self._rejected.problem:
            self._rejected.resolve()

    def _check_payload(self, payload: object) -> None:
        # Raises `EncodeError` for errors visible without encoding.
        if not isinstance(payload, Encoded):
            self._spec.codec.check(payload)
            return
        codec, data, extension = self._spec.codec.name, payload.data, payload.extension
        if not isinstance(data, _BYTES_TYPES):
            raise EncodeError(codec, type(data).__name__, _("the data must be 'bytes'"))
        if extension is not None and not isinstance(extension, Mapping):
            raise EncodeError(codec, type(extension).__name__, _("an extension must be a map"))

    def _skip(self, payload: object) -> None:
        # Counts a message without subscribers; encodes it from time to time to detect errors.
        if self.is_closed:
            raise self._closed_error()
        self._check_payload(payload)
        if self._rejected.is_valid(payload):
            self._transport.skip()

    def _closed_error(self) -> ClosedError:
        return ClosedError(f"publisher '{self.topic}'", is_forked=self._generation.is_inherited)

    # ---- names of the original module

    def send_json(self, message: object) -> None:
        """Publish a message of type `json`, as `publish` does."""
        self.publish(message)

    def send_string(self, message: str) -> None:
        """Publish a message of type `string`, as `publish` does."""
        self.publish(message)

    def send_image(self, message: object) -> None:
        """Publish an image, as `publish` does."""
        self.publish(message)

    def send_bytes(self, message: bytes) -> None:
        """Publish a message of type `bytes`, as `publish` does."""
        self.publish(message)

    def send_msgpack(self, message: object) -> None:
        """Publish a message of type `msgpack`, as `publish` does."""
        self.publish(message)

    sendJson = sendDictionary = send_json  # noqa: N815 - names of the original module from 0.5.4.7 on
    sendString = sendTopicString = send_string  # noqa: N815
    sendImages = send_image  # noqa: N815
    sendBytes = send_bytes  # noqa: N815
    sendMsgPack = send_msgpack  # noqa: N815

    def loan(self, shape: int | tuple[int, ...], dtype: str = "uint8") -> NDArray[Any]:
        """Return an array that can be filled and published without a copy.

        With shared memory the array lies in memory that all subscribers on this computer can read; otherwise
        it is an ordinary array. Publish it as an image (`nep.raw_image`) or, for type `bytes`, as an
        `Encoded`. Don't write to it after publishing; get a new array for the next message. Needs numpy.

        Args:
            shape: Shape of the array.
            dtype: Name of a numpy type.

        Raises:
            ClosedError: The publisher is closed.
        """
        if self.is_closed:
            raise self._closed_error()
        import numpy as np  # noqa: PLC0415 - optional and heavy

        number_type = np.dtype(dtype)
        sides = (shape,) if isinstance(shape, int) else tuple(shape)
        size = math.prod(sides) * number_type.itemsize
        memory = self._transport.borrow_memory(size) if size > 0 else None
        if memory is None:
            return np.empty(sides, number_type)
        array: NDArray[Any] = np.frombuffer(memory, number_type).reshape(sides)
        return array

    def close(self, timeout_s: float = 2.0) -> None:
        """Deliver published messages within `timeout_s` seconds and unregister. Idempotent."""
        check_time_limit("timeout_s", timeout_s)
        if not self.is_closed:
            self._is_closed = True
            try:
                self._transport.close(timeout_s)
            finally:
                if self._on_close is not None:
                    self._on_close(self)

    def on_node_close(self) -> None:
        """Mark the publisher as closed because its node is being closed."""
        self._is_closed = True

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_exc: object) -> None:
        self.close()

    def __repr__(self) -> str:
        return f"Publisher({self.topic!r}, {self.msg_type!r})"


class RejectedPayloads:
    """Counter of payloads of one publisher that can't be encoded, which also logs and reports them.

    Args:
        topic: Name of the topic.
        encode: Encoder of the codec.
        report: Called with the problem for the graph, or "" when a payload could be encoded again.
        clock: Monotonic clock in seconds.
    """

    def __init__(
        self,
        topic: str,
        encode: Callable[[object], Encoded],
        report: Callable[[str], None],
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self.count = 0
        """Number of rejected payloads."""
        self.problem = ""
        """Reason why the newest payload was rejected, or "" if it could be encoded."""
        self._topic = topic
        self._encode = encode
        self._report = report
        self._clock = clock
        self._validate_at = clock()
        self._locate_at = clock()
        self._located_problem = ("", "")

    def is_valid(self, payload: object) -> bool:
        """Encode a payload of an unsubscribed topic to detect errors; return False if the encoding fails.

        At most one payload per interval is encoded; the others are assumed to be valid.
        """
        started = self._clock()
        if started < self._validate_at:
            return True
        try:
            check_sendable(payload) if isinstance(payload, Encoded) else self._encode(payload)
        except Exception as error:  # noqa: BLE001 - a payload of any class may raise anything
            self.add(payload, error)
        else:
            self.resolve()
        ended = self._clock()
        self._validate_at = ended + max(_VALIDATE_INTERVAL_S, _VALIDATE_PAUSE_FACTOR * (ended - started))
        return not self.problem

    def add(self, payload: object, error: Exception) -> None:
        """Count, log and report a payload that can't be encoded because of `error`."""
        self.count += 1
        reason = _error_text(error)
        now = self._clock()
        if self._located_problem[0] != reason and (now >= self._locate_at or not self._located_problem[0]):
            self._locate_at = now + _VALIDATE_INTERVAL_S  # finding the path may take long
            path = "" if getattr(error, "place", "") else _escaped_unencodable_path(payload, self._encode)
            self._located_problem = (reason, f"{reason}; the value is at '{path}'" if path else reason)
        message = self._located_problem[1] if self._located_problem[0] == reason else reason
        if is_logged(self.count):
            _logger.warning(
                "a message on '%s' can't be sent (%d so far): %s", self._topic, self.count, message
            )
        if message != self.problem:
            self.problem = message
            self._report(message)

    def error(self, payload: object, error: Exception, codec: str) -> EncodeError:
        """Return the exception to raise for a payload, with the path of the value that can't be encoded."""
        if not isinstance(error, EncodeError):
            error = EncodeError(codec, type(payload).__name__, _error_text(error))
        path = error.place or _escaped_unencodable_path(payload, self._encode)
        if not path or error.place:
            return error
        return EncodeError(error.codec, error.kind, f"{error.reason}; the value is at '{path}'", path)

    def resolve(self) -> None:
        """Clear the reported problem after a payload was encoded successfully."""
        if self.problem:
            self.problem = ""
            self._report("")


def _error_text(error: Exception) -> str:
    try:
        text = str(error)
    except Exception:  # noqa: BLE001 - an exception class of the payload may raise anything
        text = ""
    if not isinstance(error, EncodeError | WireError):
        text = f"{type(error).__name__}: {text}"
    return escaped(shortened(text, _MAX_TEXT_LENGTH))


def check_sendable(payload: Encoded) -> None:
    """Raise `WireError` if the extension of an `Encoded` can't be encoded."""
    if payload.extension:
        extension_part(payload.extension)


def _escaped_unencodable_path(payload: object, encode: Callable[[object], Encoded]) -> str:
    try:
        return (
            ""
            if isinstance(payload, Encoded)
            else escaped(shortened(unencodable_path(payload, encode), _MAX_TEXT_LENGTH))
        )
    except Exception:  # noqa: BLE001 - keys of any class may raise anything
        return ""


def unencodable_path(payload: object, encode: Callable[[object], Encoded]) -> str:
    """Return the path of the first value that can't be encoded, such as "pose.x" or "joints[3]".

    Returns "" if the payload itself can't be encoded. After ten thousand values the search ends with
    the path of the innermost value found so far.

    Args:
        payload: Payload that `encode` rejects.
        encode: Encoder of the codec.
    """
    path, value, nodes_left = "", payload, _MAX_NODES_CHECKED
    for _level in range(_MAX_DEPTH):
        for step, part in _children(value):
            nodes_left -= 1
            if nodes_left <= 0:
                return path.removeprefix(".")
            if not _is_encodable(part, encode):
                path, value = path + step, part
                break
        else:
            break
    return path.removeprefix(".")


def _is_encodable(value: object, encode: Callable[[object], Encoded]) -> bool:
    try:
        encode(value)
    except Exception:  # noqa: BLE001 - see `RejectedPayloads.is_valid`
        return False
    return True


def _children(value: object) -> list[tuple[str, object]]:
    if isinstance(value, Mapping):
        return [(f".{str(key)[:100]}", part) for key, part in value.items()]
    if isinstance(value, Sequence) and not isinstance(value, str | bytes | bytearray | memoryview):
        return [(f"[{number}]", part) for number, part in enumerate(value[:_MAX_NODES_CHECKED])]
    return []
