"""Topics panel: all topics of the network, with statistics reported by their publishers."""

from __future__ import annotations

from typing import TYPE_CHECKING

from PySide6.QtCore import Qt, Signal
from PySide6.QtGui import QKeyEvent
from PySide6.QtWidgets import QVBoxLayout

from app.core.network.source import NODE_NAME
from app.core.network.topic_tree import TopicFolder, TopicTree, TreeRow, folders_above, topic_filter
from app.core.network.topics import split_key
from app.core.networks.networks import network_label
from app.ui.panels.base import Panel, PanelContext
from app.ui.panels.home import RowHome
from app.ui.panels.network_table import NetworkTable, are_own_nodes
from app.ui.panels.row_actions import RowAction, copy_action, show_messages, topic_actions
from app.ui.panels.table_panel import TableTexts
from app.ui.panels.watch.topics.columns import columns
from app.ui.text.numbers import group_digits
from app.ui.widgets import ElidedLabel, EmptyAction, IconButton
from app.ui.widgets.keyboard import has_no_modifiers
from app.ui.widgets.table.model import TableModel
from app.ui.widgets.table.view import TableView
from nep.i18n import _, format_list, lazy, ngettext

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from app.core.network.topics import Topic
    from app.core.networks.kinds import NetworkKind

FOOTER_TEXT = lazy("Rates are reported by the publishers; Studio subscribes only to the topics you open")
NETWORKS_FOOTER_TEXT = lazy(
    "Rates are reported by the publishers. {networks} report neither rates nor losses; Studio "
    "measures the topics you open there"
)
RECORDED_FOOTER_TEXT = lazy("Recorded values; ages are relative to the playhead")
TABLE_TEXTS = TableTexts(
    title=lazy("Topics"),
    filter=lazy("Filter topics"),
    no_matches=lazy("No matching topics"),
    clear_filter_hint=lazy("Clear the filter to see all topics."),
    not_recorded=lazy("The recording has no topics yet"),
)
STATS_UPDATE_TICKS = 6  # refreshes at 30 Hz; faster changes would be illegible
SORT_TICKS = 30
CHANGING_COLUMNS = frozenset({"rate", "bandwidth", "age", "loss"})
MAX_COLLAPSED_FOLDERS = 1000
"""Maximum number of collapsed folders to save in a layout."""


class TopicsTable(TableView[TreeRow]):
    """Table in which Left and Right collapse and expand folders.

    Signals:
        expand_requested: Key of a row, and True to expand it or False to collapse it.
    """

    expand_requested = Signal(str, bool)
    shows_folders = False
    """True while folders are shown; otherwise Left and Right have their default behaviour."""

    def keyPressEvent(self, event: QKeyEvent) -> None:
        key = self.selected_key() if self.shows_folders and has_no_modifiers(event) else None
        if event.key() in {Qt.Key.Key_Left, Qt.Key.Key_Right} and key is not None:
            self.is_keyboard_navigation = True
            self.expand_requested.emit(key, event.key() == Qt.Key.Key_Right)
        else:
            super().keyPressEvent(event)


