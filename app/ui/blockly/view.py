"""Block editor widget.

The view always stores the latest blocks of each tab. The page is loaded on the first show; if its process
dies, the view sends the complete state to a new page.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence

from msgspec import convert
from PySide6.QtCore import QByteArray, QMarginsF, QPoint, Signal
from PySide6.QtGui import QPageLayout
from PySide6.QtWidgets import QApplication, QWidget

from app.blocks.model.workspace_json import WorkspaceJson
from app.blocks.runtime.variables import VariableValue
from app.ui.blockly import messages
from app.ui.blockly.host import BlocklyHost
from app.ui.blockly.scheme import register_scheme as register_scheme
from app.ui.blockly.tabs import Tabs
from nep import i18n

_PIXELS_PER_INCH = 96.0  # CSS pixels
_MIN_MARGIN_INCH = 0.45
PAGE_EDIT_ACTIONS = {"cut": "Cut", "copy": "Copy", "paste": "Paste", "selectAll": "SelectAll"}
"""Names of `QWebEnginePage.WebAction` members for editing text fields of the page, by command."""
IS_TEXT_FIELD_FOCUSED_JS = (
    "(e => !!e && (e.isContentEditable || /^(INPUT|TEXTAREA)$/.test(e.tagName)))(document.activeElement)"
)
"""JavaScript expression that is true while a text field of the page has the focus."""


class BlocklyView(BlocklyHost):
    """Editor of behaviours, one of which is shown at a time, each in a separate tab.

    All methods can be called at any time, also before the page is loaded. Before the first `show_tab` there
    is one empty behaviour, with the key "".
    """

    changed = Signal(str, object)  # key of a tab and its newest blocks (WorkspaceJson), 150 ms after an edit
    message_received = Signal(object)  # a PanelMessage from the page

    def __init__(self, parent: QWidget | None = None, *, language: str = "") -> None:
        super().__init__(parent, language or i18n.language())
        self._tabs = Tabs()
        empty_toolbox = {"kind": "categoryToolbox", "contents": []}
        self._definitions = messages.SetDefinitions({"blocks": [], "toolbox": empty_toolbox})
        self._live_values = messages.SetLiveValues({}, ())
        self._alarms = messages.SetAlarms({})
        self._variable_values = messages.SetVariableValues({})
        self._canvas_hint: messages.SetCanvasHint | None = None
        self._backpack = messages.SetBackpack(())
        self._pending_hint: messages.PointAt | None = None  # for a page that is not loaded yet
        self._flush_callbacks: dict[int, Callable[[WorkspaceJson], None]] = {}
        self._picture_callbacks: dict[int, Callable[[bytes], None]] = {}
        self._last_token = 0

    # -- blocks -----------------------------------------------------------------------------------

    @property
    def workspace(self) -> Mapping[str, object]:
        """Latest workspace of the shown tab, in Blockly's JSON format.

        Edits of the last 150 ms may be missing; see `flush`.
        """
        return self._tabs.shown_tab.workspace.blocks

    def workspace_of(self, key: str) -> Mapping[str, object] | None:
        """Return the latest workspace of a tab, or None if there is no such tab."""
        tab = self._tabs[key]
        return tab.workspace.blocks if tab is not None else None

    def show_tab(self, key: str, workspace: Mapping[str, object]) -> None:
        """Show a behaviour, with its undo stack, zoom and scroll position.

        Args:
            key: Key of the behaviour.
            workspace: Workspace for a new tab; not used for an existing one.
        """
        evicted = self._tabs.show(key, WorkspaceJson.from_blocks(workspace))
        self._send_tab()
        if evicted is not None:
            self._send(messages.CloseTab(evicted))

    def close_tab(self, key: str) -> None:
        """Close a tab and discard its undo stack. An empty behaviour replaces the shown tab."""
        was_shown = key == self._tabs.shown_tab.key
        if self._tabs.close(key):
            if was_shown:
                self._send_tab()
            self._send(messages.CloseTab(key))

    def load(self, workspace: Mapping[str, object]) -> None:
        """Replace the blocks of the shown tab with those of another document.

        Clears the undo stack and discards pending edits of the old blocks.
        """
        self._tabs.replace(WorkspaceJson.from_blocks(workspace))
        self._tabs.shown_tab.is_loaded = False
        self._send_tab()

    def apply_edit(self, workspace: Mapping[str, object]) -> None:
        """Replace the blocks of the shown tab as one undoable edit; `changed` is not emitted."""
        self._tabs.shown_tab.workspace = WorkspaceJson.from_blocks(workspace)
        self._send(messages.ApplyEdit(workspace))

    def flush(self, callback: Callable[[WorkspaceJson], None]) -> None:
        """Fetch pending edits of the shown tab, then call `callback` with the latest workspace.

        `callback` is called exactly once, even if the page is not loaded or dies. Other tabs have no pending
        edits: they were flushed when another tab was shown.
        """
        if not self._is_page_ready:
            callback(self._tabs.shown_tab.workspace)
            return
        self._last_token += 1
        self._flush_callbacks[self._last_token] = callback
        self._bridge.send(messages.FlushWorkspace(self._last_token))

    def render_picture(
        self, kind: messages.PictureKind, white: bool, callback: Callable[[bytes], None]
    ) -> None:
        """Render all blocks of the shown tab as an image.

        Args:
            kind: "png" or "svg".
            white: True for a white background, False for a transparent one.
            callback: Called exactly once with the image; with b"" if there are no blocks, or if the editor's
                page isn't loaded.
        """
        if not self._is_page_ready:
            callback(b"")
            return
        self._last_token += 1
        self._picture_callbacks[self._last_token] = callback
        self._bridge.send(messages.RenderPicture(self._last_token, kind, white))

    def render_pdf(
        self, title: str, date: str, layout: QPageLayout, callback: Callable[[bytes], None]
    ) -> None:
        """Render all blocks of the shown tab as a PDF with title and date on each page.

        Args:
            title: Title.
            date: Formatted date.
            layout: Page size and margins.
            callback: Called exactly once with the PDF; with b"" if there are no blocks, or if the editor's
                page isn't loaded.
        """
        if not self._is_page_ready:
            callback(b"")
            return
        self._last_token += 1
        token = self._last_token

        def on_pdf_rendered(data: QByteArray) -> None:
            self._send(messages.RunCommand("clearPages"))
            pdf_callback = self._picture_callbacks.pop(token, None)
            if pdf_callback is not None:
                pdf_callback(bytes(data.data()))

        def on_pages_laid_out(pages: bytes) -> None:
            if not pages or self.web is None:
                callback(b"")
                return
            # kept until the PDF is created, as the page may die meanwhile
            self._picture_callbacks[token] = callback
            layout_without_margins = QPageLayout(layout.pageSize(), layout.orientation(), QMarginsF())
            self.web.page.printToPdf(on_pdf_rendered, layout_without_margins)

        paper = layout.fullRect(QPageLayout.Unit.Inch)
        margin = max(_MIN_MARGIN_INCH, *_margins(layout))
        size = (inches * _PIXELS_PER_INCH for inches in (paper.width(), paper.height(), margin))
        self._picture_callbacks[token] = on_pages_laid_out
        self._bridge.send(messages.LayOutPages(token, title, date, *size))

    def set_toolbox_pinned(self, is_pinned: bool | None) -> None:
        """Set whether the flyout stays open after a block was dragged out of it.

        Args:
            is_pinned: True to keep the flyout open, False to close it, None to decide by the available space.
        """
        self._is_pinned = is_pinned
        self._send(messages.PinFlyout(is_pinned))

    def set_definitions(self, definitions: Mapping[str, object]) -> None:
        """Set the block definitions (see `editor_definitions`). Equal definitions are ignored.

        The blocks, their undo stack and the open category are preserved. The change is deferred while a block
        is dragged.
        """
        if definitions != self._definitions.definitions:
            self._definitions = messages.SetDefinitions(dict(definitions))
            self._send(self._definitions)

    # -- state of the shown tab's blocks ----------------------------------------------------------

    def highlight(self, ids: Sequence[str]) -> None:
        """Highlight the blocks with these ids and no others. Fast enough for 30 calls per second."""
        self._set_state(messages.HighlightBlocks(tuple(ids)))

    def mark_stopped(self, ids: Sequence[str]) -> None:
        """Outline the blocks with these ids, at which the program stopped."""
        self._set_state(messages.MarkStopped(tuple(ids)))

    def set_errors(self, errors: Mapping[str, str]) -> None:
        """Set the errors shown at blocks, as messages by block id."""
        self._set_state(messages.SetBlockErrors(dict(errors)))

    def set_warnings(self, warnings: Mapping[str, str]) -> None:
        """Set the warnings shown at blocks, as messages by block id."""
        self._set_state(messages.SetBlockWarnings(dict(warnings)))

    def show_value(self, id: str, text: str) -> None:
        """Show a value at a block until the next click.

        Args:
            id: Id of a block on the canvas or in the flyout.
            text: Value as text.
        """
        self._send(messages.ShowValue(id, text))

    def set_absent(self, ids: Sequence[str]) -> None:
        """Dim the blocks with these ids, because their robot is not connected."""
        self._set_state(messages.SetAbsent(tuple(ids)))

    def set_live_values(self, values: Mapping[str, str], stale_keys: Collection[str] = ()) -> None:
        """Set the displayed values of sensor blocks. This is not an edit of the behaviour.

        Args:
            values: Formatted values by block id or by ``<robot>/<property>[/<field>]``.
            stale_keys: Keys of stale values, which are dimmed.
        """
        live_values = messages.SetLiveValues(dict(values), tuple(sorted(stale_keys)))
        if live_values != self._live_values:
            self._live_values = live_values
            self._send(live_values)

    def set_variable_values(self, values: Mapping[str, VariableValue]) -> None:
        """Set the displayed values of variables, by id."""
        if values != self._variable_values.values:
            self._variable_values = messages.SetVariableValues(dict(values))
            self._send(self._variable_values)

    def edit_variable(self, edit: Mapping[str, object]) -> None:
        """Edit a variable, or change its display.

        Args:
            edit: Operation such as ``{"do": "new" | "rename" | "delete" | "watch" | "show", …}``.
        """
        self._send(messages.EditVariable(convert(dict(edit), messages.VariableEdit)))

    def set_alarms(self, alarms: Mapping[str, tuple[str, str]]) -> None:
        """Set the problems of robots shown in the toolbox.

        Args:
            alarms: Pairs of status (colour of the dot) and message by robot name. The dots of other robots
                show whether the robot is connected.
        """
        message = messages.SetAlarms(
            {name: messages.RobotAlarm(status, text) for name, (status, text) in alarms.items()}
        )
        if message != self._alarms:
            self._alarms = message
            self._send(message)

    def set_backpack(self, items: Sequence[messages.BackpackItem]) -> None:
        """Set the contents of the backpack, newest first."""
        self._backpack = messages.SetBackpack(tuple(items))
        self._send(self._backpack)

    def set_canvas_hint(self, label: str, has_robot: bool) -> None:
        """Set the hint on the empty canvas, which suggests dragging a first block there.

        Args:
            label: Label of the suggested block, such as “when started”.
            has_robot: True if a robot is connected.
        """
        hint = messages.SetCanvasHint(label, has_robot)
        if hint != self._canvas_hint:
            self._canvas_hint = hint
            self._send(hint)

    def point_at(self, block: str, name: str = "", placement_hint: str = "") -> None:
        """Highlight the category of a block type and then its block, until such a block is added.

        Args:
            block: Type of the block; "" ends the highlighting.
            name: Label of the block.
            placement_hint: Hint where to put the block.
        """
        message = messages.PointAt(messages.PointerTarget(block, name, placement_hint) if block else None)
        self._pending_hint = None if self._is_page_ready else message
        self._send(message)

    # -- commands ---------------------------------------------------------------------------------

    def undo(self) -> None:
        """Undo the last edit in the shown tab."""
        self._send(messages.RunCommand("undo"))

    def undo_deletion(self) -> None:
        """Restore the most recently deleted blocks, even if other edits followed."""
        self._send(messages.RunCommand("undoDeletion"))

    def move_dragged_blocks(self) -> None:
        """Move the most recently dragged blocks from their tab into the shown one."""
        self._send(messages.RunCommand("dropBlocks"))

    def undo_block_move(self) -> None:
        """Undo the last `move_dragged_blocks` in both tabs."""
        self._send(messages.RunCommand("undoDrop"))

    def redo(self) -> None:
        """Redo the most recently undone edit in the shown tab."""
        self._send(messages.RunCommand("redo"))

    def edit(self, command: messages.EditCommand) -> None:
        """Apply an editing command to the selected block and focus the page.

        Has no effect if the page already has the focus, because the page has handled the key itself.

        Args:
            command: "copy", "cut", "paste" or "duplicate".
        """
        if self.web is not None and not self._has_focus():
            self.setFocus()
            self._send(messages.EditSelection(command))

    def edit_from_menu(self, command: messages.EditCommand) -> None:
        """Apply an editing command to the page's focused text field, or to the selected block.

        Args:
            command: "cut", "copy", "paste" or "selectAll".
        """
        if self.web is None:
            return
        page = self.web.page

        def apply_edit(is_text_field: object) -> None:
            if is_text_field:
                page.triggerAction(page.WebAction[PAGE_EDIT_ACTIONS[command]])
            else:
                self.setFocus()
                self._send(messages.EditSelection(command))

        page.runJavaScript(IS_TEXT_FIELD_FOCUSED_JS, apply_edit)

    def _has_focus(self) -> bool:
        focus = QApplication.focusWidget()
        return focus is not None and self.isAncestorOf(focus)

    def zoom_in(self) -> None:
        """Zoom in by one step."""
        self._send(messages.Zoom(1))

    def zoom_out(self) -> None:
        """Zoom out by one step."""
        self._send(messages.Zoom(-1))

    def zoom_to_fit(self) -> None:
        """Zoom and scroll so that all blocks are visible."""
        self._send(messages.RunCommand("fit"))

    def open_find(self) -> None:
        """Open the find bar for blocks of the shown tab."""
        self._request_field("find")

    def open_search(self) -> None:
        """Focus the search field of the toolbox."""
        self._request_field("search")

    def show_help(self) -> None:
        """Show the help of the focused block, if there is one."""
        self._send(messages.RunCommand("help"))

    def show_block(self, id: str) -> None:
        """Scroll to a block and select it."""
        self._send(messages.RevealBlock(id))

    # -- page -------------------------------------------------------------------------------------

    def to_screen(self, position: messages.PagePosition) -> QPoint:
        """Convert a position from the page to a position on the screen."""
        zoom = self.web.view.zoomFactor() if self.web is not None else 1.0
        view = self.web.view if self.web is not None else self
        return view.mapToGlobal(QPoint(round(position.x * zoom), round(position.y * zoom)))

    def _on_page_loaded(self) -> None:
        self._send(self._definitions)
        self._send(self._alarms)
        if self._canvas_hint is not None:
            self._send(self._canvas_hint)
        self._send(self._backpack)
        self._tabs.mark_unloaded()
        self._send_tab()
        hint, self._pending_hint = self._pending_hint, None
        if hint is not None:
            self._send(hint)

    def _on_page_lost(self) -> None:
        picture_callbacks, self._picture_callbacks = self._picture_callbacks, {}
        for picture_callback in picture_callbacks.values():
            picture_callback(b"")
        flush_callbacks, self._flush_callbacks = self._flush_callbacks, {}
        for flush_callback in flush_callbacks.values():
            flush_callback(self._tabs.shown_tab.workspace)
        self.message_received.emit(messages.HistoryChanged(can_undo=False, can_redo=False))
        self.message_received.emit(messages.SensorsShown(()))
        self.message_received.emit(messages.VariablesWatched(()))

    def _send_tab(self) -> None:
        # Sends the blocks if the page doesn't have them, and their states.
        if not self._is_page_ready:
            return
        tab = self._tabs.shown_tab
        self._bridge.send(
            messages.ShowTab(
                tab.key, None if tab.is_loaded else messages.TabContent(tab.generation, tab.workspace.blocks)
            )
        )
        tab.is_loaded = True
        for state in tab.states.values():
            self._bridge.send(state)
        self._bridge.send(self._live_values)
        self._bridge.send(self._variable_values)

    def _set_state(self, state: messages.BlockState) -> None:
        states = self._tabs.shown_tab.states
        if states.get(type(state)) != state:
            states[type(state)] = state
            self._send(state)

    def _receive(self, message: messages.PageMessage) -> None:
        match message:
            case messages.WorkspaceEdited():
                tab = self._tabs.tab_for_edit(message.key, message.generation)
                if tab is not None:
                    tab.workspace = message.workspace
                    self.changed.emit(tab.key, tab.workspace)
            case messages.WorkspaceFlushed():
                flush_callback = self._flush_callbacks.pop(message.token, None)
                if flush_callback is not None:
                    flush_callback(message.workspace)
            case messages.PngRendered():
                self._on_picture_rendered(message.token, message.png)
            case messages.SvgRendered():
                self._on_picture_rendered(message.token, message.svg.encode(errors="replace"))
            case messages.PagesLaidOut():
                self._on_picture_rendered(message.token, b"pages" if message.count else b"")
            case _:
                if isinstance(message, messages.HostMessage):
                    self._on_host_message(message)
                else:
                    self._pass_on(message)

    def _pass_on(self, message: messages.PanelMessage) -> None:
        if isinstance(message, messages.FlyoutPinned):
            self._is_pinned = message.is_pinned
        self.message_received.emit(message)

    def _on_picture_rendered(self, token: int, picture: bytes) -> None:
        callback = self._picture_callbacks.pop(token, None)
        if callback is not None:
            callback(picture)


def _margins(layout: QPageLayout) -> tuple[float, float, float, float]:
    # Printer margins in inches.
    margins = layout.margins(QPageLayout.Unit.Inch)
    return margins.left(), margins.top(), margins.right(), margins.bottom()
