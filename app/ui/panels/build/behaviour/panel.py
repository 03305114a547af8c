"""Behaviour panel: the block editor and the generated program."""

from __future__ import annotations

import re
import time
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from contextlib import suppress
from functools import partial
from typing import TYPE_CHECKING, Protocol, cast

from PySide6.QtCore import QPoint, Qt, SignalInstance
from PySide6.QtGui import QGuiApplication, QPageLayout
from PySide6.QtWidgets import QVBoxLayout, QWidget

from app.blocks.model.stack import Stack
from app.core.projects.backpack import Backpack
from app.core.projects.rename import name_problem
from app.core.projects.titles import unique_titles
from app.core.reports.not_installed import MissingLibraries, alert_missing, missing_libraries
from app.core.robots.robot_link import NOT_STOPPED, STOPPING
from app.errors import SettingsError
from app.intents import Intent, RenameVariable
from app.ui.blockly.messages import (
    BackpackAdded,
    BackpackEmptied,
    BackpackOpened,
    BackpackRemoved,
    BlocksDeleted,
    BlocksDraggedOutside,
    BlocksDroppedOutside,
    BlocksTransferred,
    CanvasButtonPressed,
    CommandRequested,
    DragImageRendered,
    FlyoutPinned,
    HistoryChanged,
    SensorsShown,
    StackTried,
    VariablesWatched,
    reject_unhandled,
)
from app.ui.intents import (
    BlockEdit,
    CloseBehaviour,
    DeleteVariable,
    MenuEdit,
    MoveTab,
    PressKey,
    RenameTab,
    SelectTab,
    ToggleVariableWatch,
    TryStack,
)
from app.ui.panels.base import PanelContext, PanelWidget
from app.ui.panels.build.behaviour.backpack_storage import BackpackController
from app.ui.panels.build.behaviour.dragged_blocks import BlockDrag
from app.ui.panels.build.behaviour.live_values import sensor_texts
from app.ui.panels.build.behaviour.printing import PrintCommands
from app.ui.panels.build.behaviour.program_pictures import ImageCommands
from app.ui.panels.build.behaviour.program_view import ProgramView
from app.ui.panels.build.behaviour.tab import TabState
from app.ui.panels.build.behaviour.tabs import BehaviourTitle
from app.ui.panels.build.behaviour.variable_commands import VariableCommands
from app.ui.widgets import EmptyAction, EmptyState, label
from app.ui.widgets.indicators import STATUS_BY_ROBOT_STATE
from nep.i18n import _, lazy, ngettext, pgettext

if TYPE_CHECKING:
    from app.blocks.model.program import Program
    from app.blocks.model.workspace_json import WorkspaceJson
    from app.blocks.runtime.variables import VariableValue
    from app.core.network.watches import Suspendable, Watch
    from app.core.projects.open_project import OpenProject
    from app.core.robots.robot_link import RobotLink
    from app.core.run.control import Runs
    from app.ui.blockly.messages import (
        BackpackItem,
        EditCommand,
        PagePosition,
        PanelMessage,
        PictureKind,
    )

LIVE_UPDATE_TICKS = 6  # refreshes at 30 Hz: values on sensor blocks are updated five times a second
ALARM_STATES = frozenset({NOT_STOPPED, STOPPING, "silent"})
LOADING_TEXT = lazy("Loading blocks…")
LOADING_TEXT_DELAY_S = 0.5
START_COMMANDS = {"robot": "robots.virtual", "examples": "help.examples"}
"""Commands of the window that the buttons on an empty canvas run."""
PAGE_INTENTS: Mapping[str, Callable[[str], Intent]] = {
    "variable.rename": RenameVariable,
    "variable.delete": DeleteVariable,
    "variable.watch": ToggleVariableWatch,
}
"""Intents that menus of the page request for a variable, by their name in the page."""
_PLACEHOLDER = re.compile(r"\([^()]*\)")  # placeholders in the help, such as "(robot) say (text)"
Json = Mapping[str, object]


