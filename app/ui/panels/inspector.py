"""Inspector: the newest message of one topic as a tree, or its bytes."""

from __future__ import annotations

import time
from collections.abc import Mapping
from typing import TYPE_CHECKING

from PySide6.QtCore import QModelIndex, QPoint, Qt
from PySide6.QtGui import QAction, QGuiApplication, QKeySequence
from PySide6.QtWidgets import QHBoxLayout, QStackedWidget, QVBoxLayout, QWidget

from app.ui.hex_view import HexView
from app.ui.inspector_parts import (
    FindField,
    Foot,
    image_summary,
    message_facts,
    plain_words,
    tells_its_shape,
)
from app.ui.panels.base import ANY_TYPE, Panel, PanelContext, PanelWidget
from app.ui.tree import Node, TreeModel
from app.ui.tree_values import search
from app.ui.tree_view import TreeView
from app.ui.widgets import Chip, EmptyAction, EmptyState, IconButton, Line, Segments, label
from app.ui.widgets.menus import Menu
from app.ui.words import size_words

if TYPE_CHECKING:
    from app.core.topics import Topic
    from app.core.watches import Watch
    from nep.message import Message

LARGE_BYTES = 1_000_000
FIRST_ROWS = 24
NOTHING, LARGE, TREE, RAW = range(4)


