"""Export of a plot: values as CSV, or the image as PNG or SVG."""

from __future__ import annotations

import errno
import os
import threading
from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path

from PySide6.QtCore import QBuffer, QIODevice, QRect, QRectF, QSize, Qt
from PySide6.QtGui import QImage, QPainter
from PySide6.QtSvg import QSvgGenerator
from PySide6.QtWidgets import QWidget

from app.core.series.csv_export import CsvColumn, columns_of, csv_chunks
from app.core.storage.atomic_file import write_atomically
from app.ui.panels.base import PanelContext
from app.ui.panels.watch.plot.curve_style import Stroke
from app.ui.panels.watch.plot.plotted_curve import PlotCurve
from app.ui.theme.theme import Theme
from app.ui.widgets import paint
from app.ui.widgets.file_dialogs import FileKind
from app.ui.widgets.menus import Menu
from nep.i18n import _, lazy

CSV_KIND = FileKind(lazy("Data (CSV)"), ".csv")
PNG_KIND = FileKind(lazy("Image (PNG)"), ".png")
SVG_KIND = FileKind(lazy("Vector image (SVG)"), ".svg")
PNG_SCALE = 2
CLOSE_TIMEOUT_S = 3.0
PicturePart = tuple[QSize, Callable[[QPainter, QRectF], object]]
LEGEND_ROW_HEIGHT = 22


class CsvWriter:
    """Background thread that writes one CSV file.

    Args:
        path: File to write.
        columns: Columns to write; they must not be modified while the thread is running.
        origin_ns: Time of the origin of the time base, in ns since 1970.
    """

    def __init__(self, path: Path, columns: Sequence[CsvColumn], origin_ns: int) -> None:
        self.path = path
        self._result: str | None = None
        self._cancelled = threading.Event()
        self._thread = threading.Thread(
            target=self._run, args=(columns, origin_ns), name="studio-plot-export", daemon=True
        )
        self._thread.start()

    def _run(self, columns: Sequence[CsvColumn], origin_ns: int) -> None:
        try:
            write_atomically(self.path, self._encoded_lines(columns, origin_ns))
        except OSError as error:
            self._result = error.strerror or type(error).__name__
        except MemoryError:
            self._result = _("not enough memory")
        else:
            self._result = ""

    def _encoded_lines(self, columns: Sequence[CsvColumn], origin_ns: int) -> Iterator[bytes]:
        for lines in csv_chunks(columns, origin_ns):
            if self._cancelled.is_set():
                raise OSError(errno.ECANCELED, os.strerror(errno.ECANCELED))
            yield lines.encode()

    def result(self) -> str | None:
        """Return None while the thread is writing, "" on success, or the reason for the failure."""
        return self._result

    def close(self) -> None:
        """Wait a few seconds for the thread to finish, then cancel it and remove the partial file."""
        self._thread.join(CLOSE_TIMEOUT_S)
        self._cancelled.set()
        self._thread.join(CLOSE_TIMEOUT_S)


