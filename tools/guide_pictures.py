"""Create the guide's images from the real window: resources/guide/LANGUAGE/{light,dark}/*.png.

    python3 dev.py guide-pictures [FOLDER]

Creates the images for each language of the guide in the light and dark theme. A process with separate
settings runs for each language and theme. Needs a screen; dev.py provides a virtual one.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path

from PySide6.QtCore import QPoint, QPointF, QRect, QSize, Qt, QTimer
from PySide6.QtGui import QColor, QPainter, QPen, QPixmap, QPolygonF
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QWidget

from app.core.session import Session
from app.ui.application import Options, make_application, make_window
from app.ui.blockly.view import BlocklyView
from app.ui.intents import OpenPanel
from app.ui.self_drive import SelfDrive, Step
from app.ui.shell.dialogs.guide import IMAGE_PIXEL_RATIO
from app.ui.shell.main_window import MainWindow
from nep.i18n import LANG_VARIABLE, translate
from nep.masters.master import is_running
from tools.screenshots import EXAMPLE, PORTS, Block, block, chain, number, pepper, text
from tools.small_png import shrink

ROOT = Path(__file__).resolve().parent.parent
FOLDER = ROOT / "resources" / "guide"
COLOURS = 128  # sufficient for flat surfaces, and a sixth smaller than with 256
DRAG_STEPS = 10  # steps of a mouse movement
THEMES = ("light", "dark")
CROP_WIDTH_PX = 640
"""Maximum width of an image in the guide in px; images of the whole window are scaled down."""
WINDOW, WHOLE = QSize(1280, 800), QSize(1200, 740)
ARROW = ((0, 0), (0, 17), (4, 13.3), (6.8, 19.5), (9.6, 18.2), (6.9, 12.2), (12.3, 12))
VISIBLE_TAB_JS = "document.querySelector('.nepTab:not([hidden])')"
TALK, SWING = "talk", "swing"  # blocks highlighted in the images


def variable_block(kind: str, *, id: str = "", **kwargs: object) -> Block:
    """Create a block that uses the variable "points"."""
    result = block(kind, id=id, **kwargs)
    result["fields"] = {"VAR": {"id": "points"}}
    return result


def placed(x: int, y: int, script: Block) -> Block:
    """Return a script at a position (px) of the page."""
    return {**script, "x": x, "y": y}


def greeting_scripts() -> list[Block]:
    """Return the scripts of the guide's first behaviour."""
    swing = chain(
        pepper("do_turn", id=SWING, DIRECTION="left", ANGLE=number(30)),
        pepper("do_turn", DIRECTION="right", ANGLE=number(30)),
    )
    first = chain(
        block("events_started"),
        pepper("do_say", id=TALK, TEXT=text("Hello! I am Pepper.")),
        block("control_repeat", TIMES=number(3), BODY={"block": swing}),
    )
    return [placed(28, 28, first)]


def single_script() -> list[Block]:
    """Return one script: a start block with one block below it."""
    say_block = pepper("do_say", id=TALK, TEXT=text("Hello! I am Pepper."))
    return [placed(28, 28, chain(block("events_started"), say_block))]


def counting_scripts() -> list[Block]:
    """Return scripts that count touches with a variable."""
    start = chain(
        block("events_started"),
        variable_block("variables_set", VALUE=number(3)),
        pepper("do_say", TEXT=text("Touch my head or my hands.")),
    )
    touched = chain(
        pepper("when_touched", PLACE="head"),
        variable_block("variables_change", BY=number(1)),
        pepper("do_say", TEXT=text("Thank you.")),
    )
    return [placed(28, 28, start), placed(28, 210, touched)]


def faulty_scripts() -> list[Block]:
    """Return scripts with errors: a block without a start, and two scripts that both move the robot."""
    first = chain(block("events_started"), pepper("do_turn", DIRECTION="left", ANGLE=number(90)))
    second = chain(block("events_started"), pepper("do_walk", DISTANCE=number(0.3)))
    loose = pepper("do_say", TEXT=text("Nice to see you."))
    return [placed(28, 28, first), placed(28, 160, second), placed(28, 290, loose)]


SCRIPTS = {
    "Greeting": greeting_scripts,
    "A dance": single_script,
    "Reaction to touch": counting_scripts,
    "A careful walk": faulty_scripts,
}
"""Functions that create the scripts of a behaviour, by the name of the behaviour.

The names are taken from the examples, so that their translations exist.
"""


