"""Wire encoding of requests, replies and pushes. Pure functions; specification: `docs/wire.md`.

A body is one msgpack map. Requests have `do` (the operation) and `call` (a number that the reply
repeats as `re`); replies and pushes have `is`; `what` holds the fields. `to_plain` converts values to
maps; `from_plain` parses and validates received maps. Graphs have a separate encoder that caches
unchanged parts.
"""

from __future__ import annotations

import gc
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import MISSING, Field, fields, is_dataclass
from functools import cache
from operator import itemgetter
from types import UnionType
from typing import Any, NamedTuple, TypeVar, Union, cast, get_args, get_origin, get_type_hints

import msgpack  # type: ignore[import-untyped]

from nep.errors import WireError
from nep.i18n import _, lazy
from nep.messages.packing import clamp_int, pack_saturated, unpack, unpack_bounded, unpack_first
from nep.protocol.graph_view import NodeInfo, TopicInfo
from nep.protocol.requests import (
    AddedReply,
    AddPublisher,
    AddSubscriber,
    DoneReply,
    FoundReply,
    GraphReply,
    Join,
    Leave,
    Listen,
    Ping,
    Probe,
    PublisherAdded,
    PublisherRemoved,
    Push,
    QueryGraph,
    RejectedReply,
    RemovePublisher,
    RemoveSubscriber,
    Renew,
    RenewedReply,
    Reply,
    ReportMissing,
    Request,
)

T = TypeVar("T")
_PLAIN_TYPES = frozenset({str, int, float, bool, bytes, type(None)})

_REQUESTS: Mapping[str, type[Request]] = {
    "join": Join,
    "publisher+": AddPublisher,
    "subscriber+": AddSubscriber,
    "publisher-": RemovePublisher,
    "subscriber-": RemoveSubscriber,
    "leave": Leave,
    "renew": Renew,
    "missing": ReportMissing,
    "listen": Listen,
    "look": QueryGraph,
    "ping": Ping,
}
_REPLIES: Mapping[str, type[Reply | Push]] = {
    "done": DoneReply,
    "added": AddedReply,
    "found": FoundReply,
    "renewed": RenewedReply,
    "seen": GraphReply,
    "refused": RejectedReply,
    "publisher+": PublisherAdded,
    "publisher-": PublisherRemoved,
    "probe": Probe,
}
_REQUEST_NAMES = {kind: name for name, kind in _REQUESTS.items()}
_REPLY_NAMES = {kind: name for name, kind in _REPLIES.items()}
_MISSING_FIELD_MESSAGE = lazy("'{field}' is missing")
_WRONG_TYPE_MESSAGE = lazy("'{field}' must be '{wanted}', not '{given}'")
_NOT_A_LIST_MESSAGE = lazy("'{field}' must be a list, not '{given}'")
_NOT_A_MAP_MESSAGE = lazy("'{field}' must be a map, not '{given}'")
_LARGE_BODY_BYTES = 50_000
_SMALL_BODY_BYTES = 4096
_MAX_LISTS, _MAX_LIST_LENGTH = 50_000, 20_000
"""Maximum number and length of lists and maps in a request. A joining node has at most 5,000 records."""
_GRAPH_REPLY_PREFIX = b"\x83\xa2is\xa4seen\xa2re"
"""First bytes of a graph reply that `ReplyEncoder` has encoded."""


class ReceivedRequest(NamedTuple):
    """Result of decoding a request.

    Attributes:
        call: Id of the request; 0 if it is missing or invalid.
        request: The request, or the error if it is malformed.
    """

    call: int
    request: Request | WireError


def encode_request(request: Request, call: int) -> bytes:
    """Encode a request."""
    return pack_saturated({"do": _REQUEST_NAMES[type(request)], "call": call, "what": to_plain(request)})