class TopicsPanel(NetworkTable[TreeRow]):
    """Panel with the topics as table or tree, a filter, and a note about the source of the statistics."""

    def __init__(self, context: PanelContext) -> None:
        self._collapsed_keys: set[str] = set()
        self._tree: TopicTree | None = None
        super().__init__(context, TABLE_TEXTS, "radio-tower")
        self.tree_button = IconButton(
            self.theme, "list-tree", _("Group topics into folders by name"), checkable=True, size=26
        )
        self.tree_button.toggled.connect(lambda _on: self.rebuild())
        self.count_label = ElidedLabel("small", "textSecondary", min_width=60)
        self.header.insert(0, self.count_label)
        self.header.append(self.tree_button)
        column = QVBoxLayout(self)
        column.setContentsMargins(0, 0, 0, 0)
        column.setSpacing(0)
        parts = ((self.pages, 1), (self.networks, 0), (self.line, 0), (self.foot, 0), (self.doctor, 0))
        for widget, stretch in parts:
            column.addWidget(widget, stretch)
        self._last_snapshot: tuple[object, ...] = ()
        self._virtual_robots: tuple[str, ...] = ()
        self._ticks = 0
        self._requested_topic = ""

    def make_model(self) -> TableModel[TreeRow]:
        table_columns = columns(self._is_own, self.has_other_networks, lambda: self._tree is not None)
        return TableModel(table_columns, lambda row: row.key)

    def make_table(self, model: TableModel[TreeRow]) -> TableView[TreeRow]:
        self.topics_table = TopicsTable(self.theme, model, "topic")
        self.topics_table.expand_requested.connect(self._set_expanded)
        return self.topics_table

    def _is_own(self, topic: Topic) -> bool:
        # True for topics published by Studio or by virtual robots that it started.
        if topic.network:
            return are_own_nodes(topic.publisher_nodes)
        if not topic.publisher_nodes:
            return topic.name.startswith(tuple(f"/{robot}/" for robot in self._virtual_robots))
        return {*self._virtual_robots, NODE_NAME}.issuperset(topic.publisher_nodes)

    def refresh(self) -> None:
        self._ticks += 1
        state = self._snapshot()
        order = self.table.order.column
        is_sorted_by_stats = order is not None and order.name in CHANGING_COLUMNS
        if state != self._last_snapshot or (is_sorted_by_stats and self._ticks % SORT_TICKS == 0):
            self.rebuild()
        if self._ticks % STATS_UPDATE_TICKS == 0 and self.model.rowCount():
            if self._tree is not None:
                self._tree.invalidate_stats()
            self.table.refresh_visible()

    def _snapshot(self) -> tuple[object, ...]:
        topics, networks = self.world.topics, self.world.networks
        return topics.revision, len(topics), networks.revision, self.session.live.master.kind

    def source_changed(self) -> None:
        self._last_snapshot = ()

    def rebuild(self) -> None:
        self._last_snapshot = self._snapshot()
        topics = self.world.all_topics
        self._virtual_robots = self.session.launcher.virtual_robots
        keywords = self.filter_words()
        matches = topic_filter(keywords)
        rows = [topic for topic in topics if matches(topic.name, _haystack(topic))] if keywords else topics
        self._show_rows(rows, is_filtered=bool(keywords))
        if self._requested_topic:
            self.show_topic(self._requested_topic)
        self._update_counts(len(topics), len(rows) if keywords else None)
        self.show_table(bool(rows), bool(keywords))
        self.show_networks()
        kinds = [network.kind for network in self.world.networks.selected_networks]
        self.foot.setText(_footer_text(kinds) if self.world.is_live else _(RECORDED_FOOTER_TEXT))
        self.foot.setVisible(bool(rows))
        self.line.setVisible(bool(rows))

    def _show_rows(self, topics: list[Topic], *, is_filtered: bool) -> None:
        # Folders are never collapsed while a filter is active.
        was_tree = self._tree is not None
        self.topics_table.shows_folders = self.tree_button.isChecked()
        if self.tree_button.isChecked():
            self._tree = TopicTree(topics, () if is_filtered else self._collapsed_keys)
            self.model.set_rows(self._tree.rows(self.table.order.sort))
        else:
            self._tree = None
            self.model.set_rows(self.table.order.sort([*topics]))
        if was_tree or self._tree is not None:
            self.table.refresh_visible()  # names of topics are formatted differently in a tree

    def _update_counts(self, total: int, match_count: int | None) -> None:
        nodes = len(self.world.networks.nodes)
        if self.world.graph is not None:
            nodes += len(self.world.graph.nodes)
        if match_count is None:
            text = ngettext("{count} topic", "{count} topics", total)
        else:
            text = ngettext("{found} of {count} topic", "{found} of {count} topics", total)
        text = text.format(count=group_digits(total), found=match_count)
        if nodes:
            node_text = ngettext("{count} node", "{count} nodes", nodes).format(count=group_digits(nodes))
            text = _("{topics}, {nodes}").format(topics=text, nodes=node_text)
        self.count_label.setText(text if total else "")
        self.filter.setVisible(total > 0)

    def update_empty_state(self) -> None:
        if self.session.live.master.kind == "searching":
            text = _("Address: {address}").format(address=self.session.live.master.address)
            self.empty.set_texts(_("Searching for a master"), text, "radio-tower")
            self.empty.set_actions([])
        else:
            self.empty.set_texts(
                _("No topics yet"), _("Topics appear as soon as a program publishes."), "list"
            )
            self.empty.set_actions(
                [EmptyAction(_("Use the virtual robot"), self._start_virtual_robot, "bot", is_primary=True)]
            )

    def missing_topic(self) -> str:
        filter_text = self.filter.text().strip()
        return filter_text if filter_text.startswith("/") and len(filter_text.split()) == 1 else ""

    def _start_virtual_robot(self) -> None:
        self.context.run("robots.virtual")

    def open_row(self, key: str) -> None:
        if self._folder(key) is not None:
            self._set_expanded(key, None)
        else:
            show_messages(self.context, key)

    def _folder(self, key: str) -> TopicFolder | None:
        return self._tree[key] if self._tree is not None and key in self._tree else None

    def _set_expanded(self, key: str, is_open: bool | None) -> None:
        # None toggles the folder. Left on a topic or a collapsed folder selects the parent folder.
        folder = self._folder(key)
        if folder is None or (is_open is False and not folder.is_expanded):
            if is_open is False:
                self._select_parent(key)
            return
        if is_open is None:
            is_open = not folder.is_expanded
        if is_open:
            self._collapsed_keys.discard(key)
        elif len(self._collapsed_keys) < MAX_COLLAPSED_FOLDERS and not self.filter_words():
            self._collapsed_keys.add(key)
        self.rebuild()
        self.table.select_key(key)

    def _select_parent(self, key: str) -> None:
        network, name = split_key(key)
        parent_keys = folders_above(name.removesuffix("/*"), network)
        if self._tree is not None and parent_keys:
            self.table.select_key(parent_keys[-1])

    def _set_all_expanded(self, *, is_open: bool) -> None:
        self._collapsed_keys.clear()
        if not is_open and self._tree is not None:
            self._collapsed_keys.update(folder.key for folder in list(self._tree)[:MAX_COLLAPSED_FOLDERS])
        self.rebuild()

    def row_actions(self, key: str) -> Sequence[RowAction]:
        folder = self._folder(key)
        if folder is None:
            return topic_actions(self.context, key)
        toggle_label = _("Collapse the folder") if folder.is_expanded else _("Expand the folder")
        return (
            RowAction(
                toggle_label,
                "chevron-right" if folder.is_expanded else "chevron-down",
                lambda: self.open_row(key),
            ),
            RowAction(_("Expand all folders"), "list-tree", lambda: self._set_all_expanded(is_open=True)),
            RowAction(_("Collapse all folders"), "list", lambda: self._set_all_expanded(is_open=False)),
            copy_action(self.context, split_key(key)[1]),
        )

    def show_topic(self, name: str) -> None:
        if self._tree is not None and not self._collapsed_keys.isdisjoint(
            parent_keys := folders_above(*split_key(name)[::-1])
        ):
            self._collapsed_keys.difference_update(parent_keys)
            self._requested_topic = ""
            self.rebuild()
        self._requested_topic = (
            "" if self.model.index_of(name).isValid() else name
        )  # selected when its row appears
        self.table.select_key(name)

    def save_state(self) -> dict[str, object]:
        return {
            **super().save_state(),
            "tree": self.tree_button.isChecked(),
            "closed": sorted(self._collapsed_keys),
        }

    def restore_state(self, state: Mapping[str, object]) -> None:
        saved_keys = state.get("closed")
        collapsed_keys = saved_keys if isinstance(saved_keys, list) else []
        self._collapsed_keys = {key for key in collapsed_keys[:MAX_COLLAPSED_FOLDERS] if isinstance(key, str)}
        self.tree_button.setChecked(state.get("tree") is True)
        super().restore_state(state)


def _footer_text(kinds: Sequence[NetworkKind]) -> str:
    # Note about the source of the statistics.
    silent_networks = [kind.product_name for kind in kinds if not kind.reports_stats]
    if not silent_networks:
        return _(FOOTER_TEXT)
    return _(NETWORKS_FOOTER_TEXT).format(networks=format_list(silent_networks))


def _haystack(topic: Topic) -> str:
    parts = (network_label(topic.network), topic.name, topic.msg_type, *topic.publisher_nodes)
    return " ".join(parts)


PANEL = Panel("topics", TABLE_TEXTS.title, "list", (), TopicsPanel, home=(RowHome("developer", 0, 0, 780),))
