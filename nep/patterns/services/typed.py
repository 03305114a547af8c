"""Typed calls: requests and replies may be dataclasses or TypedDicts, validated at both ends.

`nep.messages.typed`, which analyses the declarations, is imported when the first type is used.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from nep.errors import DecodeError, WrongTypeError
from nep.i18n import _
from nep.messages.codecs import Codec
from nep.messages.fields import FieldPathError
from nep.system.lazy_import import lazy_module
from nep.text import escaped, shortened

if TYPE_CHECKING:
    from nep.messages import typed
else:
    typed = lazy_module("nep.messages.typed")


_MAX_SHOWN_LENGTH = 60


class PayloadType:
    """Declared class of requests or replies.

    Args:
        declared: Dataclass or TypedDict; None allows any value.

    Raises:
        ValueError: The class is neither a dataclass nor a TypedDict, or its fields can't be encoded.
    """

    def __init__(self, declared: type | None) -> None:
        self._declared = None if declared is None else typed.message_type(declared)

    @property
    def is_any(self) -> bool:
        """True if any value is allowed and nothing is validated."""
        return self._declared is None

    def codec(self, base: Codec) -> Codec:
        """Return a codec for instances of the class, based on a codec of plain values."""
        return base if self._declared is None else typed.typed_codec(self._declared, base)

    def read(self, payload: object, size_bytes: int) -> object:
        """Convert a decoded payload to an instance of the class.

        Args:
            payload: Decoded payload.
            size_bytes: Size of the encoded payload, for the error message.

        Raises:
            DecodeError: The payload doesn't match the class; the message contains the field path.
        """
        if self._declared is None:
            return payload
        try:
            return self._declared.shape.read(payload)
        except FieldPathError as mismatch:
            reason = mismatch.message
        except RecursionError:
            reason = _("the value has too many levels")
        raise DecodeError(self._declared.name, size_bytes, reason)


@dataclass(frozen=True)
class CallTypes:
    """Declared types of a service's requests and replies."""

    request: PayloadType
    reply: PayloadType


UNTYPED = CallTypes(PayloadType(None), PayloadType(None))


def call_types(**declared_types: object) -> CallTypes:
    """Validate the declared types of requests and replies.

    Args:
        declared_types: Two classes or None by argument name: first the type of requests, then that of
            replies.

    Raises:
        ValueError: A value is not a dataclass or TypedDict, or the fields of a class can't be encoded.
    """
    declared: list[PayloadType] = []
    for name, declared_type in declared_types.items():
        if declared_type is not None and not isinstance(declared_type, type):
            raise WrongTypeError(
                _("{name} must be a dataclass or a TypedDict, not {given}").format(
                    name=name, given=escaped(shortened(repr(declared_type), _MAX_SHOWN_LENGTH))
                )
            )
        declared.append(PayloadType(declared_type))
    return CallTypes(*declared) if any(not declared_type.is_any for declared_type in declared) else UNTYPED
