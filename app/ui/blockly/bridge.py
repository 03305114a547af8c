"""Messages between the window and the page of the block editor over a QWebChannel.

The channel delivers messages in order in each direction.
"""

from __future__ import annotations

from collections.abc import Callable

from PySide6.QtCore import QObject, Signal, Slot
from PySide6.QtGui import QGuiApplication

from app.blocks.model import deep_json

Json = dict[str, object]
CLIPBOARD_PREFIX = '{"nepStudio":'
"""Prefix of the clipboard's text if it contains copied blocks; the same as in `clipboard.ts`."""
MAX_CLIPBOARD_CHARS = 5_000_000


class BlocklyBridge(QObject):
    """Object that the page accesses as ``bridge``: the page calls the slots, and the signals notify the view.

    Args:
        initial_settings: Returns the settings for the slot `initial_settings`.
    """

    command_sent = Signal(str, str)  # to the page: a command and its JSON
    page_ready = Signal()
    edited = Signal(str, int, str)  # a tab's key, generation of its workspace, workspace as JSON
    undo_changed = Signal(bool, bool)
    block_selected = Signal(str)
    workspace_flushed = Signal(int, str)  # token of a flush, workspace as JSON
    error_reported = Signal(str)
    field_opened = Signal()  # field requested by a command has the focus
    try_requested = Signal(str)  # script to try, as JSON
    block_focused = Signal(bool)  # True if a block has the focus
    command_requested = Signal(str)  # id of a window command, for variables or the picture of the blocks
    picture_rendered = Signal(int, str)  # token of a picture, the picture as text; "" if there are no blocks
    watched_variables_changed = Signal(str)  # ids of the variables whose values the page shows, as JSON list
    visible_sensors_changed = Signal(str)  # sensors in the open toolbox as JSON: [[robot, sensor], …]
    canvas_button_pressed = Signal(
        str
    )  # name of the pressed button of the empty canvas: "robot" or "examples"
    flyout_pinned = Signal(bool)  # True if the flyout stays open after a block was dragged out of it
    blocks_deleted = Signal(int)  # number of blocks that the user deleted at once
    # True with x, y while blocks of this tab are dragged outside the page; False when they return
    blocks_dragged_outside = Signal(int, int, bool, str)
    # picture of the dragged blocks: a PNG as `data:` URL, and its device pixels per page pixel
    drag_picture_rendered = Signal(str, float)
    blocks_dropped_outside = Signal(int, int)  # position where the blocks were dropped outside the page
    # number of blocks transferred to this tab, "moved", "copied" or "added", and key of their former tab
    blocks_transferred = Signal(int, str, str)
    backpack_requested = Signal(str)  # backpack operation as JSON (`backpack.ts`)

    def __init__(self, initial_settings: Callable[[], Json], parent: QObject | None = None) -> None:
        super().__init__(parent)
        self._initial_settings = initial_settings

    def send_command(self, command: str, payload: object) -> None:
        """Send a command with a JSON payload to the page, which sends no reply."""
        self.command_sent.emit(command, deep_json.dumps(payload, ascii=True))

    @Slot(result=str)
    def initial_settings(self) -> str:
        """Return theme, language and motion settings as JSON, which the page needs before its first paint."""
        return deep_json.dumps(self._initial_settings(), ascii=True)

    @Slot()
    def ready(self) -> None:
        self.page_ready.emit()

    @Slot(str, int, str)
    def changed(self, key: str, generation: int, workspace: str) -> None:
        self.edited.emit(key, generation, workspace)

    @Slot(bool, bool)
    def history(self, can_undo: bool, can_redo: bool) -> None:
        self.undo_changed.emit(can_undo, can_redo)

    @Slot(str)
    def selected(self, block: str) -> None:
        self.block_selected.emit(block)

    @Slot(int, str)
    def flushed(self, token: int, workspace: str) -> None:
        self.workspace_flushed.emit(token, workspace)

    @Slot(int, str)
    def pictured(self, token: int, data: str) -> None:
        self.picture_rendered.emit(token, data)

    @Slot(str)
    def try_stack(self, stack: str) -> None:
        self.try_requested.emit(stack)

    @Slot()
    def opened(self) -> None:
        self.field_opened.emit()

    @Slot(bool)
    def on_block(self, is_focused: bool) -> None:
        self.block_focused.emit(is_focused)

    @Slot(str)
    def show_sensors(self, sensors: str) -> None:
        self.visible_sensors_changed.emit(sensors)

    @Slot(bool)
    def pin(self, is_pinned: bool) -> None:
        self.flyout_pinned.emit(is_pinned)

    @Slot(int)
    def deleted(self, count: int) -> None:
        self.blocks_deleted.emit(count)

    @Slot(int, int, bool, str)
    def drag_outside(self, x: int, y: int, is_outside: bool, tab: str) -> None:
        self.blocks_dragged_outside.emit(x, y, is_outside, tab)

    @Slot(str, float)
    def drag_picture(self, data: str, ratio: float) -> None:
        self.drag_picture_rendered.emit(data, ratio)

    @Slot(int, int)
    def dropped(self, x: int, y: int) -> None:
        self.blocks_dropped_outside.emit(x, y)

    @Slot(int, str, str)
    def transferred(self, count: int, mode: str, source_tab: str) -> None:
        self.blocks_transferred.emit(count, mode, source_tab)

    @Slot(str)
    def backpack(self, operation: str) -> None:
        self.backpack_requested.emit(operation)

    @Slot(str)
    def copy(self, blocks: str) -> None:
        """Copy serialized blocks to the system clipboard as text."""
        QGuiApplication.clipboard().setText(blocks)

    @Slot(result=str)
    def copied(self) -> str:
        """Return the serialized blocks on the system clipboard; "" if it contains anything else.

        The page must not read other contents of the clipboard.
        """
        text = QGuiApplication.clipboard().text()
        return text if text.startswith(CLIPBOARD_PREFIX) and len(text) <= MAX_CLIPBOARD_CHARS else ""

    @Slot(str)
    def command(self, name: str) -> None:
        if name.startswith(("variable.", "picture.", "print.")):
            self.command_requested.emit(name)

    @Slot(str)
    def watch_variables(self, variables: str) -> None:
        self.watched_variables_changed.emit(variables)

    @Slot(str)
    def press_canvas_button(self, button: str) -> None:
        self.canvas_button_pressed.emit(button)

    @Slot(str)
    def failed(self, message: str) -> None:
        self.error_reported.emit(message)
