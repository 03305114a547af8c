"""Block editor widget.

The view always stores the latest blocks of each tab. The page is loaded on the first show; if its process
dies, the view sends the complete state to a new page.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence

from PySide6.QtCore import QByteArray, QMarginsF, QPoint, Signal
from PySide6.QtGui import QPageLayout
from PySide6.QtWidgets import QApplication, QWidget

from app.blocks.model.workspace_json import WorkspaceJson
from app.ui.blockly.bridge import Json
from app.ui.blockly.host import BlocklyHost
from app.ui.blockly.page_json import decode_data_url, parse_string_pairs, parse_strings
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
    history_changed = Signal(bool, bool)  # can undo, can redo; in the shown tab
    block_selected = Signal(str)  # id of the selected block; "" if none is selected
    canvas_button_pressed = Signal(
        str
    )  # name of the pressed button of the empty canvas: "robot" or "examples"
    try_requested = Signal(str)  # script to try, as JSON (`app.blocks.model.stack`)
    visible_sensors_changed = Signal(tuple)  # (robot, sensor) of each sensor block in the open flyout
    command_requested = Signal(str)  # id of a window command such as "variable.rename:ID"
    watched_variables_changed = Signal(tuple)  # ids of the variables whose values the page shows
    toolbox_pinned = Signal(bool)  # True if the flyout stays open after a block was dragged out of it
    blocks_deleted = Signal(int)  # number of blocks deleted at once in the shown tab
    # position on the screen (QPoint) while blocks of that tab are dragged outside the page, None when they
    # return
    blocks_dragged_outside = Signal(object, str)
    # picture of the dragged blocks: a PNG, and its device pixels per screen pixel
    drag_picture_rendered = Signal(bytes, float)
    # position where blocks were dropped outside the page; without `move_dragged_blocks` they return to
    # their place
    blocks_dropped_outside = Signal(QPoint)
    # number of blocks transferred to the shown tab, "moved", "copied" or "added", and key of their former tab
    blocks_transferred = Signal(int, str, str)
    backpack_requested = Signal(str)  # backpack operation as JSON: `BackpackController`

    def __init__(self, parent: QWidget | None = None, *, language: str = "") -> None:
        super().__init__(parent, language or i18n.language())
        self._tabs = Tabs()
        self._definitions: Json = {"blocks": [], "toolbox": {"kind": "categoryToolbox", "contents": []}}
        self._live_values: Json = {"values": {}, "old": []}
        self._alarms: Json = {}
        self._variable_values: Json = {}
        self._canvas_hint: Json | None = None
        self._backpack: list[Json] = []
        self._pending_hint: Json | None = None  # pending highlight for a page that is not loaded yet
        self._flush_callbacks: dict[int, Callable[[WorkspaceJson], None]] = {}
        self._picture_callbacks: dict[int, Callable[[bytes], None]] = {}
        self._last_token = 0
        self._bridge.edited.connect(self._on_edited)
        self._bridge.undo_changed.connect(self.history_changed)
        self._bridge.block_selected.connect(self.block_selected)
        self._bridge.workspace_flushed.connect(self._on_workspace_flushed)
        self._bridge.picture_rendered.connect(self._on_picture_rendered)
        self._bridge.command_requested.connect(self.command_requested)
        self._bridge.watched_variables_changed.connect(
            lambda text: self.watched_variables_changed.emit(parse_strings(text))
        )
        self._bridge.canvas_button_pressed.connect(self.canvas_button_pressed)
        self._bridge.try_requested.connect(self.try_requested)
        self._bridge.flyout_pinned.connect(self._on_flyout_pinned)
        self._bridge.blocks_deleted.connect(self.blocks_deleted)
        self._bridge.blocks_dragged_outside.connect(
            lambda x, y, is_outside, tab: self.blocks_dragged_outside.emit(
                self._to_screen(x, y) if is_outside else None, tab
            )
        )
        self._bridge.drag_picture_rendered.connect(
            lambda data, ratio: self.drag_picture_rendered.emit(decode_data_url(data), ratio)
        )
        self._bridge.blocks_dropped_outside.connect(
            lambda x, y: self.blocks_dropped_outside.emit(self._to_screen(x, y))
        )
        self._bridge.blocks_transferred.connect(self.blocks_transferred)
        self._bridge.backpack_requested.connect(self.backpack_requested)
        self._bridge.visible_sensors_changed.connect(
            lambda text: self.visible_sensors_changed.emit(parse_string_pairs(text))
        )

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
            self._send_command("close", evicted)

    def close_tab(self, key: str) -> None:
        """Close a tab and discard its undo stack. An empty behaviour replaces the shown tab."""
        was_shown = key == self._tabs.shown_tab.key
        if self._tabs.close(key):
            if was_shown:
                self._send_tab()
            self._send_command("close", key)

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
        self._send_command("change", workspace)

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
        self._bridge.send_command("flush", self._last_token)

    def render_picture(self, kind: str, white: bool, callback: Callable[[bytes], None]) -> None:
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
        self._bridge.send_command("picture", {"token": self._last_token, "kind": kind, "white": white})

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
            self._send_command("printed", None)
            pdf_callback = self._picture_callbacks.pop(token, None)
            if pdf_callback is not None:
                pdf_callback(bytes(data.data()))

        def on_pages_laid_out(count: bytes) -> None:
            if not count or self.web is None:
                callback(b"")
                return
            # kept until the PDF is created, as the page may die meanwhile
            self._picture_callbacks[token] = callback
            layout_without_margins = QPageLayout(layout.pageSize(), layout.orientation(), QMarginsF())
            self.web.page.printToPdf(on_pdf_rendered, layout_without_margins)

        paper = layout.fullRect(QPageLayout.Unit.Inch)
        margin = max(_MIN_MARGIN_INCH, *_margins(layout))
        lengths_inch = {"width": paper.width(), "height": paper.height(), "edge": margin}
        self._picture_callbacks[token] = on_pages_laid_out
        settings: Json = {name: inches * _PIXELS_PER_INCH for name, inches in lengths_inch.items()}
        self._bridge.send_command("pages", {"token": token, "title": title, "date": date, **settings})

    def set_toolbox_pinned(self, is_pinned: bool | None) -> None:
        """Set whether the flyout stays open after a block was dragged out of it.

        Args:
            is_pinned: True to keep the flyout open, False to close it, None to decide by the available space.
        """
        self._is_pinned = is_pinned
        self._send_command("pin", is_pinned)

    def set_definitions(self, definitions: Mapping[str, object]) -> None:
        """Set the block definitions (see `editor_definitions`). Equal definitions are ignored.

        The blocks, their undo stack and the open category are preserved. The change is deferred while a block
        is dragged.
        """
        if definitions == self._definitions:
            return
        self._definitions = dict(definitions)
        self._send_command("definitions", self._definitions)

    # -- state of the shown tab's blocks ----------------------------------------------------------

    def highlight(self, ids: Sequence[str]) -> None:
        """Highlight the blocks with these ids and no others. Fast enough for 30 calls per second."""
        self._set_state("highlight", list(ids))

    def mark_stopped(self, ids: Sequence[str]) -> None:
        """Outline the blocks with these ids, at which the program stopped."""
        self._set_state("stopped", list(ids))

    def set_errors(self, errors: Mapping[str, str]) -> None:
        """Set the errors shown at blocks, as messages by block id."""
        self._set_state("errors", dict(errors))

    def set_warnings(self, warnings: Mapping[str, str]) -> None:
        """Set the warnings shown at blocks, as messages by block id."""
        self._set_state("warnings", dict(warnings))

    def show_value(self, id: str, text: str) -> None:
        """Show a value at a block until the next click.

        Args:
            id: Id of a block on the canvas or in the flyout.
            text: Value as text.
        """
        self._send_command("value", [id, text])

    def set_absent(self, ids: Sequence[str]) -> None:
        """Dim the blocks with these ids, because their robot is not connected."""
        self._set_state("absent", list(ids))

    def set_live_values(self, values: Mapping[str, str], stale_keys: Collection[str] = ()) -> None:
        """Set the displayed values of sensor blocks. This is not an edit of the behaviour.

        Args:
            values: Formatted values by block id or by ``<robot>/<property>[/<field>]``.
            stale_keys: Keys of stale values, which are dimmed.
        """
        live_values: Json = {"values": dict(values), "old": sorted(stale_keys)}
        if live_values != self._live_values:
            self._live_values = live_values
            self._send_command("live", self._live_values)

    def set_variable_values(self, values: Mapping[str, Mapping[str, object]]) -> None:
        """Set the displayed values of variables, as results of `VariableValue.to_json` by id."""
        if values != self._variable_values:
            self._variable_values = dict(values)
            self._send_command("values", self._variable_values)

    def edit_variable(self, edit: Mapping[str, object]) -> None:
        """Edit a variable, or change its display.

        Args:
            edit: Operation such as ``{"do": "new" | "rename" | "delete" | "watch" | "show", …}``.
        """
        self._send_command("variable", dict(edit))

    def set_alarms(self, alarms: Mapping[str, tuple[str, str]]) -> None:
        """Set the problems of robots shown in the toolbox.

        Args:
            alarms: Pairs of status (colour of the dot) and message by robot name. The dots of other robots
                show whether the robot is connected.
        """
        states: Json = {
            name: {"status": status, "words": message} for name, (status, message) in alarms.items()
        }
        if states != self._alarms:
            self._alarms = states
            self._send_command("alarms", states)

    def set_backpack(self, items: Sequence[Mapping[str, object]]) -> None:
        """Set the contents of the backpack.

        Args:
            items: Mappings with ``id``, ``at`` and ``block``, newest first.
        """
        self._backpack = [dict(item) for item in items]
        self._send_command("backpack", self._backpack)

    def set_canvas_hint(self, label: str, has_robot: bool) -> None:
        """Set the hint on the empty canvas, which suggests dragging a first block there.

        Args:
            label: Label of the suggested block, such as “when started”.
            has_robot: True if a robot is connected.
        """
        state: Json = {"first": label, "robot": has_robot}
        if state != self._canvas_hint:
            self._canvas_hint = state
            self._send_command("begin", state)

    def point_at(self, block: str, name: str = "", placement_hint: str = "") -> None:
        """Highlight the category of a block type and then its block, until such a block is added.

        Args:
            block: Type of the block; "" ends the highlighting.
            name: Label of the block.
            placement_hint: Hint where to put the block.
        """
        target: Json | None = {"block": block, "name": name, "then": placement_hint} if block else None
        self._pending_hint = None if self._is_page_ready else target
        self._send_command("point", target)

    # -- commands ---------------------------------------------------------------------------------

    def undo(self) -> None:
        """Undo the last edit in the shown tab."""
        self._send_command("undo", None)

    def undo_deletion(self) -> None:
        """Restore the most recently deleted blocks, even if other edits followed."""
        self._send_command("undelete", None)

    def move_dragged_blocks(self) -> None:
        """Move the most recently dragged blocks from their tab into the shown one."""
        self._send_command("bring", None)

    def undo_block_move(self) -> None:
        """Undo the last `move_dragged_blocks` in both tabs."""
        self._send_command("giveBack", None)

    def redo(self) -> None:
        """Redo the most recently undone edit in the shown tab."""
        self._send_command("redo", None)

    def edit(self, command: str) -> None:
        """Apply an editing command to the selected block and focus the page.

        Has no effect if the page already has the focus, because the page has handled the key itself.

        Args:
            command: "copy", "cut", "paste" or "duplicate".
        """
        if self.web is not None and not self._has_focus():
            self.setFocus()
            self._send_command("edit", command)

    def edit_from_menu(self, command: str) -> None:
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
                self._send_command("edit", command)

        page.runJavaScript(IS_TEXT_FIELD_FOCUSED_JS, apply_edit)

    def _has_focus(self) -> bool:
        focus = QApplication.focusWidget()
        return focus is not None and self.isAncestorOf(focus)

    def zoom_in(self) -> None:
        """Zoom in by one step."""
        self._send_command("zoom", 1)

    def zoom_out(self) -> None:
        """Zoom out by one step."""
        self._send_command("zoom", -1)

    def zoom_to_fit(self) -> None:
        """Zoom and scroll so that all blocks are visible."""
        self._send_command("fit", None)

    def open_find(self) -> None:
        """Open the find bar for blocks of the shown tab."""
        self._request_field("find")

    def open_search(self) -> None:
        """Focus the search field of the toolbox."""
        self._request_field("search")

    def show_help(self) -> None:
        """Show the help of the focused block, if there is one."""
        self._send_command("help", None)

    def show_block(self, id: str) -> None:
        """Scroll to a block and select it."""
        self._send_command("show", id)

    # -- page -------------------------------------------------------------------------------------

    def _on_flyout_pinned(self, is_pinned: bool) -> None:
        self._is_pinned = is_pinned
        self.toolbox_pinned.emit(is_pinned)

    def _to_screen(self, x: int, y: int) -> QPoint:
        # The position may be outside the page.
        zoom = self.web.view.zoomFactor() if self.web is not None else 1.0
        view = self.web.view if self.web is not None else self
        return view.mapToGlobal(QPoint(round(x * zoom), round(y * zoom)))

    def _on_page_loaded(self) -> None:
        self._send_command("definitions", self._definitions)
        self._send_command("alarms", self._alarms)
        self._send_command("begin", self._canvas_hint)
        self._send_command("backpack", self._backpack)
        self._tabs.mark_unloaded()
        self._send_tab()
        hint, self._pending_hint = self._pending_hint, None
        if hint is not None:
            self._send_command("point", hint)

    def _on_page_lost(self) -> None:
        picture_callbacks, self._picture_callbacks = self._picture_callbacks, {}
        for picture_callback in picture_callbacks.values():
            picture_callback(b"")
        flush_callbacks, self._flush_callbacks = self._flush_callbacks, {}
        for flush_callback in flush_callbacks.values():
            flush_callback(self._tabs.shown_tab.workspace)
        self.history_changed.emit(False, False)
        self.visible_sensors_changed.emit(())
        self.watched_variables_changed.emit(())

    def _send_tab(self) -> None:
        # Sends the blocks if the page doesn't have them, and their states.
        if not self._is_page_ready:
            return
        tab = self._tabs.shown_tab
        payload: Json = {"key": tab.key}
        if not tab.is_loaded:
            payload |= {"generation": tab.generation, "workspace": tab.workspace.blocks}
            tab.is_loaded = True
        self._bridge.send_command("tab", payload)
        for name, value in tab.states.items():
            self._bridge.send_command(name, value)
        self._bridge.send_command("live", self._live_values)
        self._bridge.send_command("values", self._variable_values)

    def _set_state(self, name: str, value: object) -> None:
        states = self._tabs.shown_tab.states
        if states.get(name) != value:
            states[name] = value
            self._send_command(name, value)

    def _on_edited(self, key: str, generation: int, workspace: str) -> None:
        tab = self._tabs.tab_for_edit(key, generation)
        if tab is not None:
            tab.workspace = WorkspaceJson(workspace)
            self.changed.emit(key, tab.workspace)

    def _on_picture_rendered(self, token: int, data: str) -> None:
        callback = self._picture_callbacks.pop(token, None)
        if callback is not None:
            callback(decode_data_url(data) if data.startswith("data:") else data.encode())

    def _on_workspace_flushed(self, token: int, workspace: str) -> None:
        callback = self._flush_callbacks.pop(token, None)
        if callback is not None:
            callback(WorkspaceJson(workspace))


def _margins(layout: QPageLayout) -> tuple[float, float, float, float]:
    # Printer margins in inches.
    margins = layout.margins(QPageLayout.Unit.Inch)
    return margins.left(), margins.top(), margins.right(), margins.bottom()
