"""Loading and encoding of image files for robots.

`nep.messages.image_files` checks the content of a file before Qt decodes it; JPEG and PNG are
supported.

Images are sent as in NEP's JSON messages: ``data:image/jpeg;base64,…``, or plain base64 if the
description of the action requires it (``contentEncoding`` without ``format``).
"""

from __future__ import annotations

import base64
from pathlib import Path

from PySide6.QtCore import QBuffer, QByteArray, QIODevice, Qt
from PySide6.QtGui import QImage, QImageReader, QTransform

from nep.errors import DecodeError
from nep.i18n import _
from nep.messages.image_files import MAX_BYTES, ImageFile, parse_header

MAX_SIDE_PX, JPEG_QUALITY = 1280, 85
MAX_FILE_BYTES = 40_000_000


def read_picture(path: Path) -> tuple[QImage | None, str]:
    """Load an image file and apply its EXIF orientation.

    Returns:
        The image and ""; or None and the reason why the file can't be loaded.
    """
    try:
        if not path.is_file() and path.exists():
            return None, _("“{file}” isn't a file.").format(file=path.name)
        with path.open("rb") as file:
            data = file.read(MAX_FILE_BYTES + 1)
    except OSError as error:
        reason = (error.strerror or _("unknown")).lower()
        return None, _("“{file}” can't be read: {reason}.").format(file=path.name, reason=reason)
    if len(data) > MAX_FILE_BYTES:
        message = _("“{file}” is too large. Choose a file smaller than {size} MB.")
        return None, message.format(file=path.name, size=MAX_FILE_BYTES // 1_000_000)
    try:
        return decode_image(data), ""
    except DecodeError as error:
        return None, _("“{file}” can't be used: {reason}.").format(file=path.name, reason=error.reason)


def decode_image(data: bytes) -> QImage:
    """Decode an image, limited in size, and apply its EXIF orientation.

    Raises:
        DecodeError: The data is not a supported image.
    """
    file = parse_header(data)
    # Qt's default of 256 MB is lower than the limit that was checked before
    QImageReader.setAllocationLimit(MAX_BYTES // 1_000_000)
    buffer = QBuffer()
    buffer.setData(bytes(file.data))
    buffer.open(QIODevice.OpenModeFlag.ReadOnly)
    reader = QImageReader(buffer, QByteArray(file.kind.encode()))
    reader.setDecideFormatFromContent(False)
    image = reader.read()
    if image.isNull():
        raise DecodeError("image", len(data), _("not a readable image"))
    return apply_orientation(image, file)


def apply_orientation(image: QImage, file: ImageFile) -> QImage:
    """Rotate an image by its EXIF orientation. Qt itself would do so for JPEG files only."""
    if file.orientation >= 5:
        image = image.transformed(QTransform(0, 1, 1, 0, 0, 0))
    if file.orientation in (2, 3, 6, 7):
        image = image.flipped(Qt.Orientation.Horizontal)
    return image.flipped(Qt.Orientation.Vertical) if file.orientation in (3, 4, 7, 8) else image


def encode_image(image: QImage, *, omit_prefix: bool = False) -> str:
    """Encode an image as JPEG in base64, scaled to at most 1280 px on its longer side.

    Args:
        image: Image to encode.
        omit_prefix: True to omit the ``data:`` prefix.
    """
    if max(image.width(), image.height()) > MAX_SIDE_PX:
        aspect, smooth = Qt.AspectRatioMode.KeepAspectRatio, Qt.TransformationMode.SmoothTransformation
        image = image.scaled(MAX_SIDE_PX, MAX_SIDE_PX, aspect, smooth)
    encoded = QByteArray()
    buffer = QBuffer(encoded)
    buffer.open(QIODevice.OpenModeFlag.WriteOnly)
    image.convertToFormat(QImage.Format.Format_RGB32).save(buffer, "JPG", JPEG_QUALITY)  # type: ignore[call-overload]
    text = base64.b64encode(encoded.data()).decode("ascii")
    return text if omit_prefix else f"data:image/jpeg;base64,{text}"
