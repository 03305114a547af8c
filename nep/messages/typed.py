"""Typed messages: dataclasses and TypedDicts, sent as maps of their fields and validated at both ends.

| type of a field                     | in JSON                                                          |
|-------------------------------------|------------------------------------------------------------------|
| `float`                             | number; `null` is NaN                                            |
| `int`, `str`, `bool`, `None`        | same; `int` has 64 bits                                          |
| `list[T]`, `tuple[T, ...]`, `tuple[A, B]` | list; numpy arrays can be published                        |
| `dict[str, T]`                      | map                                                              |
| dataclass, TypedDict                | map of its fields                                                |
| `A | B`, `Optional[T]`              | the member that matches; members must differ in JSON             |
| `Literal`, `Enum`                   | the value                                                        |
| `datetime`, `date`, `time`          | text in ISO 8601                                                 |
| `Any`, `object`                     | any value                                                        |

Unknown fields of a message are ignored, so that fields can be added later; missing fields take their
defaults. Fields whose name starts with `_` are private and not sent.
"""

from __future__ import annotations

import inspect
import types
import typing
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import MISSING, dataclass, fields, is_dataclass, replace
from enum import Enum
from functools import cache
from typing import Any, NamedTuple

from nep.errors import DecodeError, EncodeError, WrongTypeError, did_you_mean
from nep.i18n import _
from nep.messages.codecs import JSON, Codec, codec_for
from nep.messages.fields import FieldPathError, wrong_type_error
from nep.messages.message import UNDECODED, Message, MessageKind, new_message
from nep.messages.shapes import (
    ANY_SHAPE,
    SCALAR_SHAPES,
    ValueShape,
    enum_shape,
    list_shape,
    literal_shape,
    map_shape,
    missing_value_error,
    tuple_shape,
    union_shape,
)
from nep.system.arguments import check_type_name
from nep.text import escaped, shortened

OTHER_NAME_KEY = "nep.other_name"
"""Key of a field's metadata for an alternative name that is accepted in received messages."""

_MAX_NAME_LENGTH = 100
"""Maximum length in characters of a name in an error message."""
_QUALIFIERS = frozenset({"Required", "NotRequired", "ReadOnly"})


@dataclass(frozen=True)
class MessageType:
    """Message type declared by a class.

    Attributes:
        name: Name of the message type in the graph.
        shape: Shape of its payloads.
        kind: Class of its payloads.
    """

    name: str
    shape: ValueShape
    kind: type


@cache
def message_type(declared: type) -> MessageType:
    """Return the message type that a dataclass or TypedDict declares.

    The name of the message type is the class attribute `MSG_TYPE`, or else the name of the class.

    Raises:
        ValueError: The class is neither a dataclass nor a TypedDict, the name of its message type is
            invalid or that of a built-in type, or JSON can't represent the type of a field.
    """
    is_map = _is_typed_dict(declared)
    if not is_map and not is_dataclass(declared):
        raise WrongTypeError(
            _(
                "msg_type is the class '{name}', which is neither a dataclass nor a TypedDict; decorate it "
                "with '@dataclass'"
            ).format(name=_name_of(declared))
        )
    name = check_type_name("MSG_TYPE", getattr(declared, "MSG_TYPE", declared.__name__))
    if codec_for(name) is not JSON:
        raise ValueError(
            _(
                "the message type of '{type}' is '{name}', a built-in type without fields; set MSG_TYPE to "
                "another name"
            ).format(type=declared.__name__, name=name)
        )
    return MessageType(name, _complete_shape(declared), dict if is_map else declared)


def value_shape(declared: type) -> ValueShape | None:
    """Return the shape of a dataclass, TypedDict or Enum for parameters, or None for other classes.

    Raises `ValueError` if JSON can't represent the type of a field.
    """
    if not (is_dataclass(declared) or _is_typed_dict(declared) or issubclass(declared, Enum)):
        return None
    return _complete_shape(declared)


def _complete_shape(declared: type) -> ValueShape:
    try:
        return _shape(declared, declared.__name__, {})
    except RecursionError:
        raise ValueError(
            _("the types in '{name}' are nested too deeply; use a dataclass for the inner levels").format(
                name=declared.__name__
            )
        ) from None