class Editor(Protocol):
    """Interface of the block editor (`app.ui.blockly.view.BlocklyView`)."""

    changed: SignalInstance
    key_pressed: SignalInstance
    recovered: SignalInstance
    message_received: SignalInstance

    @property
    def is_ready(self) -> bool: ...
    def set_toolbox_pinned(self, is_pinned: bool | None) -> None: ...
    def set_definitions(self, definitions: Json) -> None: ...
    def show_tab(self, key: str, workspace: Json) -> None: ...
    def close_tab(self, key: str) -> None: ...
    def load(self, workspace: Json) -> None: ...
    def apply_edit(self, workspace: Json) -> None: ...
    def flush(self, callback: Callable[[WorkspaceJson], None]) -> None: ...
    def set_theme(self, tokens: Json, is_dark: bool) -> None: ...
    def highlight(self, ids: Sequence[str]) -> None: ...
    def mark_stopped(self, ids: Sequence[str]) -> None: ...
    def set_errors(self, errors: Mapping[str, str]) -> None: ...
    def set_warnings(self, warnings: Mapping[str, str]) -> None: ...
    def show_value(self, id: str, text: str) -> None: ...
    def set_absent(self, ids: Sequence[str]) -> None: ...
    def set_live_values(self, values: Mapping[str, str], stale_keys: Collection[str] = ()) -> None: ...
    def set_alarms(self, alarms: Mapping[str, tuple[str, str]]) -> None: ...
    def set_variable_values(self, values: Mapping[str, VariableValue]) -> None: ...
    def edit_variable(self, edit: Json) -> None: ...
    def set_backpack(self, items: Sequence[BackpackItem]) -> None: ...
    def set_canvas_hint(self, label: str, has_robot: bool) -> None: ...
    def point_at(self, block: str, name: str = "", placement_hint: str = "") -> None: ...
    def undo(self) -> None: ...
    def edit(self, command: EditCommand) -> None: ...
    def edit_from_menu(self, command: EditCommand) -> None: ...
    def undo_deletion(self) -> None: ...
    def move_dragged_blocks(self) -> None: ...
    def undo_block_move(self) -> None: ...
    def to_screen(self, position: PagePosition) -> QPoint: ...
    def render_picture(self, kind: PictureKind, white: bool, callback: Callable[[bytes], None]) -> None: ...
    def render_pdf(
        self, title: str, date: str, layout: QPageLayout, callback: Callable[[bytes], None]
    ) -> None: ...
    def open_find(self) -> None: ...
    def open_search(self) -> None: ...
    def redo(self) -> None: ...
    def show_block(self, id: str) -> None: ...


def make_blockly_editor(parent: QWidget) -> Editor:
    """Create the block editor; called when the panel is first shown.

    Raises `ImportError` if a system library that Qt WebEngine needs is missing.
    """
    # Importing Qt WebEngine takes about 200 ms.
    from app.ui.blockly.view import BlocklyView  # noqa: PLC0415

    # mypy doesn't know that signals of instances are SignalInstance
    return cast("Editor", BlocklyView(parent))


