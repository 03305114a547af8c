"""The block editor as a widget.

The view knows the newest program at any time. The page in it may come late (it is made when the view is first
shown) or die (its process can be killed): it is given everything again and the person goes on.
"""

from __future__ import annotations

import json
import logging
import time
from collections.abc import Callable, Mapping, Sequence
from typing import cast

from PySide6.QtCore import QCoreApplication, QEvent, QObject, Qt, QTimer, Signal
from PySide6.QtGui import QColor, QKeyEvent, QKeySequence, QShowEvent
from PySide6.QtWebEngineCore import QWebEnginePage
from PySide6.QtWidgets import QVBoxLayout, QWidget

from app import resources
from app.core import deep_json
from app.ui.blockly_bridge import BlocklyBridge, Json
from app.ui.blockly_page import BlocklyWeb
from app.ui.blockly_scheme import register_scheme as register_scheme

_log = logging.getLogger(__name__)
_EMPTY: Json = {"blocks": {"languageVersion": 0, "blocks": []}}
_RESTART_MS = (0, 500, 2000, 5000)
_STABLE_S = 60.0
_FUNCTION_KEYS = range(Qt.Key.Key_F1, Qt.Key.Key_F12 + 1)


class BlocklyView(QWidget):
    """Shows and edits one behaviour. All methods may be called at any time, also before the first show."""

    ready = Signal()  # the page is there (again, after its process died)
    changed = Signal(dict)  # the newest workspace, 150 ms after the last real edit
    history_changed = Signal(bool, bool)  # can undo, can redo
    block_selected = Signal(str)  # a block's id; "" when nothing is selected
    key_pressed = Signal(str)  # a function key pressed in the page that no shortcut of the window took

    def __init__(self, parent: QWidget | None = None, *, language: str = "en") -> None:
        super().__init__(parent)
        self._language = language
        self._web: BlocklyWeb | None = None
        self._up = False
        self._generation = 0
        self._workspace: Json = _EMPTY
        self._definitions: Json = {"blocks": [], "toolbox": {"kind": "categoryToolbox", "contents": []}}
        self._theme: Json = {}
        self._reduced_motion = False
        self._shown: dict[str, object] = {}
        self._waiting: dict[int, Callable[[Json], None]] = {}
        self._tokens = 0
        self._deaths = 0
        self._up_since = 0.0
        self._bridge = BlocklyBridge(self._beginning, self)
        self._bridge.came_up.connect(self._came_up)
        self._bridge.edited.connect(self._edited)
        self._bridge.undo_changed.connect(self.history_changed)
        self._bridge.block_chosen.connect(self.block_selected)
        self._bridge.answered.connect(self._answered)
        self._bridge.went_wrong.connect(lambda sentence: _log.error("block editor: %s", sentence))
        self._layout = QVBoxLayout(self)
        self._layout.setContentsMargins(0, 0, 0, 0)

    # -- the program ------------------------------------------------------------------------------

    @property
    def workspace(self) -> Json:
        """The newest program that the page told; call `flush` for one without the last 150 ms missing."""
        return self._workspace

    @property
    def is_ready(self) -> bool:
        """Whether the page is there now."""
        return self._up

    @property
    def web(self) -> BlocklyWeb | None:
        """The page's view, None until the first show. For tools and tests; panels have no need of it."""
        return self._web

    def load(self, workspace: Mapping[str, object]) -> None:
        """Show another program; forgets undo. Edits of the old one that are still under way are dropped."""
        self._generation += 1
        self._workspace = dict(workspace)
        self._shown = {name: value for name, value in self._shown.items() if name == "live"}
        self._send_program()

    def flush(self, done: Callable[[Json], None]) -> None:
        """Ask for the newest program now; `done` is called once, also if the page is absent or dies."""
        if not self._up:
            done(self._workspace)
            return
        self._tokens += 1
        self._waiting[self._tokens] = done
        self._bridge.tell("flush", self._tokens)

    def set_definitions(self, definitions: Mapping[str, object]) -> None:
        """Give what `app.blocks.editor_definitions` made. Equal definitions cost nothing.

        Keeps the program, its undo and an open category; waits while a block is being dragged.
        """
        if definitions == self._definitions:
            return
        self._definitions = dict(definitions)
        self._tell("definitions", self._definitions)

    # -- looks ------------------------------------------------------------------------------------

    def set_theme(self, tokens: Mapping[str, object], dark: bool) -> None:
        """Use the design tokens: the whole file, or `Theme.blockly_tokens()`. Keeps program and undo."""
        self._theme = {"tokens": dict(tokens), "dark": dark}
        if isinstance(tokens.get("reducedMotion"), bool):
            self.set_reduced_motion(bool(tokens["reducedMotion"]))
        if self._web is not None:
            self._dress(self._web)
        self._tell("theme", self._theme)

    def set_reduced_motion(self, reduced: bool) -> None:
        """Steady glow instead of a breathing one."""
        if reduced != self._reduced_motion:
            self._reduced_motion = reduced
            self._tell("motion", {"reduced": reduced})

    def highlight(self, ids: Sequence[str]) -> None:
        """Let exactly these blocks glow; 30 calls a second are fine."""
        self._show("highlight", list(ids))

    def mark_stopped(self, ids: Sequence[str]) -> None:
        """Outline the blocks at which the program was stopped."""
        self._show("stopped", list(ids))

    def set_errors(self, errors: Mapping[str, str]) -> None:
        """Outline these blocks and put a sentence beside each: id -> sentence."""
        self._show("errors", dict(errors))

    def set_absent(self, ids: Sequence[str]) -> None:
        """Show these blocks grey and dashed: their robot is not connected."""
        self._show("absent", list(ids))

    def set_live_values(self, values: Mapping[str, str]) -> None:
        """Set the words of sensor blocks, by block id or by ``<robot>/<property>``. No undo, no change."""
        self._show("live", dict(values))

    # -- commands ---------------------------------------------------------------------------------

    def undo(self) -> None:
        """Take back the last edit."""
        self._tell("undo", None)

    def redo(self) -> None:
        """Do it again."""
        self._tell("redo", None)

    def zoom_in(self) -> None:
        """One step larger."""
        self._tell("zoom", 1)

    def zoom_out(self) -> None:
        """One step smaller."""
        self._tell("zoom", -1)

    def zoom_to_fit(self) -> None:
        """Show the whole program."""
        self._tell("fit", None)

    def show_block(self, id: str) -> None:
        """Bring the block to the middle and select it."""
        self._tell("show", id)

    # -- the page ---------------------------------------------------------------------------------

    def showEvent(self, event: QShowEvent) -> None:
        super().showEvent(event)
        if self._web is None:
            self._make_page()

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        if event.type() == QEvent.Type.ChildAdded:
            self._watch_keys()
        if event.type() == QEvent.Type.KeyPress:
            key = cast("QKeyEvent", event)
            # A shortcut of the window has had its turn before a key press arrives here.
            if key.key() in _FUNCTION_KEYS and key.modifiers() == Qt.KeyboardModifier.NoModifier:
                self.key_pressed.emit(QKeySequence(key.key()).toString())
                return True
        return super().eventFilter(watched, event)

    def _make_page(self) -> None:
        self._web = BlocklyWeb(self._bridge, self._background(), self)
        self._layout.addWidget(self._web.view)
        self.setFocusProxy(self._web.view)
        self._web.view.installEventFilter(self)
        self._web.page.renderProcessTerminated.connect(self._died)
        self._dress(self._web)
        application = QCoreApplication.instance()
        if application is not None:
            application.aboutToQuit.connect(self._close_page)
        self._web.start()

    def _close_page(self) -> None:
        """Let the page go before its profile, whatever order the interpreter ends things in."""
        web, self._web, self._up = self._web, None, False
        if web is not None:
            web.close()

    def _dress(self, web: BlocklyWeb) -> None:
        """What the theme decides outside the page: the colour before the first picture, the size of text."""
        web.page.setBackgroundColor(self._background())
        tokens = cast("Mapping[str, object]", self._theme["tokens"])
        percent = tokens.get("textPercent")
        web.view.setZoomFactor(percent / 100 if isinstance(percent, int | float) else 1.0)

    def _watch_keys(self) -> None:
        """The widget that gets the keys is made by the web engine, and made again with a new process."""
        keyboard = self._web.keyboard() if self._web is not None else None
        if keyboard is not None:
            keyboard.removeEventFilter(self)
            keyboard.installEventFilter(self)

    def _beginning(self) -> Json:
        if not self._theme:
            tokens = json.loads(resources.path("theme", "tokens.json").read_text("utf-8"))
            self._theme = {"tokens": tokens, "dark": False}
        return {"language": self._language, "reduced": self._reduced_motion, "theme": self._theme}

    def _background(self) -> QColor:
        tokens = cast("Mapping[str, Mapping[str, object]]", self._beginning()["theme"])["tokens"]
        colours = cast("Mapping[str, object]", tokens["colour"])
        mode = colours.get("dark" if self._theme["dark"] else "light", colours)
        return QColor(str(cast("Mapping[str, object]", mode)["workspace"]))

    def _came_up(self) -> None:
        self._up = True
        self._up_since = time.monotonic()
        self._watch_keys()
        self._bridge.tell("definitions", self._definitions)
        self._send_program()
        for name, value in self._shown.items():
            self._bridge.tell(name, value)
        self.ready.emit()

    def _died(self, _status: QWebEnginePage.RenderProcessTerminationStatus, code: int) -> None:
        _log.warning("the web process of the block editor ended (code %d); it is started again", code)
        self._up = False
        waiting, self._waiting = self._waiting, {}
        for done in waiting.values():
            done(self._workspace)
        self.history_changed.emit(False, False)
        if time.monotonic() - self._up_since > _STABLE_S:
            self._deaths = 0
        delay = _RESTART_MS[min(self._deaths, len(_RESTART_MS) - 1)]
        self._deaths += 1
        if self._web is not None:
            QTimer.singleShot(delay, self._web.page, self._web.start)

    def _send_program(self) -> None:
        self._tell("load", {"generation": self._generation, "workspace": self._workspace})

    def _show(self, name: str, value: object) -> None:
        if self._shown.get(name) != value:
            self._shown[name] = value
            self._tell(name, value)

    def _tell(self, command: str, payload: object) -> None:
        if self._up:
            self._bridge.tell(command, payload)

    def _edited(self, generation: int, workspace: str) -> None:
        if generation != self._generation:
            return
        self._workspace = _program(workspace)
        self.changed.emit(self._workspace)

    def _answered(self, token: int, workspace: str) -> None:
        done = self._waiting.pop(token, None)
        if done is not None:
            done(_program(workspace))


def _program(text: str) -> dict[str, object]:
    """The page's JSON, however long its stacks are."""
    made = deep_json.loads(text)
    return made if isinstance(made, dict) else {}
