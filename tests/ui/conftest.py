"""Tests of widgets: no screen needed; a Qt warning, or a window left open, fails the test that caused it.

While the test runs, pytest-qt watches for warnings; while its widgets are closed and deleted, we do.
The few lines that are known noise are in pyproject.toml, ``qt_log_ignore``.
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
    # Chromium refuses to run as root with its sandbox. Never in the product.
    os.environ.setdefault("QTWEBENGINE_DISABLE_SANDBOX", "1")

# Qt asks for it before the application exists, when a web view comes later.
QCoreApplication.setAttribute(Qt.ApplicationAttribute.AA_ShareOpenGLContexts)

WAIT_MS = 30_000
"""How long a test waits for what must come: on a busy computer much longer than the 5 s of pytest-qt."""

BAD = {QtMsgType.QtWarningMsg, QtMsgType.QtCriticalMsg, QtMsgType.QtFatalMsg}


class PatientBot(QtBot):
    """Waits longer unless a test says how long."""

    waitUntil = partialmethod(QtBot.waitUntil, timeout=WAIT_MS)  # noqa: N815 - pytest-qt's names
    waitSignal = partialmethod(QtBot.waitSignal, timeout=WAIT_MS)  # noqa: N815
    waitExposed = partialmethod(QtBot.waitExposed, timeout=WAIT_MS)  # noqa: N815


@pytest.fixture
def qtbot(qapp: object, request: pytest.FixtureRequest) -> QtBot:
    """A bot with patience."""
    return PatientBot(request)


@pytest.fixture(autouse=True, scope="module")
def _garbage() -> Iterator[None]:
    """Only this thread collects what is of Qt's, as in Studio; those of later tests find nothing of it.

    What is still used then is put aside: up to 1.8 million objects took 1.5 s to be looked at, file by file.
    Widgets that are left are deleted before: a style sheet goes through all that there are, and with those of
    fifty files it took longer than the tests themselves.
    """
    gc.disable()
    yield
    gc.collect()
    if left := QApplication.topLevelWidgets():  # held by references that pass through Qt
        for widget in left:
            widget.deleteLater()
        del widget, left
        QCoreApplication.sendPostedEvents(None, QEvent.Type.DeferredDelete.value)
        gc.collect()
    gc.freeze()
    gc.enable()


@pytest.fixture(autouse=True, scope="module")
def _text_as_before(qapp: QApplication) -> Iterator[None]:
    """The tests of each file find letters as large as they are at first."""
    yield
    if qapp.property(STYLED_PROPERTY) is not None:
        Theme("light").apply()


@pytest.fixture(autouse=True)
def _sessions_end() -> Iterator[None]:
    """Ends the sessions in memory that the test has made, and takes away what it left."""
    yield
    close_sessions()
    collect_garbage()


@pytest.fixture(autouse=True)
def _silent(monkeypatch: pytest.MonkeyPatch) -> None:
    """No test opens the sound system: Qt keeps its connections to it for as long as the process lives."""
    for module in ("PySide6.QtTextToSpeech", "PySide6.QtMultimedia"):
        monkeypatch.setitem(sys.modules, module, None)  # what an import fails at


@pytest.fixture(autouse=True)
def _mouse_is_away(qapp: QApplication) -> Iterator[None]:
    """Each test begins with the mouse beside its windows, and ends with no button held.

    Where an earlier test left the mouse, panels wait for it to go; with the left button held, as
    ``QTest.mouseDClick`` leaves it, a page takes no press of the right one.
    """
    QCursor.setPos(0, 0)
    yield
    nobody = QWidget()
    for held in Qt.MouseButton:
        if held.value and held & QApplication.mouseButtons():
            QTest.mouseRelease(nobody, held)


@pytest.hookimpl(wrapper=True, tryfirst=True)
def pytest_runtest_teardown(item: pytest.Item) -> Generator[None, object, object]:
    """Fails a test whose widgets warn while they are closed and deleted, or that leaves a window open.

    Such a window lies above those of later tests and takes their clicks.
    """
    noise = [re.compile(pattern) for pattern in item.config.getini("qt_log_ignore")]
    warnings: list[str] = []

    def listen(kind: QtMsgType, _context: QMessageLogContext, text: str) -> None:
        if kind in BAD and not any(pattern.search(text) for pattern in noise):
            warnings.append(text)

    previous = qInstallMessageHandler(listen)
    # Else pytest holds the windows of a file's last test until after `_garbage`, which would put them aside
    # for good: each change of the theme would then style them, too.
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
            each.hide()  # one test fails, not all that follow
        names = ", ".join(f"{type(each).__name__} “{each.accessibleName()}”" for each in left)
        pytest.fail(f"The test left open: {names}. Give them a parent or to qtbot.addWidget.", pytrace=False)
    return result
