"""An empty window with an empty web page: proves that Qt and Qt WebEngine work on this computer."""

from __future__ import annotations

import sys
import time
from pathlib import Path

import psutil
from PySide6.QtCore import QObject, Qt, QTimer
from PySide6.QtWebEngineWidgets import QWebEngineView
from PySide6.QtWidgets import QApplication, QMainWindow

SETTLE_MS = 300
GIVE_UP_MS = 60_000
PAGE = "<!doctype html><title>NEP Studio</title><body style='background:#eef;font:20px sans-serif'>web page"


class SelfDrive(QObject):
    """Waits for the page, grabs the window into a folder, and ends the application."""

    def __init__(self, window: QMainWindow, view: QWebEngineView, folder: Path) -> None:
        super().__init__(window)
        self._window = window
        self._folder = folder
        view.loadFinished.connect(self._loaded)
        QTimer.singleShot(GIVE_UP_MS, self, self._give_up)

    def _loaded(self, well: bool) -> None:
        if not well:
            self._give_up()
            return
        QTimer.singleShot(SETTLE_MS, self, self._grab)

    def _grab(self) -> None:
        self._folder.mkdir(parents=True, exist_ok=True)
        target = self._folder / "window.png"
        if not self._window.grab().save(str(target)):
            self._give_up()
            return
        age_s = time.time() - psutil.Process().create_time()
        sys.stdout.write(f"web page shown {age_s:.2f} s after the process began; screenshot: {target}\n")
        QApplication.exit(0)

    def _give_up(self) -> None:
        sys.stderr.write("the web page did not come up\n")
        QApplication.exit(1)


def run(folder: Path | None) -> int:
    """Show the window until it is closed; with a folder: until its picture is there. The exit code."""
    QApplication.setAttribute(Qt.ApplicationAttribute.AA_ShareOpenGLContexts)
    application = QApplication(sys.argv[:1])
    window = QMainWindow()
    window.setWindowTitle("NEP Studio")
    window.resize(1440, 900)
    view = QWebEngineView(window)
    window.setCentralWidget(view)
    driver = None if folder is None else SelfDrive(window, view, folder)
    view.setHtml(PAGE)
    window.show()
    code = application.exec()
    del driver
    return code