# ---- encoding and decoding


def typed_codec(declared: MessageType, base: Codec) -> Codec:
    """Return a codec for instances of the type, based on the codec for plain values."""
    write, kind = declared.shape.write, Mapping if declared.kind is dict else declared.kind

    def check(payload: object) -> None:
        if not isinstance(payload, kind):
            raise EncodeError(
                declared.name,
                type(payload).__name__,
                _("publish {wanted}").format(wanted=declared.shape.expected),
            )

    def encode(payload: object) -> Any:  # noqa: ANN401 - an `Encoded`
        check(payload)
        try:
            return base.encode(write(payload))
        except FieldPathError as mismatch:
            path, reason = mismatch.path, mismatch.message
        except RecursionError:
            path, reason = "", _("the value contains itself, or has too many levels")
        raise EncodeError(declared.name, type(payload).__name__, reason, path)

    return replace(base, encode=encode, check=check)


class TypedReader:
    """Converter of received messages to messages whose payloads are instances of a declared type."""

    def __init__(self, declared: MessageType) -> None:
        self._declared = declared
        self._kinds: tuple[MessageKind, MessageKind] | None = None

    def convert(self, message: Message) -> Message:
        """Return a copy of `message` whose payload is decoded to the type at the first access.

        `message` is not changed and may be shared.
        """
        source, kinds = message.kind, self._kinds
        if kinds is None or kinds[0] is not source:
            kinds = self._kinds = (source, source._replace(decode=self._decoder(source.decode)))
        copy = new_message(Message)
        copy.kind = kinds[1]
        copy.raw = message.raw
        copy.stamp_ns = message.stamp_ns
        copy.seq = message.seq
        copy.publisher = message.publisher
        copy.extension = message.extension
        copy.decoded = UNDECODED
        if hasattr(message, "seen_ns"):
            copy.seen_ns = message.seen_ns
        return copy

    def _decoder(
        self, decode: Callable[[bytes | memoryview, Mapping[str, object]], object]
    ) -> Callable[[bytes | memoryview, Mapping[str, object]], object]:
        name, shape = self._declared.name, self._declared.shape

        def decode_typed(data: bytes | memoryview, extension: Mapping[str, object]) -> object:
            decoded = decode(data, extension)
            try:
                return shape.read(decoded)
            except FieldPathError as mismatch:
                reason = mismatch.message
            except RecursionError:
                reason = _("the value has too many levels")
            raise DecodeError(name, memoryview(data).nbytes, reason)

        return decode_typed


# ---- shapes of annotations


def _shape(hint: Any, location: str, known_shapes: dict[object, ValueShape]) -> ValueShape:  # noqa: ANN401 - any annotation
    # `location` names the field for errors. Raises `ValueError`.
    hint = _unwrap(hint)
    try:
        hash(hint)
    except TypeError:
        raise _unsupported_error(hint, location) from None
    if hint in SCALAR_SHAPES:
        return SCALAR_SHAPES[hint]
    if isinstance(hint, type) and typing.get_origin(hint) is None:
        return _shape_of_class(hint, location, known_shapes)
    origin, arguments = typing.get_origin(hint), typing.get_args(hint)
    if origin is typing.Literal:
        return _require_shape(literal_shape(arguments), hint, location)
    if origin in {typing.Union, types.UnionType}:
        return _require_distinct(
            union_shape([_shape(each, location, known_shapes) for each in arguments]), hint, location
        )
    if origin in {list, Sequence, Iterable}:
        return list_shape(_shape(arguments[0], location, known_shapes), list)
    if origin is tuple:
        if arguments[1:] == (...,):
            return list_shape(_shape(arguments[0], location, known_shapes), tuple)
        return tuple_shape([_shape(each, location, known_shapes) for each in arguments])
    if origin in {dict, Mapping} and arguments[0] is str:
        return map_shape(_shape(arguments[1], location, known_shapes))
    raise _unsupported_error(hint, location)


