"""Sample programs and a simulated user for the tests of the block editor."""

from __future__ import annotations

import json
from collections.abc import Callable
from operator import attrgetter
from pathlib import Path

from PySide6.QtCore import QDeadlineTimer, QEventLoop, QPoint, QPointF, Qt, QTimer
from PySide6.QtGui import QCursor, QGuiApplication, QWheelEvent
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QApplication, QWidget

from app import resources
from app.blocks.model.workspace_json import WorkspaceJson
from app.ui.blockly.view import BlocklyView
from tests.still import KEYS_SEEN, LOOK

DATA = Path(__file__).resolve().parents[1] / "data" / "blockly"
DEFINITIONS = json.loads((DATA / "definitions.json").read_text("utf-8"))
PICTURE = json.loads((DATA / "picture.json").read_text("utf-8"))
UNKNOWN = json.loads((DATA / "unknown.json").read_text("utf-8"))
TOKENS = json.loads(resources.path("theme", "tokens.json").read_text("utf-8"))
START = {"type": "events_started", "id": "start", "x": 56, "y": 56}
WAIT_MS = 60_000
POLL_MS = 20
PAINTED = "performance.getEntriesByName('first-contentful-paint').length > 0"
LISTEN = """
window.nepEvents = [];
for (const kind of ['pointerdown', 'pointerup', 'keydown', 'focusin', 'focusout', 'resize', 'wheel']) {
    window.addEventListener(kind, event => {
        const {target, clientX, clientY, button, key} = event;
        const told = [Math.round(performance.now()), kind, clientX, clientY, button, key, target.tagName,
            target.getAttribute?.('class'), target.closest?.('[data-id]')?.dataset.id];
        window.nepEvents = [...window.nepEvents.slice(-39), told.filter(each => each !== undefined)];
    }, true);
}
"""
"""JavaScript that records the latest events of the page, to explain a timeout."""


def workspace(*blocks: dict) -> dict:
    return {"blocks": {"languageVersion": 0, "blocks": list(blocks)}}


def received(view: BlocklyView, kind: type, *fields: str) -> list:
    """Return the messages of this class from the page; the list grows with each message.

    With names of fields, the list contains the values of these fields, or of the only one, instead.
    """
    found: list = []
    read = attrgetter(*fields) if fields else lambda message: message

    def add(message: object) -> None:
        if isinstance(message, kind):
            found.append(read(message))

    view.message_received.connect(add)
    return found


def outlined(name: str) -> str:
    """Return JavaScript that lists the ids of blocks with this outline."""
    return f"[...document.querySelectorAll('.nepState-{name}')].map(e => e.parentElement.dataset.id)"


def editor(qtbot, definitions: dict, width: int = 1180, height: int = 700) -> BlocklyView:
    """Return a hidden block editor with these definitions; width and height in pixels.

    Its motion is reduced: each frame of an animation takes as long as several queries.
    """
    made = BlocklyView()
    qtbot.addWidget(made)
    made.resize(width, height)
    made.set_definitions(definitions)
    made.set_reduced_motion(True)
    return made


