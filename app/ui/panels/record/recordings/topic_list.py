"""Checklist of topics to export."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence

from PySide6.QtCore import Qt, Signal
from PySide6.QtWidgets import QVBoxLayout, QWidget

from app.ui.text.numbers import group_digits, size_text
from app.ui.theme.theme import Theme
from app.ui.widgets import Button, ElidedLabel
from app.ui.widgets.flow_layout import Flow
from app.ui.widgets.inputs.fields import FilterField
from app.ui.widgets.table.model import Cell, Column, TableModel
from app.ui.widgets.table.view import TableView
from nep.i18n import _, lazy, ngettext, pgettext
from nep.recordings.reader import RecordedTopic

TABLE_HEIGHT_PX = 150


class TopicList(QWidget):
    """Checklist of topics.

    Signals:
        selection_changed: Names of all checked topics, after the user changed one of them.
    """

    selection_changed = Signal(list)

    def __init__(self, theme: Theme) -> None:
        super().__init__()
        self._topics: Sequence[RecordedTopic] = ()
        self._checked_names: frozenset[str] = frozenset()
        self._size_of: Callable[[RecordedTopic], float | None] = lambda _topic: None
        self.filter = FilterField(theme, _("Filter topics"))
        self.filter.textChanged.connect(self._show_rows)
        self.all_button = Button(theme, pgettext("topics", "All"), "check", size="small")
        self.none_button = Button(theme, _("None"), "minus", size="small")
        self.all_button.clicked.connect(lambda: self._set_matching_selected(is_selected=True))
        self.none_button.clicked.connect(lambda: self._set_matching_selected(is_selected=False))
        self.count_label = ElidedLabel("small", "textSecondary", min_width=60)
        self.model: TableModel[RecordedTopic] = TableModel(self._columns(), lambda topic: topic.name)
        self.table: TableView[RecordedTopic] = TableView(theme, self.model, "topic")
        self.table.setAccessibleName(_("Topics to export"))
        self.table.opened.connect(self._toggle)
        self.table.order_changed.connect(self._show_rows)
        self.table.filter_requested.connect(lambda: self.filter.setFocus(Qt.FocusReason.ShortcutFocusReason))
        self.filter.exited.connect(lambda: self.table.setFocus(Qt.FocusReason.ShortcutFocusReason))
        self.table.setFixedHeight(round(theme.scaled(TABLE_HEIGHT_PX)))
        row = Flow(gap=8, row_gap=6)
        for widget in (self.all_button, self.none_button):
            row.addWidget(widget)
        row.addWidget(self.filter)
        row.add_elastic(self.count_label)
        column = QVBoxLayout(self)
        column.setContentsMargins(0, 0, 0, 0)
        column.setSpacing(6)
        column.addLayout(row)
        column.addWidget(self.table)

    def _columns(self) -> tuple[Column[RecordedTopic], ...]:
        def included_cell(topic: RecordedTopic) -> Cell:
            if topic.name in self._checked_names:
                return Cell(icon="check", role="accentText", accessible_text=_("exported"))
            return Cell(icon="minus", role="textTertiary", accessible_text=_("excluded"))

        def text_role(topic: RecordedTopic) -> str:
            return "text" if topic.name in self._checked_names else "textTertiary"

        return (
            Column("has", "", 40, included_cell, label=lazy("Export")),
            Column("topic", lazy("Topic"), 150, lambda topic: Cell(topic.name, role=text_role(topic),
                   mono=True),
                   key=lambda topic: topic.name, stretch=True, tip=lambda topic: topic.name),
            Column("type", lazy("Type"), 110,
                   lambda topic: Cell(topic.msg_type.rpartition("/")[2] or topic.codec, role="textSecondary"),
                   key=lambda topic: topic.msg_type, hide_order=2, tip=lambda topic: topic.msg_type),
            Column("messages", lazy("Messages"), 96,
                   lambda topic: Cell(group_digits(topic.message_count), role=text_role(topic)),
                   key=lambda topic: topic.message_count, is_numeric=True, hide_order=1),
            Column("size", lazy("Size"), 84,
                   lambda topic: Cell(self._size_text(topic), role=text_role(topic)),
                   key=lambda topic: self._size_of(topic) or 0.0, is_numeric=True, hide_order=3),
        )  # fmt: skip

    def _size_text(self, topic: RecordedTopic) -> str:
        size = self._size_of(topic)
        return "" if size is None else size_text(size)

    def show_topics(
        self,
        topics: Sequence[RecordedTopic],
        checked: Collection[str],
        size_of: Callable[[RecordedTopic], float | None],
    ) -> None:
        """Replace the topics.

        Args:
            topics: Topics of the recording.
            checked: Names of checked topics.
            size_of: Returns the size of a topic's messages in bytes, or None if it is unknown.
        """
        self._checked_names, self._size_of = frozenset(checked), size_of
        if topics is not self._topics:
            self._topics = topics
            self.filter.clear()
        self._show_rows()

    def _matching_topics(self) -> list[RecordedTopic]:
        keywords = self.filter.text().casefold().split()
        return [
            topic
            for topic in self._topics
            if all(keyword in f"{topic.name} {topic.msg_type}".casefold() for keyword in keywords)
        ]

    def _show_rows(self) -> None:
        self.model.set_rows(self.table.order.sort(self._matching_topics()))
        self.table.refresh_visible()
        self.table.viewport().update()
        count = sum(topic.message_count for topic in self._topics if topic.name in self._checked_names)
        template = ngettext("{count} message", "{count} messages", count)
        self.count_label.setText(template.format(count=group_digits(count)))

    def _toggle(self, name: str) -> None:
        self._set_selection(self._checked_names ^ {name})

    def _set_matching_selected(self, *, is_selected: bool) -> None:
        # Topics that match the filter.
        matching = {topic.name for topic in self._matching_topics()}
        self._set_selection(self._checked_names | matching if is_selected else self._checked_names - matching)

    def _set_selection(self, names: frozenset[str]) -> None:
        self._checked_names = names
        self._show_rows()
        self.selection_changed.emit([topic.name for topic in self._topics if topic.name in names])


def shortest_choice(
    topics: Sequence[RecordedTopic], names: Collection[str]
) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Express a selection of topics by the shorter list of names: included or excluded topics.

    Args:
        topics: All topics of the recording.
        names: Names of the selected topics, at least one.

    Returns:
        Names of the included topics, and names of the excluded topics. One of them is empty; if both
        are empty, all topics are selected.
    """
    included = tuple(topic.name for topic in topics if topic.name in names)
    excluded = tuple(topic.name for topic in topics if topic.name not in names)
    return ((), excluded) if len(excluded) < len(included) else (included, ())
