"""Take screenshots of the block editor with the sample program of the tests: running, stopped, with errors.

Needs a screen: ``xvfb-run -a .venv/bin/python tools/show_blocks.py FOLDER [--open CATEGORY]``
"""

from __future__ import annotations

import argparse
import json
import os
import sys
from pathlib import Path

from PySide6.QtCore import QObject, Qt, QTimer
from PySide6.QtWidgets import QApplication

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT))

from app.ui.blockly import scheme  # noqa: E402
from app.ui.blockly.view import BlocklyView  # noqa: E402

SAMPLE = ROOT / "tests" / "data" / "blockly"
SETTLE_MS = 700
ERROR_TEXT = "“turn left” needs a number. Enter one in the empty slot."

CLICK_CATEGORY_JS = """
for (const label of document.querySelectorAll('.blocklyToolboxCategoryLabel'))
  if (label.textContent === NAME)
    label.closest('.blocklyToolboxCategory').dispatchEvent(new PointerEvent('pointerdown', {bubbles: true}));
"""


def parse_arguments() -> argparse.Namespace:
    """Parse the command line."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--definitions", type=Path, default=SAMPLE / "definitions.json")
    parser.add_argument("--workspace", type=Path, default=SAMPLE / "picture.json")
    parser.add_argument("--open", metavar="CATEGORY", help="click this category first")
    parser.add_argument("--size", default="1031x586")
    return parser.parse_args()


class Screenshots(QObject):
    """Controller that saves three images of the block editor and then exits the program.

    The images are: light theme and running, dark theme and stopped, and with errors.
    """

    def __init__(self, view: BlocklyView, folder: Path, category: str | None) -> None:
        super().__init__(view)
        self._view = view
        self._folder = folder
        self._category = category
        self._tokens = json.loads((ROOT / "resources" / "theme" / "tokens.json").read_text("utf-8"))
        view.ready.connect(self._show_light_theme)

    def _show_light_theme(self) -> None:
        self._view.set_theme(self._tokens, is_dark=False)
        self._view.highlight(["say_touch"])
        self._decorate()
        QTimer.singleShot(SETTLE_MS, self, self._show_dark_theme)

    def _show_dark_theme(self) -> None:
        self._save("light")
        self._view.set_theme(self._tokens, is_dark=True)
        self._view.highlight([])
        self._view.mark_stopped(["say_touch"])
        QTimer.singleShot(SETTLE_MS, self, self._show_errors)

    def _show_errors(self) -> None:
        self._save("dark")
        self._view.set_theme(self._tokens, is_dark=False)
        self._view.mark_stopped([])
        self._view.set_errors({"b2": ERROR_TEXT, "wave": "NAO is not connected."})
        QTimer.singleShot(SETTLE_MS, self, self._finish)

    def _finish(self) -> None:
        self._save("errors")
        QApplication.exit(0)

    def _decorate(self) -> None:
        self._view.set_absent(["wave"])
        self._view.set_live_values({"Pepper/battery": "84 %"})
        if self._category and self._view.web is not None:
            self._view.web.page.runJavaScript(CLICK_CATEGORY_JS.replace("NAME", json.dumps(self._category)))

    def _save(self, name: str) -> None:
        self._folder.mkdir(parents=True, exist_ok=True)
        self._view.grab().save(str(self._folder / f"{name}.png"))


def main() -> int:
    """Create the images; return 0 on success."""
    arguments = parse_arguments()
    if hasattr(os, "geteuid") and os.geteuid() == 0:
        os.environ.setdefault("QTWEBENGINE_DISABLE_SANDBOX", "1")
    scheme.register_scheme()
    QApplication.setAttribute(Qt.ApplicationAttribute.AA_ShareOpenGLContexts)
    application = QApplication(sys.argv[:1])
    view = BlocklyView()
    view.resize(*(int(each) for each in arguments.size.split("x")))
    view.set_definitions(json.loads(arguments.definitions.read_text("utf-8")))
    view.load(json.loads(arguments.workspace.read_text("utf-8")))
    screenshots = Screenshots(view, arguments.folder, arguments.open)
    view.show()
    code = application.exec()
    del screenshots
    return code


if __name__ == "__main__":
    sys.exit(main())
