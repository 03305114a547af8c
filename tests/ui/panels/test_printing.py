"""Tests of printing, with a PDF file as the fallback when there is no printer."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import cast

import pytest
from PySide6.QtCore import QBuffer, QIODevice
from PySide6.QtGui import QPageLayout, QPainter, QPdfWriter
from PySide6.QtPdf import QPdfDocument
from PySide6.QtPrintSupport import QPrintDialog, QPrinter
from PySide6.QtWidgets import QApplication, QWidget

from app.ui.panels.base import PanelContext
from app.ui.panels.build.behaviour.printing import PrintCommands, default_page_layout, paint_pdf
from tests.ui.shell_parts import Answers


class Editor:
    """Fake block editor that renders the given PDF."""

    def __init__(self, data: bytes) -> None:
        self.data = data
        self.asked: list[tuple[str, str]] = []

    def render_pdf(self, title: str, date: str, _layout: QPageLayout, done: Callable[[bytes], None]) -> None:
        self.asked.append((title, date))
        done(self.data)


def pages(count: int) -> bytes:
    buffer = QBuffer()
    buffer.open(QIODevice.OpenModeFlag.WriteOnly)
    writer = QPdfWriter(buffer)
    writer.setPageLayout(default_page_layout())
    painter = QPainter(writer)
    for number in range(count):
        if number:
            writer.newPage()
        painter.fillRect(0, 0, 3000, 3000 * (number + 1), "#ff0000")
    painter.end()
    return bytes(buffer.data().data())


class Case:
    def __init__(self, qtbot, data: bytes, printers: list[str]) -> None:
        self.said: list[str] = []
        self.editor, self.window = Editor(data), QWidget()
        qtbot.addWidget(self.window)
        self.window.case = self  # a reference cycle: the window must outlive its print dialog
        session = SimpleNamespace(document=SimpleNamespace(name="Tea", path=None))
        self.answers = Answers()
        context = SimpleNamespace(
            show_toast=self.said.append, surface=self.window, session=session, files=self.answers
        )
        self.printing = PrintCommands(cast("PanelContext", context), self.editor.render_pdf, lambda: printers)


def dialogs(kind: type) -> list[QWidget]:
    return [each for each in QApplication.topLevelWidgets() if isinstance(each, kind) and each.isVisible()]


def test_without_a_printer_a_pdf_is_offered(qtbot, tmp_path: Path) -> None:
    case = Case(qtbot, b"%PDF", [])
    case.answers.path = tmp_path / "Tea 1.2"
    case.printing.show_dialog()
    assert "No printer" in case.said[0]
    assert case.answers.asked == [f"Save blocks as PDF: {Path.home() / 'Tea'}"]
    assert (tmp_path / "Tea 1.2.pdf").read_bytes() == b"%PDF"
    assert case.said[1] == "Saved Tea 1.2.pdf"
    assert case.editor.asked[0][0] == "Tea"


def test_print_dialog_is_not_modal(qtbot) -> None:
    case = Case(qtbot, b"%PDF", ["Office"])
    case.printing.show_dialog()
    (dialog,) = dialogs(QPrintDialog)
    assert not dialog.isModal()
    dialog.close()
    assert case.editor.asked == []


def test_unwritable_pdf_path_and_empty_canvas_are_reported(qtbot, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    case = Case(qtbot, b"%PDF", [])
    case.printing.save(tmp_path / "file" / "a.pdf")
    assert case.said[0].startswith("Can't save the PDF")
    case.editor.data = b""
    case.printing.save(tmp_path / "b.pdf")
    assert case.said[1] == "This page has no blocks"
    assert not (tmp_path / "b.pdf").exists()


@pytest.mark.parametrize(("first", "last", "count"), [(0, 0, 3), (2, 3, 2), (2, 9, 2)])
def test_only_the_requested_pages_are_painted(qtbot, tmp_path: Path, first, last, count) -> None:
    printer = QPrinter(QPrinter.PrinterMode.HighResolution)
    printer.setOutputFormat(QPrinter.OutputFormat.PdfFormat)
    printer.setOutputFileName(str(tmp_path / "out.pdf"))
    printer.setResolution(96)
    printer.setPageLayout(default_page_layout())
    printer.setFromTo(first, last)
    case = Case(qtbot, pages(3), ["Office"])
    case.printing.print(printer)
    assert case.said[0].startswith("Sent to the printer")
    document = QPdfDocument()
    document.load(str(tmp_path / "out.pdf"))
    assert document.pageCount() == count
    picture = document.render(0, document.pagePointSize(0).toSize())
    document.close()
    colour = picture.pixelColor(20, 20)
    assert (colour.red() > 240, colour.green() < 15) == (True, True)


@pytest.mark.qt_log_ignore("QPainter::begin")
def test_paint_pdf_returns_false_if_the_printer_cannot_be_opened(qtbot, tmp_path: Path) -> None:
    printer = QPrinter(QPrinter.PrinterMode.ScreenResolution)
    printer.setOutputFormat(QPrinter.OutputFormat.PdfFormat)
    printer.setOutputFileName(str(tmp_path / "no folder" / "out.pdf"))
    assert not paint_pdf(pages(1), printer)
