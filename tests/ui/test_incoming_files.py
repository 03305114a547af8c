"""Files dropped on the window, and opened by the system."""

from __future__ import annotations

from pathlib import Path

import pytest
from PySide6.QtCore import QMimeData, QPoint, QPointF, Qt, QUrl
from PySide6.QtGui import QDragEnterEvent, QDropEvent, QFileOpenEvent
from PySide6.QtWidgets import QApplication, QWidget

from app.ui.incoming_files import IncomingFiles

COPY, LEFT, NONE = Qt.DropAction.CopyAction, Qt.MouseButton.LeftButton, Qt.KeyboardModifier.NoModifier


@pytest.fixture
def taken() -> list[list[Path]]:
    return []


@pytest.fixture
def window(qtbot, taken) -> QWidget:
    made = QWidget()
    qtbot.addWidget(made)
    IncomingFiles(made, lambda paths: taken.append(list(paths)))
    return made


def mime(*urls: str) -> QMimeData:
    data = QMimeData()
    data.setUrls([QUrl(url) for url in urls])
    return data


def drop(window: QWidget, data: QMimeData) -> bool:
    """Drag something over the window and let it go; whether it would have been taken."""
    over = QDragEnterEvent(QPoint(5, 5), COPY, data, LEFT, NONE)
    over.ignore()
    QApplication.sendEvent(window, over)
    if over.isAccepted():
        QApplication.sendEvent(window, QDropEvent(QPointF(5, 5), COPY, data, LEFT, NONE))
    return over.isAccepted()


def test_dropped_files_are_taken_together(window, taken) -> None:
    assert drop(window, mime("file:///a/One.nepb", "file:///a/Zwei%20B.nepb"))
    assert taken == [[Path("/a/One.nepb"), Path("/a/Zwei B.nepb")]]


def test_what_is_no_file_of_this_computer_is_left_alone(window, taken) -> None:
    text = QMimeData()
    text.setText("hello")
    assert not drop(window, mime("https://example.org/a.nepb"))
    assert not drop(window, text)
    assert taken == []


def test_the_system_opens_a_file(window, taken) -> None:
    QApplication.sendEvent(window, QFileOpenEvent("/a/One.nepb"))
    assert taken == [[Path("/a/One.nepb")]]
