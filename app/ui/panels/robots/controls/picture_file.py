"""A picture file as it is sent to a robot: read with care, and made small enough.

What Qt may decode is decided by `nep.messages.image_files`, as for every other picture: by the bytes, JPEG
or PNG.

It is sent as NEP's pictures in JSON are: ``data:image/jpeg;base64,…``, or the bare base64 text where the
description asks for that (``contentEncoding`` and no ``format``).
"""

from __future__ import annotations

import base64
from pathlib import Path

from PySide6.QtCore import QBuffer, QByteArray, QIODevice, Qt
from PySide6.QtGui import QImage, QImageReader, QTransform

from nep.errors import DecodeError
from nep.i18n import _
from nep.messages.image_files import MOST_BYTES, ImageFile, examine

LONGEST_SIDE, QUALITY = 1280, 85
MOST_FILE_BYTES = 40_000_000


def read_picture(path: Path) -> tuple[QImage | None, str]:
    """A picture file, turned as its camera says, or the sentence that says why it can't be used."""
    try:
        if not path.is_file() and path.exists():
            return None, _("“{file}” is not a file.").format(file=path.name)
        with path.open("rb") as file:
            data = file.read(MOST_FILE_BYTES + 1)
    except OSError as error:
        reason = (error.strerror or _("unknown")).lower()
        return None, _("“{file}” can't be read: {reason}.").format(file=path.name, reason=reason)
    if len(data) > MOST_FILE_BYTES:
        said = _("“{file}” is too large. Choose a file below {size} MB.")
        return None, said.format(file=path.name, size=MOST_FILE_BYTES // 1_000_000)
    try:
        return image_of(data), ""
    except DecodeError as error:
        return None, _("“{file}” can't be used: {reason}.").format(file=path.name, reason=error.reason)


def image_of(data: bytes) -> QImage:
    """The picture in a file's bytes, upright and no larger than Qt may hold. Raises DecodeError."""
    file = examine(data)
    QImageReader.setAllocationLimit(MOST_BYTES // 1_000_000)  # else 256 MB, less than we have let through
    buffer = QBuffer()
    buffer.setData(bytes(file.data))
    buffer.open(QIODevice.OpenModeFlag.ReadOnly)
    reader = QImageReader(buffer, QByteArray(file.kind.encode()))
    reader.setDecideFormatFromContent(False)
    image = reader.read()
    if image.isNull():
        raise DecodeError("image", len(data), _("they are not a readable image"))
    return upright(image, file)


def upright(image: QImage, file: ImageFile) -> QImage:
    """The picture turned as the file's orientation says, which Qt reads from a JPEG alone."""
    if file.orientation >= 5:
        image = image.transformed(QTransform(0, 1, 1, 0, 0, 0))
    if file.orientation in (2, 3, 6, 7):
        image = image.flipped(Qt.Orientation.Horizontal)
    return image.flipped(Qt.Orientation.Vertical) if file.orientation in (3, 4, 7, 8) else image


def encoded(image: QImage, *, bare: bool = False) -> str:
    """A picture as JPEG in text, at most 1280 pixels at its longer side."""
    if max(image.width(), image.height()) > LONGEST_SIDE:
        keep, smooth = Qt.AspectRatioMode.KeepAspectRatio, Qt.TransformationMode.SmoothTransformation
        image = image.scaled(LONGEST_SIDE, LONGEST_SIDE, keep, smooth)
    held = QByteArray()
    buffer = QBuffer(held)
    buffer.open(QIODevice.OpenModeFlag.WriteOnly)
    image.convertToFormat(QImage.Format.Format_RGB32).save(buffer, "JPG", QUALITY)  # type: ignore[call-overload]
    text = base64.b64encode(held.data()).decode("ascii")
    return text if bare else f"data:image/jpeg;base64,{text}"