class InspectorPanel(PanelWidget):
    """Shows one topic: Tree or Raw, what changed, the path of the chosen value, and the message's facts."""

    def __init__(self, context: PanelContext) -> None:
        super().__init__(context, "Inspector")
        self._topic = ""
        self._watch: Watch | None = None
        self._shown: Message | None = None
        self._allowed: Message | None = None  # a large message that a person wants to read
        self._raw_wanted = False
        self._matches: list[tuple[str | int, ...]] = []
        self._match = -1
        self.model = TreeModel()
        self.live = Chip(self.theme, "", "info", "")
        self.freeze = IconButton(self.theme, "snowflake", "Freeze this panel", checkable=True, size=26)
        self.freeze.toggled.connect(lambda _on: self.refresh())
        self.header = [self.live, self.freeze]
        self._make_tree()
        self._make_body()
        self._say_nothing()

    # -- its parts ----------------------------------------------------------------------------------------

    def _make_tree(self) -> None:
        self.tree = TreeView(self.theme, self.model)
        self.tree.setAccessibleName("Newest message")
        self.tree.selectionModel().currentChanged.connect(self._chosen)
        self.tree.setContextMenuPolicy(Qt.ContextMenuPolicy.CustomContextMenu)
        self.tree.customContextMenuRequested.connect(self._show_menu)
        for words, key, does in (
            ("Copy value", QKeySequence(QKeySequence.StandardKey.Copy), self.copy_value),
            ("Copy path", QKeySequence("Ctrl+Shift+C"), self.copy_path),
        ):
            action = QAction(words, self.tree)
            action.setShortcut(key)
            action.setShortcutContext(Qt.ShortcutContext.WidgetShortcut)
            action.triggered.connect(does)
            self.tree.addAction(action)

    def _make_body(self) -> None:
        theme = self.theme
        self.finder = FindField(theme)
        self.finder.textChanged.connect(self.look_for)
        self.finder.next_wanted.connect(self.next_match)
        self.finder.leave.connect(lambda: self.tree.setFocus(Qt.FocusReason.ShortcutFocusReason))
        self.mode = Segments(
            theme, [("tree", "Tree", None), ("raw", "Raw", None)], size="small", name="Show as"
        )
        self.mode.changed.connect(self._set_mode)
        self.bar = QWidget()
        bar = QHBoxLayout(self.bar)
        bar.setContentsMargins(8, 7, 8, 7)
        bar.setSpacing(8)
        bar.addWidget(self.finder, 1)
        bar.addWidget(self.mode)
        self.line = Line(theme)
        self.sentence = label("", "small", role="warn", wrap=True)
        self.sentence.setContentsMargins(12, 6, 12, 6)
        self.bytes = HexView(theme)
        self.empty = EmptyState(theme, "list-tree", "", "")
        self.large = EmptyState(theme, "database", "", "")
        self.foot = Foot(theme, self.copy_value, self.copy_path)
        self.foot.show_path("")
        self.pages = QStackedWidget()
        for page in (self.empty, self.large, self.tree, self.bytes):
            self.pages.addWidget(page)
        column = QVBoxLayout(self)
        column.setContentsMargins(0, 0, 0, 0)
        column.setSpacing(0)
        for widget in (self.bar, self.line, self.sentence):
            column.addWidget(widget)
        column.addWidget(self.pages, 1)
        column.addWidget(self.foot)

    # -- what it shows ------------------------------------------------------------------------------------

    def show_topic(self, name: str) -> None:
        """Look at another topic."""
        if name == self._topic:
            return
        self.shut()
        self._topic = name
        self._shown = self._allowed = None
        self._raw_wanted = False
        self.model.clear()
        self.foot.show_path("")
        self.freeze.setChecked(False)
        self.set_title("Inspector", name)
        if name:
            self._watch = self.session.watch(name)
            self.session.topics.mark_seen(name)
        self._say_nothing()

    def refresh(self) -> None:
        if not self._topic:
            return
        topic = self.session.topics.get(self._topic)
        if self.frozen:
            self.live.set("frozen", "off", "snowflake")
        elif topic is None or topic.gone_s is not None:
            gone = topic.gone_s if topic is not None else None
            self.live.set(f"gone {int(gone)} s" if gone is not None else "gone", "off", "")
        else:
            self.live.set("live", "info", "")
            if topic.newest is not None and topic.newest is not self._shown:
                self._take(topic, topic.newest)
        if self.pages.currentIndex() == TREE and self.tree.fading():
            self.tree.viewport().update()

    def _take(self, topic: Topic, message: Message) -> None:
        self._shown = message
        self.foot.facts.setText(message_facts(message))
        readable = True
        large = message.size_bytes > LARGE_BYTES and message.codec != "image"
        if self._raw_wanted:
            self._show_raw(message, "")
        elif large and message is not self._allowed:
            self._offer_large(message)
        elif tells_its_shape(message) or self.session.topics.check(topic):
            self._show_tree(message)
        else:
            readable = False
            self._show_raw(message, topic.decode_error or "")
        self.mode.set_value("tree" if readable and not self._raw_wanted else "raw")

    def _show_tree(self, message: Message) -> None:
        value = image_summary(message) if message.codec == "image" else message.payload
        first = not self.model.rowCount()
        self.model.set_value(value, time.monotonic())
        if first:
            self.tree.expand_small(FIRST_ROWS)
        self._page(TREE)

    def _show_raw(self, message: Message, sentence: str) -> None:
        self.bytes.show_bytes(message.data)
        self.sentence.setText(f"This can't be read as {message.codec}: {sentence}." if sentence else "")
        self._page(RAW)

    def _offer_large(self, message: Message) -> None:
        words = "Messages above 1 MB are read only when you ask for it."
        self.large.say(f"A message of {size_words(message.size_bytes)}", words)
        if self.pages.currentIndex() != LARGE:
            read = EmptyAction("Read the newest one", self._read_large, "list-tree", primary=True)
            self.large.set_actions([read])
        self._page(LARGE)

    def _read_large(self) -> None:
        """Read the message that is shown, and hold it: the next one would hide it again."""
        topic = self.session.topics.get(self._topic)
        if topic is not None and self._shown is not None:
            self._allowed = self._shown
            self.freeze.setChecked(True)
            self._take(topic, self._shown)

    def _page(self, page: int) -> None:
        sentence = self.sentence.text() if page == RAW else ""
        self.sentence.setText(sentence)
        self.sentence.setVisible(bool(sentence))
        self.pages.setCurrentIndex(page)
        for widget in (self.bar, self.line, self.foot):
            widget.setVisible(page in {TREE, RAW})
        self.foot.legend.setVisible(page == TREE)

    def _say_nothing(self) -> None:
        if self._topic:
            self.empty.say("No message yet", f"The next message on {self._topic} appears here.")
            self.empty.set_actions([])
        else:
            self.live.set("")
            self.empty.say("Nothing chosen", "Click a topic to see its newest message.")
            choose = EmptyAction("Choose a topic", lambda: self.context.run("panel.topics"), "list")
            self.empty.set_actions([choose])
        self.freeze.setVisible(bool(self._topic))
        self._page(NOTHING)

    # -- what a person does -------------------------------------------------------------------------------

    @property
    def frozen(self) -> bool:
        """Whether this panel holds its message."""
        return self.freeze.isChecked()

    def _set_mode(self, mode: str) -> None:
        self._raw_wanted = mode == "raw"
        topic = self.session.topics.get(self._topic)
        if topic is not None and self._shown is not None:
            self._take(topic, self._shown)

    def _chosen(self, index: QModelIndex) -> None:
        self.foot.show_path(self.model.node(index).path if index.isValid() else "")

    def _node(self) -> Node | None:
        index = self.tree.currentIndex()
        return self.model.node(index) if index.isValid() else None

    def copy_value(self) -> None:
        """Put the chosen value on the clipboard."""
        node = self._node()
        if node is not None:
            QGuiApplication.clipboard().setText(plain_words(node.value))
            self.context.toast(f"Copied {node.path}")

    def copy_path(self) -> None:
        """Put the chosen value's path on the clipboard."""
        node = self._node()
        if node is not None:
            QGuiApplication.clipboard().setText(node.path)
            self.context.toast(f"Copied the path {node.path}")

    def _show_menu(self, at: QPoint) -> None:
        menu = Menu(self.theme, self)
        menu.addActions(self.tree.actions())
        menu.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        menu.popup(self.tree.viewport().mapToGlobal(at))

    def look_for(self, words: str) -> None:
        """Choose the first key or value with these words."""
        self._matches = list(search(self.model.value(), words)) if words else []
        self._match = -1
        self.finder.setProperty("wrong", "true" if words and not self._matches else "false")
        self.finder.style().unpolish(self.finder)
        self.finder.style().polish(self.finder)
        self.next_match()

    def next_match(self) -> None:
        """Choose the next one."""
        if self._matches:
            self._match = (self._match + 1) % len(self._matches)
            index = self.model.reveal(self._matches[self._match])
            self.tree.setCurrentIndex(index)
            self.tree.scrollTo(index)

    def focus_filter(self) -> bool:
        self.finder.setFocus(Qt.FocusReason.ShortcutFocusReason)
        return True

    def theme_changed(self) -> None:
        self.tree.row_height = round(self.theme.scaled(self.theme.size("row", "tree")))
        self.tree.doItemsLayout()

    def save_state(self) -> dict[str, object]:
        return {"topic": self._topic}

    def restore_state(self, state: Mapping[str, object]) -> None:
        topic = state.get("topic")
        if isinstance(topic, str):
            self.show_topic(topic)

    def shut(self) -> None:
        if self._watch is not None:
            self._watch.close()
            self._watch = None


PANEL = Panel("inspector", "Inspector", "list-tree", (ANY_TYPE,), InspectorPanel)