class Person:
    """Simulated user, who reads the page and uses mouse and keyboard."""

    def __init__(self, qtbot, view: BlocklyView) -> None:
        self._qtbot = qtbot
        self.view = view
        if view.web is not None:
            view.web.page.runJavaScript(LISTEN)

    def ask(self, script: str):
        answers: list = []
        loop = QEventLoop()

        def receive(answer: object) -> None:
            answers.append(answer)
            loop.quit()

        self.view.web.page.runJavaScript(f"JSON.stringify({script})", receive)
        if not answers:
            QTimer.singleShot(WAIT_MS, loop, loop.quit)
            loop.exec()
        assert answers, f"the page didn't answer {script}"
        return json.loads(answers[0]) if answers[0] else None

    def wait_for(self, script: str, expected: object = True) -> None:
        deadline = QDeadlineTimer(WAIT_MS)
        while (answer := self.ask(script)) != expected:
            if deadline.hasExpired():
                raise AssertionError(f"{script} is {answer!r}, not {expected!r}. {self.story()}")
            self._qtbot.wait(POLL_MS)

    def story(self) -> str:
        """Return the recorded events of the page, and windows that may have received the input instead."""
        windows = [
            f"{each} {each.geometry()}" for each in QGuiApplication.topLevelWindows() if each.isVisible()
        ]
        taken = (QApplication.activePopupWidget(), QApplication.activeModalWidget(), QWidget.mouseGrabber())
        events = "\n".join(map(str, self.ask("window.nepEvents ?? []")))
        return (
            f"The mouse is at {QCursor.pos()} over {windows}; taken by {taken}; the page was told:\n{events}"
        )

    def until(self, true: Callable[[], object], what: str) -> None:
        def seen() -> None:
            assert true(), what

        try:
            self._qtbot.waitUntil(seen, timeout=WAIT_MS)
        except self._qtbot.TimeoutError as error:
            raise AssertionError(f"never {what}. {self.story()}") from error

    def newest(self) -> dict:
        got: list[WorkspaceJson] = []
        self.view.flush(got.append)
        self._qtbot.waitUntil(lambda: bool(got), timeout=WAIT_MS)
        return dict(got[0].blocks)

    def tops(self) -> list[dict]:
        return self.newest().get("blocks", {}).get("blocks", [])

    def box(self, selector: str) -> dict:
        """Return the rectangle of an element in pixels of the page, once it exists and has stopped moving."""
        self.ask(f"({LOOK})({json.dumps(selector)})")
        self.wait_for("!!window.nepStill")
        left, top, right, bottom = self.ask("window.nepStill")
        return {"left": left, "top": top, "right": right, "bottom": bottom}

    @property
    def target(self):
        return self.view.web.keyboard_target()

    def click(self, selector: str, dx: float = 14, dy: float = 14) -> None:
        box = self.box(selector)
        QTest.mouseClick(
            self.target, Qt.LeftButton, pos=QPoint(round(box["left"] + dx), round(box["top"] + dy))
        )

    def hover(self, at: QPoint) -> None:
        """Move the mouse to a position, starting elsewhere: Qt reports no move to the current position."""
        QTest.mouseMove(self.target, at + QPoint(9, 9))
        QTest.mouseMove(self.target, at)

    def press(self, key: Qt.Key, modifiers=Qt.NoModifier) -> None:
        QTest.keyClick(self.target, key, modifiers)

    def press_and_see(self, key: Qt.Key, modifiers=Qt.NoModifier) -> None:
        """Press a key in the page and wait until its result is rendered."""
        before = self.ask(KEYS_SEEN)
        self.press(key, modifiers)
        self.wait_for(f"{KEYS_SEEN} > {before}")

    def render(self) -> None:
        """Wait until the page has rendered three frames; positions and focus follow in the next one."""
        self.ask(
            "(frame => { window.nepRendered = false; frame(() => frame(() => frame("
            "() => window.nepRendered = true))); })(then => requestAnimationFrame(then))"
        )
        self.wait_for("window.nepRendered")

    def wheel(self, by: int) -> None:
        """Turn the wheel over the middle of the canvas; a negative value scrolls down.

        Waits until the page is painted: an unpainted page drops the event and all that follow within
        half a second, because they belong to the same gesture.
        """
        self.wait_for(PAINTED)
        middle = QPointF(self.target.rect().center())
        event = QWheelEvent(
            middle,
            QPointF(self.target.mapToGlobal(middle)),
            QPoint(),
            QPoint(0, by),
            Qt.NoButton,
            Qt.NoModifier,
            Qt.NoScrollPhase,
            False,
        )
        QApplication.sendEvent(self.target, event)

    def open_category(self, name: str) -> None:
        shown = "document.querySelector('.nepTab:not([hidden])')"
        labels = f"[...{shown}.querySelectorAll('.blocklyToolboxCategoryLabel')]"
        number = self.ask(f"{labels}.findIndex(e => e.textContent == {name!r})")
        assert number >= 0
        rows = ".blocklyToolboxCategoryContainer"
        self.ask("document.querySelector('[data-test=open]')?.removeAttribute('data-test')")
        self.ask(f"{shown}.querySelectorAll({rows!r})[{number}].setAttribute('data-test', 'open')")
        row = self.box("[data-test=open]")  # the row is a tile on a narrow page
        self.click("[data-test=open]", dx=min(60, (row["right"] - row["left"]) / 2))
        self.box(".nepTab:not([hidden]) .blocklyFlyout .blocklyBlock")

    def hold(self, selector: str) -> QPoint:
        box = self.box(selector)
        start = QPoint(round(box["left"] + 12), round(box["top"] + 18))
        QTest.mouseMove(self.target, start)
        QTest.mousePress(self.target, Qt.LeftButton, pos=start)
        return start

    def move(self, start: QPoint, end: QPoint, steps: int = 10) -> None:
        for step in range(1, steps + 1):
            part = step / steps
            QTest.mouseMove(
                self.target, start + QPoint(round((end - start).x() * part), round((end - start).y() * part))
            )

    def drop(self, at: QPoint) -> None:
        QTest.mouseRelease(self.target, Qt.LeftButton, pos=at)

    def drag(self, selector: str, end: QPoint) -> None:
        start = self.hold(selector)
        self.move(start, end)
        self.drop(end)