def decode_request(body: bytes) -> ReceivedRequest:
    """Decode a request. Never raises: errors are returned, so that every sender gets a reply."""
    call = 0
    try:
        if len(body) < _SMALL_BODY_BYTES:
            envelope = _unpack_envelope(body, unpack)
        else:
            envelope = _unpack_envelope(body, lambda body: unpack_bounded(body, _MAX_LISTS, _MAX_LIST_LENGTH))
        number = envelope.get("call", 0)
        # negative numbers are reserved for calls inside the master's process
        call = number if type(number) is int and number >= 0 else 0
        name = envelope.get("do")
        kind = _REQUESTS.get(name) if isinstance(name, str) else None
        if kind is None:
            raise WireError(_("unknown request '{name}'").format(name=name), code="request")
        return ReceivedRequest(call, from_plain(kind, envelope.get("what", {})))
    except WireError as error:
        return ReceivedRequest(call, error)


class ReplyEncoder:
    """Encoder of replies and pushes. Caches the encoded nodes and topics of a graph until they change."""

    def __init__(self) -> None:
        self._pack = msgpack.Packer(use_bin_type=True, unicode_errors="replace", default=_packable_value).pack
        self._parts: dict[str, tuple[NodeInfo | TopicInfo, bytes]] = {}

    def encode(self, message: Reply | Push, call: int = 0) -> bytes:
        """Encode a reply to `call`, or a push."""
        if isinstance(message, GraphReply):
            return self._encode_graph_reply(message, call)
        return pack_saturated({"is": _REPLY_NAMES[type(message)], "re": call, "what": to_plain(message)})

    def _encode_graph_reply(self, reply: GraphReply, call: int) -> bytes:
        view = reply.view
        header = msgpack.Packer().pack_map_header
        other_fields: dict[str, object] = {
            "epoch": view.epoch,
            "revision": view.revision,
            "alerts": to_plain(view.alerts),
            "listens": view.listens,
        }
        if view.services:  # unknown to older nodes
            other_fields["services"] = to_plain(view.services)
        if view.patterns:
            other_fields["patterns"] = to_plain(view.patterns)
        nodes = [self._encode_entry(f"n{key}", key, node) for key, node in view.nodes.items()]
        topics = [self._encode_entry(f"t{key}", key, topic) for key, topic in view.topics.items()]
        if len(self._parts) > 2 * (len(nodes) + len(topics)) + 100:
            self._parts.clear()  # many were removed
        return b"".join(
            (
                header(3),
                *map(pack_saturated, ("is", "seen", "re", call, "what")),
                header(3),
                *map(pack_saturated, ("epoch", reply.epoch, "revision", reply.revision, "view")),
                header(len(other_fields) + 2),
                *(pack_saturated(key) + pack_saturated(item) for key, item in other_fields.items()),
                pack_saturated("nodes"),
                header(len(nodes)),
                *nodes,
                pack_saturated("topics"),
                header(len(topics)),
                *topics,
            )
        )

    def _encode_entry(self, name: str, key: str, value: NodeInfo | TopicInfo) -> bytes:
        cached = self._parts.get(name)
        # unchanged topics are the same object; comparing different ones takes as long as encoding them
        if cached is not None and (
            cached[0] is value or (isinstance(value, NodeInfo) and cached[0] == value)
        ):
            return cached[1]
        # includes default values: omitting them takes longer
        packed: bytes = self._pack(key) + self._pack(vars(value))
        self._parts[name] = (value, packed)
        return packed


def _packable_value(value: object) -> object:
    # Called for types unknown to msgpack: dataclasses, and ints beyond its range.
    return clamp_int(value) if isinstance(value, int) else vars(value)


def encode_reply(reply: Reply | Push, call: int = 0) -> bytes:
    """Encode a reply to `call`, or a push."""
    return ReplyEncoder().encode(reply, call)


def call_of_graph_reply(body: bytes) -> int | None:
    """Return the call id of a graph reply without decoding it; None for other bodies and invalid ids.

    Decoding a graph of thousands of topics takes 0.1 s.
    """
    if not body.startswith(_GRAPH_REPLY_PREFIX):
        return None
    try:
        number = unpack_first(body[len(_GRAPH_REPLY_PREFIX) : len(_GRAPH_REPLY_PREFIX) + 9])
    except ValueError:
        return None
    return number if isinstance(number, int) and number > 0 else None


def decode_reply(body: bytes) -> tuple[int, Reply | Push]:
    """Decode a reply or push, and return it with its call id, which is 0 for a push. Raises `WireError`."""
    if len(body) < _LARGE_BODY_BYTES:
        return _decode_reply(body)
    with gc_disabled():
        return _decode_reply(body)


