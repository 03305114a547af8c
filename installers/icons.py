"""Paint the icons of the program and of documents with Studio's own code.

Run with an interpreter that has Studio installed; needs no screen:

    python icons.py FOLDER

Writes `nep-studio-SIZE.png` and `nep-behaviour-SIZE.png` for each of `SIZES`.
"""

from __future__ import annotations

import os
import sys
from pathlib import Path

from PySide6.QtCore import QPointF, QRectF, Qt
from PySide6.QtGui import QColor, QImage, QPainter, QPen, QPolygonF
from PySide6.QtWidgets import QApplication

from app.ui.shell.bars.logo import paint_logo
from app.ui.theme.theme import Theme

SIZES = (16, 22, 24, 32, 48, 64, 128, 256, 512, 1024)
MARGIN = 0.04
PAPER, EDGE = "#FFFFFF", "#8A94A6"


def paint_program(painter: QPainter, rect: QRectF, theme: Theme) -> None:
    """Paint the logo with a small margin."""
    margin = rect.width() * MARGIN
    paint_logo(painter, rect.adjusted(margin, margin, -margin, -margin), theme)


def paint_behaviour(painter: QPainter, rect: QRectF, theme: Theme) -> None:
    """Paint a sheet of paper with a folded corner and the logo."""
    side = rect.width()

    def at(x: float, y: float) -> QPointF:
        return QPointF(rect.left() + x * side, rect.top() + y * side)

    pen = QPen(QColor(EDGE), max(1.0, side / 48))
    pen.setJoinStyle(Qt.PenJoinStyle.RoundJoin)
    painter.setPen(pen)
    painter.setBrush(QColor(PAPER))
    corners = ((0.16, 0.05), (0.62, 0.05), (0.84, 0.27), (0.84, 0.95), (0.16, 0.95))
    painter.drawPolygon(QPolygonF([at(*each) for each in corners]))
    painter.drawPolyline(QPolygonF([at(0.62, 0.05), at(0.62, 0.27), at(0.84, 0.27)]))
    paint_logo(painter, QRectF(at(0.28, 0.38), at(0.72, 0.82)), theme)


PICTURES = {"nep-studio": paint_program, "nep-behaviour": paint_behaviour}


def main() -> int:
    """Paint all icons; return 1 if a file can't be written, else 0."""
    os.environ.setdefault("QT_QPA_PLATFORM", "offscreen")
    _application = QApplication(sys.argv[:1])  # required by the theme
    theme, folder = Theme("light"), Path(sys.argv[1])
    folder.mkdir(parents=True, exist_ok=True)
    is_saved = True
    for name, picture in PICTURES.items():
        for size in SIZES:
            image = QImage(size, size, QImage.Format.Format_ARGB32)
            image.fill(Qt.GlobalColor.transparent)
            painter = QPainter(image)
            painter.setRenderHint(QPainter.RenderHint.Antialiasing)
            picture(painter, QRectF(image.rect()), theme)
            painter.end()
            is_saved = image.save(str(folder / f"{name}-{size}.png")) and is_saved
    return 0 if is_saved else 1


if __name__ == "__main__":
    sys.exit(main())
