"""Tests of files dropped on the window or opened by the operating system."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest
from PySide6.QtCore import QMimeData, QPoint, QPointF, Qt, QUrl
from PySide6.QtGui import QDragEnterEvent, QDropEvent
from PySide6.QtWidgets import QApplication, QWidget

from app.ui.startup.file_open import FileDropFilter

COPY, LEFT, NONE = Qt.DropAction.CopyAction, Qt.MouseButton.LeftButton, Qt.KeyboardModifier.NoModifier


@pytest.fixture
def taken() -> list[list[Path]]:
    return []


@pytest.fixture
def window(qtbot, taken) -> QWidget:
    made = QWidget()
    qtbot.addWidget(made)
    FileDropFilter(made, lambda paths: taken.append(list(paths)))
    return made


def mime(*urls: str) -> QMimeData:
    data = QMimeData()
    data.setUrls([QUrl(url) for url in urls])
    return data


def drop(window: QWidget, data: QMimeData) -> bool:
    """Drag data over the window and drop it if accepted; return whether it was accepted."""
    over = QDragEnterEvent(QPoint(5, 5), COPY, data, LEFT, NONE)
    over.ignore()
    QApplication.sendEvent(window, over)
    if over.isAccepted():
        QApplication.sendEvent(window, QDropEvent(QPointF(5, 5), COPY, data, LEFT, NONE))
    return over.isAccepted()


def test_dropped_files_are_opened_together(window, taken) -> None:
    assert drop(window, mime("file:///a/One.nepb", "file:///a/Zwei%20B.nepb"))
    assert taken == [[Path("/a/One.nepb"), Path("/a/Zwei B.nepb")]]


def test_drop_of_a_url_or_text_is_ignored(window, taken) -> None:
    text = QMimeData()
    text.setText("hello")
    assert not drop(window, mime("https://example.org/a.nepb"))
    assert not drop(window, text)
    assert taken == []


MAC = """
import sys
from PySide6.QtCore import QObject, QTimer
from PySide6.QtGui import QFileOpenEvent
from app.ui.application import make_application

application = make_application()
from PySide6.QtWebEngineWidgets import QWebEngineView

application.sendEvent(application, QFileOpenEvent("/a/Early.nepb"))
taken = []
application.set_file_opener(taken.extend)
application.sendEvent(application, QFileOpenEvent("/a/Late.nepb"))
try:
    application.installEventFilter(QObject(application))
except TypeError as error:
    print("refused:", error)
view = QWebEngineView()
view.loadFinished.connect(lambda well: QTimer.singleShot(0, application.quit))
view.setHtml("<p>blocks</p>")
view.show()
application.exec()
print([path.name for path in taken])
sys.exit(0)
"""


def test_file_open_events_are_received_before_and_after_the_web_engine_is_loaded() -> None:
    """macOS sends them to the application, where an event filter for all objects crashed Studio (SIGSEGV)."""
    environ = {**os.environ, "QT_QPA_PLATFORM": "offscreen"}
    if hasattr(os, "geteuid") and os.geteuid() == 0:
        environ["QTWEBENGINE_DISABLE_SANDBOX"] = "1"
    done = subprocess.run(
        [sys.executable, "-c", MAC], env=environ, check=False, capture_output=True, text=True, timeout=140
    )
    assert done.returncode == 0, done.stderr
    refused, took = done.stdout.splitlines()
    assert refused.startswith("refused: QObject can't filter the events of the whole application")
    assert took == "['Early.nepb', 'Late.nepb']"
