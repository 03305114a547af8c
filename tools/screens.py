"""Save images of every panel, sheet and dialog of the real window, with data, in one language.

    python3 dev.py screens FOLDER [--language es] [--theme dark] [--size 1280x800]

For reviews of translations and of the layout; see docs/translate.md. The window runs a virtual robot and a
behaviour, and records some seconds. Needs a screen; dev.py provides a virtual one.
"""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path

from app.intents import Inspect
from app.ui.intents import OpenPanel

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from PySide6.QtCore import QSize, QTimer
from PySide6.QtWidgets import QApplication, QDialog, QMenu

from app.core.session import Session
from app.ui.application import Options, make_application, make_window
from app.ui.self_drive import SelfDrive, Step
from app.ui.shell.dialogs.overlay import Overlay
from app.ui.shell.main_window import MainWindow
from nep.i18n import LANG_VARIABLE, set_initial_language
from nep.masters.master import is_running
from tools.screenshots import PORTS, write_behaviour

STATE_TOPIC, CAMERA_TOPIC = "/Pepper/state", "/Pepper/camera"
PANELS = (
    "topics", "nodes", "graph", "services", "publish", "sent", "console", "alarms", "alerts", "doctor",
    "health", "sensors", "robots", "recordings", "timeline", "variables", "problems", "first_steps", "camera",
)  # fmt: skip
SHEETS = (
    "settings.open", "help.about", "help.guide", "help.shortcuts", "help.report", "file.save_as", "file.open",
    "replay.open", "file.earlier", "picture.save", "recording.sheet", "network.web", "network.others",
    "network.look", "alarm.new", "publish.new", "tab.rename", "variable.new", "variable.new_list",
    "layout.keep", "help.examples", "robots.ask", "palette.open", "print.pdf",
)  # fmt: skip


class Screens(SelfDrive):
    """Studio window that operates itself and saves an image of each panel and sheet."""

    def __init__(self, window: MainWindow, folder: Path, behaviour: Path, size: QSize) -> None:
        self._behaviour = behaviour
        super().__init__(window, folder)
        window.resize(size)

    def _plan(self) -> list[Step]:
        session, run, request = self._window.session, self._commands.run, self._commands.request
        return [
            self._picture("start", self._window.show_start),
            Step("start the virtual robot", self._start_demo, self._is_robot_ready, 40, settle_s=2.5),
            self._picture("behaviour", lambda: run("layout.behaviour"), 1.5),
            Step("run", lambda: run("run.run"), lambda: session.runs.view().state == "running", 30),
            self._picture("running", lambda: None, 1.0),
            Step("record", lambda: run("recording.toggle"), lambda: True, settle_s=3.0),
            self._picture("developer", lambda: run("layout.developer"), 2.0),
            self._picture("inspector", lambda: request(Inspect(STATE_TOPIC)), 1.5),
            self._picture("image", lambda: self._window.open_topic(CAMERA_TOPIC), 1.5),
            *(self._picture(f"panel-{name}", self._open_panel(name), 1.0) for name in PANELS),
            Step("stop recording", lambda: run("recording.toggle"), lambda: True, settle_s=1.5),
            self._picture("recorded", self._open_panel("recordings"), 1.0),
            Step("stop", lambda: run("run.stop"), lambda: session.runs.view().state == "proven", 30),
            self._picture("stopped", lambda: run("layout.behaviour"), 1.0),
            *(self._picture(f"sheet-{name.replace('.', '-')}", self._sheet(name), 1.0) for name in SHEETS),
            self._picture("end", self._close_sheets, 0.5),
        ]

    def _picture(self, name: str, action: Callable[[], object], settle_s: float = 0.6) -> Step:
        return Step(name, action, lambda: True, picture=name, settle_s=settle_s)

    def _open_panel(self, name: str) -> Callable[[], object]:
        def open_panel() -> None:
            self._close_sheets()
            self._commands.request(OpenPanel(name))

        return open_panel

    def _sheet(self, command: str) -> Callable[[], object]:
        # A modal dialog blocks the caller, so the command runs outside the step.
        def run() -> None:
            self._close_sheets()
            QTimer.singleShot(0, lambda: self._commands.run(command))

        return run

    def _close_sheets(self) -> None:
        for sheet in self._window.findChildren(Overlay):
            if sheet.isVisible():
                sheet.dismiss()
        for widget in QApplication.topLevelWidgets():
            if isinstance(widget, (QDialog, QMenu)) and widget.isVisible():
                widget.close()

    def _is_robot_ready(self) -> bool:
        return any(link.state in {"ready", "busy"} for link in self._window.session.fleet.links)

    def _start_demo(self) -> None:
        self._commands.run("robots.virtual")
        self._commands.files.open(self._behaviour)


def save_screens(folder: Path, language: str, theme: str, size: QSize) -> int:
    """Save the images; return 0 if all steps succeeded, else 1.

    Args:
        folder: Folder of the images, which is created if necessary.
        language: Language of the window, such as "ja".
        theme: "light" or "dark".
        size: Size of the window in px.
    """
    with tempfile.TemporaryDirectory(prefix="nep-screens-") as home:
        port = next(port for port in PORTS if not is_running(f"127.0.0.1:{port}", 0.2))
        os.environ.update(
            {
                "NEP_STUDIO_HOME": home,
                "NEP_MASTER": f"127.0.0.1:{port}",
                "NEP_GATEWAY": "0",
                LANG_VARIABLE: language,
            }
        )
        set_initial_language()
        behaviour = Path(home) / "Greeting.nepb"
        write_behaviour(behaviour)
        application = make_application()
        application.setQuitOnLastWindowClosed(False)
        window = make_window(Session(), Options(theme=theme, self_drive=folder))
        window.on_closed = lambda: QTimer.singleShot(0, application.quit)
        window.show()
        window.start_session()
        screens = Screens(window, folder, behaviour, size)
        application.exec()
    return 0 if screens.has_succeeded else 1


def main(arguments: Sequence[str] | None = None) -> int:
    """Save the images described by the command line; return the exit code."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--language", default="en")
    parser.add_argument("--theme", choices=("light", "dark"), default="light")
    parser.add_argument("--size", default="1280x800", help="size of the window in px, such as 1280x800")
    options = parser.parse_args(arguments)
    width, height = map(int, options.size.split("x"))
    return save_screens(options.folder, options.language, options.theme, QSize(width, height))


if __name__ == "__main__":
    sys.exit(main())