def write_behaviour(folder: Path, name: str) -> Path:
    """Write one of the behaviours in `SCRIPTS`, with the robots of an example, and return its path.

    The file has the format of an example, whose texts Studio translates when it is opened.
    """
    content = {
        "format": "nep-behaviour",
        "version": 1,
        "name": name,
        "workspace": {
            "blocks": {"languageVersion": 0, "blocks": SCRIPTS[name]()},
            "variables": [{"name": "points", "id": "points"}] if SCRIPTS[name] is counting_scripts else [],
        },
        "robots": json.loads(EXAMPLE.read_text("utf-8"))["robots"],
    }
    path = folder / f"{name}.nepb"
    path.write_text(json.dumps(content), encoding="utf-8")
    return path


class GuidePictures(SelfDrive):
    """Studio window that operates itself and takes the images of the guide in one theme."""

    def __init__(self, window: MainWindow, folder: Path, home: Path, theme: str) -> None:
        self._home, self._theme = home, theme
        self._crops: dict[str, Callable[[], QRect]] = {
            "toolbox": lambda: QRect(self._panel_rect("behaviour").topLeft(), QSize(CROP_WIDTH_PX, 400)),
            "running": lambda: QRect(0, window.run_bar.geometry().top(), CROP_WIDTH_PX, 400),
            "variables": lambda: self._panel_rect("behaviour") | self._panel_rect("variables"),
            "problems": lambda: self._panel_rect("behaviour") | self._panel_rect("problems"),
            "backpack": lambda: self._panel_rect("behaviour"),
            "room": lambda: self._panel_rect("robot"),
        }
        self._mouse: QPoint | None = None  # where the image shows it, in window coordinates
        self._mouse_path: list[QPoint] = []  # remaining points of a mouse movement
        self._element_rects: dict[str, object] = {}
        super().__init__(window, folder)

    def _plan(self) -> list[Step]:
        run, request, window = self._commands.run, self._commands.request, self._window
        runs = window.session.runs

        def is_block_running(id: str) -> Callable[[], bool]:
            return lambda: runs.view().state == "running" and id in runs.running_blocks

        return [
            Step("set the theme", lambda: run(f"theme.{self._theme}"), window.isVisible),
            Step("the start page", lambda: window.resize(WHOLE), window.isVisible, picture="start"),
            Step("start the robot", lambda: run("robots.virtual"), self._is_robot_ready, 40, settle_s=2.0),
            *self._open("Greeting"),
            Step("the window", lambda: None, self._is_page_ready, picture="window", settle_s=2.0),
            Step("resize the window", lambda: window.resize(WINDOW), lambda: True, settle_s=1.0),
            Step("run", lambda: run("run.run"), is_block_running(SWING), 30, "running", 0.5),
            *self._stop(),
            *self._open("A dance"),
            *self._drag_from_toolbox(),
            Step("resize the window", lambda: window.resize(WHOLE), lambda: True, settle_s=1.0),
            *self._open("Reaction to touch"),
            Step("open the variables", lambda: request(OpenPanel("variables")), lambda: True),
            Step("watch", lambda: self._editor.edit_variable({"do": "watch", "id": "points"}), lambda: True),
            Step("show values", lambda: run("run.run"), lambda: bool(runs.values), 20, "variables", 3.0),
            *self._stop(),
            *self._open("A careful walk"),
            Step(
                "show the problems",
                lambda: request(OpenPanel("problems")),
                self._is_page_ready,
                picture="problems",
                settle_s=2.5,
            ),
            *self._add_to_backpack(),
            Step("add a robot", lambda: run("robots.turtle"), self._are_two_robots_ready, 40, "room", 3.0),
            Step(
                "Developer", lambda: run("layout.developer"), lambda: len(window.session.shown.topics) > 3, 20
            ),
            Step("open the topics", lambda: request(OpenPanel("topics")), lambda: True, 20, "developer", 3.0),
        ]

    def _open(self, name: str) -> list[Step]:
        path = write_behaviour(self._home, name)
        files, page = self._commands.files, self._is_page_ready
        return [Step(f"open {name}", lambda: files.open_example(path), page, 30, settle_s=1.5)]

    def _stop(self) -> list[Step]:
        run, runs = self._commands.run, self._window.session.runs
        stopped = Step("stop", lambda: run("run.stop"), lambda: runs.view().state == "proven")
        world = self._window.session.fleet.change_world
        return [stopped, Step("reset", lambda: world("Pepper", {"reset": True}), self._is_robot_ready)]

    def _drag_from_toolbox(self) -> list[Step]:
        # Drags a block from the toolbox to the end of the script.
        labels = f"[...{VISIBLE_TAB_JS}.querySelectorAll('.blocklyToolboxCategoryLabel')]"
        movement = f"{labels}.find(e => e.textContent === {json.dumps(translate('category', 'Movement'))})"
        turn_block = f"{VISIBLE_TAB_JS}.querySelector('.blocklyFlyout .robot_pepper_do_turn')"
        last = f"{VISIBLE_TAB_JS}.querySelector('[data-id={TALK}] > .blocklyPath')"

        def open_category() -> None:
            position = self._element_rect(movement).center()
            QTest.mouseClick(self._target, Qt.MouseButton.LeftButton, pos=position)

        def start_drag() -> None:
            start, end = (
                self._element_rect(turn_block).topLeft() + QPoint(12, 18),
                self._element_rect(last).bottomLeft(),
            )
            QTest.mouseMove(self._target, start)
            QTest.mousePress(self._target, Qt.MouseButton.LeftButton, pos=start)
            self._mouse_path = [
                start + (end + QPoint(36, 34) - start) * part / DRAG_STEPS
                for part in range(1, DRAG_STEPS + 1)
            ]

        def move() -> bool:
            # One step per call, so that the page repaints in between.
            if self._mouse_path:
                position = self._mouse_path.pop(0)
                QTest.mouseMove(self._target, position)
                self._mouse = self._target.mapTo(self._window, position)
            return not self._mouse_path

        return [
            Step("wait for the toolbox", lambda: None, lambda: self._has_element(movement), 20),
            Step(
                "open a category",
                open_category,
                lambda: self._has_element(turn_block) and self._has_element(last),
                20,
            ),
            Step("drag a block", start_drag, move, 10, "toolbox", 1.0),
            Step("drop the block", self._release_mouse, lambda: True, settle_s=1.0),
        ]

    def _release_mouse(self) -> None:
        QTest.mouseRelease(self._target, Qt.MouseButton.LeftButton, pos=QPoint(600, 300))
        self._mouse = None

    def _add_to_backpack(self) -> list[Step]:
        # Adds a stack to the backpack and opens it.
        button = "[...document.querySelectorAll('.nepBackpack')].find(e => e.offsetParent)"
        sheet = f"{VISIBLE_TAB_JS}.querySelector('.blocklyFlyout.nepPacked .blocklyBlock')"
        first = f"{VISIBLE_TAB_JS}.querySelector('.blocklyBlockCanvas .robot_pepper_do_turn > .blocklyPath')"

        def choose() -> None:
            position = self._element_rect(first).topLeft() + QPoint(10, 12)
            QTest.mouseClick(self._target, Qt.MouseButton.LeftButton, pos=position)

        def pack() -> None:
            keys = Qt.KeyboardModifier.ControlModifier | Qt.KeyboardModifier.ShiftModifier
            QTest.keyClick(self._target, Qt.Key.Key_P, keys)

        def open_backpack() -> None:
            position = self._element_rect(button).center()
            QTest.mouseClick(self._target, Qt.MouseButton.LeftButton, pos=position)

        return [
            Step("loading", lambda: None, lambda: self._has_element(first) and self._has_element(button), 20),
            Step("select a stack", choose, lambda: True),
            Step("add it to the backpack", pack, lambda: True),
            Step("open the backpack", open_backpack, lambda: self._has_element(sheet), 10, "backpack", 8.0),
        ]

    def _is_robot_ready(self) -> bool:
        return any(link.state in {"ready", "busy"} for link in self._window.session.fleet.links)

    def _are_two_robots_ready(self) -> bool:
        return sum(link.state in {"ready", "busy"} for link in self._window.session.fleet.links) > 1

    @property
    def _editor(self) -> BlocklyView:
        editor = self._opened_editor()
        if editor is None:
            raise TypeError("the editor isn't loaded yet")
        return editor

    def _opened_editor(self) -> BlocklyView | None:
        dock = self._window.find_dock("behaviour")
        editor = getattr(dock.panel, "editor", None) if dock is not None else None
        return editor if isinstance(editor, BlocklyView) else None

    @property
    def _target(self) -> QWidget:
        # The widget that receives mouse and key events.
        web = self._editor.web
        target = web.keyboard_target() if web is not None else None
        if not isinstance(target, QWidget):
            raise TypeError("the editor's page isn't loaded yet")
        return target

    def _is_page_ready(self) -> bool:
        editor = self._opened_editor()
        return editor is not None and editor.is_ready

    def _has_element(self, element: str) -> bool:
        # True if the page contains the element; each call queries its position again.
        self._query_rect(element)
        return self._element_rects.get(element) is not None

    def _element_rect(self, element: str) -> QRect:
        # The last known position.
        rect = self._element_rects[element]
        if not isinstance(rect, list):
            raise TypeError(f"the page has no element {element}")
        return QRect(*(round(each) for each in rect))

    def _query_rect(self, element: str) -> None:
        script = (
            f"(e => {{ const r = e?.getBoundingClientRect();"
            f" return r ? JSON.stringify([r.left, r.top, r.width, r.height]) : ''; }})({element})"
        )

        def store_rect(result: object) -> None:
            self._element_rects[element] = json.loads(result) if isinstance(result, str) and result else None

        if self._is_page_ready() and self._editor.web is not None:
            self._editor.web.page.runJavaScript(script, store_rect)

    def _panel_rect(self, panel: str) -> QRect:
        bench = self._window.bench
        if bench is None:
            raise TypeError("no panels are open")
        dock = bench.docks[panel]
        return QRect(dock.mapTo(self._window, QPoint()), dock.size())

    def _save_screenshot(self, name: str) -> None:
        if not name:
            return
        crop = self._crops.get(name)
        picture = self._window.grab(crop()) if crop is not None else self._window.grab()
        if self._mouse is not None and crop is not None:
            paint_mouse(picture, self._mouse - crop().topLeft())
        max_width = round(CROP_WIDTH_PX * IMAGE_PIXEL_RATIO)
        if picture.width() > max_width:
            picture = picture.scaledToWidth(max_width, Qt.TransformationMode.SmoothTransformation)
        path = self._folder / f"{name}.png"
        if picture.save(str(path)):
            self.pictures.append(path)
        else:
            sys.stderr.write(f"the image {path} can't be written\n")