def _shape_of_class(hint: type, location: str, known_shapes: dict[object, ValueShape]) -> ValueShape:
    if hint in known_shapes:
        return known_shapes[hint]
    if is_dataclass(hint) or _is_typed_dict(hint):
        shape = known_shapes[hint] = ValueShape(hint.__name__, json_types={dict})
        (_fill_map if _is_typed_dict(hint) else _fill_dataclass)(shape, hint, known_shapes)
        return shape
    if issubclass(hint, Enum):
        return _require_shape(enum_shape(hint), hint, location)
    if hint in {list, tuple}:
        return list_shape(ANY_SHAPE, hint)
    if hint is dict:
        return map_shape(ANY_SHAPE)
    raise _unsupported_error(hint, location)


def _unwrap(hint: Any) -> Any:  # noqa: ANN401 - any annotation
    # Strips wrappers without effect on values: `Annotated`, `NewType`, `NotRequired`, type aliases.
    while True:
        origin = typing.get_origin(hint)
        if origin is typing.Annotated or _qualifier_of(hint):
            hint = typing.get_args(hint)[0]
        elif hasattr(hint, "__supertype__"):
            hint = hint.__supertype__
        elif type(hint).__name__ == "TypeAliasType":
            hint = hint.__value__
        else:
            return hint


def _qualifier_of(hint: Any) -> str:  # noqa: ANN401 - any annotation
    # `Required` and the like, also of typing_extensions.
    name = getattr(typing.get_origin(hint), "_name", None)
    return name if name in _QUALIFIERS else ""


def _is_typed_dict(hint: object) -> bool:
    # Also of typing_extensions.
    # `list[int]` is a class in Python 3.10
    if not isinstance(hint, type) or typing.get_origin(hint) is not None:
        return False
    return issubclass(hint, dict) and hasattr(hint, "__required_keys__")


def _require_shape(shape: ValueShape | None, hint: object, location: str) -> ValueShape:
    if shape is None:
        raise _unsupported_error(hint, location)
    return shape


def _require_distinct(shape: ValueShape | None, hint: object, location: str) -> ValueShape:
    if shape is None:
        raise ValueError(
            _(
                "{where} is a '{type}', whose types can't be distinguished in JSON; use one of them, or "
                "two fields"
            ).format(where=location, type=_name_of(hint))
        )
    return shape


def _unsupported_error(hint: object, location: str) -> ValueError:
    return ValueError(
        _(
            "{where} is a '{type}', which typed messages don't support; see docs/types.md for supported types"
        ).format(where=location, type=_name_of(hint))
    )


def _name_of(hint: object) -> str:
    name = hint.__name__ if isinstance(hint, type) and typing.get_origin(hint) is None else str(hint)
    return shortened(name, _MAX_NAME_LENGTH)


def _type_hints(declared: type) -> dict[str, Any]:
    try:
        return typing.get_type_hints(declared, include_extras=True)
    except (NameError, TypeError, AttributeError, SyntaxError) as error:
        raise ValueError(
            _(
                "the type hints of '{name}' can't be resolved: {error}; define the types outside of functions"
            ).format(name=declared.__name__, error=error)
        ) from error


# ---- fields


class _FieldEntry(NamedTuple):
    """Description of one field of a received map."""

    name: str
    other_name: str
    shape: ValueShape
    is_required: bool


def _read_fields(value: object, entries: Sequence[_FieldEntry], record_shape: ValueShape) -> dict[str, Any]:
    # Raises `FieldPathError` for a missing required field.
    if not isinstance(value, Mapping):
        raise wrong_type_error(value, _("a map of the fields of '{name}'").format(name=record_shape.name))
    values: dict[str, Any] = {}
    name = ""
    try:
        for name, other_name, shape, is_required in entries:
            if name in value:
                values[name] = shape.read(value[name])
            elif other_name in value:
                values[name] = shape.read(value[other_name])
            elif is_required:
                raise missing_value_error(shape)
    except FieldPathError as mismatch:
        raise mismatch.within(str(name)) from mismatch.__cause__
    return values