def _decode_reply(body: bytes) -> tuple[int, Reply | Push]:
    envelope = _unpack_envelope(body, unpack)
    name, call = envelope.get("is"), envelope.get("re", 0)
    kind = _REPLIES.get(name) if isinstance(name, str) else None
    if kind is None or not isinstance(call, int):
        raise WireError(_("unknown reply '{name}'").format(name=name), code="answer")
    return call, from_plain(kind, envelope.get("what", {}))


def _unpack_envelope(body: bytes, decode: Callable[[bytes], object]) -> Mapping[str, object]:
    try:
        value = decode(body)
    except ValueError as error:
        reason = _("the body isn't valid msgpack: {error}").format(error=error)
        raise WireError(reason, len(body), code="msgpack") from error
    if not isinstance(value, dict):
        raise WireError(_("the body isn't a map"), len(body), code="map")
    return value


@contextmanager
def gc_disabled() -> Iterator[None]:
    """Disable garbage collection within the context, which halves the time to build a large graph.

    Affects the whole process, so use it for milliseconds only.
    """
    was_enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was_enabled:
            gc.enable()


# ---- frozen dataclasses to maps and back; the classes have neither `__post_init__` nor slots


def to_plain(value: object) -> object:
    """Convert a value to maps, lists and scalars. Fields with their default value are omitted."""
    if type(value) in _PLAIN_TYPES:
        return value
    if is_dataclass(value) and not isinstance(value, type):
        out: dict[str, object] = {}
        for name, default in _fields_of(type(value)):
            item = getattr(value, name)
            if default is MISSING or item != default:
                out[name] = item if type(item) in _PLAIN_TYPES else to_plain(item)
        return out
    if isinstance(value, Mapping):
        return {key: to_plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [to_plain(item) for item in value]
    return value


@cache
def _fields_of(kind: type) -> tuple[tuple[str, object], ...]:
    return tuple(
        (field.name, field.default if field.default_factory is MISSING else field.default_factory())
        for field in fields(kind)
    )


def from_plain(kind: type[T], value: object) -> T:
    """Parse a value of type `kind` from the result of `to_plain`.

    Unknown fields are ignored, because newer peers may send more fields.

    Raises:
        WireError: A field is missing or invalid; the message contains its name.
    """
    hint: Any = kind
    try:
        return cast("T", _reader(hint)(value))
    except _MismatchError as mismatch:
        field_path = ".".join((kind.__name__, *reversed(mismatch.path)))
        code = "field-missing" if mismatch.template == _MISSING_FIELD_MESSAGE else "field-type"
        raise WireError(_(mismatch.template).format(field=field_path, **mismatch.values), code=code) from None


class _MismatchError(Exception):
    """Validation error, whose field path is completed while the exception propagates.

    Attributes:
        template: Message with the placeholder ``field`` and those in ``values``.
        values: Values of the other placeholders.
        path: Field path, innermost first.
    """

    def __init__(self, template: str, **values: str) -> None:
        super().__init__(template)
        self.template, self.values = template, values
        self.path: list[str] = []


def create_frozen(kind: type[T], field_values: dict[str, object]) -> T:
    """Create a frozen dataclass from a dict of all its fields, in a fifth of the constructor's time.

    The dataclass takes ownership of `field_values`, which must not be changed afterwards.
    """
    value = object.__new__(kind)
    object.__setattr__(value, "__dict__", field_values)
    return value


Reader = Callable[[object], object]


@cache
def _reader(hint: Any) -> Reader:  # noqa: ANN401 - a type hint is any object
    if isinstance(hint, type) and is_dataclass(hint):
        return _dataclass_reader(hint)
    origin, args = get_origin(hint), get_args(hint)
    if origin in {UnionType, Union}:
        inner = _reader(next(arg for arg in args if arg is not type(None)))
        return lambda value: None if value is None else inner(value)
    if origin is tuple:
        return _tuple_reader(_reader(args[0]))
    if isinstance(origin, type) and issubclass(origin, Mapping):
        return _mapping_reader(_reader(args[0]), _reader(args[1]))
    return _plain_reader(hint)


def _plain_reader(hint: type) -> Reader:
    def parse(value: object) -> object:
        if hint is float and isinstance(value, int) and not isinstance(value, bool):
            return float(value)
        if not isinstance(value, hint) or (hint is int and isinstance(value, bool)):
            raise _MismatchError(_WRONG_TYPE_MESSAGE, given=type(value).__name__, wanted=hint.__name__)
        return value

    return parse


def _tuple_reader(item: Reader) -> Reader:
    def parse(value: object) -> object:
        if not isinstance(value, list | tuple):
            raise _MismatchError(_NOT_A_LIST_MESSAGE, given=type(value).__name__)
        return tuple([item(each) for each in value])

    return parse


def _mapping_reader(key: Reader, item: Reader) -> Reader:
    def parse(value: object) -> object:
        if not isinstance(value, Mapping):
            raise _MismatchError(_NOT_A_MAP_MESSAGE, given=type(value).__name__)
        return {key(name): item(each) for name, each in value.items()}

    return parse


def _dataclass_reader(kind: type) -> Reader:
    hints = get_type_hints(kind)
    # values of the usual type are used unchanged, without calling the reader
    readers = [
        (
            each.name,
            hints[each.name] if hints[each.name] in _PLAIN_TYPES else None,
            _reader(hints[each.name]),
            each,
        )
        for each in fields(kind)
    ]
    read_fast = _fast_reader(kind, hints)

    def parse(value: object) -> object:
        fast_value = read_fast(value) if type(value) is dict else None
        if fast_value is not None:
            return fast_value
        if not isinstance(value, Mapping):
            raise _MismatchError(_NOT_A_MAP_MESSAGE, given=type(value).__name__)
        values: dict[str, object] = {}
        for name, usual_type, reader, field in readers:
            item = value.get(name, MISSING)
            if item is MISSING:
                values[name] = _default_value(field)
            elif type(item) is usual_type:
                values[name] = item
            else:
                try:
                    values[name] = reader(item)
                except _MismatchError as mismatch:
                    mismatch.path.append(name)
                    raise
        return create_frozen(kind, values)

    return parse


def _fast_reader(kind: type, hints: Mapping[str, Any]) -> Callable[[dict[str, object]], object | None]:
    # Returns a function for the common case in graphs: a map of exactly the fields, each of its type. It
    # returns None for any other map, which the general parser then handles or rejects.
    types_by_field = {name: _plain_types(hint) for name, hint in hints.items()}
    names = [name for name, types in types_by_field.items() if types]
    parsed_fields = [(name, _reader(hints[name])) for name, types in types_by_field.items() if not types]
    plain_values = (
        itemgetter(*names) if len(names) > 1 else lambda value: tuple(value[name] for name in names)
    )
    valid_types: set[tuple[type, ...]] = set()
    """Combinations of field types that were found valid. An optional field has two possible types."""

    def read_fast(value: dict[str, object]) -> object | None:
        if len(value) != len(types_by_field):
            return None
        try:
            types = tuple(map(type, plain_values(value)))
            if types not in valid_types:
                if not all(each in types_by_field[name] for name, each in zip(names, types, strict=True)):
                    return None
                valid_types.add(types)
            field_values = dict(value)
            for name, reader in parsed_fields:
                field_values[name] = reader(value[name])
        except (LookupError, _MismatchError):
            return None
        instance: object = create_frozen(kind, field_values)
        return instance

    return read_fast


def _plain_types(hint: Any) -> frozenset[type]:  # noqa: ANN401 - a type hint is any object
    # Types whose values are used unchanged; empty if values must be parsed.
    if hint in _PLAIN_TYPES:
        return frozenset({hint})
    if get_origin(hint) in {UnionType, Union} and set(get_args(hint)) <= _PLAIN_TYPES:
        return frozenset(get_args(hint))
    return frozenset()


def _default_value(field: Field[Any]) -> object:
    if field.default is not MISSING:
        return field.default
    if field.default_factory is not MISSING:
        return field.default_factory()
    mismatch = _MismatchError(_MISSING_FIELD_MESSAGE)
    mismatch.path.append(field.name)
    raise mismatch