class BehaviourPanel(PanelWidget):
    """Panel with the active behaviour as editable blocks or read-only Python."""

    def __init__(
        self, context: PanelContext, make_editor: Callable[[QWidget], Editor] = make_blockly_editor
    ) -> None:
        super().__init__(context, _("Behaviour"))
        self._can_open_editor = True
        self._bar = BehaviourTitle(self.theme)
        self._bar.mode.changed.connect(self.set_mode)
        self._bar.copy.clicked.connect(self.copy_program)
        self._bar.undo.clicked.connect(self.undo)
        self._bar.redo.clicked.connect(self.redo)
        tabs = self._bar.tabs
        tabs.selected.connect(lambda key: context.request(SelectTab(key)))
        tabs.close_requested.connect(lambda key: context.request(CloseBehaviour(key)))
        tabs.moved.connect(lambda key, place: context.request(MoveTab(key, place)))
        tabs.intent_requested.connect(context.request)
        tabs.renamed.connect(lambda key, name: context.request(RenameTab(key, name)))
        tabs.name_problem = self._name_problem
        tabs.add.clicked.connect(lambda: context.run("file.new"))
        self.mode = "blocks"
        self.program = ProgramView(self.theme)
        self._make_editor = make_editor
        self.editor: Editor | None = None
        self._editor_container = QWidget()
        self._editor_layout = QVBoxLayout(self._editor_container)
        self._editor_layout.setContentsMargins(0, 0, 0, 0)
        self.pages = self.make_page_stack(self._editor_container, self.program)
        self.loading_message = LoadingMessage(self._editor_container)
        self._shown_values: dict[str, object] = {}
        self._loaded_revisions: dict[str, tuple[int, int]] = {}
        self._watches: dict[str, Watch] = {}
        self._sensors: tuple[tuple[str, str], ...] = ()
        self._flyout_sensors: tuple[tuple[str, str], ...] = ()  # sensors in the flyout while it is open
        self._watched_variable_ids: tuple[str, ...] = ()  # variables whose values the page shows
        self._ticks = 0
        self._block_drag: BlockDrag | None = None
        self._backpack: BackpackController | None = None
        self.variables = VariableCommands(context, self.flush, self.edit_variable)
        self.pictures = ImageCommands(context, self.render_picture)
        self.printing = PrintCommands(context, self.render_pdf)

    def title_widget(self) -> QWidget:
        return self._bar

    # -- display ------------------------------------------------------------------------------------------

    def refresh(self) -> None:
        self._ticks += 1
        projects, project = self.session.documents, self.session.document
        self._bar.tabs.show_tabs(tab_states(projects, self.session.runs), project.key)
        if self.editor is None and self._can_open_editor:
            self.editor = self._open_editor()
        if self.editor is not None:
            if self._has_changed("definitions", projects.definitions_revision):
                self.editor.set_definitions(projects.definitions())
            self._show_blocks(self.editor)
        program = project.newest_program()
        if program is not None and program is not self._shown_values.get("facts"):
            self._shown_values["facts"] = program
            self._program_changed(program)
        if self.editor is not None:
            self._show_run(self.editor)

    def _show_run(self, editor: Editor) -> None:
        runs, project = self.session.runs, self.session.document
        is_shown_run = runs.document is project
        if self._has_changed("blocks", (runs.blocks_revision, is_shown_run)):
            editor.highlight(runs.running_blocks if is_shown_run else ())
            editor.mark_stopped(runs.stopped_blocks if is_shown_run else ())
            editor.set_errors(runs.block_errors if is_shown_run else {})
            editor.set_warnings(runs.block_warnings if is_shown_run else {})
        tried = runs.tried_value
        if self._has_changed("tried", tried) and tried is not None and tried.document is project:
            editor.show_value(tried.block, tried.text)
        alarms = alarms_of(self.session.fleet.links)
        if self._has_changed("alarms", alarms):
            editor.set_alarms(alarms)
        if self._has_changed("values", (runs.values_revision, is_shown_run, self._watched_variable_ids)):
            values = runs.values if is_shown_run else {}
            editor.set_variable_values({id: values[id] for id in self._watched_variable_ids if id in values})
        if self._ticks % LIVE_UPDATE_TICKS == 0:
            self._show_live_values()
        if self._backpack is not None:
            self._backpack.tick()
        self.loading_message.set_ready(is_ready=editor.is_ready)
        has_robot = bool(self.session.fleet.connected or self.session.starting_robots)
        editor.set_canvas_hint(pgettext("block", "when started"), has_robot)

    def show_current(self) -> None:
        """Show the active behaviour at once instead of on the next tick."""
        if self.editor is not None and self.editor.is_ready:
            self._bar.tabs.show_tabs(
                tab_states(self.session.documents, self.session.runs), self.session.document.key
            )
            self._show_blocks(self.editor)

    def _show_blocks(self, editor: Editor) -> None:
        project = self.session.document
        now = (project.revision, project.fixes)
        previous = self._loaded_revisions.get(project.key)
        if self._has_changed("tab", project.key):
            editor.show_tab(project.key, project.workspace)
            for name in ("facts", "blocks"):
                self._shown_values.pop(name, None)
        if previous is not None and previous[0] != now[0]:
            editor.load(project.workspace)
        elif previous is not None and previous[1] != now[1]:
            editor.apply_edit(project.workspace)
        self._loaded_revisions[project.key] = now
        for key in self._loaded_revisions.keys() - {each.key for each in self.session.documents}:
            del self._loaded_revisions[key]
            editor.close_tab(key)

    def _has_changed(self, name: str, now: object) -> bool:
        if self._shown_values.get(name) == now and name in self._shown_values:
            return False
        self._shown_values[name] = now
        return True

    def _open_editor(self) -> Editor | None:
        try:
            editor = self._make_editor(self._editor_container)
        except ImportError as error:
            missing = missing_libraries(error)
            if missing is None:
                raise
            self._can_open_editor = False
            self._show_missing_libraries(missing)
            return None
        editor.changed.connect(self._on_edited)
        editor.recovered.connect(
            lambda: self.context.show_toast(_("The block editor was restarted. Undo history was cleared."))
        )
        editor.key_pressed.connect(self._key_pressed)
        editor.message_received.connect(self._on_message)
        self._block_drag = BlockDrag(
            self.context, self.session, self._bar.tabs, editor, self.flush, self.show_current
        )
        backpack = Backpack(self.session.settings.path.parent)
        self._backpack = BackpackController(self.context, backpack, editor)
        editor.set_toolbox_pinned(self.session.settings.toolbox_pinned)
        editor.set_theme(self.theme.blockly_tokens(), self.theme.is_dark)
        if isinstance(editor, QWidget):
            had_focus = self.hasFocus()
            self._editor_layout.addWidget(editor)
            self.setFocusProxy(editor)
            if had_focus:
                editor.setFocus(Qt.FocusReason.OtherFocusReason)
        return editor

    def _run_for_page(self, message: CommandRequested | CanvasButtonPressed | StackTried) -> None:
        match message:
            case CommandRequested():
                # The page sends ids of commands, and intents for variables as "name:id".
                name, _colon, id = message.command.partition(":")
                if name in PAGE_INTENTS:
                    self.context.request(PAGE_INTENTS[name](id))
                else:
                    self.context.run(message.command)
            case CanvasButtonPressed():
                self.context.run(START_COMMANDS[message.button])
            case StackTried():
                self.context.request(TryStack(Stack(message.id, message.kind, message.state)))
            case _:
                reject_unhandled(message)

    def _show_missing_libraries(self, missing: MissingLibraries) -> None:
        alert_missing(self.session.alerts, missing)
        state = EmptyState(self.theme, "circle-x", missing.title, missing.remedy)
        if missing.command:
            copy = partial(self._copy_command, missing.command)
            state.set_actions([EmptyAction(_("Copy the command"), copy, "copy")])
        self._editor_layout.addWidget(state)

    def _copy_command(self, command: str) -> None:
        QGuiApplication.clipboard().setText(command)
        self.context.show_toast(_("Copied “{command}”").format(command=command))

    def _program_changed(self, program: Program) -> None:
        # Updates absent blocks, sensors and the program's text.
        if self.editor is not None:
            self.editor.set_absent(program.absent)
        self._sensors = tuple(program.sensors)
        self._show_live_values()
        if self.mode == "python":
            self.program.show_program(program.source)

    def _watch_robots(self, robots: set[str]) -> None:
        for name in self._watches.keys() - robots:
            self._watches.pop(name).close()
        for name in robots - self._watches.keys():
            if self.session.fleet.link(name) is not None:
                self._watches[name] = self.session.fleet.watch_sensors(name)

    def _on_message(self, message: PanelMessage) -> None:
        backpack, block_drag = self._backpack, self._block_drag
        if backpack is None or block_drag is None:
            return
        match message:
            case HistoryChanged():
                self._bar.undo.setEnabled(message.can_undo)
                self._bar.redo.setEnabled(message.can_redo)
            case FlyoutPinned():
                self._save_pinned(message.is_pinned)
            case BlocksDeleted():
                self._blocks_deleted(message.count)
            case SensorsShown():
                self._flyout_sensors = message.sensors
                self._show_live_values()
            case VariablesWatched():
                self._watched_variable_ids = message.ids
            case CommandRequested() | CanvasButtonPressed() | StackTried():
                self._run_for_page(message)
            case BackpackOpened() | BackpackAdded() | BackpackRemoved() | BackpackEmptied():
                backpack.handle(message)
            case BlocksDraggedOutside() | DragImageRendered() | BlocksDroppedOutside() | BlocksTransferred():
                block_drag.handle(message)
            case _:
                reject_unhandled(message)

    def edit_variable(self, edit: Mapping[str, object]) -> None:
        """Run an operation on a variable in the blocks view.

        Args:
            edit: JSON object with the operation in ``do``: "new", "rename", "delete", "watch", "show" or
                "undo".
        """
        self.set_mode("blocks")
        if self.editor is not None:
            if edit.get("do") == "undo":
                self.editor.undo()
            elif edit.get("do") == "show":
                self.editor.show_block(str(edit.get("id")))
            else:
                self.editor.edit_variable(edit)

    def _save_pinned(self, is_pinned: bool) -> None:
        # Failed writes are shown by the status bar.
        with suppress(SettingsError):
            self.session.settings.toolbox_pinned = is_pinned

    def _blocks_deleted(self, count: int) -> None:
        message = ngettext("Deleted {count} block", "Deleted {count} blocks", count).format(count=count)
        if self.editor is not None:
            self.context.show_toast(message, _("Undo"), self.editor.undo_deletion)

    def _show_live_values(self) -> None:
        sensors = dict.fromkeys((*self._sensors, *self._flyout_sensors))
        self._watch_robots({robot for robot, _name in sensors})
        if self.editor is not None:
            texts, stale_keys = sensor_texts(self.session.fleet, sensors)
            self.editor.set_live_values(texts, stale_keys)

    def theme_changed(self) -> None:
        if self.editor is not None:
            self.editor.set_theme(self.theme.blockly_tokens(), self.theme.is_dark)

    # -- user actions -------------------------------------------------------------------------------------

    def set_mode(self, mode: str) -> None:
        """Switch to the view "blocks" or "python"."""
        self.mode = mode
        self._bar.show_mode(mode)
        self.pages.setCurrentIndex(1 if mode == "python" else 0)
        if mode == "python":
            self.flush(lambda: self.program.show_program(self.session.document.program().source))

    def copy_program(self) -> None:
        """Copy the Python program to the clipboard."""
        QGuiApplication.clipboard().setText(self.program.toPlainText())
        self.context.show_toast(_("Copied the program"))

    def flush(self, callback: Callable[[], None]) -> None:
        """Fetch pending edits, which the editor debounces by 150 ms, then call `callback`."""
        if self.editor is None:
            callback()
            return

        # Pending edits arrive before the reply. The reply itself is ignored: an unedited behaviour keeps the
        # JSON of its file, which Blockly would serialize differently.
        self.editor.flush(lambda _workspace: callback())

    def undo(self) -> None:
        """Undo the last edit of the blocks."""
        if self.editor is not None:
            self.editor.undo()

    def redo(self) -> None:
        """Redo the last undone edit."""
        if self.editor is not None:
            self.editor.redo()

    def edit_blocks(self, command: BlockEdit) -> None:
        """Edit the selected blocks if the blocks view is active."""
        if self.editor is not None and self.mode == "blocks":
            self.editor.edit(command)

    def edit_from_menu(self, command: MenuEdit) -> None:
        """Edit the page's focused text field, else the blocks, if the blocks view is active."""
        if self.editor is not None and self.mode == "blocks":
            self.editor.edit_from_menu(command)

    def render_picture(self, kind: PictureKind, white: bool, callback: Callable[[bytes], None]) -> None:
        """Render all blocks of the active behaviour as an image.

        Args:
            kind: "png" or "svg".
            white: True for a white background, False for a transparent one.
            callback: Receives the image data; b"" if there are no blocks.
        """
        if self.editor is None:
            callback(b"")
        else:
            self.editor.render_picture(kind, white, callback)

    def render_pdf(
        self, title: str, date: str, layout: QPageLayout, callback: Callable[[bytes], None]
    ) -> None:
        """Render all blocks of the active behaviour as a PDF document.

        Args:
            title: Title on the page.
            date: Date on the page.
            layout: Size, orientation and margins of the page.
            callback: Receives the PDF data; b"" if there are no blocks.
        """
        if self.editor is None:
            callback(b"")
        else:
            self.editor.render_pdf(title, date, layout, callback)

    def find_blocks(self, *, to_add: bool) -> None:
        """Open the search in the toolbox if `to_add` is True, else the search in the behaviour."""
        self.set_mode("blocks")
        if self.editor is not None:
            self.setFocus(Qt.FocusReason.ShortcutFocusReason)
            (self.editor.open_search if to_add else self.editor.open_find)()

    def point_at(self, block: str) -> None:
        """Highlight a block in the toolbox and the place where it belongs.

        Args:
            block: Type of the block; "" removes the highlight.
        """
        if self.editor is None:
            return
        if not block:
            self.editor.point_at("")
            return
        self.set_mode("blocks")
        help_by_type = self.session.documents.definitions().get("help")
        definition = help_by_type.get(block) if isinstance(help_by_type, Mapping) else None
        title = str(definition.get("title", "")) if isinstance(definition, Mapping) else ""
        name = " ".join(_PLACEHOLDER.sub(" ", title).split())
        starts_script = block.startswith("events_") or "_when_" in block
        hint = _("Drag it onto the page") if starts_script else _("Drag it below the other blocks")
        self.editor.point_at(block, name, hint)

    def show_block(self, block: str) -> None:
        """Switch to the blocks view and scroll to a block.

        Args:
            block: Id of the block.
        """
        self.set_mode("blocks")
        if self.editor is not None:
            self.editor.show_block(block)

    def _on_edited(self, key: str, workspace: WorkspaceJson) -> None:
        project = self.session.documents.find_by_key(key)
        if project is not None:
            was_blank = project.is_blank
            project.apply_edit(workspace)
            self.session.tabs.on_edited(project, was_blank=was_blank)

    def rename_current(self) -> None:
        """Start in-place editing of the name of the active tab."""
        self._bar.tabs.edit(self.session.document.key)

    def _name_problem(self, key: str, name: str) -> str:
        project = self.session.documents.find_by_key(key)
        return name_problem(name, project.path) if project is not None else ""

    def _key_pressed(self, key: str) -> None:
        self.context.request(PressKey(key))  # the shortcut table knows the command of this key

    def save_state(self) -> dict[str, object]:
        return {"mode": self.mode}

    def restore_state(self, state: Mapping[str, object]) -> None:
        self.set_mode("python" if state.get("mode") == "python" else "blocks")

    def suspendables(self) -> Iterable[Suspendable | None]:
        return self._watches.values()

    def dispose(self) -> None:
        self._sensors = self._flyout_sensors = ()
        self._watch_robots(set())