def _fill_dataclass(shape: ValueShape, declared: type, known_shapes: dict[object, ValueShape]) -> None:
    hints = _type_hints(declared)
    entries: list[_FieldEntry] = []
    sent_fields: list[tuple[str, ValueShape]] = []
    for data_field in fields(declared):
        location = f"{declared.__name__}.{data_field.name}"
        is_required = (
            data_field.init and data_field.default is MISSING and data_field.default_factory is MISSING
        )
        if not data_field.name.startswith("_"):
            field_shape = _shape(hints[data_field.name], location, known_shapes)
            sent_fields.append((data_field.name, field_shape))
            if data_field.init:
                other_name = data_field.metadata.get(OTHER_NAME_KEY, data_field.name)
                entries.append(_FieldEntry(data_field.name, other_name, field_shape, is_required))
        elif is_required:
            raise ValueError(_("{where} isn't sent; add a default value").format(where=location))
    _check_constructor(declared, {data_field.name for data_field in entries})

    def read(value: object) -> object:
        return _create_instance(declared, _read_fields(value, entries, shape))

    def write(value: object) -> dict[str, Any]:
        if not isinstance(value, declared):
            raise wrong_type_error(value, shape.expected)
        values: dict[str, Any] = {}
        for name, field_shape in sent_fields:
            try:
                values[name] = field_shape.write(getattr(value, name))
            except FieldPathError as mismatch:
                raise mismatch.within(str(name)) from mismatch.__cause__
        return values

    shape.read, shape.write = read, write


def _check_constructor(declared: type, names: Collection[str]) -> None:
    # Raises `ValueError` if the constructor needs more than the fields.
    for parameter in inspect.signature(declared).parameters.values():
        is_optional = (
            parameter.kind in {parameter.VAR_POSITIONAL, parameter.VAR_KEYWORD}
            or parameter.default is not parameter.empty
        )
        if not is_optional and (parameter.name not in names or parameter.kind is parameter.POSITIONAL_ONLY):
            raise ValueError(
                _(
                    "{where} is required by the constructor but isn't a field of the message; add a "
                    "default value"
                ).format(where=f"{declared.__name__}.{parameter.name}")
            )


def _create_instance(declared: type, arguments: Mapping[str, object]) -> object:
    try:
        return declared(**arguments)
    except Exception as error:
        raise FieldPathError(  # `__post_init__` may raise anything
            _("was rejected by '{name}': {error}").format(
                name=declared.__name__, error=escaped(shortened(str(error), 2 * _MAX_NAME_LENGTH))
            )
        ) from error


def _fill_map(shape: ValueShape, declared: type, known_shapes: dict[object, ValueShape]) -> None:
    hints = _type_hints(declared)
    required: frozenset[str] = getattr(declared, "__required_keys__", frozenset())
    entries: list[_FieldEntry] = []
    for name, hint in hints.items():
        qualifier = _qualifier_of(hint)  # __required_keys__ is wrong with string annotations
        is_required = qualifier == "Required" or (name in required and qualifier != "NotRequired")
        field_shape = _shape(hint, f"{declared.__name__}.{name}", known_shapes)
        entries.append(_FieldEntry(name, name, field_shape, is_required))
    shapes = {each.name: (each.shape, each.is_required) for each in entries}

    def write(value: object) -> dict[str, Any]:
        if not isinstance(value, Mapping):
            raise wrong_type_error(value, shape.expected)
        values: dict[str, Any] = {}
        name: object = ""
        try:
            for name, part in value.items():
                if name not in shapes:
                    raise FieldPathError(
                        _("isn't a field of '{name}'; {did_you_mean}").format(
                            name=declared.__name__, did_you_mean=did_you_mean(str(name), tuple(shapes))
                        )
                    )
                values[str(name)] = shapes[str(name)][0].write(part)
            for name, (field_shape, is_required) in shapes.items():
                if is_required and name not in values:
                    raise missing_value_error(field_shape)
        except FieldPathError as mismatch:
            raise mismatch.within(str(name)) from mismatch.__cause__
        return values

    shape.read = lambda value: _read_fields(value, entries, shape)
    shape.write = write
