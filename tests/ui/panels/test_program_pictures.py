"""Tests of exporting an image of the blocks to a file or the clipboard, with errors."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import cast

import pytest
from PySide6.QtGui import QColor, QGuiApplication, QImage
from pytestqt.qtbot import QtBot

from app.ui.panels.base import PanelContext
from app.ui.panels.build.behaviour.program_pictures import ImageCommands
from tests.ui.shell_parts import Answers


class Editor:
    """Fake block editor that renders the given image."""

    def __init__(self, data: bytes) -> None:
        self.data = data
        self.asked: list[tuple[str, bool]] = []

    def render_picture(self, kind: str, white: bool, done: Callable[[bytes], None]) -> None:
        self.asked.append((kind, white))
        done(self.data)


def made(editor: Editor, said: list[str], answers: Answers | None = None) -> ImageCommands:
    session = SimpleNamespace(document=SimpleNamespace(name="Tea", path=None))
    context = SimpleNamespace(show_toast=said.append, session=session, files=answers or Answers())
    return ImageCommands(cast("PanelContext", context), editor.render_picture)


def test_typed_file_extension_selects_the_image_format(tmp_path: Path) -> None:
    said: list[str] = []
    editor, answers = Editor(b"<svg/>"), Answers()
    answers.path = tmp_path / "Tea.SVG"
    made(editor, said, answers).save_as()
    assert answers.asked == [f"Save blocks as image: {Path.home() / 'Tea'}"]
    assert editor.asked == [("svg", True)]
    assert answers.path.read_bytes() == b"<svg/>"


def test_image_is_written_with_the_extension_of_its_format(tmp_path: Path) -> None:
    said: list[str] = []
    editor = Editor(b"<svg/>")
    made(editor, said).save(tmp_path / "Greeting 1.2", "svg", False)
    assert (tmp_path / "Greeting 1.2.svg").read_bytes() == b"<svg/>"
    assert editor.asked == [("svg", False)]
    assert said == ["Saved Greeting 1.2.svg"]


def test_image_that_cannot_be_saved_is_reported(tmp_path: Path) -> None:
    said: list[str] = []
    (tmp_path / "file").write_text("")
    made(Editor(b"<svg/>"), said).save(tmp_path / "file" / "a.svg", "svg", True)
    (sentence,) = said
    assert sentence.startswith("Can't save the image")


def test_image_export_without_blocks_writes_no_file(tmp_path: Path) -> None:
    said: list[str] = []
    made(Editor(b""), said).save(tmp_path / "a.png", "png", True)
    assert said == ["This page has no blocks"]
    assert list(tmp_path.iterdir()) == []


@pytest.mark.usefixtures("qapp")
def test_image_is_copied_to_the_clipboard(qtbot: QtBot, tmp_path: Path) -> None:
    image = QImage(3, 2, QImage.Format.Format_RGB32)
    image.fill(QColor("#0a0b0c"))
    image.save(str(tmp_path / "a.png"))
    said: list[str] = []
    made(Editor((tmp_path / "a.png").read_bytes()), said).copy()
    qtbot.waitUntil(lambda: QGuiApplication.clipboard().image().size() == image.size())
    assert QGuiApplication.clipboard().image().pixelColor(1, 1) == QColor("#0a0b0c")
    assert said == ["Copied the image"]
