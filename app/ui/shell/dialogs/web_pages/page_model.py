"""Qt model of the connected pages and their topics, updated in place."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from PySide6.QtCore import QAbstractItemModel, QModelIndex, QObject, QPersistentModelIndex, Qt

from app.core.network.web_page_list import ListedPage
from app.core.network.web_texts import page_name
from app.ui.shell.dialogs.web_pages.page_texts import page_description, topic_description
from nep.i18n import _

if TYPE_CHECKING:
    from nep.programs.web.context import PageTopic

Index = QModelIndex | QPersistentModelIndex
_ROOT = QModelIndex()
_TopicKey = tuple[str, bool]


@dataclass(slots=True)
class PageRow:
    """Row of a page in the model.

    Attributes:
        listed_page: Page.
        number: Row number.
        topics: Topics of the page, in the order of the child rows.
    """

    listed_page: ListedPage
    topics: list[PageTopic] = field(default_factory=list)
    number: int = 0

    @property
    def id(self) -> int:
        """Id of the page."""
        return self.listed_page.page.id


class PageTreeModel(QAbstractItemModel):
    """Tree model of pages, with their topics as children.

    Indexes of pages stay valid while other rows are added or removed. There is a single column, because
    with several Qt would query the size of each cell of thousands of topics.
    """

    def __init__(self, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self._rows: list[PageRow] = []
        self._by_id: dict[int, PageRow] = {}

    def rowCount(self, parent: Index = _ROOT) -> int:
        if not parent.isValid():
            return len(self._rows)
        row = self.page_row(parent)
        return len(row.topics) if row is not None and self.topic(parent) is None else 0

    def columnCount(self, _parent: Index = _ROOT) -> int:
        return 1

    def index(self, row: int, column: int, parent: Index = _ROOT) -> QModelIndex:
        if not 0 <= row < self.rowCount(parent) or column:
            return QModelIndex()
        if not parent.isValid():
            return self.createIndex(row, column, 0)
        return self.createIndex(row, column, self._rows[parent.row()].id + 1)

    def parent(self, index: Index = _ROOT) -> QModelIndex:  # type: ignore[override]
        row = self._by_id.get(index.internalId() - 1) if index.isValid() else None
        return QModelIndex() if row is None else self.createIndex(row.number, 0, 0)

    def data(self, index: Index, role: int = Qt.ItemDataRole.DisplayRole) -> object:
        row, topic = self.page_row(index), self.topic(index)
        if row is None:
            return None
        if role == Qt.ItemDataRole.DisplayRole:
            return page_name(row.listed_page.page) if topic is None else topic.topic
        if role == Qt.ItemDataRole.AccessibleTextRole:
            return page_description(row.listed_page) if topic is None else topic_description(topic)
        return None

    def headerData(
        self, section: int, orientation: Qt.Orientation, role: int = Qt.ItemDataRole.DisplayRole
    ) -> object:
        is_title = orientation == Qt.Orientation.Horizontal and role == Qt.ItemDataRole.DisplayRole
        return _("Page and topics") if is_title and section == 0 else None

    def page_row(self, index: Index) -> PageRow | None:
        """Return the row of the page at an index, or of the page to which the topic at the index belongs.

        Returns:
            None if the index is invalid or the page has been removed.
        """
        if not index.isValid():
            return None
        page_id = index.internalId() - 1
        if page_id >= 0:
            return self._by_id.get(page_id)
        return self._rows[index.row()] if index.row() < len(self._rows) else None

    def topic(self, index: Index) -> PageTopic | None:
        """Return the topic at an index, or None if the index is that of a page or invalid."""
        row = self._by_id.get(index.internalId() - 1) if index.isValid() else None
        return row.topics[index.row()] if row is not None and index.row() < len(row.topics) else None

    def show_pages(self, pages: Sequence[ListedPage]) -> None:
        """Update the rows to a list of pages that is sorted by id."""
        pages_by_id = {listed_page.page.id: listed_page for listed_page in pages}
        for index in reversed(range(len(self._rows))):
            if self._rows[index].id not in pages_by_id:
                self._remove_page(index)
        new_pages = [listed_page for listed_page in pages if listed_page.page.id not in self._by_id]
        for listed_page in pages:
            row = self._by_id.get(listed_page.page.id)
            if row is not None and row.listed_page != listed_page:
                row.listed_page = listed_page
                self._emit_changed(self.createIndex(row.number, 0, 0), self.createIndex(row.number, 0, 0))
                self._show_topics(row, listed_page.page.topics)
        if new_pages:
            self._append_pages(new_pages)

    def _append_pages(self, pages: Sequence[ListedPage]) -> None:
        first = len(self._rows)
        self.beginInsertRows(_ROOT, first, first + len(pages) - 1)
        for listed_page in pages:
            row = PageRow(listed_page, [*listed_page.page.topics], len(self._rows))
            self._rows.append(row)
            self._by_id[row.id] = row
        self.endInsertRows()

    def _remove_page(self, index: int) -> None:
        self.beginRemoveRows(_ROOT, index, index)
        row = self._rows.pop(index)
        del self._by_id[row.id]
        for number, other_row in enumerate(self._rows):
            other_row.number = number
        self.endRemoveRows()

    def _show_topics(self, row: PageRow, topics: Sequence[PageTopic]) -> None:
        old_topics = row.topics
        if [_key(topic) for topic in old_topics] == [_key(topic) for topic in topics]:
            changed_rows = [index for index, topic in enumerate(topics) if topic != old_topics[index]]
            row.topics = [*topics]
            if changed_rows:
                self._emit_topics_changed(row, changed_rows[0], changed_rows[-1])
            return
        parent = self.createIndex(row.number, 0, 0)
        keys = {_key(topic) for topic in topics}
        for index in reversed(range(len(old_topics))):
            if _key(old_topics[index]) not in keys:
                self.beginRemoveRows(parent, index, index)
                del old_topics[index]
                self.endRemoveRows()
        for index, topic in enumerate(topics):
            if index >= len(old_topics) or _key(old_topics[index]) != _key(topic):
                self.beginInsertRows(parent, index, index)
                old_topics.insert(index, topic)
                self.endInsertRows()
        if len(old_topics) > len(topics):  # the remaining topics are in another order
            self.beginRemoveRows(parent, len(topics), len(old_topics) - 1)
            del old_topics[len(topics) :]
            self.endRemoveRows()
        row.topics = [*topics]
        self._emit_topics_changed(row, 0, len(topics) - 1)

    def _emit_topics_changed(self, row: PageRow, first: int, last: int) -> None:
        if first <= last:
            internal_id = row.id + 1
            self._emit_changed(
                self.createIndex(first, 0, internal_id), self.createIndex(last, 0, internal_id)
            )

    def _emit_changed(self, first: QModelIndex, last: QModelIndex) -> None:
        self.dataChanged.emit(first, last, [Qt.ItemDataRole.DisplayRole])


def _key(topic: PageTopic) -> _TopicKey:
    return topic.topic, topic.is_published


def sorted_topics(listed_page: ListedPage) -> ListedPage:
    """Return a copy of a page with sorted topics: first subscribed, then published ones, each by name."""
    topics = tuple(sorted(listed_page.page.topics, key=lambda each: (each.is_published, each.topic)))
    return dataclasses.replace(listed_page, page=dataclasses.replace(listed_page.page, topics=topics))
