"""Encoding of text in the pixels of a PNG file, rosbridge's compression `png`.

Requires the extra `image`.
"""

from __future__ import annotations

import base64
import binascii
import math

from nep.errors import DecodeError, EncodeError, NepError
from nep.i18n import _
from nep.messages import image_codec
from nep.messages.image_files import parse_header
from nep.programs.web.limits import MAX_MESSAGE_BYTES
from nep.programs.web.messages.operations import OperationError

_MAX_WIDTH = 4_096


def encode_png(text: bytes) -> str:
    """Encode text in the pixels of a PNG file and return the file in base64.

    The text is padded with newlines. Raises `NepError` if the image codec is not installed.
    """
    try:
        import numpy as np  # noqa: PLC0415 - optional and heavy
    except ImportError as error:
        raise NepError(_("install the image codec with: pip install 'nep-studio[image]'")) from error
    width = max(1, min(_MAX_WIDTH, math.isqrt(len(text) // 3)))
    height = -(-len(text) // (3 * width)) or 1
    pixels = np.frombuffer(text.ljust(3 * width * height, b"\n"), np.uint8).reshape(height, width, 3)
    png = image_codec.ImageFormat("png").encode(pixels[:, :, ::-1])
    return base64.b64encode(png.data).decode()


def decode_png(data: str) -> bytes:
    """Decode the text in the pixels of a PNG file. Large files are rejected before decoding.

    Raises `OperationError` for invalid data, or if the image codec is not installed.
    """
    try:
        file = parse_header(base64.b64decode(data, validate=True))
        is_rgb8 = file.kind == "png" and (file.channels, file.bits) == (3, 8)
        if not is_rgb8 or file.width * file.height * 3 > MAX_MESSAGE_BYTES:
            raise OperationError(
                _("a 'png' must have 8-bit RGB pixels and at most {most} bytes").format(
                    most=MAX_MESSAGE_BYTES
                )
            )
        return bytes(image_codec.decode_file(file)[:, :, ::-1].tobytes().rstrip(b"\n"))
    except (binascii.Error, ValueError):
        raise OperationError(_("the 'data' of a 'png' isn't valid base64")) from None
    except (DecodeError, EncodeError) as error:
        raise OperationError(_("a 'png' can't be read: {reason}").format(reason=error.reason)) from None
    except ImportError:
        raise OperationError(_("install the image codec with: pip install 'nep-studio[image]'")) from None
