"""Printing of the blocks to a printer or a PDF file."""

from __future__ import annotations

import datetime as dt
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from PySide6.QtCore import QBuffer, QByteArray, QIODevice, QLocale, QMarginsF, QRectF, QSize, Qt
from PySide6.QtGui import QPageLayout, QPageSize, QPainter
from PySide6.QtWidgets import QDialog

from app.core.storage.atomic_file import write_atomically
from app.ui.panels.base import PanelContext
from app.ui.panels.build.behaviour.program_pictures import suggested_path
from app.ui.widgets.file_dialogs import FileKind
from nep.i18n import _, day_text

if TYPE_CHECKING:
    from PySide6.QtPrintSupport import QPrinter

MAX_DPI = 300
"""Maximum resolution. Blocks don't look better above it, and a page at 1200 dpi takes 500 MB."""


class PrintCommands:
    """Handlers that print the blocks of the current behaviour or save them as PDF.

    Args:
        context: Functions of the window.
        render: Renders all blocks as PDF. Receives title, formatted date, page layout, and a function for
            the PDF data; b"" stands for no blocks.
        printers: Returns the names of the computer's printers.
    """

    def __init__(
        self,
        context: PanelContext,
        render: Callable[[str, str, QPageLayout, Callable[[bytes], None]], object],
        printers: Callable[[], list[str]] | None = None,
    ) -> None:
        self._context, self._render_pdf = context, render
        self._printers = printers if printers is not None else printer_names

    def show_dialog(self) -> None:
        """Show the print dialog or, if there are no printers, the dialog to save a PDF."""
        if not self._printers():
            self._context.show_toast(
                _("No printer is set up on this computer. Save the pages as PDF instead.")
            )
            self.ask_save_pdf()
            return
        from PySide6.QtPrintSupport import QPrintDialog, QPrinter  # noqa: PLC0415 - needed for printing only

        printer = QPrinter(QPrinter.PrinterMode.HighResolution)
        printer.setDocName(self._context.session.document.name)
        printer.setPageLayout(default_page_layout())
        dialog = QPrintDialog(printer, self._context.surface)
        dialog.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        dialog.setWindowModality(Qt.WindowModality.NonModal)  # keeps Stop accessible
        dialog.finished.connect(
            lambda result: self.print(printer) if result == QDialog.DialogCode.Accepted else None
        )
        dialog.show()

    def print(self, printer: QPrinter) -> None:
        """Print the blocks on a printer, with the page layout and page range of the printer object."""

        def paint(data: bytes) -> None:
            if not data:
                self._notify_no_blocks()
            elif paint_pdf(data, printer):
                self._context.show_toast(_("Sent to the printer {name}").format(name=printer.printerName()))
            else:
                self._context.show_toast(
                    _("The printer {name} isn't responding").format(name=printer.printerName())
                )

        self._render(printer.pageLayout(), paint)

    def ask_save_pdf(self) -> None:
        """Ask for a file and save the blocks to it as PDF."""
        self._context.files.save_as(
            _("Save blocks as PDF"),
            suggested_path(self._context.session.document),
            (FileKind("PDF", ".pdf"),),
            lambda path, _kind: self.save(path),
        )

    def save(self, path: Path) -> None:
        """Save the blocks as PDF, adding the file extension ".pdf" if it is missing."""
        pdf_path = path if path.suffix.lower() == ".pdf" else path.with_name(f"{path.name}.pdf")

        def write(data: bytes) -> None:
            if not data:
                self._notify_no_blocks()
                return
            try:
                write_atomically(pdf_path, data)
            except OSError as error:
                self._context.show_toast(
                    _("Can't save the PDF: {why}").format(why=error.strerror or str(error))
                )
            else:
                self._context.show_toast(_("Saved {name}").format(name=pdf_path.name))

        self._render(default_page_layout(), write)

    def _render(self, layout: QPageLayout, callback: Callable[[bytes], None]) -> None:
        today = dt.datetime.now().astimezone()
        date = day_text(today.day, today.month, today.year)
        self._render_pdf(self._context.session.document.name, date, layout, callback)

    def _notify_no_blocks(self) -> None:
        self._context.show_toast(_("This page has no blocks"))


def printer_names() -> list[str]:
    """Return the names of the computer's printers; empty if Qt's print support is missing."""
    try:
        from PySide6.QtPrintSupport import QPrinterInfo  # noqa: PLC0415 - needed for printing only
    except ImportError:
        return []
    return list(QPrinterInfo.availablePrinterNames())


def default_page_layout() -> QPageLayout:
    """Return a portrait page layout: Letter on systems with US units, else A4."""
    is_imperial = QLocale.system().measurementSystem() == QLocale.MeasurementSystem.ImperialUSSystem
    size = QPageSize.PageSizeId.Letter if is_imperial else QPageSize.PageSizeId.A4
    return QPageLayout(QPageSize(size), QPageLayout.Orientation.Portrait, QMarginsF())


def paint_pdf(data: bytes, printer: QPrinter) -> bool:
    """Paint the printer's page range of a PDF document; return False if the printer rejected it."""
    from PySide6.QtPdf import QPdfDocument  # noqa: PLC0415 - needed for printing only

    buffer = QBuffer()
    buffer.setData(QByteArray(data))
    buffer.open(QIODevice.OpenModeFlag.ReadOnly)
    pages = QPdfDocument()
    pages.load(buffer)
    first = max(1, printer.fromPage())
    last = min(printer.toPage() or pages.pageCount(), pages.pageCount())
    printer.setFullPage(True)
    painter = QPainter()
    if not painter.begin(printer):
        return False
    for number in range(first, last + 1):
        if number > first and not printer.newPage():
            painter.end()
            return False
        points = pages.pagePointSize(number - 1)
        dpi = min(printer.resolution(), MAX_DPI)
        size = QSize(round(points.width() * dpi / 72), round(points.height() * dpi / 72))
        scale = printer.resolution() / 72
        target = QRectF(0, 0, points.width() * scale, points.height() * scale)
        painter.drawImage(target, pages.render(number - 1, size))
    return bool(painter.end())
