"""Fixtures of widget tests, which need no screen; a Qt warning or an open window fails its test.

pytest-qt watches for warnings while a test runs, this file while its widgets are closed and deleted.
Known harmless warnings are listed in pyproject.toml, ``qt_log_ignore``.
"""

from __future__ import annotations

import gc
import os
import re
import sys
from collections.abc import Generator, Iterator
from functools import partialmethod

import pytest
from PySide6.QtCore import QCoreApplication, QEvent, QMessageLogContext, Qt, QtMsgType, qInstallMessageHandler
from PySide6.QtGui import QCursor
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QApplication, QWidget
from pytestqt.qtbot import QtBot

from app.ui.startup.interpreter import collect_garbage
from app.ui.theme.theme import STYLED_PROPERTY, Theme
from tests.ui.fakes import close_sessions

os.environ.setdefault("QT_QPA_PLATFORM", "offscreen")
os.environ.setdefault("QT_QUICK_BACKEND", "software")
if hasattr(os, "geteuid") and os.geteuid() == 0:
    # Chromium refuses to run as root with its sandbox. Not in the product.
    os.environ.setdefault("QTWEBENGINE_DISABLE_SANDBOX", "1")

# Required by Qt before the application is created if a web view is created later.
QCoreApplication.setAttribute(Qt.ApplicationAttribute.AA_ShareOpenGLContexts)

WAIT_MS = 60_000
"""Default timeout in milliseconds; the 5 s of pytest-qt are too short on a busy computer."""

BAD = {QtMsgType.QtWarningMsg, QtMsgType.QtCriticalMsg, QtMsgType.QtFatalMsg}


class PatientBot(QtBot):
    """Bot with longer default timeouts."""

    waitUntil = partialmethod(QtBot.waitUntil, timeout=WAIT_MS)  # noqa: N815 - pytest-qt's names
    waitSignal = partialmethod(QtBot.waitSignal, timeout=WAIT_MS)  # noqa: N815
    waitExposed = partialmethod(QtBot.waitExposed, timeout=WAIT_MS)  # noqa: N815


@pytest.fixture
def qtbot(qapp: object, request: pytest.FixtureRequest) -> QtBot:
    """Bot of pytest-qt with longer default timeouts."""
    return PatientBot(request)


@pytest.fixture(autouse=True, scope="module")
def _garbage() -> Iterator[None]:
    """Collect garbage of Qt objects only in this thread, as Studio does, after the tests of each file.

    Remaining objects are frozen, because scanning up to 1.8 million of them took 1.5 s per file.
    Remaining widgets are deleted before: a style sheet is applied to every widget, and with the widgets
    of fifty files this took longer than the tests.
    """
    gc.disable()
    yield
    gc.collect()
    if left := QApplication.topLevelWidgets():  # kept alive by references through Qt
        for widget in left:
            widget.deleteLater()
        del widget, left
        QCoreApplication.sendPostedEvents(None, QEvent.Type.DeferredDelete.value)
        gc.collect()
    gc.freeze()
    gc.enable()


@pytest.fixture(autouse=True, scope="module")
def _text_as_before(qapp: QApplication) -> Iterator[None]:
    """Restore the default text size after the tests of each file."""
    yield
    if qapp.property(STYLED_PROPERTY) is not None:
        Theme("light").apply()


@pytest.fixture(autouse=True)
def _sessions_end() -> Iterator[None]:
    """Close the test's sessions in memory and collect their garbage."""
    yield
    close_sessions()
    collect_garbage()


@pytest.fixture(autouse=True)
def _silent(monkeypatch: pytest.MonkeyPatch) -> None:
    """Block Qt's sound modules: their connections to the sound system stay open until the process exits."""
    for module in ("PySide6.QtTextToSpeech", "PySide6.QtMultimedia"):
        monkeypatch.setitem(sys.modules, module, None)  # makes the import fail


@pytest.fixture(autouse=True)
def _mouse_is_away(qapp: QApplication) -> Iterator[None]:
    """Move the mouse away from the windows before each test, and release all buttons after it.

    Panels react to a mouse that an earlier test left over them. While the left button is held, as after
    ``QTest.mouseDClick``, a page ignores the right button.
    """
    QCursor.setPos(0, 0)
    yield
    nobody = QWidget()
    for held in Qt.MouseButton:
        if held.value and held & QApplication.mouseButtons():
            QTest.mouseRelease(nobody, held)


@pytest.hookimpl(wrapper=True, tryfirst=True)
def pytest_runtest_teardown(item: pytest.Item) -> Generator[None, object, object]:
    """Fail a test if Qt warns while its widgets are closed and deleted, or if it leaves a window open.

    An open window would cover those of later tests and receive their clicks.
    """
    noise = [re.compile(pattern) for pattern in item.config.getini("qt_log_ignore")]
    warnings: list[str] = []

    def listen(kind: QtMsgType, _context: QMessageLogContext, text: str) -> None:
        if kind in BAD and not any(pattern.search(text) for pattern in noise):
            warnings.append(text)

    previous = qInstallMessageHandler(listen)
    # Otherwise pytest holds the windows of a file's last test until after `_garbage`, which would freeze
    # them permanently: every theme change would then style them, too.
    item.funcargs.clear()  # type: ignore[attr-defined]
    try:
        result = yield
        QCoreApplication.sendPostedEvents(None, QEvent.Type.DeferredDelete.value)
    finally:
        qInstallMessageHandler(previous)
    if warnings:
        pytest.fail("Qt warned while the test's widgets were closed:\n" + "\n".join(warnings), pytrace=False)
    left = [each for each in QApplication.topLevelWidgets() if each.isVisible()]
    if left:
        for each in left:
            each.hide()  # fail only this test, not all later ones
        names = ", ".join(f"{type(each).__name__} “{each.accessibleName()}”" for each in left)
        pytest.fail(f"The test left open: {names}. Give them a parent or to qtbot.addWidget.", pytrace=False)
    return result
