"""A plot as a file: its numbers as CSV, written in a thread; what it shows as PNG or SVG."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path

from PySide6.QtCore import QBuffer, QIODevice, QRect, QRectF, QSize
from PySide6.QtGui import QImage, QPainter
from PySide6.QtSvg import QSvgGenerator

from app.core.series.csv_export import CsvColumn, csv_lines
from app.core.storage.atomic_file import write_atomically
from app.ui.panels.plot.look import Stroke
from app.ui.panels.plot.shown_curve import ShownCurve
from app.ui.theme.theme import Theme
from app.ui.widgets import paint
from app.ui.widgets.file_dialogs import FileKind
from nep.i18n import lazy

CSV = FileKind(lazy("Numbers (CSV)"), ".csv")
PNG = FileKind(lazy("Picture (PNG)"), ".png")
SVG = FileKind(lazy("Drawing (SVG)"), ".svg")
RATIO = 2
LEGEND_ROW = 22


class CsvWriter:
    """Writes one CSV file in a thread of its own; `take` says how it ended."""

    def __init__(self, path: Path, columns: Sequence[CsvColumn], origin_ns: int) -> None:
        """Begin at once; ``columns`` are never changed by anybody."""
        self.path = path
        self._done: str | None = None
        self._thread = threading.Thread(
            target=self._run, args=(columns, origin_ns), name="studio-plot-export", daemon=True
        )
        self._thread.start()

    def _run(self, columns: Sequence[CsvColumn], origin_ns: int) -> None:
        try:
            write_atomically(self.path, "".join(csv_lines(columns, origin_ns)).encode())
        except OSError as error:
            self._done = error.strerror or type(error).__name__
        except MemoryError:
            self._done = "memory"
        else:
            self._done = ""

    def take(self) -> str | None:
        """None while it writes, "" when it is written, else why not."""
        return self._done

    def close(self) -> None:
        """Wait until it is written, some seconds at most."""
        self._thread.join(5.0)


class PlotPicture:
    """What a plot shows, painted anywhere: the canvas, what stands below it, and the names of the curves."""

    def __init__(
        self,
        theme: Theme,
        parts: Iterable[tuple[QSize, Callable[[QPainter, QRectF], object]]],
        curves: Sequence[ShownCurve],
    ) -> None:
        """``parts`` from above: how large each is, and what paints it."""
        self._theme, self._parts, self._curves = (
            theme,
            list(parts),
            [each for each in curves if not each.hidden],
        )

    @property
    def size(self) -> QSize:
        """How large it is, in px."""
        row = round(self._theme.scaled(LEGEND_ROW))
        high = sum(size.height() for size, _paint in self._parts) + row * len(self._curves) + 8
        return QSize(max(size.width() for size, _paint in self._parts), high)

    def paint(self, painter: QPainter) -> None:
        """Paint all of it at the left upper corner."""
        painter.fillRect(QRect(0, 0, self.size.width(), self.size.height()), self._theme.colour("panel"))
        top = 0.0
        for size, painted in self._parts:
            painter.save()
            painter.translate(0, top)
            painted(painter, QRectF(0, 0, size.width(), size.height()))
            painter.restore()
            top += size.height()
        row = self._theme.scaled(LEGEND_ROW)
        for curve in self._curves:
            box = QRectF(12, top + 4, self.size.width() - 24, row)
            Stroke(curve.look, curve.curve.is_state, hidden=False).paint(painter, box, self._theme)
            font = self._theme.font("code")
            paint.words(painter, box.adjusted(46, 0, 0, 0), curve.name, font, self._theme.colour("text"))
            top += row

    def png(self) -> bytes:
        """As PNG, twice as fine as on the screen."""
        image = QImage(self.size * RATIO, QImage.Format.Format_RGB32)
        image.setDevicePixelRatio(RATIO)
        painter = QPainter(image)
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        self.paint(painter)
        painter.end()
        buffer = QBuffer()
        buffer.open(QIODevice.OpenModeFlag.WriteOnly)
        image.save(buffer, "PNG")  # type: ignore[call-overload]
        return bytes(buffer.data().data())

    def svg(self) -> bytes:
        """As SVG."""
        buffer = QBuffer()
        buffer.open(QIODevice.OpenModeFlag.WriteOnly)
        made = QSvgGenerator()
        made.setOutputDevice(buffer)
        made.setSize(self.size)
        made.setViewBox(QRect(0, 0, self.size.width(), self.size.height()))
        made.setTitle("NEP Studio")
        painter = QPainter(made)
        self.paint(painter)
        painter.end()
        return bytes(buffer.data().data())
