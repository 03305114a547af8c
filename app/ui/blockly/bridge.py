"""What the window and the page of the block editor say to each other, over one QWebChannel.

One pipe in each direction, so that what was said first arrives first.
"""

from __future__ import annotations

from collections.abc import Callable

from PySide6.QtCore import QObject, Signal, Slot
from PySide6.QtGui import QGuiApplication

from app.core.storage import deep_json

Json = dict[str, object]
COPIED = '{"nepStudio":'
"""How copied blocks begin (`clipboard.ts`)."""
MOST_COPIED = 5_000_000


class BlocklyBridge(QObject):
    """The object ``bridge`` of the page. Slots are called by the page, signals tell the view."""

    told = Signal(str, str)  # to the page: a command and its JSON
    came_up = Signal()
    edited = Signal(str, int, str)  # a tab's key, generation of the program loaded there, workspace as JSON
    undo_changed = Signal(bool, bool)
    block_chosen = Signal(str)
    answered = Signal(int, str)  # token of a flush, workspace as JSON
    went_wrong = Signal(str)
    field_opened = Signal()  # the field that was asked for has the keys
    try_asked = Signal(str)  # a stack to be tried, as JSON
    block_focused = Signal(bool)  # whether the keys go to a block
    command_wanted = Signal(str)  # a command of the window about variables or the picture of the blocks
    drawn = Signal(int, str)  # token of a picture, the picture; "" for none
    values_watched = Signal(str)  # the variables whose values the page shows, as JSON: [id, …]
    sensors_offered = Signal(str)  # the sensors in the open toolbox as JSON: [[robot, sensor], …]
    wanted = Signal(str)  # what a button of the empty canvas is for: "robot", "examples"
    pinned = Signal(bool)  # a person wants the blocks of a category to stay open, or not
    removed = Signal(int)  # a person has deleted so many blocks at once
    # something of that tab is outside of the page, at x, y; False: not any more
    carried_out = Signal(int, int, bool, str)
    carried_seen = Signal(str, float)  # how that looks: a PNG as `data:`, so many pixels in one of the page
    let_go_outside = Signal(int, int)  # and was let go there
    # so many blocks are in this tab now: "moved", "copied", "added"; from which tab
    carried_over = Signal(int, str, str)
    backpack_asked = Signal(str)  # what is to be done with the backpack, as JSON (`backpack.ts`)

    def __init__(self, begin: Callable[[], Json], parent: QObject | None = None) -> None:
        super().__init__(parent)
        self._begin = begin

    def tell(self, command: str, payload: object) -> None:
        """Send one command; the page answers nothing by itself."""
        self.told.emit(command, deep_json.dumps(payload, ascii=True))

    @Slot(result=str)
    def beginning(self) -> str:
        """What the page needs before its first picture: theme, language, motion."""
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
        """Put copied blocks on the computer's clipboard, as text."""
        QGuiApplication.clipboard().setText(blocks)

    @Slot(result=str)
    def copied(self) -> str:
        """The copied blocks on the computer's clipboard; "" for all else, which is not the page's to read."""
        text = QGuiApplication.clipboard().text()
        return text if text.startswith(COPIED) and len(text) <= MOST_COPIED else ""

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
