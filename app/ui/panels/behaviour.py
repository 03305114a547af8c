"""Behaviour: the block editor, and the program that its blocks make."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Protocol, cast

from PySide6.QtCore import QPoint, Qt, SignalInstance
from PySide6.QtGui import QGuiApplication, QResizeEvent
from PySide6.QtWidgets import QStackedWidget, QVBoxLayout, QWidget

from app.ui.behaviour_title import BehaviourTitle
from app.ui.panels.base import Panel, PanelContext, PanelWidget
from app.ui.program_view import ProgramView
from app.ui.sensor_words import reading_of
from app.ui.widgets import EmptyAction, EmptyState

if TYPE_CHECKING:
    from collections.abc import Sequence

    from app.core.watches import Watch

KEYS = {"F5": "run.run", "F8": "run.pause", "F10": "run.step", "F12": "run.stop"}
LIVE_EVERY = 6  # refreshes of 30 a second: words on sensor blocks are renewed five times a second
TOOLBOX_WIDTH = 196
EMPTY_SIZE = (460, 250)
Json = Mapping[str, object]


class Editor(Protocol):
    """What the panel needs of the block editor (`app.ui.blockly_view.BlocklyView`)."""

    changed: SignalInstance
    history_changed: SignalInstance
    key_pressed: SignalInstance

    def set_definitions(self, definitions: Json) -> None: ...
    def load(self, workspace: Json) -> None: ...
    def flush(self, done: Callable[[dict[str, object]], None]) -> None: ...
    def set_theme(self, tokens: Json, dark: bool) -> None: ...
    def highlight(self, ids: Sequence[str]) -> None: ...
    def mark_stopped(self, ids: Sequence[str]) -> None: ...
    def set_errors(self, errors: Mapping[str, str]) -> None: ...
    def set_absent(self, ids: Sequence[str]) -> None: ...
    def set_live_values(self, values: Mapping[str, str]) -> None: ...
    def undo(self) -> None: ...
    def redo(self) -> None: ...
    def show_block(self, id: str) -> None: ...


def blockly(parent: QWidget) -> Editor:
    """The real editor."""
    # Qt WebEngine takes a fifth of a second to import: only when the editor is seen for the first time.
    from app.ui.blockly_view import BlocklyView  # noqa: PLC0415

    return cast("Editor", BlocklyView(parent))  # its signals are instances, which mypy cannot see


class BehaviourPanel(PanelWidget):
    """The behaviour that is open: Blocks to build with, Python to read."""

    def __init__(self, context: PanelContext, make_editor: Callable[[QWidget], Editor] = blockly) -> None:
        super().__init__(context, "Behaviour")
        self._bar = BehaviourTitle(self.theme)
        self._bar.mode.changed.connect(self.set_mode)
        self._bar.copy.clicked.connect(self.copy_program)
        self._bar.undo.clicked.connect(self.undo)
        self._bar.redo.clicked.connect(self.redo)
        self.mode = "blocks"
        self.program = ProgramView(self.theme)
        self._make_editor = make_editor
        self.editor: Editor | None = None
        self._place = QWidget()
        self._place_column = QVBoxLayout(self._place)
        self._place_column.setContentsMargins(0, 0, 0, 0)
        self.pages = QStackedWidget()
        self.pages.addWidget(self._place)
        self.pages.addWidget(self.program)
        column = QVBoxLayout(self)
        column.setContentsMargins(0, 0, 0, 0)
        column.addWidget(self.pages)
        self.empty = EmptyState(
            self.theme,
            "bot",
            "No robot is connected",
            "You can build now and run later. With the virtual robot you can try it at once.",
            [
                EmptyAction(
                    "Use the virtual robot", lambda: context.run("robots.virtual"), "bot", primary=True
                )
            ],
        )
        self.empty.setParent(self._place)
        self.empty.hide()
        self._shown: dict[str, object] = {}
        self._watches: dict[str, Watch] = {}
        self._sensors: tuple[tuple[str, str], ...] = ()
        self._ticks = 0

    def replaces_title(self) -> QWidget:
        return self._bar

    # -- what it shows ------------------------------------------------------------------------------------

    def refresh(self) -> None:
        self._ticks += 1
        document = self.session.document
        if self.editor is None:
            self._open_editor()
        self._bar.tab.show_name(document.name, document.dirty)
        if self.editor is None:
            return
        if self._new("definitions", document.definitions_revision):
            self.editor.set_definitions(document.definitions())
        if self._new("document", document.revision):
            self.editor.load(document.workspace)
        facts = (document.revision, document.edits, document.definitions_revision)
        if self._new("facts", facts):
            self._program_changed()
        runs = self.session.runs
        if self._new("blocks", runs.blocks_revision):
            self.editor.highlight(runs.running_blocks)
            self.editor.mark_stopped(runs.stopped_blocks)
            self.editor.set_errors(runs.block_errors)
        if self._ticks % LIVE_EVERY == 0:
            self._show_live()
        self._show_empty()

    def _new(self, what: str, now: object) -> bool:
        """Whether this differs from what was shown."""
        if self._shown.get(what) == now and what in self._shown:
            return False
        self._shown[what] = now
        return True

    def _open_editor(self) -> None:
        editor = self.editor = self._make_editor(self._place)
        editor.changed.connect(self._edited)
        editor.history_changed.connect(self._history)
        editor.key_pressed.connect(self._key)
        editor.set_theme(self.theme.blockly_tokens(), self.theme.dark)
        if isinstance(editor, QWidget):
            had_focus = self.hasFocus()
            self._place_column.addWidget(editor)
            self.setFocusProxy(editor)
            if had_focus:
                editor.setFocus(Qt.FocusReason.OtherFocusReason)

    def _program_changed(self) -> None:
        """The program is another one: its problems, the sensors it reads, its text."""
        program = self.session.document.program()
        if self.editor is not None:
            self.editor.set_absent(program.absent)
        self._sensors = tuple(program.sensors)
        self._look_at({robot for robot, _ in self._sensors})
        if self.mode == "python":
            self.program.show_program(program.source)

    def _look_at(self, robots: set[str]) -> None:
        for name in self._watches.keys() - robots:
            self._watches.pop(name).close()
        for name in robots - self._watches.keys():
            if self.session.fleet.link(name) is not None:
                self._watches[name] = self.session.fleet.look_at(name)

    def _show_live(self) -> None:
        """What sensor blocks say now: "84 %" on the battery."""
        words = {}
        for robot, name in self._sensors:
            link = self.session.fleet.link(robot)
            sensor = link.robot.sensor(name) if link is not None else None
            if link is not None and sensor is not None and link.state != "away":
                words[f"{robot}/{name}"] = reading_of(sensor, link.values.get(name)).value
        if self.editor is not None:
            self.editor.set_live_values(words)

    def _show_empty(self) -> None:
        """Over the empty workspace, while there is no robot to build for."""
        wanted = (
            self.mode == "blocks" and not self.session.fleet.connected and not _blocks(self.session.document)
        )
        if wanted != self.empty.isVisibleTo(self._place):
            self.empty.setVisible(wanted)
        if wanted:
            self._place_empty()

    def _place_empty(self) -> None:
        width = min(EMPTY_SIZE[0], self._place.width() - TOOLBOX_WIDTH - 16)
        left = TOOLBOX_WIDTH + (self._place.width() - TOOLBOX_WIDTH - width) // 2
        self.empty.resize(width, EMPTY_SIZE[1])
        self.empty.move(QPoint(left, max(0, (self._place.height() - EMPTY_SIZE[1]) // 2)))
        self.empty.raise_()

    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        if self.empty.isVisibleTo(self._place):
            self._place_empty()

    def theme_changed(self) -> None:
        if self.editor is not None:
            self.editor.set_theme(self.theme.blockly_tokens(), self.theme.dark)

    # -- what a person does -------------------------------------------------------------------------------

    def set_mode(self, mode: str) -> None:
        """Show "blocks" or "python"."""
        self.mode = mode
        self._bar.show_mode(mode)
        self.pages.setCurrentIndex(1 if mode == "python" else 0)
        if mode == "python":
            self.flush(lambda: self.program.show_program(self.session.document.program().source))

    def copy_program(self) -> None:
        """Put the Python text on the clipboard."""
        QGuiApplication.clipboard().setText(self.program.toPlainText())
        self.context.toast("Copied the program")

    def flush(self, done: Callable[[], None]) -> None:
        """Take over the newest edits (the editor tells them 150 ms late), then call ``done``."""
        if self.editor is None:
            done()
            return

        # An edit that was still on its way is told before the answer. A behaviour that nobody edited stays
        # the file's own JSON, which Blockly would write another way.
        self.editor.flush(lambda _workspace: done())

    def undo(self) -> None:
        """Take back the last edit of the blocks."""
        if self.editor is not None:
            self.editor.undo()

    def redo(self) -> None:
        """Do it again."""
        if self.editor is not None:
            self.editor.redo()

    def show_block(self, block: str) -> None:
        """Show the blocks, and this one in the middle."""
        self.set_mode("blocks")
        if self.editor is not None:
            self.editor.show_block(block)

    def _edited(self, _key: str, workspace: dict[str, object]) -> None:
        self.session.document.edited(workspace)

    def _history(self, can_undo: bool, can_redo: bool) -> None:
        self._bar.undo.setEnabled(can_undo)
        self._bar.redo.setEnabled(can_redo)

    def _key(self, key: str) -> None:
        if key in KEYS:
            self.context.run(KEYS[key])

    def save_state(self) -> dict[str, object]:
        return {"mode": self.mode}

    def restore_state(self, state: Mapping[str, object]) -> None:
        self.set_mode("python" if state.get("mode") == "python" else "blocks")

    def shut(self) -> None:
        self._look_at(set())


def _blocks(document: object) -> bool:
    """Whether there is any block in the workspace."""
    workspace = getattr(document, "workspace", {})
    inner = workspace.get("blocks") if isinstance(workspace, Mapping) else None
    return bool(inner.get("blocks")) if isinstance(inner, Mapping) else False


PANEL = Panel("behaviour", "Behaviour", "blocks", (), BehaviourPanel)
