"""Nodes: the programs that are there, natives and originals, with what they publish and subscribe."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

from PySide6.QtCore import QModelIndex, Qt, Signal
from PySide6.QtGui import QAction, QKeyEvent
from PySide6.QtWidgets import QStackedWidget, QVBoxLayout

from app.core.source import NODE_NAME
from app.ui.doctor_line import DoctorLine
from app.ui.filter_field import FilterField
from app.ui.node_rows import NodeRow, columns, facts_of, limits_of, rows_of
from app.ui.panels.base import Density, Panel, PanelContext, PanelWidget
from app.ui.table import TableModel
from app.ui.table_view import TableView
from app.ui.widgets import EmptyAction, EmptyState, Line, Scrolled, label
from app.ui.words import rate_words

if TYPE_CHECKING:
    from app.core.nodes import NodeEntry

SORT_EVERY = 30  # refreshes of 30 a second: what moves is sorted once a second
LIVELY = frozenset({"cpu"})


class NodesPanel(PanelWidget):
    """The table of nodes, a filter in the title, what is known of the chosen one below."""

    def __init__(self, context: PanelContext) -> None:
        super().__init__(context, "Nodes")
        theme = self.theme
        self.model: TableModel[NodeRow] = TableModel(columns(self._own), lambda row: row.key)
        self.table = _NodeTable(theme, self.model, "node")
        self.filter = FilterField(theme, "Filter nodes")
        self.filter.textChanged.connect(self._rebuild)
        self.filter.leave.connect(lambda: self.table.setFocus(Qt.FocusReason.ShortcutFocusReason))
        self.header = [self.filter]
        self.table.setAccessibleName("Nodes")
        self.table.opened.connect(self._open)
        self.table.fold_wanted.connect(self._fold)
        self.table.filter_wanted.connect(self.focus_filter)
        self.table.order_changed.connect(self._rebuild)
        self.table.selectionModel().currentChanged.connect(self._chosen)
        self.foot = label("", "small", role="textTertiary", wrap=True)
        self.foot.setContentsMargins(12, 5, 12, 6)
        self.foot.setMinimumWidth(0)
        self.empty = EmptyState(theme, "network", "", "")
        self.doctor = DoctorLine(theme, context.run)
        self._stack = QStackedWidget()
        self._stack.addWidget(self.table)
        self._stack.addWidget(self.empty)
        self.setFocusProxy(self.table)
        self._line = Line(theme)
        self._about = Scrolled(self.foot)
        column = QVBoxLayout(self)
        column.setContentsMargins(0, 0, 0, 0)
        column.setSpacing(0)
        for widget, stretch in ((self._stack, 1), (self._line, 0), (self._about, 0), (self.doctor, 0)):
            column.addWidget(widget, stretch)
        self._opened: set[str] = set()
        self._seen: tuple[object, ...] = ()
        self._values = -1
        self._ticks = 0
        self._gone = False

    def _own(self, node: NodeEntry) -> bool:
        """Whether it is Studio, or a virtual robot that Studio itself started."""
        return node.name in {NODE_NAME, *self.session.companions.virtual_robots}

    def refresh(self) -> None:
        self._ticks += 1
        nodes = self.session.nodes
        order = self.table.order.column
        due = order is not None and order.name in LIVELY and self._ticks % SORT_EVERY == 0
        if due or (nodes.revision, self.session.master.kind) != self._seen:
            self._rebuild()
        if nodes.values_revision != self._values or (self._gone and self._ticks % SORT_EVERY == 0):
            self._values = nodes.values_revision
            self.table.tell_visible_changed()

    def _rebuild(self) -> None:
        nodes = self.session.nodes
        self._seen = (nodes.revision, self.session.master.kind)
        self._gone = any(node.gone_s is not None for node in nodes)
        words = self.filter.text().casefold().split()
        found = [node for node in nodes if all(word in _haystack(node) for word in words)]
        self.model.set_rows(rows_of(found, self._opened, self.table.order, self._rate))
        self.filter.setVisible(len(nodes) > 0)
        self.table.tell_visible_changed()
        self._show_empty(bool(found), bool(words))
        self._say_chosen()

    def _rate(self, name: str) -> str:
        topic = self.session.topics.get(name)
        return rate_words(topic.rate_hz) if topic is not None else ""

    def _show_empty(self, any_rows: bool, filtered: bool) -> None:
        self._stack.setCurrentIndex(0 if any_rows else 1)
        self.doctor.setVisible(not any_rows and not filtered)
        if any_rows:
            return
        if filtered:
            self.empty.say("No node has these words", "Clear the filter to see all nodes.", "search")
            self.empty.set_actions([EmptyAction("Clear the filter", self.filter.clear, "x")])
        elif self.session.master.kind == "none":
            self.empty.say("No master is running", "A master lets programs find each other.", "radio-tower")
            start = self.session.companions.ensure_master
            self.empty.set_actions([EmptyAction("Start a master here", start, "play", primary=True)])
        else:
            self.empty.say("No nodes yet", "Programs appear here as soon as they join the master.", "network")
            self.empty.set_actions([])

    def _chosen(self, _now: QModelIndex, _before: QModelIndex) -> None:
        self._say_chosen()

    def _say_chosen(self) -> None:
        row = self.model.row_at(self.table.currentIndex())
        shown = self._stack.currentIndex() == 0
        words = "Open a node to see its topics" if row is None else facts_of(row.node)
        limits = limits_of(row.node) if row is not None else ""
        self.foot.setText(f"{words}.\n{limits}" if limits else words)
        self._about.setVisible(shown)
        self._line.setVisible(shown)

    def _open(self, key: str) -> None:
        row = self.model.row_at(self.model.index_of(key))
        if row is None:
            return
        if row.topic:
            self.session.topics.mark_seen(row.topic)
            self.context.open_topic(row.topic)
        else:
            self.session.nodes.mark_seen(row.node.id)
            self._fold(key, row.node.id not in self._opened)

    def _fold(self, key: str, opened: bool) -> None:
        row = self.model.row_at(self.model.index_of(key))
        if row is None or (opened and row.topic):
            return
        (self._opened.add if opened else self._opened.discard)(row.node.id)
        self._rebuild()
        self.table.choose(NodeRow(row.node).key)

    def focus_filter(self) -> bool:
        self.filter.setFocus(Qt.FocusReason.ShortcutFocusReason)
        self.filter.selectAll()
        return True

    def set_density(self, density: Density) -> None:
        super().set_density(density)
        self.table.set_row_height(self.row_height(), large=density == "comfortable")

    def theme_changed(self) -> None:
        self.table.set_row_height(self.row_height(), large=self.density == "comfortable")

    def more_actions(self) -> list[QAction]:
        chosen = QAction(self.theme.icon("columns-2"), "Columns", self)
        chosen.setMenu(self.table.column_menu())
        return [chosen]

    def save_state(self) -> dict[str, object]:
        return self.table.saved_state()

    def restore_state(self, state: Mapping[str, object]) -> None:
        self.table.restore(state)


class _NodeTable(TableView[NodeRow]):
    """Right opens the chosen node, Left closes it."""

    fold_wanted = Signal(str, bool)

    def keyPressEvent(self, event: QKeyEvent) -> None:
        key = self.chosen_key()
        if key is not None and event.key() in {Qt.Key.Key_Left, Qt.Key.Key_Right}:
            self.keyboard = True
            self.fold_wanted.emit(key, event.key() == Qt.Key.Key_Right)
        else:
            super().keyPressEvent(event)


def _haystack(node: NodeEntry) -> str:
    topics = " ".join((*node.publishes, *node.subscribes))
    return f"{node.name} {node.host} {node.pid} {node.language} {node.generation} {topics}".casefold()


PANEL = Panel("nodes", "Nodes", "network", (), NodesPanel)
