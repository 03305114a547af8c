"""Tests of the startup steps after the first paint: one per event loop pass, in order, or after a timeout."""

from __future__ import annotations

import json
import logging
import os
import subprocess
import sys
from pathlib import Path

import pytest
from PySide6.QtCore import QCoreApplication, QEvent, QObject
from PySide6.QtGui import QFont, QFontInfo
from PySide6.QtWidgets import QWidget
from pytestqt.qtbot import QtBot

from app.blocks.model.project import Project
from app.core.projects.journal import Journal
from app.core.session import Session
from app.core.storage.settings import Settings
from app.ui.application import Options, make_application, make_window
from app.ui.panels.registry import PanelRegistry
from app.ui.startup.deferred import DeferredSteps
from app.ui.theme import fonts
from tests.ui.shell_parts import free_address

ROOT = Path(__file__).parents[3]


def test_deferred_steps_do_not_run_before_the_first_paint(qtbot: QtBot) -> None:
    window = QWidget()
    qtbot.addWidget(window)
    done: list[str] = []
    soon = DeferredSteps(window, [lambda: done.append("panels"), lambda: done.append("editor")])
    soon.prepend([lambda: done.append("begin"), lambda: done.append("meeting")])
    qtbot.wait(50)
    assert (done, soon.has_started) == ([], False)
    window.show()
    qtbot.waitUntil(lambda: soon.is_done)
    assert done == ["begin", "meeting", "panels", "editor"]


class Ear(QObject):
    """Object that records events posted to it, in place of a click."""

    def __init__(self, heard: list[str]) -> None:
        super().__init__()
        self._heard = heard

    def event(self, event: QEvent) -> bool:
        self._heard.append("click")
        return True


def test_click_is_handled_between_two_deferred_steps(qtbot: QtBot) -> None:
    window = QWidget()
    qtbot.addWidget(window)
    seen: list[str] = []
    ear = Ear(seen)

    def one() -> None:
        seen.append("one")
        QCoreApplication.postEvent(ear, QEvent(QEvent.Type.User))

    soon = DeferredSteps(window, [one, lambda: seen.append("two")])
    window.show()
    qtbot.waitUntil(lambda: soon.is_done)
    assert seen == ["one", "click", "two"]


def test_deferred_steps_run_after_a_timeout_if_the_window_is_not_painted(qtbot: QtBot) -> None:
    window = QWidget()
    qtbot.addWidget(window)
    done: list[int] = []
    soon = DeferredSteps(window, [lambda: done.append(1)])
    qtbot.waitUntil(lambda: soon.is_done)
    assert done == [1]


def test_failing_deferred_step_does_not_prevent_later_steps(
    qtbot: QtBot, caplog: pytest.LogCaptureFixture
) -> None:
    window = QWidget()
    qtbot.addWidget(window)
    done: list[int] = []

    def fail() -> None:
        raise OSError("no such file")

    soon = DeferredSteps(window, [fail, lambda: done.append(1)])
    with caplog.at_level(logging.ERROR):
        window.show()
        qtbot.waitUntil(lambda: soon.is_done)
    assert done == [1]
    assert "no such file" in caplog.text


def test_deferred_steps_import_every_panel() -> None:
    panels = PanelRegistry()
    for step in panels.import_steps():
        step()
    assert {"behaviour", "console", "topics"} <= set(panels)
    assert len(panels) == len(list(panels)) >= 10
    assert panels["console"].name == "console"


def test_window_is_built_without_importing_panels_editor_and_heavy_packages(tmp_path: Path) -> None:
    """Every import before the first paint delays each start."""
    late = ["PySide6.QtWebEngineCore", "PySide6.QtNetwork", "cv2", "numpy", "psutil", "nep.programs.doctor"]
    late += ["pyqtgraph", "app.ui.blockly.view", "app.ui.panels.watch.console.panel", "importlib.metadata"]
    late += ["asyncio", "app.blocks.compiler.lowering", "nep.masters.server", "app.ui.self_drive"]
    late += ["app.ui.shell.dialogs.network_access", "app.ui.shell.dialogs.web_pages.sheet"]
    program = (
        "import sys\n"
        "from app.ui import application\n"
        "from app.core.session import Session\n"
        "application.make_application()\n"
        "options = application.Options(opens_new_window=True)\n"
        "application.make_window(Session(start_processes=False), options)\n"
        f"print([name for name in {late} if name in sys.modules])\n"
        "from app.ui.panels.registry import PanelRegistry\n"
        "assert 'plot' in list(PanelRegistry())\n"
        "assert 'pyqtgraph' not in sys.modules, 'only who opens a plot loads it'\n"
    )
    environ = {**os.environ, "QT_QPA_PLATFORM": "offscreen", "NEP_STUDIO_HOME": str(tmp_path)}
    done = subprocess.run(
        [sys.executable, "-c", program],
        env=environ,
        cwd=ROOT,
        capture_output=True,
        text=True,
        timeout=140,
        check=True,
    )
    assert done.stdout.strip() == "[]"


@pytest.mark.parametrize("mode", ["light", "dark"])
def test_widgets_of_the_first_paint_use_the_bundled_fonts(
    qtbot: QtBot, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, mode: str
) -> None:
    monkeypatch.setenv("NEP_STUDIO_HOME", str(tmp_path))
    monkeypatch.setenv("NEP_MASTER", free_address())
    application = make_application()
    fonts.load()
    application.setStyleSheet("")
    application.setFont(QFont("DejaVu Serif"))  # as set by the system, before our style is applied
    journal = Journal(tmp_path / "journal")
    journal.write(Project.of_blocks("Walk", {"blocks": {"blocks": [{"type": "x", "id": "a"}]}}), None)
    monkeypatch.setattr("app.core.projects.journal._is_running", lambda _pid, _born_s: False)
    (tmp_path / "settings.json").write_text(json.dumps({"theme": mode}), "utf-8")
    window = make_window(Session(Settings(tmp_path), start_processes=False), Options())
    qtbot.addWidget(window)
    window.show()
    assert window.banner.isVisible(), "unsaved work is offered"
    shown = [each for each in window.findChildren(QWidget) if each.isVisible()]
    strange = {
        f"{type(each).__name__} {each.property('kind') or ''}"
        for each in shown
        if QFontInfo(each.font()).family() not in {"Inter", "JetBrains Mono"}
    }
    assert strange == set()
    window.close()
