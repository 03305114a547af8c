"""A picture file as it is sent to a robot: read with care, and made small enough.

It is sent as NEP's pictures in JSON are: ``data:image/jpeg;base64,…``, or the bare base64 text where the
description asks for that (``contentEncoding`` and no ``format``).
"""

from __future__ import annotations

import base64
from pathlib import Path

from PySide6.QtCore import QBuffer, QByteArray, QIODevice, Qt
from PySide6.QtGui import QImage, QImageReader

FILES = "Pictures (*.png *.jpg *.jpeg *.gif *.bmp *.webp)"
LONGEST_SIDE, QUALITY = 1280, 85
MOST_PIXELS = 60_000_000
MOST_FILE_BYTES = 40_000_000


def read_picture(path: Path) -> tuple[QImage | None, str]:
    """A picture file, turned as its camera says, or the sentence that says why it can't be used."""
    try:
        too_big = path.stat().st_size > MOST_FILE_BYTES
    except OSError as error:
        return None, f"“{path.name}” can't be read: {(error.strerror or 'unknown').lower()}."
    reader = QImageReader(str(path))
    reader.setAutoTransform(True)
    size = reader.size()
    if too_big or size.width() * size.height() > MOST_PIXELS:
        return None, f"“{path.name}” is too large; use one below {MOST_FILE_BYTES // 1_000_000} MB."
    image = reader.read()
    if image.isNull():
        return None, f"“{path.name}” is no picture that can be read."
    return image, ""


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
