"""Paint the image of the installer's last page: the logo on white.

Run this with an interpreter that has Studio installed; a screen isn't needed:

    python page_picture.py FILE.bmp
"""

from __future__ import annotations

import os
import sys

from PySide6.QtCore import QRectF, Qt
from PySide6.QtGui import QGuiApplication, QImage, QPainter

from app.ui.shell.bars.logo import paint_logo
from app.ui.theme.theme import Theme

WIDTH, HEIGHT = 164, 314
"""Size required by NSIS."""
SIDE, TOP = 80, 40


def main(target: str) -> int:
    """Paint the image; return 1 if it can't be written, else 0."""
    os.environ.setdefault("QT_QPA_PLATFORM", "offscreen")
    _application = QGuiApplication(sys.argv[:1])  # required by the theme
    image = QImage(WIDTH, HEIGHT, QImage.Format.Format_RGB888)
    image.fill(Qt.GlobalColor.white)
    painter = QPainter(image)
    painter.setRenderHint(QPainter.RenderHint.Antialiasing)
    paint_logo(painter, QRectF((WIDTH - SIDE) / 2, TOP, SIDE, SIDE), Theme("light"))
    painter.end()
    return 0 if image.save(target) else 1


if __name__ == "__main__":
    sys.exit(main(sys.argv[1]))