class PlotPicture:
    """Image of a plot for export: its parts from top to bottom, then the names of the curves.

    Args:
        theme: Theme with colours and fonts.
        parts: Size and paint function of the canvas and of the lanes.
        curves: Curves of the plot; hidden ones are omitted.
    """

    def __init__(
        self,
        theme: Theme,
        parts: Iterable[PicturePart],
        curves: Sequence[PlotCurve],
    ) -> None:
        self._theme, self._parts, self._curves = (
            theme,
            list(parts),
            [each for each in curves if not each.is_hidden],
        )

    @property
    def size(self) -> QSize:
        """Size in px."""
        row_height = round(self._theme.scaled(LEGEND_ROW_HEIGHT))
        height = sum(size.height() for size, _paint in self._parts) + row_height * len(self._curves) + 8
        return QSize(max(size.width() for size, _paint in self._parts), height)

    def paint(self, painter: QPainter) -> None:
        """Paint the image with its top left corner at the origin."""
        painter.fillRect(QRect(0, 0, self.size.width(), self.size.height()), self._theme.colour("panel"))
        top = 0.0
        for size, paint_part in self._parts:
            painter.save()
            painter.translate(0, top)
            paint_part(painter, QRectF(0, 0, size.width(), size.height()))
            painter.restore()
            top += size.height()
        row_height = self._theme.scaled(LEGEND_ROW_HEIGHT)
        for curve in self._curves:
            box = QRectF(12, top + 4, self.size.width() - 24, row_height)
            Stroke(curve.style, curve.curve.is_state, is_hidden=False).paint(painter, box, self._theme)
            font = self._theme.font("code")
            paint.text_line(painter, box.adjusted(46, 0, 0, 0), curve.name, font, self._theme.colour("text"))
            top += row_height

    def encode_png(self) -> bytes:
        """Return the image as PNG in double resolution. Raises `OSError` if there is not enough memory."""
        image = QImage(self.size * PNG_SCALE, QImage.Format.Format_RGB32)
        if image.isNull():
            raise OSError(errno.ENOMEM, _("not enough memory"))
        image.setDevicePixelRatio(PNG_SCALE)
        painter = QPainter(image)
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        self.paint(painter)
        painter.end()
        buffer = QBuffer()
        buffer.open(QIODevice.OpenModeFlag.WriteOnly)
        if not image.save(buffer, "PNG"):  # type: ignore[call-overload]
            raise OSError(errno.ENOMEM, _("not enough memory"))
        return bytes(buffer.data().data())

    def encode_svg(self) -> bytes:
        """Return the image as SVG."""
        buffer = QBuffer()
        buffer.open(QIODevice.OpenModeFlag.WriteOnly)
        generator = QSvgGenerator()
        generator.setOutputDevice(buffer)
        generator.setSize(self.size)
        generator.setViewBox(QRect(0, 0, self.size.width(), self.size.height()))
        generator.setTitle("NEP Studio")
        painter = QPainter(generator)
        self.paint(painter)
        painter.end()
        return bytes(buffer.data().data())


class PlotExport:
    """Export of a plot to a file that the user chooses; the result is shown in a toast.

    Args:
        parts: Returns size and paint function of the canvas and of the lanes.
        curves: Returns the curves of the plot.
        visible_range: Returns start and end of the visible range in s.
    """

    def __init__(
        self,
        context: PanelContext,
        parts: Callable[[], Iterable[PicturePart]],
        curves: Callable[[], Sequence[PlotCurve]],
        visible_range: Callable[[], tuple[float, float]],
    ) -> None:
        self._context, self._parts, self._curves, self._visible_range = context, parts, curves, visible_range
        self._writer: CsvWriter | None = None

    def menu(self, parent: QWidget) -> Menu:
        """Return the menu of export formats."""
        menu = Menu(self._context.theme, parent)
        menu.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        for kind in (CSV_KIND, PNG_KIND, SVG_KIND):
            action = menu.addAction(_(kind.label))
            action.triggered.connect(lambda _on=False, kind=kind: self.prompt_file(kind))
        return menu

    def prompt_file(self, kind: FileKind) -> None:
        """Ask for a file name, then export the plot. The dialog suggests the format `kind`."""
        suggestion = Path.home() / f"{_('Plot')}{kind.suffix}"
        kinds = [kind, *(each for each in (CSV_KIND, PNG_KIND, SVG_KIND) if each is not kind)]
        self._context.files.save_as(_("Export the plot"), suggestion, kinds, self.write)

    def write(self, path: Path, kind: FileKind) -> None:
        """Export the plot to a file.

        CSV files are written in a background thread, whose result `poll` reports.

        Args:
            path: File to write.
            kind: Format of the file.
        """
        if kind != CSV_KIND:
            picture = PlotPicture(self._context.theme, self._parts(), self._curves())
            try:
                write_atomically(path, picture.encode_png() if kind == PNG_KIND else picture.encode_svg())
            except OSError as error:
                self._report(path, error.strerror or type(error).__name__)
            else:
                self._report(path, "")
            return
        if self._writer is not None and self._writer.result() is None:
            self._context.show_toast(_("The previous export is still running"))
            return
        curves = [each.curve for each in self._curves() if not each.is_hidden]
        origin_ns = self._context.session.shown.series.origin_ns
        self._writer = CsvWriter(path, columns_of(curves, *self._visible_range()), origin_ns)

    def poll(self) -> None:
        """Report the result of a CSV export once it has finished; call on every tick."""
        if self._writer is not None and (error_text := self._writer.result()) is not None:
            self._report(self._writer.path, error_text)
            self._writer = None

    def _report(self, path: Path, reason: str) -> None:
        if reason:
            message = _("Can't export {file}: {reason}").format(file=path.name, reason=reason)
        else:
            message = _("Exported {file}").format(file=path.name)
        self._context.show_toast(message)

    def close(self) -> None:
        """Wait for a running export to finish."""
        if self._writer is not None:
            self._writer.close()