class LoadingMessage:
    """Message that the block editor is loading, shown after half a second.

    The delay prevents flicker when loading is fast.

    Args:
        parent: Widget to cover.
        clock: Returns the time in s.
    """

    def __init__(self, parent: QWidget, clock: Callable[[], float] = time.monotonic) -> None:
        self._container, self._clock = parent, clock
        self._waiting_since_s: float | None = None
        self.text_label = label(_(LOADING_TEXT), "bodyLarge", role="textSecondary", wrap=True)
        self.text_label.setAlignment(Qt.AlignmentFlag.AlignCenter)
        self.text_label.setAttribute(Qt.WidgetAttribute.WA_TransparentForMouseEvents)
        self.text_label.setParent(parent)
        self.text_label.hide()

    def set_ready(self, *, is_ready: bool) -> None:
        """Show or hide the message; call on every refresh.

        Args:
            is_ready: True if the block editor has loaded.
        """
        now = self._clock()
        if is_ready:
            self._waiting_since_s = None
        elif self._waiting_since_s is None:
            self._waiting_since_s = now
        is_late = self._waiting_since_s is not None and now - self._waiting_since_s >= LOADING_TEXT_DELAY_S
        if is_late:
            self.text_label.setGeometry(self._container.rect())
            self.text_label.raise_()
        if is_late != self.text_label.isVisibleTo(self._container):
            self.text_label.setVisible(is_late)


def alarms_of(links: Iterable[RobotLink]) -> dict[str, tuple[str, str]]:
    """Return the warnings to show at robots in the toolbox.

    Args:
        links: Known robots.

    Returns:
        Status and text by robot name, for robots that may be moving or don't respond.
    """
    return {
        link.name: (STATUS_BY_ROBOT_STATE[link.state], link.state_label)
        for link in links
        if link.state in ALARM_STATES
    }


def tab_states(projects: Iterable[OpenProject], runs: Runs) -> list[TabState]:
    """Return the data of the tabs of all open behaviours."""
    open_projects = list(projects)
    states = []
    for project, title in zip(
        open_projects, unique_titles([(each.name, each.path) for each in open_projects]), strict=True
    ):
        is_running = runs.active and runs.document is project
        location = str(project.path) if project.path is not None else _("Not saved to a file yet")
        states.append(
            TabState(
                project.key,
                title,
                project.dirty,
                is_running,
                f"{title}\n{location}",
                project.name,
                project.path is not None,
            )
        )
    return states
