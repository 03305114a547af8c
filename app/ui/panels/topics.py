"""Topics: everything that is on the network, with its figures as the publishers tell them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

from PySide6.QtCore import Qt
from PySide6.QtGui import QAction
from PySide6.QtWidgets import QStackedWidget, QVBoxLayout

from app.core.source import NODE_NAME
from app.ui.doctor_line import DoctorLine
from app.ui.filter_field import FilterField
from app.ui.panels.base import Density, Panel, PanelContext, PanelWidget
from app.ui.table import TableModel
from app.ui.table_view import TableView
from app.ui.topic_columns import columns
from app.ui.widgets import EmptyAction, EmptyState, Line, label
from app.ui.words import plural

if TYPE_CHECKING:
    from app.core.topics import Topic

FOOT = "Rates come from the publishers; nothing is subscribed but what you look at"
FIGURES_EVERY = 3  # refreshes of 30 a second: figures are renewed ten times a second
SORT_EVERY = 30
LIVELY = frozenset({"rate", "bandwidth", "age", "loss"})


class TopicsPanel(PanelWidget):
    """The table of topics, a filter in the title, a line about the figures below."""

    def __init__(self, context: PanelContext) -> None:
        super().__init__(context, "Topics")
        theme = self.theme
        self.filter = FilterField(theme, "Filter topics")
        self.filter.leave.connect(lambda: self.table.setFocus(Qt.FocusReason.ShortcutFocusReason))
        self.filter.textChanged.connect(self._rebuild)
        self.count = label("", "small", role="textSecondary")
        self.header = [self.count, self.filter]
        self.model: TableModel[Topic] = TableModel(columns(self._own), lambda topic: topic.name)
        self.table: TableView[Topic] = TableView(theme, self.model, "topic")
        self.table.setAccessibleName("Topics")
        self.table.opened.connect(self._open)
        self.table.filter_wanted.connect(self.focus_filter)
        self.table.order_changed.connect(self._rebuild)
        self.foot = label(FOOT, "small", role="textTertiary", wrap=True)
        self.foot.setContentsMargins(12, 5, 12, 6)
        self.foot.setMinimumWidth(0)
        self.empty = EmptyState(theme, "radio-tower", "", "")
        self.doctor = DoctorLine(theme, context.run)
        self._stack = QStackedWidget()
        self._stack.addWidget(self.table)
        self._stack.addWidget(self.empty)
        self.setFocusProxy(self.table)
        column = QVBoxLayout(self)
        column.setContentsMargins(0, 0, 0, 0)
        column.setSpacing(0)
        column.addWidget(self._stack, 1)
        self._line = Line(theme)
        column.addWidget(self._line)
        column.addWidget(self.foot)
        column.addWidget(self.doctor)
        self._seen = (-1, -1, "")
        self._ours: tuple[str, ...] = ()
        self._ticks = 0
        self._wanted = ""

    def _own(self, topic: Topic) -> bool:
        """Whether only virtual robots that Studio itself started publish it, or Studio."""
        if not topic.publisher_nodes:
            return topic.name.startswith(tuple(f"/{robot}/" for robot in self._ours))
        return {*self._ours, NODE_NAME}.issuperset(topic.publisher_nodes)

    def refresh(self) -> None:
        self._ticks += 1
        topics = self.session.topics
        facts = (topics.revision, len(topics), self.session.master.kind)
        order = self.table.order.column
        lively = order is not None and order.name in LIVELY
        if facts != self._seen or (lively and self._ticks % SORT_EVERY == 0):
            self._rebuild()
        if self._ticks % FIGURES_EVERY == 0 and self.model.rowCount():
            self.table.tell_visible_changed()

    def _rebuild(self) -> None:
        topics = self.session.topics
        self._seen = (topics.revision, len(topics), self.session.master.kind)
        self._ours = self.session.companions.virtual_robots
        words = self.filter.text().casefold().split()
        rows = [topic for topic in topics if all(word in _haystack(topic) for word in words)]
        self.model.set_rows(self.table.order.sort(rows))
        if self._wanted:
            self.show_topic(self._wanted)
        self._say_counts(len(topics), len(rows) if words else None)
        self._show_empty(bool(rows), bool(words))

    def _say_counts(self, known: int, found: int | None) -> None:
        graph = self.session.graph
        words = plural(known, "topic") if found is None else f"{found} of {plural(known, 'topic')}"
        if graph is not None and graph.nodes:
            words += f", {plural(len(graph.nodes), 'node')}"
        self.count.setText(words if known else "")
        self.filter.setVisible(known > 0)

    def _show_empty(self, any_rows: bool, filtered: bool) -> None:
        self._stack.setCurrentIndex(0 if any_rows else 1)
        self.foot.setVisible(any_rows)
        self._line.setVisible(any_rows)
        self.doctor.setVisible(not any_rows and not filtered)
        if any_rows:
            return
        kind = self.session.master.kind
        if filtered:
            self.empty.say("No topic has these words", "Clear the filter to see all topics.", "search")
            self.empty.set_actions([EmptyAction("Clear the filter", self.filter.clear, "x")])
        elif kind == "none":
            self.empty.say("No master is running", "A master lets programs find each other.", "radio-tower")
            start = self.session.companions.ensure_master
            self.empty.set_actions([EmptyAction("Start a master here", start, "play", primary=True)])
        elif kind == "searching":
            self.empty.say("Looking for a master", f"At {self.session.master.address}.", "radio-tower")
            self.empty.set_actions([])
        else:
            self.empty.say("No topics yet", "They appear as soon as a program publishes.", "list")
            self.empty.set_actions(
                [EmptyAction("Use the virtual robot", self._use_virtual, "bot", primary=True)]
            )

    def _use_virtual(self) -> None:
        self.context.run("robots.virtual")

    def _open(self, name: str) -> None:
        self.session.topics.mark_seen(name)
        self.context.open_topic(name)

    def show_topic(self, name: str) -> None:
        self._wanted = "" if self.model.index_of(name).isValid() else name  # its row may still come
        self.table.choose(name)

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
        columns = QAction(self.theme.icon("columns-2"), "Columns", self)
        columns.setMenu(self.table.column_menu())
        return [columns]

    def save_state(self) -> dict[str, object]:
        return self.table.saved_state()

    def restore_state(self, state: Mapping[str, object]) -> None:
        self.table.restore(state)


def _haystack(topic: Topic) -> str:
    return f"{topic.name} {topic.msg_type} {' '.join(topic.publisher_nodes)}".casefold()


PANEL = Panel("topics", "Topics", "list", (), TopicsPanel)
