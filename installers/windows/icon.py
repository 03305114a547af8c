"""The icon of Studio's programs and files, as Windows wants it: the logo at every size that it shows.

``python -m installers.windows.icon FILE.ico`` draws it, with Qt and no screen.
"""

from __future__ import annotations

import os
import struct
import sys
from collections.abc import Mapping
from pathlib import Path

from PySide6.QtCore import QBuffer, QIODevice, QRectF, Qt
from PySide6.QtGui import QGuiApplication, QImage, QPainter

from app.ui.shell.bars.logo import paint_logo
from app.ui.theme.theme import Theme

__all__ = ["SIDES", "ico", "logo_png"]

SIDES = (16, 20, 24, 32, 40, 48, 64, 128, 256)


def logo_png(side: int, theme: Theme) -> bytes:
    """The logo as a PNG picture of that many pixels on each side, clear around it."""
    image = QImage(side, side, QImage.Format.Format_ARGB32_Premultiplied)
    image.fill(Qt.GlobalColor.transparent)
    painter = QPainter(image)
    painter.setRenderHint(QPainter.RenderHint.Antialiasing)
    paint_logo(painter, QRectF(0, 0, side, side), theme)
    painter.end()
    buffer = QBuffer()
    buffer.open(QIODevice.OpenModeFlag.WriteOnly)
    image.save(buffer, "PNG")  # type: ignore[call-overload]  # the stubs want bytes, Qt a str
    return bytes(buffer.data().data())


def ico(pictures: Mapping[int, bytes]) -> bytes:
    """An .ico file of square PNG pictures, by their sides in pixels (at most 256)."""
    head = struct.pack("<HHH", 0, 1, len(pictures))
    at = len(head) + 16 * len(pictures)
    entries = b""
    for side, png in sorted(pictures.items()):
        entries += struct.pack("<BBBBHHII", side % 256, side % 256, 0, 0, 1, 32, len(png), at)
        at += len(png)
    return head + entries + b"".join(png for _side, png in sorted(pictures.items()))


def main(target: Path) -> int:
    """Write the icon; the exit code."""
    os.environ.setdefault("QT_QPA_PLATFORM", "offscreen")
    application = QGuiApplication([])
    theme = Theme("light")
    target.write_bytes(ico({side: logo_png(side, theme) for side in SIDES}))
    application.quit()
    return 0


if __name__ == "__main__":
    sys.exit(main(Path(sys.argv[1])))
