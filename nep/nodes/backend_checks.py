"""Validation of arguments for optional features of back ends."""

from __future__ import annotations

from dataclasses import replace

from nep.backends.base import Backend
from nep.backends.connection import Configuration, Direct
from nep.errors import WrongTypeError
from nep.i18n import _
from nep.messages.codecs import CODECS, Codec
from nep.messages.history import MAX_HISTORY
from nep.messages.image_codec import ImageFormat
from nep.nodes.arguments import check_choice, check_range
from nep.protocol.topic_pattern import is_pattern


def is_pattern_for(backend: Backend, topic: str, configuration: Configuration | None) -> bool:
    """Return True if `topic` is a pattern; always False for a direct connection.

    Raises `ValueError` if the back end has no patterns.
    """
    if isinstance(configuration, Direct) or not is_pattern(topic):
        return False
    if not backend.has_patterns:
        raise ValueError(
            _("the back end '{name}' doesn't support wildcards; subscribe to each topic by its name").format(
                name=backend.name
            )
        )
    return True


def codec_with_image_format(codec: Codec, image: ImageFormat | None) -> Codec:
    """Return `codec` with an image format.

    Raises `ValueError` if `image` is given for a codec other than "image".
    """
    if image is None:
        return codec
    if not isinstance(image, ImageFormat):
        raise WrongTypeError(
            _("'image' must be a 'nep.ImageFormat', not '{kind}'").format(kind=type(image).__name__)
        )
    if codec is not CODECS["image"]:
        raise ValueError(_("'image' requires the message type 'image'"))
    return replace(codec, encode=image.encode)


def check_history(backend: Backend, history: int, configuration: Configuration) -> int:
    """Validate a history length and return it.

    Raises `ValueError` if it is out of range, or if the back end or the wire supports no history and
    the length isn't 0.
    """
    check_range("history", history, 0, MAX_HISTORY)
    is_original = isinstance(configuration, Direct) and configuration.wire == "original"
    if history and (is_original or not backend.has_history):
        subject = _("the original wire") if is_original else _("the back end '{name}'")
        raise ValueError(
            _("{where} doesn't support history; omit history").format(where=subject.format(name=backend.name))
        )
    return history


def check_quality(backend: Backend, qos: str) -> str:
    """Validate a quality of service and return it; "" is the back end's default.

    Raises `ValueError` if the back end doesn't support it.
    """
    if qos and not backend.qos:
        raise ValueError(
            _("the back end '{name}' doesn't support quality of service; omit qos").format(name=backend.name)
        )
    return check_choice("qos", qos, ("", *backend.qos))
