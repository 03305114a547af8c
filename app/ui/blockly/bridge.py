"""Messages between the window and the page of the block editor over a QWebChannel.

The channel delivers messages in order in each direction.
"""

from __future__ import annotations

from collections.abc import Callable

from PySide6.QtCore import QObject, Signal, Slot
from PySide6.QtGui import QGuiApplication

from app.core.storage import deep_json

Json = dict[str, object]
COPIED = '{"nepStudio":'
"""Prefix of copied blocks in the clipboard's text (`clipboard.ts`)."""
MAX_COPIED_CHARS = 5_000_000


class BlocklyBridge(QObject):
    """QWebChannel object ``bridge`` of the page. The page calls its slots; its signals notify the view."""

    told = Signal(str, str)  # to the page: a command and its JSON
    came_up = Signal()
    edited = Signal(str, int, str)  # a tab's key, generation of the program loaded there, workspace as JSON
    undo_changed = Signal(bool, bool)
    block_chosen = Signal(str)
    answered = Signal(int, str)  # token of a flush, workspace as JSON
    went_wrong = Signal(str)
    field_opened = Signal()  # field requested by a command has the focus
    try_asked = Signal(str)  # script to try, as JSON
    block_focused = Signal(bool)  # True if a block has the focus
    command_wanted = Signal(str)  # id of a window command, for variables or the picture of the blocks
    drawn = Signal(int, str)  # token of a picture, the picture as text; "" if there are no blocks
    values_watched = Signal(str)  # ids of the variables whose values the page shows, as JSON list
    sensors_offered = Signal(str)  # sensors in the open toolbox as JSON: [[robot, sensor], …]
    wanted = Signal(str)  # name of the pressed button of the empty canvas: "robot" or "examples"
    pinned = Signal(bool)  # True if the flyout stays open after a block was dragged out of it
    removed = Signal(int)  # number of blocks that the user deleted at once
    # True with x, y while blocks of this tab are dragged outside the page; False when they return
    carried_out = Signal(int, int, bool, str)
    # picture of the dragged blocks: a PNG as `data:` URL, and its device pixels per page pixel
    carried_seen = Signal(str, float)
    let_go_outside = Signal(int, int)  # position where the blocks were dropped outside the page
    # number of blocks brought into this tab, "moved", "copied" or "added", and key of their former tab
    carried_over = Signal(int, str, str)
    backpack_asked = Signal(str)  # backpack operation as JSON (`backpack.ts`)

    def __init__(self, begin: Callable[[], Json], parent: QObject | None = None) -> None:
        super().__init__(parent)
        self._begin = begin

    def send_command(self, command: str, payload: object) -> None:
        """Send a command to the page. The page sends no reply."""
        self.told.emit(command, deep_json.dumps(payload, ascii=True))

    @Slot(result=str)
    def beginning(self) -> str:
        """Return the theme, language and motion settings that the page needs before its first paint."""
        return deep_json.dumps(self._begin(), ascii=True)

    @Slot()
    def ready(self) -> None:
        self.came_up.emit()

    @Slot(str, int, str)
    def changed(self, key: str, generation: int, workspace: str) -> None:
        self.edited.emit(key, generation, workspace)

    @Slot(bool, bool)
    def history(self, can_undo: bool, can_redo: bool) -> None:
        self.undo_changed.emit(can_undo, can_redo)

    @Slot(str)
    def selected(self, block: str) -> None:
        self.block_chosen.emit(block)

    @Slot(int, str)
    def flushed(self, token: int, workspace: str) -> None:
        self.answered.emit(token, workspace)

    @Slot(int, str)
    def pictured(self, token: int, data: str) -> None:
        self.drawn.emit(token, data)

    @Slot(str)
    def tries(self, stack: str) -> None:
        self.try_asked.emit(stack)

    @Slot()
    def opened(self) -> None:
        self.field_opened.emit()

    @Slot(bool)
    def on_block(self, has: bool) -> None:
        self.block_focused.emit(has)

    @Slot(str)
    def offers(self, sensors: str) -> None:
        self.sensors_offered.emit(sensors)

    @Slot(bool)
    def pin(self, keeps: bool) -> None:
        self.pinned.emit(keeps)

    @Slot(int)
    def deleted(self, count: int) -> None:
        self.removed.emit(count)

    @Slot(int, int, bool, str)
    def carried(self, x: int, y: int, out: bool, home: str) -> None:
        self.carried_out.emit(x, y, out, home)

    @Slot(str, float)
    def pictureOfCarried(self, data: str, ratio: float) -> None:
        self.carried_seen.emit(data, ratio)

    @Slot(int, int)
    def dropped(self, x: int, y: int) -> None:
        self.let_go_outside.emit(x, y)

    @Slot(int, str, str)
    def brought(self, count: int, how: str, home: str) -> None:
        self.carried_over.emit(count, how, home)

    @Slot(str)
    def backpack(self, what: str) -> None:
        self.backpack_asked.emit(what)

    @Slot(str)
    def copy(self, blocks: str) -> None:
        """Copy serialized blocks to the system clipboard as text."""
        QGuiApplication.clipboard().setText(blocks)

    @Slot(result=str)
    def copied(self) -> str:
        """Return the serialized blocks on the system clipboard.

        Return "" for other contents, which the page must not read.
        """
        text = QGuiApplication.clipboard().text()
        return text if text.startswith(COPIED) and len(text) <= MAX_COPIED_CHARS else ""

    @Slot(str)
    def command(self, name: str) -> None:
        if name.startswith(("variable.", "picture.", "print.")):
            self.command_wanted.emit(name)

    @Slot(str)
    def watches(self, variables: str) -> None:
        self.values_watched.emit(variables)

    @Slot(str)
    def wants(self, what: str) -> None:
        self.wanted.emit(what)

    @Slot(str)
    def failed(self, sentence: str) -> None:
        self.went_wrong.emit(sentence)
