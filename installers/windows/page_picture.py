"""The picture at the setup's last page: the logo on white.

Run by an interpreter in whose environment Studio is installed, with no screen:

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
"""What NSIS wants."""
SIDE, TOP = 80, 40


def main(target: str) -> int:
    """Paint it; 0, or 1 when it can't be written."""
    os.environ.setdefault("QT_QPA_PLATFORM", "offscreen")
    _application = QGuiApplication(sys.argv[:1])  # the theme asks it
    image = QImage(WIDTH, HEIGHT, QImage.Format.Format_RGB888)
    image.fill(Qt.GlobalColor.white)
    painter = QPainter(image)
    painter.setRenderHint(QPainter.RenderHint.Antialiasing)
    paint_logo(painter, QRectF((WIDTH - SIDE) / 2, TOP, SIDE, SIDE), Theme("light"))
    painter.end()
    return 0 if image.save(target) else 1


if __name__ == "__main__":
    sys.exit(main(sys.argv[1]))
