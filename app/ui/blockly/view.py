"""The block editor as a widget.

The view knows the newest program at any time. The page in it may come late (it is made when the view is first
shown) or die (its process can be killed): it is given everything again and the person goes on.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence

from PySide6.QtCore import QByteArray, QMarginsF, QPoint, Signal
from PySide6.QtGui import QPageLayout
from PySide6.QtWidgets import QApplication, QWidget

from app.core.documents.workspace_json import WorkspaceJson
from app.ui.blockly.bridge import Json
from app.ui.blockly.host import BlocklyHost
from app.ui.blockly.page_json import data_url, pairs, texts
from app.ui.blockly.scheme import register_scheme as register_scheme
from app.ui.blockly.tabs import Tabs
from nep import i18n

_PIXELS_PER_INCH = 96.0  # a page's own pixels
_EDGE_INCH = 0.45
PAGE_EDITS = {"cut": "Cut", "copy": "Copy", "paste": "Paste", "selectAll": "SelectAll"}
"""What a page's own fields do, as `QWebEnginePage.WebAction` names it."""
TYPES = "(e => !!e && (e.isContentEditable || /^(INPUT|TEXTAREA)$/.test(e.tagName)))(document.activeElement)"
"""Whether a field of the page has the keys."""


class BlocklyView(BlocklyHost):
    """Shows and edits behaviours, one at a time, each in its tab.

    All methods may be called at any time, also before the first show. Before the first `show_tab` there is
    one behaviour, with the key "".
    """

    changed = Signal(str, object)  # a tab's key and its newest program (WorkspaceJson), 150 ms after an edit
    history_changed = Signal(bool, bool)  # can undo, can redo: of the shown tab
    block_selected = Signal(str)  # a block's id; "" when nothing is selected
    wanted = Signal(str)  # a button of the empty canvas was pressed: "robot", "examples"
    try_asked = Signal(str)  # a stack to be tried at once, as JSON (`app.blocks.compiler.stack`)
    sensors_offered = Signal(tuple)  # (robot, sensor) of each one that the open toolbox shows
    command_wanted = Signal(str)  # a command of the window: "variable.rename:ID"
    values_watched = Signal(tuple)  # the variables (ids) whose values the page shows
    toolbox_pinned = Signal(bool)  # a person wants the blocks of a category to stay open, or not
    blocks_deleted = Signal(int)  # a person has deleted so many blocks at once in the shown tab
    # outside of the page, at this place of the screen (QPoint), from that tab; None: no more
    block_carried = Signal(object, str)
    carried_seen = Signal(bytes, float)  # how that looks: a PNG, and its pixels in one of the screen
    block_dropped = Signal(QPoint)  # it was let go there; unless `bring_blocks` follows it is where it was
    # so many are in the shown tab now: "moved", "copied" or "added"; from which tab
    blocks_brought = Signal(int, str, str)
    backpack_asked = Signal(str)  # what a person wants done with the backpack, as JSON: `BackpackKeeper`

    def __init__(self, parent: QWidget | None = None, *, language: str = "") -> None:
        super().__init__(parent, language or i18n.language())
        self._tabs = Tabs()
        self._definitions: Json = {"blocks": [], "toolbox": {"kind": "categoryToolbox", "contents": []}}
        self._live: Json = {"values": {}, "old": []}
        self._alarms: Json = {}
        self._values: Json = {}
        self._first_step: Json | None = None
        self._backpack: list[Json] = []
        self._pointed: Json | None = None  # what a page that is not there yet is to point at
        self._waiting: dict[int, Callable[[WorkspaceJson], None]] = {}
        self._pictures: dict[int, Callable[[bytes], None]] = {}
        self._tokens = 0
        self._bridge.edited.connect(self._edited)
        self._bridge.undo_changed.connect(self.history_changed)
        self._bridge.block_chosen.connect(self.block_selected)
        self._bridge.answered.connect(self._answered)
        self._bridge.drawn.connect(self._drawn)
        self._bridge.command_wanted.connect(self.command_wanted)
        self._bridge.values_watched.connect(lambda text: self.values_watched.emit(texts(text)))
        self._bridge.wanted.connect(self.wanted)
        self._bridge.try_asked.connect(self.try_asked)
        self._bridge.pinned.connect(self._toolbox_pinned)
        self._bridge.removed.connect(self.blocks_deleted)
        self._bridge.carried_out.connect(
            lambda x, y, out, home: self.block_carried.emit(self._on_screen(x, y) if out else None, home)
        )
        self._bridge.carried_seen.connect(lambda data, ratio: self.carried_seen.emit(data_url(data), ratio))
        self._bridge.let_go_outside.connect(lambda x, y: self.block_dropped.emit(self._on_screen(x, y)))
        self._bridge.carried_over.connect(self.blocks_brought)
        self._bridge.backpack_asked.connect(self.backpack_asked)
        self._bridge.sensors_offered.connect(lambda text: self.sensors_offered.emit(pairs(text)))

    # -- the program ------------------------------------------------------------------------------

    @property
    def workspace(self) -> Mapping[str, object]:
        """The newest program of the shown tab; call `flush` for one without the last 150 ms missing."""
        return self._tabs.shown.program.blocks

    def workspace_of(self, key: str) -> Mapping[str, object] | None:
        """The newest program of a tab; None when there is no such tab."""
        tab = self._tabs[key]
        return tab.program.blocks if tab is not None else None

    def show_tab(self, key: str, workspace: Mapping[str, object]) -> None:
        """Show the behaviour kept under this key, with its own undo, zoom and scroll position.

        The first time it is ``workspace``; afterwards what became of it.
        """
        gone = self._tabs.show(key, WorkspaceJson.of(workspace))
        self._send_tab()
        if gone is not None:
            self._tell("close", gone)

    def close_tab(self, key: str) -> None:
        """Forget a behaviour and its undo. In the place of the shown one there is an empty one then."""
        was_shown = key == self._tabs.shown.key
        if self._tabs.close(key):
            if was_shown:
                self._send_tab()
            self._tell("close", key)

    def load(self, workspace: Mapping[str, object]) -> None:
        """Show another program in the shown tab.

        Forgets its undo; edits of the old one that are still under way are dropped.
        """
        self._tabs.replace(WorkspaceJson.of(workspace))
        self._tabs.shown.in_page = False
        self._send_tab()

    def change(self, workspace: Mapping[str, object]) -> None:
        """Change the shown tab's program as one edit, which undo takes back; `changed` does not tell it."""
        self._tabs.shown.program = WorkspaceJson.of(workspace)
        self._tell("change", workspace)

    def flush(self, done: Callable[[WorkspaceJson], None]) -> None:
        """Ask for the newest program of the shown tab now.

        `done` is called once, also if the page is absent or dies. The other tabs have told their newest when
        they were left.
        """
        if not self._up:
            done(self._tabs.shown.program)
            return
        self._tokens += 1
        self._waiting[self._tokens] = done
        self._bridge.tell("flush", self._tokens)

    def picture(self, kind: str, white: bool, done: Callable[[bytes], None]) -> None:
        """Make a "png" or "svg" of all blocks of the shown tab, on white or on nothing.

        `done` is called once, with b"" when there is nothing to be seen or no page.
        """
        if not self._up:
            done(b"")
            return
        self._tokens += 1
        self._pictures[self._tokens] = done
        self._bridge.tell("picture", {"token": self._tokens, "kind": kind, "white": white})

    def pdf(self, title: str, date: str, layout: QPageLayout, done: Callable[[bytes], None]) -> None:
        """Make a PDF of all blocks of the shown tab on paper of this layout, each page with the title above.

        `done` is called once, with b"" when there is nothing to be seen or no page.
        """
        if not self._up:
            done(b"")
            return
        self._tokens += 1
        token = self._tokens

        def made(data: QByteArray) -> None:
            self._tell("printed", None)
            waiting = self._pictures.pop(token, None)
            if waiting is not None:
                waiting(bytes(data.data()))

        def laid(count: bytes) -> None:
            if not count or self.web is None:
                done(b"")
                return
            self._pictures[token] = done  # until the PDF is made: the page may die meanwhile
            bare = QPageLayout(layout.pageSize(), layout.orientation(), QMarginsF())
            self.web.page.printToPdf(made, bare)

        paper = layout.fullRect(QPageLayout.Unit.Inch)
        edge = max(_EDGE_INCH, *_margins(layout))
        pixels = {"width": paper.width(), "height": paper.height(), "edge": edge}
        self._pictures[token] = laid
        told: Json = {name: inches * _PIXELS_PER_INCH for name, inches in pixels.items()}
        self._bridge.tell("pages", {"token": token, "title": title, "date": date, **told})

    def set_toolbox_pinned(self, pinned: bool | None) -> None:
        """Let the blocks of a category stay open, or close after each use; None: as the room allows."""
        self._pinned = pinned
        self._tell("pin", pinned)

    def set_definitions(self, definitions: Mapping[str, object]) -> None:
        """Give what `app.blocks.editor_definitions` made. Equal definitions cost nothing.

        Keeps the program, its undo and an open category; waits while a block is being dragged.
        """
        if definitions == self._definitions:
            return
        self._definitions = dict(definitions)
        self._tell("definitions", self._definitions)

    # -- what the blocks of the shown tab say -----------------------------------------------------

    def highlight(self, ids: Sequence[str]) -> None:
        """Let exactly these blocks glow; 30 calls a second are fine."""
        self._show("highlight", list(ids))

    def mark_stopped(self, ids: Sequence[str]) -> None:
        """Outline the blocks at which the program was stopped."""
        self._show("stopped", list(ids))

    def set_errors(self, errors: Mapping[str, str]) -> None:
        """Outline these blocks and put a sentence beside each: id -> sentence."""
        self._show("errors", dict(errors))

    def set_warnings(self, warnings: Mapping[str, str]) -> None:
        """Put a sentence beside each of these blocks that warns, and is no error: id -> sentence."""
        self._show("warnings", dict(warnings))

    def show_value(self, id: str, words: str) -> None:
        """Say beside a block, also one of the open toolbox, what its value is, until the next press."""
        self._tell("value", [id, words])

    def set_absent(self, ids: Sequence[str]) -> None:
        """Show these blocks grey and dashed: their robot is not connected."""
        self._show("absent", list(ids))

    def set_live_values(self, values: Mapping[str, str], old: Collection[str] = ()) -> None:
        """Set the words of sensor blocks, by block id or by ``<robot>/<property>[/<field>]``.

        No undo, no change. Those whose key is among ``old`` are faint: the robot has not told them lately.
        """
        live: Json = {"values": dict(values), "old": sorted(old)}
        if live != self._live:
            self._live = live
            self._tell("live", self._live)

    def set_variable_values(self, values: Mapping[str, Mapping[str, object]]) -> None:
        """Say what the variables hold that the page shows: by id, as `VariableValue.to_json`."""
        if values != self._values:
            self._values = dict(values)
            self._tell("values", self._values)

    def edit_variable(self, edit: Mapping[str, object]) -> None:
        """Do something with a variable: ``{"do": "new" | "rename" | "delete" | "watch" | "show", …}``."""
        self._tell("variable", dict(edit))

    def set_alarms(self, alarms: Mapping[str, tuple[str, str]]) -> None:
        """Say in the toolbox what is wrong with robots: name -> status of its dot, words.

        All others have the dot of a robot that is connected or not.
        """
        told: Json = {name: {"status": status, "words": words} for name, (status, words) in alarms.items()}
        if told != self._alarms:
            self._alarms = told
            self._tell("alarms", told)

    def set_backpack(self, items: Sequence[Mapping[str, object]]) -> None:
        """Say what is in the backpack, the newest first: ``{"id", "at", "block"}`` of each."""
        self._backpack = [dict(item) for item in items]
        self._tell("backpack", self._backpack)

    def set_first_step(self, first: str, robot: bool) -> None:
        """Say on an empty canvas to drag the block ``first`` there; ``robot``: one is connected."""
        told: Json = {"first": first, "robot": robot}
        if told != self._first_step:
            self._first_step = told
            self._tell("begin", told)

    def point_at(self, block: str, name: str = "", then: str = "") -> None:
        """Put a ring round the category that has this type of block, then round the block; "" ends that.

        ``name`` is what people call it, ``then`` the words that say where to put it. It ends by itself when
        there is one more of them.
        """
        wanted: Json | None = {"block": block, "name": name, "then": then} if block else None
        self._pointed = None if self._up else wanted
        self._tell("point", wanted)

    # -- commands ---------------------------------------------------------------------------------

    def undo(self) -> None:
        """Take back the last edit."""
        self._tell("undo", None)

    def undo_deletion(self) -> None:
        """Bring back what was deleted last, whatever was done since."""
        self._tell("undelete", None)

    def bring_blocks(self) -> None:
        """Let the shown tab have what was carried out of the page last, and take it from its own tab."""
        self._tell("bring", None)

    def give_blocks_back(self) -> None:
        """Undo the last `bring_blocks`, in both tabs."""
        self._tell("giveBack", None)

    def redo(self) -> None:
        """Do it again."""
        self._tell("redo", None)

    def edit(self, what: str) -> None:
        """Do "copy", "cut", "paste" or "duplicate" with the chosen block, and give the page the keys.

        Does nothing when the page has the keys: it has had its turn.
        """
        if self.web is not None and not self._has_keys():
            self.setFocus()
            self._tell("edit", what)

    def edit_from_menu(self, what: str) -> None:
        """Do "cut", "copy", "paste" or "selectAll" in the page's field with the keys, else with blocks."""
        if self.web is None:
            return
        page = self.web.page

        def act(types: object) -> None:
            if types:
                page.triggerAction(page.WebAction[PAGE_EDITS[what]])
            else:
                self.setFocus()
                self._tell("edit", what)

        page.runJavaScript(TYPES, act)

    def _has_keys(self) -> bool:
        focus = QApplication.focusWidget()
        return focus is not None and self.isAncestorOf(focus)

    def zoom_in(self) -> None:
        """One step larger."""
        self._tell("zoom", 1)

    def zoom_out(self) -> None:
        """One step smaller."""
        self._tell("zoom", -1)

    def zoom_to_fit(self) -> None:
        """Show the whole program."""
        self._tell("fit", None)

    def open_find(self) -> None:
        """Open the bar that finds blocks in the shown program."""
        self._ask_for("find")

    def open_search(self) -> None:
        """Let the keys go to the field that finds blocks in the toolbox."""
        self._ask_for("search")

    def show_help(self) -> None:
        """Show the help of the block that the keys go to, if there is one."""
        self._tell("help", None)

    def show_block(self, id: str) -> None:
        """Bring the block to the middle and select it."""
        self._tell("show", id)

    # -- the page ---------------------------------------------------------------------------------

    def _toolbox_pinned(self, keeps: bool) -> None:
        self._pinned = keeps
        self.toolbox_pinned.emit(keeps)

    def _on_screen(self, x: int, y: int) -> QPoint:
        """A place of the page, or beside it."""
        zoom = self.web.view.zoomFactor() if self.web is not None else 1.0
        view = self.web.view if self.web is not None else self
        return view.mapToGlobal(QPoint(round(x * zoom), round(y * zoom)))

    def _page_came(self) -> None:
        self._tell("definitions", self._definitions)
        self._tell("alarms", self._alarms)
        self._tell("begin", self._first_step)
        self._tell("backpack", self._backpack)
        self._tabs.page_gone()
        self._send_tab()
        pointed, self._pointed = self._pointed, None
        if pointed is not None:
            self._tell("point", pointed)

    def _page_went(self) -> None:
        pictures, self._pictures = self._pictures, {}
        for without in pictures.values():
            without(b"")
        waiting, self._waiting = self._waiting, {}
        for done in waiting.values():
            done(self._tabs.shown.program)
        self.history_changed.emit(False, False)
        self.sensors_offered.emit(())
        self.values_watched.emit(())

    def _send_tab(self) -> None:
        """Let the page show this tab: its program when the page does not hold it, and what its blocks say."""
        if not self._up:
            return
        tab = self._tabs.shown
        here: Json = {"key": tab.key}
        if not tab.in_page:
            here |= {"generation": tab.generation, "workspace": tab.program.blocks}
            tab.in_page = True
        self._bridge.tell("tab", here)
        for name, value in tab.states.items():
            self._bridge.tell(name, value)
        self._bridge.tell("live", self._live)
        self._bridge.tell("values", self._values)

    def _show(self, name: str, value: object) -> None:
        states = self._tabs.shown.states
        if states.get(name) != value:
            states[name] = value
            self._tell(name, value)

    def _edited(self, key: str, generation: int, workspace: str) -> None:
        tab = self._tabs.edited(key, generation)
        if tab is not None:
            tab.program = WorkspaceJson(workspace)
            self.changed.emit(key, tab.program)

    def _drawn(self, token: int, data: str) -> None:
        done = self._pictures.pop(token, None)
        if done is not None:
            done(data_url(data) if data.startswith("data:") else data.encode())

    def _answered(self, token: int, workspace: str) -> None:
        done = self._waiting.pop(token, None)
        if done is not None:
            done(WorkspaceJson(workspace))


def _margins(layout: QPageLayout) -> tuple[float, float, float, float]:
    """What the printer leaves empty, in inches."""
    margins = layout.margins(QPageLayout.Unit.Inch)
    return margins.left(), margins.top(), margins.right(), margins.bottom()