def paint_mouse(picture: QPixmap, tip: QPoint) -> None:
    """Paint the mouse pointer, which grabbed images don't contain, with its tip at `tip`."""
    painter = QPainter(picture)
    painter.setRenderHint(QPainter.RenderHint.Antialiasing)
    painter.setPen(QPen(QColor("white"), 1.4))
    painter.setBrush(QColor("black"))
    painter.drawPolygon(QPolygonF([QPointF(tip) + QPointF(x, y) for x, y in ARROW]))
    painter.end()


def take_screenshots(folder: Path, theme: str) -> int:
    """Create the images in the language of this process; return 0 if all steps succeeded, else 1."""
    with tempfile.TemporaryDirectory(prefix="nep-guide-") as home:
        free = next(port for port in PORTS if not is_running(f"127.0.0.1:{port}", 0.2))
        os.environ.update(NEP_STUDIO_HOME=home, NEP_MASTER=f"127.0.0.1:{free}", NEP_GATEWAY="0")
        application = make_application()
        application.setQuitOnLastWindowClosed(False)
        window = make_window(Session(), Options(theme=theme, self_drive=folder))
        window.on_closed = lambda: QTimer.singleShot(0, application.quit)
        window.show()
        window.start_session()
        pictures = GuidePictures(window, folder, Path(home), theme)
        application.exec()
    for picture in pictures.pictures:
        shrink(picture, COLOURS)
    return 0 if pictures.has_succeeded else 1


def take_all(folder: Path) -> int:
    """Create the images in all languages of the guide and both themes; return 0 on success."""
    languages = sorted(each.name for each in FOLDER.iterdir())
    failed = 0
    for language in languages:
        for theme in THEMES:
            environ = {**os.environ, LANG_VARIABLE: language, "QT_SCALE_FACTOR": f"{IMAGE_PIXEL_RATIO:g}"}
            target_folder = folder / language / theme
            command = [sys.executable, "-m", "tools.guide_pictures", str(target_folder), "--theme", theme]
            failed += subprocess.run(command, env=environ, cwd=ROOT, check=False).returncode != 0
    return min(failed, 1)


def main(arguments: Sequence[str] | None = None) -> int:
    """Create the images that the command line asks for; return the exit code."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("folder", nargs="?", type=Path, default=FOLDER)
    parser.add_argument("--theme", choices=THEMES, help="only this theme, in the current language")
    options = parser.parse_args(arguments)
    return take_screenshots(options.folder, options.theme) if options.theme else take_all(options.folder)


if __name__ == "__main__":
    sys.exit(main())
